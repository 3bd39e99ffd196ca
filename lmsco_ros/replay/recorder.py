# Copyright 2026 lmsco_ros contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What a camera and its tracker say now, into a new bag: for the page and for the command."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
import contextlib
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonInstanceStamped, PolygonStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.interfaces import Connection
from rosbags.typesys import get_typestore, Stores
from sensor_msgs.msg import CompressedImage, Image

from lmsco_ros.replay.bags.output import BagOutput
from lmsco_ros.replay.bags.uninterrupted import uninterrupted
from lmsco_ros.replay.errors import OutputError
from lmsco_ros.replay.storage import Storage

OUTPUTS: Mapping[str, type] = {
    'status': DiagnosticArray, 'box': PolygonStamped, 'boxes': PolygonInstanceStamped,
    'state': Odometry}
"""What is recorded of a tracker, by the name of the topic below that of the node."""
# A second of images: the disk may be slow for a moment.
_IMAGE_DEPTH = 30
_DEPTH = 100


def live_topics(images: str, tracker: str, *, compressed: bool = False) -> dict[str, type]:
    """
    Return the topics of a camera and its tracker with the types of their messages.

    Parameters
    ----------
    images : str
        Name of the topic of the images, as it is.
    tracker : str
        Name of the node of the tracker.
    compressed : bool
        Whether the images are sensor_msgs/CompressedImage.

    """
    outputs = {f'{tracker}/{name}': kind for name, kind in OUTPUTS.items()}
    return {images: CompressedImage if compressed else Image, **outputs}


class Recorder:
    """
    Writes topics into new MCAP bags, one after the other.

    All calls come from the thread of the executor.

    Parameters
    ----------
    node : Node
        Listens.
    topics : mapping of str to type
        What is recorded, and the type of its messages.
    failed : callable
        Called with the error when a recording cannot go on; nothing of it is kept then.

    """

    def __init__(self, node: Node, topics: Mapping[str, type],
                 failed: Callable[[OutputError], object]) -> None:
        self._node = node
        self._topics = topics
        self._failed = failed
        self._made = contextlib.ExitStack()
        self._counts: Counter[str] | None = None

    @property
    def counts(self) -> Counter[str] | None:
        """Messages written so far, by the full names of topics; None while nothing is."""
        return self._counts

    @property
    def count(self) -> int | None:
        """Messages written so far; None while nothing is recorded."""
        return None if self._counts is None else self._counts.total()

    def start(self, path: Path) -> None:
        """
        Begin a new bag.

        Parameters
        ----------
        path : Path
            Its folder, which must not exist; those above it are made.

        Raises
        ------
        OutputError
            When it cannot be written, or something is recorded already.

        """
        if self._counts is not None:
            raise OutputError('something is recorded already; end that first')
        store = get_typestore(Stores.ROS2_JAZZY)
        with contextlib.ExitStack() as made:
            output = made.enter_context(BagOutput(path, Storage.MCAP))
            counts = Counter({self._node.resolve_topic_name(topic): 0 for topic in self._topics})
            for name, (topic, kind) in zip(counts, self._topics.items()):
                connection = output.add_connection(
                    name, f'{kind.__module__.split(".")[0]}/msg/{kind.__name__}',
                    typestore=store)
                made.callback(self._node.destroy_subscription, self._node.create_subscription(
                    kind, topic, self._writer(output, connection), _qos(kind), raw=True))
            output.keep_from_now_on()
            self._made = made.pop_all()
        self._counts = counts

    def stop(self) -> int:
        """
        Finish the bag, and return how many messages are in it; 0 when nothing was recorded.

        Raises
        ------
        OutputError
            When it cannot be finished.

        """
        counts, self._counts = self._counts, None
        self._made.close()
        return 0 if counts is None else counts.total()

    def _writer(self, output: BagOutput, connection: Connection) -> Callable[[bytes], None]:
        def take(data: bytes) -> None:
            if self._counts is None:
                return
            try:
                # What is in the bag is counted, whenever a signal comes.
                with uninterrupted():
                    output.write(connection, self._node.get_clock().now().nanoseconds, data)
                    self._counts[connection.topic] += 1
            except OutputError as error:
                self._give_up(error)
        return take

    def _give_up(self, error: OutputError) -> None:
        """End a recording that cannot go on."""
        self._counts = None
        # The bag learns of the error, and removes what is half written.
        self._made.__exit__(type(error), error, error.__traceback__)
        self._failed(error)


def _qos(kind: type) -> QoSProfile | int:
    """Return a profile that hears every camera, and misses nothing of the tracker."""
    if kind in (Image, CompressedImage):
        return QoSProfile(depth=_IMAGE_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
    return _DEPTH

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

"""What the camera and the tracker say, written into a bag while somebody wants it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import contextlib
from datetime import datetime
from pathlib import Path

from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data, QoSProfile

from lmsco_ros.replay.errors import OutputError
from lmsco_ros.replay.storage import Storage

_DEPTH = 100


class Recorder:
    """
    Writes topics into new MCAP bags of a folder, one for each recording.

    All calls come from the thread of the executor.

    Parameters
    ----------
    node : Node
        Listens.
    folder : Path
        Gets the bags; made when it is not there.
    topics : mapping of str to type
        What is recorded, and the type of its messages.

    """

    def __init__(self, node: Node, folder: Path, topics: Mapping[str, type]) -> None:
        self._node = node
        self._folder = folder
        self._topics = topics
        self._made = contextlib.ExitStack()
        self._count: int | None = None

    @property
    def count(self) -> int | None:
        """Messages written so far; None while nothing is recorded."""
        return self._count

    def start(self) -> str:
        """
        Begin a new bag, and say where.

        Raises
        ------
        OutputError
            When it cannot be written.

        """
        from rosbags.typesys import get_typestore, Stores

        from lmsco_ros.replay.bags.output import BagOutput

        if self._count is not None:
            return 'it is recorded already'
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f'{self._folder} cannot be made: {error.strerror}') from error
        path = self._folder / datetime.now().strftime('recording_%Y%m%d_%H%M%S_%f')
        store = get_typestore(Stores.ROS2_JAZZY)
        with contextlib.ExitStack() as made:
            output = made.enter_context(BagOutput(path, Storage.MCAP))
            output.keep_from_now_on()
            for topic, kind in self._topics.items():
                name = self._node.resolve_topic_name(topic)
                connection = output.add_connection(
                    name, f'{kind.__module__.split(".")[0]}/msg/{kind.__name__}',
                    typestore=store)
                made.callback(self._node.destroy_subscription, self._node.create_subscription(
                    kind, topic, self._writer(output.write, connection), _qos(kind), raw=True))
            self._made = made.pop_all()
        self._count = 0
        return f'recording into {path}'

    def stop(self) -> str:
        """
        Finish the bag, and say what is in it.

        Raises
        ------
        OutputError
            When it cannot be finished.

        """
        if self._count is None:
            return 'nothing was recorded'
        count, self._count = self._count, None
        self._made.close()
        return f'{count} messages were recorded'

    def _writer(self, write: Callable, connection: object) -> Callable[[bytes], None]:
        def take(data: bytes) -> None:
            if self._count is None:
                return
            try:
                write(connection, self._node.get_clock().now().nanoseconds, data)
            except OutputError as error:
                self._node.get_logger().error(f'the recording ends: {error}')
                self._give_up()
            else:
                self._count += 1
        return take

    def _give_up(self) -> None:
        """End a recording that cannot go on; what was written is kept as far as possible."""
        try:
            self.stop()
        except OutputError as error:
            self._node.get_logger().error(str(error))


def _qos(kind: type) -> QoSProfile | int:
    """Return a profile that hears every camera, and misses nothing of the tracker."""
    return qos_profile_sensor_data if kind.__name__.endswith('Image') else _DEPTH

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


"""What the node says about every frame; pictures only when somebody listens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import contextlib
import time

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonInstanceStamped, PolygonStamped
import numpy.typing as npt
from rclpy.lifecycle import LifecycleNode
from rclpy.lifecycle.publisher import LifecyclePublisher
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header
from visualization_msgs.msg import ImageMarker

from lmsco_ros.core.types import TrackResult, TrackState
from lmsco_ros.node.diagnostics import frame_statuses, Readings
from lmsco_ros.node.outcome import Outcome
from lmsco_ros.node.parameters import Settings
from lmsco_ros.node.state_outputs import StateOutputs
from lmsco_ros.node.target_temperature import celsius, target_reading
from lmsco_ros.visualization.display_range import DisplayRange
from lmsco_ros.visualization.overlay import draw_targets, state_color
from msg_adapters.annotations import (
    Annotated, annotations_available, annotations_from_boxes)
from msg_adapters.boxes import (
    detections_available, detections_from_boxes, instance_from_box, polygon_from_box, Tracked)
from msg_adapters.compressed import compressed_from_image
from msg_adapters.confidence import message_from_confidence
from msg_adapters.image import message_from_image
from msg_adapters.markers import marker_from_box, marker_removal
from msg_adapters.status import FrameStatus, message_from_statuses

# Messages that are kept for who cannot take them at once; so many for each target where one speaks
# of one target.
_DEPTH = 10


class Outputs:
    """
    Publishers of a configured node; silent until it is active.

    Parameters
    ----------
    node : LifecycleNode
        Owner of the publishers.
    settings : Settings
        How pictures are drawn and counts are told; may be replaced while running.

    Attributes
    ----------
    states : StateOutputs
        What a robot steers by.

    """

    def __init__(self, node: LifecycleNode, settings: Settings) -> None:
        self.settings = settings
        self._node = node
        self._display_range = DisplayRange()
        self._frames = 0
        self._outlined: set[int] = set()
        each = _DEPTH * settings.max_targets
        with contextlib.ExitStack() as made:
            self._box = self._publisher(PolygonStamped, 'box', made)
            self._boxes = self._publisher(PolygonInstanceStamped, 'boxes', made, each)
            self.states = StateOutputs(lambda kind, name: self._publisher(
                kind, name, made, each), node.get_logger().warning)
            self._status = self._publisher(DiagnosticArray, 'status', made)
            self._confidence = self._publisher(Image, 'confidence_map', made)
            self._overlay = self._publisher(Image, 'overlay', made)
            self._small_overlay = self._publisher(CompressedImage, 'overlay/compressed', made)
            self._marker = self._publisher(ImageMarker, 'marker', made, each)
            self._detections = self._detections_publisher(made)
            self._annotations = self._annotations_publisher(made)
            self._made = made.pop_all()

    def publish(self, outcome: Outcome, dropped_frames: int) -> float:
        """
        Say everything about one frame, what others wait for first.

        Returns
        -------
        float
            When the box was published, on the clock of `time.monotonic`.

        """
        header, crop = outcome.frame.context, self.settings.crop
        results = {number: crop.outwards(result) for number, result in outcome.results.items()}
        found = {number: result for number, result in results.items()
                 if result.state is not TrackState.LOST}
        result = results.get(outcome.track_id)
        if outcome.track_id in found:
            self._box.publish(polygon_from_box(found[outcome.track_id].box.as_tuple(), header))
        for number, each in found.items():
            self._boxes.publish(instance_from_box(each.box.as_tuple(), number, header))
        if outcome.image is not None:
            height, width = crop.full_shape(outcome.image)
            self.states.publish(results, outcome.track_id, (width, height), header)
        published = time.monotonic()
        self.publish_statuses(frame_statuses(
            outcome, dropped_frames, published,
            lambda result: self._readings(outcome.image, result)), header)
        if self._detections is not None and _is_heard(self._detections):
            self._detections.publish(detections_from_boxes(
                [Tracked(each.box.as_tuple(), str(number), each.score)
                 for number, each in found.items()], header))
        if _is_heard(self._marker):
            self._publish_outlines(outcome, found, header)
        # They take the place of all before; late frames tell of one target alone.
        if self._annotations is not None and outcome.live and _is_heard(self._annotations):
            self._annotations.publish(annotations_from_boxes(
                [_annotated(number, each) for number, each in found.items()],
                line_width=self.settings.marker_line_width, header=header))
        if result is not None and outcome.image is not None and _is_heard(self._confidence):
            self._confidence.publish(message_from_confidence(
                result.confidence_map, result.search_region.as_tuple(),
                crop.full_shape(outcome.image), header))
        if outcome.image is not None and (
                _is_heard(self._overlay) or _is_heard(self._small_overlay)):
            self._publish_overlay(outcome.image, results, outcome.track_id, header)
        return published

    def publish_statuses(self, statuses: Sequence[FrameStatus], header: Header) -> None:
        """Say how things are with one frame."""
        self._status.publish(message_from_statuses(statuses, self._node.get_name(), header))

    def close(self) -> None:
        """Take the topics away."""
        self._made.close()

    def _publisher(self, message_type: type, name: str, made: contextlib.ExitStack,
                   depth: int = _DEPTH) -> LifecyclePublisher:
        """Make a publisher, which keeps so many messages, that goes away with the others."""
        publisher = self._node.create_lifecycle_publisher(message_type, f'~/{name}', depth)
        made.callback(self._node.destroy_lifecycle_publisher, publisher)
        return publisher

    def _detections_publisher(self, made: contextlib.ExitStack) -> LifecyclePublisher | None:
        if not detections_available():
            return None
        from vision_msgs.msg import Detection2DArray
        return self._publisher(Detection2DArray, 'detections', made)

    def _annotations_publisher(self, made: contextlib.ExitStack) -> LifecyclePublisher | None:
        if not annotations_available():
            return None
        from foxglove_msgs.msg import ImageAnnotations
        return self._publisher(ImageAnnotations, 'annotations', made)

    def _publish_outlines(self, outcome: Outcome, found: Mapping[int, TrackResult],
                          header: Header) -> None:
        """Outline every target that is seen, and take away the outlines of the others."""
        # Of frames that one target goes through late nothing is said of the others.
        asked = self._outlined if outcome.live else set(outcome.results)
        gone = asked - set(found)
        namespace = self._node.get_name()
        for number in gone:
            self._marker.publish(marker_removal(
                namespace=namespace, marker_id=number, header=header))
        for number, result in found.items():
            self._marker.publish(marker_from_box(
                result.box.as_tuple(), _rgb(result), namespace=namespace, marker_id=number,
                line_width=self.settings.marker_line_width, header=header))
        self._outlined = self._outlined - gone | set(found)

    def _readings(self, image: npt.NDArray | None, result: TrackResult) -> Readings:
        """Return what is counted under a box of the image that the tracker sees."""
        reading = None if image is None else target_reading(image, result.box.as_tuple())
        settings = self.settings
        return Readings(reading, celsius(
            reading, settings.radiometric_scale, settings.radiometric_offset))

    def _publish_overlay(self, image: npt.NDArray, results: Mapping[int, TrackResult],
                         selected: int, header: Header) -> None:
        self._frames += 1
        if self._frames % self.settings.overlay_interval:
            return
        view = self.settings.crop.fill(self._display_range.apply(image))
        picture = draw_targets(view, results, selected, label=self.settings.overlay_label)
        if _is_heard(self._overlay):
            self._overlay.publish(message_from_image(picture, encoding='bgr8', header=header))
        if _is_heard(self._small_overlay):
            self._small_overlay.publish(
                compressed_from_image(picture, codec='jpeg', header=header))


def _annotated(number: int, found: TrackResult) -> Annotated:
    return Annotated(found.box.as_tuple(),
                     f'{number} {found.state.name.lower()} {found.score:.2f}', _rgb(found))


def _rgb(found: TrackResult) -> tuple[float, float, float]:
    blue, green, red = (value / 255 for value in state_color(found.state))
    return red, green, blue


def _is_heard(publisher: LifecyclePublisher) -> bool:
    return publisher.get_subscription_count() > 0

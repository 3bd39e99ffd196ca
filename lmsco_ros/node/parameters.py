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

"""
Parameters of the node: one table of names, defaults, descriptions and limits.

:class:`Settings` is that table; it is declared, checked and read from here only.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, Field, field, fields
from typing import Any

from rcl_interfaces.msg import (FloatingPointRange, IntegerRange, ParameterDescriptor,
                                SetParametersResult)
from rclpy.exceptions import InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from lmsco_ros.node.crop import Crop
from lmsco_ros.node.detection_policy import DetectionPolicy
from msg_adapters.compressed import DecodingLimits


def _setting(default: Any, description: str, *, limits: tuple[float, float] | None = None,
             choices: tuple[str, ...] = (), live: bool = False, fixed: bool = False) -> Any:
    """
    Return the field of one parameter.

    Parameters
    ----------
    default : bool, int, float or str
        Its type is the type of the parameter.
    description : str
        What it does, with its unit.
    limits : (lowest, highest), optional
        Of a number, both allowed.
    choices : tuple of str
        Allowed values of a string; empty allows any.
    live : bool
        Whether a change takes effect at once, rather than when the node is configured.
    fixed : bool
        Whether only the start of the node can set it, and nobody in the graph.

    """
    return field(default=default, metadata={
        'description': description, 'limits': limits, 'choices': choices, 'live': live,
        'fixed': fixed})


@dataclass(frozen=True)
class Settings:
    """Values of all parameters."""

    autostart: bool = _setting(
        True, 'Configure and activate the node when it starts; otherwise do it by lifecycle '
        'transitions. Only at the start.', fixed=True)
    preset: str = _setting(
        'default', 'Named tracker configuration; an unknown name is answered with the known.')
    tracker_config: str = _setting(
        '', 'YAML file with a tracker configuration, in place of the preset; it may name a '
        'preset itself and change single values. Empty: use the preset. Only at the start, so '
        'that no file is opened for a message.', fixed=True)
    device: str = _setting(
        '', 'Where the tracker computes: cpu, cuda or cuda:N. Empty: as the tracker '
        'configuration says.')
    threads: int = _setting(
        0, 'Threads of the numerical libraries; more than cores to spare starve the '
        'reception of images. 0: as the tracker configuration says.', limits=(0, 256))
    max_targets: int = _setting(
        1, 'Targets that are followed at once. A start beyond it takes the place of the one that '
        'is lost for the longest time, or of the selected one where none is lost: with 1, every '
        'start replaces the one before.', limits=(1, 64))
    drop_after: float = _setting(
        0.0, 'Seconds, by the stamps of the images, after which a lost target is dropped. 0: it '
        'is searched for until it is found again.', limits=(0.0, 86400.0))
    detection_choice: str = _setting(
        'highest_score', 'On which of the boxes of init_detections to start where several fit: '
        'highest_score, or nearest_to_center of the image.',
        choices=('highest_score', 'nearest_to_center'))
    detection_classes: str = _setting(
        '', 'Classes of init_detections to start on, separated by commas. Empty: any.')
    detection_min_score: float = _setting(
        0.5, 'Score from which a box of init_detections is one to start on.', limits=(0.0, 1.0))
    detection_restart: bool = _setting(
        True, 'Whether a box of init_detections takes the place of a target that is lost; '
        'otherwise only a free place is taken.')
    image_transport: str = _setting(
        'raw', 'raw: sensor_msgs/Image on image_raw; compressed: sensor_msgs/CompressedImage '
        '(jpeg, png) on image_raw/compressed.', choices=('raw', 'compressed'))
    image_reliability: str = _setting(
        'best_effort', 'Reliability of the image subscription; best_effort hears every '
        'camera, reliable only reliable ones.',
        choices=('best_effort', 'reliable', 'system_default'))
    image_depth: int = _setting(
        5, 'Images that the middleware keeps for the node; 0 keeps all (with reliable and '
        'frame_policy all: the camera waits).', limits=(0, 1000))
    frame_policy: str = _setting(
        'latest', 'When images come faster than they are tracked: latest drops the older '
        'ones, all keeps up to queue_size and then leaves them to the middleware.',
        choices=('latest', 'all'))
    queue_size: int = _setting(
        30, 'Images that wait for the tracker with frame_policy all.', limits=(1, 10000))
    frame_history_seconds: float = _setting(
        2.0, 'How long images are kept for init_box_stamped, in seconds.', limits=(0.0, 60.0))
    frame_history_frames: int = _setting(
        64, 'At most this many images are kept for init_box_stamped.', limits=(1, 10000))
    frame_history_megabytes: int = _setting(
        256, 'At most so much memory holds images for init_box_stamped, as they were received, '
        'in megabytes.', limits=(1, 1000000))
    max_image_pixels: int = _setting(
        2 ** 26, 'Compressed images of more pixels are refused before they are decoded.',
        limits=(1, 2 ** 30))
    max_jpeg_scans: int = _setting(
        100, 'Jpeg images of more scans are refused before they are decoded; each scan of a '
        'progressive one costs as much as an image.', limits=(1, 100000))
    crop_left: int = _setting(
        0, 'Columns at the left edge of the image that the tracker does not see; boxes stay in '
        'pixels of the full image.', limits=(0, 10000))
    crop_top: int = _setting(
        0, 'Rows at the top edge that the tracker does not see, such as telemetry.',
        limits=(0, 10000))
    crop_right: int = _setting(
        0, 'Columns at the right edge that the tracker does not see.', limits=(0, 10000))
    crop_bottom: int = _setting(
        0, 'Rows at the bottom edge that the tracker does not see, such as telemetry.',
        limits=(0, 10000))
    no_image_timeout: float = _setting(
        3.0, 'Seconds without an image after which /diagnostics turns stale and names the '
        'likely causes.', limits=(0.1, 3600.0), live=True)
    radiometric_scale: float = _setting(
        0.0, 'Degrees Celsius for one unit of the image, 0.01 for centikelvin; ~/status then '
        'gives the temperature of the target. 0: the image is not radiometric.',
        limits=(0.0, 1000.0), live=True)
    radiometric_offset: float = _setting(
        0.0, 'Degrees Celsius at the image value 0, -273.15 for kelvin and centikelvin.',
        limits=(-10000.0, 10000.0), live=True)
    overlay_interval: int = _setting(
        1, 'Publish ~/overlay for every n-th image, to save bandwidth.', limits=(1, 1000),
        live=True)
    overlay_label: str = _setting(
        '', 'Text in the lower left corner of ~/overlay.', live=True)
    marker_line_width: float = _setting(
        2.0, 'Width of the outline in ~/marker, in pixels.', limits=(0.1, 100.0), live=True)

    @property
    def decoding_limits(self) -> DecodingLimits:
        """What it may cost to decode a compressed image."""
        return DecodingLimits(self.max_image_pixels, self.max_jpeg_scans)

    @property
    def detection_policy(self) -> DetectionPolicy:
        """On which of the boxes of a detector to start."""
        names = (name.strip() for name in self.detection_classes.split(','))
        return DetectionPolicy(self.detection_choice, frozenset(filter(None, names)),
                               self.detection_min_score, self.detection_restart,
                               self.max_targets)

    @property
    def crop(self) -> Crop:
        """The edges of the image that are cut off."""
        return Crop(self.crop_left, self.crop_top, self.crop_right, self.crop_bottom)


LIVE = frozenset(item.name for item in fields(Settings) if item.metadata['live'])


def declare(node: Node) -> Settings:
    """
    Declare all parameters and return their values.

    Raises
    ------
    rclpy.exceptions.ParameterException
        When a value that was given at the start has a wrong type, is out of range or is
        none of the choices.

    """
    for item in fields(Settings):
        parameter = node.declare_parameter(item.name, item.default, _descriptor(item))
        reason = _problem(parameter)
        if reason:
            raise InvalidParameterValueException(item.name, parameter.value, reason)
    return read(node)


def read(node: Node) -> Settings:
    """Return the present values."""
    return Settings(**{item.name: node.get_parameter(item.name).value
                       for item in fields(Settings)})


def judge_change(changes: Iterable[Parameter], *, configured: bool) -> SetParametersResult:
    """
    Decide whether parameters may change now; types and ranges have been checked before.

    Parameters
    ----------
    changes : iterable of Parameter
        What is about to be set, together.
    configured : bool
        Whether the node holds what it made of the parameters.

    """
    for parameter in changes:
        reason = _problem(parameter)
        if not reason and configured and _is_ours(parameter) and parameter.name not in LIVE:
            reason = (f'{parameter.name} is read when the node is configured; deactivate and '
                      'clean up the node, set it, then configure and activate again')
        if reason:
            return SetParametersResult(successful=False, reason=reason)
    return SetParametersResult(successful=True)


def _is_ours(parameter: Parameter) -> bool:
    return parameter.name in {item.name for item in fields(Settings)}


def _problem(parameter: Parameter) -> str:
    """Say why the value is none of the choices; empty when it is."""
    choices = next((item.metadata['choices'] for item in fields(Settings)
                    if item.name == parameter.name), ())
    if choices and parameter.value not in choices:
        return f'"{parameter.value}" is unknown; expected one of {", ".join(choices)}'
    return ''


def _descriptor(item: Field) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        description=item.metadata['description'],
        read_only=item.metadata['fixed'],
        additional_constraints=', '.join(item.metadata['choices']))
    if item.metadata['limits'] is not None:
        lowest, highest = item.metadata['limits']
        if isinstance(item.default, int):
            descriptor.integer_range = [IntegerRange(from_value=lowest, to_value=highest, step=1)]
        else:
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=lowest, to_value=highest)]
    return descriptor

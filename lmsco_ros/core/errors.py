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

"""Errors of the tracker core: what was wrong, what was expected, what to do."""


class LMSCOError(ValueError):
    """Base of every error that the core raises on bad input."""


class ImageError(LMSCOError):
    """The image has a shape, a type or a content that cannot be tracked in."""


class BoxError(LMSCOError):
    """The box is degenerate, too small to learn from, or not in the image."""


class PointError(LMSCOError):
    """The point is not in the image, or nothing stands out from its surroundings there."""


class TimeError(LMSCOError):
    """The time of a frame is no number, or is given for some frames only."""


class ConfigError(LMSCOError):
    """A configuration key is unknown or its value is out of range."""


class NotInitializedError(LMSCOError):
    """`update` was called before `initialize`."""


class UnknownTargetError(LMSCOError):
    """There is no target of that number."""


class BusyError(LMSCOError):
    """A tracker was called while another call, of a second thread, was at work in it."""


class WeightsError(LMSCOError):
    """Weights of a network are missing, damaged, or those of another network."""

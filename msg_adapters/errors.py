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

"""Errors of the adapters: what was wrong, what was expected, what to do."""


class MessageError(ValueError):
    """A message, or a value meant for one, does not hold what it claims to."""


class ImageMessageError(MessageError):
    """The image has an encoding, a layout or an amount of data that cannot be read."""


class BoxMessageError(MessageError):
    """The box or point is empty, not finite, or cannot be expressed in the message."""


class StatusMessageError(MessageError):
    """The diagnostic message is not one that this package wrote."""


class StateMessageError(MessageError):
    """The state has a number that is not finite, or the odometry is not that of a target."""


class CameraInfoError(MessageError):
    """The camera is not calibrated, or its model cannot be used."""

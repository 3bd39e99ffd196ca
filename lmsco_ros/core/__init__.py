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

"""LMSCO tracker core: plain Python, no ROS."""

from lmsco_ros.core.config import TrackerConfig
from lmsco_ros.core.errors import (
    BoxError, BusyError, ConfigError, ImageError, LMSCOError, NotInitializedError, PointError,
    TimeError, UnknownTargetError, WeightsError)
from lmsco_ros.core.tracker import LMSCOTracker, MultiTracker
from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState

__all__ = [
    'BoundingBox', 'BoxError', 'BusyError', 'ConfigError', 'ImageError', 'LMSCOError',
    'LMSCOTracker', 'MultiTracker', 'NotInitializedError', 'PointError', 'TimeError',
    'TrackerConfig', 'TrackResult', 'TrackState', 'UnknownTargetError', 'WeightsError',
]

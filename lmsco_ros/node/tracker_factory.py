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

"""From the node's parameters to a tracker."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from lmsco_ros.core import MultiTracker, TrackerConfig
from lmsco_ros.node.gpu_fallback import FallbackTracker
from lmsco_ros.node.outcome import Tracker
from lmsco_ros.node.parameters import Settings


def tracker_config(settings: Settings) -> TrackerConfig:
    """
    Return the tracker configuration that the parameters describe.

    Raises
    ------
    ConfigError
        When the preset is unknown, or the file cannot be read or holds wrong values.

    """
    if settings.tracker_config:
        config = TrackerConfig.from_yaml(settings.tracker_config)
    else:
        config = TrackerConfig.preset(settings.preset)
    runtime = config.runtime
    return replace(config, runtime=replace(
        runtime, device=settings.device or runtime.device,
        threads=settings.threads or runtime.threads))


def make_tracker(settings: Settings) -> MultiTracker:
    """Return a tracker as the parameters describe it; raises as :func:`tracker_config`."""
    return MultiTracker(tracker_config(settings))


def with_fallback(factory: Callable[[Settings], Tracker], settings: Settings,
                  warn: Callable[[str], None]) -> FallbackTracker:
    """
    Return the tracker of a factory that may retreat from the GPU to the processor.

    Parameters
    ----------
    factory : callable
        Makes a tracker from the parameters.
    settings : Settings
        The parameters.
    warn : callable
        Called with the reason of a retreat.

    """
    device = settings.device or tracker_config(settings).runtime.device
    return FallbackTracker(lambda device: factory(replace(settings, device=device)), device, warn)

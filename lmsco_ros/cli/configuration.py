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

"""The tracker configuration that a command asks for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lmsco_ros.core import TrackerConfig


def requested_config(preset: str, path: Path | None = None) -> TrackerConfig:
    """
    Return the configuration in `path`, or without one the preset.

    Raises
    ------
    ConfigError
        When the preset is unknown or the file holds wrong values.

    """
    from lmsco_ros.core import TrackerConfig

    return TrackerConfig.from_yaml(path) if path else TrackerConfig.preset(preset)


def node_parameters(preset: str, path: Path | None = None) -> dict[str, str]:
    """Return the parameters that tell the node to use the configuration of `requested_config`."""
    return {'preset': preset, 'tracker_config': str(path.resolve()) if path else ''}

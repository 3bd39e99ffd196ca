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

"""The trackers of this package: presets, and configurations in files."""

from __future__ import annotations

from dataclasses import dataclass
import json
from pathlib import Path

import numpy.typing as npt

from lmsco_ros.core import BoundingBox, LMSCOError, LMSCOTracker, TrackerConfig
from lmsco_ros.evaluation.errors import TrackerError
from lmsco_ros.evaluation.trackers.code_version import core_version
from lmsco_ros.evaluation.trackers.interface import Answer


class ConfiguredTracker:
    """
    `LMSCOTracker` behind the interface of the evaluation.

    Parameters
    ----------
    config : TrackerConfig
        Settings of the tracker.

    """

    in_process = True

    def __init__(self, config: TrackerConfig) -> None:
        """Build the tracker."""
        self._tracker = LMSCOTracker(config)

    def initialize(self, image: npt.NDArray, box: BoundingBox) -> None:
        """Start on `box`."""
        self._tracker.reset()
        self._tracker.initialize(image, box)

    def update(self, image: npt.NDArray) -> Answer:
        """Track into `image`."""
        result = self._tracker.update(image)
        return Answer(result.box, result.score, result.state, result.predicted_box,
                      result.covariance)

    def close(self) -> None:
        """Release nothing; all memory is Python's."""


@dataclass(frozen=True)
class ConfiguredSpec:
    """
    A configuration and what it is called.

    Attributes
    ----------
    name : str
        Of the preset, or of the file without its suffix.
    config : TrackerConfig
        All settings.

    """

    name: str
    config: TrackerConfig

    @classmethod
    def from_file(cls, path: Path) -> ConfiguredSpec:
        """Return the configuration in a YAML file; raise `ConfigError` where it holds none."""
        return cls(path.stem, TrackerConfig.from_yaml(path))

    @property
    def identity(self) -> str:
        """All settings and the version of the core."""
        settings = json.dumps(self.config.to_dict(), sort_keys=True, default=str)
        return f'{core_version()} {settings}'

    def build(self) -> ConfiguredTracker:
        """Return a tracker, or raise `TrackerError` saying what it lacks here."""
        try:
            return ConfiguredTracker(self.config)
        except LMSCOError as error:
            raise TrackerError(f'tracker {self.name!r} cannot be built: {error}') from error

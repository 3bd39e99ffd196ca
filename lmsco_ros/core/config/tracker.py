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

"""Configuration of the tracker: frozen, validated, with named presets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
import math
from pathlib import Path
from typing import Any

import yaml

from lmsco_ros.core.config.extent import ExtentConfig, ScaleConfig
from lmsco_ros.core.config.features import (
    FeatureConfig, MOTION_KINDS, MotionConfig, NetworkConfig)
from lmsco_ros.core.config.imaging import IntensityConfig, SamplingConfig
from lmsco_ros.core.config.learning import LearningConfig
from lmsco_ros.core.config.presence import PresenceConfig
from lmsco_ros.core.config.presets import HANDCRAFTED, PRESETS
from lmsco_ros.core.config.runtime import RuntimeConfig
from lmsco_ros.core.config.search import SearchConfig
from lmsco_ros.core.config.validation import build, shown
from lmsco_ros.core.config.yaml_file import read_mapping
from lmsco_ros.core.errors import ConfigError

__all__ = ['TrackerConfig']

_FEWEST_CELLS = 5


@dataclass(frozen=True)
class TrackerConfig:
    """
    Everything that decides how a target is tracked.

    Attributes
    ----------
    features : tuple of FeatureConfig
        Feature blocks.
    intensity, sampling, networks, motion, learning, scale, extent, presence, search, runtime
        Sections, described in their classes.

    Raises
    ------
    ConfigError
        When a value is out of its range; says which and what was expected.

    """

    features: tuple[FeatureConfig, ...] = HANDCRAFTED
    intensity: IntensityConfig = IntensityConfig()
    sampling: SamplingConfig = SamplingConfig()
    networks: NetworkConfig = NetworkConfig()
    motion: MotionConfig = MotionConfig()
    learning: LearningConfig = LearningConfig()
    scale: ScaleConfig = ScaleConfig()
    extent: ExtentConfig = ExtentConfig()
    presence: PresenceConfig = PresenceConfig()
    search: SearchConfig = SearchConfig()
    runtime: RuntimeConfig = RuntimeConfig()

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not self.features:
            raise ConfigError('TrackerConfig.features is empty; name at least one block, '
                              'for instance {channels: [{kind: hog}]}')
        if all(group.kind in MOTION_KINDS for block in self.features for group in block.channels):
            raise ConfigError('TrackerConfig.features has motion channels only, which show '
                              'nothing in the first frame; add a block of appearance, hog or '
                              'intensity')
        if _FEWEST_CELLS * self.cell > self.sampling.patch_size_max:
            raise ConfigError(f'a patch of {self.sampling.patch_size_max} pixels has less than '
                              f'{_FEWEST_CELLS} cells of {self.cell} pixels, the least common '
                              'multiple of the cells in TrackerConfig.features; expected smaller '
                              'cells or a larger SamplingConfig.patch_size_max')

    @property
    def cell(self) -> int:
        """Pixels that every block's cell divides; the side of a patch is a multiple of it."""
        return math.lcm(*(block.cell for block in self.features))

    @property
    def sees_motion(self) -> bool:
        """Whether a block shows what moves."""
        return any(group.kind in MOTION_KINDS for block in self.features
                   for group in block.channels)

    @classmethod
    def preset(cls, name: str) -> TrackerConfig:
        """Return a named configuration; `preset_names` lists them."""
        try:
            return cls(**PRESETS[name])
        except (KeyError, TypeError):
            # Callers and files may have something else in the place of a name.
            raise ConfigError(f'unknown preset {shown(name)}; expected one of '
                              f'{", ".join(PRESETS)}; TrackerConfig.from_yaml reads a file'
                              ) from None

    @classmethod
    def preset_names(cls) -> tuple[str, ...]:
        """Return the names of all presets."""
        return tuple(PRESETS)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> TrackerConfig:
        """
        Return a configuration from nested plain values.

        The key `preset` names the configuration that the other keys change; without it they
        change `default`. A list replaces the whole list.
        """
        data = dict(data)
        base = asdict(cls.preset(data.pop('preset', 'default')))
        return build(cls, _merge(base, data))

    @classmethod
    def from_yaml(cls, path: str | Path) -> TrackerConfig:
        """
        Return the configuration in a YAML file, as `from_dict` reads it.

        Raises
        ------
        ConfigError
            As `read_mapping` and `from_dict`; names the file.

        """
        data = read_mapping(path)
        try:
            return cls.from_dict(data)
        except ConfigError as error:
            raise ConfigError(f'{path}: {error}') from error

    def to_dict(self) -> dict[str, Any]:
        """Return nested plain values that `from_dict` turns into the same configuration."""
        data = asdict(self)
        data['features'] = list(data['features'])
        return data

    def to_yaml(self) -> str:
        """Return the text of a file that `from_yaml` turns into the same configuration."""
        return yaml.safe_dump(self.to_dict(), sort_keys=False)


def _merge(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return `base` with `changes` laid over it, section by section."""
    merged = dict(base)
    for key, value in changes.items():
        nested = isinstance(value, Mapping) and isinstance(merged.get(key), Mapping)
        merged[key] = _merge(merged[key], value) if nested else value
    return merged

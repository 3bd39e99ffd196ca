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

"""How the size of the target is followed."""

from __future__ import annotations

from dataclasses import dataclass

from lmsco_ros.core.config.validation import check_range
from lmsco_ros.core.errors import ConfigError

__all__ = ['ExtentConfig', 'ScaleConfig']

_LARGEST_SCALE = 4.0


@dataclass(frozen=True)
class ExtentConfig:
    """
    The network that measures the extent of what is found, and knows the target of the start.

    Attributes
    ----------
    network : str
        Name of its weights; empty for none, and a size that only a search over scales changes.

    """

    network: str = ''


@dataclass(frozen=True)
class ScaleConfig:
    """
    Scales at which the target is searched, relative to its last size.

    Attributes
    ----------
    step : float
        Ratio of two neighboring scales.
    exponent_min, exponent_max : int
        Range of the exponents of `step`; the last size alone with 0 and 0.
    calibrated : bool
        Whether scores count by how they depend on the scale of the first frame's target, which
        so keeps its size; without it the highest score wins, as in the paper.
    rate : float
        Part of a change of scale that the size follows from one frame to the next.

    """

    step: float = 1.03
    exponent_min: int = 0
    exponent_max: int = 0
    calibrated: bool = True
    rate: float = 0.5

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_range(self, 'step', 1, 2, open_low=True)
        check_range(self, 'exponent_min', -50, 0)
        check_range(self, 'exponent_max', 0, 50)
        check_range(self, 'rate', 0, 1, open_low=True)
        reach = self.step**max(self.exponent_max, -self.exponent_min)
        if reach > _LARGEST_SCALE:
            raise ConfigError(f'ScaleConfig.step and its exponents reach a factor of {reach:g} '
                              f'from one frame to the next; expected at most {_LARGEST_SCALE:g}')

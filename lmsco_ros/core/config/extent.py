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

from lmsco_ros.core.config.validation import check_choice, check_range
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
        Name of its weights; empty for none, and a size that follows the scale estimator alone.

    """

    network: str = ''


@dataclass(frozen=True)
class ScaleConfig:
    """
    How the size of the target is followed.

    Attributes
    ----------
    estimator : {'filter', 'search', 'none'}
        One-dimensional scale filter (DSST), search over scaled patches (the paper), or a
        constant size.
    step : float
        Ratio of two neighboring scales.
    exponent_min, exponent_max : int
        Range of the exponents of `step`.
    learning_rate : float
        Of the scale filter, which learns in the frames in which the filter is trained.
    slow_rate, slow_share : float
        Learning rate of the scale filter that holds on to the first frames, and its share in
        the response.
    model_area : float
        Area of a scale sample in pixels.
    padding : float
        Side of a scale sample over that of the target.
    regularization : float
        Ridge term of the scale filter.
    label_sigma : float
        Standard deviation of its label, in scales.
    damping : float
        Side of a target, in pixels, of whose measured change from one frame to the next one half
        is believed: more of a larger one, less of a smaller one.
    tolerance : float
        Change of the size, in pixels of the side, that is taken for an error of measurement: the
        box is given with that much less of it.

    """

    estimator: str = 'filter'
    step: float = 1.02
    exponent_min: int = -8
    exponent_max: int = 8
    learning_rate: float = 0.12
    slow_rate: float = 0.01
    slow_share: float = 0.0
    model_area: float = 512.0
    padding: float = 1.0
    regularization: float = 0.01
    label_sigma: float = 1.0
    damping: float = 0.0
    tolerance: float = 0.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_choice(self, 'estimator', ('filter', 'search', 'none'))
        check_range(self, 'step', 1, 2, open_low=True)
        check_range(self, 'exponent_min', -50, 0)
        check_range(self, 'exponent_max', 0, 50)
        check_range(self, 'learning_rate', 0, 1)
        check_range(self, 'slow_rate', 0, 1)
        check_range(self, 'slow_share', 0, 1)
        check_range(self, 'model_area', 64, 65536)
        check_range(self, 'padding', 1, 4)
        check_range(self, 'regularization', 0, 100, open_low=True)
        check_range(self, 'label_sigma', 0, 50, open_low=True)
        check_range(self, 'damping', 0, 1000)
        check_range(self, 'tolerance', 0, 10)
        reach = self.step**max(self.exponent_max, -self.exponent_min)
        if reach > _LARGEST_SCALE:
            raise ConfigError(f'ScaleConfig.step and its exponents reach a factor of {reach:g} '
                              f'from one frame to the next; expected at most {_LARGEST_SCALE:g}')

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

"""From the image to the patch: working range and search region."""

from __future__ import annotations

from dataclasses import dataclass

from lmsco_ros.core.config.validation import check_range

__all__ = ['IntensityConfig', 'SamplingConfig']


@dataclass(frozen=True)
class IntensityConfig:
    """
    From counts to the working range.

    Attributes
    ----------
    low_percentile, high_percentile : float
        Percentiles of the frame that become 0 and 1.
    smoothing : float
        Part of the way that the range follows a small change in one frame, in (0, 1].
    jump : float
        Change, as a part of the range, above which the range is adopted at once.

    """

    low_percentile: float = 1.0
    high_percentile: float = 99.0
    smoothing: float = 0.2
    jump: float = 0.1

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_range(self, 'low_percentile', 0, 49)
        check_range(self, 'high_percentile', 51, 100)
        check_range(self, 'smoothing', 0, 1, open_low=True)
        check_range(self, 'jump', 0, 1)


@dataclass(frozen=True)
class SamplingConfig:
    """
    The search region, its patch, and how exactly the peak is found in it.

    Attributes
    ----------
    search_factor : float
        Side of the square search region over sqrt(target width * height).
    patch_size_min, patch_size_max : int
        Limits of the side of the patch, in pixels, into which the search region is resampled;
        the nearest size that fits the cells and the Fourier transform is taken.
    newton_steps : int
        Refinement of the score's maximum between the points of its grid.

    """

    search_factor: float = 5.0
    patch_size_min: int = 140
    patch_size_max: int = 140
    newton_steps: int = 5

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_range(self, 'search_factor', 1.5, 10)
        check_range(self, 'patch_size_min', 32, 1024)
        check_range(self, 'patch_size_max', self.patch_size_min, 1024)
        check_range(self, 'newton_steps', 0, 100)

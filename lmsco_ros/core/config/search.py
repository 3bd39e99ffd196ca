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

"""Where a missing target is searched."""

from __future__ import annotations

from dataclasses import dataclass

from lmsco_ros.core.config.validation import check_range

__all__ = ['SearchConfig']


@dataclass(frozen=True)
class SearchConfig:
    """
    How much of the image is searched in a frame while the target is missing.

    Attributes
    ----------
    candidates : int
        Salient places while the target is missing for a short time; half as many, rounded up,
        are measured in every other frame when it is missing for longer.
    tiles : int
        Other regions, which cover the whole image in the course of frames; in the other frames
        when it is missing for longer.

    """

    candidates: int = 4
    tiles: int = 2

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_range(self, 'candidates', 0, 64)
        check_range(self, 'tiles', 0, 64)

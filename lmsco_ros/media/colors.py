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

"""Colors that mean the same in every picture, by whatever part it is drawn."""

from __future__ import annotations

TRUTH_COLOR = '#f0f0f0'
"""Of true boxes: no state of a tracker has it."""


def bgr(color: str) -> tuple[int, int, int]:
    """Return blue, green and red, 0 to 255, of a color such as `#rrggbb`."""
    red, green, blue = bytes.fromhex(color[1:])
    return blue, green, red

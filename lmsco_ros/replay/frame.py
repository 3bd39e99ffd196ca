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

"""One image of a recording."""

from dataclasses import dataclass

import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class RecordedFrame:
    """
    One image of a recording.

    Attributes
    ----------
    index : int
        Number of the frame, from 0.
    stamp_ns : int
        When it was taken, in nanoseconds; from 0 for sources that have no stamps.
    image : ndarray, shape (H, W) or (H, W, 3)
        uint8, uint16 or float32; color as uint8, BGR.

    """

    index: int
    stamp_ns: int
    image: npt.NDArray

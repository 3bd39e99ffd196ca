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

"""What a compressed file says of itself, read before anything is spent on its pixels."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ['ImageFile']


@dataclass(frozen=True)
class ImageFile:
    """
    A jpeg or png file that is whole as far as its head and its segments tell.

    Attributes
    ----------
    width, height : int
        In pixels, at least 1.
    pixel_bytes : int
        What one pixel takes while it is decoded.
    gray : bool
        Whether there is one channel beside transparency.
    scans : int
        How often the decoder goes over the image.
    data : bytes or memoryview of bytes
        The file, without what says nothing about the pixels and may cost much.

    """

    width: int
    height: int
    pixel_bytes: int
    gray: bool
    scans: int
    data: bytes | memoryview

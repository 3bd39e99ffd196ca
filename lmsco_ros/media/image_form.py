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

"""All images of a recording have one size and one type."""

from __future__ import annotations

from dataclasses import dataclass

import numpy.typing as npt

from lmsco_ros.media.errors import MediaError


@dataclass(frozen=True)
class ImageForm:
    """
    What the images of a recording have in common.

    Attributes
    ----------
    width, height : int
        Size in pixels.
    values : str
        Type of the values, as NumPy calls it.
    storage : str
        How the image is stored: the ending of its file, or what its film is called.

    """

    width: int
    height: int
    values: str
    storage: str

    def __str__(self) -> str:
        """Return the form in words."""
        return f'{self.width} x {self.height} pixels of {self.values} ({self.storage})'


class CommonForm:
    """The form of the first image, which those after it must have."""

    def __init__(self) -> None:
        self._form: ImageForm | None = None
        self._name = ''

    def require(self, image: npt.NDArray, name: str, storage: str) -> None:
        """
        Check one more image; gray and color may be mixed.

        Parameters
        ----------
        image : ndarray, shape (H, W) or (H, W, 3)
            Image as decoded.
        name : str
            What to call it.
        storage : str
            How it is stored.

        Raises
        ------
        MediaError
            When it has another form than the first one.

        """
        form = ImageForm(image.shape[1], image.shape[0], image.dtype.name, storage)
        if self._form is None:
            self._form, self._name = form, name
        elif form != self._form:
            raise MediaError(f'{name} has {form}, but {self._name} has {self._form}; a recording '
                             'has one size and type: take away what does not belong to it')

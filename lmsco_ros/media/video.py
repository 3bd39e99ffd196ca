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

"""Films: every frame that can be decoded, with all its bits and the time it was taken."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
import hashlib
from pathlib import Path
import warnings

import numpy.typing as npt

from lmsco_ros.media.decoded_frame import image_of
from lmsco_ros.media.decoding import decode, DecodedFrame, image_streams, open_film
from lmsco_ros.media.errors import MediaError, MediaWarning
from lmsco_ros.media.film_length import length_and_rate, tell_missing
from lmsco_ros.media.image_form import CommonForm
from lmsco_ros.media.timeline import Timeline


class VideoFile:
    """
    Frames of a film, decoded forward; going back starts again at the first one.

    With more than 8 bits, and where it shows no color, only the luminance is read. A film that
    says so is turned, as in a player.

    Parameters
    ----------
    path : Path
        Any film that FFmpeg decodes.

    Attributes
    ----------
    fps : float
        Frames per second, on average.

    Raises
    ------
    MediaError
        When it is no film, or has no frames.

    """

    def __init__(self, path: Path) -> None:
        """Find the number of frames and their rate."""
        self._path = path
        self._form = CommonForm()
        self._frames: Iterator[DecodedFrame] | None = None
        self._next = 0
        with open_film(path) as (container, stream):
            streams = len(image_streams(container))
            if streams > 1:
                warnings.warn(f'{path.name} holds {streams} streams of images; the first is '
                              'read', MediaWarning, stacklevel=2)
            self._length, self._rate = length_and_rate(container, stream, path.name)
        if not self._length:
            raise MediaError(f'{path.name} has no frames; it may not have been recorded to its '
                             'end')
        self.fps = float(self._rate)

    @property
    def signature(self) -> str:
        """Size of the file and digest of its two ends."""
        size = self._path.stat().st_size
        with self._path.open('rb') as stream:
            head = stream.read(1 << 16)
            stream.seek(max(size - (1 << 16), 0))
            digest = hashlib.sha256(head + stream.read()).hexdigest()
        return f'{self._path.name}:{size}:{digest}'

    def __len__(self) -> int:
        """Return the number of frames that the container states."""
        return self._length

    def __getitem__(self, index: int) -> npt.NDArray:
        """
        Decode frame `index`.

        Raises
        ------
        MediaError
            When the film ends before it, or its size changes.

        """
        if not 0 <= index < self._length:
            raise IndexError(index)
        if self._frames is None or index < self._next:
            self._frames, self._next = decode(self._path), 0
        for decoded in self._frames:
            self._next += 1
            if self._next > index:
                return self._image(decoded, index, self._form)
        raise MediaError(f'{self._path.name} ends before frame {index}, '
                         f'although it states {self._length} frames')

    def __iter__(self) -> Iterator[npt.NDArray]:
        """Yield the frames to the end, wherever that is."""
        return (image for _, image in self._play())

    def timed(self) -> Iterator[tuple[int, npt.NDArray]]:
        """
        Yield the frames to the end, each behind its time.

        Times that were of no use are told at the end, by a `MediaWarning`.

        Yields
        ------
        tuple of int and ndarray
            Nanoseconds since the first frame, by the times of the container, and the image.

        """
        timeline = Timeline(self._rate)
        for seconds, image in self._play():
            yield timeline.stamp(seconds), image
        for count, what in ((timeline.missing, f'have no time and follow at {self.fps:g} '
                                               'frames/s'),
                            (timeline.repeated, 'are not later than those before them and '
                                                'follow a nanosecond after'),
                            (timeline.restarts, 'start to count the time again and go on '
                                                'where the one before was')):
            if count:
                warnings.warn(f'{self._path.name}: frames that {what}: {count}', MediaWarning,
                              stacklevel=2)

    def _play(self) -> Iterator[tuple[Fraction | None, npt.NDArray]]:
        """Yield times and images to the end, and tell when that comes early."""
        form, count = CommonForm(), 0
        for decoded in decode(self._path):
            yield decoded.seconds, self._image(decoded, count, form)
            count += 1
        if count < self._length:
            tell_missing(self._path.name, f'{self._length} frames', f'{count}')

    def __getstate__(self) -> dict:
        """Leave the decoder behind when the film goes to another process."""
        return {**self.__dict__, '_frames': None, '_next': 0}

    def _image(self, decoded: DecodedFrame, index: int, form: CommonForm) -> npt.NDArray:
        image = image_of(decoded.frame)
        form.require(image, f'frame {index} of {self._path.name}', 'film')
        return image

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

"""Films that browsers play, and that survive the end of the process that writes them."""

from __future__ import annotations

from contextlib import suppress
from errno import ENOTSUP
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.extras import require_extra

if TYPE_CHECKING:
    from av import FFmpegError, VideoStream
    from av.container import OutputContainer

# A film that is being written is a row of fragments, each complete in itself; at the end it
# becomes one piece, with a table of all its frames.
_CONTAINER = {
    'movflags': 'hybrid_fragmented+frag_keyframe+empty_moov+default_base_moof',
    'flush_packets': '1',
}
# No frame waits in the encoder for later ones.
_ENCODER = {'preset': 'superfast', 'crf': '23', 'tune': 'zerolatency'}
_PIXELS, _ITU_601, _LIMITED_RANGE = 'yuv420p', 5, 1


class FilmWriter:
    """
    A film as H.264 in an mp4 file.

    Of a process that is killed, the film up to its last second remains.

    Parameters
    ----------
    path : Path
        The mp4 file; made with the first frame.
    fps : float
        Frames per second.

    Raises
    ------
    OSError
        When the film cannot be written; names the file.
    MissingExtraError
        When PyAV, which writes it, is not installed.

    """

    def __init__(self, path: Path, fps: float) -> None:
        require_extra('cli', f'{path.name}, a film,', 'av')
        self._path = path
        self._rate = Fraction(fps).limit_denominator(1001)
        self._open: _OpenFilm | None = None

    def write(self, image: npt.NDArray[np.uint8]) -> None:
        """
        Append a frame.

        Parameters
        ----------
        image : ndarray, shape (H, W, 3), uint8
            In BGR order. A film keeps the size of its first frame, to which others are
            resized.

        """
        import av

        try:
            if self._open is None:
                self._open = _OpenFilm(self._path, self._rate, image.shape[1], image.shape[0])
            self._open.write(image)
        except (av.FFmpegError, OSError) as error:
            # What is in the file already is a film; the first error is the one to tell.
            with suppress(OSError):
                self.close()
            raise self._named(error) from error

    def close(self) -> None:
        """Finish the film."""
        if self._open is None:
            return

        import av

        film, self._open = self._open, None
        try:
            film.close()
        except (av.FFmpegError, OSError) as error:
            raise self._named(error) from error

    def _named(self, error: FFmpegError | OSError) -> OSError:
        return OSError(error.errno, error.strerror, str(self._path))


class _OpenFilm:
    """Container and encoder of a film with at least one frame."""

    def __init__(self, path: Path, rate: Fraction, width: int, height: int) -> None:
        import av

        self._container = av.open(str(path.absolute()), 'w', format='mp4', options=_CONTAINER)
        self._stream = _add_stream(self._container, rate)
        # The encoder wants even sizes.
        self._stream.width, self._stream.height = width + width % 2, height + height % 2
        self._rate = rate
        self._count = 0

    def write(self, image: npt.NDArray[np.uint8]) -> None:
        from av import VideoFrame

        frame = VideoFrame.from_ndarray(
            _fit(image, self._stream.width, self._stream.height), format='bgr24')
        frame = frame.reformat(format=_PIXELS, dst_colorspace=_ITU_601,
                               dst_color_range=_LIMITED_RANGE)
        frame.pts, frame.time_base = self._count, 1 / self._rate
        self._count += 1
        self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        try:
            self._container.mux(self._stream.encode(None))
        finally:
            self._container.close()


def _add_stream(container: OutputContainer, rate: Fraction) -> VideoStream:
    from av.codec.codec import UnknownCodecError

    try:
        stream = container.add_stream('libx264', rate=rate, options=_ENCODER)
    except UnknownCodecError as error:
        raise OSError(ENOTSUP, 'PyAV has no H.264 encoder here; install it from the package '
                      'index') from error
    stream.pix_fmt = _PIXELS
    coding = stream.codec_context
    coding.colorspace, coding.color_range = _ITU_601, _LIMITED_RANGE
    # A fragment begins with a frame that needs no other: one a second.
    coding.gop_size = max(1, round(rate))
    return stream


def _fit(image: npt.NDArray, width: int, height: int) -> npt.NDArray:
    """Return the image in another size; a row or column that is missing is repeated."""
    right, below = width - image.shape[1], height - image.shape[0]
    if 0 <= right <= 1 and 0 <= below <= 1:
        return cv2.copyMakeBorder(image, 0, below, 0, right, cv2.BORDER_REPLICATE)
    return cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)

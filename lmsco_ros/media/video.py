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
from contextlib import contextmanager
from fractions import Fraction
import hashlib
from pathlib import Path
from typing import TYPE_CHECKING
import warnings

import numpy.typing as npt

from lmsco_ros.media.decoded_frame import image_of
from lmsco_ros.media.errors import MediaError, MediaWarning
from lmsco_ros.media.image_form import CommonForm
from lmsco_ros.media.timeline import Timeline

if TYPE_CHECKING:
    from av import Packet, VideoFrame, VideoStream
    from av.container import InputContainer

_DEFAULT_FPS = Fraction(30)
# Text is shown as if it were a film by a reader that is meant for the art of old terminals.
_NO_FILM = 'tty'
# A damaged place may stop the reader several times before it finds the next frame.
_MOST_STOPS = 100


class VideoFile:
    """
    Frames of a film, decoded forward; going back starts again at the first one.

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
        self._frames: Iterator[VideoFrame] | None = None
        self._next = 0
        with _opened(path) as (container, stream):
            if len(_films(container)) > 1:
                warnings.warn(f'{path.name} holds {len(_films(container))} films; the first is '
                              'read', MediaWarning, stacklevel=2)
            self._length, self._rate = _length_and_rate(container, stream)
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
            self._frames, self._next = _decode(self._path), 0
        for frame in self._frames:
            self._next += 1
            if self._next > index:
                return self._image(frame, index, self._form)
        raise MediaError(f'{self._path.name} ends before frame {index}, '
                         f'although it states {self._length} frames')

    def __iter__(self) -> Iterator[npt.NDArray]:
        """Yield the frames to the end, wherever that is."""
        form = CommonForm()
        for index, frame in enumerate(_decode(self._path)):
            yield self._image(frame, index, form)

    def timed(self) -> Iterator[tuple[int, npt.NDArray]]:
        """
        Yield the frames to the end, each behind its time.

        Yields
        ------
        tuple of int and ndarray
            Nanoseconds since the first frame, by the times of the container, and the image.
            `MediaWarning` tells at the end where these times were of no use.

        """
        form, timeline = CommonForm(), Timeline(self._rate)
        for index, frame in enumerate(_decode(self._path)):
            image = self._image(frame, index, form)
            yield timeline.stamp(_seconds(frame)), image
        name = self._path.name
        if timeline.missing:
            warnings.warn(f'{name} has no times for {timeline.missing} frames; they follow at '
                          f'{self.fps:g} frames/s', MediaWarning, stacklevel=2)
        if timeline.repeated:
            warnings.warn(f'{name} has {timeline.repeated} frames that are not later than the '
                          'ones before them; they follow one nanosecond after', MediaWarning,
                          stacklevel=2)

    def __getstate__(self) -> dict:
        """Leave the decoder behind when the film goes to another process."""
        return {**self.__dict__, '_frames': None, '_next': 0}

    def _image(self, frame: VideoFrame, index: int, form: CommonForm) -> npt.NDArray:
        image = image_of(frame)
        form.require(image, f'frame {index} of {self._path.name}', 'film')
        return image


@contextmanager
def _opened(path: Path) -> Iterator[tuple[InputContainer, VideoStream]]:
    """
    Open a film.

    Raises
    ------
    MediaError
        When it is none.

    """
    import av

    try:
        # A name with a colon is an address for FFmpeg, unless it begins with a slash.
        container = av.open(str(path.absolute()))
    except (av.FFmpegError, OSError) as error:
        reason = 'the file is empty' if path.is_file() and not path.stat().st_size \
            else error.strerror
        raise MediaError(f'{path.name} is not a readable video ({reason})') from error
    with container:
        films = _films(container)
        if not films or container.format.name == _NO_FILM:
            kinds = ', '.join(sorted({stream.type for stream in container.streams} - {'video'}))
            raise MediaError(f'{path.name} is not a readable video (it holds '
                             f'{kinds or "no images"})')
        yield container, films[0]


def _films(container: InputContainer) -> list[VideoStream]:
    """Return the streams of images; the cover of a piece of music is none."""
    from av.stream import Disposition

    return [stream for stream in container.streams.video
            if not stream.disposition & Disposition.attached_pic
            and stream.codec_context is not None]


def _decode(path: Path) -> Iterator[VideoFrame]:
    """Yield every frame that can be decoded, and tell how much could not."""
    from av import FFmpegError

    frames = damaged = 0
    with _opened(path) as (container, stream):
        for packet in _packets(container, stream):
            try:
                decoded = stream.codec_context.decode(packet)
            except FFmpegError:
                damaged += 1
                continue
            frames += len(decoded)
            yield from decoded
    if not frames:
        raise MediaError(f'{path.name} has no frame that can be decoded; it is damaged')
    if damaged:
        warnings.warn(f'{path.name} is damaged: {damaged} pieces were left out, {frames} frames '
                      'were read', MediaWarning, stacklevel=2)


def _packets(container: InputContainer, stream: VideoStream) -> Iterator[Packet | None]:
    """Yield what the decoder needs, None at the end; what is damaged is passed over."""
    from av import FFmpegError

    stops = 0
    while stops < _MOST_STOPS:
        try:
            for packet in container.demux(stream):
                if packet.size:
                    yield packet
                    stops = 0
            break
        except FFmpegError:
            stops += 1
    yield None


def _length_and_rate(container: InputContainer, stream: VideoStream) -> tuple[int, Fraction]:
    """Return the number of frames and their average rate, as stated or else as counted."""
    rate = _sane(stream.average_rate)
    if rate and stream.frames and stream.duration is not None:
        expected = stream.duration * stream.time_base * rate
        # Films in fragments may state the frames of the first of them.
        if abs(expected - stream.frames) <= 2 + 0.02 * stream.frames:
            return stream.frames, rate
    times = [packet.pts for packet in _packets(container, stream) if packet is not None]
    known = [time for time in times if time is not None]
    span = (max(known) - min(known)) * stream.time_base if len(known) == len(times) > 1 else 0
    measured = _sane((len(times) - 1) / Fraction(span)) if span else None
    return len(times), measured or rate or _DEFAULT_FPS


def _sane(rate: Fraction | None) -> Fraction | None:
    return rate if rate is not None and Fraction(1, 10) <= rate <= 1000 else None


def _seconds(frame: VideoFrame) -> Fraction | None:
    time = frame.pts if frame.pts is not None else frame.dts
    return None if time is None or frame.time_base is None else time * frame.time_base

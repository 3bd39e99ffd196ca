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

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
import hashlib
from pathlib import Path
from typing import TYPE_CHECKING
import warnings

import numpy.typing as npt

from lmsco_ros.media.decoded_frame import image_of
from lmsco_ros.media.decoding import decode, DecodedFrame, image_streams, open_film, read_packets
from lmsco_ros.media.errors import MediaError, MediaWarning
from lmsco_ros.media.image_form import CommonForm
from lmsco_ros.media.timeline import Timeline

if TYPE_CHECKING:
    from av import VideoStream
    from av.container import InputContainer

_DEFAULT_FPS = Fraction(30)


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
            self._length, self._rate = _length_and_rate(container, stream, path.name)
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

        Yields
        ------
        tuple of int and ndarray
            Nanoseconds since the first frame, by the times of the container, and the image.

        Warns
        -----
        MediaWarning
            At the end, where these times were of no use.

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
            _tell_missing(self._path.name, f'{self._length} frames', f'{count}')

    def __getstate__(self) -> dict:
        """Leave the decoder behind when the film goes to another process."""
        return {**self.__dict__, '_frames': None, '_next': 0}

    def _image(self, decoded: DecodedFrame, index: int, form: CommonForm) -> npt.NDArray:
        image = image_of(decoded.frame)
        form.require(image, f'frame {index} of {self._path.name}', 'film')
        return image


def _length_and_rate(container: InputContainer, stream: VideoStream,
                     name: str) -> tuple[int, Fraction]:
    """Return the number of frames and their average rate, as stated or else as counted."""
    stated = _sane(stream.average_rate)
    if stated and stream.frames and stream.duration is not None:
        expected = stream.duration * stream.time_base * stated
        # Films in fragments may state the frames of the first of them.
        if abs(expected - stream.frames) <= 2 + 0.02 * stream.frames:
            return stream.frames, stated
    packets = [_PacketTime(packet.pts, packet.duration or 0, packet.is_discard)
               for packet in read_packets(container, stream)]
    shown = [packet for packet in packets if not packet.is_hidden]
    rate = _measured_rate(shown, stream.time_base) or stated or _DEFAULT_FPS
    if stream.frames > len(packets):
        _tell_missing(name, f'{stream.frames} frames', f'{len(packets)}')
    elif container.duration and len(container.streams) == 1:
        _tell_early_end(name, Fraction(container.duration, 1_000_000), rate, shown,
                        stream.time_base)
    return len(shown), rate


@dataclass(frozen=True)
class _PacketTime:
    """When a frame is shown and for how long, in units of its stream, and whether at all."""

    time: int | None
    duration: int
    is_hidden: bool


def _measured_rate(packets: Sequence[_PacketTime], unit: Fraction) -> Fraction | None:
    times = [packet.time for packet in packets if packet.time is not None]
    if len(times) < max(len(packets), 2) or min(times) == max(times):
        return None
    return _sane((len(times) - 1) / ((max(times) - min(times)) * unit))


def _tell_early_end(name: str, length: Fraction, rate: Fraction,
                    packets: Sequence[_PacketTime], unit: Fraction) -> None:
    """Say where a film ends before its stated length is over."""
    known = [packet for packet in packets if packet.time is not None]
    if len(known) < len(packets) or not known:
        return
    last = max(known, key=lambda packet: packet.time)
    shown = last.duration * unit or 1 / rate
    # Some containers count their length from the first frame, others from zero.
    end = last.time * unit - min(0, *(packet.time for packet in known)) * unit + shown
    if length - end > max(2 * shown, length / 50):
        _tell_missing(name, f'{float(length):.2f} s', f'{float(end):.2f} s')


def _tell_missing(name: str, stated: str, found: str) -> None:
    warnings.warn(f'{name} states {stated}, of which {found} are there', MediaWarning,
                  stacklevel=2)


def _sane(rate: Fraction | None) -> Fraction | None:
    return rate if rate is not None and Fraction(1, 10) <= rate <= 1000 else None

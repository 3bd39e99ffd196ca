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

"""What is in the file of a film: streams, packets and decoded frames."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING
import warnings

from lmsco_ros.extras import require_extra
from lmsco_ros.media.errors import MediaError, MediaWarning

if TYPE_CHECKING:
    from av import Packet, VideoFrame, VideoStream
    from av.container import InputContainer

# Text is shown as if it were a film by a reader that is meant for the art of old terminals.
_NO_FILM = 'tty'
# A damaged place may stop the reader several times before it finds the next frame.
_MOST_STOPS = 100


@contextmanager
def open_film(path: Path) -> Iterator[tuple[InputContainer, VideoStream]]:
    """
    Open a film at its first stream of images.

    Raises
    ------
    MediaError
        When it is none.
    MissingExtraError
        When PyAV, which reads films, is not installed.

    """
    require_extra('cli', f'{path.name}, a film,', 'av')
    import av

    try:
        # A name with a colon is an address for FFmpeg, unless it begins with a slash.
        container = av.open(str(path.absolute()))
    except (av.FFmpegError, OSError) as error:
        reason = 'the file is empty' if path.is_file() and not path.stat().st_size \
            else error.strerror
        raise MediaError(f'{path.name} is not a readable video ({reason})') from error
    with container:
        films = image_streams(container)
        if not films or container.format.name == _NO_FILM:
            raise MediaError(f'{path.name} is not a readable video ({_instead(container)})')
        yield container, films[0]


def image_streams(container: InputContainer) -> list[VideoStream]:
    """Return the streams of images that can be decoded; the cover of a record is none."""
    from av.stream import Disposition

    return [stream for stream in container.streams.video
            if not stream.disposition & Disposition.attached_pic
            and stream.codec_context is not None]


def _instead(container: InputContainer) -> str:
    """Return what a container holds that has no images to decode."""
    if any(stream.codec_context is None for stream in container.streams.video):
        return 'FFmpeg does not know how its images are coded'
    kinds = sorted({stream.type for stream in container.streams} - {'video'})
    return f'it holds {", ".join(kinds) or "no images"}'


def read_packets(container: InputContainer, stream: VideoStream) -> Iterator[Packet]:
    """Yield the packets of a stream to the end; what is damaged is passed over."""
    from av import FFmpegError

    stops = 0
    while stops < _MOST_STOPS:
        try:
            for packet in container.demux(stream):
                if packet.size:
                    yield packet
                    stops = 0
            return
        except FFmpegError:
            stops += 1


@dataclass(frozen=True, eq=False)
class DecodedFrame:
    """
    One frame as it left the decoder.

    Attributes
    ----------
    seconds : Fraction or None
        Its time in the container, where the container has any.
    frame : av.VideoFrame
        The frame.

    """

    seconds: Fraction | None
    frame: VideoFrame


def decode(path: Path) -> Iterator[DecodedFrame]:
    """
    Yield every frame of a film that can be decoded.

    What could not be decoded is told at the end, by a `MediaWarning`.

    Raises
    ------
    MediaError
        When it is no film, or nothing of it can be decoded.

    """
    from av import FFmpegError
    from av.format import Flags

    frames = damaged = 0
    with open_film(path) as (container, stream):
        # Readers of bare streams invent times.
        timed = not Flags(container.format.flags) & Flags.no_timestamps
        for packet in chain(read_packets(container, stream), (None,)):
            try:
                decoded = stream.codec_context.decode(packet)
            except FFmpegError:
                damaged += 1
                continue
            frames += len(decoded)
            for frame in decoded:
                yield DecodedFrame(_seconds(frame, stream) if timed else None, frame)
    if not frames:
        raise MediaError(f'{path.name} has no frame that can be decoded; it is damaged')
    if damaged:
        warnings.warn(f'{path.name} is damaged; pieces left out: {damaged}, frames read: '
                      f'{frames}', MediaWarning, stacklevel=2)


def _seconds(frame: VideoFrame, stream: VideoStream) -> Fraction | None:
    """Return the time of a frame; those that leave the decoder last know no unit of their own."""
    time = frame.pts if frame.pts is not None else frame.dts
    return None if time is None or stream.time_base is None else time * stream.time_base

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

"""How many frames a film has, and how fast they follow each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING
import warnings

from lmsco_ros.media.decoding import read_packets
from lmsco_ros.media.errors import MediaWarning

if TYPE_CHECKING:
    from av import VideoStream
    from av.container import InputContainer

_DEFAULT_FPS = Fraction(30)


def length_and_rate(container: InputContainer, stream: VideoStream,
                    name: str) -> tuple[int, Fraction]:
    """
    Return the number of frames and their average rate, as stated or else as counted.

    Counting reads the file to its end, and a `MediaWarning` tells when that comes early.

    Parameters
    ----------
    container : InputContainer
        The open film, at its beginning.
    stream : VideoStream
        Its images.
    name : str
        What to call it.

    """
    stated, unit = _sane(stream.average_rate), stream.time_base or Fraction(1)
    if stated and stream.frames and stream.duration is not None:
        # Films in fragments may state the frames of the first of them.
        if abs(stream.duration * unit * stated - stream.frames) <= 2 + 0.02 * stream.frames:
            return stream.frames, stated
    # Packets hold a part of the film each: only their times are kept.
    packets = [(packet.pts, packet.duration or 0, packet.is_discard)
               for packet in read_packets(container, stream)]
    shown = [(time, duration) for time, duration, is_hidden in packets if not is_hidden]
    times = _times(shown, unit)
    rate = _sane(_average(times)) or stated or _DEFAULT_FPS
    if stream.frames > len(packets):
        tell_missing(name, f'{stream.frames} frames', f'{len(packets)}')
    elif times and container.duration and len(container.streams) == 1:
        _tell_early_end(name, Fraction(container.duration, 1_000_000), times, 1 / rate)
    return len(shown), rate


def tell_missing(name: str, stated: str, found: str) -> None:
    """Warn that a film has less than it states."""
    warnings.warn(f'{name} states {stated}, of which {found} are there', MediaWarning,
                  stacklevel=3)


@dataclass(frozen=True, order=True)
class _Shown:
    """When a frame begins to be shown and for how long, in seconds; 0 where unknown."""

    time: Fraction
    duration: Fraction


def _times(frames: Sequence[tuple[int | None, int]], unit: Fraction) -> list[_Shown]:
    """Return the times of all frames in their order, or nothing when some have none."""
    known = [_Shown(time * unit, duration * unit) for time, duration in frames
             if time is not None]
    return sorted(known) if len(known) == len(frames) else []


def _average(times: Sequence[_Shown]) -> Fraction | None:
    span = times[-1].time - times[0].time if times else Fraction(0)
    return (len(times) - 1) / span if span else None


def _tell_early_end(name: str, length: Fraction, times: Sequence[_Shown],
                    period: Fraction) -> None:
    shown = times[-1].duration or period
    # Some containers count their length from the first frame, others from zero.
    end = times[-1].time - min(Fraction(0), times[0].time) + shown
    if length - end > max(2 * shown, length / 50):
        tell_missing(name, f'{float(length):.2f} s', f'{float(end):.2f} s')


def _sane(rate: Fraction | None) -> Fraction | None:
    return rate if rate is not None and Fraction(1, 10) <= rate <= 1000 else None

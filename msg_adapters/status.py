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

"""Status: `diagnostic_msgs/DiagnosticArray` <-> plain values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple, TypeVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header

from msg_adapters.errors import StatusMessageError


class Level(IntEnum):
    """How well things are, as in DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class Diagnosis:
    """One entry of a DiagnosticArray: who is how well, in one line and in figures."""

    name: str
    level: Level
    message: str
    values: Mapping[str, str] = field(default_factory=dict)
    hardware_id: str = ''


class FrameTimes(NamedTuple):
    """When a frame passed each station, in seconds since 1970 on the system's clock."""

    received: float
    started: float
    finished: float
    published: float


class Reading(NamedTuple):
    """Lowest, mean and highest value of the pixels of a target."""

    minimum: float
    mean: float
    maximum: float


@dataclass(frozen=True)
class FrameStatus:
    """
    What a tracker says about one frame.

    Attributes
    ----------
    state : str
        One word, such as tracking, uncertain, lost or idle.
    track_id : int
        Grows with every start; 0 before the first.
    score : float or None
        Trust in the box, in [0, 1]; None without a box.
    latency_ms : float
        From the arrival of the frame until its box was published, in milliseconds.
    tracker_ms : float
        The tracker's own share of it, in milliseconds.
    dropped_frames : int
        Frames that were skipped since the node became active.
    level : Level
    message : str
        For people: what is wrong and what to do, or the state.
    times : FrameTimes or None
        None for a message that was not tracked.
    target : Reading or None
        Of the pixels under the box, in the units of the image; None without a box.
    target_celsius : Reading or None
        The same in degrees Celsius; None where that is not known.
    start : str
        The answer to who asked to start: accepted or refused; empty where nobody has.

    """

    state: str
    track_id: int
    score: float | None
    latency_ms: float
    tracker_ms: float
    dropped_frames: int
    level: Level = Level.OK
    message: str = ''
    times: FrameTimes | None = None
    target: Reading | None = None
    target_celsius: Reading | None = None
    start: str = ''


# Prefix of the keys in the message, attribute of FrameStatus and its type.
_Group = TypeVar('_Group', FrameTimes, Reading)
# What stands before the numbers of a group, and the attribute that holds them.
_GROUPS = (('', 'times'), ('target_', 'target'), ('target_celsius_', 'target_celsius'))


def message_from_diagnoses(diagnoses: Iterable[Diagnosis],
                           header: Header | None = None) -> DiagnosticArray:
    """Return a DiagnosticArray with one entry for each diagnosis."""
    return DiagnosticArray(header=header or Header(), status=[
        DiagnosticStatus(
            level=bytes([diagnosis.level]), name=diagnosis.name, message=diagnosis.message,
            hardware_id=diagnosis.hardware_id,
            values=[KeyValue(key=key, value=value) for key, value in diagnosis.values.items()])
        for diagnosis in diagnoses])


def diagnoses_from_message(message: DiagnosticArray) -> list[Diagnosis]:
    """
    Return the entries of a DiagnosticArray.

    Raises
    ------
    StatusMessageError
        When a level is none of the four.

    """
    return [Diagnosis(status.name, _level(status), status.message,
                      {pair.key: pair.value for pair in status.values}, status.hardware_id)
            for status in message.status]


def message_from_status(status: FrameStatus, name: str,
                        header: Header | None = None) -> DiagnosticArray:
    """Return the status of a frame with one target, under the name of the node that says it."""
    return message_from_statuses([status], name, header)


def message_from_statuses(statuses: Iterable[FrameStatus], name: str,
                          header: Header | None = None) -> DiagnosticArray:
    """Return the status of a frame: an entry for each target, the selected one first."""
    return message_from_diagnoses([_diagnosis(status, name) for status in statuses], header)


def _diagnosis(status: FrameStatus, name: str) -> Diagnosis:
    """Return the entry of one target."""
    values = {
        'state': status.state,
        'track_id': str(status.track_id),
        'score': '' if status.score is None else repr(float(status.score)),
        'latency_ms': repr(float(status.latency_ms)),
        'tracker_ms': repr(float(status.tracker_ms)),
        'dropped_frames': str(status.dropped_frames),
    }
    for prefix, attribute in _GROUPS:
        group = getattr(status, attribute)
        if group is not None:
            values |= {prefix + key: repr(float(value))
                       for key, value in group._asdict().items()}
    if status.start:
        values['start'] = status.start
    target = f'target_{status.track_id}' if status.track_id else ''
    return Diagnosis(name, status.level, status.message, values, target)


def status_from_message(message: DiagnosticArray) -> FrameStatus:
    """
    Return the status of the frame that `message` speaks of: of the selected target.

    Raises
    ------
    StatusMessageError
        As :func:`statuses_from_message`.

    """
    return statuses_from_message(message)[0]


def statuses_from_message(message: DiagnosticArray) -> list[FrameStatus]:
    """
    Return the status of each target in a frame, at least one.

    Raises
    ------
    StatusMessageError
        When the message was not made by :func:`message_from_statuses`.

    """
    if not message.status:
        raise StatusMessageError('the message has no entry; expected one for each target')
    return [_status(diagnosis) for diagnosis in diagnoses_from_message(message)]


def _status(diagnosis: Diagnosis) -> FrameStatus:
    """Return the status of one target."""
    values = diagnosis.values
    try:
        return FrameStatus(
            values['state'], int(values['track_id']),
            float(values['score']) if values['score'] else None,
            float(values['latency_ms']), float(values['tracker_ms']),
            int(values['dropped_frames']), diagnosis.level, diagnosis.message,
            times=_group(values, '', FrameTimes), target=_group(values, 'target_', Reading),
            target_celsius=_group(values, 'target_celsius_', Reading),
            start=values.get('start', ''))
    except (KeyError, ValueError) as error:
        raise StatusMessageError(
            f'the message is no frame status ({error}); expected entries with state, '
            'track_id, score, latency_ms, tracker_ms and dropped_frames') from error


def _group(values: Mapping[str, str], prefix: str, kind: type[_Group]) -> _Group | None:
    """Return the numbers that belong together; None when they are not there."""
    if prefix + kind._fields[0] not in values:
        return None
    return kind(*(float(values[prefix + key]) for key in kind._fields))


def _level(status: DiagnosticStatus) -> Level:
    try:
        return Level(status.level[0])
    except ValueError:
        raise StatusMessageError(f'status "{status.name}" has the level {status.level[0]}; '
                                 'expected 0 (ok) to 3 (stale)') from None

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

"""
The file that says what one evaluation consisted of.

`run-ope.json`, `run-vot.json` and `run-anchors.json` in the output folder name
trackers, sequences with their true boxes, records, machine and versions: with the
records it is all that tables and the report are made from.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.challenges import CHALLENGES
from lmsco_ros.evaluation.datasets.sequence import Origin
from lmsco_ros.evaluation.errors import ResultError
from lmsco_ros.evaluation.execution import PROTOCOLS
from lmsco_ros.evaluation.geometry import overlaps
from lmsco_ros.evaluation.plain_values import (
    box_rows, damaged, MISFITS, read_object, the_list, the_object, the_text, whole_number,
    whole_numbers)
from lmsco_ros.evaluation.record_store import read_record
from lmsco_ros.evaluation.trace import Trace
from lmsco_ros.evaluation.whole_file import write_json


@dataclass(frozen=True, eq=False)
class SequenceInfo:
    """
    A sequence without its images.

    Attributes
    ----------
    name, group : str
        Names of the sequence and of the folder around it.
    size : (int, int)
        Width and height of the images in pixels.
    ground_truth : ndarray, shape (n, 4)
        True boxes, NaN where absent.
    attributes : mapping of str to ndarray, shape (n,), bool
        Annotated attributes; empty where unknown.
    challenge : str
        What the sequence was made harder with; empty for one as it was recorded.
    origin : Origin or None
        The whole sequence that this is a part of; None for one that is whole.
    other_truth : ndarray, shape (n, 4), or None
        Boxes of the visible channel, where the data has them.

    """

    name: str
    group: str
    size: tuple[int, int]
    ground_truth: npt.NDArray[np.float64]
    attributes: Mapping[str, npt.NDArray[np.bool_]]
    challenge: str = ''
    origin: Origin | None = None
    other_truth: npt.NDArray[np.float64] | None = None

    @property
    def full_name(self) -> str:
        """Group and name."""
        return f'{self.group}/{self.name}'

    @property
    def whole(self) -> Origin:
        """The sequence that this is a part of, or this one itself."""
        return self.origin or Origin(self.full_name, len(self.ground_truth))

    def overlaps(self, trace: Trace, in_image: bool) -> npt.NDArray[np.float64]:
        """Return the overlap for each frame, on request only of what lies in the image."""
        return overlaps(self.ground_truth, trace.boxes, self.size if in_image else None)

    def to_json(self) -> dict[str, Any]:
        """Return plain values; absent boxes become None."""
        flags = {name: np.flatnonzero(values).tolist()
                 for name, values in self.attributes.items()}
        return {'name': self.name, 'group': self.group, 'size': list(self.size),
                'ground_truth': _rows(self.ground_truth),
                'attributes': flags, 'challenge': self.challenge,
                'origin': None if self.origin is None else asdict(self.origin),
                'other_truth': None if self.other_truth is None else _rows(self.other_truth)}

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> SequenceInfo:
        """
        Return the sequence that `to_json` described.

        Raises
        ------
        KeyError, OverflowError, TypeError, ValueError
            When `content` is something else.

        """
        boxes = box_rows(the_object(content)['ground_truth'])
        width, height = whole_numbers(content['size'])
        frames = np.arange(len(boxes))
        attributes = {name: np.isin(frames, whole_numbers(indices, len(boxes)))
                      for name, indices in the_object(content['attributes']).items()}
        return cls(the_text(content['name']), the_text(content['group']), (width, height),
                   boxes, attributes, the_text(content.get('challenge', '')),
                   _origin(content.get('origin')), _other_truth(content, len(boxes)))


@dataclass(frozen=True, eq=False)
class EvaluationRun:
    """
    Trackers on sequences under one protocol.

    Attributes
    ----------
    protocol : str
        'ope', 'vot' or 'anchors'.
    sequences : tuple of SequenceInfo
        What was evaluated.
    traces : mapping of str to tuple of Trace
        For each tracker, in the order of the command line, one trace a sequence.
    context : mapping
        Command, date, machine, versions, split, frame limit and skipped sequences.

    """

    protocol: str
    sequences: tuple[SequenceInfo, ...]
    traces: Mapping[str, tuple[Trace, ...]]
    context: Mapping[str, Any] = field(default_factory=dict)

    @property
    def trackers(self) -> tuple[str, ...]:
        """Names of the trackers."""
        return tuple(self.traces)

    def crashes(self, tracker: str) -> tuple[str, ...]:
        """Return `sequence: what happened` for each sequence that `tracker` crashed on."""
        return tuple(f'{sequence.full_name}: {trace.error}'
                     for sequence, trace in zip(self.sequences, self.traces[tracker])
                     if trace.error)

    @property
    def wholes(self) -> tuple[Origin, ...]:
        """Whole sequences, however many parts of them were evaluated."""
        return tuple(dict.fromkeys(sequence.whole for sequence in self.sequences))

    @property
    def challenges(self) -> tuple[str, ...]:
        """Challenges of the sequences in their order; empty without any."""
        found = dict.fromkeys(sequence.challenge for sequence in self.sequences)
        return tuple(name for name in found if name)

    def only(self, groups: tuple[str, ...] | None = None,
             challenge: str | None = None) -> EvaluationRun:
        """Return the run on the sequences of `groups` and of `challenge`; None keeps all."""
        kept = [index for index, sequence in enumerate(self.sequences)
                if (groups is None or sequence.group in groups)
                and (challenge is None or sequence.challenge == challenge)]
        return EvaluationRun(
            self.protocol, tuple(self.sequences[index] for index in kept),
            {name: tuple(traces[index] for index in kept)
             for name, traces in self.traces.items()}, self.context)


def run_path(output: Path, protocol: str) -> Path:
    """Return the file of the run under `protocol`."""
    return output / f'run-{protocol}.json'


def write_run(output: Path, protocol: str, sequences: tuple[SequenceInfo, ...],
              records: Mapping[str, list[str]], context: Mapping[str, Any]) -> None:
    """Write the run file; `records` names one record file a sequence for each tracker."""
    write_json(run_path(output, protocol), {
        'protocol': protocol, 'context': dict(context), 'records': dict(records),
        'sequences': [sequence.to_json() for sequence in sequences]})


def read_run(output: Path, protocol: str) -> EvaluationRun | None:
    """
    Return the run under `protocol`, or None when the folder has none.

    Raises
    ------
    ResultError
        When the run file, or a record that it names, is damaged or missing.

    """
    path = run_path(output, protocol)
    if not path.is_file():
        return None
    try:
        return _run(output, protocol, read_object(path))
    except MISFITS as error:
        said = str(error) if isinstance(error, ResultError) else damaged(path, error)
        raise ResultError(f'{said}; run `lmsco evaluate` with --protocol {protocol} and the same '
                          f'--output {output} again') from error


def read_runs(output: Path) -> tuple[dict[str, EvaluationRun], tuple[str, ...]]:
    """Return the runs in a folder by their protocol, and why others cannot be read."""
    runs: dict[str, EvaluationRun] = {}
    complaints: list[str] = []
    for protocol in PROTOCOLS:
        try:
            run = read_run(output, protocol)
        except ResultError as error:
            complaints.append(str(error))
        else:
            runs.update({} if run is None else {protocol: run})
    return runs, tuple(complaints)


def _run(output: Path, protocol: str, content: Mapping[str, Any]) -> EvaluationRun:
    """Return the run that a file describes; anything may be raised where it describes none."""
    sequences = tuple(map(SequenceInfo.from_json, the_list(content['sequences'])))
    lengths = [len(sequence.ground_truth) for sequence in sequences]
    unknown = {sequence.challenge for sequence in sequences} - {'', *CHALLENGES}
    if not lengths or unknown:
        raise ValueError(f'unknown challenges {sorted(unknown)}' if unknown else 'no sequences')
    traces = {}
    for name, records in the_object(content['records']).items():
        traces[name] = tuple(_record(output / the_text(record)) for record in the_list(records))
        if [len(trace.scores) for trace in traces[name]] != lengths:
            raise ValueError(f'the records of {name} do not fit the sequences')
    if content['protocol'] != protocol:
        raise ValueError('it is of another protocol')
    return EvaluationRun(protocol, sequences, traces, _context(content['context']))


def _context(content: Any) -> Mapping[str, Any]:
    """Return what a run file says of its making, if it can be shown."""
    for name in ('machine', 'versions'):
        the_object(the_object(content).get(name, {}))
    for number in the_object(content.get('anchors') or {}).values():
        whole_number(number or 0)
    for item in the_list(content.get('skipped', [])):
        the_text(item['name'] + item['reason'])
    groups = [name for names in the_object(content.get('scenes', {})).values()
              for name in the_list(names)]
    for word in (*the_list(content.get('challenges', [])), content.get('sequences', ''), *groups):
        the_text(word)
    return content


def _origin(content: Any) -> Origin | None:
    """Return the whole sequence that a run file names, if it does."""
    if content is None:
        return None
    return Origin(the_text(the_object(content)['full_name']), whole_number(content['frames']))


def _rows(boxes: npt.NDArray[np.float64]) -> list[list[float] | None]:
    """Return boxes as plain values, None for absent ones."""
    return [row.round(4).tolist() if np.isfinite(row).all() else None for row in boxes]


def _other_truth(content: Mapping[str, Any], frames: int) -> npt.NDArray[np.float64] | None:
    """Return the boxes of the visible channel, if a run file has them."""
    if content.get('other_truth') is None:
        return None
    boxes = box_rows(content['other_truth'])
    if len(boxes) != frames:
        raise ValueError(f'{len(boxes)} boxes of the visible channel for {frames} frames')
    return boxes


def _record(path: Path) -> Trace:
    trace = read_record(path)
    if trace is None:
        raise ResultError(f'{path} is missing')
    return trace

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

`run-ope.json` and `run-vot.json` in the output folder name trackers, sequences with
their true boxes, records, machine and versions: with the records it is all that
tables and the report are made from.
"""

from __future__ import annotations

from dataclasses import dataclass, field
import json
from pathlib import Path
from typing import Any, Mapping, Optional

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.errors import DatasetError
from lmsco_ros.evaluation.execution import PROTOCOLS
from lmsco_ros.evaluation.geometry import overlaps
from lmsco_ros.evaluation.record_store import read_record, write_json
from lmsco_ros.evaluation.trace import Trace


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

    """

    name: str
    group: str
    size: tuple[int, int]
    ground_truth: npt.NDArray[np.float64]
    attributes: Mapping[str, npt.NDArray[np.bool_]]
    challenge: str = ''

    @property
    def full_name(self) -> str:
        """Group and name."""
        return f'{self.group}/{self.name}'

    def overlaps(self, trace: Trace, in_image: bool) -> npt.NDArray[np.float64]:
        """Return the overlap for each frame, on request only of what lies in the image."""
        return overlaps(self.ground_truth, trace.boxes, self.size if in_image else None)

    def to_json(self) -> dict[str, Any]:
        """Return plain values; absent boxes become None."""
        rows = [row.round(4).tolist() if np.isfinite(row).all() else None
                for row in self.ground_truth]
        flags = {name: np.flatnonzero(values).tolist()
                 for name, values in self.attributes.items()}
        return {'name': self.name, 'group': self.group, 'size': list(self.size),
                'ground_truth': rows, 'attributes': flags, 'challenge': self.challenge}

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> SequenceInfo:
        """Return the sequence that `to_json` described."""
        rows = [row or [np.nan] * 4 for row in content['ground_truth']]
        frames = np.arange(len(rows))
        attributes = {name: np.isin(frames, indices)
                      for name, indices in content['attributes'].items()}
        return cls(content['name'], content['group'], tuple(content['size']),
                   np.array(rows, dtype=float), attributes, content.get('challenge', ''))


@dataclass(frozen=True, eq=False)
class EvaluationRun:
    """
    Trackers on sequences under one protocol.

    Attributes
    ----------
    protocol : str
        'ope' or 'vot'.
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
    def challenges(self) -> tuple[str, ...]:
        """Challenges of the sequences in their order; empty without any."""
        found = dict.fromkeys(sequence.challenge for sequence in self.sequences)
        return tuple(name for name in found if name)

    def only(self, groups: Optional[tuple[str, ...]] = None,
             challenge: Optional[str] = None) -> EvaluationRun:
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


def read_run(output: Path, protocol: str) -> Optional[EvaluationRun]:
    """Return the run under `protocol`, or None when the folder has none."""
    path = run_path(output, protocol)
    if not path.is_file():
        return None
    content = json.loads(path.read_text(encoding='utf-8'))
    traces = {name: tuple(_record(output / record) for record in records)
              for name, records in content['records'].items()}
    sequences = tuple(SequenceInfo.from_json(item) for item in content['sequences'])
    return EvaluationRun(content['protocol'], sequences, traces, content['context'])


def read_runs(output: Path) -> dict[str, EvaluationRun]:
    """Return the runs in a folder by their protocol."""
    return {protocol: run for protocol in PROTOCOLS
            if (run := read_run(output, protocol)) is not None}


def _record(path: Path) -> Trace:
    trace = read_record(path)
    if trace is None:
        raise DatasetError(f'record {path.name} is missing; run the evaluation again')
    return trace

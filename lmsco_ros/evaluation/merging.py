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

"""Several output folders as one run: other trackers, other sequences, or both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lmsco_ros.evaluation.errors import DatasetError
from lmsco_ros.evaluation.run_file import EvaluationRun, read_run, SequenceInfo
from lmsco_ros.evaluation.trace import Trace


def merged_run(folders: Sequence[Path], protocol: str) -> EvaluationRun | None:
    """
    Return what the folders hold under a protocol as one run, None where none holds any.

    Raises
    ------
    DatasetError
        When a tracker lacks a sequence that another one has, or folders differ in what is true
        of a sequence.
    ResultError
        When a folder is damaged.

    """
    runs = [(folder, run) for folder in folders
            if (run := read_run(folder, protocol)) is not None]
    if len(runs) < 2:
        return runs[0][1] if runs else None
    sequences = _sequences(runs)
    traces: dict[str, dict[str, Trace]] = {}
    for _, run in runs:
        for tracker, found in run.traces.items():
            traces.setdefault(tracker, {}).update(
                zip((sequence.full_name for sequence in run.sequences), found))
    _require_all(traces, sequences)
    return EvaluationRun(
        protocol, sequences,
        {tracker: tuple(found[sequence.full_name] for sequence in sequences)
         for tracker, found in traces.items()},
        _context([run.context for _, run in runs]))


def _sequences(runs: Sequence[tuple[Path, EvaluationRun]]) -> tuple[SequenceInfo, ...]:
    """Return the sequences of all runs, in the order of an evaluation of all of them."""
    found: dict[str, SequenceInfo] = {}
    for folder, run in runs:
        for sequence in run.sequences:
            known = found.setdefault(sequence.full_name, sequence)
            if not np.array_equal(known.ground_truth, sequence.ground_truth, equal_nan=True):
                raise DatasetError(f'{folder} has another {sequence.full_name} than the folders '
                                   'before it; tables need the same sequences for all trackers')
    if len(found) == len(runs[0][1].sequences):
        return tuple(found.values())
    challenges = list(dict.fromkeys(sequence.challenge for sequence in found.values()))
    return tuple(sorted(found.values(), key=lambda sequence: (
        challenges.index(sequence.challenge), sequence.whole.full_name.split('/'))))


def _require_all(traces: Mapping[str, Mapping[str, Trace]],
                 sequences: Sequence[SequenceInfo]) -> None:
    missing = [(tracker, sequence.full_name) for tracker, found in traces.items()
               for sequence in sequences if sequence.full_name not in found]
    if missing:
        tracker, name = missing[0]
        more = f' and {len(missing) - 1} more such pairs' if len(missing) > 1 else ''
        raise DatasetError(f'no folder has {tracker} on {name}{more}; tables need the same '
                           'sequences for all trackers')


def _context(contexts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return under which conditions the runs were made, those of the first where they differ."""
    skipped = {item['name']: item for context in contexts for item in context.get('skipped', ())}
    machines: dict[str, list[str]] = {}
    for context in contexts:
        for key, value in context.get('machine', {}).items():
            machines.setdefault(key, []).append(str(value))
    return {**contexts[0], 'shard': None, 'skipped': list(skipped.values()),
            'machine': {key: ' / '.join(dict.fromkeys(values))
                        for key, values in machines.items()}}

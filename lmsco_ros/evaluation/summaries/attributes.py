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

"""Figures on the frames of each annotated attribute, over the sequences that have any."""

from __future__ import annotations

import numpy as np

from lmsco_ros.evaluation.datasets.attributes import VOT_TIR_ATTRIBUTES
from lmsco_ros.evaluation.protocols.per_attribute import attribute_figures, AttributeFigures
from lmsco_ros.evaluation.protocols.supervised import counted_frames
from lmsco_ros.evaluation.run_file import EvaluationRun


def attribute_names(run: EvaluationRun) -> tuple[str, ...]:
    """Return the attributes annotated in any sequence, those of VOT-TIR first."""
    found = {name for sequence in run.sequences for name in sequence.attributes}
    known = tuple(name for name in VOT_TIR_ATTRIBUTES if name in found)
    return known + tuple(sorted(found - set(known)))


def summarize_attributes(run: EvaluationRun) -> dict[str, dict[str, AttributeFigures]]:
    """Return for each tracker the figures of each attribute; empty without annotations."""
    names = attribute_names(run)
    return {tracker: _pooled(run, tracker, names) for tracker in run.trackers if names}


def _pooled(run: EvaluationRun, tracker: str,
            names: tuple[str, ...]) -> dict[str, AttributeFigures]:
    overlaps, counted = [], []
    failures: list[int] = []
    flags: dict[str, list] = {name: [] for name in names}
    first = 0
    for sequence, trace in zip(run.sequences, run.traces[tracker]):
        frames = len(sequence.ground_truth)
        supervised = run.protocol == 'vot'
        overlaps.append(sequence.overlaps(trace, in_image=supervised))
        counted.append(counted_frames(frames, trace.starts, trace.failures) if supervised
                       else np.ones(frames, dtype=bool))
        failures.extend(first + failure for failure in trace.failures)
        for name in names:
            flags[name].append(sequence.attributes.get(name, np.zeros(frames, dtype=bool)))
        first += frames
    return attribute_figures(np.concatenate(overlaps), np.concatenate(counted), failures,
                             {name: np.concatenate(parts) for name, parts in flags.items()})

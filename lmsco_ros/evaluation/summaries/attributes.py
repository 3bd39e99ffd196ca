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

"""Figures on the frames of each attribute, annotated or by the true boxes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lmsco_ros.evaluation.datasets.attributes import VOT_TIR_ATTRIBUTES
from lmsco_ros.evaluation.protocols.per_attribute import (
    attribute_figures, AttributeFigures, box_attributes, Flags)
from lmsco_ros.evaluation.protocols.supervised import counted_frames
from lmsco_ros.evaluation.run_file import EvaluationRun


_BY_BOXES = (
    'The true boxes tell: fast motion is by more than the size of the target in one frame, scale '
    'and aspect ratio are outside of half and double the first ones, low resolution is below 1000 '
    'pixels (LaSOT).')


def is_annotated(run: EvaluationRun) -> bool:
    """Tell whether any sequence has attributes that somebody annotated."""
    return any(sequence.attributes for sequence in run.sequences)


def attribute_source(run: EvaluationRun) -> str:
    """Return a sentence on where the attributes come from."""
    return 'They are annotated.' if is_annotated(run) else _BY_BOXES


def summarize_attributes(run: EvaluationRun) -> dict[str, dict[str, AttributeFigures]]:
    """
    Return for each tracker the figures of each attribute, those of VOT-TIR first.

    Where any sequence is annotated, those that are not have no attributes; where none is, their
    true boxes tell.
    """
    known = is_annotated(run)
    attributes = [sequence.attributes if known else box_attributes(sequence.ground_truth)
                  for sequence in run.sequences]
    return {tracker: _pooled(run, tracker, attributes) for tracker in run.trackers}


def _names(attributes: list[Mapping[str, Flags]]) -> list[str]:
    order = {name: place for place, name in enumerate(VOT_TIR_ATTRIBUTES)}
    return sorted({name for flags in attributes for name in flags},
                  key=lambda name: (name == 'empty', order.get(name, len(order)), name))


def _pooled(run: EvaluationRun, tracker: str,
            attributes: list[Mapping[str, Flags]]) -> dict[str, AttributeFigures]:
    overlaps, counted = [], []
    failures: list[int] = []
    flags: dict[str, list] = {name: [] for name in _names(attributes)}
    first = 0
    for sequence, trace, known in zip(run.sequences, run.traces[tracker], attributes):
        frames = len(sequence.ground_truth)
        supervised = run.protocol == 'vot'
        overlaps.append(sequence.overlaps(trace, in_image=supervised))
        counted.append(counted_frames(frames, trace.starts, trace.failures) if supervised
                       else np.ones(frames, dtype=bool))
        failures.extend(first + failure for failure in trace.failures)
        for name, parts in flags.items():
            parts.append(known.get(name, np.zeros(frames, dtype=bool)))
        first += frames
    return attribute_figures(np.concatenate(overlaps), np.concatenate(counted), failures,
                             {name: np.concatenate(parts) for name, parts in flags.items()})

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
Fit the coefficients of `lmsco_ros.core.presence.trust`.

    python -m training.trust --data DATA --rendered FOLDER [--frames N]

DATA holds `thermal_dev`, FOLDER what `python -m training.extent.sequences` has written. Every 5th
clip of the train part, and every 3rd rendered sequence, none of which the extent network ever
saw, are tracked as they are and under the challenges that take the target away, move it, set
another one beside it, hide it in noise, or start on nothing. Printed are the coefficients, to be
copied; how far the probability is from the truth on average; and for each challenge the chance
that a box on the target is trusted more than one off it.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize
import yaml

from lmsco_ros.core import BoundingBox, LMSCOError, TrackerConfig
from lmsco_ros.core.backend import limit_threads, select_backend
from lmsco_ros.core.imaging.gain import survey
from lmsco_ros.core.networks.together import Asking, at_once
from lmsco_ros.core.presence.observer import Outlook, Sighting
from lmsco_ros.core.presence.trust import regressors
from lmsco_ros.core.track import Track
from lmsco_ros.core.weights.loading import load_networks
from lmsco_ros.evaluation.challenges import apply_challenge
from lmsco_ros.evaluation.datasets import scan_dataset, TrackingSequence
from lmsco_ros.evaluation.errors import EvaluationError, SequenceError
from lmsco_ros.evaluation.geometry import is_absent
from lmsco_ros.evaluation.protocols.calibration import calibration_error, calibration_terms
from lmsco_ros.evaluation.protocols.confidence import auroc, auroc_terms, GOOD_OVERLAP
from lmsco_ros.evaluation.split import load_split
from training.sources import data_folder, SPLIT
from training.train import CONFIG

CHALLENGES = ('', 'disappear_1s', 'leave', 'leave_edge', 'cut', 'cut_other_view', 'twin_crosses',
              'shutter', 'noise_step', 'stretch_step', 'start_on_background', 'start_on_noise')
NOTHING_THERE = ('start_on_background', 'start_on_noise')
RENDERED_EVERY = 3
# A box that moved with a detection overlaps it by more.
_FOLLOWED = 0.3

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Model:
    """
    One of the models that are fitted.

    Attributes
    ----------
    name : str
        That of its coefficients.
    columns : tuple of int
        Hints that it has.
    overlap : float
        What has to be exceeded by a box that is good.
    unfit : tuple of str
        Challenges that are not fitted: without edges, nothing tells from a target what stays as
        it was learned.

    """

    name: str
    columns: tuple[int, ...]
    overlap: float
    unfit: tuple[str, ...] = NOTHING_THERE


MODELS = (Model('MEASURED', (0, 1, 2, 3), GOOD_OVERLAP, ()),
          Model('UNMEASURED', (0, 1), GOOD_OVERLAP),
          Model('BELIEF_MEASURED', (0, 1, 2, 3), 0.0),
          Model('BELIEF_UNMEASURED', (0, 1), 0.0))


@dataclass(frozen=True)
class Records:
    """
    What was seen in the frames of one sequence.

    Attributes
    ----------
    hints : ndarray, shape (n, 4)
        What the coefficients multiply: sharpness, likeness, presence, vagueness.
    overlap : ndarray, shape (n,)
        Of the box at the detection with the target; 0 where that is absent.

    """

    hints: Array
    overlap: Array


class RecordingTrack(Track):
    """A track that keeps what speaks for the place it looks at first in each frame."""

    seen: tuple[tuple[float, ...], BoundingBox] | None = None

    def _look(self, outlook: Outlook) -> Asking[Sighting]:
        """Return the best detection; keep what the coefficients multiply, and where it is."""
        sighting = yield from super()._look(outlook)
        found = sighting.assessment
        self.seen = regressors(found.quality, found.likeness, found.evidence.presence,
                               found.evidence.vagueness), sighting.found
        return sighting


def main(arguments: Sequence[str] | None = None) -> None:
    """Track, fit and print; leave with 2 where there is nothing to track."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--data', type=data_folder('thermal_dev'), required=True)
    parser.add_argument('--rendered', type=Path, required=True)
    parser.add_argument('--frames', type=int, default=150, help='of each clip, at least 2')
    options = parser.parse_args(arguments)
    if options.frames < 2:
        parser.error(f'argument --frames: {options.frames} frames; at least 2 are needed')
    try:
        sequences = [*validation_clips(options.data / 'thermal_dev', options.frames),
                     *scan_dataset(options.rendered).sequences[::RENDERED_EVERY]]
    except EvaluationError as error:
        parser.error(str(error))
    limit_threads(1)
    records = {name: list(record_all(sequences, name)) for name in CHALLENGES}
    for model in MODELS:
        fitted = [part for name, parts in records.items() if name not in model.unfit
                  for part in parts]
        weights = fit(fitted, model)
        print(model.name, ' '.join(f'{value:.2f}' for value in weights),
              f'calibration error {miscalibration(fitted, model, weights):.3f}')
        for name, parts in records.items():
            print(f'    {name or "plain":<20}{separation(parts, model, weights):.3f}')


def validation_clips(dataset: Path, frames: int) -> list[TrackingSequence]:
    """
    Return the first frames of every clip that training looks at but does not learn from.

    Raises
    ------
    EvaluationError
        When the dataset holds none of them.

    """
    every = yaml.safe_load(CONFIG.read_text(encoding='utf-8'))['validation']['every']
    known = load_split(SPLIT).select('train', scan_dataset(dataset).sequences)
    return [clip.first(min(frames, len(clip))) for clip in known[::every]]


def record_all(sequences: Sequence[TrackingSequence], challenge: str) -> Iterator[Records]:
    """Yield the records of all sequences that fit a challenge."""
    config = TrackerConfig.preset('default')
    for sequence in sequences:
        try:
            changed = apply_challenge(sequence, challenge) if challenge else sequence
        except SequenceError:
            continue
        yield record(changed, config)


def record(sequence: TrackingSequence, config: TrackerConfig) -> Records:
    """Track a sequence and return what was seen."""
    truth = sequence.ground_truth
    absent = is_absent(truth)
    track: RecordingTrack | None = None
    hints, overlaps = [], []
    for frame in range(len(sequence)):
        image = sequence.frames[frame]
        if track is None:
            track = None if absent[frame] else _start(config, image, BoundingBox(*truth[frame]))
            continue
        track.seen = None
        at_once(track.advance(survey(image, config.intensity)))
        if track.seen is not None:
            seen, box = track.seen
            if track.result.box.overlap(box) > _FOLLOWED:
                box = track.result.box
            hints.append(seen)
            overlaps.append(0.0 if absent[frame] else box.overlap(BoundingBox(*truth[frame])))
    return Records(np.array(hints).reshape(-1, 4), np.array(overlaps))


def _start(config: TrackerConfig, image: npt.NDArray, box: BoundingBox) -> RecordingTrack | None:
    """Return a track from a box on, or None where nothing can be learned."""
    try:
        return RecordingTrack(config, select_backend('cpu'), load_networks(config),
                              survey(image, config.intensity), box)
    except LMSCOError:
        return None


def fit(records: Sequence[Records], model: Model) -> Array:
    """Return the coefficients of a logistic regression, the constant last."""
    hints = np.concatenate([part.hints for part in records])[:, model.columns]
    good = np.concatenate([part.overlap for part in records]) > model.overlap
    inputs = np.c_[hints, np.ones(len(hints))]

    def loss(values: Array) -> tuple[float, Array]:
        logits = inputs @ values
        slope = 1 / (1 + np.exp(-logits)) - good
        ridge = 1e-4 * np.append(values[:-1], 0)
        return (float((np.logaddexp(0, logits) - good * logits).mean() + values @ ridge),
                slope @ inputs / len(good) + 2 * ridge)

    return minimize(loss, np.zeros(inputs.shape[1]), jac=True).x


def separation(records: Sequence[Records], model: Model, weights: Array) -> float:
    """Return the chance that a good box is trusted more than another one."""
    terms = auroc_terms([odds(part, model, weights) for part in records], graded(records, model))
    return float(auroc(*terms, np.ones(len(records))))


def miscalibration(records: Sequence[Records], model: Model, weights: Array) -> float:
    """Return how far the probability is from the share of good boxes, on average."""
    terms = calibration_terms(
        [1 / (1 + np.exp(-odds(part, model, weights))) for part in records],
        graded(records, model))
    return float(calibration_error(terms, np.ones(len(records))))


def graded(records: Sequence[Records], model: Model) -> list[Array]:
    """Return 1 for each good box and 0 for each other one, as the measures take overlaps."""
    return [(part.overlap > model.overlap).astype(float) for part in records]


def odds(records: Records, model: Model, weights: Array) -> Array:
    """Return the log-odds of each frame."""
    return np.asarray(records.hints[:, model.columns] @ weights[:-1] + weights[-1])


if __name__ == '__main__':
    main()

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
clip of the train part, and all rendered sequences, which the extent network never saw, are
tracked as they are and under the challenges that take the target away, move it, or set another
one beside it. Printed are the coefficients, and for each challenge the chance that a detection on
the target is trusted more than one off it.
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
from lmsco_ros.evaluation.protocols.confidence import auroc, auroc_terms
from lmsco_ros.evaluation.split import load_split
from training.sources import data_folder, SPLIT
from training.train import CONFIG

CHALLENGES = ('', 'disappear_1s', 'disappear_3s', 'leave', 'cut', 'twin', 'twin_remains',
              'shutter')
# A copy of the target cannot be told from it by its looks: judged, but not fitted.
COPIES = ('twin', 'twin_remains')
PRESENT_SHARE = 0.9

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Records:
    """
    What was seen in the frames of one sequence.

    Attributes
    ----------
    hints : ndarray, shape (n, 3)
        What the coefficients multiply: sharpness, likeness, presence.
    overlap : ndarray, shape (n,)
        Of the detection with the target; 0 where that is absent.

    """

    hints: Array
    overlap: Array


class RecordingTrack(Track):
    """A track that keeps what speaks for the place it looks at first in each frame."""

    seen: tuple[tuple[float, float, float], BoundingBox] | None = None

    def _look(self, outlook: Outlook) -> Asking[Sighting]:
        """Return the best detection; keep what the coefficients multiply, and where it is."""
        sighting = yield from super()._look(outlook)
        evidence = sighting.assessment.evidence
        hints = regressors(sighting.assessment.quality, evidence.likeness,
                           evidence.presence or 0.0)
        self.seen = hints, self._box.moved_to(sighting.detection.center)
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
                     *scan_dataset(options.rendered).sequences]
    except EvaluationError as error:
        parser.error(str(error))
    limit_threads(1)
    records = {name: list(record_all(sequences, name)) for name in CHALLENGES}
    everything = [part for name, parts in records.items() if name not in COPIES
                  for part in parts]
    for label, columns in (('MEASURED', [0, 1, 2]), ('UNMEASURED', [0, 1])):
        weights = fit(everything, columns)
        print(label, ' '.join(f'{value:.2f}' for value in weights))
        for name, parts in records.items():
            print(f'    {name or "plain":<14}{separation(parts, columns, weights):.3f}')


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
            hints.append(seen)
            overlaps.append(0.0 if absent[frame] else box.overlap(BoundingBox(*truth[frame])))
    return Records(np.array(hints).reshape(-1, 3), np.array(overlaps))


def _start(config: TrackerConfig, image: npt.NDArray, box: BoundingBox) -> RecordingTrack | None:
    """Return a track from a box on, or None where nothing can be learned."""
    try:
        return RecordingTrack(config, select_backend('cpu'), load_networks(config),
                              survey(image, config.intensity), box)
    except LMSCOError:
        return None


def fit(records: Sequence[Records], columns: Sequence[int]) -> Array:
    """
    Return the coefficients of a logistic regression, the constant last.

    Detections with an overlap above 0.5 count against those without any.
    """
    hints = np.concatenate([part.hints for part in records])[:, columns]
    overlap = np.concatenate([part.overlap for part in records])
    good, bad = overlap > 0.5, overlap == 0
    weights = good * PRESENT_SHARE / good.sum() + bad * (1 - PRESENT_SHARE) / bad.sum()
    inputs = np.c_[hints, np.ones(len(hints))]

    def loss(values: Array) -> tuple[float, Array]:
        odds = inputs @ values
        slope = weights * (1 / (1 + np.exp(-odds)) - good)
        ridge = 1e-3 * np.append(values[:-1], 0)
        return (float(weights @ (np.logaddexp(0, odds) - good * odds) + values @ ridge),
                slope @ inputs + 2 * ridge)

    return minimize(loss, np.zeros(inputs.shape[1]), jac=True).x


def separation(records: Sequence[Records], columns: Sequence[int], weights: Array) -> float:
    """Return the chance that a detection on the target is trusted more than one off it."""
    kept = [(part.overlap > 0.5) | (part.overlap == 0) for part in records]
    scores = [part.hints[keep][:, columns] @ weights[:-1]
              for part, keep in zip(records, kept, strict=True)]
    terms = auroc_terms(scores, [part.overlap[keep]
                                 for part, keep in zip(records, kept, strict=True)])
    return float(auroc(*terms, np.ones(len(records))))


if __name__ == '__main__':
    main()

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

"""What `lmsco evaluate` is asked for, resolved: who, on what, and how to say so later."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import date
from difflib import get_close_matches
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from lmsco_ros.evaluation.challenges import apply_challenge
from lmsco_ros.evaluation.datasets import BrokenSequence, scan_dataset, TrackingSequence
from lmsco_ros.evaluation.datasets.parts import anchored_parts, AnchorPlan
from lmsco_ros.evaluation.environment import versions
from lmsco_ros.evaluation.errors import (
    DatasetError, RequestError, SequenceError, TrackerError)
from lmsco_ros.evaluation.jobs import Engine
from lmsco_ros.evaluation.split import load_split
from lmsco_ros.evaluation.trackers import available_names, resolve, TrackerSpec

_NAMES_SHOWN = 6


@dataclass(frozen=True)
class Shard:
    """
    A share of the sequences: every so manieth of them.

    Attributes
    ----------
    number, count : int
        Which one, from 1 on, of how many.

    """

    number: int
    count: int

    def of(self, sequences: Sequence[TrackingSequence]) -> list[TrackingSequence]:
        """Return the sequences of this share, or raise `RequestError` where it is empty."""
        chosen = list(sequences[self.number - 1::self.count])
        if not chosen:
            raise RequestError(f'share {self} of {len(sequences)} sequences is empty; make at '
                               f'most {len(sequences)} of them')
        return chosen

    def __str__(self) -> str:
        """Return the share as a command line gives it."""
        return f'{self.number}/{self.count}'


@dataclass(frozen=True)
class Request:
    """
    The sequences that an evaluation is asked for.

    Attributes
    ----------
    dataset : Path
        Folder of the dataset.
    pattern : str
        Shell pattern for `name` or `group/name`.
    frames : int or None
        Only the first so many frames of each sequence.
    split : Path or None
        File of a split, of which only one part is evaluated.
    part : str
        That part.
    challenges : tuple of str
        Each sequence once with each of these challenges; empty: as it was recorded.
    anchors : AnchorPlan or None
        Parts that begin at anchors along each sequence; None: the sequence as a whole.
    shard : Shard or None
        Only this share of the sequences.

    """

    dataset: Path
    pattern: str = '*'
    frames: int | None = None
    split: Path | None = None
    part: str = 'test'
    challenges: tuple[str, ...] = ()
    anchors: AnchorPlan | None = None
    shard: Shard | None = None


@dataclass(frozen=True)
class Selection:
    """
    What is evaluated.

    Attributes
    ----------
    sequences : tuple of TrackingSequence
        Sequences, or the parts of them that begin at anchors.
    broken : tuple of BrokenSequence
        Those that would have been evaluated but are broken.
    wholes : tuple of TrackingSequence
        The same as whole sequences.

    """

    sequences: tuple[TrackingSequence, ...]
    broken: tuple[BrokenSequence, ...]
    wholes: tuple[TrackingSequence, ...]


def select_sequences(request: Request) -> Selection:
    """
    Return the sequences of a request.

    Raises
    ------
    RequestError
        When there is no such dataset, pattern, split or part of it.
    DatasetError
        When none is left that can be used.

    """
    scan = scan_dataset(request.dataset)
    chosen = [item for item in scan.sequences if _matches(item.full_name, request.pattern)]
    broken = [item for item in scan.broken if _matches(item.name, request.pattern)]
    if not chosen and not broken:
        raise RequestError(_unmatched(request, [
            *(item.full_name for item in scan.sequences), *(item.name for item in scan.broken)]))
    if request.split is not None:
        split = load_split(request.split)
        chosen = split.select(request.part, chosen)
        broken = [item for item in broken if item.name in split.parts[request.part]]
    if not chosen:
        reasons = ''.join(f'\n  {item.name}: {item.reason}' for item in broken)
        raise DatasetError(f'no usable sequence of {request.dataset} matches '
                           f'{request.pattern!r}{reasons}')
    if request.shard is not None:
        chosen = request.shard.of(chosen)
    if request.frames is not None:
        chosen, empty = _cut(chosen, request.frames)
        broken += empty
    if request.challenges:
        chosen, unfit = _challenged(chosen, request.challenges)
        broken += unfit
    wholes = chosen
    if request.anchors is not None:
        chosen, unfit = _parted(chosen, request.anchors)
        broken += unfit
    if not chosen:
        reasons = ''.join(f'\n  {item.name}: {item.reason}' for item in broken)
        raise DatasetError(f'no sequence is left to evaluate{reasons}')
    return Selection(tuple(chosen), tuple(broken), tuple(wholes))


def build_trackers(names: Sequence[str]) -> tuple[TrackerSpec, ...]:
    """
    Return the trackers in the order given, each of them known to work here.

    Parameters
    ----------
    names : sequence of str
        As on the command line.

    Raises
    ------
    TrackerError
        When one is unknown or cannot be built here, or two have the same name.

    """
    specs = tuple(resolve(name) for name in dict.fromkeys(names))
    for name, count in Counter(spec.name for spec in specs).items():
        if count > 1:
            raise TrackerError(f'{count} trackers are called {name!r}, which is what tables and '
                               'folders tell them apart by; rename the file or the tracker')
    for spec in specs:
        try:
            spec.build().close()
        except TrackerError:
            raise
        except Exception as error:  # Whatever is thrown by code that is not ours.
            raise TrackerError(f'tracker {spec.name!r} cannot be built: '
                               f'{type(error).__name__}: {error}') from error
    return specs


def buildable_trackers() -> tuple[tuple[TrackerSpec, ...], tuple[str, ...]]:
    """Return every tracker that works here, and why others do not."""
    specs: list[TrackerSpec] = []
    reasons: list[str] = []
    for name in available_names():
        try:
            specs += build_trackers([name])
        except TrackerError as error:
            reasons.append(str(error))
    return tuple(specs), tuple(reasons)


def describe(request: Request, engine: Engine,
             skipped: Sequence[BrokenSequence]) -> dict[str, Any]:
    """Return the conditions of a run for its run file; no paths, no host."""
    return {
        'dataset': request.dataset.resolve().name, 'sequences': request.pattern,
        'frames': request.frames,
        **({'split': request.split.name, 'part': request.part,
            'scenes': load_split(request.split).scenes} if request.split else {}),
        'challenges': list(request.challenges), 'jobs': engine.at_once,
        'shard': None if request.shard is None else str(request.shard),
        'anchors': None if request.anchors is None else asdict(request.anchors),
        'date': date.today().isoformat(), 'machine': dict(engine.machine()),
        'versions': dict(versions()),
        'skipped': [{'name': item.name, 'reason': item.reason} for item in skipped],
    }


def _unmatched(request: Request, names: Sequence[str]) -> str:
    """Return what to say of a pattern that no name matches."""
    near = [*get_close_matches(request.pattern, names),
            *get_close_matches(request.pattern, [name.rpartition('/')[2] for name in names])]
    shown = list(dict.fromkeys(near)) or sorted(names)
    more = f' and {len(shown) - _NAMES_SHOWN} more' if len(shown) > _NAMES_SHOWN else ''
    return (f'no sequence of {request.dataset} matches {request.pattern!r}; '
            f'{"near are" if near else "there are"} {", ".join(shown[:_NAMES_SHOWN])}{more}; a '
            'pattern is a name or group/name in which * stands for anything')


def _cut(sequences: Sequence[TrackingSequence], frames: int,
         ) -> tuple[list[TrackingSequence], list[BrokenSequence]]:
    """Return the sequences cut to their first frames, and those without a target there."""
    kept, empty = [], []
    for sequence in sequences:
        try:
            kept.append(sequence.first(frames))
        except SequenceError as error:
            empty.append(BrokenSequence(sequence.full_name, f'first {frames} frames: {error}'))
    return kept, empty


def _challenged(sequences: Sequence[TrackingSequence], challenges: Sequence[str],
                ) -> tuple[list[TrackingSequence], list[BrokenSequence]]:
    """Return each sequence with each challenge, and the pairs that do not fit together."""
    made, unfit = [], []
    for challenge in challenges:
        for sequence in sequences:
            try:
                made.append(apply_challenge(sequence, challenge))
            except SequenceError as error:
                unfit.append(BrokenSequence(f'{sequence.full_name}+{challenge}', str(error)))
    return made, unfit


def _parted(sequences: Sequence[TrackingSequence], plan: AnchorPlan,
            ) -> tuple[list[TrackingSequence], list[BrokenSequence]]:
    """Return the parts of the sequences, and the sequences that have none."""
    parts: list[TrackingSequence] = []
    unfit = []
    for sequence in sequences:
        try:
            parts += anchored_parts(sequence, plan)
        except SequenceError as error:
            unfit.append(BrokenSequence(sequence.full_name, str(error)))
    return parts, unfit


def _matches(full_name: str, pattern: str) -> bool:
    return fnmatch(full_name, pattern) or fnmatch(full_name.rpartition('/')[2], pattern)

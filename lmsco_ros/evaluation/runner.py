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

"""Evaluate trackers on sequences: what is on disk is kept, the rest is run."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from lmsco_ros.evaluation.datasets import BrokenSequence, TrackingSequence
from lmsco_ros.evaluation.errors import DatasetError, ResultError, SequenceError
from lmsco_ros.evaluation.jobs import Engine, Job, LeftOut, Outcome
from lmsco_ros.evaluation.record_store import RecordStore
from lmsco_ros.evaluation.run_file import SequenceInfo, write_run
from lmsco_ros.evaluation.trackers import TrackerSpec


class Evaluation:
    """
    One evaluation, resumable at the level of a tracker on a sequence.

    Parameters
    ----------
    trackers : sequence of TrackerSpec
        Who is evaluated.
    sequences : sequence of TrackingSequence
        On what; those whose first image cannot be read are skipped and noted.
    protocol : str
        'ope', 'vot' or, on parts of sequences, 'anchors'.
    output : Path
        Folder for records and the run file.

    Attributes
    ----------
    done, pending : tuple of Job
        What has a record already, and what has none or a damaged one.
    damaged : list of str
        What is wrong with which record.
    finished : int
        Number of records that are kept by now.
    skipped : list of BrokenSequence
        Sequences that turned out to be unreadable.

    """

    def __init__(self, trackers: Sequence[TrackerSpec], sequences: Sequence[TrackingSequence],
                 protocol: str, output: Path) -> None:
        """Find out what is to be done."""
        self._trackers = tuple(trackers)
        self._protocol = protocol
        self._output = output
        self._store = RecordStore(output)
        self.skipped: list[BrokenSequence] = []
        self._infos: dict[str, SequenceInfo] = {}
        for sequence in sequences:
            self._describe(sequence)
        self._sequences = [sequence for sequence in sequences
                           if sequence.full_name in self._infos]
        jobs = [Job(tracker, sequence, protocol)
                for sequence in self._sequences for tracker in self._trackers]
        self.damaged: list[str] = []
        held = [self._holds(job) for job in jobs]
        self.pending = tuple(job for job, there in zip(jobs, held) if not there)
        self.done = tuple(job for job, there in zip(jobs, held) if there)
        self.finished = len(self.done)

    def _holds(self, job: Job) -> bool:
        try:
            return self._store.holds(job)
        except ResultError as error:
            self.damaged.append(str(error))
            return False

    def run(self, engine: Engine) -> Generator[tuple[Job, Outcome], None, None]:
        """Let `engine` run what is pending, and yield each job that is done."""
        with closing(engine.run(self.pending)) as outcomes:
            for job, outcome in outcomes:
                if isinstance(outcome, LeftOut):
                    self._drop(job.sequence.full_name, outcome.reason)
                else:
                    self._store.write(job, outcome)
                    self.finished += 1
                yield job, outcome

    def finish(self, context: Mapping[str, Any]) -> None:
        """
        Write the run file.

        Parameters
        ----------
        context : mapping
            How the run was made.

        Raises
        ------
        DatasetError
            When every sequence turned out to be broken.

        """
        kept = [sequence for sequence in self._sequences if sequence.full_name in self._infos]
        if not kept:
            reasons = '; '.join(f'{item.name}: {item.reason}' for item in self.skipped)
            raise DatasetError(f'no sequence could be evaluated: {reasons}')
        records = {tracker.name: [str(self._store.path(Job(tracker, sequence, self._protocol)))
                                  for sequence in kept] for tracker in self._trackers}
        infos = tuple(self._infos[sequence.full_name] for sequence in kept)
        write_run(self._output, self._protocol, infos, records, context)

    def _drop(self, name: str, reason: str) -> None:
        self.skipped.append(BrokenSequence(name, reason))
        self._infos.pop(name, None)

    def _describe(self, sequence: TrackingSequence) -> None:
        try:
            height, width = sequence.frames[0].shape[:2]
        except SequenceError as error:
            self._drop(sequence.full_name, str(error))
            return
        self._infos[sequence.full_name] = SequenceInfo(
            sequence.name, sequence.group, (width, height),
            sequence.ground_truth, sequence.attributes, sequence.challenge, sequence.origin,
            None if sequence.challenge or sequence.origin else sequence.other_truth)

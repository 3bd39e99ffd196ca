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

"""Results on disk: one JSON file for each tracker, sequence and version of both."""

from __future__ import annotations

from collections.abc import Mapping
import hashlib
from inspect import getfile
from pathlib import Path
import re
from typing import Any

from lmsco_ros.evaluation import execution, geometry, trace
from lmsco_ros.evaluation.datasets import frames
from lmsco_ros.evaluation.errors import ResultError
from lmsco_ros.evaluation.jobs import Job
from lmsco_ros.evaluation.plain_values import damaged, MISFITS, read_object
from lmsco_ros.evaluation.trace import Trace
from lmsco_ros.evaluation.trackers import TrackerSpec
from lmsco_ros.evaluation.trackers.code_version import sources_digest
from lmsco_ros.evaluation.whole_file import write_json


class RecordStore:
    """
    The record files below an output folder.

    A record's name holds a digest of everything that its content depends on: settings
    and code of the tracker, frames and ground truth, protocol, and the code that runs
    it. A record that exists is therefore never out of date. A tracker's version is
    taken when it is first asked for, so that code edited during a run does not split it.

    Parameters
    ----------
    output : Path
        Folder for results.

    """

    def __init__(self, output: Path) -> None:
        """Note the folder; it is made with the first record."""
        self._output = output
        self._identities: dict[str, tuple[str, str]] = {}

    def path(self, job: Job) -> Path:
        """Return where the record of `job` belongs, relative to the output folder."""
        tracker, code = self._identity(job.tracker)
        parts = (tracker, job.sequence.fingerprint, job.protocol, code)
        digest = hashlib.sha256('\0'.join(parts).encode()).hexdigest()[:12]
        name = file_name(f'{job.sequence.group}-{job.sequence.name}')
        return Path('records', job.protocol, file_name(job.tracker.name), f'{name}-{digest}.json')

    def holds(self, job: Job) -> bool:
        """
        Return whether `job` has been done.

        Raises
        ------
        ResultError
            When there is a record that is damaged, or of something else.

        """
        path = self._output / self.path(job)
        if not path.is_file():
            return False
        content = read_object(path)
        said = tuple(content.get(key) for key in ('tracker', 'sequence', 'protocol'))
        if said != (job.tracker.name, job.sequence.full_name, job.protocol):
            raise ResultError(f'{path} is damaged (it is a record of something else)')
        frames = len(_trace(path, content).scores)
        if frames != len(job.sequence):
            raise ResultError(f'{path} is damaged ({frames} frames of {len(job.sequence)})')
        return True

    def write(self, job: Job, result: Trace) -> None:
        """Store what came out of `job`."""
        write_json(self._output / self.path(job), {
            'tracker': job.tracker.name, 'sequence': job.sequence.full_name,
            'protocol': job.protocol, **result.to_json()})

    def _identity(self, tracker: TrackerSpec) -> tuple[str, str]:
        if tracker.name not in self._identities:
            self._identities[tracker.name] = identity(tracker)
        return self._identities[tracker.name]


def identity(tracker: TrackerSpec) -> tuple[str, str]:
    """Return what changes with a tracker's settings and code, and with the code that drives it."""
    modules = (execution, frames, geometry, trace)
    return tracker.identity, sources_digest(tuple(Path(getfile(module)) for module in modules))


def read_record(path: Path) -> Trace | None:
    """
    Return the trace in a record file, or None when there is no such file.

    Raises
    ------
    ResultError
        When the file is damaged.

    """
    return _trace(path, read_object(path)) if path.is_file() else None


def _trace(path: Path, content: Mapping[str, Any]) -> Trace:
    try:
        return Trace.from_json(content)
    except MISFITS as error:
        raise ResultError(damaged(path, error)) from error


def file_name(text: str) -> str:
    """Return `text` without what a file's name may not hold."""
    return re.sub(r'[^\w.+-]', '_', text)

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

import hashlib
import json
import os
from pathlib import Path
import re
import tempfile
from typing import Any, Optional

from lmsco_ros.evaluation import execution, geometry, trace
from lmsco_ros.evaluation.datasets import frames
from lmsco_ros.evaluation.trace import Trace
from lmsco_ros.evaluation.trackers.code_version import sources_digest
from lmsco_ros.evaluation.worker_pool import Job


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
        self._identities: dict[str, str] = {}
        modules = (execution, frames, geometry, trace)
        self._code = sources_digest(tuple(Path(module.__file__) for module in modules))

    def path(self, job: Job) -> Path:
        """Return where the record of `job` belongs, relative to the output folder."""
        if job.tracker.name not in self._identities:
            self._identities[job.tracker.name] = job.tracker.identity
        parts = (self._identities[job.tracker.name], job.sequence.fingerprint, job.protocol,
                 self._code)
        digest = hashlib.sha256('\0'.join(parts).encode()).hexdigest()[:12]
        name = _file_name(f'{job.sequence.group}-{job.sequence.name}')
        return Path('records', job.protocol, _file_name(job.tracker.name), f'{name}-{digest}.json')

    def holds(self, job: Job) -> bool:
        """Return whether `job` has been done."""
        return (self._output / self.path(job)).is_file()

    def write(self, job: Job, result: Trace) -> None:
        """Store what came out of `job`."""
        write_json(self._output / self.path(job), {
            'tracker': job.tracker.name, 'sequence': job.sequence.full_name,
            'protocol': job.protocol, **result.to_json()})


def read_record(path: Path) -> Optional[Trace]:
    """Return the trace in a record file, or None when there is no such file."""
    if not path.is_file():
        return None
    return Trace.from_json(json.loads(path.read_text(encoding='utf-8')))


def write_json(path: Path, content: Any) -> None:
    """Write a JSON file that is either complete or not there at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, temporary = tempfile.mkstemp(dir=path.parent, prefix='.', suffix='.partial')
    try:
        with os.fdopen(descriptor, 'w', encoding='utf-8') as stream:
            json.dump(content, stream)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise


def _file_name(text: str) -> str:
    return re.sub(r'[^\w.+-]', '_', text)

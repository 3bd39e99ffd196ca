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
What runs in a worker of a Dask cluster: a tracker's process of its own for each thread.

The tracker does not compute in the worker itself. So it has a thread and a random state for itself
whatever the worker was started with, a tracker that crashes is the same result as on a single
machine, and a worker answers its scheduler while a tracker computes.
"""

from __future__ import annotations

import os
import signal
import threading
from typing import Any, cast

from distributed import get_worker, WorkerPlugin

from lmsco_ros.evaluation.errors import EvaluationError
from lmsco_ros.evaluation.jobs import Job, LeftOut, Outcome
from lmsco_ros.evaluation.record_store import identity
from lmsco_ros.evaluation.worker_process import EndedError, ENDING, WorkerProcess

# Whoever started this is gone when nothing has come for so long.
_IDLE_SECONDS = 60.0


def dask_setup(worker: Any) -> None:
    """
    Let a worker that was started with signals blocked lead a process group of its own.

    Dask calls this in workers that preload this module. A signal to the group of the process that
    started them, such as Ctrl-C, is for that process, which ends them.
    """
    os.setsid()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)


class UnseenError(EvaluationError):
    """A worker cannot read the first frame of a sequence."""


class TrackerProcesses(WorkerPlugin):
    """The processes of trackers that belong to one Dask worker, kept from job to job."""

    def setup(self, worker: Any) -> None:
        """Begin without any."""
        self._lock = threading.Lock()
        self._idle: list[tuple[WorkerProcess, threading.Timer]] = []
        self._busy: set[WorkerProcess] = set()
        self._identities: dict[str, tuple[str, str]] = {}
        self._closed = False

    def teardown(self, worker: Any) -> None:
        """End all; those that are busy are waited for by whoever asked them."""
        with self._lock:
            self._closed = True
            for process in self._busy:
                process.kill()
            for process, timer in self._idle:
                timer.cancel()
                process.stop()
            self._idle = []

    def answer(self, job: Job) -> Outcome:
        """
        Return what came of a job.

        Raises
        ------
        EndedError
            When somebody ended the process that it ran in, or closed this worker.

        """
        process = self._take()
        try:
            process.connection.send(job)
            outcome = process.answer(job)
        finally:
            self._put_back(process)
        if self._closed:
            raise EndedError('a worker was closed')
        return outcome

    def identity(self, job: Job) -> tuple[str, str]:
        """Return the identity of the code behind a result, found once for each tracker."""
        if job.tracker.name not in self._identities:
            self._identities[job.tracker.name] = identity(job.tracker)
        return self._identities[job.tracker.name]

    def _take(self) -> WorkerProcess:
        with self._lock:
            process = self._take_idle() or WorkerProcess()
            self._busy.add(process)
        return process

    def _take_idle(self) -> WorkerProcess | None:
        """Return a process that waits; one that somebody ended meanwhile is put away."""
        while self._idle:
            process, timer = self._idle.pop()
            timer.cancel()
            if process.waits:
                return process
            process.stop()
        return None

    def _put_back(self, process: WorkerProcess) -> None:
        with self._lock:
            self._busy.discard(process)
            if process.lives and not self._closed:
                timer = threading.Timer(_IDLE_SECONDS, self._end, [process])
                timer.daemon = True
                timer.start()
                self._idle.append((process, timer))

    def _end(self, process: WorkerProcess) -> None:
        with self._lock:
            kept = [item for item in self._idle if item[0] is not process]
            if len(kept) < len(self._idle):
                self._idle = kept
                process.stop()


def evaluate(number: int, job: Job, expected: tuple[str, str], name: str) -> Outcome:
    """
    Return what came of a job; the task of the cluster.

    Parameters
    ----------
    number : int
        Of the job. That it begins is told under the topic `name`, for a worker may not live to
        tell anything after it.
    job : Job
        What is to be done.
    expected : tuple of str
        Identity of the code where the job comes from.
    name : str
        Of the `TrackerProcesses` of that run.

    Raises
    ------
    EvaluationError
        When this worker has other code.
    UnseenError
        When it has not the data.

    """
    worker = get_worker()
    worker.log_event(name, (number, 1))
    processes = cast(TrackerProcesses, worker.plugins[name])
    if processes.identity(job) != tuple(expected):
        raise EvaluationError(
            f'worker {worker.address} has other code, settings or files of the tracker '
            f'{job.tracker.name!r} than this machine; install the same version of lmsco_ros on '
            'all, and start the workers again')
    outcome = processes.answer(job)
    worker.log_event(name, (number, -1))
    if isinstance(outcome, LeftOut):
        _require_data(job, worker.address)
    return outcome


def _require_data(job: Job, address: str) -> None:
    """Tell a worker that does not see the data from a sequence that is broken further on."""
    try:
        job.sequence.frames[0]
    except (OSError, ValueError) as error:
        raise UnseenError(
            f'worker {address} cannot read the first frame of {job.sequence.full_name}, which '
            f'this machine can ({error}); the dataset has to lie at the same path on all '
            'workers') from error

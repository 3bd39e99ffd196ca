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
Processes of this machine that run trackers over sequences.

A process that dies takes only its own job with it: the job is reported and the next one gets
a new process, which `concurrent.futures` does not offer.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing.connection import wait
from typing import Any

from lmsco_ros.evaluation.environment import machine
from lmsco_ros.evaluation.jobs import Job, Outcome
from lmsco_ros.evaluation.worker_process import WorkerProcess


@dataclass(frozen=True)
class LocalProcesses:
    """
    Engine of processes that are started here.

    Attributes
    ----------
    at_once : int
        Their number.

    """

    at_once: int = 1

    def machine(self) -> Mapping[str, str]:
        """Return the model of this machine's processor and the number of its cores."""
        return machine()

    def run(self, jobs: Sequence[Job]) -> Generator[tuple[Job, Outcome], None, None]:
        """
        Yield each job with its outcome, in the order in which they finish.

        Parameters
        ----------
        jobs : sequence of Job
            What to run; nothing is started without any.

        Raises
        ------
        EndedError
            When somebody ended a process by a signal, which says nothing of its tracker.

        """
        pending = deque(jobs)
        idle: list[WorkerProcess] = []
        busy: dict[Any, tuple[WorkerProcess, Job]] = {}
        try:
            while pending or busy:
                while pending and len(busy) < self.at_once:
                    process, job = idle.pop() if idle else WorkerProcess(), pending.popleft()
                    busy[process.connection] = process, job
                    process.connection.send(job)
                for connection in wait(list(busy)):
                    process, job = busy.pop(connection)
                    outcome = process.answer(job)
                    idle += [process] * process.lives
                    yield job, outcome
        finally:
            for process in (*idle, *(process for process, _ in busy.values())):
                process.stop()

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
Spawned processes that run one tracker over one sequence at a time.

Each worker computes in a single thread, so that frames per second compare. A worker
that dies takes only its own job with it: the job is reported and the next one gets
a new worker, which `concurrent.futures` does not offer.

A worker leads a process group of its own, with whatever its tracker starts. So a signal to the
group of this process, such as Ctrl-C, does not make a worker look like a tracker that crashed,
and nothing outlives its end or that of this process, however that came.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Sequence
from contextlib import suppress
from dataclasses import dataclass
import multiprocessing
from multiprocessing.connection import Connection, wait
import os
import signal
import sys
import threading
from typing import Any

import cv2
from threadpoolctl import threadpool_limits

from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.errors import EvaluationError, SequenceError, TrackerError
from lmsco_ros.evaluation.execution import PROTOCOLS
from lmsco_ros.evaluation.trace import Trace
from lmsco_ros.evaluation.trackers import TrackerSpec

# What asks a process to end; a tracker that crashes does not die of these.
_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@dataclass(frozen=True, eq=False)
class Job:
    """One tracker on one sequence under one of `PROTOCOLS`."""

    tracker: TrackerSpec
    sequence: TrackingSequence
    protocol: str


@dataclass(frozen=True)
class Unreadable:
    """The sequence, not the tracker, was at fault; `reason` says how."""

    reason: str


Outcome = Trace | Unreadable


def run_jobs(jobs: Sequence[Job], workers: int,
             ) -> Generator[tuple[Job, Outcome], None, None]:
    """
    Yield each job with its outcome, in the order in which they finish.

    Parameters
    ----------
    jobs : sequence of Job
        What to run; nothing is started without any.
    workers : int
        Number of processes.

    Raises
    ------
    EvaluationError
        When somebody ended a worker by a signal, which says nothing of its tracker.

    """
    pending = deque(jobs)
    idle: list[_Worker] = []
    busy: dict[Any, tuple[_Worker, Job]] = {}
    try:
        while pending or busy:
            while pending and len(busy) < workers:
                worker, job = idle.pop() if idle else _Worker(), pending.popleft()
                worker.connection.send(job)
                busy[worker.connection] = worker, job
            for connection in wait(list(busy)):
                worker, job = busy.pop(connection)
                try:
                    outcome = worker.connection.recv()
                    idle.append(worker)
                except (EOFError, ConnectionError):
                    outcome = Trace.unanswered(len(job.sequence), worker.obituary())
                yield job, outcome
    finally:
        for worker in (*idle, *(worker for worker, _ in busy.values())):
            worker.stop()


class _Worker:
    """A process and the connection to it."""

    def __init__(self) -> None:
        context = multiprocessing.get_context('spawn')
        self.connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,), daemon=True)
        # It inherits that signals wait, until it leads its own group.
        waiting = signal.pthread_sigmask(signal.SIG_BLOCK, _ENDING)
        try:
            self._process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, waiting)
        theirs.close()

    def obituary(self) -> str:
        """Return what is known of a process that died."""
        os.waitid(os.P_PID, self._pid, os.WEXITED | os.WNOWAIT)
        self._end_group()
        self._process.join()
        code = self._process.exitcode or 0
        if -code in _ENDING:
            raise EvaluationError(f'a worker process was ended by {signal.Signals(-code).name}')
        return f'the process died with exit code {code}'

    def stop(self) -> None:
        """End the process whatever it does, and all that it started."""
        self.connection.close()
        self._end_group()
        self._process.kill()
        self._process.join()

    @property
    def _pid(self) -> int:
        assert self._process.pid is not None
        return self._process.pid

    def _end_group(self) -> None:
        """End the group that a process leads that was not waited for yet."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._pid, signal.SIGKILL)


def _serve(connection: Connection) -> None:
    """Answer jobs until the other side hangs up."""
    os.setsid()
    # Who says that all is to end says it to the other side too, which ends this one.
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDING)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        while True:
            connection.send(_run(connection.recv()))
    except (EOFError, ConnectionError):
        pass


def _end_with_parent() -> None:
    """End this process and what it started as soon as the one that started it is gone."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os.killpg(os.getpgrp(), signal.SIGKILL)


def _run(job: Job) -> Outcome:
    cv2.setRNGSeed(0)
    try:
        tracker = job.tracker.build()
    except TrackerError as error:
        return Trace.unanswered(len(job.sequence), str(error))
    try:
        with threadpool_limits(limits=1):
            _one_thread()
            return PROTOCOLS[job.protocol](tracker, job.sequence)
    except SequenceError as error:
        return Unreadable(str(error))
    finally:
        tracker.close()


def _one_thread() -> None:
    """Limit the libraries that keep a thread count of their own."""
    cv2.setNumThreads(1)
    torch = sys.modules.get('torch')
    if torch is not None:
        torch.set_num_threads(1)

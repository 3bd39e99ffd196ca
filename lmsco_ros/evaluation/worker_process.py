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
A process that runs one tracker over one sequence at a time.

It computes in a single thread, so that frames per second compare. It leads a process group of its
own, with whatever its tracker starts. So a signal to the group of the process that started it,
such as Ctrl-C, does not make it look like a tracker that crashed, and nothing outlives its end or
that of the process that started it, however that came.

`multiprocessing` has no such process: those of its processes that are daemons, as the workers of
a cluster are, may not start any.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
import os
import select
import signal
import socket
import subprocess
import sys
import threading

import cv2
from threadpoolctl import threadpool_limits

from lmsco_ros.evaluation.errors import EvaluationError, SequenceError, TrackerError
from lmsco_ros.evaluation.execution import PROTOCOLS
from lmsco_ros.evaluation.jobs import Job, LeftOut, Outcome
from lmsco_ros.evaluation.trace import Trace

# What asks a process to end; a tracker that crashes does not die of these.
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# The new process imports from where this one does, and hands no setting of that on to what its
# tracker starts.
_START = ('import sys; sys.path[:] = sys.argv[2:]; '
          f'from {__name__} import serve; serve(int(sys.argv[1]))')


class EndedError(EvaluationError):
    """Somebody ended a process by a signal, which says nothing of its tracker."""


class WorkerProcess:
    """
    The process and the connection to it.

    Attributes
    ----------
    connection : Connection
        Sends a `Job` and receives its `Outcome`; both may be waited for with others.

    """

    def __init__(self) -> None:
        """Start the process."""
        ours, theirs = socket.socketpair()
        self.connection = Connection(ours.detach())
        with signals_waiting():
            self._process = subprocess.Popen(
                [sys.executable, '-c', _START, str(theirs.fileno()), *sys.path],
                pass_fds=[theirs.fileno()], start_new_session=True, stdin=subprocess.DEVNULL)
        theirs.close()

    def answer(self, job: Job) -> Outcome:
        """
        Return what came of the job that was sent, also when the process died of it.

        Raises
        ------
        EndedError
            When somebody ended the process.

        """
        try:
            return self.connection.recv()
        except (EOFError, ConnectionError):
            return Trace.unanswered(len(job.sequence), self._obituary())

    @property
    def lives(self) -> bool:
        """Whether the process can be given another job."""
        return self._process.returncode is None

    @property
    def waits(self) -> bool:
        """Whether the process, which has no job, can take one: what died has hung up."""
        return self.lives and not self.connection.poll()

    def kill(self) -> None:
        """End the process whatever it does, and all that it started; wait for nothing."""
        if self.lives:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)

    def stop(self) -> None:
        """End the process whatever it does, and all that it started."""
        self.connection.close()
        self.kill()
        self._process.wait()

    def _obituary(self) -> str:
        """Return what is known of a process that died."""
        os.waitid(os.P_PID, self._process.pid, os.WEXITED | os.WNOWAIT)
        self.kill()
        code = self._process.wait()
        self.connection.close()
        if -code in ENDING:
            raise EndedError(f'a worker process was ended by {signal.Signals(-code).name}')
        return f'the process died with exit code {code}'


@contextmanager
def signals_waiting() -> Iterator[None]:
    """Let signals wait, also in what is started meanwhile, until that leads a group of its own."""
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def serve(descriptor: int) -> None:
    """
    Answer jobs until the other side hangs up.

    Parameters
    ----------
    descriptor : int
        Of the connected socket.

    """
    # Who says that all is to end says it to the other side too, which ends this one.
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
    os.set_inheritable(descriptor, False)
    threading.Thread(target=_end_when_left, args=(descriptor,), daemon=True).start()
    connection = Connection(descriptor)
    with suppress(EOFError, ConnectionError):
        while True:
            connection.send(_run(connection.recv()))


def _end_when_left(descriptor: int) -> None:
    """End this process and what it started as soon as the other side is gone."""
    hung_up = select.poll()
    hung_up.register(descriptor, 0)
    hung_up.poll()
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
        return LeftOut(str(error))
    finally:
        tracker.close()


def _one_thread() -> None:
    """Limit the libraries that keep a thread count of their own."""
    cv2.setNumThreads(1)
    torch = sys.modules.get('torch')
    if torch is not None:
        torch.set_num_threads(1)

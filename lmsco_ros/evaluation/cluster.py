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
The engine of a Dask cluster: jobs are its tasks, and what comes of them is sent back here.

Dask gives a task whose worker died to another one, and gives it up after so many deaths as its
scheduler allows. That counts those as well that only waited in a worker which another task ended;
so each task tells when it begins and ends, and only those that began twice and did not end
are left out.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import closing, contextmanager, ExitStack
import logging
import uuid

import dask
from distributed import as_completed, Client, Future, KilledWorker, LocalCluster

from lmsco_ros.evaluation import cluster_worker
from lmsco_ros.evaluation.cluster_worker import evaluate, TrackerProcesses, UnseenError
from lmsco_ros.evaluation.environment import machine
from lmsco_ros.evaluation.errors import EvaluationError, SequenceError
from lmsco_ros.evaluation.jobs import Job, LeftOut, Outcome
from lmsco_ros.evaluation.record_store import identity
from lmsco_ros.evaluation.worker_process import EndedError, signals_waiting

# What the scheduler holds at once, however many jobs there are; a cluster that grows with its
# tasks sees enough of them.
_FEWEST_SUBMITTED = 256
_PER_THREAD = 4
# A job that ended so many of its workers is left out.
_DEATHS = 2
_MOST_TRIES = 4
_CONNECT_SECONDS = 30
_GONE = 'the scheduler went away, or dropped the work; start it again'
_LOCALHOST = '127.0.0.1'


@contextmanager
def cluster_at(address: str) -> Iterator[DaskCluster]:
    """
    Yield the engine of the scheduler at `address`.

    Raises
    ------
    EvaluationError
        When there is none.

    """
    try:
        client = Client(address, timeout=_CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError) as error:
        raise EvaluationError(
            f'no scheduler answers at {address} ({error}); start one with `dask scheduler` and '
            'give the address that it says, such as tcp://10.0.0.1:8786') from error
    with client:
        yield DaskCluster(client)


@contextmanager
def local_cluster(workers: int) -> Iterator[DaskCluster]:
    """Yield the engine of a scheduler and `workers` single-threaded workers on loopback."""
    with ExitStack() as stack:
        stack.enter_context(dask.config.set(
            {'distributed.scheduler.allowed-failures': _DEATHS - 1}))
        with signals_waiting():
            cluster = stack.enter_context(LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, host=_LOCALHOST,
                memory_limit=0, dashboard_address=f'{_LOCALHOST}:0', silence_logs=logging.CRITICAL,
                preload=[cluster_worker.__name__]))
        yield DaskCluster(stack.enter_context(Client(cluster, set_as_default=False)))


class DaskCluster:
    """
    Engine of the workers that a Dask scheduler has and will have.

    Parameters
    ----------
    client : distributed.Client
        Connection to the scheduler.

    """

    def __init__(self, client: Client) -> None:
        """Ask nothing yet."""
        self._client = client
        self._most_threads = 0

    @property
    def at_once(self) -> int:
        """The most threads that the workers had whenever this was asked for."""
        self._most_threads = max(self._most_threads, sum(self._client.nthreads().values()))
        return self._most_threads

    @property
    def address(self) -> str:
        """Address of the scheduler."""
        return str(self._client.scheduler_info()['address'])

    @property
    def dashboard(self) -> str:
        """Address of the dashboard."""
        return self._client.dashboard_link

    def machine(self) -> Mapping[str, str]:
        """Return the models of the workers' processors and the number of cores of all hosts."""
        hosts = {address.rpartition(':')[0]: found
                 for address, found in self._client.run(machine).items()}
        if not hosts:
            return {}
        models = sorted({found['processor'] for found in hosts.values()})
        return {'processor': ', '.join(models),
                'cores': str(sum(int(found['cores']) for found in hosts.values()))}

    def run(self, jobs: Sequence[Job]) -> Generator[tuple[Job, Outcome], None, None]:
        """
        Yield each job with its outcome, in the order in which they finish.

        Parameters
        ----------
        jobs : sequence of Job
            What to run. Workers may come and go meanwhile.

        Raises
        ------
        EvaluationError
            When a worker cannot run any job, or the scheduler goes away.

        """
        tasks = _Tasks(self._client, jobs, lambda: _PER_THREAD * self.at_once)
        try:
            with tasks.open(), closing(tasks.outcomes()) as outcomes:
                yield from outcomes
        except OSError as error:
            raise EvaluationError(_GONE) from error


class _Tasks:
    """
    The tasks of one run.

    Parameters
    ----------
    client : distributed.Client
        Connection to the scheduler.
    jobs : sequence of Job
        What they do.
    enough : callable
        Returns how many keep all workers busy.

    """

    def __init__(self, client: Client, jobs: Sequence[Job], enough: Callable[[], int]) -> None:
        self._client = client
        self._jobs = jobs
        self._enough = enough
        self._name = f'lmsco-{uuid.uuid4().hex[:8]}'
        self._identities = {job.tracker.name: identity(job.tracker) for job in jobs}
        # Or how often a job has begun and not ended, which is the same when its worker is gone.
        self._deaths: Counter[int] = Counter()
        self._tries: Counter[int] = Counter()
        self._running: dict[Future, int] = {}

    @contextmanager
    def open(self) -> Iterator[None]:
        """Have the workers hold processes, those that come later too, and hear of their tasks."""
        self._client.register_plugin(TrackerProcesses(), self._name)
        self._client.subscribe_topic(self._name, self._on_told)
        try:
            yield
        finally:
            if self._client.status == 'running':
                self._client.cancel(list(self._running), force=True)
                self._client.unsubscribe_topic(self._name)
                self._client.unregister_worker_plugin(self._name)

    def outcomes(self) -> Generator[tuple[Job, Outcome], None, None]:
        """Yield each job with its outcome; the scheduler has some of them at a time."""
        waiting = deque(range(len(self._jobs)))
        finished = as_completed(loop=self._client.loop)
        while waiting or self._running:
            while waiting and len(self._running) < max(_FEWEST_SUBMITTED, self._enough()):
                finished.add(self._submit(waiting.popleft()))
            future = next(finished)
            number = self._running.pop(future)
            outcome = self._outcome(number, future)
            # What a worker still holds is made again when that worker dies.
            future.release()
            if outcome is None:
                waiting.appendleft(number)
            else:
                yield self._jobs[number], outcome

    def _submit(self, number: int) -> Future:
        job = self._jobs[number]
        task = (self._name, f'{job.tracker.name} {job.sequence.full_name}', self._tries[number])
        self._tries[number] += 1
        future = self._client.submit(
            evaluate, number, job, self._identities[job.tracker.name], self._name, key=task,
            pure=False)
        self._running[future] = number
        return future

    def _outcome(self, number: int, future: Future) -> Outcome | None:
        """Return what came of a job, None where it has to be tried again."""
        try:
            return future.result()
        except UnseenError as error:
            return self._broken(number, error)
        except (KilledWorker, EndedError) as error:
            return self._after_death(number, error)
        except EvaluationError:
            raise
        except CancelledError as error:
            raise EvaluationError(_GONE) from error
        except Exception as error:  # Whatever a worker lacks.
            raise EvaluationError(
                f'a worker failed: {type(error).__name__}: {error}; it needs the same lmsco_ros '
                'as this machine, with the extra `eval`, and the modules of the trackers'
            ) from error

    def _after_death(self, number: int, error: Exception) -> LeftOut | None:
        # What a worker told last may be lost with it, so that there is an end to this, too.
        if self._deaths[number] < _DEATHS and self._tries[number] < _MOST_TRIES:
            return None
        deaths = max(self._deaths[number], _DEATHS)
        return LeftOut(f'{deaths} workers died while they ran {self._jobs[number].tracker.name} '
                       f'on it ({_last_words(error)}); the same command tries it again')

    def _broken(self, number: int, error: UnseenError) -> LeftOut:
        """Return what is wrong with a sequence, unless it is so with one worker only."""
        try:
            self._jobs[number].sequence.frames[0]
        except SequenceError as here:
            return LeftOut(str(here))
        raise error

    def _on_told(self, event: tuple[float, tuple[int, int]]) -> None:
        number, change = event[1]
        self._deaths[number] += change


def _last_words(error: Exception) -> str:
    """Return what is known of the last death."""
    return f'the last was {error.last_worker.address}' \
        if isinstance(error, KilledWorker) else str(error)

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
A tracker in a thread of its own, fed through a mailbox; knows nothing of ROS.

Images are read here, when their turn comes. Everything that happens to a frame comes back as an
:class:`~lmsco_ros.node.outcome.Outcome`, errors included.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
import threading
import time
from types import MappingProxyType

import numpy.typing as npt

from lmsco_ros.core.errors import LMSCOError
from lmsco_ros.core.types import TrackResult
from lmsco_ros.node.followed_targets import FollowedTargets
from lmsco_ros.node.history import FrameHistory
from lmsco_ros.node.intake import Intake
from lmsco_ros.node.mailbox import Mailbox
from lmsco_ros.node.outcome import Outcome, PendingFrame, Phase, StartAnswer
from lmsco_ros.node.work import Item, Refuse, Request, Start, Step


class TrackerWorker(Intake):
    """
    Runs a tracker over frames as they come.

    Nobody who hands something over ever waits for the tracker.

    Parameters
    ----------
    targets : FollowedTargets
        Changed by the worker's thread only.
    deliver : callable
        Called with every outcome, in the worker's thread.
    mailbox, history
        As of :class:`~lmsco_ros.node.intake.Intake`.
    on_fault : callable
        Called with what was being done and what was raised by it that nobody expects, in the
        worker's thread; must not raise.

    Attributes
    ----------
    image_size : tuple of int or None
        Width and height of the last image that was read.

    """

    def __init__(self, targets: FollowedTargets, deliver: Callable[[Outcome], None], *,
                 mailbox: Mailbox[Item], history: FrameHistory[PendingFrame],
                 on_fault: Callable[[str, BaseException], object]) -> None:
        super().__init__(mailbox, history, targets.most)
        self._targets = targets
        self._deliver = deliver
        self._on_fault = on_fault
        self.image_size: tuple[int, int] | None = None
        # The rest belongs to the thread alone.
        self._busy_since: float | None = None
        self._cleared: int | None = None
        self._newest_start: tuple[Request, int] | None = None
        self._stopping = threading.Event()
        # A tracker that never returns must not keep the process alive.
        self._thread = threading.Thread(target=self._run, name='tracker', daemon=True)

    @property
    def track_id(self) -> int:
        """Number of the selected target, of the latest where there is none; 0 before it."""
        return self._targets.selected

    @property
    def results(self) -> Mapping[int, TrackResult]:
        """What was last said of each target, by its number."""
        return self._targets.results

    @property
    def busy_seconds(self) -> float:
        """Time since the work on the present frame began; 0 while the worker waits."""
        since = self._busy_since
        return 0.0 if since is None else time.monotonic() - since

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self, timeout: float = 1.0) -> bool:
        """
        End the thread after the frame it is at; what waits is discarded.

        Nothing is delivered any more when this returns, even if the tracker did not come
        back in time.

        Parameters
        ----------
        timeout : float
            Seconds to wait for the tracker.

        Returns
        -------
        bool
            Whether the thread ended in time.

        """
        self._stopping.set()
        self._mailbox.close()
        with self._intake:
            # Who refers to whom here goes in circles: it may take long until they are collected.
            self._history.clear()
        if self._thread.ident is not None:
            self._thread.join(timeout)
        return not self._thread.is_alive()

    def select(self, number: int) -> None:
        """Choose the target that is spoken of where only one is."""
        self._targets.select(number)

    def _run(self) -> None:
        while (item := self._mailbox.take()) is not None:
            self._busy_since = time.monotonic()
            try:
                self._handle(item)
            except BaseException as error:  # noqa: B902
                # Nothing may end the thread: the node would be deaf without a word.
                self._on_fault('answering an image', error)
            self._busy_since = None

    def _handle(self, item: Item) -> None:
        """Read the frame of an item, and do what the item asks for."""
        self._obey_resets()
        reset_since = item.orders.resets != self._orders.resets
        if reset_since and not item.live:
            return
        if isinstance(item, Refuse):
            self._report(item, Phase.REFUSED, item.reason, start=StartAnswer(reason=item.reason))
            return
        started = time.monotonic()
        try:
            image = item.frame.picture.read()
        except LMSCOError as error:
            self._set_aside(item, str(error), started)
        except Exception as error:  # noqa: B902
            self._set_aside(item, f'the image cannot be read: {type(error).__name__}: {error}',
                            started)
        else:
            self.image_size = image.shape[1], image.shape[0]
            if isinstance(item, Start) and not reset_since:
                self._begin(item, image, started)
            else:
                self._step(item, image, started)

    def _obey_resets(self) -> None:
        """Drop all targets if that was asked for since it was done last."""
        resets = self._orders.resets
        if self._cleared != resets:
            self._targets.clear()
            self._cleared = resets

    def _set_aside(self, item: Step | Start, reason: str, started: float) -> None:
        """Refuse an unreadable frame; a start that any frame would do for waits for another."""
        start = None
        with self._intake:
            self._history.discard(item.frame)
            if isinstance(item, Start):
                if item.request.stamp is None:
                    self._wait_again(item.request)
                else:
                    start = StartAnswer(reason=reason)
        self._report(item, Phase.REFUSED, reason, started=started, start=start)

    def _step(self, item: Step | Start, image: npt.NDArray, started: float) -> None:
        self._obey_resets()
        late = item.request if isinstance(item, Step) else None
        only = None if late is None else self._late_target(late)
        if not item.orders.enabled:
            self._report(item, Phase.DISABLED, image=image, started=started)
        elif not self._targets.ids:
            self._report(item, Phase.IDLE, image=image, started=started)
        elif only is None or only:
            self._track(item, image, lambda: (self._targets.step(
                image, item.frame.seconds, only), None), started)

    def _late_target(self, request: Request) -> tuple[int, ...]:
        """Return the target of a start in the past, or nothing if there is none any more."""
        if self._newest_start is None or self._newest_start[0] is not request:
            return ()
        return tuple({self._newest_start[1]} & set(self._targets.ids))

    def _begin(self, item: Start, image: npt.NDArray, started: float) -> None:
        if not item.request.is_wanted(self._targets.results):
            if item.live:
                self._step(item, image, started)
            return
        if not item.orders.enabled:
            reason = 'cannot start while tracking is disabled; enable it first'
            self._report(item, Phase.REFUSED, reason, image=image, started=started,
                         start=StartAnswer(reason=reason))
            return

        def start() -> tuple[Mapping[int, TrackResult], StartAnswer | None]:
            results, answer = self._targets.start(
                image, item.frame.seconds, item.request.place, follow=item.live)
            self._newest_start = (item.request, answer.number) if answer.accepted else None
            return results, answer

        self._track(item, image, start, started)

    def _track(self, item: Step | Start, image: npt.NDArray,
               work: Callable[[], tuple[Mapping[int, TrackResult], StartAnswer | None]],
               started: float) -> None:
        """
        Let the tracker work on a frame.

        What the tracker refuses leaves it as it was; anything else that it raises costs the
        targets, and only them.
        """
        try:
            results, start = work()
            dropped = self._targets.give_up(results, item.frame.stamp)
        except LMSCOError as error:
            self._report(item, Phase.REFUSED, str(error), image=image, started=started,
                         start=_refusal(item, str(error)))
        except Exception as error:  # noqa: B902
            reason = f'{type(error).__name__}: {error}'
            self._targets.clear()
            self._report(item, Phase.FAILED, reason, image=image, started=started,
                         start=_refusal(item, reason))
        else:
            self._report(item, Phase.TRACKED if results else Phase.REFUSED,
                         '' if start is None else start.reason, results=results, image=image,
                         started=started, start=start, dropped=dropped)
            # What this raises, the next frame raises again, and is answered so.
            self._targets.learn()

    def _report(self, item: Item, phase: Phase, error: str = '', *,
                results: Mapping[int, TrackResult] = MappingProxyType({}),
                image: npt.NDArray | None = None, started: float | None = None,
                start: StartAnswer | None = None, dropped: tuple[int, ...] = ()) -> None:
        if not self._stopping.is_set():
            finished = time.monotonic()
            selected = self._targets.selected
            # Where one that is started late catches up, nothing is said of the others.
            track_id = selected if selected in results else max(results, default=selected)
            self._deliver(Outcome(
                item.frame, phase, results, track_id, item.live, error,
                finished if started is None else started, finished, image, start, dropped))


def _refusal(item: Item, reason: str) -> StartAnswer | None:
    """Return the answer to the wish of an item, if it is one to start."""
    return StartAnswer(reason=reason) if isinstance(item, Start) else None

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


"""What exists while the node is active: a worker between what is heard and what is said."""

from __future__ import annotations

from collections.abc import Callable

from std_msgs.msg import Header

from lmsco_ros.node.diagnostics import HealthMonitor, Problem, refused_status
from lmsco_ros.node.followed_targets import FollowedTargets
from lmsco_ros.node.guarded_node import GuardedNode
from lmsco_ros.node.history import FrameHistory
from lmsco_ros.node.inputs import Inputs
from lmsco_ros.node.mailbox import BoundedMailbox, LatestMailbox, Mailbox
from lmsco_ros.node.outcome import Outcome, Phase, Tracker
from lmsco_ros.node.outputs import Outputs
from lmsco_ros.node.parameters import Settings
from lmsco_ros.node.worker import TrackerWorker
from msg_adapters.status import Level

# A signal has to end the process within a second, whatever the tracker is at.
_STOP_SECONDS = 0.6
# Messages of one kind are repeated in the log after this time at the earliest.
_QUIET_SECONDS = 5.0
_MEGABYTE = 1_000_000


class TrackingSession:
    """
    Receives, tracks and publishes from its making until it is stopped.

    Parameters
    ----------
    node : GuardedNode
        Owner of the subscriptions.
    settings : Settings
        Of the images and the mailbox.
    tracker : Tracker
        Used by the worker's thread only.
    outputs : Outputs
        Where the answers go.
    monitor : HealthMonitor
        Is told of everything that happens.

    """

    def __init__(self, node: GuardedNode, settings: Settings, tracker: Tracker,
                 outputs: Outputs, monitor: HealthMonitor) -> None:
        self._node = node
        self._outputs = outputs
        self._monitor = monitor
        self.worker = TrackerWorker(
            FollowedTargets(tracker, settings.max_targets, settings.drop_after),
            self._deliver, on_fault=node.faults.note,
            mailbox=_mailbox(settings, node.guarded('waking the executor', self._wake)),
            history=FrameHistory(settings.frame_history_seconds, settings.frame_history_frames,
                                 settings.frame_history_megabytes * _MEGABYTE))
        monitor.restart()
        self.worker.start()
        try:
            self._inputs = Inputs(node, settings, self.worker, monitor, self._refuse,
                                  outputs.states.calibrate)
        except Exception:
            self.worker.stop(_STOP_SECONDS)
            raise

    @property
    def image_topic(self) -> str:
        """Full name of the topic that images are expected on."""
        return self._inputs.image_topic

    def problem(self, timeout: float) -> Problem | None:
        """Return what keeps images from coming in, or answers from going out."""
        busy = self.worker.busy_seconds
        if busy > timeout:
            return Problem(Level.ERROR, f'the tracker has been at one frame for {busy:.0f} s; '
                           'deactivate the node and configure it again')
        return self._inputs.problem(timeout)

    def stop(self) -> bool:
        """Stop listening and tracking; return whether the tracker came back in time."""
        self._inputs.close()
        return self.worker.stop(_STOP_SECONDS)

    def _deliver(self, outcome: Outcome) -> None:
        """Tell what became of a frame; runs in the worker's thread."""
        log = self._node.get_logger()
        self._monitor.answered(outcome)
        if outcome.phase is Phase.FAILED:
            log.error(f'the tracker failed, the targets are dropped: {outcome.error}')
        elif outcome.refused:
            log.error(outcome.error, throttle_duration_sec=_QUIET_SECONDS)
        for number in outcome.dropped:
            log.info(f'target {number} is dropped: it was lost for too long (drop_after)')
        published = self._outputs.publish(outcome, self.worker.dropped_frames)
        self._monitor.published(outcome, published)

    def _wake(self) -> None:
        """Let the executor look again at what it left with the middleware."""
        executor = self._node.executor
        if executor is not None:
            executor.wake()

    def _refuse(self, header: Header, reason: str, start: bool = False) -> None:
        """Tell that a message cannot be used, and whether it was one to start."""
        self._monitor.refused(reason)
        self._outputs.publish_statuses([refused_status(
            reason, self.worker.track_id, self.worker.dropped_frames, start=start)], header)
        self._node.get_logger().error(reason, throttle_duration_sec=_QUIET_SECONDS)


def _mailbox(settings: Settings, freed: Callable[[], None]) -> Mailbox:
    """Return the mailbox that the frame policy names."""
    if settings.frame_policy == 'latest':
        return LatestMailbox()
    return BoundedMailbox(settings.queue_size, freed)

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

import traceback

from rclpy.lifecycle import LifecycleNode
from std_msgs.msg import Header

from lmsco_ros.node.diagnostics import HealthMonitor, Problem, refused_status
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


class TrackingSession:
    """
    Receives, tracks and publishes from its making until it is stopped.

    Parameters
    ----------
    node : LifecycleNode
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

    def __init__(self, node: LifecycleNode, settings: Settings, tracker: Tracker,
                 outputs: Outputs, monitor: HealthMonitor) -> None:
        self._node = node
        self._outputs = outputs
        self._monitor = monitor
        self.worker = TrackerWorker(
            tracker, self._deliver, mailbox=_mailbox(settings),
            history=FrameHistory(settings.frame_history_seconds, settings.frame_history_frames))
        monitor.restart()
        self._inputs = Inputs(node, settings, self.worker, monitor, self._refuse)
        self.worker.start()

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
        try:
            self._monitor.answered(outcome)
            published = self._outputs.publish(outcome, self.worker.dropped_frames)
            self._monitor.published(outcome, published)
            if outcome.phase is Phase.FAILED:
                log.error(f'the tracker failed, the target is dropped: {outcome.error}')
            elif outcome.phase is Phase.REFUSED:
                log.error(outcome.error, throttle_duration_sec=_QUIET_SECONDS)
        except Exception:  # noqa: B902
            # A signal invalidates the publishers at any moment; anything else is a mistake.
            if self._node.context.ok():
                log.error(traceback.format_exc(), throttle_duration_sec=_QUIET_SECONDS)

    def _refuse(self, header: Header, reason: str) -> None:
        """Tell that a message cannot be used."""
        self._monitor.refused(reason)
        self._outputs.publish_status(refused_status(
            reason, self.worker.track_id, self.worker.dropped_frames), header)
        self._node.get_logger().error(reason, throttle_duration_sec=_QUIET_SECONDS)


def _mailbox(settings: Settings) -> Mailbox:
    """Return the mailbox that the frame policy names."""
    if settings.frame_policy == 'latest':
        return LatestMailbox()
    return BoundedMailbox(settings.queue_size)

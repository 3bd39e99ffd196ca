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


"""The lifecycle node `lmsco_tracker`: receives images, lets the worker track, publishes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import functools
import sys
import traceback

from diagnostic_msgs.msg import DiagnosticArray
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger

from lmsco_ros.core.errors import LMSCOError
from lmsco_ros.node import parameters
from lmsco_ros.node.diagnostics import HealthMonitor, refused_status, silence_warning
from lmsco_ros.node.history import FrameHistory
from lmsco_ros.node.inputs import Inputs
from lmsco_ros.node.mailbox import BoundedMailbox, LatestMailbox
from lmsco_ros.node.outputs import Outputs
from lmsco_ros.node.parameters import Settings
from lmsco_ros.node.tracker_factory import make_tracker
from lmsco_ros.node.worker import Outcome, Phase, Tracker, TrackerWorker
from msg_adapters.status import message_from_diagnoses

# A signal has to end the process within a second, whatever the tracker is at.
_STOP_SECONDS = 0.6
_HEALTH_PERIOD = 1.0
_NOT_ACTIVE = 'the node is not active; activate it first'

_Transition = Callable[['TrackerNode', LifecycleState], TransitionCallbackReturn]


def _reported(transition: _Transition) -> _Transition:
    """Log what a transition raises, which rclpy keeps to itself."""
    @functools.wraps(transition)
    def wrapper(self: TrackerNode, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return transition(self, state)
        except LMSCOError as error:
            self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        except Exception:  # noqa: B902
            self.get_logger().error(traceback.format_exc())
            return TransitionCallbackReturn.ERROR
    return wrapper


class TrackerNode(LifecycleNode):
    """
    Connects ROS to a tracker; decides nothing itself.

    Configured: parameters are read, the tracker exists, topics and services are offered.
    Active: images are received and tracked. Deactivating drops the target.

    Parameters
    ----------
    node_name : str
        Name, unless remapped.
    tracker_factory : callable
        Makes the tracker from the :class:`~lmsco_ros.node.parameters.Settings`.
    **kwargs
        As for `rclpy.lifecycle.LifecycleNode`: context, parameter_overrides, ...

    """

    def __init__(self, node_name: str = 'lmsco_tracker', *,
                 tracker_factory: Callable[[Settings], Tracker] = make_tracker,
                 **kwargs) -> None:
        super().__init__(node_name, **kwargs)
        self._tracker_factory = tracker_factory
        self._tracker: Tracker | None = None
        self._outputs: Outputs | None = None
        self._inputs: Inputs | None = None
        self._worker: TrackerWorker | None = None
        self._monitor = HealthMonitor()
        self._served = []
        self._health_timer = None
        self._health_publisher = None
        try:
            self.settings = parameters.declare(self)
        except ParameterException:
            super().destroy_node()
            raise
        self.add_on_set_parameters_callback(self._judge_change)
        self.add_post_set_parameters_callback(self._apply_change)
        if self.settings.autostart:
            if self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
                self.trigger_activate()

    @property
    def is_active(self) -> bool:
        """Whether images are received and tracked."""
        return self._worker is not None

    @_reported
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Read the parameters, make the tracker, offer topics and services."""
        self.settings = parameters.read(self)
        self._tracker = self._tracker_factory(self.settings)
        self._outputs = Outputs(self, self.settings)
        self._served = [
            self.create_service(Trigger, '~/reset', self._on_reset),
            self.create_service(SetBool, '~/set_enabled', self._on_set_enabled),
        ]
        self._health_publisher = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        # Health must be told while a simulated clock stands still, too.
        self._health_timer = self.create_timer(
            _HEALTH_PERIOD, self._report_health, clock=Clock(clock_type=ClockType.STEADY_TIME))
        return super().on_configure(state)

    @_reported
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start to receive and track."""
        settings = self.settings
        self._worker = TrackerWorker(
            self._tracker, self._deliver,
            mailbox=(LatestMailbox() if settings.frame_policy == 'latest'
                     else BoundedMailbox(settings.queue_size)),
            history=FrameHistory(settings.frame_history_seconds, settings.frame_history_frames))
        self._worker.start()
        self._monitor.restart()
        self._inputs = Inputs(self, settings, self._worker, self._monitor, self._refuse)
        self.get_logger().info(f'waiting for images on {self._inputs.image_topic}')
        return super().on_activate(state)

    @_reported
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop to receive and track; the target is dropped."""
        if not self._stop_tracking():
            self.get_logger().error('the tracker did not come back from its last frame')
            return TransitionCallbackReturn.ERROR
        return super().on_deactivate(state)

    @_reported
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give back what was taken on configuring."""
        self._release()
        return super().on_cleanup(state)

    @_reported
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give back everything, from whatever state."""
        self._release()
        return super().on_shutdown(state)

    @_reported
    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give back everything, so that the node can be configured again."""
        self._release()
        return super().on_error(state)

    def destroy_node(self) -> None:
        """Stop the worker before the publishers that it uses go away."""
        self._release()
        super().destroy_node()

    def _stop_tracking(self) -> bool:
        if self._inputs is not None:
            self._inputs.close()
            self._inputs = None
        stopped = self._worker is None or self._worker.stop(_STOP_SECONDS)
        self._worker = None
        return stopped

    def _release(self) -> None:
        self._stop_tracking()
        if self._outputs is not None:
            self._outputs.close()
            self._outputs = None
        for service in self._served:
            self.destroy_service(service)
        self._served = []
        if self._health_timer is not None:
            self.destroy_timer(self._health_timer)
            self.destroy_publisher(self._health_publisher)
            self._health_timer = self._health_publisher = None
        self._tracker = None

    def _deliver(self, outcome: Outcome) -> None:
        """Publish what became of a frame; runs in the worker's thread."""
        try:
            self._monitor.answered(outcome)
            self._outputs.publish(outcome, self._worker.dropped_frames)
            if outcome.phase is Phase.FAILED:
                self.get_logger().error(
                    f'the tracker failed, the target is dropped: {outcome.error}')
            elif outcome.phase is Phase.REFUSED:
                self.get_logger().error(outcome.error)
        except Exception:  # noqa: B902
            # A signal invalidates the publishers at any moment; anything else is a mistake.
            if self.context.ok():
                self.get_logger().error(traceback.format_exc(), throttle_duration_sec=5.0)

    def _refuse(self, header: Header, reason: str) -> None:
        """Tell that a message cannot be used."""
        self._monitor.refused(reason)
        self._outputs.publish_status(refused_status(
            reason, self._worker.track_id, self._worker.dropped_frames), header)
        self.get_logger().error(reason, throttle_duration_sec=5.0)

    def _on_reset(self, request: Trigger.Request,
                  response: Trigger.Response) -> Trigger.Response:
        if self._worker is not None:
            self._worker.reset()
        response.success = self.is_active
        response.message = 'the target is dropped' if self.is_active else _NOT_ACTIVE
        return response

    def _on_set_enabled(self, request: SetBool.Request,
                        response: SetBool.Response) -> SetBool.Response:
        if self._worker is not None:
            self._worker.set_enabled(request.data)
        response.success = self.is_active
        response.message = ('enabled' if request.data else 'disabled') if self.is_active \
            else _NOT_ACTIVE
        return response

    def _report_health(self) -> None:
        warning, silence = '' if self.is_active else 'inactive', self._monitor.silence()
        if self._inputs is not None and silence > self.settings.no_image_timeout:
            topic = self._inputs.image_topic
            warning = silence_warning(silence, topic, self.count_publishers(topic))
            self.get_logger().warning(warning, throttle_duration_sec=10.0)
        dropped = self._worker.dropped_frames if self._worker is not None else 0
        diagnosis = self._monitor.report(self.get_name(), warning=warning,
                                         dropped_frames=dropped)
        header = Header(stamp=self.get_clock().now().to_msg())
        self._health_publisher.publish(message_from_diagnoses([diagnosis], header))

    def _judge_change(self, changes: list[Parameter]):
        return parameters.judge_change(changes, configured=self._tracker is not None)

    def _apply_change(self, changes: list[Parameter]) -> None:
        self.settings = parameters.read(self)
        if self._outputs is not None:
            self._outputs.settings = self.settings


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until a signal comes; return the exit code."""
    rclpy.init(args=args)
    node = None
    try:
        node = TrackerNode()
        if node.settings.autostart and not node.is_active:
            return 1
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except ParameterException as error:
        print(f'tracker_node: {error}', file=sys.stderr)
        return 1
    except rclpy_implementation.RCLError:
        # A signal may surface as the error of whatever used the context at that moment.
        if rclpy.ok():
            raise
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())

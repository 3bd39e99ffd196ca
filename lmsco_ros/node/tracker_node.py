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


"""The lifecycle node `lmsco_tracker`: parameters, transitions, services and health."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
import functools
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import ParameterException
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger

from lmsco_ros.core.errors import LMSCOError
from lmsco_ros.node import parameters
from lmsco_ros.node.diagnostics import HealthMonitor, Problem
from lmsco_ros.node.guarded_node import GuardedNode
from lmsco_ros.node.outcome import Tracker
from lmsco_ros.node.outputs import Outputs
from lmsco_ros.node.parameters import Settings
from lmsco_ros.node.session import TrackingSession
from lmsco_ros.node.tracker_factory import make_tracker, with_fallback
from msg_adapters.status import Level, message_from_diagnoses

_HEALTH_PERIOD = 1.0
_NOT_ACTIVE = 'the node is not active; activate it first'

_Transition = Callable[['TrackerNode', LifecycleState], TransitionCallbackReturn]


def _reported(transition: _Transition) -> _Transition:
    """Tell what a transition raises, which rclpy keeps to itself."""
    @functools.wraps(transition)
    def wrapper(self: TrackerNode, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return transition(self, state)
        except LMSCOError as error:
            self._fail(str(error))
            return TransitionCallbackReturn.FAILURE
        except Exception as error:  # noqa: B902
            self.faults.note(f'the transition {transition.__name__}', error)
            return TransitionCallbackReturn.ERROR
    return wrapper


class TrackerNode(GuardedNode):
    """
    Connects ROS to a tracker; decides nothing itself.

    Configured: parameters are read, the tracker exists, topics and services are offered.
    Active: images are received and tracked. Deactivating drops the targets.

    Parameters
    ----------
    node_name : str
        Name, unless remapped.
    tracker_factory : callable
        Makes the tracker from the :class:`~lmsco_ros.node.parameters.Settings`.
    **kwargs
        As for `rclpy.lifecycle.LifecycleNode`: context, parameter_overrides, ...

    Raises
    ------
    rclpy.exceptions.ParameterException
        When a parameter is given a value that it cannot have.

    """

    def __init__(self, node_name: str = 'lmsco_tracker', *,
                 tracker_factory: Callable[[Settings], Tracker] = make_tracker,
                 **kwargs: Any) -> None:
        self._monitor = HealthMonitor()
        super().__init__(node_name, count_fault=self._monitor.faulted,
                         count_refusal=self._monitor.turned_away, **kwargs)
        self._tracker_factory = tracker_factory
        self._tracker: Tracker | None = None
        self._outputs: Outputs | None = None
        self._session: TrackingSession | None = None
        self._offered = contextlib.ExitStack()
        try:
            self.settings = parameters.declare(self)
        except ParameterException:
            super().destroy_node()
            raise
        self.add_on_set_parameters_callback(self._judge_change)
        self.add_post_set_parameters_callback(self._apply_change)
        self._health = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        # Health must be told while a simulated clock stands still, too.
        self.create_timer(_HEALTH_PERIOD, self._report_health,
                          clock=Clock(clock_type=ClockType.STEADY_TIME))
        if self.settings.autostart:
            if self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
                self.trigger_activate()

    @property
    def is_active(self) -> bool:
        """Whether images are received and tracked."""
        return self._session is not None

    @_reported
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Read the parameters, make the tracker, offer topics and services."""
        self.settings = parameters.read(self)
        self._monitor.warned('')
        try:
            self._tracker = with_fallback(self._tracker_factory, self.settings, self._warn)
            self._offer()
        except Exception:
            self._release()
            raise
        return super().on_configure(state)

    @_reported
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start to receive and track."""
        assert self._tracker is not None and self._outputs is not None, 'it is configured'
        self._session = TrackingSession(
            self, self.settings, self._tracker, self._outputs, self._monitor)
        self.get_logger().info(f'waiting for images on {self._session.image_topic}')
        return super().on_activate(state)

    @_reported
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop to receive and track; the targets are dropped."""
        if not self._stop_session():
            # Its thread still uses the tracker: neither may be used again.
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

    def _stop_session(self) -> bool:
        session, self._session = self._session, None
        return session is None or session.stop()

    def _offer(self) -> None:
        """Make the topics and services that exist as long as the node is configured."""
        self._outputs = Outputs(self, self.settings)
        self._offered.callback(self._outputs.close)
        for kind, name, callback in ((Trigger, '~/reset', self._on_reset),
                                     (SetBool, '~/set_enabled', self._on_set_enabled)):
            self._offered.callback(self.destroy_service,
                                   self.create_service(kind, name, callback))

    def _release(self) -> None:
        self._stop_session()
        self._offered.close()
        self._outputs = None
        self._tracker = None

    def _on_reset(self, request: Trigger.Request,
                  response: Trigger.Response) -> Trigger.Response:
        response.message = _NOT_ACTIVE
        if self._session is not None:
            self._session.worker.reset()
            response.success, response.message = True, 'all targets are dropped'
        return response

    def _on_set_enabled(self, request: SetBool.Request,
                        response: SetBool.Response) -> SetBool.Response:
        response.message = _NOT_ACTIVE
        if self._session is not None:
            self._session.worker.set_enabled(request.data)
            response.success = True
            response.message = 'enabled' if request.data else 'disabled'
        return response

    def _fail(self, reason: str) -> None:
        """Tell why a transition is not made."""
        self._monitor.turned_away(reason)
        self.get_logger().error(reason)

    def _warn(self, warning: str) -> None:
        """Log what stays wrong, and keep it in the diagnostics."""
        self.get_logger().warning(warning)
        self._monitor.warned(warning)

    def _report_health(self) -> None:
        problem: Problem | None = Problem(Level.WARN, 'the node is not active')
        dropped = 0
        if self._session is not None:
            problem = self._session.problem(self.settings.no_image_timeout)
            dropped = self._session.worker.dropped_frames
            if problem is not None:
                self.get_logger().warning(problem.message, throttle_duration_sec=10.0)
        diagnosis = self._monitor.report(self.get_name(), problem=problem,
                                         dropped_frames=dropped)
        header = Header(stamp=self.get_clock().now().to_msg())
        self._health.publish(message_from_diagnoses([diagnosis], header))

    def _judge_change(self, changes: list[Parameter]) -> SetParametersResult:
        return parameters.judge_change(changes, configured=self._tracker is not None)

    def _apply_change(self, changes: list[Parameter]) -> None:
        self.settings = parameters.read(self)
        if self._outputs is not None:
            self._outputs.settings = self.settings

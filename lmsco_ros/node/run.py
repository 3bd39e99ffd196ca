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

"""The node in its process: started, spun until the process has to end, and taken down."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import contextlib
import gc
import sys
import threading
from typing import TypeVar

import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from lmsco_ros.node import parameter_files
from lmsco_ros.node.executor import GuardedExecutor
from lmsco_ros.node.ros_arguments import (check_remappings, explained, shortened, StartError,
                                          values_of)
from lmsco_ros.node.tracker_node import TrackerNode

Made = TypeVar('Made', bound=Node)
# The end of the process is noticed after this time at the latest.
_LOOK_PERIOD = 0.1


def run(arguments: Sequence[str], ending: threading.Event) -> int:
    """
    Run the node until the process has to end.

    Parameters
    ----------
    arguments : sequence of str
        Those for ROS.
    ending : threading.Event
        Set when the process has to end.

    Returns
    -------
    int
        Exit code: 1 when the node cannot start.

    """
    try:
        with in_ros(arguments), living(
                TrackerNode, arguments, parameter_files.TRACKER_FILE) as node:
            return _spin(node, ending)
    except StartError as error:
        print(f'tracker_node: {error}', file=sys.stderr)
        return 1


@contextlib.contextmanager
def in_ros(arguments: Sequence[str]) -> Iterator[None]:
    """Join ROS; raise StartError when it refuses the arguments."""
    check_remappings(arguments)
    # What ROS would log of arguments that it refuses is in the error, too.
    set_logger_level('rcl', LoggingSeverity.FATAL)
    try:
        # Its signal handlers would take the context away under the hands of whoever uses it:
        # a node that is being made, the worker that publishes.
        rclpy.init(args=list(arguments), signal_handler_options=SignalHandlerOptions.NO)
    except rclpy_implementation.UnknownROSArgsError as error:
        raise StartError('ROS does not know the argument '
                         f'{shortened(str(error).strip("[]"))}') from error
    except rclpy_implementation.RCLError as error:
        raise StartError(_refusal(str(error), arguments)) from error
    finally:
        set_logger_level('rcl', LoggingSeverity.UNSET)
    try:
        yield
    finally:
        rclpy.try_shutdown()


def _refusal(reason: str, arguments: Sequence[str]) -> str:
    """Say why ROS refuses the arguments."""
    for path in values_of('--params-file', arguments):
        if f"'--params-file {path}'" in reason:
            return parameter_files.file_problem(
                path, explained(reason).partition('Error: ')[2])
    return explained(reason)


@contextlib.contextmanager
def living(make: Callable[[], Made], arguments: Sequence[str], listed_in: str) -> Iterator[Made]:
    """
    Make a node, say what of the parameters it does not hear, and take it down.

    Parameters
    ----------
    make : callable
        Returns the node.
    arguments : sequence of str
        Those for ROS.
    listed_in : str
        Where a user finds all parameters.

    Raises
    ------
    StartError
        When the node cannot be made with what it was given.

    """
    try:
        node = make()
    except ParameterException as error:
        raise StartError(f'{explained(str(error))}; {listed_in} lists all parameters with their '
                         'types') from error
    except (NameValidationException, rclpy_implementation.RCLError) as error:
        raise StartError(explained(str(error))) from error
    try:
        for warning in [
                *parameter_files.unheard(arguments, node.get_fully_qualified_name()),
                *parameter_files.unknown(node._parameter_overrides, node._parameters, listed_in)]:
            node.get_logger().warning(warning)
        yield node
    finally:
        node.destroy_node()


def _spin(node: TrackerNode, ending: threading.Event) -> int:
    """Let the node work until the process has to end."""
    if node.settings.autostart and not node.is_active:
        return 1
    _spare_the_garbage_collector()
    spin_until(ending, node, node.faults.note)
    return 0


def spin_until(ending: threading.Event, node: Node,
               on_fault: Callable[[str, BaseException], object]) -> None:
    """
    Let a node work until the process has to end.

    Parameters
    ----------
    ending : threading.Event
        Set when the process has to end.
    node : rclpy.node.Node
        In the default context.
    on_fault : callable
        As `note` of :class:`~lmsco_ros.node.executor.GuardedExecutor`.

    """
    executor = GuardedExecutor(on_fault)
    try:
        executor.add_node(node)
        while not ending.is_set() and rclpy.ok():
            executor.spin_once(timeout_sec=_LOOK_PERIOD)
    finally:
        executor.shutdown()


def _spare_the_garbage_collector() -> None:
    """
    Take what has been made so far out of every later collection.

    These are some 200,000 objects of the libraries, which stay. To go through them takes as
    long as several frames.
    """
    gc.collect()
    gc.freeze()

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

"""Answers to requests that cannot be met; rclpy would raise, and end the process."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
import functools
from typing import Any

from lifecycle_msgs.msg import Transition
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter

from lmsco_ros.node.parameter_files import TRACKER_FILE, unknown

Answer = Callable[[Any, Any], Any]
Known = Callable[[], Collection[str]]


def refusal(kind: Any, request: Any, reason: str) -> Any:
    """
    Return the response of a service that says no.

    Parameters
    ----------
    kind : service type
        Such as `std_srvs.srv.Trigger`.
    request : kind.Request
        What was asked for.
    reason : str
        Told where the type of the response has a place for it.

    """
    result = SetParametersResult(successful=False, reason=reason)
    response = kind.Response()
    if kind is SetParameters:
        response.results = [result for _ in request.parameters]
    elif kind is SetParametersAtomically:
        response.result = result
    elif hasattr(response, 'success') and hasattr(response, 'message'):
        response.message = reason
    return response


def set_each(answer: Answer, known: Known) -> Answer:
    """Return the callback of set_parameters so that every parameter is judged by itself."""
    @functools.wraps(answer)
    def set_parameters(request: SetParameters.Request,
                       response: SetParameters.Response) -> SetParameters.Response:
        for parameter in request.parameters:
            one = SetParameters.Request(parameters=[parameter])
            reason = _objection([parameter], known())
            answered = refusal(SetParameters, one, reason) if reason \
                else answer(one, SetParameters.Response())
            response.results.extend(answered.results)
        return response
    return set_parameters


def set_together(answer: Answer, known: Known) -> Answer:
    """Return the callback of set_parameters_atomically so that rclpy can judge them all."""
    @functools.wraps(answer)
    def set_parameters(
            request: SetParametersAtomically.Request,
            response: SetParametersAtomically.Response) -> SetParametersAtomically.Response:
        reason = _objection(request.parameters, known())
        return refusal(SetParametersAtomically, request, reason) if reason \
            else answer(request, response)
    return set_parameters


def transition_objection(transition: Transition, state: str,
                         available: Iterable[tuple]) -> str:
    """
    Say why a transition is not possible now; empty when it is.

    Parameters
    ----------
    transition : lifecycle_msgs/Transition
        What is asked for: the label counts, and without one the number.
    state : str
        Where the node is.
    available : iterable of (number, label, ...)
        What is possible there.

    """
    possible = {number: label for number, label, *_ in available}
    if transition.label in possible.values() or (
            not transition.label and transition.id in possible):
        return ''
    asked = f'"{transition.label}"' if transition.label else f'number {transition.id}'
    expected = ', '.join(f'{label} ({number})' for number, label in possible.items())
    return (f'transition {asked} is not possible while the node is {state}; possible: '
            + (expected or 'none, start the node anew'))


def _objection(parameters: Iterable[ParameterMessage], names: Collection[str]) -> str:
    """Name what no parameter can be; empty when rclpy may judge them."""
    types = [kind.value for kind in Parameter.Type]
    for parameter in parameters:
        if not parameter.name:
            return 'a parameter without a name cannot be set; expected one of those listed'
        if parameter.value.type not in types:
            return (f'{parameter.name}: {parameter.value.type} is no type of a value; expected '
                    f'{min(types)} to {max(types)}, see rcl_interfaces/msg/ParameterType')
        if parameter.name not in names:
            return unknown([parameter.name], names, TRACKER_FILE)[0]
    return ''

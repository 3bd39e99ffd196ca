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

"""An executor that a message cannot end."""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Any

from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

# So that something that is raised over and over does not take all of a core.
_PAUSE = 0.01


class GuardedExecutor(SingleThreadedExecutor):
    """
    Goes on, whatever a node or rclpy itself raises.

    What is raised while a message is taken from the middleware, such as MemoryError, would
    leave what received it, and everything in its callback group, marked as at work for good.

    Parameters
    ----------
    note : callable
        Called with what was given up and what was raised; must not raise.
    context : Context, optional
        The default context unless given.

    """

    def __init__(self, note: Callable[[str, BaseException], object], *,
                 context: Context | None = None) -> None:
        super().__init__(context=context)
        self._note = note

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """
        Do one piece of work, or wait for one.

        Parameters
        ----------
        timeout_sec : float, optional
            Seconds to wait; None waits until there is work.

        Raises
        ------
        rclpy.executors.ExternalShutdownException
            When the context is at its end.

        """
        try:
            super().spin_once(timeout_sec)
        except ExternalShutdownException:
            raise
        except Exception as error:  # noqa: B902
            if not self.context.ok():
                raise ExternalShutdownException() from error
            self._note('work of the executor', error)
            time.sleep(_PAUSE)

    def _make_handler(self, entity: Any, node: Any, take: Callable[[Any], Any]) -> Any:
        """Return the task that works on an entity, so that taking from it cannot fail."""
        def take_guarded(entity: Any) -> Any:
            try:
                return take(entity)
            except Exception as error:  # noqa: B902
                self._note(f'what came in on {_name(entity)}', error)
                return None
        return super()._make_handler(entity, node, take_guarded)


def _name(entity: Any) -> str:
    """Return the topic or the service of an entity, or what it is."""
    return (getattr(entity, 'topic_name', '') or getattr(entity, 'srv_name', '')
            or f'a {type(entity).__name__}')

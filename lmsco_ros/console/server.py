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

"""The web server beside the node, in a thread of its own."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import socket
import threading

import uvicorn

from lmsco_ros.console.access import Access, AccessError
from lmsco_ros.console.desk import Desk
from lmsco_ros.console.requests import MOST_BYTES
from lmsco_ros.console.settings import ConsoleSettings
from lmsco_ros.console.web import make_app
from lmsco_ros.node.ros_arguments import shortened, StartError

_MOST_OPEN = 128
_END_SECONDS = 1
_BACKLOG = 64
_EVERY_ADDRESS = ('', '0.0.0.0', '::')


@contextlib.contextmanager
def serving(desk: Desk, settings: ConsoleSettings, token: str = '') -> Iterator[str]:
    """
    Offer the page, and give its address.

    Parameters
    ----------
    desk : Desk
        What the page works on.
    settings : ConsoleSettings
        Where it is offered, and to whom.
    token : str
        What a person has to enter; may be empty on the loopback interface only.

    Raises
    ------
    StartError
        When it would be open to others than it should, or the port cannot be had.

    """
    try:
        access = Access.of_server(settings.host, token, settings.origins)
    except AccessError as error:
        raise StartError(str(error)) from error
    with _listening(settings.host, settings.port) as listener:
        server = uvicorn.Server(uvicorn.Config(
            make_app(desk, access), ws='websockets-sansio', ws_max_size=MOST_BYTES,
            ws_per_message_deflate=False, lifespan='off', log_config=None, log_level='warning',
            access_log=False, server_header=False, limit_concurrency=_MOST_OPEN,
            timeout_graceful_shutdown=_END_SECONDS))
        thread = threading.Thread(
            target=server.run, kwargs={'sockets': [listener]}, name='web', daemon=True)
        thread.start()
        try:
            yield f'http://{_name(settings.host)}:{listener.getsockname()[1]}/'
        finally:
            server.should_exit = True
            thread.join()


def _name(host: str) -> str:
    """Return the name by which browsers find what listens on an address."""
    if host in _EVERY_ADDRESS:
        return socket.gethostname()
    return f'[{host}]' if ':' in host else host


def _listening(host: str, port: int) -> socket.socket:
    """Return a socket that listens."""
    try:
        family = socket.AF_INET6 if ':' in host else socket.AF_INET
        return socket.create_server((host, port), family=family, backlog=_BACKLOG)
    # Of a name that cannot be encoded Python says that it has a wrong type.
    except (OSError, OverflowError, TypeError) as error:
        raise StartError(f'cannot listen on {shortened(host)}, port {port}: {error}; choose '
                         'another one with -p host:=... and -p port:=..., 0 takes any port that '
                         'is free') from error

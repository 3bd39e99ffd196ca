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

"""The server of the page: its files, the form for the token, and the socket."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from importlib.resources import files
from urllib.parse import parse_qs

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from lmsco_ros.console.access import Access, COOKIE, HEADERS
from lmsco_ros.console.connection import Connection
from lmsco_ros.console.desk import Desk

_TYPES = {'.html': 'text/html; charset=utf-8', '.css': 'text/css; charset=utf-8',
          '.js': 'text/javascript; charset=utf-8', '.svg': 'image/svg+xml'}
_MOST_FORM_BYTES = 1024
_MOST_CONNECTIONS = 16
_TRY_AGAIN_LATER, _FORBIDDEN = 1013, 1008
_COOKIE_SECONDS = 30 * 24 * 3600


def make_app(desk: Desk, access: Access) -> Starlette:
    """
    Return the application.

    Parameters
    ----------
    desk : Desk
        What the page works on.
    access : Access
        Who may use it.

    """
    site = _Site(desk, access)
    page = _page()
    routes = [
        Route('/', site.index), Route('/login', site.login, methods=['POST']),
        WebSocketRoute('/socket', site.socket),
        # Every file has a route of its own, so that no part of a path is ever looked up.
        *(Route(f'/{name}', _file(name, content)) for name, content in page.items()
          if not name.endswith('.html'))]
    return Starlette(routes=routes, middleware=[Middleware(_WithHeaders)])


class _Site:
    """The answers that depend on who asks."""

    def __init__(self, desk: Desk, access: Access) -> None:
        self._desk = desk
        self._access = access
        self._connections = 0
        page = _page()
        self._index, self._login = page['index.html'], page['login.html']

    async def index(self, request: Request) -> Response:
        """Show the page, or ask for the token."""
        if self._access.knows(request.cookies.get(COOKIE)):
            return Response(self._index, media_type=_TYPES['.html'])
        return Response(self._login, 401, media_type=_TYPES['.html'])

    async def login(self, request: Request) -> Response:
        """Compare what was entered with the token."""
        if not self._access.is_own(request.headers.get('origin'), request.headers.get('host')):
            return Response('the form was not sent from this page', 403)
        entered = parse_qs((await _body(request)).decode(errors='replace')).get('token', [''])
        if not self._access.opens(entered[0]):
            return Response(self._login.replace(b' hidden', b''), 401,
                            media_type=_TYPES['.html'])
        answer = RedirectResponse('./', 303)
        answer.set_cookie(COOKIE, self._access.cookie, max_age=_COOKIE_SECONDS, httponly=True,
                          samesite='strict', secure=request.url.scheme == 'https')
        return answer

    async def socket(self, socket: WebSocket) -> None:
        """Talk with a page of ours whose user may."""
        access = self._access
        if not access.is_own(socket.headers.get('origin'), socket.headers.get('host')) \
                or not access.knows(socket.cookies.get(COOKIE)):
            await socket.close(_FORBIDDEN)
            return
        if self._connections >= _MOST_CONNECTIONS:
            await socket.close(_TRY_AGAIN_LATER)
            return
        self._connections += 1
        try:
            await socket.accept()
            await Connection(socket, self._desk).talk()
        finally:
            self._connections -= 1


class _WithHeaders:
    """Adds to every answer what browsers shall refuse."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer as the application does, with the headers."""
        async def send_with_headers(message: Message) -> None:
            if message['type'] == 'http.response.start':
                message['headers'] = [*message['headers'], *(
                    (name.lower().encode(), value.encode()) for name, value in HEADERS.items())]
            await send(message)
        await self._app(scope, receive, send_with_headers)


async def _body(request: Request) -> bytes:
    """Return as much of a form as one of ours can have."""
    body = b''
    async for part in request.stream():
        body += part
        if len(body) > _MOST_FORM_BYTES:
            return b''
    return body


def _page() -> dict[str, bytes]:
    """Return the files of the page by name."""
    folder = files('lmsco_ros.console').joinpath('page')
    return {file.name: file.read_bytes() for file in folder.iterdir() if _type(file.name)}


def _file(name: str, content: bytes) -> Callable[[Request], Awaitable[Response]]:
    async def answer(request: Request) -> Response:
        return Response(content, media_type=_type(name))
    return answer


def _type(name: str) -> str:
    return _TYPES.get('.' + name.rpartition('.')[2], '')

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

"""One page's connection: frames when it asks for them, requests as they come."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
import contextlib
import time

from starlette.websockets import WebSocket, WebSocketDisconnect

from lmsco_ros.console import replies
from lmsco_ros.console.desk import Desk, Operator
from lmsco_ros.console.moments import Moment
from lmsco_ros.console.picture import Look
from lmsco_ros.console.requests import (
    Absent, Command, Enable, Next, parse_request, Point, Record, RequestError, Reset, Select,
    Start, Step, Unmark)
from lmsco_ros.core.errors import LMSCOError
from lmsco_ros.node.faults import cause

_ANSWER_SECONDS = 5.0
# More than a person gives, and less than would hinder the tracker.
_MOST_COMMANDS, _PER_SECONDS = 20, 1.0


class Connection:
    """
    Talks with one page.

    Every `next` is answered once, by a frame or by word of silence; a page that does not ask
    is sent nothing, and so never lags behind.

    Parameters
    ----------
    socket : WebSocket
        Accepted.
    desk : Desk
        What all connections share.

    """

    def __init__(self, socket: WebSocket, desk: Desk) -> None:
        self._socket = socket
        self._desk = desk
        self._loop = asyncio.get_running_loop()
        self._frames = desk.open_frames()
        self._wanted = asyncio.Event()
        self._sending = asyncio.Lock()
        self._look = Look()
        self._last: Moment | None = None
        self._revision = 0
        self._delay: float | None = None
        self._commands: list[float] = []

    async def talk(self) -> None:
        """Serve the page until it leaves."""
        frames = asyncio.create_task(self._send_frames())
        try:
            await self._send(replies.greeting(self._desk))
            while True:
                await self._answer(await self._receive())
        except WebSocketDisconnect:
            pass
        finally:
            self._frames.close()
            self._desk.operator.want_map(self, False)
            frames.cancel()
            await asyncio.gather(frames, return_exceptions=True)

    async def _receive(self) -> str:
        message = await self._socket.receive()
        if message['type'] == 'websocket.disconnect':
            raise WebSocketDisconnect(message.get('code', 1000))
        return message.get('text') or ''

    async def _send(self, content: str | bytes) -> None:
        try:
            async with self._sending:
                if isinstance(content, str):
                    await self._socket.send_text(content)
                else:
                    await self._socket.send_bytes(content)
        except RuntimeError as error:
            # So it is told that the other side is gone already.
            raise WebSocketDisconnect(1006) from error

    async def _answer(self, text: str) -> None:
        """Do what a message asks for."""
        async with self._telling():
            request = parse_request(text)
            if isinstance(request, Next):
                self._note_drawn(request.drawn)
                self._wanted.set()
            elif isinstance(request, Step):
                await self._step(request)
            elif isinstance(request, Look):
                self._look = request
                self._desk.operator.want_map(self, request.confidence)
            else:
                self._check(request)
                await self._do(request)

    @contextlib.asynccontextmanager
    async def _telling(self) -> AsyncIterator[None]:
        """Tell the page what cannot be done, whatever the reason; it costs that and no more."""
        try:
            yield
        except WebSocketDisconnect:
            raise
        except (LMSCOError, RequestError) as error:
            await self._send(replies.answer(False, str(error)))
        except Exception as error:  # noqa: B902
            await self._send(replies.answer(False, f'the console cannot do that: {cause(error)}'))

    def _note_drawn(self, number: int) -> None:
        if self._last is not None and number == self._last.number:
            self._delay = time.monotonic() - self._last.received

    def _check(self, command: Command) -> None:
        """Raise RequestError where a command may not be given."""
        if self._desk.read_only:
            raise RequestError('this page may only look; the console was started read-only')
        now = time.monotonic()
        self._commands = [each for each in self._commands if now - each < _PER_SECONDS]
        if len(self._commands) >= _MOST_COMMANDS:
            raise RequestError(f'more than {_MOST_COMMANDS} commands in a second; the last one '
                               'is ignored')
        self._commands.append(now)

    async def _do(self, command: Command) -> None:
        operator = self._desk.operator
        if isinstance(command, Start):
            operator.start(command.stamp, command.box)
        elif isinstance(command, Point):
            operator.point(command.stamp, command.x, command.y)
        elif isinstance(command, Select):
            operator.select(command.track_id)
        elif isinstance(command, (Absent, Unmark)):
            self._mark(command)
        else:
            await self._call(operator, command)

    def _mark(self, command: Absent | Unmark) -> None:
        marker = self._desk.marker
        if marker is None:
            raise RequestError('only the frames of a recording can be marked')
        (marker.mark_absent if isinstance(command, Absent) else marker.unmark)(command.stamp)

    async def _call(self, operator: Operator, command: Reset | Enable | Record) -> None:
        """Have something done that is answered, and tell the answer."""
        future: asyncio.Future[tuple[bool, str]] = self._loop.create_future()

        def settle(done: bool, text: str) -> None:
            if not future.done():
                future.set_result((done, text))

        def answered(done: bool, text: str) -> None:
            self._loop.call_soon_threadsafe(settle, done, text)

        if isinstance(command, Reset):
            operator.reset(answered)
        elif isinstance(command, Record):
            operator.record(command.on, answered)
        else:
            operator.enable(command.on, answered)
        try:
            done, text = await asyncio.wait_for(future, _ANSWER_SECONDS)
        except asyncio.TimeoutError:
            done, text = False, 'the tracker does not answer; is it running?'
        await self._send(replies.answer(done, text))

    async def _step(self, step: Step) -> None:
        moment = await self._frames.beside(step.number, step.by)
        if moment is None:
            raise RequestError('there is no frame yet')
        await self._show(moment, 'step')

    async def _send_frames(self) -> None:
        """Send what is asked for, as soon as it is there."""
        # Whoever receives is told of the end, too, and cleans up.
        with contextlib.suppress(WebSocketDisconnect):
            while True:
                await self._wanted.wait()
                self._wanted.clear()
                if not await self._send_next():
                    await self._send(replies.silence(self._desk, self._events()))

    async def _send_next(self) -> bool:
        """Send the next frame; tell whether there was one that can be shown."""
        async with self._telling():
            moment = await self._frames.after(0 if self._last is None else self._last.number)
            if moment is not None:
                await self._show(moment, 'next')
                return True
        return False

    async def _show(self, moment: Moment, asked: str) -> None:
        # A frame that cannot be shown is not tried again.
        self._last = moment
        picture = await asyncio.to_thread(self._desk.pictures.jpeg, moment, self._look)
        await self._send(replies.frame(
            moment, picture, self._desk, self._events(), self._delay, asked))

    def _events(self) -> list:
        """Return what the page does not know yet."""
        events = self._desk.chronicle.since(self._revision)
        self._revision = max((event.revision for event in events), default=self._revision)
        return events

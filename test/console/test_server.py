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

"""The real server on the loopback interface: its bounds, and pages that behave badly."""

import contextlib
import json
import threading
import tracemalloc

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from lmsco_ros.console.server import serving
from lmsco_ros.console.settings import ConsoleSettings
from lmsco_ros.node.ros_arguments import StartError

PATIENCE = 100.0


@pytest.fixture
def address(desk):
    """Serve the desk, and return the address of the page."""
    with serving(desk, ConsoleSettings(port=0)) as address:
        yield address


@contextlib.contextmanager
def join(address, **more):
    """Give a greeted connection, as the page makes it."""
    with connect(address.replace('http', 'ws') + 'socket', origin=address.rstrip('/'),
                 proxy=None, open_timeout=PATIENCE, **more) as socket:
        assert json.loads(socket.recv(PATIENCE))['type'] == 'hello'
        yield socket


def ask(socket, read_frame):
    """Ask for the next frame until one comes, and return its number."""
    while True:
        socket.send('{"type": "next", "drawn": 0}')
        data = socket.recv(PATIENCE)
        if isinstance(data, bytes):
            return read_frame(data)[0]['number']


def test_page_is_served_with_its_socket(address, feed, moment, read_frame):
    feed.add(moment(3))
    with join(address) as socket:
        assert ask(socket, read_frame) == 3


def test_foreign_origin_is_turned_away(address):
    with pytest.raises(InvalidStatus, match='403'), connect(
            address.replace('http', 'ws') + 'socket', origin='http://a.example', proxy=None):
        pass


@pytest.mark.parametrize('size', [2049, 5_000_000])
def test_long_messages_end_the_connection_and_nothing_else(
        address, feed, moment, read_frame, size):
    feed.add(moment(1))
    with join(address) as other:
        with join(address) as socket, pytest.raises(ConnectionClosed):
            socket.send('a' * size)
            while True:
                socket.recv(PATIENCE)
        assert ask(other, read_frame) == 1


def test_page_that_reads_nothing_harms_nobody(address, feed, moment, read_frame):
    """It asks and asks, and the frames for it fill all that lies between."""
    ended = threading.Event()

    def flood():
        with contextlib.suppress(ConnectionClosed), join(address, max_queue=1) as stuck:
            while not ended.is_set():
                stuck.send('{"type": "step", "number": 1, "by": 0}')

    feed.add(moment(1, shape=(480, 640)))
    thread = threading.Thread(target=flood, daemon=True)
    thread.start()
    with join(address) as other:
        for number in range(2, 40):
            feed.add(moment(number))
            assert ask(other, read_frame) == number
        assert thread.is_alive()
    # It ends with the server.
    ended.set()


def test_ten_thousand_messages_leave_nothing_behind(address, feed, desk, moment, read_frame):
    rng = np.random.default_rng(3)
    feed.add(moment(1))
    texts = ['', '{', 'null', '[]', '{"type": "look"}', '{"type": "start", "box": [1, 2, 3, 4]}',
             '{"type": "select", "id": -1}', '{"type": "step", "number": 1e99, "by": 0}',
             '[' * 1500, '{"type": "next", "drawn": 9007199254740993}', '\u0000', '"' * 2000]

    def storm(count):
        with join(address) as socket:
            for _ in range(count):
                text = texts[rng.integers(len(texts))]
                socket.send(text if rng.random() < 0.7 else rng.bytes(rng.integers(1, 400)))
                assert json.loads(socket.recv(PATIENCE))['type'] == 'answer'

    storm(1000)
    tracemalloc.start()
    try:
        storm(1000)
        before, _ = tracemalloc.get_traced_memory()
        storm(8000)
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # A byte for each message would already be a leak; what is left is that of one connection.
    assert after - before < 200_000
    assert not desk.operator.asked
    with join(address) as socket:
        assert ask(socket, read_frame) == 1


def test_port_that_is_taken_is_told(address, desk):
    port = int(address.rstrip('/').rpartition(':')[2])
    with pytest.raises(StartError, match=f'port {port}.*port:='), \
            serving(desk, ConsoleSettings(port=port)):
        pass


@pytest.mark.parametrize('host', ['a..b', 'ä' * 80, 'a\0b', '\ud800', '1.2.3.4.5', '::1%none'])
def test_address_that_is_none_is_told(desk, host):
    with pytest.raises(StartError, match='cannot listen on .*host:='), \
            serving(desk, ConsoleSettings(host=host, port=0), 'a long enough token'):
        pass


@pytest.mark.parametrize('host, token, reason', [
    ('0.0.0.0', '', 'LMSCO_CONSOLE_TOKEN'), ('::', '', 'LMSCO_CONSOLE_TOKEN'),
    ('robot', '', 'LMSCO_CONSOLE_TOKEN'), ('127.0.0.1', 'short', '16')])
def test_page_is_not_open_to_others_by_mistake(desk, host, token, reason):
    with pytest.raises(StartError, match=reason), \
            serving(desk, ConsoleSettings(host=host, port=0), token):
        pass

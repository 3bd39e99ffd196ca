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

"""What every test may rely on: a private ROS graph, data, servers, reproducible properties."""

from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
import os
from pathlib import Path
import re
import signal
import threading
import time
import zlib

from hypothesis import HealthCheck, settings
import pytest

REPOSITORY = Path(__file__).resolve().parents[1]
# Domains above 101 need ports of the range that Linux hands to outgoing connections.
LAST_DOMAIN = 101
# Much more than anything takes, also on a busy machine.
PATIENCE_SECONDS = 120.0


def ros_domain_id(run: str, worker: str, workers: int) -> int:
    """
    Give each parallel worker of a test run a ROS domain of its own.

    Parameters
    ----------
    run : str
        Anything that tells two runs on one machine apart.
    worker : str
        The name pytest-xdist gives the worker (`gw0`, `gw1`, ...), or `master`.
    workers : int
        Number of workers of the run, 0 without pytest-xdist.

    Returns
    -------
    int
        A domain between 1 and 101; two workers of one run never share it.

    """
    block = workers + 1
    start = zlib.crc32(run.encode()) % (LAST_DOMAIN // block) * block
    number = re.search(r'\d+', worker)
    return 1 + start + (int(number.group()) + 1 if number else 0)


# The ROS libraries read both variables when the first context starts, so they are set here, on
# collection, before any test module can import rclpy.
# What starts in the background of a shell ignores Ctrl-C, and so would all that is tested with it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ['ROS_DOMAIN_ID'] = str(ros_domain_id(
    os.environ.get('PYTEST_XDIST_TESTRUNUID', str(os.getpid())),
    os.environ.get('PYTEST_XDIST_WORKER', 'master'),
    int(os.environ.get('PYTEST_XDIST_WORKER_COUNT', 0)),
))

settings.register_profile(
    'local', deadline=None, max_examples=50,
    suppress_health_check=[HealthCheck.too_slow])
settings.register_profile('ci', settings.get_profile('local'), derandomize=True)
settings.load_profile('ci' if os.environ.get('CI') else 'local')


def wait_until(condition):
    """Wait until a condition holds, and return what it says then."""
    deadline = time.monotonic() + PATIENCE_SECONDS
    while not (found := condition()):
        assert time.monotonic() < deadline, 'waited in vain'
        time.sleep(0.02)
    return found


@pytest.fixture(scope='session')
def until():
    """Return the function that waits until a condition holds, and returns what it says then."""
    return wait_until


@pytest.fixture(scope='session')
def test_data() -> Path:
    """Return the root of the real thermal sequences, or skip with the way to provide them."""
    root = Path(os.environ.get('LMSCO_TEST_DATA', REPOSITORY.parent / 'shared' / 'data'))
    if not root.is_dir():
        pytest.skip(f'no thermal sequences in {root}; set LMSCO_TEST_DATA to their folder')
    return root


class FileServer:
    """
    A server on this machine that gives one file to whoever asks, well or badly.

    Attributes
    ----------
    content : bytes
        The file.
    tag : str or None
        What it calls this version of the file.
    ranges : bool
        Whether it heeds requests for a part.
    cuts : list of int
        Numbers of bytes after which the next connections break.
    asked : list of str or None
        Parts that were asked for so far; None for all.

    """

    def __init__(self):
        self.content, self.tag, self.ranges = b'', '"1"', True
        self.cuts, self.asked = [], []
        files = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self):  # noqa: N802
                files.answer(self)

            def log_message(self, *arguments):
                pass

        self._server = ThreadingHTTPServer(('127.0.0.1', 0), Handler)
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.01,))
        self._thread.start()

    def url(self, name):
        """Return the address of the file; `missing` is not there, `circle` leads to itself."""
        return f'http://127.0.0.1:{self._server.server_port}/{name}'

    def answer(self, request):
        """Send what is asked for, as far as the connection holds."""
        wanted = request.headers.get('Range')
        self.asked.append(wanted)
        start = int(re.match(r'bytes=(\d+)-', wanted)[1]) if wanted and self.ranges else 0
        if request.headers.get('If-Range') != self.tag:
            start = 0
        if request.path == '/missing':
            request.send_error(404)
        elif request.path == '/circle':
            request.send_response(302)
            request.send_header('Location', '/circle')
            request.send_header('Content-Length', '0')
            request.end_headers()
        elif start and start >= len(self.content):
            request.send_error(416)
        else:
            self._send(request, start)

    def _send(self, request, start):
        """Send the file from `start` on."""
        request.send_response(206 if start else 200)
        if start:
            end = len(self.content)
            request.send_header('Content-Range', f'bytes {start}-{end - 1}/{end}')
        if self.tag:
            request.send_header('ETag', self.tag)
        request.send_header('Content-Length', str(len(self.content) - start))
        request.end_headers()
        length = self.cuts.pop(0) if self.cuts else None
        request.wfile.write(self.content[start:][:length])
        request.close_connection = True

    def close(self):
        """Stop listening."""
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()


@pytest.fixture
def file_server(monkeypatch):
    """Return a server whose file may be asked for directly, whatever proxies are set."""
    monkeypatch.setenv('NO_PROXY', '127.0.0.1')
    server = FileServer()
    yield server
    server.close()

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

"""Downloads from a server that breaks connections, ignores ranges and sends wrong bytes."""

import errno
import hashlib
import io
from pathlib import Path
import socket

import pytest

from lmsco_ros.core.errors import WeightsError
from lmsco_ros.core.weights.download import download

CHUNK = 1 << 16


@pytest.fixture
def content(rng):
    """Return the file."""
    return rng.bytes(700_001)


@pytest.fixture
def server(file_server, content):
    """Return a server of the file."""
    file_server.content = content
    return file_server


@pytest.fixture
def goal(tmp_path):
    """Return where the file goes, in a folder that does not exist."""
    return tmp_path / 'folder' / 'file.bin'


def assert_complete(goal, content):
    """Check that the file is there, whole, and nothing else."""
    assert goal.read_bytes() == content
    assert list(goal.parent.iterdir()) == [goal]


def test_download_reports_and_checks(server, goal, content):
    told = []
    wanted = hashlib.sha256(content).hexdigest()
    found = download(server.url('file'), goal, wanted, lambda *pair: told.append(pair))
    assert found == wanted
    assert_complete(goal, content)
    assert told[-1] == (len(content), len(content))
    assert [done for done, _ in told] == sorted(done for done, _ in told)


def test_broken_connections_go_on_where_they_stopped(server, goal, content):
    server.cuts = [3 * CHUNK, 4 * CHUNK, 0, 0, CHUNK, 1]
    told = []
    download(server.url('file'), goal, progress=lambda *pair: told.append(pair))
    assert_complete(goal, content)
    assert server.asked == [None, *(f'bytes={n * CHUNK}-' for n in (3, 7, 7, 7, 8, 8))]
    assert {total for _, total in told} == {len(content)}


def test_later_call_goes_on(server, goal, content):
    server.cuts = [4 * CHUNK, 0, 0, 0]
    with pytest.raises(WeightsError, match='what has arrived is kept'):
        download(server.url('file'), goal)
    assert not goal.exists()
    server.asked.clear()
    download(server.url('file'), goal)
    assert server.asked == [f'bytes={4 * CHUNK}-']
    assert_complete(goal, content)


def test_server_that_ignores_ranges_sends_all_again(server, goal, content):
    server.ranges, server.cuts = False, [3 * CHUNK]
    download(server.url('file'), goal)
    assert server.asked == [None, f'bytes={3 * CHUNK}-']
    assert_complete(goal, content)


def test_another_version_is_not_appended(server, goal, content):
    server.cuts = [4 * CHUNK, 0, 0, 0]
    with pytest.raises(WeightsError):
        download(server.url('file'), goal)
    server.content, server.tag = content[::-1], '"2"'
    download(server.url('file'), goal)
    assert_complete(goal, content[::-1])


@pytest.mark.parametrize('tag', [None, 'W/"1"'])
def test_without_a_strong_version_everything_is_sent_again(server, goal, content, tag):
    server.tag, server.cuts = tag, [3 * CHUNK]
    download(server.url('file'), goal)
    assert server.asked == [None, None]
    assert_complete(goal, content)


def test_stale_part_longer_than_the_file_is_thrown_away(server, goal, content):
    server.cuts = [4 * CHUNK, 0, 0, 0]
    with pytest.raises(WeightsError):
        download(server.url('file'), goal)
    server.content = content[:100_000]
    download(server.url('file'), goal)
    assert_complete(goal, content[:100_000])


def test_wrong_bytes_are_refused_and_what_was_there_stays(server, goal, content):
    goal.parent.mkdir()
    goal.write_bytes(b'old')
    wanted = hashlib.sha256(content).hexdigest()
    server.content = content[:-1] + bytes([content[-1] ^ 1])
    found = hashlib.sha256(server.content).hexdigest()
    with pytest.raises(WeightsError, match=f'checksum {found}, expected {wanted}'):
        download(server.url('file'), goal, wanted)
    assert_complete(goal, b'old')


def test_missing_file_is_told(server, goal):
    with pytest.raises(WeightsError, match='missing answers 404'):
        download(server.url('missing'), goal)
    assert len(server.asked) == 1


def refusal(url, goal):
    """Return what is said of a download that cannot be, which is one line with the address."""
    with pytest.raises(WeightsError) as refused:
        download(url, goal)
    message = str(refused.value)
    assert message.startswith(url) and '\n' not in message and 'object at' not in message
    return message


def test_nobody_there_is_told(goal):
    with socket.socket() as reserved:
        reserved.bind(('127.0.0.1', 0))
        url = f'http://127.0.0.1:{reserved.getsockname()[1]}/file'
        assert 'could not be downloaded: Connection refused; try' in refusal(url, goal)


def test_name_that_is_not_known_is_told(goal, monkeypatch):
    """What a machine without a network says."""
    def unknown(*arguments, **keywords):
        raise socket.gaierror(socket.EAI_AGAIN, 'Temporary failure in name resolution')
    monkeypatch.setenv('NO_PROXY', '*')
    monkeypatch.setattr(socket, 'getaddrinfo', unknown)
    message = refusal('https://weights.example/net.mat', goal)
    assert 'could not be downloaded: Temporary failure in name resolution; try' in message


def test_unreachable_proxy_is_told(goal, monkeypatch):
    with socket.socket() as reserved:
        reserved.bind(('127.0.0.1', 0))
        monkeypatch.setenv('HTTP_PROXY', f'http://127.0.0.1:{reserved.getsockname()[1]}')
        monkeypatch.setenv('NO_PROXY', '')
        message = refusal('http://weights.example/net.mat', goal)
    assert 'through the proxy: Connection refused; try' in message


def test_silence_is_told(goal, monkeypatch):
    monkeypatch.setattr('lmsco_ros.core.weights.download._TIMEOUT_SECONDS', (0.2, 0.2))
    monkeypatch.setenv('NO_PROXY', '*')
    with socket.create_server(('127.0.0.1', 0)) as silent:
        url = f'http://127.0.0.1:{silent.getsockname()[1]}/file'
        assert 'could not be downloaded: there was no answer in time; try' in refusal(url, goal)


def test_address_that_leads_to_itself_is_told(server, goal):
    assert 'leads to itself again and again; try' in refusal(server.url('circle'), goal)


@pytest.mark.parametrize('page', [b'<!DOCTYPE html><title>Log in</title>', b'\n <HTML lang="en">'])
def test_page_in_place_of_the_file_is_told(server, goal, page):
    server.content = page
    assert 'answers with a web page in place of the file' in refusal(server.url('file'), goal)
    assert not goal.exists()


@pytest.mark.parametrize('address', ['nowhere', 'http://', 'gopher://host/file'])
def test_address_that_is_none_is_told(goal, address):
    assert 'could not be downloaded: ' in refusal(address, goal)


def test_file_without_room_is_told_and_what_arrived_is_used(server, goal, content, monkeypatch):
    class Full(io.FileIO):
        def write(self, data):
            if self.tell() >= 3 * CHUNK:
                raise OSError(errno.ENOSPC, 'No space left on device')
            return super().write(data)
    opened = Path.open
    with monkeypatch.context() as full:
        full.setattr(Path, 'open', lambda path, mode='r', **options: (
            Full(path, mode) if mode == 'ab' else opened(path, mode, **options)))
        with pytest.raises(WeightsError, match=f'{goal}.part: No space left on device; make room'):
            download(server.url('file'), goal)
    download(server.url('file'), goal)
    assert server.asked == [None, f'bytes={3 * CHUNK}-']
    assert_complete(goal, content)


def test_empty_file(server, goal):
    server.content = b''
    download(server.url('file'), goal)
    assert_complete(goal, b'')

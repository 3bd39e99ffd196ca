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

"""The programs around the page: they start, say where it is, and end when they are told to."""

import os
from pathlib import Path
import re
import signal
import socket
import subprocess
import sys
import urllib.request

import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from websockets.sync.client import connect

REPOSITORY = Path(__file__).resolve().parents[2]
PATIENCE = 100.0
CONSOLE = [sys.executable, '-m', 'lmsco_ros.console.main']
LMSCO = [sys.executable, '-m', 'lmsco_ros.cli.main', 'console']


class Program:
    """A program that offers a page."""

    def __init__(self, command, **environment):
        self.process = subprocess.Popen(
            command, cwd=REPOSITORY, text=True, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, env={**os.environ, **environment})
        self.told = ''

    def address(self):
        """Wait until it says where the page is."""
        for line in self.process.stdout:
            self.told += line
            found = re.search(r'the page is at (http://\S+/)', line)
            if found:
                return found[1]
        raise AssertionError(self.told)

    def end(self, number=None):
        """Have it end, and return its exit code."""
        if number is not None:
            self.process.send_signal(number)
        rest, _ = self.process.communicate(timeout=PATIENCE)
        self.told += rest
        return self.process.returncode


@pytest.fixture
def run():
    """Return what starts programs, none of which outlives the test."""
    programs = []

    def start(command, **environment):
        programs.append(Program(command, **environment))
        return programs[-1]
    yield start
    for program in programs:
        program.process.kill()
        program.process.communicate()


def fetch(address):
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with opener.open(address, timeout=PATIENCE) as answer:
        return answer.read().decode()


@pytest.mark.parametrize('stop', [signal.SIGINT, signal.SIGTERM])
def test_console_ends_on_a_signal_while_a_page_is_open(run, stop):
    program = run([*CONSOLE, '--ros-args', '-p', 'port:=0', '-r', '__ns:=/ended'])
    address = program.address()
    assert '<canvas' in fetch(address)
    with connect(address.replace('http', 'ws') + 'socket', origin=address.rstrip('/'),
                 proxy=None) as page:
        assert '/ended/image_raw' in page.recv(PATIENCE)
        assert program.end(stop) == 0
    assert 'Traceback' not in program.told


@pytest.mark.parametrize('arguments, code, words', [
    (['--ros-args', '-p', 'host:=0.0.0.0'], 1, 'LMSCO_CONSOLE_TOKEN'),
    (['--ros-args', '-p', 'port:=eighty'], 1, 'docs/console.md'),
    (['--ros-args', '-p', 'port:=100000'], 1, 'cannot listen'),
    (['--ros-args', '-p', 'tracker:=two words'], 1, 'expected the name of a node'),
    (['--ros-args', '-p', 'tracker:=""'], 1, 'expected the name of a node'),
    (['--ros-args', '-p', 'image_transport:=theora'], 1, 'raw or compressed'),
    (['--ros-args', '-p', 'history_megabytes:=-1.0'], 1, '0 or more'),
    (['--ros-args', '-p', 'history_megabytes:=.nan'], 1, '0 or more'),
    (['--ros-args', '-p', 'allowed_origins:=robot.example'], 1, 'https://robot.example'),
    (['--nonsense'], 2, '--help'), (['--version'], 0, 'lmsco_ros'), (['-h'], 0, '-p port:=')])
def test_what_cannot_be_is_told_in_one_line(run, arguments, code, words):
    program = run([*CONSOLE, *arguments], LMSCO_CONSOLE_TOKEN='')
    assert program.end() == code, program.told
    assert words in program.told and 'Traceback' not in program.told


@pytest.mark.parametrize('name, words', [
    ('redonly', 'did you mean read_only'), ('qqq', 'docs/console.md lists all')])
def test_parameter_that_is_not_heard_is_warned_of(run, name, words):
    program = run([*CONSOLE, '--ros-args', '-p', 'port:=0', '-p', f'{name}:=true'])
    program.address()
    assert f'{name} is unknown' in program.told and words in program.told


def test_page_for_every_address_is_told_by_the_name_of_the_machine(run):
    program = run([*CONSOLE, '--ros-args', '-p', 'port:=0', '-p', 'host:=0.0.0.0'],
                  LMSCO_CONSOLE_TOKEN='a long enough token')
    assert f'//{socket.gethostname()}:' in program.address()


def test_page_can_record_where_the_command_line_says(run, tmp_path):
    folder = tmp_path / "odd: it's"
    program = run([*LMSCO, '--port', '0', '--namespace', '/kept', '--record-folder', str(folder)])
    address = program.address()
    with connect(address.replace('http', 'ws') + 'socket', origin=address.rstrip('/'),
                 proxy=None) as page:
        assert '"can_record":true' in page.recv(PATIENCE)
        page.send('{"type": "record", "on": true}')
        assert str(folder) in page.recv(PATIENCE)
        # What is under way is finished with the program.
        assert program.end(signal.SIGINT) == 130
    assert 'messages were recorded' in program.told and 'Traceback' not in program.told
    (bag,) = folder.iterdir()
    with AnyReader([bag]) as reader:
        assert list(reader.messages()) == []


def test_compressed_images_are_taken_when_asked_for(run):
    program = run([*LMSCO, '--port', '0', '--namespace', '/small', '--compressed'])
    program.address()
    assert 'images on /small/image_raw/compressed' in program.process.stdout.readline()


def test_command_line_offers_the_same_page(run):
    program = run([*LMSCO, '--port', '0', '--namespace', '/same', '--read-only'])
    address = program.address()
    with connect(address.replace('http', 'ws') + 'socket', origin=address.rstrip('/'),
                 proxy=None) as page:
        hello = page.recv(PATIENCE)
    assert '/same/image_raw' in hello and '"read_only":true' in hello
    assert program.end(signal.SIGINT) == 130 and 'Traceback' not in program.told


def test_recording_is_marked_and_its_bag_is_written_at_the_end(run, tmp_path):
    (tmp_path / 'frames').mkdir()
    for number in range(5):
        cv2.imwrite(str(tmp_path / 'frames' / f'{number}.png'), np.zeros((48, 64), np.uint8))
    program = run([*LMSCO, str(tmp_path / 'frames'), '--port', '0', '--output',
                   str(tmp_path / 'marks.txt'), '--bag', str(tmp_path / 'boxes')])
    address = program.address()
    with connect(address.replace('http', 'ws') + 'socket', origin=address.rstrip('/'),
                 proxy=None) as page:
        page.recv(PATIENCE)
        for number, x in ((1, 10), (3, 14)):
            page.send(f'{{"type": "step", "number": {number}, "by": 0}}')
            stamp = re.search(rb'"stamp":"(\d+)"', page.recv(PATIENCE))[1].decode()
            page.send(f'{{"type": "start", "stamp": "{stamp}", "box": [{x}, 5, 8, 6]}}')
        page.send('{"type": "reset"}')
        page.recv(PATIENCE)
    assert program.end(signal.SIGINT) == 130, program.told
    assert '2 marks are in' in program.told and 'Traceback' not in program.told
    assert (tmp_path / 'marks.txt').read_text().splitlines()[1] == '12.00,5.00,8.00,6.00'
    with AnyReader([tmp_path / 'boxes']) as reader:
        assert len(list(reader.messages())) == 3


@pytest.mark.parametrize('arguments, words', [
    (['nowhere'], 'nowhere'), (['--bag', 'boxes'], 'recording'), (['.', '--port', '0'], 'images')])
def test_command_line_tells_what_is_wrong(run, arguments, words):
    program = run([*LMSCO, *arguments])
    assert program.end() in (1, 2) and words in program.told
    assert 'Traceback' not in program.told

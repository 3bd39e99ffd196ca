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

"""New bags appear whole or not at all, whatever ends the work."""

import errno
import os
import resource
import signal
import subprocess
import sys
import threading

import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from rosbags.typesys import get_typestore, Stores

from lmsco_ros.replay.bags.output import BagOutput
from lmsco_ros.replay.bags.uninterrupted import uninterrupted
from lmsco_ros.replay.errors import OutputError
from lmsco_ros.replay.storage import Storage

TEXT = 'std_msgs/msg/String'
STORE = get_typestore(Stores.ROS2_JAZZY)


@pytest.fixture(params=list(Storage), ids=lambda storage: storage.value)
def storage(request):
    return request.param


@pytest.fixture
def output(tmp_path, storage):
    return BagOutput(tmp_path / 'bag', storage)


def write(output, count=1, size=5):
    connection = output.add_connection('/chat', TEXT, typestore=STORE)
    for index in range(count):
        message = STORE.types[TEXT](data=str(index) * size)
        output.write(connection, index, STORE.serialize_cdr(message, TEXT))


def count_in(path):
    with AnyReader([path]) as reader:
        return len(list(reader.messages()))


def test_whole_bag(tmp_path, storage, output):
    with output:
        write(output, 3)
        assert not (tmp_path / 'bag').exists()
    assert output.is_complete and output.count == count_in(tmp_path / 'bag') == 3
    assert [path.name for path in tmp_path.iterdir()] == ['bag']
    assert (tmp_path / 'bag' / f'bag.{"mcap" if storage is Storage.MCAP else "db3"}').is_file()


@pytest.mark.parametrize('error', [RuntimeError, KeyboardInterrupt, OutputError])
def test_nothing_is_left_of_what_is_not_worth_keeping(tmp_path, output, error):
    with pytest.raises(error):
        with output:
            write(output)
            raise error
    assert not output.is_complete and not list(tmp_path.iterdir())


@pytest.mark.parametrize('error', [RuntimeError, KeyboardInterrupt, OutputError])
def test_what_is_worth_keeping_is_kept(tmp_path, output, error):
    with pytest.raises(error):
        with output:
            write(output)
            output.keep_from_now_on()
            raise error
    assert output.is_complete and count_in(tmp_path / 'bag') == 1


@pytest.mark.parametrize('name, words', [
    ('bag', 'exists; choose another output'), ('bag.partial', 'killed left it; remove it')])
def test_existing_output_is_refused_at_once(tmp_path, storage, name, words):
    (tmp_path / name).mkdir()
    (tmp_path / name / 'precious').write_text('something')
    with pytest.raises(OutputError, match=words):
        BagOutput(tmp_path / 'bag', storage)
    assert (tmp_path / name / 'precious').read_text() == 'something'


def test_link_to_nowhere_is_something_that_exists(tmp_path, storage):
    (tmp_path / 'bag').symlink_to(tmp_path / 'elsewhere')
    with pytest.raises(OutputError, match='exists'):
        BagOutput(tmp_path / 'bag', storage)


def test_two_at_the_same_place(tmp_path, storage):
    first, second = (BagOutput(tmp_path / 'bag', storage) for _ in range(2))
    with first:
        write(first)
        with pytest.raises(OutputError, match='another command is writing it'), second:
            pass
    assert count_in(tmp_path / 'bag') == 1


def test_place_that_was_taken_meanwhile(tmp_path, output):
    with pytest.raises(OutputError, match='nothing of it is kept'):
        with output:
            write(output)
            (tmp_path / 'bag').mkdir()
            (tmp_path / 'bag' / 'precious').write_text('something')
    assert [path.name for path in tmp_path.iterdir()] == ['bag']
    assert (tmp_path / 'bag' / 'precious').exists()


def test_place_with_too_long_a_name(tmp_path, storage):
    with pytest.raises(OutputError, match='created .File name too long.; choose a place'):
        BagOutput(tmp_path / ('x' * 300), storage)


def test_place_that_cannot_be_written_to(tmp_path, storage):
    (tmp_path / 'file').write_text('')
    with pytest.raises(OutputError, match='cannot be created'):
        with BagOutput(tmp_path / 'file' / 'bag', storage):
            pass


def test_name_that_means_something_to_databases(tmp_path):
    with pytest.raises(OutputError, match='choose another name, or mcap'):
        BagOutput(tmp_path / 'number#1', Storage.SQLITE3)
    with BagOutput(tmp_path / 'number#1', Storage.MCAP) as output:
        write(output)
    assert count_in(tmp_path / 'number#1') == 1


PROCESS = """
from pathlib import Path
import sys
import time
from lmsco_ros.replay.bags.output import BagOutput
from lmsco_ros.replay.storage import Storage
with BagOutput(Path(sys.argv[1]), Storage(sys.argv[2])) as output:
    connection = output.add_connection('/chat', 'a/msg/B', msgdef='uint8[] a', rihs01='c')
    output.keep_from_now_on()
    for index in range(4000):
        output.write(connection, index, bytes(1000))
    print('writing', flush=True)
    time.sleep(600)
"""


def test_full_disk(tmp_path, storage):
    """A limit on the size of files stands for it: the system refuses to write more."""
    ended = subprocess.run(
        [sys.executable, '-c', PROCESS, str(tmp_path / 'bag'), storage.value],
        capture_output=True, text=True, timeout=100,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (500_000, 500_000)))
    assert f'OutputError: {tmp_path / "bag"} cannot be written' in ended.stderr
    assert 'nothing of it is kept' in ended.stderr
    assert not list(tmp_path.iterdir())


def test_no_room_for_the_end(tmp_path, output, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(OutputError, match='No space left on device.*nothing of it is kept'):
        with output:
            write(output)
            monkeypatch.setattr(os, 'rename', full)
    assert not list(tmp_path.iterdir())


def test_killed_process_leaves_no_bag(tmp_path, storage):
    with subprocess.Popen([sys.executable, '-c', PROCESS, str(tmp_path / 'bag'), storage.value],
                          stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b'writing\n'
        process.kill()
    assert [path.name for path in tmp_path.iterdir()] == ['bag.partial']
    assert not list(tmp_path.rglob('metadata.yaml'))


def test_signal_waits_until_the_bag_is_in_its_place(tmp_path, output, monkeypatch):
    rename = os.rename

    def interrupted(*places):
        signal.raise_signal(signal.SIGINT)
        rename(*places)

    monkeypatch.setattr(os, 'rename', interrupted)
    with pytest.raises(KeyboardInterrupt):
        with output:
            write(output)
    assert output.is_complete and count_in(tmp_path / 'bag') == 1


def test_signal_never_cuts_a_message(tmp_path, storage):
    """Signals at any moment of writing leave a bag that can be read to its end."""
    for index in range(15):
        path = tmp_path / f'bag_{index}'
        output = BagOutput(path, storage)
        timer = threading.Timer(0.001 * (index + 1), os.kill, (os.getpid(), signal.SIGINT))
        with pytest.raises(KeyboardInterrupt), output:
            connection = output.add_connection('/chat', 'a/msg/B', msgdef='uint8[] a', rihs01='c')
            output.write(connection, 0, bytes(100_000))
            output.keep_from_now_on()
            timer.start()
            # No more than a disk holds, should the signal never come.
            for logged in range(1, 5000):
                output.write(connection, logged, bytes(100_000))
        with Reader(path) as reader:
            assert len(list(reader.messages())) == reader.message_count == output.count


def test_handlers_of_signals_are_put_back():
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    with pytest.raises(RuntimeError), uninterrupted():
        assert signal.getsignal(signal.SIGINT) is not before[0]
        raise RuntimeError
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before

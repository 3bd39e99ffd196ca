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

"""Bags as recorders, disks and other tools leave them: what can be read is, the rest is told."""

import shutil
import sqlite3
import struct
from zlib import crc32

from backports import zstd
from hypothesis import given, HealthCheck, settings, strategies as st
import lz4.frame
import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionMode
from rosbags.typesys import get_typestore, Stores
import yaml

from lmsco_ros.replay.bags.files import is_bag
from lmsco_ros.replay.errors import SourceError, SourceWarning
from lmsco_ros.replay.sources import open_source
from lmsco_ros.replay.storage import Storage

SUFFIX = {Storage.MCAP: '.mcap', Storage.SQLITE3: '.db3'}
REMEDY = {Storage.MCAP: 'mcap recover', Storage.SQLITE3: 'sqlite3 .*recover'}
COUNT = 12
pytestmark = pytest.mark.filterwarnings('ignore::lmsco_ros.replay.errors.SourceWarning')
SIZE = 480


@pytest.fixture
def large(messages):
    """Return images of 225 kB, so that a bag has several chunks; image i has the value i."""
    return [(messages.time(i), messages.raw(
        i, messages.time(i), height=SIZE, width=SIZE, step=SIZE,
        data=np.full(SIZE * SIZE, i, np.uint8))) for i in range(COUNT)]


@pytest.fixture(params=list(Storage), ids=lambda storage: storage.value)
def storage(request):
    return request.param


def storage_file(bag):
    file, = (file for file in bag.iterdir() if file.suffix in SUFFIX.values())
    return file


def damage(file, start, content):
    with file.open('r+b') as stream:
        stream.seek(start)
        stream.write(content)


class TestCut:
    # Of a database, the beginning alone does not even say where the first images are.
    @pytest.mark.parametrize('part', [0.5, 0.8, 0.95, 0.999])
    def test_what_is_there_is_read(self, messages, large, storage, values, part):
        bag = messages.write('bag', ('/image', messages.RAW, large), storage=storage)
        file = storage_file(bag)
        content = file.read_bytes()
        file.write_bytes(content[:int(part * len(content))])
        with pytest.warns(SourceWarning, match=f'{file.name} is damaged.*{REMEDY[storage]}'):
            read = values(open_source(bag))
        # All but one image in the part, which may be cut itself.
        assert read == list(range(len(read))) and len(read) >= int(part * COUNT) - 1

    def test_in_the_last_bytes_nothing_is_lost(self, messages, large, values):
        bag = messages.write('bag', ('/image', messages.RAW, large))
        file = storage_file(bag)
        for bytes_lost in (1, 8, 37, 200):
            file.write_bytes(file.read_bytes()[:-bytes_lost])
            assert values(open_source(bag)) == list(range(COUNT))

    @pytest.mark.parametrize('mode', [CompressionMode.STORAGE, CompressionMode.MESSAGE])
    def test_compressed(self, messages, large, values, mode):
        bag = messages.write('bag', ('/image', messages.RAW, large), compression=mode)
        file = storage_file(bag)
        content = file.read_bytes()
        file.write_bytes(content[:content.rindex(b'sensor_msgs') * 9 // 10])
        with pytest.warns(SourceWarning, match='is damaged'):
            read = values(open_source(bag))
        assert len(read) > 2 and read == list(range(len(read)))

    def test_compressed_file(self, messages, large, values):
        bag = messages.write('bag', ('/image', messages.RAW, large),
                             compression=CompressionMode.FILE)
        file = bag / 'bag.mcap.zstd'
        file.write_bytes(file.read_bytes()[:file.stat().st_size // 2])
        with pytest.warns(SourceWarning, match='bag.mcap.zstd is cut or damaged'):
            read = values(open_source(bag))
        assert len(read) > 2 and read == list(range(len(read)))

    @pytest.mark.parametrize('content', [b'', b'no bag', b'\x89MCAP0\r\n', b'SQLite format 3\0'])
    def test_nothing_can_be_read(self, messages, large, storage, content):
        bag = messages.write('broken', ('/image', messages.RAW, large), storage=storage)
        storage_file(bag).write_bytes(content)
        with pytest.raises(SourceError, match='broken'):
            open_source(bag)


class TestDamaged:
    """In the middle, where neither end knows of it."""

    def test_page_of_a_database(self, messages, large, values):
        bag = messages.write('bag', ('/image', messages.RAW, large), storage=Storage.SQLITE3)
        file = storage_file(bag)
        content = file.read_bytes()
        # A page of nothing but pixels begins with the number of the page that follows.
        page = content.index(bytes([5]) * 4092) // 4096 + 1
        assert content[4096 * page + 4:4096 * (page + 1)] == bytes([5]) * 4092
        damage(file, 4096 * page, b'\x00\xc3\x01\xfb')
        with pytest.warns(SourceWarning, match='malformed.*messages can be read; repair'):
            assert values(open_source(bag)) == [0, 1, 2, 3, 4, *range(6, COUNT)]

    @pytest.mark.parametrize('compression, place', [
        (None, 0), (None, 10), (CompressionMode.STORAGE, 10)])
    def test_chunk_of_an_mcap(self, messages, large, values, compression, place):
        bag = messages.write('bag', ('/image', messages.RAW, large), compression=compression)
        file = storage_file(bag)
        chunk, = struct.unpack('<Q', _chunk_indices(file)[1][25:33])
        damage(file, chunk + 9 + 40 + place, b'\xff' * 40)
        with pytest.warns(SourceWarning, match='is damaged.*; repair'):
            read = values(open_source(bag))
        # The chunk has five images at most.
        assert read == sorted(read) and read[0] == 0 and read[-1] == COUNT - 1
        assert COUNT - 5 <= len(read) < COUNT

    def test_length_of_a_chunk(self, messages, large, values):
        """Chunks behind it are found again."""
        bag = messages.write('bag', ('/image', messages.RAW, large))
        file = storage_file(bag)
        chunk, = struct.unpack('<Q', _chunk_indices(file)[1][25:33])
        damage(file, chunk, b'\x00' * 20)
        file.write_bytes(file.read_bytes()[:-100])
        with pytest.warns(SourceWarning, match='no whole record at byte'):
            read = values(open_source(bag))
        assert read[0] == 0 and read[-1] == COUNT - 1 and COUNT - 5 <= len(read) < COUNT

    def test_index_of_an_mcap(self, messages, large, values):
        bag = messages.write('bag', ('/image', messages.RAW, large))
        file = storage_file(bag)
        damage(file, file.stat().st_size - 28, b'\xff' * 8)
        assert values(open_source(bag)) == list(range(COUNT))

    def test_index_of_a_database(self, messages, large, values):
        bag = messages.write('bag', ('/image', messages.RAW, large), storage=Storage.SQLITE3)
        with sqlite3.connect(storage_file(bag)) as database:
            page, = database.execute(
                'SELECT rootpage FROM sqlite_master WHERE name = "timestamp_idx"').fetchone()
        damage(storage_file(bag), 4096 * (page - 1), b'\xff' * 100)
        with pytest.warns(SourceWarning, match='malformed.*12 messages can be read'):
            assert values(open_source(bag)) == list(range(COUNT))

    @settings(deadline=None, max_examples=60,
              suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(data=st.data())
    def test_anywhere_is_read_or_refused(self, messages, storage, data):
        bag = messages.folder / 'bag'
        if not bag.exists():
            messages.write('bag', ('/image', messages.RAW, messages.images(20)), storage=storage)
            shutil.copy(storage_file(bag), messages.folder / 'whole')
        content = bytearray((messages.folder / 'whole').read_bytes())
        for place in data.draw(st.lists(st.integers(0, len(content) - 9), max_size=20)):
            content[place:place + 8] = data.draw(st.binary(min_size=8, max_size=8))
        storage_file(bag).write_bytes(content[:data.draw(st.integers(0, len(content)))])
        try:
            frames = list(open_source(bag))
        except SourceError as error:
            assert str(bag) in str(error)
        else:
            assert len({frame.stamp_ns for frame in frames}) == len(frames)

    def test_file_is_never_changed(self, messages, large, storage):
        bag = messages.write('bag', ('/image', messages.RAW, large), storage=storage)
        file = storage_file(bag)
        file.write_bytes(file.read_bytes()[:-5000])
        before = {item.name: item.read_bytes() for item in bag.iterdir()}
        with pytest.warns(SourceWarning):
            list(open_source(bag))
        assert {item.name: item.read_bytes() for item in bag.iterdir()} == before


def _chunk_indices(file):
    """Return the records that tell where the chunks of an mcap are."""
    content = file.read_bytes()
    summary, = struct.unpack('<Q', content[-28:-20])
    found, position = [], summary
    while position < len(content) - 8:
        operation, length = struct.unpack_from('<BQ', content, position)
        if operation == 8:
            found.append(content[position:position + 9 + length])
        position += 9 + length
    return found


class TestLeftBehind:
    """What a recorder leaves that was killed."""

    def test_folder_without_metadata(self, messages, storage, values):
        bag = messages.write('bag', ('/image', messages.RAW, messages.images(5)),
                             storage=storage)
        (bag / 'metadata.yaml').unlink()
        with pytest.warns(SourceWarning, match=f'no metadata.yaml.*{storage_file(bag).name} is '
                                               f'read. "ros2 bag reindex {bag}"'):
            assert is_bag(bag) and values(open_source(bag)) == list(range(5))

    @pytest.mark.parametrize('content', ['', '[', 'a: 1', '{rosbag2_bagfile_information: 3}',
                                         '[' * 1000, '\0'])
    def test_metadata_that_says_nothing(self, messages, storage, values, content):
        bag = messages.write('bag', ('/image', messages.RAW, messages.images(5)),
                             storage=storage)
        (bag / 'metadata.yaml').write_text(content)
        with pytest.warns(SourceWarning, match='damaged metadata.yaml.*ros2 bag reindex'):
            assert values(open_source(bag)) == list(range(5))

    def test_messages_beside_a_database(self, messages, values):
        bag = messages.write('bag', ('/image', messages.RAW, messages.images(5)),
                             storage=Storage.SQLITE3)
        file, killed = storage_file(bag), messages.folder / 'killed.db3'
        database = sqlite3.connect(file)
        database.execute('PRAGMA journal_mode=WAL')
        row = database.execute('SELECT topic_id, data FROM messages').fetchone()
        image = bytes(messages.store.serialize_cdr(messages.raw(9, 5), messages.RAW))
        database.execute('INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)',
                         (row[0], messages.time(99), image))
        database.commit()
        shutil.copy(file, killed)
        shutil.copy(f'{file}-wal', f'{killed}-wal')
        database.close()
        before = killed.read_bytes()
        with pytest.warns(SourceWarning, match='stamps that go back'):
            assert values(open_source(killed)) == [0, 1, 2, 3, 4, 9]
        assert killed.read_bytes() == before

    def test_database_in_use(self, messages, values):
        bag = messages.write('bag', ('/image', messages.RAW, messages.images(5)),
                             storage=Storage.SQLITE3)
        database = sqlite3.connect(storage_file(bag), isolation_level=None)
        database.execute('BEGIN EXCLUSIVE')
        try:
            assert values(open_source(bag)) == list(range(5))
        finally:
            database.close()

    @pytest.mark.parametrize('compress', [
        None, *((name, pack) for name, pack in (('', bytes), ('lz4', lz4.frame.compress),
                                                ('zstd', zstd.compress)))])
    def test_mcap_without_end(self, messages, values, compress):
        """With and without chunks; what was recorded side by side is not in order."""
        bag = messages.write('bag', ('/image', messages.RAW, messages.images(6)[::-1]))
        file = storage_file(bag)
        content = file.read_bytes()
        begin, = struct.unpack('<Q', _chunk_indices(file)[0][25:33])
        length, = struct.unpack_from('<Q', content, begin + 9 + 32)
        records = content[begin + 9 + 40:begin + 9 + 40 + length]
        if compress is not None:
            name, pack = compress
            packed = pack(records)
            head = struct.pack('<QQQII', 0, 0, length, crc32(records), len(name))
            chunk = head + name.encode() + struct.pack('<Q', len(packed)) + packed
            records = struct.pack('<BQ', 6, len(chunk)) + chunk
        file.write_bytes(content[:begin] + records)
        with pytest.warns(SourceWarning, match=r'its end is missing\): 6 messages can be read'):
            assert values(open_source(file)) == list(range(6))


class TestSeveralFiles:
    @pytest.fixture
    def split(self, messages, storage):
        """Return a bag of two files, as a recorder with a limit of size leaves it."""
        bag = messages.write('bag_0', ('/image', messages.RAW, messages.images(5)),
                             storage=storage)
        second = messages.write('bag_1', ('/image', messages.RAW, messages.images(4, 5)),
                                storage=storage)
        shutil.move(storage_file(second), bag)
        return bag

    def list_files(self, bag, names):
        path = bag / 'metadata.yaml'
        metadata = yaml.safe_load(path.read_text())
        metadata['rosbag2_bagfile_information']['relative_file_paths'] = names
        path.write_text(yaml.safe_dump(metadata))

    def test_all_are_read(self, split, storage, values):
        self.list_files(split, [f'somewhere/bag_{i}{SUFFIX[storage]}' for i in (1, 0)])
        source = open_source(split)
        assert len(source) == 9 and values(source) == list(range(9))

    def test_all_are_read_without_metadata(self, split, values):
        (split / 'metadata.yaml').unlink()
        with pytest.warns(SourceWarning, match='bag_0.*, bag_1.* is read'):
            assert values(open_source(split)) == list(range(9))

    def test_missing_one_is_named(self, split, storage, values):
        self.list_files(split, [f'bag_{i}{SUFFIX[storage]}' for i in range(3)])
        with pytest.warns(SourceWarning, match='lacks bag_2'):
            assert values(open_source(split)) == list(range(9))

    def test_one_that_is_not_listed_is_named(self, split, values):
        with pytest.warns(SourceWarning, match='has bag_1.* left out; "ros2 bag reindex'):
            assert values(open_source(split)) == list(range(5))

    def test_all_missing(self, split):
        self.list_files(split, ['other.mcap'])
        with pytest.raises(SourceError, match='lacks what its metadata.yaml lists: other.mcap'):
            open_source(split)

    def test_one_that_cannot_be_read_is_named(self, split, storage, values):
        self.list_files(split, [f'bag_{i}{SUFFIX[storage]}' for i in (0, 1)])
        (split / f'bag_0{SUFFIX[storage]}').write_bytes(b'no bag')
        with pytest.warns(SourceWarning, match='bag_0.* is damaged and cannot be read'):
            assert values(open_source(split)) == list(range(5, 9))

    def test_different_kinds_without_metadata(self, messages):
        bag = messages.write('bag', ('/image', messages.RAW, messages.images(2)))
        (bag / 'metadata.yaml').unlink()
        (bag / 'converted.db3').write_bytes(b'')
        with pytest.raises(SourceError, match='several kinds .*give one file'):
            open_source(bag)


class TestOthers:
    @pytest.mark.parametrize('mode', [CompressionMode.FILE, CompressionMode.MESSAGE])
    @pytest.mark.parametrize('has_metadata', [True, False])
    def test_compressed(self, messages, storage, values, mode, has_metadata):
        bag = messages.write('bag', ('/image', messages.RAW, messages.images(5)),
                             storage=storage, compression=mode)
        if not has_metadata:
            (bag / 'metadata.yaml').unlink()
            with pytest.warns(SourceWarning, match='no metadata.yaml'):
                assert values(open_source(bag)) == list(range(5))
        else:
            assert values(open_source(bag)) == list(range(5))

    @pytest.mark.parametrize('version', [1, 4, 5, 9, 12])
    def test_metadata_of_other_distributions(self, messages, storage, values, version):
        bag = messages.write('bag', ('/image', messages.RAW, messages.images(5)),
                             storage=storage)
        path = bag / 'metadata.yaml'
        metadata = yaml.safe_load(path.read_text())
        information = metadata['rosbag2_bagfile_information']
        information['version'] = version
        if version < 9:
            for name in ('custom_data', 'ros_distro', 'files'):
                del information[name]
            for topic in information['topics_with_message_count']:
                del topic['topic_metadata']['type_description_hash']
        path.write_text(yaml.safe_dump(metadata))
        assert values(open_source(bag)) == list(range(5))

    def test_first_databases(self, messages, values):
        """Without quality of service, type definitions and their tables."""
        path = messages.folder / 'first.db3'
        with sqlite3.connect(path) as database:
            database.executescript(
                'CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, '
                'serialization_format TEXT); CREATE TABLE messages(id INTEGER PRIMARY KEY, '
                'topic_id INTEGER, timestamp INTEGER, data BLOB);')
            database.execute('INSERT INTO topics VALUES (1, "/image", ?, "cdr")', (messages.RAW,))
            for logged, message in messages.images(5):
                database.execute(
                    'INSERT INTO messages (topic_id, timestamp, data) VALUES (1, ?, ?)',
                    (logged, bytes(messages.store.serialize_cdr(message, messages.RAW))))
        database.close()
        assert values(open_source(path)) == list(range(5))

    @pytest.mark.parametrize('definition', ['', 'uint8 a\n', 'strange things here\n'])
    def test_unknown_types_beside_the_images(self, messages, storage, values, definition):
        bag = messages.write('bag', ('/image', messages.RAW, messages.images(5)),
                             ('/other', messages.TEXT, [(1, messages.text('hi'))]),
                             storage=storage)
        file = storage_file(bag)
        if storage is Storage.SQLITE3:
            with sqlite3.connect(file) as database:
                database.execute('UPDATE topics SET type = "a_msgs/msg/B" WHERE name = "/other"')
                database.execute('UPDATE message_definitions SET topic_type = "a_msgs/msg/B", '
                                 'encoded_message_definition = ? WHERE topic_type = ?',
                                 (definition, messages.TEXT))
            database.close()
        else:
            # Of the same length, so that everything stays where it is.
            file.write_bytes(file.read_bytes().replace(b'std_msgs/msg/String',
                                                       b'new_msgs/msg/Things')
                             .replace(b'string data', b'#' * 11))
        assert values(open_source(bag)) == list(range(5))

    def test_schemas_of_another_kind_beside_the_images(self, messages, values):
        bag = messages.write('bag', ('/image', messages.RAW, messages.images(5)),
                             ('/other', messages.TEXT, [(1, messages.text('hi'))]))
        file = storage_file(bag)
        schema = b'std_msgs/msg/String' + struct.pack('<I', 7)
        content = file.read_bytes()
        assert schema in content
        file.write_bytes(content.replace(schema + b'ros2msg', schema + b'unknown'))
        assert values(open_source(bag)) == list(range(5))

    def test_names_that_mean_something_to_databases(self, messages, storage, values):
        bag = messages.write('bag', ('/image', messages.RAW, messages.images(5)),
                             storage=storage)
        bag = bag.rename(bag.with_name('50% of #1?'))
        assert values(open_source(bag)) == list(range(5))


class TestRos1:
    @pytest.fixture
    def bag(self, tmp_path):
        store = get_typestore(Stores.ROS1_NOETIC)
        types, path = store.types, tmp_path / 'old.bag'
        with Ros1Writer(path) as writer:
            connection = writer.add_connection('/image', 'sensor_msgs/msg/Image', typestore=store)
            for index in range(5):
                stamp = types['builtin_interfaces/msg/Time'](sec=7 + index, nanosec=5)
                message = types['sensor_msgs/msg/Image'](
                    header=types['std_msgs/msg/Header'](seq=index, stamp=stamp, frame_id=''),
                    height=2, width=3, encoding='mono8', is_bigendian=0, step=3,
                    data=np.full(6, index, np.uint8))
                writer.write(connection, index, store.serialize_ros1(
                    message, 'sensor_msgs/msg/Image'))
        return path

    def test_is_read(self, bag, values):
        source = open_source(bag)
        assert source.topic == '/image' and values(source) == list(range(5))
        assert next(iter(source)).stamp_ns == 7_000_000_005

    def test_cut_is_named(self, bag):
        bag.write_bytes(bag.read_bytes()[:-300])
        with pytest.raises(SourceError, match='old.bag is damaged.*rosbag reindex'):
            open_source(bag)


def test_folder_of_something_else(tmp_path):
    (tmp_path / 'notes.txt').write_text('')
    assert not is_bag(tmp_path)
    assert not is_bag(tmp_path / 'notes.txt')

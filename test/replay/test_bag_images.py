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

"""Images of bags: which topic, in which order, with which stamps, and what cannot be read."""

from backports import zstd
import numpy as np
import pytest
from rosbags.interfaces import (
    Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime)

from lmsco_ros.replay.bag_images import BagImages
from lmsco_ros.replay.bag_maker import make_bag
from lmsco_ros.replay.bags import reader
from lmsco_ros.replay.errors import SourceError, SourceWarning
from lmsco_ros.replay.sources import open_source
from lmsco_ros.replay.storage import Storage

pytestmark = pytest.mark.filterwarnings('ignore::lmsco_ros.replay.errors.SourceWarning')
SECOND = 1_000_000_000
FOREVER = QosTime(0, 0)
BEST_EFFORT = Qos(QosHistory.KEEP_LAST, 5, QosReliability.BEST_EFFORT, QosDurability.VOLATILE,
                  FOREVER, FOREVER, QosLiveliness.AUTOMATIC, FOREVER, False)


@pytest.fixture
def bag(tmp_path, frames):
    path = tmp_path / 'bag'
    make_bag(frames, path, topic='thermal/image', frame_id='camera', storage=Storage.MCAP,
             start_ns=1_700_000_000_000_000_000)
    return path


def test_frames_with_the_stamps_of_their_headers(bag, frames):
    source = open_source(bag)
    read = list(source)
    assert len(source) == len(read) == 10 and source.fps == pytest.approx(25)
    for frame, original in zip(read, frames):
        np.testing.assert_array_equal(frame.image, original.image)
        assert frame.stamp_ns == 1_700_000_000_000_000_000 + original.stamp_ns


def test_storage_file_is_enough(bag):
    path, = bag.glob('*.mcap')
    assert len(list(open_source(path))) == 10


def test_compressed_images(messages, frames):
    path = messages.write('bag', ('/image/compressed', messages.COMPRESSED, [
        (1, messages.compressed(frames[0].image, 3_000_000_004))]))
    frame, = open_source(path)
    np.testing.assert_array_equal(frame.image, frames[0].image)
    assert frame.stamp_ns == 3_000_000_004


class TestTopic:
    @pytest.mark.parametrize('name', ['thermal/image', '/thermal/image', ''])
    def test_with_or_without_slash(self, bag, name):
        assert open_source(bag, topic=name).topic == '/thermal/image'

    def test_several_are_named(self, messages):
        path = messages.write('bag', ('/left', messages.RAW, messages.images(1)),
                              ('/right', messages.RAW, messages.images(1)))
        with pytest.raises(SourceError, match='--topic: /left, /right'):
            open_source(path)
        assert open_source(path, topic='right').topic == '/right'

    def test_wrong_one_is_answered_with_the_right_ones(self, bag):
        with pytest.raises(SourceError, match='no image topic /nope; it has /thermal/image'):
            open_source(bag, topic='nope')

    def test_none(self, messages):
        path = messages.write('bag', ('/chat', messages.TEXT, [(1, messages.text('hi'))]))
        with pytest.raises(SourceError, match='has no image topic; it holds /chat'):
            open_source(path)

    @pytest.mark.parametrize('storage', list(Storage))
    def test_no_message_on_it(self, messages, storage):
        path = messages.write('bag', ('/image', messages.RAW, []),
                              ('/chat', messages.TEXT, [(1, messages.text('hi'))]),
                              storage=storage)
        with pytest.raises(SourceError, match='no message on /image; record some'):
            open_source(path)

    @pytest.mark.parametrize('storage', list(Storage))
    def test_all_channels_are_read_in_the_order_of_time(self, messages, storage, values):
        images = messages.images(20)
        path = messages.write('bag', ('/image', messages.RAW, images[1::2]),
                              ('/image', messages.RAW, images[::2], BEST_EFFORT),
                              storage=storage)
        source = open_source(path)
        assert len(source) == 20 and values(source) == list(range(20))

    def test_two_kinds_of_image_on_it_are_told(self, messages, frames):
        path = messages.write('bag', ('/image', messages.RAW, messages.images(1)),
                              ('/image', messages.COMPRESSED,
                               [(1, messages.compressed(frames[0].image))]))
        with pytest.raises(SourceError, match='CompressedImage and sensor_msgs/msg/Image on '
                                              '/image; a topic has one type'):
            open_source(path)

    def test_what_else_is_on_it_does_not_matter(self, messages, values):
        path = messages.write('bag', ('/image', messages.TEXT, [(1, messages.text('hi'))]),
                              ('/image', messages.RAW, messages.images(3)))
        assert values(open_source(path)) == [0, 1, 2]


class TestStamps:
    @pytest.mark.parametrize('stamp, logged, expected, words', [
        (lambda i: 0, lambda i: 5 * SECOND + i, lambda i: 5 * SECOND + i, 'time of recording'),
        (lambda i: -SECOND, lambda i: SECOND + i, lambda i: SECOND + i, 'time of recording'),
        (lambda i: 7 * SECOND, lambda i: i, lambda i: 7 * SECOND + i, 'share stamps'),
        (lambda i: (10 + i) // 4 * SECOND, lambda i: i,
         lambda i: (10 + i) // 4 * SECOND + ((10 + i) % 4 if i > 1 else i), 'share stamps'),
        (lambda i: 0, lambda i: 0, lambda i: (i + 1) * (SECOND // 30), 'neither stamp'),
    ])
    def test_are_mended_and_told(self, messages, values, stamp, logged, expected, words):
        path = messages.write('bag', ('/image', messages.RAW, [
            (logged(i), messages.raw(i, stamp(i))) for i in range(8)]))
        source = open_source(path)
        with pytest.warns(SourceWarning, match=words) as told:
            read = list(source)
        assert len(told) == 1
        assert values(read) == list(range(8))
        assert [frame.stamp_ns for frame in read] == [expected(i) for i in range(8)]

    def test_order_is_that_of_recording(self, messages, values):
        times = [3, 1, 2]
        path = messages.write('bag', ('/image', messages.RAW, [
            (i, messages.raw(i, time * SECOND)) for i, time in enumerate(times)]))
        with pytest.warns(SourceWarning, match='read in the order of recording'):
            read = list(open_source(path))
        assert values(read) == [0, 1, 2]
        assert [frame.stamp_ns for frame in read] == [time * SECOND for time in times]

    @pytest.mark.parametrize('storage', list(Storage))
    def test_recorded_in_another_order_than_written(self, messages, values, storage):
        images = messages.images(6)
        path = messages.write('bag', ('/image', messages.RAW, images[::-1]), storage=storage)
        assert values(open_source(path)) == list(range(6))

    def test_rate_of_meaningless_times(self, messages):
        path = messages.write('bag', ('/image', messages.RAW, [
            (0, messages.raw(1, SECOND)), (10 ** 18, messages.raw(2, 2 * SECOND))]))
        assert open_source(path).fps == 30


class TestUndecodable:
    def images(self, messages, broken, **change):
        return [(messages.time(i), messages.raw(i, messages.time(i), **(
            change if i in broken else {}))) for i in range(40)]

    @pytest.mark.parametrize('broken', [{0}, {7}, {39}, {0, 1, 38, 39}])
    @pytest.mark.parametrize('change, reason', [
        ({'encoding': 'no such'}, 'no such'), ({'step': 1}, 'image step is 1'),
        ({'data': np.zeros(3, np.uint8)}, 'truncated')])
    def test_are_left_out_and_told(self, messages, values, broken, change, reason):
        path = messages.write('bag', ('/image', messages.RAW,
                                      self.images(messages, broken, **change)))
        with pytest.warns(SourceWarning, match=rf'image {min(broken)} on /image .*{reason}'):
            read = list(open_source(path))
        assert values(read) == [i for i in range(40) if i not in broken]
        assert [frame.index for frame in read] == values(read)

    def test_many_are_counted(self, messages):
        broken = set(range(1, 21))
        path = messages.write('bag', ('/image', messages.RAW,
                                      self.images(messages, broken, encoding='no such')))
        with pytest.warns(SourceWarning) as told:
            assert len(list(open_source(path))) == 20
        assert [('20 of 40 images' in str(note.message)) for note in told] == [False] * 3 + [True]

    @pytest.mark.parametrize('count', [1, 3, 40])
    def test_none_that_can_is_an_error(self, messages, count):
        path = messages.write('bag', ('/image', messages.RAW, self.images(
            messages, range(40), encoding='no such')[:count]))
        with pytest.warns(SourceWarning), pytest.raises(SourceError, match='no such'):
            list(open_source(path))

    def test_garbage_for_a_message(self, messages, values):
        images = messages.images(3)
        garbage = [(time + 1, bytes([0, 1, 0, 0, *range(length)]))
                   for time, _ in images for length in (0, 3, 9, 40)]
        path = messages.write('bag', ('/image', messages.RAW, images + garbage))
        with pytest.warns(SourceWarning, match='the message is damaged'):
            assert values(BagImages(path)) == [0, 1, 2]

    def test_message_that_unfolds_without_an_end(self, messages, values, monkeypatch):
        monkeypatch.setattr(reader, '_MOST_UNPACKED', 10_000)
        images = messages.images(3)
        bomb = zstd.compress(b'\0\1\0\0' + bytes(100_000))
        path = messages.write('bag', ('/image', messages.RAW, [*images, (messages.time(9), bomb)]))
        with pytest.warns(SourceWarning, match='image 3 .* the message is damaged'):
            assert values(BagImages(path)) == [0, 1, 2]

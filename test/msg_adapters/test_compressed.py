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

"""Compressed images are read at a bounded cost, or refused with a reason."""

from array import array

import cv2
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp
import numpy as np
import pytest
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header

from msg_adapters.compressed import compressed_from_image, image_from_compressed
from msg_adapters.errors import ImageMessageError

SIZES = st.tuples(st.integers(1, 12), st.integers(1, 12))


@given(st.sampled_from([(np.uint8, ()), (np.uint16, ()), (np.uint8, (3,))]).flatmap(
    lambda kind: hnp.arrays(kind[0], SIZES.map(lambda size: size + kind[1]))))
def test_png_keeps_every_value(image):
    message = compressed_from_image(image)
    assert 'png' in message.format
    back = image_from_compressed(message)
    assert back.dtype == image.dtype
    np.testing.assert_array_equal(back, image)


@pytest.mark.parametrize('channels', [1, 3])
def test_jpeg_is_close(channels):
    ramp = np.add.outer(np.arange(48), 2 * np.arange(64)).astype(np.uint8)
    image = ramp if channels == 1 else np.dstack([ramp, ramp // 2, 200 - ramp // 2])
    back = image_from_compressed(compressed_from_image(image, codec='jpeg'))
    assert back.shape == image.shape
    assert np.abs(back.astype(int) - image).mean() < 3


@pytest.mark.parametrize('image', [
    np.zeros((2, 2), np.uint16), np.zeros((2, 2), np.float32)])
def test_jpeg_takes_8_bit_only(image):
    with pytest.raises(ImageMessageError, match='jpeg cannot hold'):
        compressed_from_image(image, codec='jpeg')


def test_unknown_codec_and_float_png_are_refused():
    with pytest.raises(ImageMessageError, match='"png" or "jpeg"'):
        compressed_from_image(np.zeros((2, 2), np.uint8), codec='webp')
    with pytest.raises(ImageMessageError, match='png cannot hold float32'):
        compressed_from_image(np.zeros((2, 2), np.float32))


@pytest.mark.parametrize('codec', ['png', 'jpeg'])
@given(cut=st.floats(0, 1, exclude_max=True))
def test_truncated_files_are_refused(codec, cut):
    image = np.random.default_rng(0).integers(0, 255, (40, 40), np.uint8)
    message = compressed_from_image(image, codec=codec)
    message.data = message.data[:int(cut * len(message.data))]
    with pytest.raises(ImageMessageError, match='truncated|neither jpeg nor png'):
        image_from_compressed(message)


def test_damaged_png_is_refused():
    message = compressed_from_image(
        np.random.default_rng(0).integers(0, 60000, (40, 40), np.uint16))
    message.data[200:300] = array('B', bytes(100))
    with pytest.raises(ImageMessageError, match='damaged'):
        image_from_compressed(message)


def test_padding_behind_the_file_is_harmless():
    image = np.full((3, 4), 9, np.uint8)
    message = compressed_from_image(image)
    message.data.extend(bytes(7))
    np.testing.assert_array_equal(image_from_compressed(message), image)


def test_other_files_are_refused():
    with pytest.raises(ImageMessageError, match='neither jpeg nor png'):
        image_from_compressed(CompressedImage(format='tiff', data=b'II*\0' + bytes(50)))


@pytest.mark.parametrize('declared', [
    '', 'jpeg', '16UC1; png compressed', 'mono8; jpeg compressed bgr8', 'tiff', '\u2603',
    'x' * 5000])
@pytest.mark.parametrize('dtype', [np.uint8, np.uint16])
def test_what_the_format_says_does_not_matter(declared, dtype):
    image = np.random.default_rng(1).integers(0, np.iinfo(dtype).max, (5, 7), dtype)
    message = compressed_from_image(image)
    message.format = declared
    back = image_from_compressed(message)
    assert back.dtype == dtype
    np.testing.assert_array_equal(back, image)


@pytest.mark.parametrize('codec', ['png', 'jpeg'])
@given(damage=st.lists(st.tuples(st.integers(0, 10 ** 6), st.integers(0, 255)), min_size=1))
def test_damaged_files_are_read_or_refused(codec, damage):
    image = np.random.default_rng(0).integers(0, 255, (16, 16), np.uint8)
    message = compressed_from_image(image, codec=codec)
    for place, value in damage:
        message.data[place % len(message.data)] = value
    try:
        assert image_from_compressed(message).dtype in (np.uint8, np.uint16)
    except ImageMessageError as error:
        assert 'expected' in str(error) or 'publish' in str(error) or 'send' in str(error)


def test_small_file_that_claims_a_huge_image_is_refused_before_it_is_decoded(monkeypatch):
    monkeypatch.setattr(cv2, 'imdecode', lambda *args: pytest.fail('decoded'))
    for codec, place in (('png', 16), ('jpeg', None)):
        message = compressed_from_image(np.zeros((8, 8), np.uint8), codec=codec)
        data = bytearray(message.data)
        if codec == 'png':
            data[place:place + 8] = (40000).to_bytes(4, 'big') * 2
        else:
            place = data.index(b'\xff\xc0')
            data[place + 5:place + 9] = (40000).to_bytes(2, 'big') * 2
        message.data = array('B', data)
        with pytest.raises(ImageMessageError, match='claims 40000 x 40000'):
            image_from_compressed(message)


def test_header_is_taken_over():
    header = Header(frame_id='thermal')
    header.stamp.sec = 7
    assert compressed_from_image(np.zeros((2, 2), np.uint8), header=header).header == header

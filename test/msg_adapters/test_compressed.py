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

from benchmarks.costly_images import (
    jpeg_file, jpeg_segment, noise_png, png_chunk, png_file, scans_jpeg)
from msg_adapters.compressed import compressed_from_image, DecodingLimits, image_from_compressed
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


@pytest.fixture
def undecoded(monkeypatch):
    """Fail where anything is spent on pixels."""
    monkeypatch.setattr(cv2, 'imdecode', lambda *args: pytest.fail('decoded'))


def _read(data, **limits):
    return image_from_compressed(CompressedImage(data=data), DecodingLimits(**limits))


@pytest.mark.parametrize('data', [
    png_file(40000, 40000), jpeg_file(40000, 40000), jpeg_file(40000, 40000, components=3),
    jpeg_file(40000, 40000, before=b'\xff\x01'), jpeg_file(40000, 40000, before=b'\xff\xd0' * 9)])
def test_small_file_that_claims_a_huge_image_is_refused_before_it_is_decoded(data, undecoded):
    with pytest.raises(ImageMessageError, match='claims 40000 x 40000.*send smaller frames'):
        _read(data)


@pytest.mark.parametrize('data', [
    jpeg_file(64, 0), jpeg_file(64, 64, frame=0xC9), jpeg_file(64, 64, before=b'\xff\x02'),
    png_file(64, 64, color=1), png_file(64, 64, before=png_chunk(b'ABCD', b''))])
def test_size_that_cannot_be_told_is_refused_before_it_is_decoded(data, undecoded):
    with pytest.raises(ImageMessageError, match='expected'):
        _read(data)


def test_pixels_have_a_limit(undecoded):
    with pytest.raises(ImageMessageError, match='claims 8 x 4 pixels.*at most 31 pixels'):
        _read(jpeg_file(8, 4), pixels=31)


def test_deep_pixels_are_limited_by_their_memory():
    data = noise_png(8, 4, color=6, depth=16, interlace=False)
    with pytest.raises(ImageMessageError, match='4 pixels of 8 bytes.*63 pixels and 252 bytes'):
        _read(data, pixels=63)
    assert _read(data, pixels=10 ** 4).shape == (4, 8)


def test_scans_have_a_limit(monkeypatch):
    data = scans_jpeg(64, 64, 12)
    assert _read(data, scans=12).shape == (64, 64, 3)
    monkeypatch.setattr(cv2, 'imdecode', lambda *args: pytest.fail('decoded'))
    with pytest.raises(ImageMessageError, match='takes 12 scans; expected at most 11'):
        _read(data, scans=11)
    with pytest.raises(ImageMessageError, match='takes 1000 scans'):
        _read(scans_jpeg(64, 64, 1000))


def test_long_file_of_few_pixels_is_refused(undecoded):
    data = jpeg_file(8, 8, before=jpeg_segment(0xE1, bytes(60000)))
    with pytest.raises(ImageMessageError, match='too long; expected at most 8192 bytes'):
        _read(data, pixels=4096)


@pytest.mark.parametrize('interlace', [0, 1])
def test_png_that_unfolds_to_more_than_its_pixels_is_refused(interlace, undecoded):
    data = png_file(64, 64, interlace=interlace, rows=bytes(6 * 10 ** 8))
    with pytest.raises(ImageMessageError, match='holds more than its 64 x 64 pixels; expected'):
        _read(data)


def test_damage_is_told_where_a_long_png_is_unfolded(undecoded):
    data = png_file(64, 64, before=png_chunk(b'IDAT', b'damaged' * 10 ** 5))
    with pytest.raises(ImageMessageError, match='is damaged; expected'):
        _read(data)


@pytest.mark.parametrize('color, depth', [(0, 8), (0, 16), (2, 8), (4, 16), (6, 16)])
@pytest.mark.parametrize('interlace', [False, True])
@pytest.mark.parametrize('width, height', [(1, 1), (1, 9), (9, 1), (5, 7), (64, 48)])
def test_png_with_just_its_pixels_passes_the_unfolding(width, height, color, depth, interlace,
                                                       monkeypatch):
    monkeypatch.setattr('msg_adapters.png_file._HARMLESS_BYTES', 0)
    data = noise_png(width, height, color=color, depth=depth, interlace=interlace)
    assert _read(data, pixels=10 ** 4).shape[:2] == (height, width)


@pytest.mark.parametrize('start', [
    b'BM', b'GIF89a', b'RIFF\0\0\0\0WEBP', b'MM\0*', b'P5\n9 9\n255\n', b'\xff\xd8\0',
    b'\xffO\xffQ', b'\x89PNX\r\n\x1a\n'])
def test_what_else_opencv_reads_does_not_reach_it(start, undecoded):
    with pytest.raises(ImageMessageError, match='neither jpeg nor png; publish one of these'):
        _read(start + bytes(200))


@given(hnp.arrays(np.uint8, SIZES.map(lambda size: size + (4,))))
def test_transparency_is_left_out(image):
    data = cv2.imencode('.png', image)[1]
    np.testing.assert_array_equal(_read(data.tobytes()), image[..., :3])


@given(hnp.arrays(np.uint16, SIZES.map(lambda size: size + (3,))), st.booleans())
def test_color_of_16_bits_becomes_gray(image, transparent):
    stored = np.dstack([image, image[..., 0]]) if transparent else image
    gray = image @ [.114, .587, .299]
    back = _read(cv2.imencode('.png', stored)[1].tobytes())
    assert back.dtype == np.uint16
    np.testing.assert_allclose(back, gray, atol=8)


@pytest.mark.parametrize('color, depth, dtype', [
    (0, 8, np.uint8), (0, 16, np.uint16), (4, 8, np.uint8), (4, 16, np.uint16)])
def test_interlaced_gray_with_and_without_transparency_is_gray(color, depth, dtype):
    images = [_read(noise_png(16, 16, color=color, depth=depth, interlace=interlace))
              for interlace in (False, True)]
    assert all(image.shape == (16, 16) and image.dtype == dtype for image in images)


def test_pixels_of_an_interlaced_png_stand_in_their_places():
    """The passes of 2 x 2 pixels: the first, one to its right, and the row below."""
    rows = b''.join(b'\0' + bytes(values) for values in ([10], [20], [30, 40]))
    np.testing.assert_array_equal(_read(png_file(2, 2, interlace=1, rows=rows)),
                                  [[10, 20], [30, 40]])


def test_animation_gives_its_first_image():
    image = np.arange(12, dtype=np.uint8).reshape(3, 4)
    data = bytes(compressed_from_image(image).data)
    animated = data[:33] + png_chunk(b'acTL', bytes((0, 0, 0, 2, 0, 0, 0, 0))) + data[33:-12] \
        + png_chunk(b'fdAT', bytes(40)) + data[-12:]
    np.testing.assert_array_equal(_read(animated), image)


def test_second_image_behind_the_first_is_left_alone():
    first, second = (bytes(compressed_from_image(np.full((8, 8), value, np.uint8),
                                                 codec='jpeg').data) for value in (50, 200))
    np.testing.assert_array_equal(_read(first + second), np.full((8, 8), 50))


def test_header_is_taken_over():
    header = Header(frame_id='thermal')
    header.stamp.sec = 7
    assert compressed_from_image(np.zeros((2, 2), np.uint8), header=header).header == header


def test_array_that_no_file_of_the_codec_holds_is_refused():
    with pytest.raises(ImageMessageError, match='70000 x 2 pixels.*sensor_msgs/Image'):
        compressed_from_image(np.zeros((2, 70000), np.uint8), codec='jpeg')

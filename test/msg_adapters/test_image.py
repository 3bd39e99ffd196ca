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

"""Images survive the way through a message, and broken messages are refused with a reason."""

from array import array
import sys

from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as hnp
import numpy as np
import pytest
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from msg_adapters.encodings import ALIASES, ENCODINGS
from msg_adapters.errors import ImageMessageError
from msg_adapters.image import image_from_message, message_from_image

SIZES = st.tuples(st.integers(3, 12), st.integers(3, 12))
REVERSIBLE = sorted(name for name, layout in ENCODINGS.items() if layout.reversible)
PLAIN = sorted(set(REVERSIBLE) - {'rgb8'})
MOSAICS = sorted(name for name in ENCODINGS if name.startswith('bayer'))
RED, GREEN, BLUE = .299, .587, .114


def _gray(pixels, order):
    return sum(share * pixels[..., order.index(name)].astype(float)
               for name, share in zip('rgb', (RED, GREEN, BLUE)))


def _expected(encoding, pixels, height):
    """Return what the pixels of a message, (rows, W[, channels]), mean, and the tolerance."""
    name = encoding.lower()
    if name[:4] in ('nv12', 'nv21', 'nv16', 'nv61', 'nv24', 'nv42', 'i420', 'yv12'):
        return pixels[:height], 0
    if name in ('yuv422', 'uyvy'):
        return pixels[..., 1], 0
    if name in ('yuv422_yuy2', 'yuyv'):
        return pixels[..., 0], 0
    if name in ('bgr8', '8uc3', 'bgra8', '8uc4'):
        return pixels[..., :3], 0
    if name in ('rgb8', 'rgba8'):
        return pixels[..., 2::-1], 0
    if name in ('rgb16', 'rgba16'):
        return _gray(pixels, 'rgb'), 8
    if name in ('bgr16', 'bgra16', '16uc3', '16uc4'):
        return _gray(pixels, 'bgr'), 8
    assert pixels.ndim == 2, encoding
    return pixels, 0


def _layout_shape(encoding, height, width):
    layout = ENCODINGS[encoding]
    channels = (layout.channels,) if layout.channels > 1 else ()
    return (layout.rows(height), width, *channels)


@st.composite
def messages_in_parts(draw, encodings):
    """Draw an encoding, a height, and the pixels of a message."""
    encoding = draw(encodings)
    height, width = draw(SIZES)
    return encoding, height, draw(hnp.arrays(
        ENCODINGS[encoding].dtype, _layout_shape(encoding, height, width)))


def _as_message(encoding, height, pixels, padding=0, big=False, last_row_padded=True):
    wire = pixels.astype(pixels.dtype.newbyteorder('>' if big else '<'))
    rows = [row.tobytes() + b'\xa5' * padding for row in wire]
    data = b''.join(rows)
    if padding and not last_row_padded:
        data = data[:-padding]
    return Image(height=height, width=pixels.shape[1], encoding=encoding, step=len(rows[0]),
                 is_bigendian=int(big), data=array('B', data))


@pytest.mark.parametrize('encoding', sorted(set(ENCODINGS) - set(MOSAICS)))
@settings(max_examples=20)
@given(st.data(), st.integers(0, 7), st.booleans(), st.booleans())
def test_every_encoding_is_read_padded_or_not_in_either_byte_order(
        encoding, data, padding, big, last_row_padded):
    _, height, pixels = parts = data.draw(messages_in_parts(st.just(encoding)))
    expected, tolerance = _expected(encoding, pixels, height)
    back = image_from_message(_as_message(*parts, padding, big, last_row_padded))
    assert back.dtype.isnative and back.shape == expected.shape
    if tolerance:
        np.testing.assert_allclose(back, expected, atol=tolerance)
    else:
        np.testing.assert_array_equal(back, expected)


@pytest.mark.parametrize('encoding', MOSAICS)
@settings(max_examples=20)
@given(SIZES, st.tuples(*[st.integers(0, 255)] * 3), st.booleans())
def test_mosaics_become_gray(encoding, size, color, big):
    deep = encoding.endswith('16')
    values = {name: value * (257 if deep else 1) for name, value in zip('rgb', color)}
    order = encoding[len('bayer_'):][:4]
    pixels = np.array([[values[order[2 * (row % 2) + column % 2]] for column in range(size[1])]
                       for row in range(size[0])], ENCODINGS[encoding].dtype)
    back = image_from_message(_as_message(encoding, size[0], pixels, padding=1, big=big))
    assert back.dtype == pixels.dtype and back.shape == pixels.shape
    gray = values['r'] * RED + values['g'] * GREEN + values['b'] * BLUE
    np.testing.assert_allclose(back, gray, atol=8 if deep else 1)


def test_mosaic_without_neighbors_is_refused():
    with pytest.raises(ImageMessageError, match='at least 3 in each direction of bayer_rggb8'):
        image_from_message(_as_message('bayer_rggb8', 2, np.zeros((2, 9), np.uint8)))


@pytest.mark.parametrize('encoding', sorted(ENCODINGS))
@settings(max_examples=10)
@given(st.data())
def test_any_missing_byte_is_noticed(encoding, data):
    message = _as_message(*data.draw(messages_in_parts(st.just(encoding))))
    message.data = message.data[:data.draw(st.integers(0, len(message.data) - 1))]
    with pytest.raises(ImageMessageError, match='truncated'):
        image_from_message(message)


@pytest.mark.parametrize('encoding, rows', [
    ('nv12', 6), ('nv21', 6), ('i420', 6), ('yv12', 6), ('nv16', 8), ('nv61', 8), ('nv24', 12),
    ('nv42', 12), ('mono8', 4)])
def test_chroma_lies_behind_the_luminance(encoding, rows):
    pixels = np.arange(rows * 8, dtype=np.uint8).reshape(rows, 8)
    np.testing.assert_array_equal(
        image_from_message(_as_message(encoding, 4, pixels)), pixels[:4])
    with pytest.raises(ImageMessageError, match=f'expected {rows * 8} for {rows} rows'):
        image_from_message(_as_message(encoding, 4, pixels[:-1]))


@pytest.mark.parametrize('encoding', ['nv12', 'i420'])
def test_half_a_row_of_chroma_may_be_missing_below_an_odd_height(encoding):
    pixels = np.arange(7 * 6, dtype=np.uint8).reshape(7, 6)
    back = image_from_message(_as_message(encoding, 5, pixels))
    np.testing.assert_array_equal(back, pixels[:5])


@given(messages_in_parts(st.sampled_from(sorted(set(ALIASES.values())))), st.data())
def test_further_spellings_are_read_alike(parts, data):
    encoding, height, pixels = parts
    spelling = data.draw(st.sampled_from(
        [encoding, *(alias for alias, name in ALIASES.items() if name == encoding)]))
    spelling = data.draw(st.sampled_from(
        [spelling, spelling.upper(), spelling.capitalize(), f'{spelling} ']))
    np.testing.assert_array_equal(
        image_from_message(_as_message(spelling, height, pixels)),
        image_from_message(_as_message(encoding, height, pixels)))


def test_packed_values_are_told_by_their_short_rows():
    packed = Image(height=2, width=8, encoding='mono12', step=12, data=bytes(24))
    with pytest.raises(ImageMessageError, match='a row of 8 mono12 pixels takes 16'):
        image_from_message(packed)


@given(messages_in_parts(st.sampled_from(REVERSIBLE)))
def test_round_trip_keeps_every_value(parts):
    encoding, height, pixels = parts
    image = image_from_message(_as_message(encoding, height, pixels))
    message = message_from_image(image, encoding=encoding)
    assert message.encoding == encoding
    back = image_from_message(message)
    assert back.dtype == image.dtype
    np.testing.assert_array_equal(back, image)


@given(messages_in_parts(st.sampled_from(sorted(ENCODINGS))))
def test_what_is_read_can_be_written(parts):
    image = image_from_message(_as_message(*parts))
    np.testing.assert_array_equal(image_from_message(message_from_image(image)), image)


@pytest.mark.parametrize('encoding', PLAIN)
def test_plain_layouts_are_read_without_a_copy(encoding):
    image = np.zeros(_layout_shape(encoding, 4, 6), ENCODINGS[encoding].dtype)
    message = message_from_image(image, encoding=encoding)
    view = image_from_message(message)
    assert np.shares_memory(view, np.frombuffer(message.data, np.uint8))


def test_values_that_do_not_start_on_their_boundaries_are_read():
    image = np.arange(24, dtype=np.float64).reshape(4, 6)
    message = message_from_image(image)
    message._data = np.frombuffer(b'\0' + message.data.tobytes(), np.uint8)[1:]
    back = image_from_message(message)
    assert back.flags.aligned
    np.testing.assert_array_equal(back, image)


def test_color_is_blue_first_in_arrays():
    blue = np.zeros((1, 1, 3), np.uint8)
    blue[..., 0] = 200
    assert bytes(message_from_image(blue).data) == b'\xc8\0\0'
    assert bytes(message_from_image(blue, encoding='rgb8').data) == b'\0\0\xc8'


def test_data_has_the_type_that_messages_take_unchecked():
    message = message_from_image(np.arange(6, dtype=np.uint16).reshape(2, 3)[:, ::2])
    assert isinstance(message.data, array)
    assert np.frombuffer(message.data, np.uint16).tolist() == [0, 2, 3, 5]
    assert message.is_bigendian == (sys.byteorder == 'big')


def test_header_is_taken_over():
    header = Header(frame_id='thermal')
    header.stamp.sec = 7
    image = np.zeros((2, 2), np.uint8)
    assert message_from_image(image, header=header).header == header


def _message(**fields) -> Image:
    whole = {'height': 2, 'width': 3, 'encoding': 'mono16', 'step': 6, 'data': bytes(12)}
    return Image(**{**whole, **fields})


@pytest.mark.parametrize('fields, words', [
    ({'encoding': 'mono61'}, ['mono61', 'nearest name is mono16', 'driver']),
    ({'encoding': '32FC3'}, ['32FC3', 'expected one of', 'one channel', *ENCODINGS]),
    ({'encoding': 'mono12p'}, ['mono12p', 'mono16']),
    ({'encoding': 'x' * 5000}, ['mono16']),
    ({'encoding': ''}, ['""', 'mono8']),
    ({'height': 0}, ['empty', '3 x 0']),
    ({'width': 0}, ['empty', '0 x 2']),
    ({'step': 5}, ['step is 5', 'takes 6', 'set step']),
    ({'step': 0}, ['step is 0']),
    ({'data': bytes(11)}, ['truncated', '11 bytes', 'expected 12']),
    ({'data': b''}, ['truncated', '0 bytes']),
])
def test_broken_messages_say_what_was_expected(fields, words):
    with pytest.raises(ImageMessageError) as error:
        image_from_message(_message(**fields))
    assert all(word in str(error.value) for word in words), error.value


@pytest.mark.parametrize('image, encoding', [
    (np.zeros((2, 2), np.int64), ''),
    (np.zeros((2, 2), bool), ''),
    (np.zeros((2, 2), np.uint16), 'rgb16'),
    (np.zeros((2, 2), np.uint8), 'nv12'),
    (np.zeros((2, 2, 4), np.uint8), ''),
    (np.zeros(4, np.uint8), ''),
    (np.zeros((0, 4), np.uint8), ''),
    (np.zeros((2, 2), np.uint8), 'mono16'),
    (np.zeros((2, 2), np.uint8), 'jpeg'),
])
def test_arrays_without_an_encoding_are_refused(image, encoding):
    with pytest.raises(ImageMessageError, match='expected'):
        message_from_image(image, encoding=encoding)

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

import cv2
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp
import numpy as np
import pytest
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from msg_adapters.errors import ImageMessageError
from msg_adapters.image import ENCODINGS, image_from_message, message_from_image

SIZES = st.tuples(st.integers(1, 12), st.integers(1, 12))


@st.composite
def encoded_images(draw):
    """Draw an encoding and an array that fits it."""
    encoding = draw(st.sampled_from(sorted(ENCODINGS)))
    dtype, channels = ENCODINGS[encoding]
    shape = draw(SIZES) + ((3,) if channels == 3 else ())
    return encoding, draw(hnp.arrays(dtype, shape))


@given(encoded_images())
def test_round_trip_keeps_every_value(encoded):
    encoding, image = encoded
    message = message_from_image(image, encoding=encoding)
    assert message.encoding == encoding
    back = image_from_message(message)
    assert back.dtype == image.dtype
    np.testing.assert_array_equal(back, image)


@given(encoded_images(), st.integers(0, 7), st.booleans(), st.booleans())
def test_padding_and_byte_order_do_not_change_the_pixels(encoded, padding, big, last_row_padded):
    encoding, image = encoded
    wire = cv2.cvtColor(image, cv2.COLOR_BGR2RGB) if encoding == 'rgb8' else image
    wire = wire.astype(wire.dtype.newbyteorder('>' if big else '<'))
    rows = [row.tobytes() + b'\xa5' * padding for row in wire]
    data = b''.join(rows)
    if padding and not last_row_padded:
        data = data[:-padding]
    message = Image(height=image.shape[0], width=image.shape[1], encoding=encoding,
                    step=len(rows[0]), is_bigendian=int(big), data=array('B', data))
    back = image_from_message(message)
    assert back.dtype == image.dtype and back.dtype.isnative
    np.testing.assert_array_equal(back, image)


@pytest.mark.parametrize('encoding', sorted(set(ENCODINGS) - {'rgb8'}))
def test_plain_layouts_are_read_without_a_copy(encoding):
    dtype, channels = ENCODINGS[encoding]
    image = np.zeros((4, 6, 3) if channels == 3 else (4, 6), dtype)
    message = message_from_image(image, encoding=encoding)
    view = image_from_message(message)
    assert np.shares_memory(view, np.frombuffer(message.data, np.uint8))


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
    ({'encoding': 'yuv422'}, ['yuv422', 'mono16', 'driver']),
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


@given(encoded_images(), st.data())
def test_any_missing_byte_is_noticed(encoded, data):
    encoding, image = encoded
    message = message_from_image(image, encoding=encoding)
    message.data = message.data[:data.draw(st.integers(0, len(message.data) - 1))]
    with pytest.raises(ImageMessageError, match='truncated'):
        image_from_message(message)


@pytest.mark.parametrize('image, encoding', [
    (np.zeros((2, 2), np.int32), ''),
    (np.zeros((2, 2), np.float64), ''),
    (np.zeros((2, 2, 4), np.uint8), ''),
    (np.zeros(4, np.uint8), ''),
    (np.zeros((0, 4), np.uint8), ''),
    (np.zeros((2, 2), np.uint8), 'mono16'),
    (np.zeros((2, 2), np.uint8), 'jpeg'),
])
def test_arrays_without_an_encoding_are_refused(image, encoding):
    with pytest.raises(ImageMessageError, match='expected'):
        message_from_image(image, encoding=encoding)

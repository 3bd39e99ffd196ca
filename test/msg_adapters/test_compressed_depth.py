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

"""Images of the transport compressedDepth are read, or refused with what to set."""

import struct

from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp
import numpy as np
import pytest
from sensor_msgs.msg import CompressedImage

from msg_adapters.compressed import compressed_from_image, DecodingLimits, image_from_compressed
from msg_adapters.errors import ImageMessageError

COUNTS = hnp.arrays(np.uint16, st.tuples(st.integers(1, 12), st.integers(1, 12)))


def _message(counts, declared, a=0., b=0.):
    data = struct.pack('<iff', 0, a, b) + bytes(compressed_from_image(counts).data)
    return CompressedImage(data=data, format=declared)


@pytest.mark.parametrize('declared', [
    '16UC1; compressedDepth png', '16UC1; compressedDepth', '16UC1;compressedDepth png',
    'mono16; compressedDepth png', '16UC1; png compressed '])
@given(COUNTS)
def test_counts_are_kept(declared, counts):
    image = image_from_compressed(_message(counts, declared))
    assert image.dtype == np.uint16
    np.testing.assert_array_equal(image, counts)


@given(hnp.arrays(np.float32, (5, 7), elements=st.floats(.5, 9, width=32)))
def test_numbers_come_back_as_exact_as_they_were_sent(depths):
    """As the publisher does it: the inverse between its resolution and the largest number."""
    resolution, largest = 100., 10.
    a = resolution * (resolution + 1)
    b = 1 - a / largest
    counts = (a / depths + b).astype(np.uint16)
    counts[2, 3] = 0
    image = image_from_compressed(_message(counts, '32FC1; compressedDepth png', a, b))
    assert image.dtype == np.float32 and np.isnan(image[2, 3])
    depths[2, 3] = np.nan
    np.testing.assert_allclose(image, depths, atol=largest ** 2 / a)


def test_number_without_end_is_none():
    counts = np.array([[7, 8]], np.uint16)
    image = image_from_compressed(_message(counts, '32FC1; compressedDepth png', 2, 7))
    np.testing.assert_array_equal(image, [[np.nan, 2]])


def test_counts_without_the_head_are_read_by_their_first_bytes():
    message = compressed_from_image(np.full((3, 4), 300, np.uint16))
    message.format = '16UC1; compressedDepth png'
    np.testing.assert_array_equal(image_from_compressed(message), np.full((3, 4), 300))


@pytest.mark.parametrize('declared, a, b, words', [
    ('', 0, 0, 'does not say what its pixels are'),
    ('compressedDepth', 0, 0, 'does not say what its pixels are'),
    ('32FC1; compressedDepth png', 0, 0, 'quantized by 0 and 0'),
    ('32FC1; compressedDepth png', float('nan'), 1, 'quantized by nan and 1'),
    ('32FC1; compressedDepth png', 1, float('-inf'), 'quantized by 1 and -inf'),
])
def test_unknown_meaning_is_refused(declared, a, b, words):
    with pytest.raises(ImageMessageError, match=f'{words}.*expected'):
        image_from_compressed(_message(np.ones((3, 4), np.uint16), declared, a, b))


@pytest.mark.parametrize('data', [
    b'', bytes(12), struct.pack('<iffII', 0, 1, 1, 640, 512) + bytes(90)])
def test_rvl_is_refused_with_the_parameter_to_set(data):
    message = CompressedImage(data=data, format='16UC1; compressedDepth rvl')
    with pytest.raises(ImageMessageError, match='"format" of the publisher to png.*rvl'):
        image_from_compressed(message)


def test_numbers_without_the_head_are_refused():
    message = compressed_from_image(np.ones((3, 4), np.uint16))
    message.format = '32FC1; compressedDepth png'
    with pytest.raises(ImageMessageError, match='expected a png behind 12 bytes'):
        image_from_compressed(message)


def test_other_pixels_are_refused():
    with pytest.raises(ImageMessageError, match='other pixels than 16-bit gray'):
        image_from_compressed(_message(np.ones((3, 4), np.uint8), '16UC1; compressedDepth png'))


def test_limits_hold_behind_the_head():
    message = _message(np.ones((30, 40), np.uint16), '16UC1; compressedDepth png')
    assert image_from_compressed(message, DecodingLimits(pixels=1200)).shape == (30, 40)
    with pytest.raises(ImageMessageError, match='claims 40 x 30'):
        image_from_compressed(message, DecodingLimits(pixels=1199))

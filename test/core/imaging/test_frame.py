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

"""What is accepted as a frame, and that its values and its memory are what they were."""

from collections import UserList

from hypothesis import given, strategies as st
from hypothesis.extra import numpy as arrays
import numpy as np
import pytest

from lmsco_ros.core.errors import ImageError
from lmsco_ros.core.imaging.frame import read_frame

COUNTS = np.arange(120).reshape(10, 12)


@pytest.mark.parametrize('dtype, shape', [
    (np.uint8, (8, 8)), (np.uint16, (480, 640)), (np.float32, (9, 30)), (np.uint8, (20, 20, 3))])
def test_what_needs_no_conversion_is_not_copied(dtype, shape):
    image = np.zeros(shape, dtype)
    frame = read_frame(image)
    assert frame.pixels.base is image or frame.pixels is image
    assert frame.kind == f'{shape} {np.dtype(dtype).name}'


@pytest.mark.parametrize('dtype', [
    np.int8, np.int16, np.int32, np.int64, np.uint32, np.uint64, np.float16, np.float64,
    np.longdouble, '>i2', '>f8', '<i4'])
def test_other_numbers_keep_their_values_as_float32(dtype):
    frame = read_frame(COUNTS.astype(dtype))
    assert frame.pixels.dtype == np.float32 and frame.pixels.dtype.isnative
    np.testing.assert_array_equal(frame.pixels, COUNTS)
    assert frame.kind == f'(10, 12) {np.dtype(dtype).name}'


@pytest.mark.parametrize('dtype', ['>u2', '>f4'])
def test_bytes_of_another_order_are_turned(dtype):
    frame = read_frame((300 + COUNTS).astype(dtype))
    assert frame.pixels.dtype == np.dtype(dtype).newbyteorder('=') and frame.pixels.dtype.isnative
    np.testing.assert_array_equal(frame.pixels, 300 + COUNTS)


@pytest.mark.filterwarnings('error')
def test_limits_of_float32():
    values = np.full((8, 8), 2.0**24 + 1)
    values[0, :3] = 1e300, -1e300, np.nan
    pixels = read_frame(values).pixels
    assert pixels[1, 1] == 2**24
    np.testing.assert_array_equal(pixels[0, :3], [np.inf, -np.inf, np.nan])
    assert read_frame(np.full((8, 8), 2**31 - 1, np.int32)).pixels[0, 0] == 2.0**31


LAYOUTS = {
    'up': lambda a: a[::-1], 'left': lambda a: a[:, ::-1], 'fortran': np.asfortranarray,
    'strided': lambda a: np.repeat(np.repeat(a, 2, 0), 3, 1)[::2, 1::3],
    'channel': lambda a: a[:, :, None],
    'planes': lambda a: np.stack([a, a + 1], axis=2)[:, :, :1],
    'unaligned': lambda a: unaligned(a), 'matrix': np.matrix,
    'subclass': lambda a: a.view(type('Labeled', (np.ndarray,), {}))}


def unaligned(array):
    """Return the array in rows that begin at odd bytes."""
    row = array.shape[1] * array.itemsize + 1
    buffer = np.zeros(1 + row * len(array), np.uint8)
    view = np.ndarray(array.shape, array.dtype, buffer, 1, (row, array.itemsize))
    view[...] = array
    return view


@pytest.mark.parametrize('dtype', [np.uint8, np.uint16, np.float32, np.int32])
@pytest.mark.filterwarnings('ignore:the matrix subclass')
@pytest.mark.parametrize('layout', LAYOUTS)
def test_any_layout_and_subclass_is_read_as_it_looks(layout, dtype):
    given = LAYOUTS[layout](COUNTS.astype(dtype))
    expected = np.array(given).reshape(10, 12)
    given.flags.writeable = False
    pixels = read_frame(given).pixels
    assert type(pixels) is np.ndarray and pixels.shape == (10, 12) and pixels.flags.aligned
    np.testing.assert_array_equal(pixels, expected)


@given(values=arrays.arrays(np.uint16, (9, 11)), mask=arrays.arrays(bool, (9, 11)),
       dtype=st.sampled_from([np.uint8, np.uint16, np.int32, np.float32, np.float64]))
def test_masked_pixels_have_no_value(values, mask, dtype):
    values = values.astype(dtype)
    frame = read_frame(np.ma.array(values, mask=mask))
    np.testing.assert_array_equal(frame.pixels, np.where(mask, np.nan, values.astype(float)))
    # Frames of which nothing is masked are of the same kind.
    assert frame.kind == read_frame(values).kind
    assert type(frame.pixels) is np.ndarray


def test_masked_colors_are_refused_and_others_are_not():
    image = np.ma.array(np.zeros((9, 9, 3), np.uint8))
    assert read_frame(image).pixels.shape == (9, 9, 3)
    image[2, 3, 1] = np.ma.masked
    with pytest.raises(ImageError, match=r'masked array of colors.*give image\.filled'):
        read_frame(image)


def tensor():
    return pytest.importorskip('torch').zeros(20, 20)


@pytest.mark.parametrize('make, reason', [
    (lambda: [[1, 2], [3, 4]], r'is a list; expected a NumPy array: give np\.asarray'),
    (lambda: None, 'is a NoneType; expected a NumPy array: see whether the frame could be read'),
    (lambda: UserList(), 'is a UserList; expected a NumPy array'),
    (tensor, r'is a Tensor; expected a NumPy array: give image\.cpu\(\)\.numpy\(\)'),
    (lambda: np.zeros((20, 20), bool), 'type bool; expected .* give the counts'),
    (lambda: np.zeros((20, 20), complex), 'type complex128; expected'),
    (lambda: np.zeros((20, 20), object), 'type object; expected'),
    (lambda: np.zeros((20, 20), 'm8[s]'), r'type timedelta64\[s\]; expected'),
    (lambda: np.zeros((20, 20), [('t', 'f4')]), 'expected .* give the counts'),
    (lambda: np.zeros((20, 20, 4), np.uint8), r'shape \(20, 20, 4\).*alpha'),
    (lambda: np.zeros((20, 20, 2), np.uint8), r'shape \(20, 20, 2\).*give one channel'),
    (lambda: np.zeros((20, 20, 0), np.uint8), r'shape \(20, 20, 0\).*give one channel'),
    (lambda: np.zeros((3, 20, 20), np.uint8), r'shape \(3, 20, 20\).*give one channel'),
    (lambda: np.zeros((20, 20, 3), np.uint16), 'type uint16; expected .* give one channel'),
    (lambda: np.zeros((20, 20, 3)), 'type float64; expected .* give one channel'),
    (lambda: np.zeros(20, np.uint8), r'shape \(20,\).*one image'),
    (lambda: np.zeros(()), r'shape \(\).*one image'),
    (lambda: np.zeros((2, 20, 20, 3), np.uint8), r'shape \(2, 20, 20, 3\).*one image'),
    (lambda: np.zeros((0, 20), np.uint8), '20 x 0 pixels; expected at least'),
    (lambda: np.zeros((20, 0, 3), np.uint8), '0 x 20 pixels; expected at least'),
    (lambda: np.zeros((7, 20), np.uint8), '20 x 7 pixels; expected at least'),
])
def test_unsupported_images_are_refused_for_a_reason(make, reason):
    with pytest.raises(ImageError, match=reason):
        read_frame(make())

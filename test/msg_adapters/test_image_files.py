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

"""Size and scans of a file are told before it is decoded, or the file is refused."""

import struct

import cv2
from hypothesis import given, strategies as st
import numpy as np
import pytest

from benchmarks.costly_images import (
    jpeg_file, jpeg_segment, noise_png, png_chunk, png_file, scans_jpeg)
from msg_adapters.errors import ImageMessageError
from msg_adapters.jpeg_file import JPEG_START, read_jpeg
from msg_adapters.png_file import PNG_START, read_png

FILL, TEM, RESTART = b'\xff' * 3, b'\xff\x01', b'\xff\xd3'


def _jpeg(data):
    return read_jpeg(memoryview(data))


def _png(data):
    return read_png(memoryview(data))


def _encoded(kind, image, *parameters):
    return cv2.imencode(kind, image, parameters)[1].tobytes()


@given(st.integers(1, 300), st.integers(1, 300), st.booleans(), st.booleans())
def test_size_is_that_of_the_image(width, height, color, progressive):
    image = np.zeros((height, width, 3) if color else (height, width), np.uint8)
    jpeg = _jpeg(_encoded('.jpg', image, cv2.IMWRITE_JPEG_PROGRESSIVE, int(progressive)))
    png = _png(_encoded('.png', image))
    for file in (jpeg, png):
        assert (file.width, file.height, file.gray) == (width, height, not color)
    assert (jpeg.scans > 1) == progressive and png.scans == 1


@pytest.mark.parametrize('before', [
    TEM, RESTART, FILL, TEM * 50 + FILL, b'\0\xff\0', jpeg_segment(0xE1, b'\xff\xd9' * 9),
    jpeg_segment(0xFE, jpeg_file(3, 4)), jpeg_segment(0xDC, b'\0\x07'),
    jpeg_segment(0xDD, b'\0\1'), jpeg_segment(0xE0, b'') + RESTART + jpeg_segment(0xCC, b'\0\0')])
def test_markers_in_front_of_the_size_do_not_hide_it(before):
    data = jpeg_file(65500, 16000, components=3, before=before)
    assert (_jpeg(data).width, _jpeg(data).height) == (65500, 16000)


@pytest.mark.parametrize('frame', [0xC0, 0xC1, 0xC2])
@pytest.mark.parametrize('before', [TEM, RESTART, FILL, b'\0\xff\0'])
def test_the_decoder_sees_the_same_size(frame, before):
    """What this relies on is that both skip the same; a decoder may still refuse the file."""
    data = jpeg_file(40, 30, frame=frame, before=before)
    decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert decoded is None or decoded.shape == (_jpeg(data).height, _jpeg(data).width)


@pytest.mark.parametrize('before, words', [
    (b'\xff\x02', 'marker FF02'), (b'\xff\xbf', 'marker FFBF'), (b'\xff\xd8', 'marker FFD8'),
    (b'\xff\xde\0\x02', 'marker FFDE'), (b'\xff\xf7\0\x02', 'marker FFF7'),
    (b'\xff\xc8\0\x02', 'marker FFC8'), (b'\xff\xe1\0\x01', 'segment of 1 bytes'),
    (b'\xff\xe1\0\0', 'segment of 0 bytes'), (b'\xff\xe1\xff\xff', 'truncated'),
    (b'\xff\xd9', 'holds no image'), (jpeg_segment(0xC0, b'\x08\0\x04\0\x04\1\1\x11\0'), 'twice'),
    (jpeg_segment(0xC0, b'\x08\0\x04\0\x04'), 'does not tell its size'),
    (jpeg_segment(0xC0, b'\x08\0\x04\0\x04\3\1\x11\0'), 'does not tell its size'),
    (jpeg_segment(0xC0, b'\x0c\0\x04\0\x04\1\1\x11\0'), '1 components of 12 bits'),
    (jpeg_segment(0xC0, b'\x08\0\x04\0\x04\2\1\x11\0\2\x11\0'), '2 components of 8 bits'),
    (jpeg_segment(0xFE, b'') * 2 ** 16, 'more than 65536 segments'),
])
def test_jpeg_whose_size_cannot_be_told_is_refused(before, words):
    with pytest.raises(ImageMessageError, match=words):
        _jpeg(jpeg_file(4, 4, before=before))


@pytest.mark.parametrize('frame', sorted(set(range(0xC3, 0xD0)) - {0xC4, 0xC8, 0xCC}))
def test_kinds_of_jpeg_that_no_camera_writes_are_refused(frame):
    with pytest.raises(ImageMessageError, match=rf'\(SOF{frame - 0xC0}\) that is not read'):
        _jpeg(jpeg_file(4, 4, frame=frame))


def test_size_that_is_told_behind_the_pixels_is_refused():
    """A height of 0 says that a DNL segment will tell it."""
    line_count = jpeg_segment(0xDC, struct.pack('>H', 65500))
    with pytest.raises(ImageMessageError, match='claims 8 x 0 pixels'):
        _jpeg(jpeg_file(8, 0)[:-2] + line_count + b'\xff\xd9')


@pytest.mark.parametrize('scans', [4, 11, 300])
def test_scans_are_counted(scans):
    assert _jpeg(scans_jpeg(64, 64, scans)).scans == scans
    assert _jpeg(scans_jpeg(64, 64, scans, full=scans)).scans == scans


def test_restarts_and_stuffed_bytes_are_no_scans():
    noise = np.random.default_rng(0).integers(0, 256, (64, 64), np.uint8)
    data = _encoded('.jpg', noise, cv2.IMWRITE_JPEG_RST_INTERVAL, 1, cv2.IMWRITE_JPEG_QUALITY, 100)
    assert b'\xff\0' in data and b'\xff\xd7' in data
    assert _jpeg(data).scans == 1
    assert _jpeg(data + jpeg_file(9, 9)).width == 64


@given(st.binary(max_size=80), st.sampled_from([JPEG_START, PNG_START]))
def test_any_head_is_read_or_refused(data, start):
    try:
        file = (_png if start == PNG_START else _jpeg)(start + data)
    except ImageMessageError as error:
        assert 'expected' in str(error)
    else:
        assert file.width and file.height


@pytest.mark.parametrize('color, depth, pixel_bytes', [
    (0, 1, 1), (0, 16, 2), (2, 8, 3), (2, 16, 6), (3, 4, 3), (4, 8, 4), (4, 16, 8), (6, 8, 4),
    (6, 16, 8)])
@pytest.mark.parametrize('interlace', [0, 1])
def test_memory_of_a_png_is_told(color, depth, pixel_bytes, interlace):
    file = _png(png_file(5, 6, color=color, depth=depth, interlace=interlace))
    assert (file.pixel_bytes, file.gray) == (pixel_bytes, color in (0, 4))


@pytest.mark.parametrize('changes, words', [
    ({'depth': 3}, 'color type 0, 3 bits'), ({'color': 3, 'depth': 16}, 'breaks the rules'),
    ({'color': 1}, 'color type 1'), ({'color': 2, 'depth': 4}, 'breaks the rules'),
    ({'interlace': 2}, 'interlace 2'), ({'width': 0}, 'claims 0 x 4'),
    ({'height': 65536}, 'claims 4 x 65536'), ({'width': 2 ** 31}, 'claims 2147483648'),
    ({'before': png_chunk(b'IHDR', bytes(13))}, 'one head'),
    ({'before': png_chunk(b'ABCD', b'')}, "chunk b'ABCD'"),
    ({'before': png_chunk(b'tEXt', b'')[:-4] + bytes(3)}, 'chunk|truncated'),
    ({'before': png_chunk(b'tEXt', b'') * 2 ** 16}, 'more than 65536 chunks'),
])
def test_png_that_breaks_the_rules_is_refused(changes, words):
    with pytest.raises(ImageMessageError, match=words):
        _png(png_file(**{'width': 4, 'height': 4, **changes}))


def test_png_without_a_head_or_with_a_short_one_is_refused():
    with pytest.raises(ImageMessageError, match='does not begin'):
        _png(PNG_START + png_chunk(b'IDAT', bytes(30)))
    with pytest.raises(ImageMessageError, match='does not tell its size'):
        _png(PNG_START + png_chunk(b'IHDR', bytes(12)) + png_chunk(b'IEND', b''))


@pytest.mark.parametrize('extra', [b'zTXt', b'iTXt', b'iCCP', b'acTL', b'fcTL', b'fdAT', b'tRNS'])
def test_only_the_first_image_of_a_png_goes_to_the_decoder(extra):
    data = noise_png(9, 7, color=0, depth=16, interlace=False)
    head = len(PNG_START) + 25
    longer = data[:head] + png_chunk(extra, bytes(50)) + data[head:] + data
    assert _png(longer).data == data

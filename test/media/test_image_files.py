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

"""Images come in the order of time, all pages of them, turned as their files say."""

from pathlib import Path
import pickle

import cv2
from hypothesis import given, strategies
import numpy as np
import pytest

from lmsco_ros.media.errors import MediaError, MediaWarning
from lmsco_ros.media.image_files import ImageFiles, natural_order

IMAGE = np.arange(24 * 32, dtype=np.uint8).reshape(24, 32)


def with_orientation(path, orientation):
    """Write `IMAGE` with an EXIF orientation."""
    entry = b'\x12\x01\x03\x00\x01\x00\x00\x00' + bytes([orientation, 0, 0, 0])
    tiff = b'II*\x00\x08\x00\x00\x00\x01\x00' + entry + bytes(4)
    exif = b'Exif\x00\x00' + tiff
    content = cv2.imencode('.jpg', IMAGE, [cv2.IMWRITE_JPEG_QUALITY, 100])[1].tobytes()
    segment = b'\xff\xe1' + (len(exif) + 2).to_bytes(2, 'big') + exif
    path.write_bytes(content[:2] + segment + content[2:])


def tiff_with_orientation(path, orientation, image):
    """Write an uncompressed gray TIFF of one strip by hand."""
    height, width = image.shape
    values = {256: width, 257: height, 258: 8 * image.itemsize, 259: 1, 262: 1, 273: 8,
              274: orientation, 277: 1, 278: height, 279: image.nbytes}
    head = b'II*\x00' + (8 + image.nbytes).to_bytes(4, 'little')
    entries = b''.join(tag.to_bytes(2, 'little') + b'\x04\x00\x01\x00\x00\x00'
                       + value.to_bytes(4, 'little') for tag, value in values.items())
    path.write_bytes(head + image.tobytes() + len(values).to_bytes(2, 'little') + entries
                     + bytes(4))


class TestOrder:
    @pytest.mark.parametrize('names', [
        ['1700000000_900000000.png', '1700000000_933333333.png', '1700000001_33333333.png'],
        ['1700000000.900000000.png', '1700000000.933333333.png', '1700000001.33333333.png'],
        ['frame0000_T10.1C.png', 'frame0001_T9.8C.png', 'frame0002_T10.1C.png'],
        ['9.png', '10.png', '11.png'], ['a9_2.png', 'a9_10.png', 'a10_1.png'],
        ['IMG_1.png', 'img_2.png', 'IMG_10.png'], ['x²1.png', 'x²2.png']])
    def test_numbers_are_compared_group_by_group(self, tmp_path, names):
        for name in reversed(names):
            cv2.imwrite(str(tmp_path / name), np.full((24, 32), names.index(name), np.uint8))
        assert [int(image.max()) for image in ImageFiles.in_folder(tmp_path)] \
            == list(range(len(names)))

    @given(strategies.lists(strategies.tuples(*[strategies.integers(0, 10**10)] * 2), unique=True),
           strategies.sampled_from('_.- '), strategies.booleans())
    def test_two_numbers_are_ordered_as_pairs(self, pairs, separator, padded):
        form = '{:011d}' if padded else '{}'
        names = {pair: f'{form}{separator}{form}.tif'.format(*pair) for pair in pairs}
        ordered = sorted(pairs, key=lambda pair: natural_order(Path(names[pair])))
        assert ordered == sorted(pairs)


class TestStack:
    @pytest.mark.parametrize('kind', [np.uint8, np.uint16, np.float32])
    def test_every_page_keeps_its_values(self, tmp_path, kind):
        pages = [IMAGE.astype(kind) * 20 + index for index in range(40)]
        cv2.imwritemulti(str(tmp_path / 'stack.tif'), pages)
        images = ImageFiles.in_folder(tmp_path)
        assert len(images) == 40
        for index in (*range(40), 3, 39, 0):
            assert images[index].dtype == kind
            np.testing.assert_array_equal(images[index], pages[index])

    def test_stacks_and_single_pages_follow_each_other(self, tmp_path):
        cv2.imwritemulti(str(tmp_path / 's2.tif'), [IMAGE + 2, IMAGE + 3])
        cv2.imwrite(str(tmp_path / 's10.tiff'), IMAGE + 4)
        cv2.imwritemulti(str(tmp_path / 's1.tif'), [IMAGE, IMAGE + 1])
        images = ImageFiles.in_folder(tmp_path)
        assert [image[0, 0] for image in images] == [0, 1, 2, 3, 4]

    def test_not_all_pages_are_held(self, tmp_path):
        cv2.imwritemulti(str(tmp_path / 's.tif'), [IMAGE] * 100)
        images = ImageFiles.in_folder(tmp_path)
        assert images[99].shape == IMAGE.shape and len(pickle.dumps(images)) < 8192
        assert sum(image is not None for image in pickle.loads(pickle.dumps(images))) == 100

    def test_float64_becomes_float32(self, tmp_path):
        cv2.imwrite(str(tmp_path / 'd.tif'), IMAGE + 0.5)
        image, = ImageFiles.in_folder(tmp_path)
        assert image.dtype == np.float32 and image[0, 3] == 3.5

    def test_cut_stack_is_told_and_its_pages_are_kept(self, tmp_path):
        path, random = tmp_path / 's.tif', np.random.default_rng(0)
        pages = [random.integers(0, 255, (64, 64)).astype(np.uint8) for _ in range(8)]
        cv2.imwritemulti(str(path), pages, [cv2.IMWRITE_TIFF_COMPRESSION, 1])
        path.write_bytes(path.read_bytes()[:20_000])
        with pytest.warns(MediaWarning, match=r's\.tif is cut off after 4 pages'):
            images = list(ImageFiles.in_folder(tmp_path))
        np.testing.assert_array_equal(images, pages[:4])


class TestOrientation:
    @pytest.mark.parametrize('orientation, quarters', [(1, 0), (3, 2), (6, 3), (8, 1)])
    def test_turned_as_the_file_says(self, tmp_path, orientation, quarters):
        with_orientation(tmp_path / 'a.jpg', orientation)
        plain = cv2.imdecode(cv2.imencode('.jpg', IMAGE, [cv2.IMWRITE_JPEG_QUALITY, 100])[1], -1)
        image, = ImageFiles.in_folder(tmp_path)
        np.testing.assert_array_equal(image, np.rot90(plain, quarters))

    @pytest.mark.parametrize('kind', [np.uint8, np.uint16])
    @pytest.mark.parametrize('orientation, quarters', [(1, 0), (3, 2), (6, 3), (8, 1)])
    def test_tiff_too(self, tmp_path, orientation, quarters, kind):
        stored = 9 * IMAGE.astype(kind)
        tiff_with_orientation(tmp_path / 'a.tif', orientation, stored)
        image, = ImageFiles.in_folder(tmp_path)
        np.testing.assert_array_equal(image, np.rot90(stored, quarters))


class TestOneForm:
    @pytest.mark.parametrize('other, words', [
        (('2.png', np.zeros((30, 32), np.uint8)), '32 x 30 pixels of uint8'),
        (('2.png', IMAGE.astype(np.uint16)), '32 x 24 pixels of uint16'),
        (('2.jpg', IMAGE), r'32 x 24 pixels of uint8 \(\.jpg\)'),
    ], ids=['size', 'depth', 'kind of file'])
    def test_the_first_that_differs_is_named(self, tmp_path, other, words):
        for name, image in (('0.png', IMAGE), ('1.png', IMAGE), other, ('3.png', IMAGE)):
            cv2.imwrite(str(tmp_path / name), image)
        images = ImageFiles.in_folder(tmp_path)
        assert images[1].shape == (24, 32)
        with pytest.raises(MediaError, match=rf'{other[0]} has {words}.*, but 1\.png has 32 x 24'):
            list(images)

    def test_two_endings_of_one_kind(self, tmp_path):
        cv2.imwrite(str(tmp_path / '1.jpg'), IMAGE)
        cv2.imwrite(str(tmp_path / '2.JPEG'), IMAGE)
        assert len(list(ImageFiles.in_folder(tmp_path))) == 2

    @pytest.mark.parametrize('name', ['1.png', '1.tif', '1.jpg'])
    @pytest.mark.parametrize('content', [b'', b'no image'])
    def test_unreadable_image_is_named(self, tmp_path, name, content):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(MediaError, match=f'{name} is not a readable image'):
            ImageFiles.in_folder(tmp_path)[0]

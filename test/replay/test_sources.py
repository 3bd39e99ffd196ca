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

"""Folders, videos and bags give the same kind of frames; what is broken is named."""

import av
import cv2
import numpy as np
import pytest

from lmsco_ros.media.errors import MediaWarning
from lmsco_ros.replay.errors import SourceError
from lmsco_ros.replay.sources import open_source


class TestFolder:
    def test_sixteen_bit_images_in_natural_order(self, folder, frames):
        source = open_source(folder, fps=25)
        read = list(source)
        assert len(source) == len(read) == 10
        for frame, original in zip(read, frames):
            np.testing.assert_array_equal(frame.image, original.image)
            assert frame.image.dtype == np.uint16
            assert (frame.index, frame.stamp_ns) == (original.index, original.stamp_ns)

    @pytest.mark.parametrize('suffix', ['png', 'tiff', 'bmp', 'jpg', 'JPG'])
    def test_formats(self, tmp_path, suffix):
        image = np.full((20, 30), 77, np.uint8)
        cv2.imwrite(str(tmp_path / f'0001.{suffix}'), image)
        frame, = open_source(tmp_path)
        assert frame.image.shape == (20, 30)
        assert np.abs(frame.image.astype(int) - 77).max() <= 2

    def test_other_files_do_not_disturb(self, folder):
        (folder / 'groundtruth.txt').write_text('1,2,3,4')
        assert len(open_source(folder)) == 10

    def test_one_color_image_does_not_change_the_kind(self, folder):
        flashy = np.zeros((48, 64, 3), np.uint8)
        flashy[..., 2] = np.arange(64)
        for index, image in enumerate((np.zeros((48, 64), np.uint8), flashy)):
            cv2.imwrite(str(folder / f'frame{index}.bmp'), image)
        for path in folder.glob('*.png'):
            path.unlink()
        assert [f.image.ndim for f in open_source(folder)] == [2, 2]

    def test_empty_folder(self, tmp_path):
        with pytest.raises(SourceError, match='has no images; give a folder'):
            open_source(tmp_path)

    def test_folder_of_a_folder_is_told(self, folder):
        with pytest.raises(SourceError, match=r'images has some: give .*images'):
            open_source(folder.parent)

    def test_damaged_image_is_named(self, folder):
        (folder / 'frame4.png').write_bytes(b'no image')
        with pytest.raises(SourceError, match=r'frame4\.png'):
            list(open_source(folder))

    def test_another_size_is_named(self, folder):
        cv2.imwrite(str(folder / 'frame7.png'), np.zeros((50, 64), np.uint16))
        with pytest.raises(SourceError, match=r'frame7\.png has 64 x 50 .* but frame1\.png'):
            list(open_source(folder))

    def test_stack_in_a_folder_gives_all_pages(self, tmp_path, frames):
        cv2.imwritemulti(str(tmp_path / 'stack.tif'), [frame.image for frame in frames])
        for source in (open_source(tmp_path), open_source(tmp_path / 'stack.tif')):
            read = list(source)
            assert len(source) == len(read) == 10
            for frame, original in zip(read, frames):
                np.testing.assert_array_equal(frame.image, original.image)

    def test_one_image_is_one_frame_and_says_so(self, folder, frames):
        with pytest.warns(MediaWarning, match=r'frame3\.png is one image; .* give the folder'):
            frame, = open_source(folder / 'frame3.png')
        np.testing.assert_array_equal(frame.image, frames[2].image)


class TestVideo:
    def test_gray_frames_and_their_rate(self, video):
        source = open_source(video)
        frames = list(source)
        assert len(source) == len(frames) == 12 and source.fps == pytest.approx(20)
        assert frames[3].stamp_ns == 150_000_000
        for frame in frames:
            assert frame.image.shape == (48, 64)
            assert np.median(frame.image) == pytest.approx(10 * frame.index + 50, abs=2)

    def test_wanted_rate_wins(self, video):
        source = open_source(video, fps=50)
        assert source.fps == 50
        assert [frame.stamp_ns for frame in source][:3] == [0, 20_000_000, 40_000_000]

    def test_sixteen_bits_at_the_times_of_the_container(self, tmp_path, frames):
        path, times = tmp_path / 'counts.mkv', (0, 1, 2, 3, 20, 40, 60, 80, 81, 82)
        with av.open(str(path), 'w') as container:
            stream = container.add_stream('ffv1', rate=20)
            stream.width, stream.height, stream.pix_fmt = 64, 48, 'gray16le'
            for frame, time in zip(frames, times):
                image = av.VideoFrame.from_ndarray(frame.image, 'gray16le')
                image.pts = time
                container.mux(stream.encode(image))
            container.mux(stream.encode(None))
        read = list(open_source(path))
        assert [frame.stamp_ns for frame in read] == [50_000_000 * time for time in times]
        for frame, original in zip(read, frames):
            np.testing.assert_array_equal(frame.image, original.image)

    def test_no_video(self, tmp_path):
        path = tmp_path / 'film.mp4'
        path.write_bytes(b'no film')
        with pytest.raises(SourceError, match='not a readable video'):
            open_source(path)

    def test_end_cut_off(self, tmp_path):
        path, random = tmp_path / 'cut.avi', np.random.default_rng(0)
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*'MJPG'), 20, (64, 48))
        for _ in range(40):
            writer.write(random.integers(0, 255, (48, 64, 3)).astype(np.uint8))
        writer.release()
        content = path.read_bytes()
        path.write_bytes(content[:len(content) * 2 // 3])
        with pytest.warns(MediaWarning, match=r'cut\.avi states 40 frames, of which 2\d are'):
            frames = list(open_source(path))
        assert 5 < len(frames) < 40
        assert [f.index for f in frames] == list(range(len(frames)))


def test_missing_source(tmp_path):
    with pytest.raises(SourceError, match='does not exist'):
        open_source(tmp_path / 'nothing')


def test_topic_of_something_else_than_a_bag(video):
    with pytest.raises(SourceError, match='is not a bag'):
        open_source(video, topic='image')

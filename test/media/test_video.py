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

"""A film gives every frame that can be decoded, with all its bits and its time."""

import pickle
import struct
import subprocess
import sys
import wave

import av
import cv2
import numpy as np
import pytest

from lmsco_ros.media.errors import MediaError, MediaWarning
from lmsco_ros.media.false_color import without_false_color
from lmsco_ros.media.video import VideoFile

# The matrices of mp4 that players turn a film by, clockwise.
TURNS = {90: (0, 1, -1, 0), 180: (-1, 0, 0, -1), 270: (0, -1, 1, 0)}


def by_opencv(path):
    """Return the frames as OpenCV decodes them."""
    capture, frames = cv2.VideoCapture(str(path)), []
    while (item := capture.read())[0]:
        frames.append(without_false_color(item[1]))
    return frames


def seconds(path):
    return [1e-9 * stamp for stamp, _ in VideoFile(path).timed()]


class TestPixels:
    @pytest.mark.parametrize('name, codec, pixels, divisor', [
        ('y.mkv', 'ffv1', 'gray16le', 1), ('y.avi', 'ffv1', 'gray16le', 1),
        ('y.mov', 'png', 'gray16be', 1), ('y.mkv', 'ffv1', 'gray10le', 8),
        ('y.mkv', 'ffv1', 'gray12le', 2), ('y.avi', 'jpegls', 'gray16le', 1)])
    def test_counts_are_kept(self, film, counts, name, codec, pixels, divisor):
        stored = [image // divisor for image in counts]
        path = film(name, stored, codec=codec, pixels=pixels, stored=pixels)
        images = list(VideoFile(path))
        assert len(images) == 12
        for image, original in zip(images, stored):
            assert image.dtype == np.uint16
            np.testing.assert_array_equal(image, original)

    @pytest.mark.parametrize('name, codec, pixels', [
        ('y.mkv', 'ffv1', 'yuv420p10le'), ('y.mkv', 'ffv1', 'yuv444p16le'),
        ('y.mov', 'v210', 'yuv422p10le'), ('y.mkv', 'ffv1', 'gbrp10le'),
        ('y.mkv', 'ffv1', 'rgb48le')])
    def test_of_deep_color_every_level_of_luminance_is_kept(self, film, levels, name, codec,
                                                            pixels):
        path = film(name, levels, codec=codec, pixels=pixels)
        for image, original in zip(VideoFile(path), levels):
            assert image.shape == original.shape and image.dtype == np.uint16
            # The same order of gray levels, and as many.
            pairs = set(zip(original.ravel().tolist(), image.ravel().tolist()))
            assert len(pairs) == len(np.unique(original)) == len(np.unique(image))
            assert [level for _, level in sorted(pairs)] == sorted(np.unique(image).tolist())

    @pytest.mark.parametrize('name, codec, pixels', [
        ('a.mp4', 'libx264', 'yuv420p'), ('a.avi', 'mpeg4', 'yuv420p'),
        ('a.avi', 'mjpeg', 'yuvj420p'), ('a.mov', 'qtrle', 'rgb24'),
        ('a.avi', 'rawvideo', 'bgr24'), ('a.mkv', 'ffv1', 'gray'), ('a.mkv', 'ffv1', 'yuv444p')])
    def test_of_8_bits_the_values_are_those_of_opencv(self, film, levels, name, codec, pixels):
        path = film(name, levels, codec=codec, pixels=pixels)
        reference = by_opencv(path)
        images = list(VideoFile(path))
        assert len(images) == len(reference) == 12
        for image, expected in zip(images, reference):
            assert image.ndim == 2
            np.testing.assert_array_equal(image, expected)

    def test_color_stays(self, film):
        image = np.zeros((48, 64, 3), np.uint8)
        image[:, 32:] = 10, 20, 200
        path = film('c.mkv', [image], pixels='bgr0', stored='bgr24')
        np.testing.assert_array_equal(next(iter(VideoFile(path))), image)

    @pytest.mark.parametrize('angle', TURNS)
    def test_turned_as_the_film_says(self, film, levels, angle):
        path = film('phone.mp4', levels, codec='libx264', pixels='yuv420p')
        content = bytearray(path.read_bytes())
        matrix = content.index(b'tkhd') + 44
        for place, value in zip((0, 1, 3, 4), TURNS[angle]):
            struct.pack_into('>i', content, matrix + 4 * place, value << 16)
        path.write_bytes(content)
        image = VideoFile(path)[3]
        assert image.shape == ((48, 64) if angle == 180 else (64, 48))
        np.testing.assert_array_equal(image, by_opencv(path)[3])


class TestTimes:
    def test_variable_rate(self, film, levels):
        times = [0, 1, 2, 3, 4, 17, 30, 43, 56, 69, 82, 95]
        for name, codec, pixels in (('v.mkv', 'ffv1', 'gray'), ('v.mp4', 'libx264', 'yuv420p')):
            path = film(name, levels, codec=codec, pixels=pixels, times=times)
            assert seconds(path) == pytest.approx([time / 25 for time in times], abs=6e-4)
            assert len(VideoFile(path)) == 12
            assert VideoFile(path).fps < 5

    @pytest.mark.parametrize('first', [-5, 125])
    def test_counted_from_the_first_frame(self, film, levels, first):
        path = film('f.mkv', levels, times=[first + index for index in range(12)])
        assert seconds(path) == pytest.approx([index / 25 for index in range(12)], abs=6e-4)

    @pytest.mark.parametrize('name, codec', [('b.mp4', 'libx264'), ('b.ts', 'libx264'),
                                             ('b.avi', 'mpeg4')])
    def test_frames_that_were_coded_out_of_order(self, film, levels, name, codec):
        path = film(name, levels, codec=codec, pixels='yuv420p', bf='2')
        means = [image.mean() for _, image in VideoFile(path).timed()]
        assert means == sorted(means) and len(means) == 12
        assert seconds(path) == pytest.approx([index / 25 for index in range(12)], abs=6e-4)

    def test_equal_times_stay_apart(self, film, levels):
        path = film('d.mkv', levels, times=[0, 1, 1, 2, 3, 4, 5, 6, 7, 8, 8, 9])
        with pytest.warns(MediaWarning, match='d.mkv: frames that are not later .*: 2'):
            stamps = [stamp for stamp, _ in VideoFile(path).timed()]
        assert np.diff(stamps).min() == 1 and len(stamps) == 12
        assert stamps[-1] == 9 * 40_000_000

    @pytest.mark.parametrize('name, codec', [('bare.h264', 'libx264'), ('bare.mjpeg', 'mjpeg')])
    def test_a_stream_without_times_says_so(self, film, levels, name, codec):
        pixels = 'yuv420p' if codec == 'libx264' else 'yuvj420p'
        path = film(name, levels, codec=codec, pixels=pixels)
        with pytest.warns(MediaWarning, match='have no time and follow at 25 frames/s: 12'):
            assert seconds(path) == pytest.approx([index / 25 for index in range(12)])

    def test_joined_films_go_on(self, film, levels):
        path = film('j.ts', levels, codec='libx264', pixels='yuv420p')
        path.write_bytes(2 * path.read_bytes())
        with pytest.warns(MediaWarning, match='start to count the time again'):
            times = seconds(path)
        assert len(times) == 24 and times[-1] > 0.8
        assert np.diff(times).min() > 0.01


class TestContainer:
    def test_sound_before_the_images(self, tmp_path):
        path = tmp_path / 'sound.mkv'
        with av.open(str(path), 'w') as container:
            sound = container.add_stream('pcm_s16le', rate=8000, layout='mono')
            images = container.add_stream('ffv1', rate=25)
            images.width, images.height, images.pix_fmt = 64, 48, 'gray'
            piece = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), layout='mono')
            piece.sample_rate = 8000
            container.mux(sound.encode(piece))
            for level in range(3):
                image = av.VideoFrame.from_ndarray(np.full((48, 64), level, np.uint8), 'gray')
                image.pts = level
                container.mux(images.encode(image))
            container.mux(images.encode(None))
        assert [image.max() for image in VideoFile(path)] == [0, 1, 2]

    def test_sound_alone(self, tmp_path):
        path = tmp_path / 'sound.wav'
        with wave.open(str(path), 'wb') as sound:
            sound.setparams((1, 2, 8000, 0, 'NONE', ''))
            sound.writeframes(bytes(8000))
        with pytest.raises(MediaError, match=r'sound\.wav is not a readable video.*holds audio'):
            VideoFile(path)

    @pytest.mark.parametrize('content, words', [
        (b'', 'the file is empty'), (b'no film', 'not a readable'), (b'1,2,3\n' * 99, 'readable')])
    def test_no_film(self, tmp_path, content, words):
        path = tmp_path / 'film.mp4'
        path.write_bytes(content)
        with pytest.raises(MediaError, match=f'film.mp4.*{words}'):
            VideoFile(path)

    def test_one_of_two_streams_is_told(self, tmp_path):
        path = tmp_path / 'two.mkv'
        with av.open(str(path), 'w') as container:
            streams = [container.add_stream('ffv1', rate=25) for _ in range(2)]
            for stream, width in zip(streams, (64, 96)):
                stream.width, stream.height, stream.pix_fmt = width, 48, 'gray'
            for stream, width in zip(streams, (64, 96)):
                frame = av.VideoFrame.from_ndarray(np.zeros((48, width), np.uint8), 'gray')
                frame.pts = 0
                container.mux(stream.encode(frame))
                container.mux(stream.encode(None))
        with pytest.warns(MediaWarning, match='two.mkv holds 2 streams of images'):
            assert VideoFile(path)[0].shape == (48, 64)

    def test_size_that_changes_is_told(self, film):
        small = film('a.ts', [np.full((48, 64), 50, np.uint8)] * 5, codec='libx264',
                     pixels='yuv420p')
        large = film('b.ts', [np.full((64, 96), 50, np.uint8)] * 5, codec='libx264',
                     pixels='yuv420p')
        small.write_bytes(small.read_bytes() + large.read_bytes())
        with pytest.raises(MediaError, match='frame 5 of a.ts has 96 x 64 .*has 64 x 48'):
            list(VideoFile(small))

    def test_a_name_is_no_address(self, film, levels, monkeypatch):
        path = film('http:x.mkv', levels)
        monkeypatch.chdir(path.parent)
        assert len(VideoFile(path.relative_to(path.parent))) == 12


class TestDamage:
    @pytest.fixture
    def damaged(self, film, counts):
        path = film('m.avi', counts * 3, codec='png', pixels='gray16be', stored='gray16be')
        content = bytearray(path.read_bytes())
        start = content.index(b'IHDR', len(content) // 2)
        content[start:start + 20] = bytes(20)
        path.write_bytes(content)
        return path

    def test_damaged_middle_costs_only_itself(self, damaged, counts):
        with pytest.warns(MediaWarning, match=r'm\.avi is damaged; pieces left out: 1'):
            images = list(VideoFile(damaged))
        assert len(images) == 35
        np.testing.assert_array_equal(images[0], counts[0])
        np.testing.assert_array_equal(images[-1], counts[-1])

    def test_cut_end_is_told(self, film, counts):
        path = film('c.avi', counts * 3, pixels='gray16le', stored='gray16le')
        content = path.read_bytes()
        path.write_bytes(content[:len(content) // 2])
        with pytest.warns(MediaWarning, match=r'c\.avi states 36 frames, of which 1\d are there'):
            assert 15 < len(list(VideoFile(path))) < 20

    def test_cut_end_of_a_container_without_a_count(self, film, counts):
        path = film('c.mkv', counts * 3, pixels='gray16le', stored='gray16le')
        content = path.read_bytes()
        path.write_bytes(content[:len(content) // 2])
        with pytest.warns(MediaWarning, match=r'c\.mkv states 1\.44 s, of which 0\.\d+ s are'):
            video = VideoFile(path)
        assert len(list(video)) == len(video) == pytest.approx(18, abs=2)

    def test_index_behind_the_end(self, damaged):
        with pytest.raises(MediaError, match='m.avi ends before frame 35, although'):
            VideoFile(damaged)[35]

    def test_only_a_head(self, film, counts):
        path = film('h.mkv', counts, pixels='gray16le', stored='gray16le')
        path.write_bytes(path.read_bytes()[:800])
        with pytest.raises(MediaError, match='h.mkv (has no frames|is not a readable)'):
            VideoFile(path)


class TestIndex:
    def test_any_order(self, film, counts):
        video = VideoFile(film('y.mkv', counts, pixels='gray16le', stored='gray16le'))
        for index in (4, 7, 2, 2, 11, 0):
            np.testing.assert_array_equal(video[index], counts[index])
        with pytest.raises(IndexError):
            video[12]

    def test_copy_for_another_process_starts_again(self, film, counts):
        video = VideoFile(film('y.mkv', counts, pixels='gray16le', stored='gray16le'))
        assert video[5].max()
        copy = pickle.loads(pickle.dumps(video))
        np.testing.assert_array_equal(copy[0], counts[0])
        assert (len(copy), copy.fps, copy.signature) == (12, video.fps, video.signature)


def test_pyav_is_imported_only_for_a_film():
    code = ('import sys, lmsco_ros.replay.sources, lmsco_ros.visualization.overlay_video; '
            'sys.exit("av" in sys.modules)')
    assert subprocess.run([sys.executable, '-c', code]).returncode == 0

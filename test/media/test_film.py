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

"""A film plays where people look at films, and survives what happens to its writer."""

from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
import queue
import shutil
import subprocess
import sys
import threading
from urllib.parse import unquote, urlsplit

import av
import cv2
import numpy as np
import pytest

from lmsco_ros.media.film import FilmWriter

BROWSER = shutil.which('chromium') or shutil.which('chromium-browser') \
    or shutil.which('google-chrome')
PAGE = """<video id="film" src="film.mp4" muted></video><script>
const film = document.getElementById('film');
const tell = words => fetch('/told?' + encodeURIComponent(words));
film.onerror = () => tell('error ' + film.error.message);
film.onended = () => tell(`${film.videoWidth} x ${film.videoHeight}, ${film.duration} s`);
film.play().catch(error => tell('refused ' + error));
</script>"""
WRITER = """
import os, signal, sys
from pathlib import Path
import numpy as np
from lmsco_ros.media.film import FilmWriter
film = FilmWriter(Path(sys.argv[1]), 10)
for index in range(38):
    film.write(np.full((48, 64, 3), 5 * index, np.uint8))
os.kill(os.getpid(), signal.SIGKILL)
"""


def write(path, count=25, size=(64, 48), fps=25):
    """Write a gray film that gets brighter."""
    film = FilmWriter(path, fps)
    for index in range(count):
        film.write(np.full((size[1], size[0], 3), 5 * index + 20, np.uint8))
    film.close()
    return path


def opencv_frames(path):
    capture, frames = cv2.VideoCapture(str(path)), []
    while (item := capture.read())[0]:
        frames.append(item[1])
    return frames


def test_film_is_what_browsers_play(tmp_path):
    with av.open(str(write(tmp_path / 'film.mp4'))) as container:
        stream, = container.streams
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ('h264', 'yuv420p')
        assert (stream.frames, stream.average_rate) == (25, 25)


@pytest.mark.parametrize('fps', [1, 8.7, 29.97, 240])
def test_rate(tmp_path, fps):
    with av.open(str(write(tmp_path / 'film.mp4', fps=fps))) as container:
        assert float(container.streams.video[0].average_rate) == pytest.approx(fps, rel=1e-4)


def test_colors_are_those_that_were_written(tmp_path):
    color = np.full((48, 64, 3), (40, 200, 90), np.uint8)
    film = FilmWriter(tmp_path / 'film.mp4', 25)
    film.write(color)
    film.close()
    frame, = opencv_frames(tmp_path / 'film.mp4')
    np.testing.assert_allclose(frame.mean((0, 1)), (40, 200, 90), atol=4)


def test_odd_size_gets_one_more_row_and_column(tmp_path):
    frames = opencv_frames(write(tmp_path / 'film.mp4', 3, size=(65, 49)))
    assert [frame.shape for frame in frames] == [(50, 66, 3)] * 3


def test_nothing_is_made_without_a_frame(tmp_path):
    FilmWriter(tmp_path / 'film.mp4', 25).close()
    assert not (tmp_path / 'film.mp4').exists()


def test_of_a_killed_writer_the_film_remains(tmp_path):
    path = tmp_path / 'film.mp4'
    done = subprocess.run([sys.executable, '-c', WRITER, path], timeout=100)
    assert done.returncode == -9
    with av.open(str(path)) as container:
        levels = [frame.to_ndarray(format='gray').mean() for frame in container.decode(video=0)]
    # Of 38 frames at 10 a second those of the last, unfinished second are lost.
    assert len(levels) == len(opencv_frames(path)) == 30
    assert levels == sorted(levels)


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='needs /dev/full')
def test_full_disk_is_told_with_the_file(tmp_path):
    path = tmp_path / 'film.mp4'
    path.symlink_to('/dev/full')
    film = FilmWriter(path, 25)
    with pytest.raises(OSError, match=r'No space left on device.*film\.mp4'):
        for _ in range(100):
            film.write(np.zeros((48, 64, 3), np.uint8))
    film.close()


class _Site(SimpleHTTPRequestHandler):
    """Serve a folder and hand on what its page tells."""

    def __init__(self, told, *arguments, **options):
        self.told = told
        super().__init__(*arguments, **options)

    def do_GET(self):
        """Answer a request."""
        address = urlsplit(self.path)
        if address.path == '/told':
            self.told.put(unquote(address.query))
        super().do_GET()

    def log_message(self, *_):
        """Say nothing."""


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason='needs Chromium')
@pytest.mark.parametrize('is_killed', [False, True], ids=['finished', 'killed'])
def test_film_plays_in_a_browser(tmp_path, is_killed):
    (tmp_path / 'page.html').write_text(PAGE)
    if is_killed:
        subprocess.run([sys.executable, '-c', WRITER, tmp_path / 'film.mp4'], timeout=100)
    else:
        write(tmp_path / 'film.mp4', 30, fps=10)
    told = queue.Queue()
    with ThreadingHTTPServer(('127.0.0.1', 0), partial(
            _Site, told, directory=str(tmp_path))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser = subprocess.Popen(
            [BROWSER, '--headless', '--no-sandbox', '--disable-gpu',
             '--autoplay-policy=no-user-gesture-required', f'--user-data-dir={tmp_path / "user"}',
             f'http://127.0.0.1:{server.server_port}/page.html'],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            assert told.get(timeout=100).startswith('64 x 48, 3')
        finally:
            browser.terminate()
            browser.wait()
            server.shutdown()

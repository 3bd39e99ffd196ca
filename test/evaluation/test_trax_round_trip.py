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

"""A real TraX client talks to the server in a process of its own, with the real tracker."""

from __future__ import annotations

from contextlib import contextmanager
import os
from pathlib import Path
import subprocess
import sys

import cv2
import numpy as np
import pytest

from lmsco_ros.core import BoundingBox

trax = pytest.importorskip(
    'trax', reason="vot-trax is not installed; pip install 'lmsco_ros[vot]'")

REPOSITORY = Path(__file__).resolve().parents[2]
SIZE = (160, 120)
PATIENCE_SECONDS = 100.0


def scene(box, dtype=np.uint8):
    """Render a warm, textured target in `box` over a fixed background, shape (120, 160)."""
    random = np.random.default_rng(3)
    background = cv2.GaussianBlur(random.random(SIZE[::-1]), (0, 0), 4)
    image = (background - background.min()) / np.ptp(background) * 0.4
    x, y, width, height = box
    warm = cv2.resize(random.random((4, 4)), (width, height), interpolation=cv2.INTER_LINEAR)
    image[y:y + height, x:x + width] = 0.6 + 0.4 * warm
    return (image * np.iinfo(dtype).max).astype(dtype)


def launch(*arguments):
    """Start a server process."""
    return subprocess.Popen(
        [sys.executable, '-m', 'lmsco_ros.evaluation.trax', *arguments],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join([str(REPOSITORY), *sys.path])})


class Session:
    """A server process and the client that is connected to it."""

    def __init__(self, *arguments):
        from trax.client import Client
        self.process = launch(*arguments)
        self.client = Client(
            (self.process.stdin.fileno(), self.process.stdout.fileno()), log=lambda text: None)

    def start(self, resource, region):
        return self._box(self.client.initialize({'ir': resource}, [(region, {})], {}))

    def update(self, resource):
        return self._box(self.client.frame({'ir': resource}, {}, []))

    @staticmethod
    def _box(reply):
        (region, properties), = reply[0]
        return BoundingBox(*region.bounds()), properties

    def ended(self):
        """Return the exit status and the error output, once the process is gone."""
        _, errors = self.process.communicate(timeout=PATIENCE_SECONDS)
        return self.process.returncode, errors.decode()


@contextmanager
def session(*arguments):
    """Start a server and leave no process behind."""
    running = Session(*arguments)
    try:
        yield running
    finally:
        # A client that is destroyed writes to its pipes, so it says goodbye before they close.
        running.client.quit()
        running.process.kill()
        running.process.communicate()


def stored(folder, number, box, dtype=np.uint8):
    """Write a frame as png and return it as a TraX image."""
    path = folder / f'{number:08d}.png'
    cv2.imwrite(str(path), scene(box, dtype))
    return trax.FileImage.create(str(path))


def test_one_process_tracks_files_and_images_in_memory(tmp_path):
    deep, small = tmp_path / '16 bit', tmp_path / 'small'
    deep.mkdir()
    small.mkdir()
    with session('--preset', 'hcs') as running:
        corners = [(60.0, 50.0), (80.0, 50.0), (80.0, 66.0), (60.0, 66.0)]
        box, properties = running.start(
            stored(deep, 1, (60, 50, 20, 16), np.uint16), trax.Polygon.create(corners))
        assert box == BoundingBox(60, 50, 20, 16)
        assert properties.keys() == {'confidence', 'state'}
        assert properties['state'] == 'tracking' and float(properties['confidence']) > 0.7
        for number in range(2, 6):
            x = 58 + 2 * number
            box, properties = running.update(
                stored(deep, number, (x, 50, 20, 16), np.uint16))
            assert box.overlap(BoundingBox(x, 50, 20, 16)) > 0.6
            assert 0 <= float(properties['confidence']) <= 1

        running.start(stored(small, 1, (30, 30, 4, 3)), trax.Rectangle.create(30, 30, 4, 3))
        box, _ = running.update(trax.MemoryImage.create(scene((31, 30, 4, 3))))
        assert box.overlap(BoundingBox(31, 30, 4, 3)) > 0.2

        running.client.quit()
        assert running.ended() == (0, '')


def test_a_box_outside_of_the_image_ends_the_session_with_a_reason(tmp_path):
    with session('--preset', 'hcs') as running:
        with pytest.raises(trax.TraxException, match='terminated the session: .*box'):
            running.start(stored(tmp_path, 1, (60, 50, 20, 16)),
                          trax.Rectangle.create(500, 400, 20, 16))
        status, errors = running.ended()
        assert status == 1
        assert 'session ended' in errors and 'Traceback' not in errors


def test_settings_that_do_not_exist_end_the_session_with_a_reason(tmp_path):
    with session('--preset', 'no_such_preset') as running:
        with pytest.raises(trax.TraxException, match='no_such_preset'):
            running.start(stored(tmp_path, 1, (60, 50, 20, 16)),
                          trax.Rectangle.create(60, 50, 20, 16))
        assert running.ended()[0] == 1


def test_the_server_goes_when_its_client_is_gone():
    process = launch('--preset', 'hcs')
    _, errors = process.communicate(timeout=PATIENCE_SECONDS)
    assert process.returncode == 1
    assert b'session ended' in errors

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

"""Small datasets and a tracker of known behavior, for the tests of the evaluation."""

from pathlib import Path
import sys

import cv2
import numpy as np
import pytest

SIZE = (64, 48)
WALK_SIZE = (160, 120)

# A tracker that is right until it is told otherwise by what the image shows: pixel
# (0, 0) holds a command, the next four the true box.
SCRIPTED = """
import os
from pathlib import Path
import signal
import subprocess
import time

from lmsco_ros.core import BoundingBox, TrackState
from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.evaluation.trackers import Answer

TRACK, MISS, LOSE, RAISE, DIE, REFUSE, WAIT, END, MUMBLE, AXE = range(10)


class Scripted:
    in_process = True

    def initialize(self, image, box):
        if image[0, 0] == REFUSE:
            raise ValueError('refused to start')

    def update(self, image):
        command, x, y, width, height = image[0, :5].tolist()
        if command == RAISE:
            raise RuntimeError('stumbled')
        if command == DIE:
            os._exit(7)
        if command == END:
            os.kill(os.getpid(), signal.SIGTERM)
        if command == AXE:
            # What takes a whole worker of a cluster with it, such as too much memory.
            os.kill(os.getppid(), signal.SIGKILL)
            time.sleep(1000)
        if command == MUMBLE:
            return 'somewhere'
        if command == WAIT:
            wait(Path(os.environ['SCRIPTED_GATE']))
        if command == MISS:
            x, y = 50, 40
        state = TrackState.LOST if command == LOSE else TrackState.TRACKING
        return Answer(BoundingBox(x, y, width, height), 0.25 if command == MISS else 0.75, state)

    def close(self):
        pass


class Here:
    # Images that only one process sees.
    signature = 'here'

    def __init__(self, frames):
        self._frames, self._process = frames, os.getpid()

    def __len__(self):
        return len(self._frames)

    def __getitem__(self, index):
        if os.getpid() != self._process:
            raise SequenceError('there is no such file')
        return self._frames[index]


def wait(gate):
    # Say who waits, a helper with it, until somebody opens the gate.
    if not gate.exists():
        helper = subprocess.Popen(['sleep', '1000'])
        (gate.parent / f'waiting-{os.getpid()}-{helper.pid}').touch()
        while not gate.exists():
            time.sleep(0.01)
        helper.kill()
        helper.wait()
"""


def render(box, command=0):
    """Return an image that holds a command and the true box in its first pixels."""
    image = np.full((SIZE[1], SIZE[0]), 90, np.uint8)
    x, y, width, height = box
    image[y:y + height, x:x + width] = 200
    image[0, :5] = (command, *box)
    return image


def moving_boxes(frames):
    """Return boxes that move right by one pixel a frame and stay in the image."""
    return [(8 + index % 30, 12, 10, 8) for index in range(frames)]


def write_vot(folder, commands, boxes=None):
    """Write a VOT folder whose images carry `commands`, one a frame."""
    boxes = boxes or moving_boxes(len(commands))
    (folder / 'ir').mkdir(parents=True)
    for index, (box, command) in enumerate(zip(boxes, commands)):
        cv2.imwrite(str(folder / 'ir' / f'{index + 1:08d}.png'), render(box, command))
    rows = [','.join(map(str, box)) for box in boxes]
    (folder / 'groundtruth.txt').write_text('\n'.join(rows) + '\n', encoding='utf-8')
    return folder


@pytest.fixture
def vot_folder():
    """Return the function that writes a VOT folder."""
    return write_vot


class WalkingTarget:
    """Images that are drawn when asked for: a bright target that moves over a soft ground."""

    signature = 'memory'

    def __init__(self, boxes, dtype=np.uint8, channels=1):
        self.boxes, self.dtype, self.channels = boxes.copy(), dtype, channels

    def __len__(self):
        return len(self.boxes)

    def __getitem__(self, index):
        noise = np.random.default_rng(index).integers(-2, 3, WALK_SIZE[::-1])
        image = 60 + np.arange(WALK_SIZE[0]) // 8 + noise
        x, y, width, height = np.round(self.boxes[index]).astype(int)
        image[y:y + height, x:x + width] = 220
        image = image.astype(self.dtype)
        return image if self.channels == 1 else np.repeat(image[..., None], 3, axis=2)


def walk(frames=150, dtype=np.uint8, channels=1, name='walk'):
    """Return a target of 10 x 8 pixels that moves to the right and down."""
    from lmsco_ros.evaluation.datasets import TrackingSequence

    steps = np.arange(frames)
    boxes = np.stack([15 + 0.5 * steps, 40 + 0.2 * steps, np.full(frames, 10.),
                      np.full(frames, 8.)], axis=1)
    return TrackingSequence(name, 'group', WalkingTarget(boxes, dtype, channels), boxes)


def well_inside(image, box):
    """Return the pixels well within a box."""
    x, y, width, height = np.round(box).astype(int)
    return image[y + 1:y + height - 1, x + 1:x + width - 1]


@pytest.fixture(scope='session')
def sequence():
    """Return the function that makes a sequence in memory, drawn when asked for."""
    return walk


@pytest.fixture(scope='session')
def inside():
    """Return the function of an image and a box to the pixels well within the box."""
    return well_inside


@pytest.fixture
def scripted(tmp_path, monkeypatch):
    """Return the command-line name of the scripted tracker, importable in workers too."""
    folder = tmp_path / 'modules'
    folder.mkdir()
    (folder / 'scripted_tracker.py').write_text(SCRIPTED, encoding='utf-8')
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, 'scripted_tracker', raising=False)
    return 'python:scripted_tracker:Scripted'


def process_lives(process):
    """Return whether a process is there and more than an entry that nobody has read."""
    try:
        status = Path(f'/proc/{process}/stat').read_text(encoding='utf-8')
    except OSError:
        return False
    return status.rpartition(')')[2].split()[0] not in 'ZX'


@pytest.fixture(scope='session')
def is_alive():
    """Return the function that tells of the number of a process whether that is alive."""
    return process_lives


@pytest.fixture
def lmsco():
    """Return a function that runs the commands of evaluations."""
    import typer
    from typer.testing import CliRunner

    from lmsco_ros.cli import evaluate, results

    app = typer.Typer()
    evaluate.register(app)
    results.register(app)
    return lambda *words: CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture
def thermal_dev(test_data):
    """Return the folder of real sequences, or skip."""
    return test_data / 'thermal_dev'

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

"""NanoTrack on another grid: the way from the answers of its networks to boxes."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from lmsco_ros.core import BoundingBox
from lmsco_ros.evaluation.errors import TrackerError
from lmsco_ros.evaluation.report.conditions import command_line, conditions
from lmsco_ros.evaluation.run_file import EvaluationRun, SequenceInfo
from lmsco_ros.evaluation.session import build_trackers
from lmsco_ros.evaluation.trace import Trace
from lmsco_ros.evaluation.trackers import nanotrack, registry, resolve
from lmsco_ros.evaluation.trackers.nanotrack import answer_side, NanoSpec, NanoTracker
from lmsco_ros.evaluation.trackers.opencv_peer import OpenCVSpec

SIDE = 15


class Backbone:
    """Passes patches on as they are."""

    def setInput(self, blob):
        self.blob = blob

    def forward(self):
        return self.blob


class Head:
    """Answers in the middle of what is bright, with the size of what is in the template."""

    side = SIDE

    def __init__(self):
        self.inputs = {}

    def setInput(self, blob, name):
        self.inputs[name] = blob[0, 0]

    def forward(self, names):
        assert names == ['output1', 'output2']
        half = self.side // 2
        places = (np.arange(self.side) - half) * 16 + 127
        bright = np.argwhere(self.inputs['input2'] > 150)
        middle = bright.mean(axis=0) if bright.size else (127, 127)
        away = np.hypot(places[:, None] - middle[0], places[None, :] - middle[1])
        width, height = ((self.inputs['input1'] > 150).any(axis=axis).sum() for axis in (0, 1))
        classes = np.stack([0.3 * away, np.full_like(away, 4)])
        distances = np.broadcast_to(np.array([width, height, width, height])[:, None, None] / 2,
                                    (4, self.side, self.side))
        return classes[None], distances[None]


class Doubled(Head):
    """Says that everything is twice as large as it is."""

    def forward(self, names):
        classes, distances = super().forward(names)
        return classes, distances * 2


class Leftmost(Head):
    """Is sure of the places farthest to the left, and of no other."""

    def forward(self, names):
        classes, distances = super().forward(names)
        classes[:] = 0
        classes[0, 0] = 20
        classes[0, 1, :, 0] = 40
        return classes, distances


class Undecided(Head):
    """Takes all places for the same; keeps what it was given."""

    seen = {}

    def forward(self, names):
        self.seen.update(self.inputs)
        return np.zeros((1, 2, self.side, self.side)), np.full((1, 4, self.side, self.side), 30.)


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Return files that OpenCV reads as the two stand-ins."""
    monkeypatch.setattr(cv2.dnn, 'readNet',
                        lambda name: Head() if 'head' in name else Backbone())
    paths = tmp_path / 'backbone.onnx', tmp_path / 'head.onnx'
    for path in paths:
        path.write_bytes(path.name.encode())
    return paths


def scene(left, top, dtype=np.uint8, shape=(120, 160)):
    """Return a dark image with a bright box of 20 x 12 pixels."""
    image = np.full(shape, 20, dtype)
    image[max(top, 0):top + 12, max(left, 0):left + 20] = 220
    return image if dtype == np.uint8 else image * 3 + 28_000


@pytest.mark.parametrize('dtype', [np.uint8, np.uint16])
def test_the_box_follows_what_the_head_says(files, dtype):
    tracker = NanoTracker(*files)
    tracker.initialize(scene(60, 50, dtype), BoundingBox(60, 50, 20, 12))
    for step in range(1, 9):
        answer = tracker.update(scene(60 + 2 * step, 50 + step, dtype))
    # Between two places of the grid lie some five pixels of the image.
    assert answer.box.center == pytest.approx((86, 64), abs=5)
    assert answer.box.size == pytest.approx((20, 12), abs=2)
    assert answer.score > 0.5


@pytest.fixture
def tracker_with(files, monkeypatch):
    """Return a function that makes a tracker with another head."""
    def make(head):
        monkeypatch.setattr(cv2.dnn, 'readNet',
                            lambda name: head() if 'head' in name else Backbone())
        return NanoTracker(*files)
    return make


def test_the_size_follows_slowly(tracker_with):
    tracker = tracker_with(Doubled)
    tracker.initialize(scene(60, 50), BoundingBox(60, 50, 20, 12))
    first = tracker.update(scene(60, 50))
    assert 20 < first.box.width < 20 * (1 + nanotrack._RATE)
    for _ in range(60):
        last = tracker.update(scene(60, 50))
    assert last.box.width > first.box.width + 2


def test_the_box_stays_in_the_image_wherever_the_head_points(tracker_with):
    tracker = tracker_with(Leftmost)
    tracker.initialize(scene(60, 50), BoundingBox(60, 50, 20, 12))
    boxes = [tracker.update(scene(60, 50)).box for _ in range(9)]
    assert boxes[0].center[0] < 50 and boxes[-1].center[0] == 0
    assert boxes[-1].width >= 10 and boxes[-1].height >= 10


def test_of_equal_places_the_middle_is_taken(tracker_with):
    tracker = tracker_with(Undecided)
    tracker.initialize(scene(60, 50), BoundingBox(60, 50, 20, 12))
    assert tracker.update(scene(60, 50)).box.center == pytest.approx((70, 56))


def test_both_patches_have_one_scale(tracker_with):
    ramp = np.tile(np.arange(160, dtype=np.uint8), (120, 1))
    tracker = tracker_with(Undecided)
    tracker.initialize(ramp, BoundingBox(60, 50, 20, 12))
    tracker.update(ramp)
    # Context makes 36 x 28 pixels of the box, as an area a square of 31.75: 127 / 31.75 = 4.
    for name, pixels in (('input1', 127), ('input2', 255)):
        patch = Undecided.seen[name]
        assert patch.shape == (pixels, pixels)
        slope = (patch[pixels // 2, -2] - patch[pixels // 2, 1]) / (pixels - 3)
        assert slope == pytest.approx(1 / 4, abs=.01)
        # Half a pixel before the middle of the box, where its pixel 69.5 begins.
        assert patch[pixels // 2, pixels // 2] == pytest.approx(69, abs=.6)


def test_changes_of_size_and_shape_cost_score():
    sizes = np.array([[[20., 40, 40]], [[20., 40, 10]]])
    same, larger, flatter = nanotrack._penalties(sizes, np.array([20., 20]))[0]
    # Twice the size costs (2 - 1), four times the ratio 4 and a region of sqrt(65 * 35) / 40.
    assert same == pytest.approx(1)
    assert larger == pytest.approx(np.exp(-.138))
    assert flatter == pytest.approx(np.exp(-.138 * (4 * np.sqrt(65 * 35) / 40 - 1)))


def test_edges_are_seen_from_the_middle_of_the_patch():
    edges = nanotrack._edges(np.ones((4, SIDE, SIDE)))
    assert edges[:, 7, 7].tolist() == [-1, -1, 1, 1]
    assert edges[:, 0, 14].tolist() == [111, -113, 113, -111]


@pytest.mark.parametrize(('side', 'kind'), [(15, NanoSpec), (17, NanoSpec), (16, OpenCVSpec)])
def test_the_shape_of_the_answer_chooses(files, monkeypatch, side, kind):
    monkeypatch.setattr(Head, 'side', side)
    assert answer_side(*files) == side
    spec = resolve(f'nanotrack:{files[0]},{files[1]}')
    assert isinstance(spec, kind)
    assert spec.name == ('nanotrack' if side == 16 else 'nanotrack_v3')


def test_identity_follows_the_files(files):
    spec = resolve(f'nanotrack:{files[0]},{files[1]}')
    before = spec.identity
    files[1].write_bytes(b'other weights')
    assert spec.identity != before
    assert isinstance(spec.build(), NanoTracker)


def test_files_that_are_no_networks_are_told_in_one_line(tmp_path):
    paths = [tmp_path / 'backbone.onnx', tmp_path / 'head.onnx']
    for path in paths:
        path.write_bytes(b'no network')
    assert answer_side(*paths) is None
    with pytest.raises(TrackerError, match='cannot use the model files') as caught:
        resolve(f'nanotrack:{paths[0]},{paths[1]}').build()
    assert len(str(caught.value).splitlines()) == 1
    with pytest.raises(TrackerError, match="'nanotrack_v3': OpenCV cannot use the model files"):
        NanoSpec(*paths).build()


@pytest.mark.parametrize(('name', 'attribute'), [
    ('nanotrack', 'TrackerNano'), ('vittrack', 'TrackerVit')])
def test_a_class_that_this_opencv_lacks_is_told_in_one_line(monkeypatch, name, attribute):
    monkeypatch.delattr(cv2, attribute, raising=False)
    with pytest.raises(TrackerError, match=f"'{name}' is not in this OpenCV") as caught:
        resolve(name).build()
    assert len(str(caught.value).splitlines()) == 1


def test_conditions_say_how_images_were_stretched_and_files_are_given():
    info = SequenceInfo('a', 'group', (9, 9), np.ones((2, 4)), {})
    trace = Trace(np.ones((2, 4)), np.ones(2), np.zeros(2, bool), starts=(0,))
    run = EvaluationRun('ope', (info,), {
        name: (trace,) for name in ('default', 'nanotrack_v3', 'vittrack', 'csrt')})
    said = dict(conditions({'ope': run}))['images']
    assert said.startswith('for nanotrack_v3, vittrack, csrt, images of more than 8 bits are')
    assert '--tracker nanotrack:BACKBONE,NECKHEAD --tracker vittrack:NET' in command_line(run)
    alone = EvaluationRun('ope', (info,), {'default': (trace,)})
    assert 'images' not in dict(conditions({'ope': alone}))
    assert set(registry.EIGHT_BIT_NAMES) >= {'nanotrack', 'nanotrack_v3', 'vittrack', 'kcf'}


@pytest.fixture
def peers():
    """Return the folder of the peers' networks, or skip."""
    beside = Path(__file__).parents[3] / 'shared' / 'peers'
    folder = Path(os.environ.get('LMSCO_TEST_PEERS', beside))
    if not folder.is_dir():
        pytest.skip(f'no networks of peers in {folder}; set LMSCO_TEST_PEERS to their folder')
    return folder


@pytest.mark.parametrize(('names', 'called'), [
    (('nanotrack_v2/nanotrack_backbone_sim.onnx', 'nanotrack_v2/nanotrack_head_sim.onnx'),
     'nanotrack'),
    (('nanotrack_v3/nanotrack_backbone.onnx', 'nanotrack_v3/nanotrack_head.onnx'),
     'nanotrack_v3'),
    (('vittrack/object_tracking_vittrack_2023sep.onnx',), 'vittrack')])
def test_real_networks_follow_a_textured_box(peers, names, called):
    kind = called.partition('_')[0]
    (spec,) = build_trackers([f'{kind}:' + ','.join(str(peers / name) for name in names)])
    assert spec.name == called
    texture = np.random.default_rng(5).uniform(150, 255, (40, 30)).astype(np.uint8)
    ground = cv2.GaussianBlur(np.random.default_rng(6).uniform(0, 120, (240, 320)), (0, 0), 4)

    def view(shift):
        image = ground.astype(np.uint8)
        image[90:130, 120 + shift:150 + shift] = texture
        return image
    tracker = spec.build()
    tracker.initialize(view(0), BoundingBox(120, 90, 30, 40))
    for shift in range(1, 16):
        answer = tracker.update(view(shift))
    assert answer.box.overlap(BoundingBox(135, 90, 30, 40)) > 0.4

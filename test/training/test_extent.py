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

"""Training of the extent network: bodies, pairs, examples, and that a loss falls."""

import csv

import numpy as np
import pytest
import torch
import yaml

from lmsco_ros.core.extent.measurement import ExtentMeter
from lmsco_ros.core.imaging.gain import IntensityRange
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.networks.extent import ExtentNet
from lmsco_ros.core.types import BoundingBox
from lmsco_ros.core.weights.formats import read_arrays
from training.extent import train as training
from training.extent.bodies import draw, edges, PLANS, sample_bodies, transformed
from training.extent.examples import examples, patches
from training.extent.pairs import ClipPairs, Pairs, RenderedPairs, StillPairs
from training.extent.sequences import write_sequences
from training.extent.windows import (
    clip_windows, cut, read_windows, SIDE, still_windows, texture_windows, Windows, write_windows)

CPU = torch.device('cpu')


@pytest.fixture(autouse=True)
def seed():
    """Begin every test with the same numbers."""
    torch.manual_seed(3)


@pytest.fixture(scope='session')
def windows(tmp_path_factory, clip, still):
    """Return a file of windows of the made-up clip and still."""
    path = tmp_path_factory.mktemp('windows') / 'windows.npz'
    rng = np.random.default_rng(1)
    write_windows(path, {
        'clips': list(clip_windows([clip, clip], rng)),
        'held_out': list(clip_windows([clip], rng)),
        'stills': list(still_windows([still], rng)) * 4,
        'textures': list(texture_windows([still], rng)) * 3})
    return path


def test_edges_are_those_of_what_is_drawn():
    bodies = sample_bodies(60, CPU)
    seen = transformed(bodies, 0.4 * torch.randn(60), torch.exp(0.2 * torch.randn(60, 2)),
                       torch.rand(60) < 0.5)
    seen.radii[seen.heat < 0.4] = 0
    extent = edges(seen)
    scales = 90 / (extent[:, 2:] - extent[:, :2]).amax(dim=1)
    places = 64 - scales[:, None] * (extent[:, :2] + extent[:, 2:]) / 2
    cover, _ = draw(seen, places, scales, torch.full((60,), 0.3), 128)
    drawn = []
    for picture in cover:
        rows, columns = torch.where(picture > 0.5)
        drawn.append([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1])
    expected = extent * scales[:, None] + places.repeat(1, 2)
    assert (torch.tensor(drawn) - expected).abs().max() < 1.5


def test_every_plan_fits_into_its_parts():
    assert all(2 > len(plan[0]) - 5 >= 1 and len(plan) <= 8 for plan in PLANS.values())


def test_window_keeps_the_box_on_its_target(still):
    box = np.array(still.boxes[0].as_tuple())
    for scale in (1.0, 1.7):
        window = cut(still.image, box, (100, 75), scale, 0)
        x, y = np.meshgrid(np.arange(SIDE) + 0.5, np.arange(SIDE) + 0.5)
        weight = np.clip(window.image.astype(float) - 60, 0, None)
        middle = [(axis * weight).sum() / weight.sum() for axis in (x, y)]
        assert (window.box[:2] + window.box[2:]) / 2 == pytest.approx(middle, abs=0.6)
        assert (window.box[2:] - window.box[:2]) * scale == pytest.approx(box[2:])


def test_windows_are_read_as_they_were_written(windows, clip):
    read = read_windows(windows, 'clips')
    assert read.images.shape[1:] == (SIDE, SIDE) and read.images.dtype == torch.uint8
    assert set(read.groups.tolist()) == {0, 1}
    assert (read.bounds[:, 2:] > read.bounds[:, :2]).all()


def collections(path):
    """Return the sources of pairs over a file of windows."""
    read = {name: read_windows(path, name) for name in ('clips', 'stills', 'textures')}
    return {'rendered': RenderedPairs(read['textures']),
            'stills': StillPairs(read['stills'], read['textures']),
            'clips': ClipPairs(read['clips'])}


@pytest.mark.parametrize('name', ['rendered', 'stills', 'clips'])
def test_pairs_are_sound(windows, name):
    pairs = collections(windows)[name](24)
    assert pairs.images.shape == (24, 2, SIDE, SIDE) and pairs.images.isfinite().all()
    assert (pairs.boxes[..., 2:] > pairs.boxes[..., :2]).all()
    assert 0 < pairs.present.float().mean() < 1


def test_patches_are_those_that_the_tracker_cuts():
    rng = np.random.default_rng(2)
    image = np.kron(rng.normal(size=(32, 32)), np.ones((4, 4))).astype(np.float32)
    box = BoundingBox(70.0, 50.0, 30.0, 18.0)
    shown = []

    class Network(ExtentNet):
        def encode(self, patch):
            shown.append(patch)
            return torch.zeros(1, 64, 8, 8)

    ExtentMeter.marked(Network(), FrameView(image, IntensityRange(0.0, 1.0)), box)
    edge = torch.tensor([[[box.x, box.y, box.x + box.width, box.y + box.height]]])
    bounds = torch.tensor([[[0.0, 0.0, 128.0, 128.0]]])
    ours = patches(torch.from_numpy(image)[None, None], edge, bounds, 64, 3.0)[0, 0].numpy()
    assert np.abs(ours[1:] - shown[0][1:]).mean() < 0.01
    assert np.abs(ours[0] - shown[0][0]).mean() < 0.15


def made_pairs(count):
    """Return pairs of a bright rectangle that stays where it is."""
    images = torch.zeros(count, 2, SIDE, SIDE)
    images[:, :, 50:80, 40:90] = 1
    box = torch.tensor([40.0, 50.0, 90.0, 80.0]).expand(count, 2, 4)
    bounds = torch.tensor([0.0, 0.0, SIDE, SIDE]).expand(count, 2, 4)
    return Pairs(images, box, bounds, torch.ones(count, 2), torch.ones(count, dtype=torch.bool))


def test_labels_lie_on_the_edges_that_are_seen(monkeypatch):
    """Without margins, the label is the rectangle in the patch, cut by the border or not."""
    monkeypatch.setattr('training.extent.examples._with_margins', lambda pairs: pairs.boxes)
    batch = examples(made_pairs(64), 64, 3.0)
    pixels = 32 + 32 * batch.truth
    checked = 0
    for patch, edge, measurable in zip(batch.now, pixels, batch.measurable, strict=True):
        if not measurable or edge.min() < 1 or edge.max() > 63:
            continue
        inside = (patch[0] > 0.5) & (patch[2] > 0.5)
        rows, columns = torch.where(inside)
        seen = torch.tensor([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1])
        assert (seen - edge).abs().max() < 2.0
        checked += 1
    assert checked > 20


def test_expected_boxes_tell_little_of_the_truth():
    batch = examples(made_pairs(400), 64, 3.0)
    off = batch.edges[batch.measurable & batch.known].std(dim=0)
    assert (off > 0.05).all()
    assert 0.05 < (~batch.known).float().mean() < 0.3
    assert (batch.sides[~batch.known, 0] == 0).all()


def test_sides_of_a_mirrored_batch_change_places():
    from training.extent.examples import _flipped
    batch = examples(made_pairs(8), 64, 3.0)
    mirrored = _flipped(batch, True, True)
    assert torch.equal(mirrored.edges, -batch.edges[:, [2, 3, 0, 1]])
    assert torch.equal(_flipped(mirrored, True, True).now, batch.now)


def test_overlap_of_boxes():
    one = torch.tensor([[0.0, 0, 2, 2], [0, 0, 1, 1]])
    other = torch.tensor([[1.0, 0, 3, 2], [2, 2, 3, 3]])
    assert training.overlaps(one, other).tolist() == pytest.approx([1 / 3, 0])


def test_loss_is_least_at_the_truth_and_its_scale():
    batch = examples(made_pairs(16), 64, 3.0)

    class Answers(ExtentNet):
        def measure(self, reference, now, sides):
            edges = batch.edges + self.error * torch.tensor([1.0, -1, 1, -1])
            scale = torch.full_like(edges, float(np.log(self.scale)))
            presence = 20 * (2 * batch.present[:, None].float() - 1)
            return torch.cat([edges, scale, presence], dim=1)

    def loss(error, scale):
        network = Answers()
        network.error, network.scale = error, scale
        return float(training.ExtentObjective()(network, batch))

    assert loss(0.1, 0.1) < min(loss(0.1, 0.05), loss(0.1, 0.2), loss(0.2, 0.1))


def test_rendered_sequences_are_a_data_set(windows, tmp_path):
    from lmsco_ros.evaluation.datasets import scan_dataset
    write_sequences(read_windows(windows, 'textures'), tmp_path, 3, seed=4)
    sequences = scan_dataset(tmp_path).sequences
    assert [sequence.name for sequence in sequences] == ['crowd_02', 'entering_00', 'view_01']
    assert sequences[0].frames[0].dtype == np.uint16
    assert np.isfinite(sequences[2].ground_truth).all()


def run(windows, folder, monkeypatch, *arguments):
    """Train as the command line does and return the rows of log and report."""
    config = yaml.safe_load(training.CONFIG.read_text(encoding='utf-8'))
    config['extent']['validation'] = {'batches': 1, 'size': 24}
    path = folder / 'config.yaml'
    path.write_text(yaml.safe_dump(config), encoding='utf-8')
    monkeypatch.setattr(training, 'CONFIG', path)
    monkeypatch.setattr('sys.argv', ['train', '--windows', str(windows), '--output', str(folder),
                                     '--device', 'cpu', *arguments])
    training.main()
    tables = []
    for name in ('log', 'report'):
        with next(folder.glob(f'*_{name}.csv')).open(encoding='utf-8') as stream:
            tables.append(list(csv.DictReader(stream)))
    return tables


def test_training_writes_what_the_tracker_reads(windows, tmp_path, monkeypatch):
    log, report = run(windows, tmp_path, monkeypatch, '--minutes', '0.02', '--batch', '6',
                      '--without', 'clips')
    arrays = read_arrays(tmp_path / 'extent_without_clips.safetensors')
    assert {name: array.shape for name, array in arrays.items()} == ExtentNet.file_shapes()
    assert all(array.dtype == np.float16 for array in arrays.values())
    assert [row['source'] for row in report] == ['rendered', 'stills', 'clips']
    assert log[0]['step'] == '0'


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_some_minutes_lower_the_validation_loss(windows, tmp_path, monkeypatch):
    log, _ = run(windows, tmp_path, monkeypatch, '--minutes', '4', '--batch', '32')
    assert float(log[-1]['validation_loss']) < float(log[0]['validation_loss']) - 0.5
    assert float(log[-1]['validation_accuracy']) > float(log[0]['validation_accuracy']) + 0.02


def test_windows_are_chosen_by_index():
    whole = Windows(*(torch.arange(3)[:, None] for _ in range(5)))
    assert whole[torch.tensor([2, 0])].boxes.flatten().tolist() == [2, 0] and len(whole) == 3

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

"""The benchmarks measure what they say, and each of them runs."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import measurement, paper_cost, scaling, scenes, side_by_side, stage_profile
from benchmarks.profiling import amortized, FrameProfile, profile_track, REST
from benchmarks.stages import (
    CallRecorder, FORWARD, FOURIER, instrumented, StageClock, STAGES, TRAINING)
from lmsco_ros.core import TrackerConfig
from lmsco_ros.core.features.extractor import FeatureExtractor
from lmsco_ros.core.weights.store import load_backbone

CONFIGURATIONS = Path(measurement.__file__).with_name('configurations')


@pytest.fixture(scope='module')
def clip():
    """Return some frames with a moving target."""
    return scenes.moving_scene((320, 256), 30, 7)


@pytest.fixture(scope='module')
def profile(clip):
    """Return the profile of a track that trains in one of its frames."""
    return profile_track(TrackerConfig.preset('default'), clip)


@pytest.mark.parametrize('stage', STAGES, ids=lambda stage: stage.attribute)
def test_stages_are_functions_of_the_core(stage):
    """A stage whose function was renamed would silently count for the one around it."""
    owner, name = stage.place()
    assert callable(getattr(owner, name))


def test_stage_counts_its_own_time_only():
    """The outer function spends 5 seconds, 3 of them in two calls of the inner one."""
    now = [0.0]

    def spend(seconds):
        now[0] += seconds

    clock = StageClock(lambda: now[0])
    inner = clock.wrap(lambda *_: 'inner', spend)
    outer = clock.wrap(lambda *_: 'outer', lambda: (spend(2.0), inner(1.0), inner(2.0)))
    assert clock.spent(outer) == 5.0
    assert clock.seconds == {'inner': 3.0, 'outer': 2.0}


def test_instruments_leave_the_core_as_it_was():
    """What is put in the place of a function is taken away again."""
    before = FeatureExtractor._series
    with instrumented(StageClock(lambda: 0.0), CallRecorder()) as missing:
        assert FeatureExtractor._series is not before
    assert FeatureExtractor._series is before and not missing


def test_missing_stage_is_named(monkeypatch):
    """The rest is measured all the same."""
    odd = SimpleNamespace(name='odd', place=lambda: (_ for _ in ()).throw(LookupError('odd')))
    with instrumented(StageClock(lambda: 0.0), stages=(odd, *STAGES)) as missing:
        assert missing == ['odd']


def test_recorder_repeats_the_outermost_calls_of_a_kind():
    """Calls inside of recorded calls are part of them; the faster of two times counts."""
    made = []
    recorder = CallRecorder()
    inner = recorder.wrap(FOURIER, made.append)
    recorder.wrap(FOURIER, lambda value: inner(value + 1))(1)
    recorder.wrap('other', made.append)(7)
    times = iter([4.0, 3.0])

    def spent(call):
        call()
        return next(times)

    assert recorder.replay(FOURIER, spent) == 3.0
    assert made == [2, 7, 2, 2]


def test_profile_sees_stages_and_floor(profile):
    """The frame behind every other one trains; passes and transforms are there in all."""
    assert [frame.trained for frame in profile.frames] == [False, *2 * [False, True], False]
    for frame in profile.frames:
        assert sum(frame.stages.values()) == pytest.approx(frame.total)
        assert 0 < frame.floor[FORWARD] and 0 < frame.floor[FOURIER]
        assert any(name.startswith(FORWARD) for name in frame.stages)
        assert frame.stages[REST] >= 0
    assert all(len(shape) == 4 for shape in profile.inputs.values()) and profile.inputs


def test_average_is_weighted_by_how_often_a_frame_occurs():
    """Three frames of 1 (one hiccup of 100 between them) and one training frame of 5."""
    frames = [FrameProfile(total, {}, {}, trained) for total, trained in
              ((1.0, False), (100.0, False), (1.0, False), (5.0, True))]
    other, training, average = amortized(frames, lambda frame: frame.total)
    assert (other, training, average) == (1.0, 5.0, 2.0)


def test_turns_are_fair():
    """Everybody is first equally often, and each step is prepared and noted."""
    order = []

    def contestant(name):
        return SimpleNamespace(prepare=lambda: order.append(f'<{name}'),
                               step=lambda: order.append(name),
                               note=lambda: order.append(f'{name}>'))

    seconds = measurement.take_turns([contestant('a'), contestant('b')], 2)
    assert seconds.shape == (2, 2, 2) and (seconds[..., measurement.WALL] > 0).all()
    assert ''.join(order) == '<aaa><bbb>' + '<bbb><aaa>'


@pytest.mark.parametrize('value, text', [
    (0.01234, '0.012'), (0.5, '0.500'), (12.345, '12.3'), (1234.5, '1234'), (3, '3'),
    (float('nan'), '–'), ('name', 'name')])
def test_table_cells(value, text):
    """Numbers are rounded to what they are good for."""
    table = measurement.markdown_table(('a', 'b'), [('row', value)])
    assert table.splitlines()[-1] == f'| row | {text} |'


@pytest.mark.parametrize('side', [12, 40, 150])
def test_vehicle_fills_its_box(side):
    """The box is a square of the asked size, warm against its landscape, and it moves."""
    clip = scenes.moving_scene((640, 512), side, 3)
    np.testing.assert_allclose(clip.truth[:, 2:], side, rtol=1e-6)
    assert (clip.truth[1:, 0] > clip.truth[:-1, 0]).all()
    x, y, width, height = clip.truth[0].round().astype(int)
    inside = clip.frames[0][y:y + height, x:x + width]
    assert np.median(inside) > np.percentile(clip.frames[0], 95)
    assert [int(clip.endless(i)[0, 0]) for i in range(5)] == [
        int(clip.frames[i][0, 0]) for i in (0, 1, 2, 1, 0)]


def test_side_by_side_leaves_out_who_is_not_there(capsys):
    """The others are compared; the last of them takes the place of a missing reference."""
    side_by_side.main(['--frames', '5', '--tracker', 'default', '--tracker', 'nobody',
                       '--tracker', 'mil', '--reference', 'csrt'])
    printed = capsys.readouterr().out
    assert "Left out: there is no tracker 'nobody'" in printed
    assert 'csrt is not there to compare with; mil takes its place' in printed
    assert printed.count('\n| default | ') == printed.count('\n| mil | ') == 2


def test_side_by_side_takes_configuration_files(tmp_path, capsys):
    """A YAML file is a tracker like any other; a broken one is left out with the reason."""
    (tmp_path / 'good.yaml').write_text('preset: default\nsampling: {newton_steps: 0}\n')
    (tmp_path / 'bad.yaml').write_text('newton: 0\n')
    side_by_side.main(['--frames', '4', '--tracker', str(tmp_path / 'good.yaml'),
                       '--tracker', str(tmp_path / 'bad.yaml')])
    printed = capsys.readouterr().out
    assert f'| {tmp_path / "good.yaml"} | ' in printed
    assert f'Left out: {tmp_path / "bad.yaml"} cannot be built' in printed


def test_stage_profile_prints_both_tables(capsys):
    """Stages in the order of their cost, then the floor."""
    stage_profile.main(['--frames', '6', '--repetitions', '1'])
    printed = capsys.readouterr().out
    assert f'| {TRAINING} | 0.00 | ' in printed and '| **update / floor** | ' in printed
    assert 'Not measured' not in printed


def test_scaling_draws_each_curve(tmp_path, monkeypatch, capsys):
    """Two points, a ratio and a picture."""
    monkeypatch.setattr(scaling, 'MEMORIES', (1, 2))
    scaling.main(['--curve', 'memory', '--frames', '5', '--output', str(tmp_path)])
    assert '2 over 1: ' in capsys.readouterr().out
    assert (tmp_path / 'memory.png').read_bytes().startswith(b'\x89PNG')


def test_scaling_tells_what_a_further_target_costs(tmp_path, monkeypatch, capsys):
    """Every vehicle of the scene is followed, and they cost more than one."""
    monkeypatch.setattr(scaling, 'COUNTS', (1, 3))
    scaling.main(['--curve', 'targets', '--frames', '5', '--output', str(tmp_path)])
    printed = capsys.readouterr().out
    assert '| 3 | ' in printed and printed.count('100%') == 2
    assert 0 < float(printed.split('Each further target costs ')[1].split()[0]) < 2


def test_vehicles_are_where_their_boxes_are():
    """Further ones are other places, and as warm."""
    clip = scenes.moving_scene((640, 512), 40, 2, vehicles=5)
    assert len(clip.others) == 4 and clip.start not in clip.others
    for box in (clip.start, *clip.others):
        x, y, width, height = np.round(box.as_tuple()).astype(int)
        inside = clip.frames[0][y:y + height, x:x + width]
        assert np.median(inside) > np.percentile(clip.frames[0], 95)


@pytest.mark.parametrize('name', ['vgg_m_2048', 'motion_cnn'])
def test_random_weights_are_those_of_the_network(name, tmp_path):
    """They load under the name, and a deep layer neither dies nor explodes."""
    import torch

    paper_cost.write_random_weights(name, tmp_path, np.random.default_rng(0))
    network = load_backbone(name, tmp_path)
    top = 1.0 if network.input_channels == 1 else 255.0
    images = top * torch.rand(1, network.input_channels, 96, 96)
    (deep,) = network(images, (network.layer_name('deep'),))
    assert 0.01 < float(deep.std()) < 1e4


def test_paper_cost_compares_with_the_bare_networks(capsys):
    """Both networks are seen, and a frame takes longer than their passes alone."""
    paper_cost.main(['--frames', '2'])
    printed = capsys.readouterr().out
    assert 'VGGM sees 10 x 1' in printed and 'MotionCNN sees 10 x 3' in printed
    assert float(printed.split('A frame takes ')[1].split()[0]) > 1


@pytest.mark.parametrize('name, changes', [
    ('ridge', {'loss': 'ridge'}), ('coupled', {'loss': 'coupled'})])
def test_configurations_of_losses_change_the_loss_alone(name, changes):
    """Whatever else differs would be compared with it."""
    default = TrackerConfig.preset('default')
    expected = replace(default, learning=replace(default.learning, **changes))
    assert TrackerConfig.from_yaml(CONFIGURATIONS / f'{name}.yaml') == expected != default

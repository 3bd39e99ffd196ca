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

"""Every key of the configuration changes a result: a small scene, or the part that it steers."""

from dataclasses import fields, is_dataclass
from functools import cache
import math
import typing
from typing import NamedTuple

import cv2
import numpy as np
import pytest
from safetensors.numpy import save_file
from threadpoolctl import threadpool_info

from lmsco_ros.core import BoundingBox, ConfigError, LMSCOTracker, TrackerConfig
from lmsco_ros.core.backend import limit_threads
from lmsco_ros.core.features.motion import MotionObserver
from lmsco_ros.core.imaging.gain import AutomaticGain
from lmsco_ros.core.presence.evidence import Evidence
from lmsco_ros.core.presence.monitor import PresenceMonitor
from lmsco_ros.core.presence.trust import MEASURED
from lmsco_ros.core.search.schedule import Schedule

VISIBLE = 2e-3
START, SIZE = (60.3, 64.4), (24.0, 18.0)
HOG = {'kind': 'hog'}
# Small and quick; nothing in it is left to chance or to a network.
BASE = {
    'features': [{'channels': [HOG, {'kind': 'intensity'}]}],
    'sampling': {'search_factor': 4.0, 'patch_size_min': 84, 'patch_size_max': 84},
    'learning': {'initial_iterations': 6, 'memory_size': 4},
    'extent': {'network': ''}, 'search': {'candidates': 1, 'tiles': 1}}


class Effect(NamedTuple):
    """
    A key, and how it shows.

    Attributes
    ----------
    key : str
        Path in the configuration; a channel's is `features.channels.` and its name.
    value : object
        The key's other value.
    measure : callable
        From a configuration to numbers, which that value changes.
    given : dict
        What else the configuration says, both times; laid over `BASE`.

    """

    key: str
    value: object
    measure: typing.Callable
    given: dict = {}


@pytest.fixture(scope='module')
def scene(make_scene):
    return make_scene((240, 160))


def walk(config, scene):
    """Return boxes and maps of a target that walks, grows and is seen in noise."""
    rng, tracker, told = np.random.default_rng(4), LMSCOTracker(config), []
    for n in range(7):
        zoom = 1.01**n
        clean = scene.render((START[0] + 1.7 * n, START[1] - n), (24 * zoom, 18 * zoom))
        image = np.round(clean + 5 * rng.normal(size=clean.shape)).astype(np.uint16)
        result = tracker.update(image) if n else tracker.initialize(
            image, BoundingBox.from_center(START, SIZE))
        told += [*result.box.as_tuple(), result.score, *result.search_region.as_tuple(),
                 *cv2.resize(result.confidence_map, (16, 16)).ravel()]
    return told


def move(config, scene):
    """Return boxes and maps of a target that moves before a ground that moves."""
    tracker, told = LMSCOTracker(config), []
    for n in range(5):
        image = scene.frame((START[0] + 1.9 * n, START[1]), SIZE, pan=(-1.3 * n, 0))
        result = tracker.update(image) if n else tracker.initialize(
            image, BoundingBox.from_center(START, SIZE))
        told += [*result.box.as_tuple(), *cv2.resize(result.confidence_map, (16, 16)).ravel()]
    return told


def beside_a_twin(config, scene):
    """Return scores and boxes while a target vanishes beside another one."""
    alone, empty = scene.render(START, SIZE), scene.render()
    twin = np.roll(alone - empty, (20, 50), axis=(0, 1))
    tracker, told = LMSCOTracker(config), []
    tracker.initialize(np.round(alone + twin).astype(np.uint16),
                       BoundingBox.from_center(START, SIZE))
    for n in range(8):
        ground = scene.render(START if n < 5 else None, SIZE, pan=(n / 10, 0))
        result = tracker.update(np.round(ground + twin).astype(np.uint16))
        told += [*result.box.as_tuple(), result.score]
    return told


def ranges(config, scene):
    """Return the working ranges over frames that get a little warmer, and then much."""
    gain = AutomaticGain(config.intensity)
    frame = scene.frame(START, SIZE).astype(np.float32)
    seen = [gain.observe(frame + warmer) for warmer in (0, 10, 20, 60, 60)]
    return [value for intensity in seen for value in (intensity.low, intensity.high)]


def side_of_patch(config, scene):
    """Return how many points the map of a small and of a large target has."""
    sides = []
    for size in (SIZE, (72, 50)):
        tracker = LMSCOTracker(config)
        box = BoundingBox.from_center((120, 80), size)
        sides.append(len(tracker.initialize(scene.frame(box.center, size), box).confidence_map))
    return sides


def flow(config, scene):
    """Return the flow images of a ground that moves by 1.3 pixels and a target that moves."""
    frames = [AutomaticGain(config.intensity).observe(image).normalize(image) for image in (
        scene.frame((START[0] + 3 * n, START[1]), SIZE, pan=(1.3 * n, 0)) for n in range(2))]
    motion, region = MotionObserver(config.motion), BoundingBox(0, 0, 100, 100)
    motion.remember(region, frames[0][:100, :100])
    images = motion.images(region, frames[1][:100, :100], (1.0,))
    return [0.0] if images is None else [1.0, *cv2.resize(images[0], (10, 10)).ravel()]


def scored(score, quality=1.0, likeness=0.5):
    """Return the hints of a score, whichever coefficients were fitted; usual are 20 and 4."""
    odds = math.log(score / (1 - score)) - (
        MEASURED.constant + MEASURED.quality * math.log(quality) + MEASURED.likeness * likeness
        + MEASURED.presence)
    return 20 * quality, likeness, 1, math.exp(odds / MEASURED.vagueness), 0


# Clear frames, sharper and sharper ones; fading, half back, missed, gone; then, for a moment each,
# what is not sharp, not alike, or not quite enough; at last the target.
STORY = [Evidence(*hints) for hints in (
    *3 * [(10, 1, 4, .06, 0)], *6 * [(20, 1, 4, .06, 0)], *3 * [(10, 1, 4, .06, 0)],
    scored(.45), scored(.3), scored(.55), scored(.2), (10, 1, 4, .06, 0),
    *4 * [(3, 0, 0, .2, 0)], (3, .3, -2, .15, 0), (2, .3, -2, .12, 0), *3 * [(1, 0, -5, .2, 0)],
    (5, 1.2, 8, .05, 2), (20, .28, 6, .05, 2), scored(.6, .45, .35), (14, 1, 4, .06, 2))]


def verdicts(config, scene):
    """Return what is judged of the frames of a story."""
    monitor, told = PresenceMonitor(config.presence), []
    for evidence in STORY:
        seen = monitor.assess(evidence)
        verdict = monitor.judge(seen)
        told += [verdict.score, 'lut'.find(verdict.state.value[0]), verdict.believed,
                 verdict.learns, monitor.convincing(seen)]
    return told


def searched(config, scene):
    """Return how much is searched in the frames after a target was seen."""
    schedule, told = Schedule(config.search), []
    for misses in range(4):
        salient = schedule.salient(misses)
        told += [salient.start, salient.stop, len(schedule.tiles((640, 512), 80, START, 1))]
    return told


def threads(config, scene):
    """Return how many threads the libraries use, and OpenCV."""
    try:
        LMSCOTracker(config)
        return [cv2.getNumThreads(), *(library['num_threads'] for library in threadpool_info())]
    finally:
        limit_threads(1)


SEARCH = {'scale': {'exponent_min': -1, 'exponent_max': 1}}
# Cells in which every network can be read.
LEARNED, MOTION = ({
    'features': [{'channels': [HOG]}, {'channels': [{'kind': kind, 'layer': 'deep'}], 'cell': 16}],
    'sampling': {'patch_size_min': 80, 'patch_size_max': 80}} for kind in ('appearance', 'motion'))

EFFECTS = (
    Effect('features.channels.kind', 'intensity', walk, {'features': [{'channels': [HOG]}]}),
    Effect('features.channels.weight', 3.0, walk),
    Effect('features.channels.power', 0.4, walk),
    Effect('features.channels.layer', 'shallow', move, LEARNED),
    Effect('features.cell', 6, walk),
    Effect('features.projection', 5, walk),
    Effect('intensity.low_percentile', 10.0, ranges),
    Effect('intensity.high_percentile', 90.0, ranges),
    Effect('intensity.smoothing', 0.5, ranges),
    Effect('intensity.jump', 0.9, ranges),
    Effect('sampling.search_factor', 5.0, walk),
    Effect('sampling.patch_size_min', 108, side_of_patch, {
        'sampling': {'patch_size_min': 60, 'patch_size_max': 140}}),
    Effect('sampling.patch_size_max', 180, side_of_patch),
    Effect('sampling.newton_steps', 0, walk),
    Effect('networks.appearance_backbone', 'vgg_m_2048', move, LEARNED),
    Effect('networks.motion_backbone', 'motion_cnn', move, MOTION),
    Effect('motion.remove_camera_motion', False, flow),
    Effect('motion.least_motion', 50.0, flow),
    Effect('learning.loss', 'ridge', walk),
    Effect('learning.margin_weight', 0.01, walk),
    Effect('learning.label_sigma', 0.2, walk),
    Effect('learning.window_minimum', 0.05, walk),
    Effect('learning.window_edge', 0.3, walk),
    Effect('learning.window_sparsity', 0.5, walk),
    Effect('learning.memory_size', 1, walk),
    Effect('learning.learning_rate', 0.3, walk),
    Effect('learning.initial_iterations', 3, walk),
    Effect('learning.iterations', 5, walk),
    Effect('learning.gradient_steps', 4, walk),
    Effect('learning.update_interval', 3, walk),
    Effect('scale.step', 1.05, walk, SEARCH),
    Effect('scale.exponent_min', 0, walk, SEARCH),
    Effect('scale.exponent_max', 0, walk, SEARCH),
    Effect('scale.calibrated', False, walk, SEARCH),
    Effect('scale.rate', 1.0, walk, SEARCH),
    Effect('extent.network', 'extent', walk),
    Effect('presence.learn', 'always', verdicts),
    Effect('presence.reference_frames', 3, verdicts),
    Effect('presence.uncertain', 0.5, verdicts),
    Effect('presence.certain', 0.99, verdicts),
    Effect('presence.lost', 0.1, verdicts),
    Effect('presence.lost_frames', 2, verdicts),
    Effect('presence.found', 0.5, verdicts),
    Effect('presence.sharp', 0.2, verdicts),
    Effect('presence.alike', 0.2, verdicts),
    Effect('presence.distractors', False, beside_a_twin, {'search': {'candidates': 4}}),
    Effect('search.candidates', 3, searched),
    Effect('search.tiles', 3, searched),
    Effect('runtime.threads', 2, threads),
)
# Keys that are not a value of a section: where the weights lie, and what may be missing.
SHOWN_BELOW = {'networks.directory', 'runtime.device'}


def keys(kind=TrackerConfig, path=''):
    """Yield the path of every key of a configuration."""
    hints = typing.get_type_hints(kind)
    for field in fields(kind):
        hint, name = hints[field.name], f'{path}{field.name}'
        inner = typing.get_args(hint)[0] if typing.get_origin(hint) is tuple else hint
        if is_dataclass(inner):
            yield from keys(inner, f'{name}.')
        else:
            yield name


def merged(base, *changes):
    """Return nested values with others laid over them."""
    result = dict(base)
    for change in changes:
        for key, value in change.items():
            result[key] = merged(result.get(key, {}), value) if isinstance(value, dict) else value
    return result


def with_value(data, key, value):
    """Return the plain values of a configuration, a key of which has another value."""
    section, *path, name = key.split('.')
    owner = data[section]
    if section == 'features':
        # Of the last block; of its first channels where they are asked for.
        owner = owner[-1]['channels'][0] if path else owner[-1]
    assert owner[name] != value
    owner[name] = value
    return data


def test_no_key_is_without_an_effect():
    assert sorted([effect.key for effect in EFFECTS] + list(SHOWN_BELOW)) == sorted(keys())


@cache
def plain(measure, config, scene):
    """Return what is measured without a change, once for all keys."""
    return measure(config, scene)


@pytest.mark.parametrize('effect', EFFECTS, ids=lambda effect: effect.key)
def test_key_changes_a_result(effect, scene, random_weights):
    given = TrackerConfig.from_dict(merged(BASE, effect.given))
    before = plain(effect.measure, given, scene)
    changed = TrackerConfig.from_dict(with_value(given.to_dict(), effect.key, effect.value))
    after = effect.measure(changed, scene)
    difference = np.abs(np.subtract(before, after, dtype=float)).max()
    assert difference > VISIBLE, f'{effect.key} changes nothing by more than {difference}'


@pytest.mark.parametrize('measure', sorted(
    {effect.measure for effect in EFFECTS}, key=lambda measure: measure.__name__))
def test_nothing_else_changes_a_result(measure, scene, random_weights):
    config = TrackerConfig.from_dict(BASE)
    assert measure(config, scene) == measure(config, scene)


def test_networks_are_taken_from_their_folder(tmp_path, scene, random_arrays):
    from lmsco_ros.core.weights.registry import find_source
    architecture = find_source('thermal').architecture
    save_file(random_arrays(architecture), tmp_path / 'thermal.safetensors')
    given = {'features': [{'channels': [{'kind': 'appearance', 'layer': 'features'}]}]}
    bundled, own = (move(TrackerConfig.from_dict(merged(BASE, given, {
        'networks': {'directory': folder}})), scene) for folder in ('', str(tmp_path)))
    assert np.abs(np.subtract(bundled, own)).max() > VISIBLE


def test_device_is_the_one_asked_for():
    with pytest.raises(ConfigError, match="device 'abacus' is not available"):
        LMSCOTracker(TrackerConfig.from_dict({'runtime': {'device': 'abacus'}}))

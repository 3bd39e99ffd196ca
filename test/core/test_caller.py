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

"""What a caller may do to a tracker: reuse its memory, copy it, call it twice at once."""

import copy
import gc
import pickle
from threading import Event, Thread
import weakref

import numpy as np
import pytest

from lmsco_ros.core import (
    BoundingBox, BoxError, BusyError, ConfigError, ImageError, LMSCOTracker, TrackerConfig,
    TrackState)
from lmsco_ros.core.config import ChannelConfig, FeatureConfig, NetworkConfig
from lmsco_ros.core.track import Track

BOX = (28, 51, 24, 18)
FLOW = TrackerConfig(
    features=(FeatureConfig((ChannelConfig('appearance', layer='deep'),), 16),
              FeatureConfig((ChannelConfig('motion', layer='deep'),), 16)),
    networks=NetworkConfig('thermal', 'thermal_flow'))


@pytest.fixture(scope='module')
def scene(make_scene):
    return make_scene()


def frames(scene, count=10, convert=lambda image: image):
    """Return frames of a target that moves, with a closed shutter, and is hidden once."""
    centers = [(40 + n, 60 + 0.3 * n) for n in range(count)]
    images = [scene.frame(center) for center in centers]
    images[4] = images[3].copy()
    images[6] = scene.frame()
    return [convert(image) for image in images]


def as_8_bits(image):
    return np.clip((image.astype(int) - 6800) // 4, 0, 255).astype(np.uint8)


def as_color(image):
    return np.stack([as_8_bits(image), as_8_bits(image) // 2, as_8_bits(image)], axis=2)


def as_big_endian(image):
    return image.astype('>u2')


def as_masked(image):
    return np.ma.masked_greater(image.astype(np.float32), 7900)


CONVERSIONS = [as_8_bits, as_color, as_big_endian, as_masked, *(
    lambda image, dtype=dtype: image.astype(dtype)
    for dtype in (np.uint16, np.int16, np.int32, np.float32, np.float64))]


def follow(tracker, images):
    """Return the results; the first image is the start where there is no target."""
    images = iter(images)
    first = [] if tracker.initialized else [tracker.initialize(next(images), BOX)]
    return first + [tracker.update(image) for image in images]


def through_one_buffer(images):
    """Return the same array again and again, with each image in its turn."""
    buffer = np.empty_like(images[0])
    for image in images:
        buffer[...] = image
        if isinstance(buffer, np.ma.MaskedArray):
            buffer.mask = image.mask
        yield buffer


def assert_same(results, others):
    """Check that two trackers gave the same, bit for bit."""
    for result, other in zip(results, others, strict=True):
        assert (result.box, result.score, result.state) == (other.box, other.score, other.state)
        np.testing.assert_array_equal(result.confidence_map, other.confidence_map)


@pytest.mark.parametrize('size, convert', [
    *(((160, 128), convert) for convert in CONVERSIONS), ((320, 256), as_8_bits)])
def test_one_buffer_for_all_frames_is_as_good_as_fresh_ones(make_scene, size, convert):
    images = frames(make_scene(size), 16, convert)
    fresh = follow(LMSCOTracker(), images)
    assert_same(follow(LMSCOTracker(), through_one_buffer(images)), fresh)
    assert fresh[-1].state is TrackState.TRACKING
    assert fresh[-1].box.overlap(BoundingBox(43, 55.5, 24, 18)) > 0.7


@pytest.mark.parametrize('config', [TrackerConfig.preset('hcs'), FLOW], ids=['hcs', 'flow'])
def test_one_buffer_serves_every_kind_of_features(scene, config):
    images = frames(scene, 8)
    assert_same(follow(LMSCOTracker(config), through_one_buffer(images)),
                follow(LMSCOTracker(config), images))


@pytest.mark.parametrize('convert', CONVERSIONS)
def test_nothing_of_a_frame_is_kept(scene, convert):
    tracker, images = LMSCOTracker(), frames(scene, 8, convert)
    gc.disable()
    try:
        while images:
            follow(tracker, images[:1])
            kept = weakref.ref(images.pop(0))
            assert kept() is None
    finally:
        gc.enable()


@pytest.mark.parametrize('dtype', [np.int32, np.float64])
def test_other_types_give_what_float32_gives(scene, dtype):
    results = [follow(LMSCOTracker(), frames(scene, 8, lambda image: image.astype(kind)))
               for kind in (dtype, np.float32)]
    assert_same(*results)


def test_masked_pixels_do_not_count(scene):
    def burnt(image):
        image = image.astype(np.float32)
        image[2:9, 2:60] = 60000
        return image

    def masked(image):
        return np.ma.masked_greater(burnt(image), 50000)

    def without(image):
        return masked(image).filled(np.nan)
    assert_same(follow(LMSCOTracker(), frames(scene, 8, masked)),
                follow(LMSCOTracker(), frames(scene, 8, without)))


def test_frames_are_of_the_type_of_the_first(scene):
    tracker = LMSCOTracker()
    image, after = frames(scene, 8)[:2]
    tracker.initialize(image.astype(np.float64), BOX)
    with pytest.raises(ImageError, match=r'is \(128, 160\) float32, but .* float64; initialize'):
        tracker.update(after.astype(np.float32))
    for same in (after.astype('>f8'), after.astype(float)[:, :, None], np.ma.array(after, float)):
        assert tracker.update(same).state is TrackState.TRACKING


@pytest.mark.parametrize('give', [tuple, list, np.array, lambda box: np.array(box, np.float32)])
def test_box_may_be_four_numbers(scene, give):
    result = LMSCOTracker('hcs').initialize(scene.frame((40, 60)), give(BOX))
    assert result.box == BoundingBox(*BOX)
    assert all(type(number) is float for number in result.box.as_tuple())


@pytest.mark.parametrize('box', [
    (1, 2, 3), (1, 2, 3, 4, 5), '1234', b'1234', None, 7, {1: 2}, np.ones((1, 4)),
    np.ones((4, 1)), (1, 2, 3, None), (1, 2, 3, '4'), (1, 2, 3, 4j), (1, 2, 3, np.nan),
    (1, 2, 3, 10**400), np.ma.masked_equal([1, 2, 3, 4], 3)])
def test_what_is_no_box_is_refused(scene, box):
    tracker = LMSCOTracker('hcs')
    with pytest.raises(BoxError, match=r'expected a BoundingBox, or \(x, y, width, height\)'):
        tracker.initialize(scene.frame((40, 60)), box)
    assert not tracker.initialized


@pytest.mark.parametrize('numbers', [(1, 2, 3, None), ('1', 2, 3, 4), (1, 2, 3, 10**400)])
def test_box_of_other_than_numbers_is_refused(numbers):
    with pytest.raises(BoxError, match='give four finite numbers'):
        BoundingBox(*numbers)


def test_configuration_may_be_the_name_of_a_preset():
    assert LMSCOTracker('hcs').config == TrackerConfig.preset('hcs')
    assert LMSCOTracker('default').config == LMSCOTracker(None).config


@pytest.mark.parametrize('given, reason', [
    ('', 'unknown preset .*expected one of default'),
    ('tracker.yaml', 'unknown preset .*TrackerConfig.from_yaml reads a file'),
    ({'preset': 'hcs'}, r'is a dict; .*give TrackerConfig\.from_dict'),
    ({}, r'is a dict; .*give TrackerConfig\.from_dict'),
    (7, r'is a int; expected a TrackerConfig or the name of a preset')])
def test_what_is_no_configuration_is_refused_with_the_remedy(given, reason):
    with pytest.raises(ConfigError, match=reason):
        LMSCOTracker(given)


def test_path_is_refused_with_the_remedy(tmp_path):
    with pytest.raises(ConfigError, match=r'Path; .*give TrackerConfig\.from_yaml\(path\)'):
        LMSCOTracker(tmp_path / 'tracker.yaml')


@pytest.fixture
def busy(scene, monkeypatch):
    """Return a tracker that is at work in another thread until the test is over."""
    inside, done = Event(), Event()
    advance = Track.advance

    def wait(track, *frame):
        inside.set()
        done.wait(60)
        return advance(track, *frame)
    tracker = LMSCOTracker('hcs')
    tracker.initialize(scene.frame((40, 60)), BOX)
    monkeypatch.setattr(Track, 'advance', wait)
    results = []
    thread = Thread(target=lambda: results.append(tracker.update(scene.frame((41, 60)))))
    thread.start()
    inside.wait(60)
    monkeypatch.undo()
    yield tracker
    done.set()
    thread.join(60)
    assert results[0].state is TrackState.TRACKING
    # The target was kept, and the tracker can be used again.
    assert tracker.update(scene.frame((42, 60))).box.overlap(BoundingBox(30, 51, 24, 18)) > 0.8


@pytest.mark.parametrize('call', [
    lambda tracker, image: tracker.update(image),
    lambda tracker, image: tracker.initialize(image, BOX),
    lambda tracker, image: tracker.reset(),
    lambda tracker, image: copy.deepcopy(tracker),
    lambda tracker, image: pickle.dumps(tracker)],
    ids=['update', 'initialize', 'reset', 'copy', 'pickle'])
def test_second_call_at_once_is_refused(busy, scene, call):
    with pytest.raises(BusyError, match='one call at a time: wait .* The target is kept'):
        call(busy, scene.frame((41, 60)))


def pickled(tracker):
    return pickle.loads(pickle.dumps(tracker))


@pytest.mark.parametrize('config', ['default', 'hcs', FLOW], ids=['default', 'hcs', 'flow'])
@pytest.mark.parametrize('duplicate', [copy.deepcopy, copy.copy, pickled])
def test_copies_go_on_as_the_original_does(scene, config, duplicate):
    images = frames(scene, 12)
    original = LMSCOTracker(config)
    fresh = duplicate(original)
    follow(original, images[:3])
    started = duplicate(original)
    expected = follow(original, images[3:])
    # The copies come after it: what they shared with it would have changed.
    assert_same(follow(started, images[3:]), expected)
    assert_same(follow(fresh, images)[3:], expected)


def test_copy_keeps_its_threads_and_serves_other_threads(scene, monkeypatch):
    original = LMSCOTracker('hcs')
    counts = []
    monkeypatch.setattr('lmsco_ros.core.targets.limit_threads', counts.append)
    image = scene.frame((40, 60))
    assert pickled(original).initialize(image, BOX).box == BoundingBox(*BOX)
    assert counts == [original.config.runtime.threads]


def test_results_and_configurations_can_be_pickled(scene):
    result = LMSCOTracker('hcs').initialize(scene.frame((40, 60)), BOX)
    assert_same([pickled(result)], [result])
    for config in map(TrackerConfig.preset, TrackerConfig.preset_names()):
        assert pickled(config) == copy.deepcopy(config) == config

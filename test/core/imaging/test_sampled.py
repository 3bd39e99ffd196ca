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

"""Frozen frames, polarity, and pixels that are no picture, seen on a subset of pixels."""

import cv2
from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.config import IntensityConfig
from lmsco_ros.core.errors import ImageError
from lmsco_ros.core.imaging.gain import AutomaticGain, IntensityRange, survey
from lmsco_ros.core.imaging.pixels import measured, without_dead_pixels
from lmsco_ros.core.imaging.sampled import (
    credible_values, noise_deviation, percentiles, take_probe)
from lmsco_ros.core.imaging.scene_change import (
    same_picture, scene_pattern, SceneChange, SceneMonitor)

SHAPE = (120, 160)


def scene(seed=0, shape=SHAPE, low=7000.0, span=600.0, shift=0):
    """Return smooth counts with a little noise; `shift` pans by so many pixels."""
    rng = np.random.default_rng(seed)
    ground = cv2.GaussianBlur(rng.normal(size=(shape[0], shape[1] + 40)), (0, 0), 9)
    ground = (ground - ground.min()) / np.ptp(ground)
    noise = np.random.default_rng((seed, shift)).normal(0, 0.005, shape)
    return low + span * (ground[:, shift:shift + shape[1]] + noise)


def examined(gain, image):
    """Return the condition of a frame."""
    return gain.examine(survey(image, IntensityConfig()))


def observed(monitor, image, low, high):
    """Return what has changed in a frame of which every pixel is looked at."""
    return monitor.observe(scene_pattern(image, low, high))


def as_tuple(intensity):
    """Return both ends."""
    return intensity.low, intensity.high


@given(values=st.lists(st.integers(0, 65535), min_size=1, max_size=60),
       shares=st.lists(st.floats(0, 100), min_size=1, max_size=4))
def test_percentiles_are_those_of_numpy(values, shares):
    image = np.array(values, np.uint16)
    np.testing.assert_allclose(percentiles(image, tuple(shares)), np.percentile(image, shares),
                               atol=1e-6)


def test_probe_covers_the_frame_regularly():
    image = np.arange(512 * 640, dtype=np.float32).reshape(512, 640)
    probe = take_probe(image)
    assert 6000 < probe.size < 12000 and probe.flags.c_contiguous
    assert set(np.unique(np.diff(probe, axis=1))) == {6}
    assert take_probe(scene()).shape == (120, 160)
    assert take_probe(np.zeros((300, 400, 3), np.uint8)).ndim == 2


@pytest.mark.parametrize('dtype', [np.uint8, np.uint16, np.float32])
def test_only_the_same_bits_are_a_frozen_frame(dtype):
    first = take_probe(scene(low=20, span=200).astype(dtype))
    assert same_picture(first, first.copy())
    other = first.copy()
    other[60, 80] += 1
    assert not same_picture(first, other)
    assert not same_picture(first, first.astype(np.float64))
    assert not same_picture(first, first[:-1])


def test_frozen_frames_may_have_pixels_without_a_value_and_telemetry():
    first = scene().astype(np.float32)
    first[50, 50] = np.nan
    other = first.copy()
    other[0] += 1
    assert same_picture(first, other)
    other[50, 50] = 7000
    assert not same_picture(first, other)


@given(st.lists(st.tuples(st.integers(0, 39), st.booleans(), st.floats(0.3, 3),
                          st.floats(-3000, 3000)), min_size=1, max_size=8))
def test_polarity_follows_every_switch_under_motion_gain_and_offset(frames):
    tracker, before, place = SceneMonitor(), False, 0
    for index, (target, inverted, gain, offset) in enumerate(frames):
        inverted = inverted and index > 0
        place += int(np.clip(target - place, -3, 3))
        image = gain * scene(shift=place) + offset
        image = (-image if inverted else image).astype(np.float32)
        change = observed(tracker, image, *np.percentile(image, (1, 99)))
        assert change == SceneChange(switched=inverted != before)
        assert tracker.inverted == inverted
        before = inverted


def test_flat_frames_and_other_scenes_switch_nothing():
    tracker = SceneMonitor()
    assert observed(tracker, scene().astype(np.float32), 7000, 7600) == SceneChange()
    assert observed(tracker, np.full(SHAPE, 7000, np.float32), 7000, 7001) == SceneChange()
    for seed in range(1, 6):
        assert not observed(tracker, scene(seed).astype(np.float32), 7000, 7600).switched
    # The flat frame was not taken as the scene to compare with.
    observed(tracker, np.full(SHAPE, 7000, np.float32), 7000, 7001)
    assert observed(tracker, (14600 - scene(5)).astype(np.float32), 7000, 7600).switched


def test_range_of_another_view_is_adopted_at_once():
    gain = AutomaticGain(IntensityConfig(smoothing=0.01, jump=1.0))
    before = examined(gain, scene(0).astype(np.float32))
    after = examined(gain, scene(3, low=7100.0).astype(np.float32))
    alone = AutomaticGain(IntensityConfig()).observe(scene(3, low=7100.0).astype(np.float32))
    assert (before.cut, after.cut) == (False, True)
    assert after.intensity == alone


def test_cut_to_another_scene_is_seen_once():
    tracker = SceneMonitor()
    images = [scene(seed).astype(np.float32) for seed in (0, 0, 3, 3, 3)]
    changes = [observed(tracker, image, *np.percentile(image, (1, 99))) for image in images]
    assert [change.cut for change in changes] == [False, False, True, False, False]


@given(low_share=st.floats(0, 10), high_share=st.floats(90, 100))
def test_the_working_picture_does_not_notice_the_polarity(low_share, high_share):
    config = IntensityConfig(low_percentile=low_share, high_percentile=high_share)
    plain, other = AutomaticGain(config), AutomaticGain(config)
    for frame in range(6):
        image = scene(shift=frame).astype(np.float32)
        camera = 14600 - image if frame in (2, 3, 4) else image
        one, two = (gain.examine(survey(seen, config))
                    for gain, seen in ((plain, image), (other, camera)))
        assert two.inverted == (frame in (2, 3, 4)) and not one.inverted
        if frame < 2:
            np.testing.assert_allclose(as_tuple(one.intensity), as_tuple(two.intensity))
        np.testing.assert_allclose(two.intensity.normalize(camera),
                                   one.intensity.normalize(image), atol=0.03)


def test_a_turned_range_exchanges_warm_and_cold():
    counts = np.array([100, 150, 300], np.float32)
    straight = IntensityRange(100, 300)
    np.testing.assert_allclose(straight.turned().normalize(counts), [1, 0.75, 0])
    assert straight.turned().turned() == straight


def test_frozen_frames_are_reported():
    gain = AutomaticGain(IntensityConfig())
    images = [scene(shift=shift).astype(np.uint16) for shift in (0, 0, 1, 1, 2)]
    closed = [examined(gain, image).shutter_closed for image in images]
    assert closed == [False, True, False, True, False]


def test_a_frame_without_a_value_is_forgotten():
    gain = AutomaticGain(IntensityConfig())
    image = scene().astype(np.float32)
    before = examined(gain, image)
    with pytest.raises(ImageError):
        examined(gain, np.full(SHAPE, np.nan, np.float32))
    after = examined(gain, image)
    assert after.shutter_closed and not after.inverted
    assert as_tuple(after.intensity) == pytest.approx(as_tuple(before.intensity))


def dead(image, rng):
    """Return the image with 3 % dead pixels, two dead rows and columns."""
    count = round(0.015 * image.size)
    for value in (0, 65535):
        places = [rng.integers(0, length, count) for length in image.shape]
        image[tuple(places)] = value
        image[rng.integers(image.shape[0])] = value
        image[:, rng.integers(image.shape[1])] = value
    return image


def telemetry(image, rng):
    """Return the image with rows of noise at the top."""
    image[:6] = rng.integers(0, 65536, (6, image.shape[1]))
    return image


def last_row(image, rng):
    """Return the image with a row of noise at the bottom and a dead first column."""
    image[-1] = rng.integers(0, 65536, image.shape[1])
    image[:, 0] = 65535
    return image


@pytest.mark.parametrize('shape', [(60, 80), (120, 160), (256, 320), (513, 641)])
@pytest.mark.parametrize('damage', [dead, telemetry, last_row])
@pytest.mark.parametrize('dtype', [np.uint16, np.float32])
def test_pixels_that_are_no_picture_do_not_stretch_the_range(rng, shape, damage, dtype):
    image = scene(shape=shape).astype(dtype)
    clean = AutomaticGain(IntensityConfig()).observe(image)
    broken = AutomaticGain(IntensityConfig()).observe(damage(image.copy(), rng))
    assert as_tuple(broken) == pytest.approx(as_tuple(clean), abs=30)


@pytest.mark.parametrize('dtype', [np.uint8, np.uint16, np.float32])
def test_dead_pixels_become_the_median_around_them(rng, dtype):
    image = scene(low=20, span=150, shape=(40, 50)).astype(dtype)
    image[rng.integers(0, 40, 20), rng.integers(0, 50, 20)] = 255
    image[7], image[:, 31] = 0, 255
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(image, 1, 'edge'), (3, 3))
    median = np.median(windows, axis=(2, 3)).astype(dtype)
    far = np.abs(image.astype(float) - median) > 60
    expected = np.where(far, median, image)
    assert far.sum() > 80
    np.testing.assert_array_equal(without_dead_pixels(image, 60), expected)


@given(seed=st.integers(0, 2**32 - 1), height=st.integers(1, 6), width=st.integers(1, 6),
       levels=st.sampled_from([2, 12, 200]), spread=st.integers(0, 12))
def test_every_dead_pixel_is_filled_in_whatever_its_place(seed, height, width, levels, spread):
    rng = np.random.default_rng(seed)
    image = rng.integers(0, levels, (height, width)).astype(np.uint16)
    extended = np.pad(image, 1, mode='edge')
    around = np.lib.stride_tricks.sliding_window_view(extended, (3, 3)).reshape(*image.shape, 9)
    median = np.median(around, axis=-1)
    expected = np.where(np.abs(image - median) > spread, median, image)
    np.testing.assert_array_equal(without_dead_pixels(image, spread), expected)


def test_a_living_picture_stays_as_it_is():
    image = scene(shape=(40, 50)).astype(np.float32)
    image[10:13, 20:23] += 2000
    image[5, 5], image[30, 30] = np.nan, np.inf
    clean = without_dead_pixels(image, 600)
    changed = (clean != image) & np.isfinite(image)
    # The corners of a small target, no more.
    assert changed.sum() <= 4
    assert np.isnan(clean[5, 5]) and np.isinf(clean[30, 30])
    view = image[::2, ::2]
    assert without_dead_pixels(view, 1e6) is view


def test_a_warm_region_is_a_picture():
    image = scene(span=60).astype(np.uint16)
    image[80:100, 100:120] += 900
    observed = AutomaticGain(IntensityConfig()).observe(image)
    assert observed.high > 7800
    probe = take_probe(image)
    # Two corners stand out from both neighbors on a diagonal.
    assert credible_values(image, probe, 60).size >= probe.size - 2


def test_pixels_without_a_value_are_left_out():
    image = scene().astype(np.float32)
    image[20:30, 40:60] = np.nan
    values = credible_values(image, take_probe(image), 600)
    np.testing.assert_array_equal(values, image[np.isfinite(image)])


def test_rows_that_change_slowly_are_a_picture_however_wide_their_range():
    image = np.full(SHAPE, 7000.0, np.float32)
    # In the lowest row of the bar each pixel differs from the one below by 3000 on the mean.
    image[40:44] += np.linspace(0, 6000, SHAPE[1], dtype=np.float32)
    assert credible_values(image, take_probe(image), 600).size >= image.size - 2


def test_nothing_but_noise_is_still_a_range(rng):
    noise = rng.integers(0, 65536, SHAPE).astype(np.uint16)
    observed = AutomaticGain(IntensityConfig()).observe(noise)
    assert observed.low < 3000 and observed.high > 62000


def test_measured_pixels_stay_and_others_are_copied():
    image = scene().astype(np.float32)
    assert measured(image) is image
    image[3, 5], image[4, 6] = 1.01e12, -np.inf
    clean = measured(image)
    assert np.isnan(clean[[3, 4], [5, 6]]).all() and np.isfinite(clean).sum() == image.size - 2
    assert image[3, 5] == np.float32(1.01e12) and clean.dtype == np.float32
    counts = np.full((20, 20), 65535, np.uint16)
    assert measured(counts) is counts


@pytest.mark.parametrize('shape', [(60, 80), (240, 320), (512, 640), (4, 9000)])
@pytest.mark.parametrize('deviation', [0.5, 6.0])
def test_noise_is_measured_whatever_the_scene(shape, deviation):
    rng = np.random.default_rng(1)
    ramp = np.add.outer(3.0 * np.arange(shape[0]), 0.5 * np.arange(shape[1]))
    image = (ramp + deviation * rng.normal(size=shape)).astype(np.float32)
    image[:, shape[1] // 2:] += 500.0
    assert noise_deviation(image) == pytest.approx(deviation, rel=0.15)


def test_noise_of_nothing_is_none():
    assert noise_deviation(np.full((20, 20), np.nan, np.float32)) == 0.0
    assert noise_deviation(np.zeros((20, 2), np.uint8)) == 0.0
    assert noise_deviation(np.zeros((40, 50, 3), np.uint8)) == 0.0


def test_noise_is_told_in_the_working_range():
    image = np.random.default_rng(2).normal(1000, 10, (200, 200)).astype(np.float32)
    gain = AutomaticGain(IntensityConfig())
    condition = gain.examine(survey(image, IntensityConfig()))
    # Of the 1st to the 99th percentile: 4.65 deviations.
    assert condition.noise == pytest.approx(1 / 4.65, rel=0.1)

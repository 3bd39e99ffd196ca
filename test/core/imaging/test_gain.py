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

"""The working range of raw counts."""

from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.config import IntensityConfig
from lmsco_ros.core.errors import ImageError
from lmsco_ros.core.imaging.gain import AutomaticGain, IntensityRange
from lmsco_ros.core.imaging.pixels import to_gray

CONFIG = IntensityConfig(low_percentile=2, high_percentile=97, smoothing=0.25, jump=0.2)


def scene(low=7000, high=7600, shape=(60, 80)):
    """Return counts spread evenly over a range, in no order."""
    values = np.linspace(low, high, shape[0] * shape[1])
    return np.random.default_rng(1).permutation(values).reshape(shape).astype(np.float32)


def as_tuple(intensity):
    """Return both ends."""
    return intensity.low, intensity.high


def test_first_frame_sets_the_percentiles():
    image = scene()
    observed = AutomaticGain(CONFIG).observe(image)
    assert as_tuple(observed) == pytest.approx(tuple(np.percentile(image, (2, 97))))
    assert as_tuple(observed) == pytest.approx((7012, 7582), abs=0.5)


def test_large_frames_are_seen_through_a_part_of_their_pixels():
    observed = AutomaticGain(CONFIG).observe(scene(shape=(512, 640)))
    assert as_tuple(observed) == pytest.approx((7012, 7582), abs=10)


def test_normalization_maps_the_range_to_zero_and_one():
    counts = IntensityRange(100, 300).normalize(np.array([100, 200, 300, 400], np.float32))
    np.testing.assert_allclose(counts, [0, 0.5, 1, 1.5])
    assert counts.dtype == np.float32


def test_small_changes_are_smoothed():
    gain = AutomaticGain(CONFIG)
    first = gain.observe(scene())
    second = gain.observe(scene() + 40)  # below the jump of 0.2 * 570
    assert second.low - first.low == pytest.approx(10, abs=0.01)
    assert second.high - first.high == pytest.approx(10, abs=0.01)
    for _ in range(60):
        last = gain.observe(scene() + 40)
    assert last.low - first.low == pytest.approx(40, abs=0.01)


@pytest.mark.parametrize('change', [lambda i: i + 200, lambda i: 7000 + 1.5 * (i - 7000)])
def test_jumps_are_adopted_at_once(change):
    gain = AutomaticGain(CONFIG)
    gain.observe(scene())
    changed = change(scene())
    assert as_tuple(gain.observe(changed)) == pytest.approx(
        as_tuple(AutomaticGain(CONFIG).observe(changed)))


@given(factor=st.floats(0.05, 8), offset=st.floats(-6000, 6000),
       drift=st.lists(st.floats(-300, 300), min_size=1, max_size=6))
def test_constant_gain_and_offset_of_the_camera_change_nothing(factor, offset, drift):
    plain, other = AutomaticGain(CONFIG), AutomaticGain(CONFIG)
    base = scene().astype(np.float64)
    for change in drift:
        if abs(abs(change) - 0.2 * 570) < 5:
            continue
        one = plain.observe((base + change).astype(np.float32))
        two = other.observe((factor * (base + change) + offset).astype(np.float32))
        assert two.low == pytest.approx(factor * one.low + offset, abs=0.02 * max(1, factor))
        assert two.high == pytest.approx(factor * one.high + offset, abs=0.02 * max(1, factor))


@pytest.mark.parametrize('value', [0, 7000, 65535])
def test_constant_frame_has_a_range(value):
    observed = AutomaticGain(CONFIG).observe(np.full((40, 40), value, np.uint16))
    assert observed.low == value and observed.high > observed.low


def test_small_target_before_a_constant_background_is_seen():
    image = np.full((40, 40), 100, np.uint8)
    image[20:22, 20:22] = 180
    assert as_tuple(AutomaticGain(CONFIG).observe(image)) == (100, 180)


def test_dead_pixels_do_not_stretch_the_range():
    image = scene().astype(np.uint16)
    clean = AutomaticGain(CONFIG).observe(image)
    image[5, ::20], image[11, ::20] = 65535, 0
    broken = AutomaticGain(CONFIG).observe(image)
    assert as_tuple(broken) == pytest.approx(as_tuple(clean), abs=3)


def test_pixels_without_a_value_do_not_count():
    image = scene()
    image[:, :30], image[:, 30] = np.nan, np.inf
    observed = AutomaticGain(CONFIG).observe(image)
    assert as_tuple(observed) == pytest.approx(tuple(np.percentile(image[:, 31:], (2, 97))))


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('value', [0, 1e12, -1e12])
def test_narrowest_and_farthest_ranges_are_ranges(value):
    image = np.full((60, 80), value, np.float32)
    image[:, ::2] += np.float32(1e-38)
    assert np.isfinite(AutomaticGain(CONFIG).observe(image).normalize(image)).all()


def test_frame_without_a_value_is_an_error():
    with pytest.raises(ImageError, match='no finite pixel; expected'):
        AutomaticGain(CONFIG).observe(np.full((20, 20), np.nan, np.float32))


def test_failed_frame_leaves_the_range():
    gain = AutomaticGain(CONFIG)
    before = gain.observe(scene())
    with pytest.raises(ImageError):
        gain.observe(np.full((60, 80), np.nan, np.float32))
    assert as_tuple(gain.observe(scene())) == pytest.approx(as_tuple(before))


def test_gray_passes_through_and_color_is_weighted():
    gray = np.arange(20, dtype=np.uint16).reshape(4, 5)
    assert to_gray(gray) is gray
    color = np.zeros((4, 5, 3), np.uint8)
    color[..., 2] = 200
    np.testing.assert_allclose(to_gray(color), 0.299 * 200, atol=0.6)

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

"""Each challenge does to images and true boxes what it says, the same every time."""

import pickle

import cv2
from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.evaluation.challenges import apply_challenge, challenge_names, CHALLENGES
from lmsco_ros.evaluation.challenges.intensities import Span, stored
from lmsco_ros.evaluation.challenges.regions import with_copy, without_region
from lmsco_ros.evaluation.errors import DatasetError, SequenceError
from lmsco_ros.evaluation.geometry import is_absent, overlaps

SIZE = (160, 120)
FRAMES = 150
TARGET = 220


@pytest.fixture(params=CHALLENGES)
def name(request):
    """Return the name of each challenge in turn."""
    return request.param


def test_frames_are_the_same_in_any_order_and_in_any_process(name, sequence):
    plain = sequence()
    made = apply_challenge(plain, name)
    other = pickle.loads(pickle.dumps(apply_challenge(sequence(), name)))
    assert made.name == f'walk+{name}' and made.challenge == name
    assert len(made.frames) == len(made) == len(made.ground_truth)
    forward = [made.frames[index] for index in range(0, len(made), 7)]
    backward = [other.frames[index] for index in reversed(range(0, len(made), 7))]
    for one, two in zip(forward, reversed(backward)):
        assert one.dtype == two.dtype and np.array_equal(one, two, equal_nan=one.dtype.kind == 'f')
    assert made.fingerprint == other.fingerprint
    with pytest.raises(IndexError):
        made.frames[len(made)]


def test_no_two_challenges_share_a_fingerprint(sequence):
    prints = {apply_challenge(sequence(), name).fingerprint for name in CHALLENGES}
    assert len(prints | {sequence().fingerprint}) == len(CHALLENGES) + 1


def test_a_fingerprint_knows_the_truth_that_is_hidden(sequence):
    made, other = sequence(), sequence()
    other.ground_truth[75] += 1
    one, two = (apply_challenge(item, 'disappear_1s') for item in (made, other))
    assert np.array_equal(one.ground_truth, two.ground_truth, equal_nan=True)
    assert one.fingerprint != two.fingerprint


@pytest.mark.parametrize(('dtype', 'channels'), [
    (np.uint8, 3), (np.uint16, 1), (np.float32, 1)])
def test_every_depth_is_taken_and_stays(name, dtype, channels, sequence):
    made = apply_challenge(sequence(dtype=dtype, channels=channels), name)
    image = made.frames[75]
    expected = {'nan': np.float32, 'sixteen_bit': np.uint16}.get(name, dtype)
    assert image.dtype == expected
    assert image.ndim == (2 if name in ('nan', 'sixteen_bit') or channels == 1 else 3)


@pytest.mark.parametrize(('which', 'count'), [('disappear_1s', 30), ('disappear_3s', 90)])
def test_the_target_disappears_and_is_back(which, count, sequence, inside):
    plain, made = sequence(), apply_challenge(sequence(), which)
    absent = np.flatnonzero(is_absent(made.ground_truth))
    assert absent.tolist() == list(range((150 - count) // 2, (150 + count) // 2))
    for index in range(0, FRAMES, 5):
        image = made.frames[index]
        if index in absent:
            assert np.abs(inside(image.astype(int), plain.ground_truth[index]) - 70).max() < 25
            assert image.max() < 100
        else:
            assert np.array_equal(image, plain.frames[index])


def test_filled_background_has_the_noise_around_it():
    rng = np.random.default_rng(5)
    image = rng.normal(7000, 12, (80, 80)).astype(np.float32)
    filled = without_region(image, np.array([30., 30, 20, 20]), rng)
    assert 6 < filled[30:50, 30:50].std() < 24
    assert np.array_equal(filled[:24], image[:24])


@given(corner=st.tuples(*[st.floats(-30, 190)] * 2), size=st.tuples(*[st.floats(2, 90)] * 2))
def test_regions_may_reach_over_the_border(corner, size, sequence):
    box = np.array([*corner, *size])
    image = sequence().frames[0]
    for made in (without_region(image, box, np.random.default_rng(1)),
                 with_copy(image, box, np.array([15., -9]))):
        assert made.shape == image.shape and made.dtype == image.dtype


def test_cut_makes_the_target_jump(sequence):
    plain, made = sequence(), apply_challenge(sequence(), 'cut')
    assert len(made) < FRAMES
    steps = np.linalg.norm(np.diff(made.ground_truth[:, :2], axis=0), axis=1)
    assert steps.argmax() == 49 and steps.max() > 20 and np.sort(steps)[-2] < 1
    assert np.array_equal(made.frames[50], plain.frames[FRAMES - len(made) + 50])
    still = sequence()
    still.ground_truth[:] = still.ground_truth[0]
    with pytest.raises(SequenceError, match='does not move by its own size'):
        apply_challenge(still, 'cut')


def test_twin_is_a_second_target_that_never_covers_the_first(sequence, inside):
    made = apply_challenge(sequence(), 'twin')
    assert np.array_equal(made.ground_truth, sequence().ground_truth)
    centers = []
    for index in range(0, FRAMES, 3):
        image = made.frames[index]
        truth = made.ground_truth[index]
        assert (inside(image, truth) == TARGET).all()
        _, _, stats, middles = cv2.connectedComponentsWithStats(
            (image > 180).astype(np.uint8))
        blobs = [(stat, middle) for stat, middle in zip(stats[1:], middles[1:])]
        assert len(blobs) == 2
        other = max((middle for _, middle in blobs),
                    key=lambda middle: np.linalg.norm(middle - truth[:2] - truth[2:] / 2))
        centers.append(other - truth[:2])
    # It moves on its own, and smoothly.
    steps = np.linalg.norm(np.diff(centers, axis=0), axis=1)
    assert np.ptp(centers, axis=0).min() > 5 and steps.max() < 8


def test_the_twin_remains_where_the_target_disappears(sequence):
    made, both = (apply_challenge(sequence(), which) for which in ('twin_remains', 'twin'))
    for index in (30, 60, 75, 89, 120):
        image, absent = made.frames[index], is_absent(made.ground_truth[[index]])[0]
        assert absent == (60 <= index < 90)
        count, _ = cv2.connectedComponents((image > 180).astype(np.uint8))
        assert count - 1 == (1 if absent else 2)
        assert absent or np.array_equal(image, both.frames[index])


def test_leaving_shows_the_target_where_the_truth_says_and_nowhere_else(sequence, inside):
    made = apply_challenge(sequence(), 'leave')
    absent = is_absent(made.ground_truth)
    assert 30 <= absent.sum() < 70 and not absent[:40].any() and not absent[-40:].any()
    shapes = {made.frames[index].shape for index in range(0, FRAMES, 10)}
    assert len(shapes) == 1
    size = shapes.pop()[::-1]
    for index in range(0, FRAMES, 3):
        image, box = made.frames[index], made.ground_truth[index]
        if absent[index]:
            assert (image == TARGET).sum() < 0.25 * 80
        elif (box[:2] >= 0).all() and (box[:2] + box[2:] <= size).all():
            assert (inside(image, box) == TARGET).all()


@pytest.mark.parametrize('which', ['leave', 'leave_edge'])
def test_a_target_that_fills_the_image_cannot_leave_it(which, sequence):
    made = sequence()
    made.ground_truth[:] = 30, 20, 90, 80
    with pytest.raises(SequenceError, match='too large'):
        apply_challenge(made, which)


def test_shutter_repeats_a_frame_bit_for_bit(sequence, inside):
    made = apply_challenge(sequence(), 'shutter')
    same = [np.array_equal(made.frames[index], made.frames[index - 1])
            for index in range(1, FRAMES)]
    expected = [60 < index < 72 or 120 < index < 132 for index in range(1, FRAMES)]
    assert same == expected
    assert (inside(made.frames[70], made.ground_truth[70]) == TARGET).all()
    assert np.array_equal(made.ground_truth[72], sequence().ground_truth[72])


def test_gain_jumps_every_twenty_frames_only(sequence):
    plain, made = sequence(), apply_challenge(sequence(), 'gain_jump')
    # A line through counts of the plain image gives gain and offset of each frame.
    lines = np.array([np.polyfit(plain.frames[index].ravel().astype(float),
                                 made.frames[index].ravel().astype(float), 1)
                      for index in range(0, 100, 5)])
    np.testing.assert_allclose(lines[:4], [[1, 0]] * 4, atol=1e-6)
    for block in lines.reshape(5, 4, 2):
        np.testing.assert_allclose(block, block[:1].repeat(4, axis=0), rtol=0.05, atol=3)
    assert len(set(lines[::4, 0].round(2))) == 5


def test_polarity_switches_and_switches_back(sequence):
    plain, made = sequence(), apply_challenge(sequence(), 'polarity')
    for index in (0, 49, 50, 99, 100, 149):
        image = plain.frames[index]
        expected = 255 - image if 50 <= index < 100 else image
        assert np.array_equal(made.frames[index], expected)


def test_dead_pixels_stay_where_they_are(sequence):
    plain, made = sequence(), apply_challenge(sequence(), 'dead_pixels')
    changed = [made.frames[index] != plain.frames[index] for index in (0, 60, 149)]
    values = made.frames[0][changed[0]]
    assert set(values.tolist()) == {0, 255}
    assert (changed[0] == changed[1]).mean() > 0.999
    assert changed[0].all(axis=1).sum() == changed[0].all(axis=0).sum() == 2
    assert 0.02 < changed[0].mean() < 0.04


def test_telemetry_changes_the_first_rows_only(sequence):
    plain, made = sequence(dtype=np.uint16), apply_challenge(sequence(dtype=np.uint16),
                                                             'telemetry')
    one, two = made.frames[3], made.frames[4]
    assert np.array_equal(one[4:], plain.frames[3][4:])
    assert one[:4].std() > 15000 and not np.array_equal(one[:4], two[:4])


def test_spots_have_no_value(sequence):
    image = apply_challenge(sequence(), 'nan').frames[9]
    assert np.isnan(image).any() and np.isposinf(image).any() and np.isneginf(image).any()
    assert 0.9 < np.isfinite(image).mean() < 1


def test_text_runs_and_blinks(sequence):
    plain, made = sequence(), apply_challenge(sequence(), 'text')
    x, y = np.nanmean(plain.ground_truth[:, :2], axis=0).astype(int)

    def drawn(index):
        """Return which pixels were written over."""
        return made.frames[index] != plain.frames[index]
    assert 0.001 < drawn(0).mean() < 0.15
    around = (slice(y - 4, y + 12), slice(x, x + 18))
    assert drawn(20)[around].sum() > drawn(5)[around].sum() + 10
    assert np.array_equal(drawn(5)[around], drawn(35)[around])
    assert not np.array_equal(made.frames[0][:12] > 200, made.frames[8][:12] > 200)


def test_sixteen_bit_keeps_the_picture_in_few_counts_that_drift(sequence):
    plain, made = sequence(), apply_challenge(sequence(), 'sixteen_bit')
    offsets = []
    for index in range(0, FRAMES, 10):
        image, before = made.frames[index].astype(float), plain.frames[index].astype(float)
        assert 6700 < image.min() and image.max() < 7800
        offsets.append((image - 2 * before).mean())
        assert np.abs(image - 2 * before - offsets[-1]).max() < 2
    assert 200 < np.ptp(offsets) <= 501


@given(values=st.lists(st.floats(-1e5, 1e5), min_size=1),
       dtype=st.sampled_from([np.uint8, np.uint16, np.float32]))
def test_stored_values_are_rounded_and_cut(values, dtype):
    image = stored(np.array(values), dtype)
    assert image.dtype == dtype
    limits = (0, np.iinfo(dtype).max) if dtype != np.float32 else (-np.inf, np.inf)
    np.testing.assert_allclose(image, np.clip(values, *limits), atol=0.51)


def test_span_is_that_of_the_scene(sequence):
    assert Span.of(sequence()) == Span(0, 255)
    span = Span.of(sequence(dtype=np.uint16))
    assert 55 < span.low < 65 and 70 < span.high < 230


@pytest.mark.parametrize('which', ['disappear_1s', 'disappear_3s', 'leave', 'leave_edge', 'cut',
                                   'cut_other_view'])
def test_short_sequences_are_refused_with_the_reason(which, sequence):
    with pytest.raises(SequenceError, match='needs at least|does not move'):
        apply_challenge(sequence(40), which)


def test_a_target_that_is_away_anyway_cannot_be_taken_away(sequence):
    made = sequence()
    made.ground_truth[90] = np.nan
    with pytest.raises(SequenceError, match='absent in frame 59 or 90'):
        apply_challenge(made, 'disappear_1s')
    made.ground_truth[110] = np.nan
    with pytest.raises(SequenceError, match='absent in frame 110, in which'):
        apply_challenge(made, 'cut_other_view')


def test_absent_targets_stay_absent(name, sequence):
    plain = sequence()
    plain.ground_truth[30:34] = np.nan
    made = apply_challenge(plain, name)
    absent = is_absent(made.ground_truth)
    assert absent[30:34].all() and not absent[0]
    assert not absent[:30].any() or name.startswith('start_on')
    made.frames[31]


def test_names_are_chosen_once_or_all():
    assert challenge_names(['twin', 'cut', 'twin']) == ('twin', 'cut')
    assert challenge_names(['text', 'all'])[0] == 'text'
    assert set(challenge_names(['all'])) == set(CHALLENGES)
    with pytest.raises(DatasetError, match="no challenge 'fog'; known are disappear_1s"):
        challenge_names(['twin', 'fog'])


@pytest.mark.parametrize('folder', ['vot_tir/crowd', 'drone_ir/drone_048'])
def test_real_sequences_take_every_challenge(thermal_dev, folder):
    from lmsco_ros.evaluation.datasets import scan_dataset
    plain = scan_dataset(thermal_dev / folder).sequences[0].first(70)
    for which in set(CHALLENGES) - {'disappear_3s', 'leave', 'leave_edge', 'cut',
                                    'cut_other_view'}:
        made = apply_challenge(plain, which)
        truth = made.ground_truth[[10]]
        assert which.startswith('start_on') or overlaps(truth, plain.ground_truth[[10]])[0] == 1
        assert made.frames[35].shape[:2] == plain.frames[35].shape[:2]

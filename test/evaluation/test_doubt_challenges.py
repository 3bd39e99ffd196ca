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

"""Challenges of doubt: what changes at once, what is not there, and what looks the same."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from lmsco_ros.evaluation.challenges import apply_challenge
from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.evaluation.geometry import is_absent

SIZE = (160, 120)
FRAMES = 150
TARGET = 220


class Still:
    """Images that are all the same."""

    signature = 'still'

    def __init__(self, image, count):
        self.image, self.count = image, count

    def __len__(self):
        return self.count

    def __getitem__(self, index):
        return self.image


def test_a_target_that_leaves_over_the_edge_stays_close_behind_it(sequence, inside):
    plain, made = sequence(), apply_challenge(sequence(), 'leave_edge')
    absent = np.flatnonzero(is_absent(made.ground_truth))
    assert 45 <= len(absent) < 80 and np.all(np.diff(absent) == 1)
    size = made.frames[75].shape[::-1]
    gaps = []
    for index in range(0, FRAMES, 3):
        image, box = made.frames[index], made.ground_truth[index]
        if index in absent:
            # What is around the target in the whole image is in view, but for the target.
            assert (image == TARGET).sum() < 0.25 * 80
            corner = corner_of(image, plain.frames[index])
            x, y, width, height = plain.ground_truth[index]
            gaps.append(max(corner[0] - x - width, x - corner[0] - size[0],
                            corner[1] - y - height, y - corner[1] - size[1]))
        elif (box[:2] >= 0).all() and (box[:2] + box[2:] <= size).all():
            assert (inside(image, box) == TARGET).all()
    assert 3 < max(gaps) < 8


def corner_of(part, image):
    """Return the corner (x, y) of the place where a part is in an image."""
    found = cv2.matchTemplate(image, part, cv2.TM_SQDIFF)
    return np.unravel_index(found.argmin(), found.shape)[::-1]


def test_other_view_is_the_mirrored_one_in_which_the_target_comes_up_late(sequence, inside):
    plain, made = sequence(), apply_challenge(sequence(), 'cut_other_view')
    absent = np.flatnonzero(is_absent(made.ground_truth))
    assert absent.tolist() == list(range(50, 110))
    for index in (0, 49):
        assert np.array_equal(made.frames[index], plain.frames[index])
    for index in (50, 80, 109):
        mirrored = plain.frames[index][:, ::-1]
        assert made.frames[index].max() < 100
        assert (made.frames[index] == mirrored).mean() > 0.9
    for index in (110, 149):
        assert np.array_equal(made.frames[index], plain.frames[index][:, ::-1])
        assert (inside(made.frames[index], made.ground_truth[index]) == TARGET).all()


def test_crossing_twin_comes_from_afar_over_the_target_and_goes_on(sequence, inside):
    made = apply_challenge(sequence(), 'twin_crosses')
    assert np.array_equal(made.ground_truth, sequence().ground_truth)
    ways = []
    for index in range(45, 105, 3):
        image, truth = made.frames[index], made.ground_truth[index]
        assert (inside(image, truth) > 180).mean() > 0.6
        _, _, _, middles = cv2.connectedComponentsWithStats((image > 180).astype(np.uint8))
        others = middles[1:] - truth[:2] - truth[2:] / 2
        ways.append(max(others, key=np.linalg.norm))
    ways = np.array(ways)
    # Before and after, it is on opposite sides, and it goes straight.
    assert np.linalg.norm(ways[0]) > 20 and np.linalg.norm(ways[-1]) > 20
    assert ways[0] @ ways[-1] < -0.98 * np.linalg.norm(ways[0]) * np.linalg.norm(ways[-1])
    assert np.linalg.norm(ways, axis=1).min() < 4


def line(plain, made, index):
    """Return gain, offset and deviation of the noise between two images of a sequence."""
    before, after = (item.frames[index].ravel().astype(float) for item in (plain, made))
    gain, offset = np.polyfit(before, after, 1)
    return gain, offset, (after - gain * before - offset).std()


@pytest.mark.parametrize('which, gain, noisy, frames', [
    ('noise_step', 1.0, 6, range(50, 150)), ('contrast_step', 0.3, 1, range(50, 100)),
    ('stretch_step', 0.3, 6, range(50, 150))])
def test_contrast_and_noise_are_stepped_from_one_frame_to_the_next(
        which, gain, noisy, frames, sequence):
    plain, made = sequence(dtype=np.uint16), apply_challenge(sequence(dtype=np.uint16), which)
    for index in (0, 49, 50, 99, 100, 149):
        if index not in frames:
            assert np.array_equal(made.frames[index], plain.frames[index])
            continue
        found, offset, noise = line(plain, made, index)
        # The scene has noise of deviation 1.4, which shrinks with the contrast.
        assert found == pytest.approx(gain, abs=0.05)
        assert found * 70 + offset == pytest.approx(70, abs=2)
        assert np.hypot(noise, gain * 1.4) == pytest.approx(noisy * 1.5, rel=0.25)
        assert not np.array_equal(made.frames[index], made.frames[index - 1])


def test_noise_of_colored_images_is_gray(sequence):
    image = apply_challenge(sequence(channels=3), 'noise_step').frames[60]
    assert (image == image[..., :1]).all()


def test_images_without_noise_get_some(sequence):
    plain = sequence(dtype=np.float32)
    plain.frames.boxes[:] = np.nan_to_num(plain.frames.boxes)
    steps = [apply_challenge(item, 'noise_step').frames[60] - item.frames[60]
             for item in (plain, sequence())]
    assert all(0.02 < step.astype(float).std() for step in steps)


@pytest.mark.parametrize('which', ['start_on_background', 'start_on_noise'])
def test_a_start_on_nothing_has_a_box_in_the_first_frame_only(which, sequence):
    made = apply_challenge(sequence(), which)
    assert is_absent(made.ground_truth).tolist() == [False] + [True] * (FRAMES - 1)
    assert made.ground_truth[0, 2:].tolist() == [10, 8]
    with pytest.raises(SequenceError, match='needs at least 40'):
        apply_challenge(sequence(39), which)


def test_background_is_that_of_the_scene_away_from_the_target(sequence):
    for name in 'abcdef':
        plain = sequence(name=name)
        made = apply_challenge(plain, 'start_on_background')
        box, target = made.ground_truth[0], plain.ground_truth[0]
        assert (np.abs(box[:2] - target[:2]) >= [15, 12]).any()
        assert (box[:2] >= [5, 4]).all() and (box[:2] + box[2:] <= np.subtract(SIZE, [5, 4])).all()
        assert np.array_equal(made.frames[7], plain.frames[7])


def test_background_does_not_stand_out(sequence):
    plain = sequence()
    values = plain.frames[0].astype(float)
    rng = np.random.default_rng(3)
    # Most of the picture is full of edges; a quarter of it is even.
    values[:, :120] += 100 * (rng.uniform(size=(12, 12)).repeat(10, 0).repeat(10, 1) > 0.5)
    still = replace(plain, frames=Still(values, len(plain)))
    box = apply_challenge(still, 'start_on_background').ground_truth[0]
    x, y, width, height = np.round(box).astype(int)
    assert values[y - 4:y + height + 4, x - 5:x + width + 5].std() < 5


@pytest.mark.parametrize('paint, reason', [
    (lambda values: values * 0, 'no place away from the target that is not all the same'),
    (lambda values: values[:16, :19], 'too large for another place')])
def test_no_start_where_there_is_no_other_place(paint, reason, sequence):
    plain = sequence()
    still = replace(plain, frames=Still(paint(plain.frames[0]), len(plain)))
    with pytest.raises(SequenceError, match=reason):
        apply_challenge(still, 'start_on_background')


def test_noise_is_new_in_each_frame_and_has_the_counts_of_the_scene(sequence):
    plain, made = (make(sequence(dtype=np.uint16)) for make in (
        lambda item: item, lambda item: apply_challenge(item, 'start_on_noise')))
    assert np.array_equal(made.ground_truth[0], plain.ground_truth[0])
    one, two, first = (item.astype(float) for item in (
        made.frames[3], made.frames[4], plain.frames[0]))
    assert abs(np.corrcoef(one.ravel(), two.ravel())[0, 1]) < 0.03
    assert abs(np.corrcoef(one[:, 1:].ravel(), one[:, :-1].ravel())[0, 1]) < 0.03
    assert one.mean() == pytest.approx(first.mean(), rel=0.02)
    assert one.std() == pytest.approx(first.std(), rel=0.05)

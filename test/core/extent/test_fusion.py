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

"""What is fused of two extents, against the dense Kalman update and known cases."""

from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.extent.fusion import EdgeFilter
from lmsco_ros.core.extent.measurement import Measurement
from lmsco_ros.core.types import BoundingBox

IMAGE = (320, 240)
BOX = BoundingBox(100.0, 80.0, 40.0, 30.0)
lengths = st.floats(4, 100)
errors = st.floats(0.1, 30)


def measured(box, deviation):
    """Return a measurement of a box, all of whose edges are as sure."""
    edges = np.array([[box.x, box.x + box.width], [box.y, box.y + box.height]])
    return Measurement(edges, np.broadcast_to(np.asarray(deviation, float), (2, 2)), 5.0)


def run(first, seen, deviation, frames=40):
    """Return the box after some frames in which the same is measured."""
    fuse, box = EdgeFilter(first, IMAGE), first
    for _ in range(frames):
        box = fuse(box, measured(seen, deviation))
    return box, fuse


def test_fusion_is_the_dense_kalman_update():
    """Of the state (x0, x1, y0, y1), all at once, with the covariances written out."""
    fuse = EdgeFilter(BOX, IMAGE)
    deviations = np.array([[1.0, 2.0], [0.5, 3.0]])
    side = BOX.area**0.5
    drawn = (0.08 * side)**2 + 0.7**2
    blocks = []
    for _ in range(2):
        size = 2 * drawn + (0.05 * side)**2
        center = (0.2 * side)**2
        map_to_edges = np.array([[1, -0.5], [1, 0.5]])
        blocks.append(map_to_edges @ np.diag([center, size]) @ map_to_edges.T)
    prior = np.block([[blocks[0], np.zeros((2, 2))], [np.zeros((2, 2)), blocks[1]]])
    noise = np.diag(deviations.ravel()**2)
    expected = np.array([100.0, 140, 80, 110])
    difference = np.array([90.0, 150, 88, 124]) - expected
    convention = 0.3 + 12 * np.maximum(0, deviations.ravel()**2 - 2**2) / side
    # Along x the edges have moved apart, along y both of them down, by 8 at least.
    shared = np.array([0.0, 0, 8, 8])
    difference = difference - shared
    difference = shared + np.sign(difference) * np.maximum(0, abs(difference) - convention)
    gain = prior @ np.linalg.inv(prior + noise)
    right = expected + gain @ difference
    box = fuse(BOX, Measurement(np.array([[90.0, 150], [88, 124]]), deviations, 1.0))
    assert box.as_tuple() == pytest.approx(
        (right[0], right[2], right[1] - right[0], right[3] - right[2]))
    assert 60 > box.width > BOX.width and 90 > box.y > BOX.y
    posterior = prior - gain @ prior
    assert fuse._covariances[0] == pytest.approx(posterior[:2, :2])
    assert fuse._covariances[1] == pytest.approx(posterior[2:, 2:])


def test_sure_measurements_are_followed_at_once():
    larger = BoundingBox(80.0, 70.0, 90.0, 60.0)
    box, _ = run(BOX, larger, 0.3, frames=2)
    assert box.overlap(larger) > 0.97


def test_unsure_measurements_leave_the_size():
    box, _ = run(BoundingBox(100, 80, 12, 12), BoundingBox(98, 78, 16, 16), 5.0, frames=100)
    assert box.size == pytest.approx((12, 12))


def test_what_is_unclear_keeps_the_size():
    """Two that touch are measured as one, with edges that are unsure for their size."""
    both = BoundingBox(95, 78, 50, 34)
    unclear, clear = (run(BOX, both, deviation, frames=100)[0] for deviation in (5.0, 2.0))
    assert unclear.as_tuple() == pytest.approx(BOX.as_tuple())
    assert clear.overlap(both) > 0.95


@pytest.mark.parametrize('shift', [3.0, -3.0])
def test_what_moves_as_a_whole_moves_where_its_extent_is_unclear(shift):
    moved = BOX.moved_to((BOX.center[0] + shift, BOX.center[1]))
    box, _ = run(BOX, moved, 5.0, frames=1)
    assert box.size == pytest.approx(BOX.size)
    assert 0.5 < (box.x - BOX.x) / shift < 1
    assert box.y == pytest.approx(BOX.y)


def test_what_a_convention_explains_is_no_change():
    """A box that was drawn with a margin keeps it."""
    tight = BoundingBox(100.2, 80.2, 39.6, 29.6)
    box, _ = run(BOX, tight, 1.0, frames=100)
    assert box.as_tuple() == pytest.approx(BOX.as_tuple())


def test_box_that_the_border_cuts_has_no_convention():
    entering = BoundingBox(0, 80, 8, 20)
    whole = BoundingBox(0.0, 76.0, 30.0, 28.0)
    box, _ = run(entering, whole, 1.0)
    assert box.as_tuple() == pytest.approx(whole.as_tuple(), abs=0.05)


def test_target_that_came_in_gets_a_convention_when_it_has_settled():
    entered, larger = BoundingBox(60, 80, 30, 28), BoundingBox(59.8, 79.8, 30.4, 28.4)
    changes = []
    for frames in (1, 100):
        fuse = EdgeFilter(BoundingBox(0, 80, 8, 20), IMAGE)
        for _ in range(frames):
            fuse(entered, measured(entered, 1.0))
        changes.append(fuse(entered, measured(larger, 1.0)).width - entered.width)
    assert changes[0] > 0.05 and changes[1] == pytest.approx(0, abs=1e-9)


def test_target_that_came_in_changes_faster_until_it_has_settled():
    # Between the fast change at the border and the slow one far from it, ever slower.
    start, larger = BoundingBox(60, 80, 40, 30), BoundingBox(60, 80, 50, 30)
    changes = []
    for frames in (0, 30, 70, 100, 300):
        fuse = EdgeFilter(BoundingBox(0, 80, 8, 20), IMAGE)
        for _ in range(frames):
            fuse(start, measured(start, 2.0))
        assert fuse.settled is (frames >= 100)
        fuse._covariances = np.tile(np.eye(2), (2, 1, 1))
        changes.append(fuse(start, measured(larger, 2.0)).width - 40)
    assert changes[0] > changes[1] > changes[2] > changes[3] == changes[4] > 0


def test_frames_at_the_border_settle_nothing():
    fuse, cut = EdgeFilter(BoundingBox(0, 80, 8, 20), IMAGE), BoundingBox(0, 80, 40, 30)
    for _ in range(300):
        fuse(cut, measured(cut, 2.0))
    assert not fuse.settled and EdgeFilter(BOX, IMAGE).settled


def test_size_at_the_border_changes_faster():
    near, far = BoundingBox(0, 80, 40, 30), BoundingBox(60, 80, 40, 30)
    changes = []
    for start in (near, far):
        _, fuse = run(start, start, 2.0)
        larger = BoundingBox(start.x, start.y, 50, 30)
        changes.append(fuse(start, measured(larger, 2.0)).width - 40)
    assert changes[0] > 1.5 * changes[1] > 0


def test_variances_decide_where_filter_and_network_differ_on_the_center():
    moved = BOX.moved_to((124.0, 95.0))
    sure, unsure = (EdgeFilter(BOX, IMAGE)(BOX, measured(moved, deviation))
                    for deviation in (0.2, 60.0))
    assert sure.center[0] == pytest.approx(124, abs=0.35)
    assert unsure.center[0] == pytest.approx(120, abs=0.2)


@given(st.floats(-50, 300), st.floats(-50, 200), lengths, lengths, lengths, lengths, errors)
def test_fused_boxes_have_sides_and_covariances_are_positive(x, y, width, height, wide, high,
                                                             deviation):
    fuse = EdgeFilter(BoundingBox(x, y, width, height), IMAGE)
    box = BoundingBox(x, y, width, height)
    for _ in range(3):
        box = fuse(box, measured(BoundingBox(x + 3, y - 2, wide, high), deviation))
        assert min(box.size) >= 2
        assert np.linalg.eigvalsh(fuse._covariances).min() > 0


@given(st.floats(0.2, 5))
def test_unit_of_length_does_not_matter_before_a_convention_is_known(scale):
    """Twice as large in an image twice as large is twice the result."""
    def fused(factor):
        fuse = EdgeFilter(BOX.scaled(1.0), IMAGE)
        fuse._covariances, fuse._whole = fuse._covariances * factor**2, 0
        place = BoundingBox(*(factor * value for value in BOX.as_tuple()))
        larger = BoundingBox(*(factor * value for value in (90.0, 70.0, 60.0, 50.0)))
        fuse._image_size = tuple(factor * side + 50 for side in IMAGE)
        return np.array(fuse(place, measured(larger, 2 * factor)).as_tuple())

    assert fused(scale) == pytest.approx(scale * fused(1.0), rel=1e-6)

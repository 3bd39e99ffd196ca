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

"""What belongs together comes together, by its stamp, and what happened is noted."""

import itertools

import numpy as np
import pytest

from lmsco_ros.console.chronicle import Chronicle
from lmsco_ros.console.feed import Feed, Rate
from lmsco_ros.console.moments import Assembly
from lmsco_ros.console.picture import Look, PALETTES, Pictures
from msg_adapters.boxes import Box
from msg_adapters.state import State

IMAGE = np.zeros((48, 64), np.uint16)
BOX = Box(1, 2, 3, 4)


class Clock:
    """A clock that is set by hand."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def gathered(clock):
    """Return an assembly of a tracker that was just heard, and the list that it delivers to."""
    delivered = []
    assembly = Assembly(delivered.append, clock)
    assembly.add_statuses(1, ())
    return assembly, delivered


@pytest.mark.parametrize('order', [
    ('image', 'box', 'status'), ('status', 'image', 'box'), ('box', 'status', 'image')])
def test_a_frame_waits_for_its_parts_in_any_order(gathered, status, order):
    assembly, delivered = gathered
    add = {'image': lambda: assembly.add_image(7, IMAGE),
           'box': lambda: assembly.add_box(7, 1, BOX),
           'status': lambda: assembly.add_statuses(7, (status(),))}
    for part in order:
        assert not delivered
        add[part]()
    (moment,) = delivered
    assert (moment.stamp, moment.boxes, moment.statuses[0].state) == (7, {1: BOX}, 'tracking')


def test_lost_and_idle_frames_have_no_box_to_wait_for(gathered, status):
    assembly, delivered = gathered
    for stamp, state in ((7, 'lost'), (8, 'idle'), (9, 'disabled')):
        assembly.add_image(stamp, IMAGE)
        assembly.add_statuses(stamp, (status(state),))
        assert delivered[-1].stamp == stamp


def test_frames_that_the_tracker_skipped_are_left_out(gathered, status):
    assembly, delivered = gathered
    for stamp in (7, 8, 9):
        assembly.add_image(stamp, IMAGE)
    assembly.add_statuses(9, (status('idle'),))
    # An older one that is told of later would go back.
    assembly.add_statuses(7, (status('idle'),))
    assert [moment.stamp for moment in delivered] == [9]


def test_images_are_shown_as_they_come_when_the_tracker_is_silent(gathered, clock, status):
    assembly, delivered = gathered
    assembly.add_image(7, IMAGE)
    assert not delivered
    clock.now += 2.5
    assembly.release()
    assembly.add_image(8, IMAGE)
    assert [(moment.stamp, moment.statuses) for moment in delivered] == [(7, ()), (8, ())]


def test_recording_that_starts_over_is_shown_again(gathered, status):
    assembly, delivered = gathered
    for stamp in (7, 8, 9, 7, 8):
        assembly.add_image(stamp, IMAGE)
        assembly.add_statuses(stamp, (status('idle'),))
    assert [moment.stamp for moment in delivered] == [7, 8, 9, 7, 8]


def test_confidence_map_is_waited_for_but_not_for_long(gathered, clock, status):
    assembly, delivered = gathered
    assembly.with_map = True
    assembly.add_image(7, IMAGE)
    assembly.add_statuses(7, (status('lost'),))
    assert not delivered
    assembly.add_confidence(7, IMAGE)
    assert delivered[-1].confidence is IMAGE
    assembly.add_image(8, IMAGE)
    assembly.add_statuses(8, (status('lost'),))
    clock.now += 0.3
    assembly.release()
    assert delivered[-1].stamp == 8 and delivered[-1].confidence is None


def test_states_are_waited_for_once_they_come_but_not_for_long(gathered, clock, status):
    assembly, delivered = gathered
    state = State(1, (5.0, 6.0), np.eye(2), (1.0, 0.0), np.eye(2))
    assembly.add_image(6, IMAGE)
    assembly.add_statuses(6, (status('lost'),))
    # A tracker that never told one is not waited for.
    assert delivered[-1].stamp == 6 and delivered[-1].states == {}
    assembly.add_image(7, IMAGE)
    assembly.add_state(7, state)
    assembly.add_statuses(7, (status('lost'),))
    assert delivered[-1].stamp == 7 and delivered[-1].states == {1: state}
    assembly.add_image(8, IMAGE)
    assembly.add_statuses(8, (status('lost'),))
    assert delivered[-1].stamp == 7
    assembly.add_state(8, state)
    assert delivered[-1].stamp == 8
    assembly.add_image(9, IMAGE)
    assembly.add_statuses(9, (status('lost'),))
    clock.now += 0.3
    assembly.release()
    assert delivered[-1].stamp == 9
    # Where there is no target, there is none to wait for.
    assembly.add_image(10, IMAGE)
    assembly.add_statuses(10, (status('idle'),))
    assert delivered[-1].stamp == 10


def test_what_never_becomes_complete_does_not_pile_up(gathered):
    assembly, delivered = gathered
    for stamp in range(1000):
        assembly.add_box(stamp, 1, BOX)
        assembly.add_image(stamp, IMAGE)
    assert len(assembly._waiting) <= 64 and not delivered
    for stamp in range(1000, 1010):
        assembly.add_image(stamp, np.zeros((4000, 4000), np.uint16))
    assert assembly._bytes() <= 128 * 2 ** 20


def test_feed_keeps_as_much_as_it_may(moment):
    feed = Feed(megabytes=0.05)
    told = []
    end = feed.watch(lambda: told.append(1))
    for number in range(1, 21):
        feed.add(moment(number))
    assert len(told) == 20 and feed.after(19).number == 20 and feed.after(20) is None
    oldest = feed.beside(20, -100).number
    assert sum(IMAGE.nbytes for _ in range(oldest, 21)) <= 0.05e6 < IMAGE.nbytes * (22 - oldest)
    end()
    feed.add(moment(21))
    assert len(told) == 20


def test_rate_is_that_of_the_last_two_seconds(clock):
    rate = Rate(clock)
    assert rate.silence is None
    for _ in range(100):
        clock.now += 0.1
        rate.count()
    assert rate.per_second == pytest.approx(10, abs=1) and rate.silence == 0
    clock.now += 3
    assert rate.per_second == 0 and rate.silence == pytest.approx(3)


@pytest.fixture
def chronicle(clock):
    return Chronicle(lambda moment, box: b'picture', clock)


def hear(chronicle, statuses, stamps=itertools.count(1)):
    """Have the chronicle hear of the next frame."""
    chronicle.hear(next(stamps), statuses)


def kinds(chronicle):
    return [(event.kind, event.track_id) for event in chronicle.since(0)]


def test_losses_and_finds_are_noted_once(chronicle, status):
    for state in ('tracking', 'lost', 'lost', 'uncertain', 'tracking', 'lost'):
        hear(chronicle, [status(state)])
    assert kinds(chronicle) == [('lost', 1), ('found', 1), ('lost', 1)]


def test_starts_and_drops_are_noted(chronicle, status):
    hear(chronicle, [status(start='accepted')])
    hear(chronicle, [status(), status('refused', track_id=1, start='refused')])
    hear(chronicle, [status(track_id=2, start='accepted')])
    hear(chronicle, [status('disabled', track_id=0)])
    hear(chronicle, [status('idle', track_id=0)])
    assert kinds(chronicle) == [('accepted', 1), ('refused', 1), ('accepted', 2), ('dropped', 1),
                                ('dropped', 2)]


def test_targets_that_are_not_told_of_while_another_catches_up_are_kept(chronicle, status):
    second = 10 ** 9
    chronicle.hear(50 * second, [status()])
    for stamp in (49 * second, 50 * second):
        chronicle.hear(stamp, [status(track_id=2)])
    chronicle.hear(51 * second, [status(), status(track_id=2)])
    assert kinds(chronicle) == []
    # A recording that starts over, where the second one is given up.
    chronicle.hear(second, [status()])
    assert kinds(chronicle) == [('dropped', 2)]


def test_loss_shows_where_the_target_was_seen_last(chronicle, status, moment):
    hear(chronicle, [status()])
    chronicle.see(moment(1))
    hear(chronicle, [status('lost')])
    (event,) = chronicle.since(0)
    assert event.thumbnail == 'cGljdHVyZQ=='


def test_strip_has_two_minutes_at_ten_a_second(chronicle, clock, moment):
    for number in range(6000):
        clock.now += 1 / 30
        chronicle.see(moment(1, 'lost', boxes={}) if number % 2 else moment(1))
    strip = chronicle.strip()
    assert 119 <= strip[-1].at - strip[0].at <= 120.01
    assert 900 <= len(strip) <= 1201
    assert {sample.state for sample in strip} <= {'lost', 'tracking'}
    assert chronicle.strip()[0].size in (None, pytest.approx(48 ** 0.5))


@pytest.mark.parametrize('palette', PALETTES)
def test_palettes_run_from_one_end_to_the_other(palette):
    gray = PALETTES[palette].astype(float).mean(axis=1)
    assert PALETTES[palette].shape == (256, 3)
    steps = np.diff(gray) * (-1 if palette == 'black_hot' else 1)
    assert steps.min() > -0.8 and steps.sum() > 180


def test_pictures_are_made_once_and_forgotten(moment):
    pictures = Pictures()
    assert pictures.jpeg(moment(1), Look()) is pictures.jpeg(moment(1), Look())
    for number in range(2, 40):
        pictures.jpeg(moment(number), Look())
    assert len(pictures._files) <= 8 and len(pictures._views) <= 8


@pytest.mark.parametrize('box', [
    Box(-30, -30, 10, 10), Box(63.5, 47.5, 100, 100), Box(10, 10, 0.1, 0.1),
    Box(-1000, -1000, 5000, 5000)])
def test_thumbnails_of_boxes_anywhere(moment, box):
    assert Pictures().thumbnail(moment(1), box)[:2] == b'\xff\xd8'


@pytest.mark.parametrize('image', [
    np.full((40, 50), np.nan, np.float32), np.zeros((40, 50, 3), np.uint8),
    np.zeros((1, 1), np.uint16), np.zeros((3, 4000), np.uint16)])
def test_pictures_of_any_image(moment, image):
    from dataclasses import replace
    look = Look('ironbow', True)
    shown = replace(moment(1), image=image, confidence=np.ones(image.shape[:2], np.float32))
    assert Pictures().jpeg(shown, look)[:2] == b'\xff\xd8'


def test_thumbnail_is_of_a_frame_in_which_the_target_was_certain(clock, status, moment):
    drawn = []
    chronicle = Chronicle(lambda moment, box: drawn.append(moment.number) or b'', clock)
    for number, state in enumerate(('tracking', 'tracking', 'uncertain'), 1):
        hear(chronicle, [status(state)])
        chronicle.see(moment(number, state))
    hear(chronicle, [status('lost')])
    assert drawn == [2]

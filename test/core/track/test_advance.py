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

"""What a track does with a frame, line by line, each of its parts replaced."""

from dataclasses import replace
from unittest.mock import call, create_autospec, Mock

import numpy as np
import pytest

from lmsco_ros.core import BoundingBox, BoxError, TimeError, TrackerConfig, TrackState
from lmsco_ros.core import track as track_module
from lmsco_ros.core.config import LearningConfig, PresenceConfig, ScaleConfig
from lmsco_ros.core.detection.detector import Detection
from lmsco_ros.core.detection.scale import scale_factors
from lmsco_ros.core.extent.measurement import Measurement
from lmsco_ros.core.fourier.localization import Peak
from lmsco_ros.core.imaging.gain import FrameCondition, FrameSurvey, IntensityRange
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.networks.together import at_once
from lmsco_ros.core.presence.evidence import Assessment, Evidence, Verdict
from lmsco_ros.core.presence.neighbors import Neighbors
from lmsco_ros.core.presence.observer import Outlook, Sighting
from lmsco_ros.core.search import course as course_module
from lmsco_ros.core.track import Track
from lmsco_ros.core.weights.loading import Networks

CONFIG = TrackerConfig(learning=LearningConfig(update_interval=2))
START = BoundingBox(40, 30, 20, 10)
AHEAD = START.moved_to((55, 36))
MOVED = START.moved_to((53, 35))
REGION = BoundingBox(0, 0, 80, 80)
SEARCHED = ScaleConfig(step=1.25, exponent_min=-1, exponent_max=0, rate=1)
FIRST_RANGE, RANGE = IntensityRange(0, 1), IntensityRange(10, 20)
PLAIN = FrameCondition(RANGE, shutter_closed=False, inverted=False, cut=False, noise=0.03)
SHUT, CUT = replace(PLAIN, shutter_closed=True), replace(PLAIN, cut=True)
BELIEVED = Verdict(0.8, TrackState.TRACKING, believed=True, learns=True)
DOUBTED = Verdict(0.4, TrackState.UNCERTAIN, believed=True, learns=False)
MISSED = Verdict(0.1, TrackState.UNCERTAIN, believed=False, learns=False)
PROMISING = replace(MISSED, score=0.9, promising=True)
FIRST = Verdict(0.95, TrackState.TRACKING, believed=True, learns=True)
VAGUE = Verdict(0.2, TrackState.UNCERTAIN, believed=True, learns=False, note='vague')
CLASSES = {'gain': 'AutomaticGain', 'detector': 'Detector', 'extent': 'EdgeFilter',
           'monitor': 'PresenceMonitor', 'observer': 'Observer', 'prediction': 'Prediction',
           'redetection': 'Redetection', 'motion': 'TargetState'}
ELSEWHERE = {'Prediction': course_module, 'TargetState': course_module}


class SameView(FrameView):
    """Equal to every view of the very same image; two arrays cannot be compared in one word."""

    def __eq__(self, other):
        """Compare without asking an array for its truth."""
        return other.image is self.image and other.intensity == self.intensity


def sighting(center, presence, peak=3.0, box=START):
    """Return something as large as a box seen at a place; so sure of it is the network."""
    displacement = tuple((c - r) / 80 for c, r in zip(center, REGION.center, strict=True))
    grid = np.arange(25.0).reshape(5, 5) * peak
    found = Detection(REGION, Peak(displacement[::-1], 0, peak, grid, np.array([peak, 1.0])),
                      [], np.zeros((3, 2)), 10.0)
    seen = Assessment(Evidence(10.0, 1.0, presence, 0.1), 1.0, 1.0, 0.8, 0.9)
    return Sighting(box.moved_to(center), found, seen,
                    Measurement(np.zeros((2, 2)), np.ones((2, 2)), presence))


HERE, THERE = sighting((52, 36), 2.5), sighting((20, 60), -1.5)


class Seen:
    """What a look returns that asks nobody; any number of times."""

    def __init__(self, sighting):
        self._sighting = sighting

    def __iter__(self):
        return self._sighting
        yield


def advance(track, *arguments):
    """Return the result of a frame of one target alone."""
    return at_once(track.advance(*arguments))


@pytest.fixture
def parts(monkeypatch):
    """Replace all that a track is made of; attributes are the parts, and calls are in order."""
    parts = Mock()
    for name, kind in CLASSES.items():
        module = ELSEWHERE.get(kind, track_module)
        part = create_autospec(getattr(module, kind), instance=True)
        parts.attach_mock(part, name)
        monkeypatch.setattr(module, kind, Mock(return_value=part))
    parts.gain.examine.return_value = replace(PLAIN, intensity=FIRST_RANGE)
    parts.detector.return_value = sighting(START.center, 4.0, peak=2.0).detection
    parts.monitor.believable.return_value = True
    parts.monitor.judge.return_value, parts.monitor.start.return_value = BELIEVED, FIRST
    parts.observer.look.return_value, parts.redetection.return_value = Seen(HERE), THERE
    parts.prediction.expected.return_value, parts.prediction.misses = AHEAD, 0
    parts.extent.side_effect, parts.extent.settled = lambda box, measured: box, True
    parts.motion.box, parts.motion.velocity = MOVED, (2.0, -1.0)
    parts.motion.covariance, parts.motion.velocity_covariance = np.eye(4), np.eye(2)
    monkeypatch.setattr(track_module, 'box_covariance', lambda *of: of)
    return parts


def frame():
    """Return a frame, of which nothing but its pixels is looked at here."""
    return FrameSurvey(np.zeros((100, 120), np.uint8), np.zeros((10, 12)), None, RANGE, RANGE)


def started(parts, config=CONFIG, networks=Networks()):
    """Return a track whose first frame is forgotten by its parts."""
    track = Track(config, 'backend', networks, frame(), START)
    parts.reset_mock()
    parts.gain.examine.return_value = PLAIN
    return track


@pytest.fixture
def track(parts):
    """Return a track that has seen its first frame."""
    return started(parts)


def names(parts):
    """Return what was called, in order."""
    return [made[0] for made in parts.mock_calls]


def test_plain_frame_is_seen_judged_followed_and_remembered_in_this_order(parts, track):
    advance(track, frame())
    parts.reset_mock()
    advance(track, frame())
    assert names(parts) == [
        'motion.predict', 'gain.examine', 'monitor.note_noise', 'prediction.expected',
        'observer.look',
        'monitor.believable', 'monitor.judge', 'extent', 'prediction.seen',
        'redetection.restart', 'observer.keep', 'motion.measure', 'detector.remember',
        'prediction.expected', 'detector.watch']


def test_frame_is_examined_and_seen_in_its_range(parts, track):
    shown = frame()
    advance(track, shown)
    parts.gain.examine.assert_called_once_with(shown)
    outlook, = parts.observer.look.call_args.args[:1]
    assert outlook.view.image is shown.image and outlook.view.intensity is RANGE


def test_target_is_looked_for_where_it_is_expected_at_the_searched_scales(parts):
    track, shown = started(parts, replace(CONFIG, scale=SEARCHED)), frame()
    advance(track, shown)
    view = SameView(shown.image, RANGE)
    parts.observer.look.assert_called_once_with(
        Outlook(view, START, AHEAD, MOVED), scale_factors(SEARCHED))
    assert parts.prediction.expected.call_args_list[0] == call(START, (120, 100))


def test_others_are_told_with_where_the_target_goes_itself(parts, track):
    parts.prediction.velocity = (3.0, -2.0)
    assert track.course.heading == (53, 33)
    advance(track, frame(), None, [(70, 40), (90, 20)])
    assert parts.observer.look.call_args.args[0].neighbors == Neighbors(
        (53, 33), ((70, 40), (90, 20)))


@pytest.mark.parametrize('other, merged', [((50, 30), True), ((120, 90), False)])
def test_what_is_seen_in_the_place_of_another_one_is_no_motion(parts, track, other, merged):
    parts.prediction.velocity = (3.0, -2.0)
    advance(track, frame(), None, [(120, 20), other])
    assert parts.prediction.seen.call_args.args[1] is merged


def test_nobody_is_where_he_was_expected_after_a_cut(parts, track):
    parts.gain.examine.return_value = CUT
    advance(track, frame(), None, [(70, 40)])
    assert parts.observer.look.call_args.args[0].neighbors is None


def test_frame_is_judged_once_by_what_was_seen(parts, track):
    result = advance(track, frame())
    parts.monitor.judge.assert_called_once_with(HERE.assessment)
    assert (result.score, result.state) == (BELIEVED.score, BELIEVED.state)
    assert result is track.result


def test_believable_sighting_needs_no_search(parts, track):
    advance(track, frame())
    parts.monitor.believable.assert_called_once_with(HERE.assessment)
    parts.redetection.assert_not_called()


def test_what_is_not_believable_is_searched_elsewhere_and_that_is_judged(parts, track):
    parts.monitor.believable.return_value = False
    parts.prediction.misses = 7
    shown = frame()
    result = advance(track, shown)
    assert parts.redetection.call_args_list == [call(
        Outlook(SameView(shown.image, RANGE), START, AHEAD, MOVED, misses=7), HERE,
        after_shutter=False)]
    parts.monitor.judge.assert_called_once_with(THERE.assessment)
    parts.detector.remember.assert_called_once_with(THERE.detection, pytest.approx((20, 60)))
    assert result.box.center == pytest.approx(THERE.detection.center)


def test_closed_shutter_shows_nothing_new(parts, track):
    before = track.result
    parts.gain.examine.return_value = SHUT
    for number in range(3):
        parts.motion.box = MOVED.moved_to((50 + number, 40))
        parts.motion.covariance = number * np.eye(4)
        shut = advance(track, frame())
        assert (shut.box, shut.score, shut.state) == (before.box, before.score, before.state)
        assert shut.confidence_map is before.confidence_map
        # The motion goes on behind it, and is known less and less.
        assert shut.predicted_box == parts.motion.box
        assert shut.covariance is parts.motion.covariance and track.result is shut
    assert set(names(parts)) == {'motion.predict', 'gain.examine'}


def test_first_frame_after_the_shutter_is_searched_whatever_is_seen(parts, track):
    conditions = [SHUT, PLAIN, PLAIN]
    parts.gain.examine.side_effect = conditions
    for _ in conditions:
        advance(track, frame())
    parts.redetection.assert_called_once()
    assert parts.redetection.call_args.kwargs == {'after_shutter': True}


def test_frames_of_a_closed_shutter_are_not_counted(parts, track):
    parts.gain.examine.side_effect = [PLAIN, SHUT, PLAIN, PLAIN]
    for _ in range(4):
        advance(track, frame())
    # The filter is trained after the second frame that shows something.
    assert [made for made in names(parts) if made in ('detector.train', 'observer.look')] == [
        'observer.look', 'observer.look', 'detector.train', 'observer.look']


def test_after_a_cut_nothing_is_expected_before_the_target_is_looked_for(parts, track):
    parts.gain.examine.return_value = CUT
    advance(track, frame())
    assert names(parts)[1:10] == [
        'gain.examine', 'monitor.note_noise', 'monitor.note_cut', 'redetection.restart',
        'observer.forget', 'prediction.stop', 'motion.forget_place', 'prediction.expected',
        'observer.look']
    parts.motion.forget_place.assert_called_once_with((120, 100))


def test_frame_without_a_cut_forgets_nothing(parts, track):
    advance(track, frame())
    for unwanted in ('monitor.note_cut', 'prediction.stop', 'observer.forget',
                     'motion.forget_place'):
        assert unwanted not in names(parts)


@pytest.mark.parametrize('verdict', [BELIEVED, DOUBTED], ids=['certain', 'doubted'])
def test_believed_target_is_followed(parts, track, verdict):
    parts.monitor.judge.return_value = verdict
    result = advance(track, frame())
    parts.prediction.seen.assert_called_once_with(pytest.approx((52, 36)), False)
    parts.prediction.missed.assert_not_called()
    parts.redetection.restart.assert_called_once_with()
    assert result.box.center == pytest.approx((52, 36)) and result.box.size == START.size
    advance(track, frame())
    assert parts.observer.look.call_args.args[0].last == result.box


def test_target_that_is_not_believed_stays_where_it_was_and_counts_as_missed(parts, track):
    parts.monitor.judge.return_value = MISSED
    result = advance(track, frame())
    assert result.box == START and result.state is MISSED.state
    parts.prediction.missed.assert_called_once_with()
    for unwanted in ('prediction.seen', 'redetection.restart', 'observer.keep',
                     'detector.remember', 'detector.train', 'extent',
                     'motion.measure'):
        assert unwanted not in names(parts)


def test_motion_goes_by_the_times_of_the_frames(parts):
    track = Track(CONFIG, 'backend', Networks(), frame(), START, 5.0)
    parts.gain.examine.side_effect = [PLAIN, SHUT, PLAIN]
    results = [advance(track, frame(), time) for time in (5.1, 5.3, 5.4)]
    assert [made.args[0] for made in parts.motion.predict.call_args_list] == pytest.approx(
        [3.0, 6.0, 3.0])
    assert results[-1].velocity == (60.0, -30.0)
    np.testing.assert_allclose(results[-1].velocity_covariance, 900 * np.eye(2))


def test_frames_without_times_are_one_step_each(parts, track):
    result = advance(track, frame())
    assert result.velocity == (2.0, -1.0) and (result.velocity_covariance == np.eye(2)).all()
    parts.motion.predict.assert_called_once_with(1.0)


def test_wrong_time_changes_nothing(parts, track):
    with pytest.raises(TimeError, match='initialized on a frame with none'):
        advance(track, frame(), 5.0)
    assert names(parts) == []
    advance(track, frame())


def test_motion_takes_what_is_followed_with_how_exactly_it_was_seen(parts, track):
    advance(track, frame())
    (box, covariance, edges), = (made.args for made in parts.motion.measure.call_args_list)
    assert box.size == pytest.approx(START.size) and box.center == pytest.approx((52, 36))
    assert covariance == (HERE.detection, box)
    assert list(edges) == list(HERE.measurement.deviations.mean(axis=1))


def test_motion_is_not_told_of_edges_where_nothing_is_measured(parts, track):
    parts.observer.look.return_value = Seen(replace(HERE, measurement=None))
    advance(track, frame())
    assert parts.motion.measure.call_args.args[2] is None


@pytest.mark.parametrize('moved, told', [
    (MOVED, MOVED), (START.moved_to((500, 36)), BoundingBox(110, 31, 10, 10)),
    (START.moved_to((118, -20)), BoundingBox(108, 0, 12, 5))])
def test_motion_is_told_with_the_box_in_the_image(parts, track, moved, told):
    parts.motion.box = moved
    result = advance(track, frame())
    assert result.predicted_box.as_tuple() == pytest.approx(told.as_tuple())
    assert result.covariance is parts.motion.covariance


@pytest.mark.parametrize('verdict, distractors, kept', [
    (BELIEVED, True, True), (DOUBTED, True, False), (BELIEVED, False, False)])
def test_frame_is_kept_where_the_target_is_certain_and_distractors_are_asked_for(
        parts, verdict, distractors, kept):
    track = started(parts, replace(CONFIG, presence=PresenceConfig(distractors=distractors)))
    parts.monitor.judge.return_value = verdict
    shown = frame()
    result = advance(track, shown)
    expected = [call(SameView(shown.image, RANGE), result.box)] if kept else []
    assert parts.observer.keep.call_args_list == expected


def test_size_is_searched_and_then_measured(parts):
    track = started(parts, replace(CONFIG, scale=SEARCHED))
    parts.extent.side_effect = lambda box, measured: box.scaled(1.5)
    result = advance(track, frame())
    (box, measured), = (made.args for made in parts.extent.call_args_list)
    # The better of the two scores is that of the smaller scale.
    assert box.center == pytest.approx((52, 36)) and box.size == pytest.approx((16, 8))
    assert measured is HERE.measurement
    assert result.box.center == pytest.approx((52, 36)) and result.box.size == (24, 12)


def test_box_and_sample_follow_the_measurement(parts, track):
    parts.extent.side_effect = lambda box, measured: box.moved_to((57, 31))
    result = advance(track, frame())
    assert result.box.center == pytest.approx((57, 31))
    # Edges that are sure to 1 of 14.1 pixels: 1 / (1 + (1 / 14.1 / .2)^2) of the way is learned.
    parts.detector.remember.assert_called_once_with(
        HERE.detection, pytest.approx((52 + 5 / 1.125, 36 - 5 / 1.125)))
    parts.prediction.seen.assert_called_once_with(pytest.approx((57, 31)), False)


def test_size_is_kept_where_nothing_is_measured(parts, track):
    parts.observer.look.return_value = Seen(replace(HERE, measurement=None))
    assert advance(track, frame()).box.size == START.size
    parts.extent.assert_not_called()
    parts.detector.remember.assert_called_once_with(HERE.detection, HERE.detection.center)


def test_what_is_learned_hardly_moves_to_a_center_that_is_unsure(parts, track):
    unsure = replace(HERE.measurement, deviations=np.full((2, 2), 20.0))
    parts.observer.look.return_value = Seen(replace(HERE, measurement=unsure))
    parts.extent.side_effect = lambda box, measured: box.moved_to((57, 31))
    advance(track, frame())
    x, y = parts.detector.remember.call_args.args[1]
    assert 52 < x < 52.2 and 35.8 < y < 36


@pytest.mark.parametrize('factor', [1e4, 1e-4])
def test_size_remains_one_that_can_be_tracked(parts, track, factor):
    parts.extent.side_effect = lambda box, measured: box.scaled(factor)
    advance(track, frame())
    advance(track, frame())
    last = parts.observer.look.call_args.args[0].last
    assert max(last.size) <= 2.001 * np.hypot(120, 100) and min(last.size) >= 1.999


def test_size_is_that_of_the_sighting(parts, track):
    parts.observer.look.return_value = Seen(sighting((52, 36), 2.5, box=START.scaled(2)))
    assert advance(track, frame()).box.size == (40, 20)


def test_target_beyond_the_border_is_followed_to_the_border(parts, track):
    parts.observer.look.return_value = Seen(sighting((130, 36), 2.5))
    advance(track, frame())
    parts.prediction.seen.assert_called_once_with(pytest.approx((120, 36)), False)


def test_filter_learns_what_was_seen_and_trains_every_other_frame(parts, track):
    for _ in range(4):
        advance(track, frame())
    assert parts.detector.remember.call_args_list == 4 * [
        call(HERE.detection, pytest.approx((52, 36)))]
    track.learn()
    assert parts.detector.train.call_args_list == 2 * [call()]


@pytest.fixture
def entering(parts, track):
    """Return a track of a target that comes in and is twice as large by now."""
    parts.extent.settled = False
    parts.extent.side_effect = lambda box, measured: box.scaled(2**0.5)
    return track


def test_target_that_has_outgrown_what_was_learned_is_learned_anew(parts, entering):
    shown, later = frame(), sighting((52, 36), 2.5, peak=8.0).detection
    parts.detector.return_value = later
    result = advance(entering, shown)
    view = SameView(shown.image, RANGE)
    assert track_module.Detector.call_args == call(
        CONFIG, 'backend', Networks(), view, result.box)
    parts.observer.begin.assert_called_once_with(parts.detector, later)
    parts.monitor.expect_anew.assert_called_once_with()
    assert names(parts)[-4:] == [
        'observer.begin', 'monitor.expect_anew', 'prediction.expected', 'detector.watch']
    # The map of this frame is of the former filter, the next one of the new one.
    assert result.confidence_map.max() == pytest.approx(HERE.detection.peak.grid.max() / 2)
    parts.extent.side_effect = lambda box, measured: box
    assert advance(entering, frame()).confidence_map.max() == pytest.approx(
        HERE.detection.peak.grid.max() / 8)


def test_new_detector_is_not_trained_on_what_the_former_one_remembered(parts, entering):
    sizes = iter((1.0, 2**0.5))
    parts.extent.side_effect = lambda box, measured: box.scaled(next(sizes))
    for _ in range(2):
        advance(entering, frame())
    entering.learn()
    parts.observer.begin.assert_called_once()
    parts.detector.train.assert_not_called()


@pytest.mark.parametrize('growth, deviation, settled, anew', [
    (1.31, 0.9, False, True), (1.29, 0.9, False, False), (0.5, 0.1, False, False),
    (1.31, 2.5, False, False), (1.31, 0.9, True, False)])
def test_only_what_has_surely_grown_since_it_came_in_is_learned_anew(
        parts, track, growth, deviation, settled, anew):
    # The side of the grown box is 16 pixels: a deviation of 1.9 is not sure any more.
    parts.extent.settled = settled
    parts.extent.side_effect = lambda box, measured: box.scaled(growth**0.5)
    measured = replace(HERE.measurement, deviations=np.full((2, 2), deviation))
    parts.observer.look.return_value = Seen(replace(HERE, measurement=measured))
    advance(track, frame())
    assert parts.observer.begin.called is anew


@pytest.mark.parametrize('verdict, measurement', [
    (MISSED, HERE.measurement), (BELIEVED, None)], ids=['missed', 'not measured'])
def test_what_is_not_seen_or_not_measured_is_not_learned_anew(
        parts, entering, verdict, measurement):
    parts.monitor.judge.return_value = verdict
    parts.observer.look.return_value = Seen(
        replace(HERE, measurement=measurement, found=HERE.found.scaled(2)))
    advance(entering, frame())
    parts.observer.begin.assert_not_called()


def test_next_frame_learns_first_what_nobody_has_learned_before(parts, track):
    for _ in range(3):
        advance(track, frame())
    assert [made for made in names(parts) if made in ('detector.train', 'gain.examine')] == [
        'gain.examine', 'gain.examine', 'detector.train', 'gain.examine']


def test_frame_is_learned_from_once(parts, track):
    track.learn()
    for _ in range(2):
        advance(track, frame())
    assert not parts.detector.train.called
    track.learn()
    track.learn()
    advance(track, frame())
    parts.detector.train.assert_called_once_with()


def test_training_that_fails_is_tried_again(parts, track):
    for _ in range(2):
        advance(track, frame())
    parts.detector.train.side_effect = [MemoryError, None]
    with pytest.raises(MemoryError):
        track.learn()
    advance(track, frame())
    assert parts.detector.train.call_count == 2


def test_doubted_target_is_not_learned(parts, track):
    parts.monitor.judge.return_value = DOUBTED
    advance(track, frame())
    advance(track, frame())
    track.learn()
    for unwanted in ('detector.remember', 'detector.train'):
        assert unwanted not in names(parts)


@pytest.mark.parametrize('verdict', [BELIEVED, MISSED], ids=['believed', 'missed'])
def test_place_of_the_next_frame_is_watched_at_the_end(parts, track, verdict):
    parts.monitor.judge.return_value = verdict
    shown = frame()
    result = advance(track, shown)
    assert names(parts)[-2:] == ['prediction.expected', 'detector.watch']
    assert parts.prediction.expected.call_args == call(result.box, (120, 100))
    parts.detector.watch.assert_called_once_with(SameView(shown.image, RANGE), AHEAD)


def test_map_is_the_score_in_units_of_the_first_frame(parts, track):
    result = advance(track, frame())
    assert result.search_region == REGION
    assert result.confidence_map.dtype == np.float32
    assert result.confidence_map[2, 2] == 0 and result.confidence_map.max() == 3.0 * 24 / 2.0


def test_told_box_is_the_visible_part(parts, track):
    parts.observer.look.return_value = Seen(sighting((119, 36), 2.5))
    assert advance(track, frame()).box.as_tuple() == pytest.approx((109, 31, 11, 10))


def test_parts_are_made_of_the_first_frame(parts, monkeypatch):
    made = {name: getattr(ELSEWHERE.get(kind, track_module), kind)
            for name, kind in CLASSES.items()}
    make_meter, shown = Mock(), frame()
    monkeypatch.setattr(track_module.ExtentMeter, 'marked', make_meter)
    networks = Networks(extent='network')
    track = Track(CONFIG, 'backend', networks, shown, START)
    view = SameView(shown.image, FIRST_RANGE)
    made['gain'].assert_called_once_with(CONFIG.intensity)
    made['detector'].assert_called_once_with(CONFIG, 'backend', networks, view, START)
    assert parts.detector.call_args_list == [call(view, START)]
    make_meter.assert_called_once_with('network', view, START)
    made['extent'].assert_called_once_with(START, (120, 100))
    made['monitor'].assert_called_once_with(CONFIG.presence)
    made['observer'].assert_called_once_with(
        parts.detector, make_meter.return_value, parts.monitor, parts.detector.return_value)
    made['redetection'].assert_called_once_with(
        CONFIG.search, parts.observer, parts.monitor, view, START)
    made['motion'].assert_called_once_with(START)
    parts.prediction.seen.assert_called_once_with(START.center, False)
    parts.observer.keep.assert_called_once_with(view, START)
    parts.detector.watch.assert_called_once_with(view, START)
    assert (track.result.box, track.result.score) == (START, FIRST.score)
    assert track.result.state is TrackState.TRACKING and track.result.search_region == REGION
    # The target of the first frame scores 1.
    assert track.result.confidence_map.max() == 24


def test_noise_of_every_frame_is_noted(parts, track):
    advance(track, frame())
    parts.monitor.note_noise.assert_called_once_with(0.03)


def test_start_is_judged_by_what_speaks_for_the_first_frame(parts):
    shown = frame()
    track = Track(CONFIG, 'backend', Networks(), shown, START)
    parts.observer.introduce.assert_called_once_with(SameView(shown.image, FIRST_RANGE), START)
    parts.monitor.start.assert_called_once_with(parts.observer.introduce.return_value)
    assert names(parts).index('monitor.note_noise') < names(parts).index('monitor.start')
    assert track.result.note == '' and advance(track, frame()).note == ''


def test_what_a_person_should_know_is_told_with_every_verdict(parts):
    parts.monitor.start.return_value = VAGUE
    track = Track(CONFIG, 'backend', Networks(), frame(), START)
    assert (track.result.score, track.result.state) == (VAGUE.score, VAGUE.state)
    assert track.result.note == 'vague'
    parts.observer.keep.assert_not_called()
    parts.monitor.judge.return_value = replace(DOUBTED, note='still vague')
    assert advance(track, frame()).note == 'still vague'
    parts.monitor.judge.return_value = BELIEVED
    assert advance(track, frame()).note == ''


def test_what_is_promising_is_looked_for_where_it_was_and_in_its_size(parts, track):
    promised = sighting((90, 70), 2.5, box=START.scaled(2))
    parts.observer.look.return_value = Seen(promised)
    parts.monitor.judge.return_value = PROMISING
    assert advance(track, frame()).box == START
    parts.monitor.judge.return_value = MISSED
    advance(track, frame())
    looked = parts.observer.look.call_args.args[0]
    assert looked.expected.center == pytest.approx((90, 70)) and looked.expected.size == (40, 20)
    assert looked.last == START
    advance(track, frame())
    assert parts.observer.look.call_args.args[0].expected == AHEAD


def test_size_before_it_vanished_is_taken_when_the_target_is_lost_and_no_sooner(parts, track):
    parts.observer.look.return_value = Seen(sighting((52, 36), 2.5, box=START.scaled(0.5)))
    advance(track, frame())
    for verdict, size in ((MISSED, (10, 5)), (replace(MISSED, state=TrackState.LOST), (20, 10))):
        parts.monitor.judge.return_value = verdict
        advance(track, frame())
        assert parts.prediction.expected.call_args.args[0].size == pytest.approx(size)


def test_promise_of_another_view_is_none(parts, track):
    parts.monitor.judge.return_value = PROMISING
    advance(track, frame())
    parts.gain.examine.return_value = CUT
    advance(track, frame())
    assert parts.observer.look.call_args.args[0].expected == AHEAD


def test_nothing_is_measured_without_a_network(parts):
    made = track_module.Observer
    started(parts)
    assert made.call_args.args[1] is None


def test_box_is_checked_against_the_image_first(parts):
    with pytest.raises(BoxError, match='image of 120 x 100 pixels'):
        Track(CONFIG, 'backend', Networks(), frame(), BoundingBox(0, 0, 10, 110))
    assert names(parts) == []

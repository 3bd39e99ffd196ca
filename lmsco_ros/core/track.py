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

"""One target's story: look, judge, search elsewhere, follow, learn."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from lmsco_ros.core.backend import Backend
from lmsco_ros.core.config import TrackerConfig
from lmsco_ros.core.detection.detector import Detection, Detector
from lmsco_ros.core.detection.precision import box_covariance
from lmsco_ros.core.detection.scale import scale_factors
from lmsco_ros.core.extent.fusion import EdgeFilter, place_to_learn
from lmsco_ros.core.extent.measurement import ExtentMeter
from lmsco_ros.core.fourier.localization import centered_map
from lmsco_ros.core.imaging.gain import AutomaticGain, FrameSurvey
from lmsco_ros.core.imaging.regions import check_box, clamp_box, visible_part
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.networks.together import Asking, in_step
from lmsco_ros.core.presence.evidence import Verdict
from lmsco_ros.core.presence.monitor import PresenceMonitor
from lmsco_ros.core.presence.neighbors import Neighbors
from lmsco_ros.core.presence.observer import Observer, Outlook, Sighting
from lmsco_ros.core.search.course import Course
from lmsco_ros.core.search.redetection import Redetection
from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.core.weights.loading import Networks

__all__ = ['Track']

# Growth in area with which a target that comes in over the border has outgrown what was learned of
# it, and the deviation of its edges, in sides, with which that is sure.
_OUTGROWN, _SURE = 1.3, 0.12


class Track:
    """
    State of one target: where it is, how large, and what was learned of it.

    Parameters
    ----------
    config : TrackerConfig
        How to track.
    backend : Backend
        Where the filter is computed.
    networks : Networks
        What the configuration asks for.
    frame, box : FrameSurvey, BoundingBox
        First frame, and the target in it.
    time : float, optional
        When that frame was taken, in seconds; None where frames have no times.

    Raises
    ------
    BoxError, ImageError, TimeError
        When the box is too small or not in the image, there is nothing to see around it, or the
        time is no finite number.

    """

    def __init__(self, config: TrackerConfig, backend: Backend, networks: Networks,
                 frame: FrameSurvey, box: BoundingBox, time: float | None = None) -> None:
        check_box(box, (frame.image.shape[1], frame.image.shape[0]))
        self.course, self._config = Course(box, time), config
        self._box, self._frame, self._after_shutter = box, 0, False
        self._training_due = False
        self._gain = AutomaticGain(config.intensity)
        condition = self._gain.examine(frame)
        view = FrameView(frame.image, condition.intensity)
        self._new_detector = partial(Detector, config, backend, networks)
        first = self._start_detector(view, box)
        meter = ExtentMeter.marked(networks.extent, view, box) if networks.extent else None
        self._monitor = PresenceMonitor(config.presence)
        self._monitor.note_noise(condition.noise)
        self._observer = Observer(self._detector, meter, self._monitor, first)
        self._redetection = Redetection(config.search, self._observer, self._monitor, view, box)
        self._extent = EdgeFilter(box, view.size)
        verdict = self._monitor.start(self._observer.introduce(view, box))
        self._follow(view, box, verdict.state)
        self._detector.watch(view, box)
        self.result = self._describe(view, first, verdict)

    def advance(self, frame: FrameSurvey, time: float | None = None,
                others: Sequence[tuple[float, float]] = ()) -> Asking[TrackResult]:
        """
        Find the target in the next frame, asking the networks.

        A frame that can be trusted is remembered; :meth:`learn` learns from it, at the latest when
        the next frame comes.

        Parameters
        ----------
        frame : FrameSurvey
            The next frame.
        time : float, optional
            When it was taken, in seconds; None where frames have no times.
        others : sequence of tuple of float
            Where (x, y) other targets go, which are not to be taken for this one.

        """
        self.learn()
        yield from in_step()
        self.course.next_frame(time)
        condition = self._gain.examine(frame)
        view = FrameView(frame.image, condition.intensity)
        if condition.shutter_closed:
            self._after_shutter = True
            self.result = self.course.describe(self.result, view.size)
            return self.result
        self._frame += 1
        self._monitor.note_noise(condition.noise)
        if condition.cut:
            self._expect_nothing(view)
        self.course.look_around(frame)
        known = others and not condition.cut
        neighbors = Neighbors(self.course.heading, tuple(others)) if known else None
        outlook = Outlook(view, self.course.last, self.course.expected(view.size),
                          self.course.predicted, neighbors, self.course.misses)
        sighting = yield from self._look(outlook)
        if self._after_shutter or not self._monitor.believable(sighting.assessment):
            sighting = self._redetection(
                outlook, sighting, after_shutter=self._after_shutter)
        self._after_shutter = False
        verdict = self._monitor.judge(sighting.assessment)
        if verdict.believed:
            side = self._box.area**0.5
            alone = neighbors is None or not neighbors.touched(side)
            self._follow(view, self._fused(view, sighting, alone), verdict.state,
                         merged=neighbors is not None and neighbors.merged(side))
            self.course.measure(self._box, box_covariance(sighting.detection, self._box),
                                sighting.measurement)
        else:
            self.course.missed(sighting.found if verdict.promising else None)
            if verdict.state is TrackState.LOST:
                self.course.lost()
        if verdict.learns:
            self._remember(sighting)
        self._detector.watch(view, self.course.expected(view.size))
        self.result = self._describe(view, sighting.detection, verdict)
        if verdict.believed and self._outgrown(sighting):
            self._begin_anew(view)
        return self.result

    def learn(self) -> None:
        """Train the filter if the last frame has made it time to; the next frame would do so."""
        if self._training_due:
            self._detector.train()
            self._training_due = False

    def _expect_nothing(self, view: FrameView) -> None:
        """Expect nothing of a view that has changed at once, but that it shows the target."""
        self._monitor.note_cut()
        self._redetection.restart()
        self._observer.forget()
        self.course.forget(view.size)

    def _look(self, outlook: Outlook) -> Asking[Sighting]:
        """Return what is where the target is expected."""
        return (yield from self._observer.look(outlook, scale_factors(self._config.scale)))

    def _fused(self, view: FrameView, sighting: Sighting, alone: bool) -> BoundingBox:
        """Return the box at a sighting, as large as was searched, and measured if it is alone."""
        box = sighting.sized(self._config.scale)
        if sighting.measurement is not None and alone:
            box = self._extent(box, sighting.measurement)
        return clamp_box(box, view.size)

    def _follow(self, view: FrameView, box: BoundingBox, state: TrackState,
                merged: bool = False) -> None:
        """Move to where the target is, alone or in the place of another one."""
        self._box = box
        self.course.follow(box, merged)
        self._redetection.restart()
        if state is TrackState.TRACKING and self._config.presence.distractors:
            self._observer.keep(view, box)

    def _outgrown(self, sighting: Sighting) -> bool:
        """Return whether what was learned is a small part of what has come in since."""
        measured = sighting.measurement
        return (not self._extent.settled and measured is not None
                and self.result.box.area > _OUTGROWN * self._learned.area
                and measured.deviations.mean() < _SURE * self.result.box.area**0.5)

    def _begin_anew(self, view: FrameView) -> None:
        """Learn the target as it is now, as if it was marked in this frame."""
        first = self._start_detector(view, self.result.box)
        self._training_due = False
        self._observer.begin(self._detector, first)
        self._monitor.expect_anew()
        self._detector.watch(view, self.course.expected(view.size))

    def _start_detector(self, view: FrameView, box: BoundingBox) -> Detection:
        """Return what a new detector sees of what it has learned."""
        self._detector = self._new_detector(view, box)
        self._learned = visible_part(box, view.size)
        first = self._detector(view, box)
        self._first_peak = first.peak.value
        return first

    def _remember(self, sighting: Sighting) -> None:
        """Store the sample, and see whether it is time to train the filter."""
        place = place_to_learn(sighting.detection.center, self._box, sighting.measurement)
        self._detector.remember(sighting.detection, place)
        self._training_due = self._frame % self._config.learning.update_interval == 0

    def _describe(self, view: FrameView, detection: Detection, verdict: Verdict) -> TrackResult:
        """Return what there is to say; the target in the first frame scores 1 in the map."""
        return self.course.describe(TrackResult(
            visible_part(self._box, view.size), verdict.score, verdict.state,
            centered_map(detection.peak.grid / self._first_peak), detection.region,
            note=verdict.note), view.size)

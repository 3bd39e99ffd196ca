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
from dataclasses import replace

from lmsco_ros.core.backend import Backend
from lmsco_ros.core.config import TrackerConfig
from lmsco_ros.core.detection.detector import Detection, Detector
from lmsco_ros.core.detection.precision import box_covariance
from lmsco_ros.core.detection.scale import found_factor, scale_factors
from lmsco_ros.core.extent.fusion import EdgeFilter, place_to_learn
from lmsco_ros.core.extent.measurement import ExtentMeter
from lmsco_ros.core.fourier.localization import centered_map
from lmsco_ros.core.imaging.gain import AutomaticGain, FrameSurvey
from lmsco_ros.core.imaging.regions import check_box, clamp_box, visible_part
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.networks.together import Asking
from lmsco_ros.core.presence.monitor import PresenceMonitor
from lmsco_ros.core.presence.neighbors import Neighbors
from lmsco_ros.core.presence.observer import Observer, Outlook, Sighting
from lmsco_ros.core.search.prediction import Prediction
from lmsco_ros.core.search.redetection import Redetection
from lmsco_ros.core.state import FrameClock, TargetState
from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.core.weights.loading import Networks

__all__ = ['Track']


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
    frame : FrameSurvey
        First frame.
    box : BoundingBox
        Target in the first frame.
    time : float, optional
        When that frame was taken, in seconds; None where frames have no times.

    Raises
    ------
    BoxError
        When the box is too small or not in the image.
    ImageError
        When there is nothing to see in the search region.
    TimeError
        When the time is no finite number.

    """

    def __init__(self, config: TrackerConfig, backend: Backend, networks: Networks,
                 frame: FrameSurvey, box: BoundingBox, time: float | None = None) -> None:
        check_box(box, (frame.image.shape[1], frame.image.shape[0]))
        self._clock, self._motion = FrameClock(time), TargetState(box)
        self._config = config
        self._box = box
        self._frame = 0
        self._after_shutter = False
        self._gain = AutomaticGain(config.intensity)
        view = FrameView(frame.image, self._gain.examine(frame).intensity)
        self._detector = Detector(config, backend, networks, view, box)
        first = self._detector(view, box)
        self._first_peak = first.peak.value
        meter = ExtentMeter.marked(networks.extent, view, box) if networks.extent else None
        self._monitor = PresenceMonitor(config.presence)
        self._observer = Observer(self._detector, meter, self._monitor, first)
        self._prediction = Prediction()
        self._redetection = Redetection(config.search, self._observer, self._monitor, view, box)
        self._extent = EdgeFilter(box, view.size)
        self._follow(view, box, TrackState.TRACKING)
        self._detector.watch(view, box)
        self.result = self._describe(view, first, 1.0, TrackState.TRACKING)

    def advance(self, frame: FrameSurvey, time: float | None = None,
                others: Sequence[tuple[float, float]] = ()) -> Asking[TrackResult]:
        """
        Find the target in the next frame, and learn from it if it can be trusted.

        It asks the networks, so that several targets may be looked for together.

        Parameters
        ----------
        frame : FrameSurvey
            The next frame.
        time : float, optional
            When it was taken, in seconds; None where frames have no times.
        others : sequence of tuple of float
            Where (x, y) other targets go, which are not to be taken for this one.

        """
        self._motion.predict(self._clock.step(time))
        condition = self._gain.examine(frame)
        if condition.shutter_closed:
            self._after_shutter = True
            height, width = frame.image.shape[:2]
            self.result = self._with_motion(self.result, (width, height))
            return self.result
        self._frame += 1
        if condition.cut:
            others = ()
            self._expect_nothing()
            self._motion.forget_place((frame.image.shape[1], frame.image.shape[0]))
        view = FrameView(frame.image, condition.intensity)
        neighbors = Neighbors(self.heading, tuple(others)) if others else None
        outlook = Outlook(view, self._box, self._expected(view), neighbors)
        sighting = yield from self._look(outlook)
        if self._after_shutter or not self._monitor.believable(sighting.assessment):
            sighting = self._redetection(outlook, sighting, self._prediction.misses,
                                         after_shutter=self._after_shutter)
        self._after_shutter = False
        verdict = self._monitor.judge(sighting.assessment)
        if verdict.believed:
            merged = neighbors is not None and neighbors.merged(self._box.area**0.5)
            self._follow(view, self._fused(view, sighting), verdict.state, merged)
            self._motion.measure(self._box, box_covariance(sighting.detection, self._box))
        else:
            self._prediction.missed()
        if verdict.learns:
            self._learn(sighting)
        self._detector.watch(view, self._expected(view))
        self.result = self._describe(view, sighting.detection, verdict.score, verdict.state)
        return self.result

    def check_time(self, time: float | None) -> None:
        """Raise TimeError unless the next frame may have that time."""
        self._clock.check(time)

    @property
    def heading(self) -> tuple[float, float]:
        """Where (x, y) the target gets to in the next frame, if it goes on as before."""
        (x, y), (right, down) = self._box.center, self._prediction.velocity
        return x + right, y + down

    def _expect_nothing(self) -> None:
        """Expect nothing of a view that has changed at once, but that it shows the target."""
        self._monitor.note_cut()
        self._prediction.stop()
        self._redetection.restart()
        self._observer.forget()

    def _expected(self, view: FrameView) -> BoundingBox:
        """Return where the target is expected next."""
        return self._prediction.expected(self._box, view.size)

    def _look(self, outlook: Outlook) -> Asking[Sighting]:
        """Return what is where the target is expected."""
        return (yield from self._observer.look(outlook, scale_factors(self._config.scale)))

    def _fused(self, view: FrameView, sighting: Sighting) -> BoundingBox:
        """Return the box at a sighting, in the size that was searched and measured there."""
        detection = sighting.detection
        factor = found_factor(self._config.scale, detection.peak.scale_values)
        box = sighting.box.moved_to(detection.center).scaled(factor)
        if sighting.measurement is not None:
            box = self._extent(box, sighting.measurement)
        return clamp_box(box, view.size)

    def _follow(self, view: FrameView, box: BoundingBox, state: TrackState,
                merged: bool = False) -> None:
        """Move to where the target is, alone or in the place of another one."""
        self._box = box
        self._prediction.seen(box.center, merged)
        self._redetection.restart()
        if state is TrackState.TRACKING and self._config.presence.distractors:
            self._observer.keep(view, box)

    def _learn(self, sighting: Sighting) -> None:
        """Store the sample; when it is time, train the filter."""
        place = place_to_learn(sighting.detection.center, self._box, sighting.measurement)
        self._detector.remember(sighting.detection, place)
        if self._frame % self._config.learning.update_interval == 0:
            self._detector.train()

    def _describe(self, view: FrameView, detection: Detection, score: float,
                  state: TrackState) -> TrackResult:
        """Return what there is to say; the target in the first frame scores 1 in the map."""
        return self._with_motion(TrackResult(
            visible_part(self._box, view.size), score, state,
            centered_map(detection.peak.grid / self._first_peak), detection.region), view.size)

    def _with_motion(self, result: TrackResult, size: tuple[int, int]) -> TrackResult:
        """Return a result with what is known of the motion, in an image of a size (w, h)."""
        (x, y), rate = self._motion.velocity, self._clock.rate
        return replace(
            result, velocity=(rate * x, rate * y), covariance=self._motion.covariance,
            predicted_box=visible_part(clamp_box(self._motion.box, size), size),
            velocity_covariance=rate**2 * self._motion.velocity_covariance)

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


"""A GPU without memory costs speed, and nothing else."""

import weakref

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import pytest
import torch

from lmsco_ros.core.types import BoundingBox, TrackState
from lmsco_ros.node.gpu_fallback import FallbackTracker
from msg_adapters.status import diagnoses_from_message, Level

OutOfMemory = torch.cuda.OutOfMemoryError
BOX = BoundingBox(1, 2, 3, 4)


def image(value):
    return np.full((4, 4), value)


@pytest.fixture
def bench(make_fake):
    """Return a tracker on a fake GPU, the fakes by device, and the warnings."""
    fakes, warnings = {'cuda': make_fake(), 'cpu': make_fake()}, []
    return FallbackTracker(fakes.__getitem__, 'cuda', warnings.append), fakes, warnings


def calls(fake):
    return [(name, int(seen[0, 0])) for name, seen in fake.calls]


def started(tracker, frame):
    """Start on a target, and return its box."""
    number = tracker.initialize(frame, BOX, 1.0)
    return tracker.results[number].box


def test_goes_on_from_the_last_frame_that_showed_the_target(bench):
    tracker, fakes, warnings = bench
    tracker.initialize(image(0), BOX, 1.0)
    fakes['cuda'].states = [TrackState.TRACKING, TrackState.LOST]
    tracker.update(image(1), 2.0)
    tracker.update(image(2), 2.0)
    fakes['cuda'].error = OutOfMemory('2 GiB are missing')
    result = tracker.update(image(3), 2.0)[1]
    assert calls(fakes['cpu']) == [('initialize', 1), ('update', 3)]
    # The box of frame 1 is one pixel right of the first, and frame 3 moves it once more.
    assert result.box == BoundingBox(3, 2, 3, 4)
    warning, = warnings
    assert 'processor' in warning and '2 GiB are missing' in warning
    tracker.initialize(image(4), BOX, 1.0)
    assert calls(fakes['cpu'])[-1] == ('initialize', 4)


def test_all_targets_go_on_under_their_numbers(bench):
    """Each from the frame that it was seen in last; the new tracker counts from 1 again."""
    tracker, fakes, _ = bench
    places = [BoundingBox(10 * number, 2, 3, 4) for number in range(4)]
    assert [tracker.initialize(image(0), box, 1.0) for box in places] == [1, 2, 3, 4]
    tracker.drop(1)
    assert tracker.initialize(image(1), BOX, 1.0, in_place_of=(4,)) == 5
    fakes['cuda'].states = [TrackState.LOST, TrackState.TRACKING, TrackState.TRACKING]
    assert set(tracker.update(image(2), 2.0)) == {2, 3, 5}
    fakes['cuda'].error = OutOfMemory()
    results = tracker.update(image(3), 2.0, only=(3, 5))
    assert calls(fakes['cpu']) == [('initialize', 0), ('initialize', 2), ('initialize', 2),
                                   ('update', 3)]
    assert {number: result.box.x for number, result in results.items()} == {3: 22, 5: 3}
    assert set(tracker.results) == {2, 3, 5} and tracker.results[2].box == places[1]
    tracker.drop(3)
    assert tracker.initialize(image(4), BOX, 1.0, in_place_of=(2,)) == 6
    assert set(tracker.update(image(5), 2.0)) == {5, 6}
    tracker.reset()
    assert tracker.results == {} and tracker.initialize(image(6), BOX, 1.0) == 7


def test_start_beside_others_is_repeated_on_the_processor(bench):
    tracker, fakes, _ = bench
    tracker.initialize(image(0), BoundingBox(9, 2, 3, 4), 1.0)
    fakes['cuda'].error = OutOfMemory()
    assert tracker.initialize(image(1), BOX, 1.0) == 2
    assert calls(fakes['cpu']) == [('initialize', 0), ('initialize', 1)]
    assert {number: result.box.x for number, result in tracker.results.items()} == {1: 9, 2: 1}


def test_targets_go_on_after_memory_was_short_in_training(bench, monkeypatch):
    tracker, fakes, warnings = bench
    number = tracker.initialize(image(0), BOX, 1.0)

    def learn():
        raise OutOfMemory

    monkeypatch.setattr(fakes['cuda'], 'learn', learn)
    tracker.learn()
    assert len(warnings) == 1 and list(tracker.results) == [number]
    tracker.learn()
    tracker.update(image(1), 2.0)
    assert calls(fakes['cpu']) == [('initialize', 0), ('update', 1)]


def test_start_on_a_point_is_repeated_on_the_processor(bench):
    tracker, fakes, _ = bench
    tracker.initialize(image(0), BOX, 1.0)
    fakes['cuda'].error = OutOfMemory()
    assert tracker.initialize_at(image(1), (20.0, 9.0), 1.0, in_place_of=(1,)) == 2
    assert calls(fakes['cpu']) == [('initialize', 0), ('initialize', 1)]
    assert {number: result.box.center for number, result in tracker.results.items()} == {
        2: (20.0, 9.0)}


def test_times_go_with_the_frames(bench):
    tracker, fakes, _ = bench
    tracker.initialize(image(0), BOX, 5.0)
    tracker.update(image(1), 6.0)
    fakes['cuda'].error = OutOfMemory()
    tracker.update(image(2), 7.5)
    assert (fakes['cuda'].times, fakes['cpu'].times) == ([5.0, 6.0, 7.5], [6.0, 7.5])


def test_one_buffer_for_all_frames_is_as_good_as_fresh_ones(bench):
    tracker, fakes, _ = bench
    buffer = image(0)
    tracker.initialize(buffer, BOX, 1.0)
    buffer[...] = 1
    tracker.update(buffer, 2.0)
    fakes['cuda'].error = OutOfMemory()
    buffer[...] = 2
    tracker.update(buffer, 2.0)
    assert calls(fakes['cpu']) == [('initialize', 1), ('update', 2)]


@pytest.mark.parametrize('device', ['cuda', 'cpu'])
def test_nothing_of_a_frame_is_kept(make_fake, device):
    tracker = FallbackTracker(lambda device: make_fake(), device, lambda reason: None)
    for call in (lambda image: tracker.initialize(image, BOX, 1.0),
                 lambda image: tracker.update(image, 2.0)):
        frame = image(0)
        kept = weakref.ref(frame)
        call(frame)
        del frame
        assert kept() is None


def test_start_is_repeated_on_the_processor(bench):
    tracker, fakes, warnings = bench
    fakes['cuda'].error = OutOfMemory()
    assert started(tracker, image(7)) == BOX
    assert calls(fakes['cpu']) == [('initialize', 7)] and len(warnings) == 1


def test_tracker_that_does_not_fit_is_made_on_the_processor(make_fake):
    devices, warnings = [], []

    def make(device):
        devices.append(device)
        if device != 'cpu':
            raise OutOfMemory
        return make_fake()
    tracker = FallbackTracker(make, '', warnings.append)
    assert started(tracker, image(0)) == BOX
    assert devices == ['', 'cpu'] and len(warnings) == 1


def test_no_memory_anywhere_and_other_errors_are_raised(bench):
    tracker, fakes, _ = bench
    tracker.initialize(image(0), BOX, 1.0)
    fakes['cuda'].error = RuntimeError('other')
    with pytest.raises(RuntimeError, match='other'):
        tracker.update(image(1), 2.0)
    fakes['cuda'].error, fakes['cpu'].error = OutOfMemory(), OutOfMemory('here neither')
    with pytest.raises(OutOfMemory, match='here neither'):
        tracker.update(image(2), 2.0)
    fakes['cpu'].error = OutOfMemory('nor now')
    with pytest.raises(OutOfMemory, match='nor now'):
        tracker.initialize(image(3), BOX, 1.0)
    assert started(tracker, image(4)) == BOX


def test_node_goes_on_and_warns_until_it_is_configured_again(run, make_fake):
    fakes = {'cuda': make_fake(), 'cpu': make_fake()}
    running = run(tracker_factory=lambda settings: fakes[settings.device], device='cuda')
    health = running.graph.listen(DiagnosticArray, '/diagnostics')
    running.start()
    running.send()
    fakes['cuda'].error = OutOfMemory()
    status = running.send()
    assert (status.state, status.track_id) == ('tracking', 1)
    assert running.last_box == (11, 12, 8, 6)
    count = len(health)
    running.graph.spin_until(lambda: len(health) > count + 1)
    diagnosis, = diagnoses_from_message(health[-1])
    assert diagnosis.level == Level.WARN and 'GPU ran out of memory' in diagnosis.message
    running.node.trigger_deactivate()
    running.node.trigger_cleanup()
    running.node.trigger_configure()
    running.node.trigger_activate()
    running.graph.spin_until(lambda: running.images.get_subscription_count() == 1)
    running.send()
    count = len(health)
    running.graph.spin_until(lambda: len(health) > count + 1)
    assert diagnoses_from_message(health[-1])[0].level == Level.OK

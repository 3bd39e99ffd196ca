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


"""Every row of the node's table of topics and services, over real ROS messages."""

from unittest.mock import Mock

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import pytest
from sensor_msgs.msg import CompressedImage, Image, RegionOfInterest
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import ImageMarker

from lmsco_ros.core.types import TrackState
from msg_adapters.boxes import detections_available
from msg_adapters.compressed import compressed_from_image
from msg_adapters.image import image_from_message
from msg_adapters.markers import box_from_marker
from msg_adapters.status import diagnoses_from_message, Level


def test_without_a_target_every_frame_is_answered_idle(running):
    status = running.send(running.graph.image(), running.graph.image())
    assert (status.state, status.track_id, status.score) == ('idle', 0, None)
    assert [status.state for status in running.statuses] == ['idle', 'idle']
    assert not running.boxes and not running.fake.calls


def test_init_box_starts_on_the_newest_frame(running):
    running.send(running.graph.image(1), running.graph.image(2))
    running.start(10, 12, 8, 6)
    running.graph.spin_until(lambda: running.boxes)
    (call, image), = running.fake.calls
    assert call == 'initialize' and (image == 2).all()
    assert running.last_box == (10, 12, 8, 6)
    status = running.send(running.graph.image(3))
    assert (status.state, status.track_id, status.score) == ('tracking', 1, 0.75)
    assert running.last_box == (11, 12, 8, 6)


def test_init_before_the_first_image_waits_for_it(running):
    running.start(10, 12, 8, 6)
    status = running.send(running.graph.image(7))
    assert (status.state, status.track_id) == ('tracking', 1)
    assert running.last_box == (10, 12, 8, 6)


def test_every_output_has_the_header_of_its_image(running):
    overlays = running.graph.listen(Image, 'lmsco_tracker/overlay')
    maps = running.graph.listen(Image, 'lmsco_tracker/confidence_map')
    markers = running.graph.listen(ImageMarker, 'lmsco_tracker/marker')
    image = running.graph.image()
    running.start()
    running.send(image)
    running.graph.spin_until(lambda: overlays and maps and markers)
    for message in (running.boxes[-1], overlays[-1], maps[-1], markers[-1]):
        assert message.header == image.header
    assert running.status_headers[-1] == image.header


def test_corners_run_clockwise_from_top_left(running):
    running.start(10, 12, 8, 6)
    running.send()
    assert [(p.x, p.y) for p in running.boxes[-1].polygon.points] == [
        (10, 12), (18, 12), (18, 18), (10, 18)]


def test_no_box_while_lost(running):
    running.start()
    running.send()
    running.fake.states = [TrackState.UNCERTAIN, TrackState.LOST, TrackState.LOST,
                           TrackState.TRACKING]
    states = [running.send().state for _ in range(4)]
    assert states == ['uncertain', 'lost', 'lost', 'tracking']
    stamps = [header.stamp for header in running.status_headers]
    assert [box.header.stamp for box in running.boxes] == [stamps[0], stamps[1], stamps[4]]
    assert [status.level for status in running.statuses[1:4]] == [Level.WARN] * 3


def test_track_id_grows_with_every_init(running):
    for expected in (1, 2, 3):
        running.start(expected, expected)
        status = running.send()
        assert (status.state, status.track_id) == ('tracking', expected)
    assert running.last_box[:2] == (4, 3)


def test_reset_drops_the_target(running):
    running.start()
    running.send()
    assert running.graph.call(Trigger, 'lmsco_tracker/reset').success
    count = len(running.boxes)
    assert running.send().state == 'idle'
    assert len(running.boxes) == count
    running.start()
    assert running.send().track_id == 2


def test_reset_forgets_an_init_that_waits_for_its_image(running):
    running.start()
    running.graph.call(Trigger, 'lmsco_tracker/reset')
    assert running.send().state == 'idle'


def test_disabled_node_keeps_its_target_and_stays_silent(running):
    running.start()
    running.send()
    assert running.graph.call(SetBool, 'lmsco_tracker/set_enabled', data=False).success
    calls = len(running.fake.calls)
    assert running.send().state == 'disabled'
    assert len(running.fake.calls) == calls and len(running.boxes) == 1
    running.graph.call(SetBool, 'lmsco_tracker/set_enabled', data=True)
    status = running.send()
    assert (status.state, status.track_id) == ('tracking', 1)


def test_init_while_disabled_is_refused_with_the_remedy(running):
    running.send()
    running.graph.call(SetBool, 'lmsco_tracker/set_enabled', data=False)
    running.start()
    running.graph.spin_until(lambda: running.statuses[-1].state == 'refused')
    assert 'enable' in running.statuses[-1].message
    assert not running.fake.calls


@pytest.mark.parametrize('spoil, reason', [
    (lambda image: setattr(image, 'encoding', 'h264'), 'h264'),
    (lambda image: setattr(image, 'data', image.data[:-1]), 'truncated'),
    (lambda image: setattr(image, 'step', 3), 'step is 3'),
])
def test_unreadable_image_is_refused_and_tracking_goes_on(running, spoil, reason):
    running.start()
    running.send()
    broken = running.graph.image()
    spoil(broken)
    status = running.send(broken)
    assert (status.state, status.level, status.track_id) == ('refused', Level.ERROR, 1)
    assert reason in status.message
    assert running.status_headers[-1] == broken.header
    assert running.send().state == 'tracking'


@pytest.mark.parametrize('region', [
    RegionOfInterest(), RegionOfInterest(x_offset=4, width=5)])
def test_empty_box_is_refused_and_tracking_goes_on(running, region):
    running.start()
    running.send()
    running.init_box.publish(region)
    running.graph.spin_until(lambda: running.statuses[-1].state == 'refused')
    assert 'empty' in running.statuses[-1].message
    assert running.send().state == 'tracking'


def test_tracker_that_raises_costs_the_target_only(running):
    running.start()
    running.send()
    running.fake.error = RuntimeError('out of luck')
    status = running.send()
    assert (status.state, status.level) == ('failed', Level.ERROR)
    assert 'RuntimeError: out of luck' in status.message
    assert running.send().state == 'idle' and len(running.boxes) == 1
    running.start(1, 2, 3, 4)
    status = running.send()
    assert (status.state, status.track_id) == ('tracking', 2)


def test_failing_start_is_reported_and_the_next_one_tracks(running):
    running.send()
    running.fake.error = ValueError('box is outside the image')
    running.start()
    running.graph.spin_until(lambda: running.statuses[-1].state == 'failed')
    assert 'outside' in running.statuses[-1].message
    running.start()
    assert running.send().state == 'tracking'


def test_image_size_may_change(running):
    running.start()
    running.send(running.graph.image(shape=(48, 64)))
    maps = running.graph.listen(Image, 'lmsco_tracker/confidence_map')
    small = running.graph.image(shape=(20, 30), dtype=np.uint8)
    running.send(small)
    assert running.fake.calls[-1][1].shape == (20, 30)
    confidence = running.graph.answer(maps, small)
    assert (confidence.height, confidence.width) == (20, 30)


def test_stamps_may_go_backwards(running):
    running.start()
    running.send(running.graph.image(stamp=5 * 10 ** 9))
    early = running.graph.image(stamp=10 ** 9)
    assert running.send(early).state == 'tracking'
    assert running.boxes[-1].header == early.header
    running.start_stamped((1, 2, 3, 4), 10 ** 9)
    assert running.send().track_id == 2


def test_confidence_map_is_aligned_and_computed_on_demand(running, monkeypatch):
    running.start(10, 12, 8, 6)
    monkeypatch.setattr('lmsco_ros.node.outputs.message_from_confidence',
                        lambda *args: pytest.fail('nobody listens'))
    assert running.send().state == 'tracking'
    monkeypatch.undo()
    maps = running.graph.listen(Image, 'lmsco_tracker/confidence_map')
    image = running.graph.image()
    running.send(image)
    confidence = running.graph.answer(maps, image)
    expected = np.zeros((48, 64), np.float32)
    expected[12:18, 11:19] = 0.5
    assert confidence.encoding == '32FC1'
    np.testing.assert_array_equal(image_from_message(confidence), expected)


def test_overlay_shows_the_box_and_is_drawn_on_demand(running, monkeypatch):
    monkeypatch.setattr('lmsco_ros.node.outputs.draw_targets',
                        lambda *args, **kwargs: pytest.fail('nobody listens'))
    assert running.send().state == 'idle'
    monkeypatch.undo()
    overlays = running.graph.listen(Image, 'lmsco_tracker/overlay')
    first, second = running.graph.image(1000), running.graph.image(1000)
    running.send(first)
    plain = image_from_message(running.graph.answer(overlays, first))
    running.start(30, 12, 16, 20)
    running.send(second)
    overlay = running.graph.answer(overlays, second)
    drawn = image_from_message(overlay)
    assert overlay.encoding == 'bgr8' and drawn.shape == (48, 64, 3)
    assert (drawn[25, 29:33] != plain[25, 29:33]).any()
    np.testing.assert_array_equal(drawn[40:, :28], plain[40:, :28])


def test_overlay_interval_saves_pictures(run):
    running = run(overlay_interval=2)
    overlays = running.graph.listen(Image, 'lmsco_tracker/overlay')
    images = [running.graph.image() for _ in range(4)]
    running.send(*images)
    running.graph.spin_until(lambda: len(overlays) == 2)
    assert [o.header for o in overlays] == [images[1].header, images[3].header]


def test_marker_outlines_the_box_and_goes_away_with_it(running):
    markers = running.graph.listen(ImageMarker, 'lmsco_tracker/marker')
    running.start(10, 12, 8, 6)
    running.send()
    running.fake.states = [TrackState.LOST]
    running.send()
    running.graph.spin_until(lambda: len(markers) == 2)
    assert box_from_marker(markers[0]) == (10, 12, 8, 6)
    assert box_from_marker(markers[1]) is None
    assert (markers[0].ns, markers[0].id) == (markers[1].ns, markers[1].id)


def test_detections_are_empty_without_a_box(run, monkeypatch):
    detections = []
    listener = Mock(publish=detections.append, get_subscription_count=lambda: 1)
    monkeypatch.setattr('lmsco_ros.node.outputs.Outputs._detections_publisher',
                        lambda self, made: listener)
    monkeypatch.setattr('lmsco_ros.node.outputs.detections_from_boxes',
                        lambda boxes, header: (boxes, header))
    running = run()
    running.send()
    running.start(10, 12, 8, 6)
    running.graph.spin_until(lambda: len(running.statuses) == 2)
    running.fake.states = [TrackState.UNCERTAIN, TrackState.LOST]
    images = [running.graph.image(), running.graph.image()]
    running.send(*images)
    running.graph.spin_until(lambda: len(detections) == 4)
    assert [boxes for boxes, _ in detections] == [
        [], [((10, 12, 8, 6), '1', 0.75, 'target')], [((11, 12, 8, 6), '1', 0.75, 'target')], []]
    assert detections[2][1] == images[0].header


@pytest.mark.skipif(not detections_available(), reason='vision_msgs is not installed')
def test_detections(running):
    from vision_msgs.msg import Detection2DArray
    detections = running.graph.listen(Detection2DArray, 'lmsco_tracker/detections')
    running.start(10, 12, 8, 6)
    running.send()
    running.fake.states = [TrackState.LOST]
    running.send()
    running.graph.spin_until(lambda: len(detections) == 2)
    detection, = detections[0].detections
    assert (detection.id, detection.bbox.size_x) == ('1', 8)
    assert not detections[1].detections


def test_slow_tracker_drops_frames_and_counts_them(running):
    running.start()
    running.send()
    running.fake.gate.clear()
    images = [running.graph.image(value) for value in range(10)]
    running.images.publish(images[0])
    running.graph.spin_until(lambda: len(running.fake.calls) == 2)
    for image in images[1:]:
        running.images.publish(image)
        running.settle()
    running.fake.gate.set()
    running.graph.spin_until(lambda: running.status_headers[-1] == images[-1].header)
    # The first was at work, the last is the newest; nothing between them waited.
    answered = [header.stamp for header in running.status_headers[1:]]
    assert answered == [images[0].header.stamp, images[-1].header.stamp]
    assert running.statuses[-1].dropped_frames == 8


def test_policy_all_answers_every_frame(run):
    running = run(frame_policy='all', queue_size=3, image_reliability='reliable',
                  image_depth=0)
    running.start()
    running.send()
    images = [running.graph.image(value) for value in range(20)]
    for image in images:
        running.images.publish(image)
    running.graph.spin_until(lambda: len(running.statuses) == len(running.boxes) == 21)
    assert running.statuses[-1].dropped_frames == 0
    assert [box.header for box in running.boxes[1:]] == [image.header for image in images]


def test_stamped_init_catches_up(running):
    images = [running.graph.image(value) for value in range(6)]
    running.send(*images)
    stamp = images[2].header.stamp
    running.start_stamped((20, 12, 8, 6), stamp.sec * 10 ** 9 + stamp.nanosec)
    running.graph.spin_until(lambda: len(running.boxes) == 4)
    assert [call for call, _ in running.fake.calls] == ['initialize'] + ['update'] * 3
    assert [image[0, 0] for _, image in running.fake.calls] == [2, 3, 4, 5]
    assert [box.header for box in running.boxes] == [image.header for image in images[2:]]
    assert running.send().track_id == 1
    assert running.last_box == (24, 12, 8, 6)


def test_stamped_init_may_come_before_its_image(running):
    running.send(running.graph.image(stamp=10 ** 9))
    running.start_stamped((20, 12, 8, 6), 2 * 10 ** 9)
    assert running.send(running.graph.image(stamp=15 * 10 ** 8)).state == 'idle'
    assert running.send(running.graph.image(stamp=2 * 10 ** 9)).state == 'tracking'
    assert running.last_box == (20, 12, 8, 6)


def test_stamped_init_on_an_unknown_frame_is_refused(running):
    running.send(running.graph.image(stamp=10 ** 9), running.graph.image(stamp=2 * 10 ** 9))
    running.start_stamped((20, 12, 8, 6), 15 * 10 ** 8)
    running.graph.spin_until(lambda: running.statuses[-1].state == 'refused')
    assert 'stamp 1.500000000' in running.statuses[-1].message
    assert not running.fake.calls


def test_polygon_without_a_stamp_means_the_newest_frame(running):
    running.send(running.graph.image(4))
    running.start_stamped((20, 12, 8, 6), 0)
    running.graph.spin_until(lambda: running.boxes)
    assert (running.fake.calls[0][1] == 4).all()


def test_compressed_images(run):
    running = run((CompressedImage, 'image_raw/compressed'), image_transport='compressed')
    pixels = np.arange(48 * 64, dtype=np.uint16).reshape(48, 64)
    image = compressed_from_image(pixels, header=running.graph.image().header)
    running.start()
    assert running.send(image).state == 'tracking'
    np.testing.assert_array_equal(running.fake.calls[0][1], pixels)
    image.data = image.data[:40]
    image.header = running.graph.image().header
    assert 'truncated' in running.send(image).message


def test_health_counts(running):
    health = running.graph.listen(DiagnosticArray, '/diagnostics')
    running.start()
    running.send()
    running.fake.error = RuntimeError('out of luck')
    running.send()
    broken = running.graph.image()
    broken.encoding = 'nonsense'
    running.send(broken)
    running.send()
    count = len(health)
    running.graph.spin_until(lambda: len(health) > count + 1)
    diagnosis, = diagnoses_from_message(health[-1])
    assert diagnosis.level == Level.OK and diagnosis.name == 'lmsco_tracker'
    expected = {'state': 'idle', 'received': '4', 'tracked': '1', 'tracker_errors': '1',
                'refused': '1', 'dropped_frames': '0', 'backward_stamps': '0'}
    assert expected.items() <= diagnosis.values.items()
    assert 'nonsense' in diagnosis.values['last_error']

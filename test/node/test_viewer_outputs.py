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

"""What the node offers to viewers besides: small overlays, annotations."""

from unittest.mock import Mock

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import CompressedImage, Image

from lmsco_ros.core.types import TrackState
from lmsco_ros.node import outputs
from msg_adapters.compressed import image_from_compressed
from msg_adapters.image import image_from_message

SMALL = 'lmsco_tracker/overlay/compressed'


@pytest.fixture
def annotated(run, monkeypatch):
    """Run the node with somebody who listens to annotations, and return what is heard."""
    heard = []
    listener = Mock(publish=heard.append, get_subscription_count=lambda: 1)
    monkeypatch.setattr(outputs.Outputs, '_annotations_publisher', lambda self, made: listener)
    monkeypatch.setattr(outputs, 'annotations_from_boxes',
                        lambda boxes, **more: (list(boxes), more))
    running = run(marker_line_width=5.0)
    running.heard, running.listener = heard, listener
    return running


def test_small_overlay_is_the_overlay_as_jpeg(running):
    whole, small = (running.graph.listen(*each) for each in (
        (Image, 'lmsco_tracker/overlay'), (CompressedImage, SMALL)))
    running.start(30, 12, 16, 20)
    image = running.graph.image(1000)
    running.send(image)
    drawn = image_from_message(running.graph.answer(whole, image))
    message = running.graph.answer(small, image)
    assert 'jpeg' in message.format and len(message.data) < drawn.nbytes / 2
    assert np.abs(image_from_compressed(message).astype(int) - drawn).mean() < 8


def test_small_overlay_is_made_on_demand_and_without_the_other(running, monkeypatch):
    monkeypatch.setattr(outputs, 'draw_targets',
                        lambda *args, **kwargs: pytest.fail('nobody listens'))
    assert running.send().state == 'idle'
    monkeypatch.undo()
    monkeypatch.setattr(outputs, 'message_from_image',
                        lambda *args, **kwargs: pytest.fail('nobody listens to this one'))
    small = running.graph.listen(CompressedImage, SMALL)
    image = running.graph.image(1000)
    running.send(image)
    assert image_from_compressed(running.graph.answer(small, image)).shape == (48, 64, 3)


def test_overlay_is_not_compressed_for_those_who_take_it_whole(running, monkeypatch):
    monkeypatch.setattr(cv2, 'imencode', lambda *args: pytest.fail('nobody listens'))
    whole = running.graph.listen(Image, 'lmsco_tracker/overlay')
    image = running.graph.image(1000)
    running.send(image)
    assert running.graph.answer(whole, image).encoding == 'bgr8'


def test_annotations_name_every_target_that_is_seen(annotated):
    annotated.start(10, 12, 8, 6)
    image = annotated.graph.image()
    annotated.send(image)
    annotated.graph.spin_until(lambda: annotated.heard)
    (box,), more = annotated.heard[-1]
    assert box.box == (10, 12, 8, 6) and box.text == '1 tracking 0.75'
    assert more == {'line_width': 5.0, 'header': image.header}
    colors = [box.color]
    for state in (TrackState.UNCERTAIN, TrackState.LOST):
        annotated.fake.states, told = [state], len(annotated.heard)
        annotated.send()
        annotated.graph.spin_until(lambda: len(annotated.heard) > told)
        colors += [each.color for each in annotated.heard[-1][0]]
    # A target that is lost has no box: what was drawn goes away.
    assert annotated.heard[-1][0] == [] and len(set(colors)) == len(colors) == 2


def test_annotations_are_made_on_demand(annotated):
    annotated.listener.get_subscription_count = lambda: 0
    annotated.start()
    annotated.send()
    assert annotated.send().state == 'tracking' and not annotated.heard

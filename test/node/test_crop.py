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


"""What is cut off is unseen by the tracker, and nobody else notices."""

from dataclasses import replace

from hypothesis import given, strategies as st
import numpy as np
import pytest
from sensor_msgs.msg import Image

from lmsco_ros.core.errors import ImageError
from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.node.crop import Crop
from msg_adapters.image import image_from_message

EDGES = st.integers(0, 6)
CROP = {'crop_left': 3, 'crop_top': 2, 'crop_right': 5, 'crop_bottom': 4}


@given(st.builds(Crop, EDGES, EDGES, EDGES, EDGES))
def test_a_pixel_keeps_its_place_in_the_full_image(crop):
    image = np.arange(20 * 30).reshape(20, 30)
    remaining = crop.trim(image)
    assert np.shares_memory(remaining, image)
    assert crop.full_shape(remaining) == image.shape
    place = BoundingBox(10, 8, 1, 1)
    inside = crop.inwards(place)
    assert crop.inwards_point(place.center) == inside.center
    assert remaining[int(inside.y), int(inside.x)] == image[8, 10]
    result = TrackResult(inside, 1.0, TrackState.TRACKING, np.zeros((1, 1), np.float32), inside)
    assert crop.outwards(result).box == crop.outwards(result).search_region == place
    assert crop.outwards(result).predicted_box is None
    assert crop.outwards(replace(result, predicted_box=inside)).predicted_box == place
    filled = crop.fill((remaining % 256).astype(np.uint8))
    assert filled.shape == image.shape and filled[8, 10] == image[8, 10] % 256


@pytest.mark.parametrize('crop', [Crop(left=8), Crop(right=9), Crop(top=3, bottom=3),
                                  Crop(top=7), Crop(bottom=600)])
def test_nothing_left_is_refused(crop):
    with pytest.raises(ImageError, match='8 x 6 pixels.*lower crop_left'):
        crop.trim(np.zeros((6, 8)))


def test_node_cuts_edges_and_speaks_of_the_full_image(run):
    running = run(**CROP)
    maps = running.graph.listen(Image, 'lmsco_tracker/confidence_map')
    overlays = running.graph.listen(Image, 'lmsco_tracker/overlay')
    running.start(20, 12, 8, 6)
    message = running.graph.image(500)
    pixels = np.frombuffer(message.data, np.uint16).reshape(48, 64)
    pixels[0] = 65535
    assert running.send(message).state == 'tracking'
    assert running.last_box == (20, 12, 8, 6)
    (call, seen), = running.fake.calls
    np.testing.assert_array_equal(seen, pixels[2:-4, 3:-5])
    assert running.fake.results[1].box.as_tuple() == (17, 10, 8, 6)
    running.graph.spin_until(lambda: maps and overlays)
    confidence = image_from_message(maps[0])
    assert confidence.shape == (48, 64)
    assert set(zip(*np.nonzero(confidence))) == {
        (y, x) for y in range(12, 18) for x in range(20, 28)}
    picture = image_from_message(overlays[0])
    assert picture.shape == (48, 64, 3)
    assert picture[20:-4, 3:-5].any()
    assert not picture[-4:].any() and not picture[20:, -5:].any()


def test_image_without_anything_left_is_refused(run):
    running = run(**CROP)
    status = running.send(running.graph.image(shape=(6, 20)))
    assert status.state == 'refused' and 'crop_top' in status.message
    assert running.send().state == 'idle'

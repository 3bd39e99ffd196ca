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

"""A desk without ROS, and moments to put on it."""

import json
import struct

import numpy as np
import pytest

from lmsco_ros.console.chronicle import Chronicle
from lmsco_ros.console.desk import Desk
from lmsco_ros.console.feed import Feed, Rate
from lmsco_ros.console.frames import LiveFrames
from lmsco_ros.console.moments import Moment
from lmsco_ros.console.picture import Pictures
from msg_adapters.boxes import Box
from msg_adapters.status import FrameStatus


class FakeOperator:
    """Remembers what it was asked to do."""

    def __init__(self):
        self.asked, self.maps, self.answers = [], set(), []

    def start(self, stamp, box):
        self.asked.append(('start', stamp, box))

    def point(self, stamp, x, y):
        self.asked.append(('point', stamp, x, y))

    def select(self, track_id):
        self.asked.append(('select', track_id))

    def reset(self, answer):
        self.asked.append(('reset',))
        answer(True, 'all targets are dropped')

    def enable(self, on, answer):
        self.asked.append(('enable', on))
        answer(False, 'not active')

    def record(self, on, answer):
        self.asked.append(('record', on))
        answer(True, 'recorded')

    def want_map(self, who, wanted):
        (self.maps.add if wanted else self.maps.discard)(id(who))


@pytest.fixture
def status():
    """Return a maker of what the tracker says of a target."""
    def make(state='tracking', track_id=1, **more):
        score = 0.75 if state in ('tracking', 'uncertain') else None
        return FrameStatus(state, track_id, score, 12.5, 8.0, 3, message=state, **more)
    return make


@pytest.fixture
def moment(status):
    """Return a maker of frames: the stamp is the number, and the box moves along."""
    def make(number, state='tracking', shape=(48, 64), **fields):
        image = np.random.default_rng(number).integers(7000, 7100, shape).astype(np.uint16)
        fields = {'statuses': (status(state),), 'boxes': {1: Box(number, 12, 8, 6)}, **fields}
        return Moment(number, 10 ** 18 + number, 0.0, image, **fields)
    return make


@pytest.fixture
def feed():
    """Return what the frames for the pages are added to."""
    return Feed()


@pytest.fixture
def make_desk(feed):
    """Return a maker of desks without frames."""
    def make(**fields):
        pictures = Pictures()
        return Desk(lambda: LiveFrames(feed), Chronicle(pictures.thumbnail), pictures,
                    FakeOperator(), Rate(), Rate(), '/image_raw', **fields)
    return make


@pytest.fixture
def desk(make_desk):
    """Return a desk that pages may work on."""
    return make_desk()


@pytest.fixture
def read_frame():
    """Return what splits a frame into its state and its picture."""
    def read(data):
        (length,) = struct.unpack_from('>I', data)
        return json.loads(data[4:4 + length]), data[4 + length:]
    return read

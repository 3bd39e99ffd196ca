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

"""Stamps are read from serialized messages as from whole ones."""

from hypothesis import given, strategies as st
import numpy as np
from rosbags.typesys import get_typestore, Stores

from lmsco_ros.replay.bag_images import header_stamp, RAW, serialized_stamp
from lmsco_ros.replay.bag_maker import image_message

STORE = get_typestore(Stores.ROS2_JAZZY)


@given(st.integers(0, (1 << 31) * 1_000_000_000 - 1), st.booleans())
def test_serialized_stamp(stamp, little_endian):
    message = image_message(STORE, np.zeros((2, 3), np.uint16), stamp, 'camera')
    data = STORE.serialize_cdr(message, RAW, little_endian=little_endian)
    assert serialized_stamp(data) == header_stamp(message) == stamp

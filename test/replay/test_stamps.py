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

"""Stamps are read from serialized messages as from whole ones, and mended where they must be."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores

from lmsco_ros.replay.bag_images import RAW
from lmsco_ros.replay.bag_maker import image_message
from lmsco_ros.replay.bags.stamps import (
    END_OF_TIME, header_stamp, ImageStamps, serialized_stamp, with_stamp)
from lmsco_ros.replay.errors import SourceWarning

STORE = get_typestore(Stores.ROS2_JAZZY)


@given(st.integers(0, (1 << 31) * 1_000_000_000 - 1), st.booleans())
def test_serialized_stamp(stamp, little_endian):
    message = image_message(STORE, np.zeros((2, 3), np.uint16), stamp, 'camera')
    data = STORE.serialize_cdr(message, RAW, little_endian=little_endian)
    assert serialized_stamp(data) == header_stamp(message) == stamp


@pytest.mark.parametrize('little_endian', [True, False])
def test_another_stamp_in_a_serialized_message(little_endian):
    message = image_message(STORE, np.full((2, 3), 9, np.uint8), 5, 'camera')
    data = bytes(STORE.serialize_cdr(message, RAW, little_endian=little_endian))
    changed = with_stamp(data, 1_700_000_000_123_456_789)
    assert serialized_stamp(changed) == 1_700_000_000_123_456_789
    read = STORE.deserialize_cdr(changed, RAW)
    assert read.header.frame_id == 'camera' and read.data.tolist() == [9] * 6


@pytest.mark.filterwarnings('ignore::lmsco_ros.replay.errors.SourceWarning')
@given(st.lists(st.tuples(
    st.one_of(st.sampled_from([0, 1, 2, 3, -1, 2 ** 61]), st.integers(-2 ** 62, 2 ** 62)),
    st.one_of(st.sampled_from([0, 1, 2]), st.integers(0, 2 ** 63 - 1))), max_size=40))
def test_stamps_are_distinct_and_fit_into_messages(times):
    stamps = ImageStamps('here')
    taken = [stamps.take(*time) for time in times]
    assert len(set(taken)) == len(taken)
    for stamp, (header, _) in zip(taken, times):
        assert 0 < stamp < END_OF_TIME
        if 0 < header < 2 ** 60:
            assert 0 <= stamp - header < len(times)


def test_many_equal_stamps_take_no_time():
    stamps = ImageStamps('here')
    with pytest.warns(SourceWarning, match='images here share stamps'):
        taken = [stamps.take(5, 0) for _ in range(100_000)]
    assert taken == list(range(5, 100_005))

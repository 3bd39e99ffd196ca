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

"""Status values survive the way through a DiagnosticArray."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from hypothesis import given, strategies as st
import pytest
from std_msgs.msg import Header

from msg_adapters.errors import StatusMessageError
from msg_adapters.status import (
    diagnoses_from_message, Diagnosis, FrameStatus, FrameTimes, Level, message_from_diagnoses,
    message_from_status, message_from_statuses, Reading, status_from_message,
    statuses_from_message)

FINITE = st.floats(allow_nan=False, allow_infinity=False)
STATUSES = st.builds(
    FrameStatus, st.text(), st.integers(0), st.none() | FINITE, FINITE, FINITE, st.integers(0),
    st.sampled_from(Level), st.text(), st.none() | st.builds(FrameTimes, *[FINITE] * 4),
    st.none() | st.builds(Reading, *[FINITE] * 3), st.none() | st.builds(Reading, *[FINITE] * 3),
    st.sampled_from(['', 'accepted', 'refused']))
DIAGNOSES = st.builds(Diagnosis, st.text(), st.sampled_from(Level), st.text(),
                      st.dictionaries(st.text(), st.text()), st.text())


@given(STATUSES)
def test_frame_status_round_trip(status):
    assert status_from_message(message_from_status(status, 'node')) == status


@given(st.lists(STATUSES, min_size=1))
def test_statuses_of_several_targets_round_trip(statuses):
    message = message_from_statuses(statuses, 'node')
    assert statuses_from_message(message) == statuses
    assert status_from_message(message) == statuses[0]
    assert [entry.hardware_id for entry in message.status] == [
        f'target_{status.track_id}' if status.track_id else '' for status in statuses]


@given(st.lists(DIAGNOSES))
def test_diagnoses_round_trip(diagnoses):
    assert diagnoses_from_message(message_from_diagnoses(diagnoses)) == diagnoses


def test_message_is_readable_by_people():
    status = FrameStatus('lost', 3, 0.25, 12.5, 8.0, 4, Level.WARN, 'target lost',
                         FrameTimes(10.0, 10.25, 10.5, 11.0), Reading(30000.0, 30500.5, 31000.0),
                         Reading(26.85, 31.855, 36.85))
    message = message_from_status(status, 'lmsco_tracker', Header(frame_id='thermal'))
    entry, = message.status
    assert message.header.frame_id == 'thermal'
    assert (entry.name, entry.message) == ('lmsco_tracker', 'target lost')
    assert entry.level == DiagnosticStatus.WARN
    assert {pair.key: pair.value for pair in entry.values} == {
        'state': 'lost', 'track_id': '3', 'score': '0.25', 'latency_ms': '12.5',
        'tracker_ms': '8.0', 'dropped_frames': '4', 'received': '10.0', 'started': '10.25',
        'finished': '10.5', 'published': '11.0', 'target_minimum': '30000.0',
        'target_mean': '30500.5', 'target_maximum': '31000.0', 'target_celsius_minimum': '26.85',
        'target_celsius_mean': '31.855', 'target_celsius_maximum': '36.85'}


@pytest.mark.parametrize('message', [
    DiagnosticArray(),
    DiagnosticArray(status=[DiagnosticStatus(name='other')]),
    DiagnosticArray(status=[DiagnosticStatus(level=b'\x09')]),
])
def test_foreign_messages_are_refused(message):
    with pytest.raises(StatusMessageError):
        status_from_message(message)

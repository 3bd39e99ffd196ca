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

"""Faults are counted each, told once, and never make it worse."""

from unittest.mock import Mock

import pytest

from lmsco_ros.node import faults
from lmsco_ros.node.faults import cause, Faults


@pytest.fixture
def clock(monkeypatch):
    """Return a clock that stands still until its `now` is changed."""
    clock = Mock(now=100.0)
    monkeypatch.setattr(faults.time, 'monotonic', lambda: clock.now)
    return clock


class Notes:
    """Everything that is told of faults."""

    def __init__(self):
        self.alive, self.counted, self.log = True, [], Mock()
        self.faults = Faults(lambda: self.log, self.counted.append, lambda: self.alive)

    @property
    def errors(self):
        """The lines that a person sees."""
        return [call.args[0] for call in self.log.error.call_args_list]


def raised(error):
    """Return an error as it is when it has been raised."""
    try:
        raise error
    except type(error) as caught:
        return caught


def test_same_fault_is_counted_always_and_told_once_in_a_while(clock):
    notes = Notes()
    for _ in range(3):
        notes.faults.note('a message on /a', raised(MemoryError('no room')))
    notes.faults.note('a message on /b', raised(MemoryError('no room')))
    assert len(notes.counted) == 4 and len(notes.errors) == 2
    clock.now += 5
    notes.faults.note('a message on /a', raised(MemoryError('no room')))
    assert len(notes.errors) == 3
    assert all('the node goes on: MemoryError: no room (test_fault_log.py:' in line
               and '\n' not in line for line in notes.errors)
    assert 'Traceback' in notes.log.debug.call_args.args[0]


def test_many_different_faults_take_bounded_memory(clock):
    notes = Notes()
    for number in range(1000):
        notes.faults.note(f'work {number}', ValueError())
    assert len(notes.errors) == 1000 and len(notes.faults._told) <= 64


def test_while_ros_ends_nothing_is_told():
    notes = Notes()
    notes.alive = False
    assert notes.faults.note('work', RuntimeError('context')) == 'RuntimeError: context'
    assert not notes.counted and not notes.errors


def test_noting_never_raises():
    notes = Notes()
    notes.log.error.side_effect = MemoryError()
    assert notes.faults.note('work', ValueError('odd')) == 'ValueError'


def test_cause_is_one_line_with_the_place():
    assert cause(KeyError('x')) == "KeyError: 'x'"
    assert cause(MemoryError()) == 'MemoryError'
    assert cause(raised(OSError('one\n  two'))).startswith('OSError: one two (test_fault_log.py:')

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

"""What the doctor says of machines that lack one thing each."""

from collections import namedtuple
import shutil

import pytest

from lmsco_ros.cli import machine
from lmsco_ros.cli.machine import Finding, State
from lmsco_ros.extras import MODULES
from lmsco_ros.node import installation

Usage = namedtuple('Usage', 'total used free')


def test_every_finding_but_a_good_one_has_a_remedy(lmsco):
    findings = machine.examine({})
    assert all(bool(item.remedy) is (item.state is not State.GOOD) for item in findings)
    assert {item.name for item in findings} >= {
        'Python', 'ROS 2', 'middleware', 'profile for large images', 'shared memory', 'threads',
        'GPU', 'weights', 'this folder', *(f'extra {extra}' for extra in MODULES)}
    assert lmsco('doctor').exit_code == (
        1 if any(item.state is State.WRONG for item in machine.examine()) else 0)


@pytest.mark.parametrize('version, state', [
    ((3, 9), State.WRONG), ((3, 10), State.GOOD), ((3, 12), State.GOOD), ((3, 13), State.NOTE),
    ((3, 14), State.NOTE)])
def test_versions_of_python(version, state):
    assert machine.python(version).state is state


def test_newer_versions_are_told_what_they_are_good_for():
    assert 'for the node use Python 3.12' in machine.python((3, 13)).remedy
    assert 'tested on 3.10 to 3.13' in machine.python((3, 14)).remedy


def test_an_extra_that_is_not_whole_is_named_with_what_it_lacks(monkeypatch):
    monkeypatch.setitem(MODULES, 'eval', ('json', 'no_such_module', 'no_such.module'))
    finding = next(item for item in machine.extras() if item.name == 'extra eval')
    assert finding.said == 'lacks no_such_module, no_such.module'
    assert finding.remedy.endswith("pip install 'lmsco_ros[eval]'")


def test_what_keeps_the_node_from_running_is_told(monkeypatch):
    monkeypatch.setattr(installation, '_PACKAGES', ('no_such_package',))
    finding = machine.ros()
    assert 'no_such_package is not installed' in finding.said
    assert finding.remedy.startswith('source a ROS 2 Jazzy installation')


def test_another_middleware_is_told():
    assert machine.middleware({}).state is State.GOOD
    assert machine.middleware({'RMW_IMPLEMENTATION': 'rmw_fastrtps_cpp'}).state is State.GOOD
    finding = machine.middleware({'RMW_IMPLEMENTATION': 'rmw_cyclonedds_cpp'})
    assert finding.state is State.NOTE and 'unset RMW_IMPLEMENTATION' in finding.remedy


def test_profile_has_to_be_a_file_under_the_name_that_is_read(tmp_path):
    name = 'FASTRTPS_DEFAULT_PROFILES_FILE'
    (tmp_path / 'profile.xml').touch()
    assert machine.profile({name: str(tmp_path / 'profile.xml')}).state is State.GOOD
    assert machine.profile({name: str(tmp_path / 'none.xml')}).state is State.WRONG
    assert machine.profile({}).said == 'not set'
    assert 'not read by Jazzy' in machine.profile({'FASTDDS_DEFAULT_PROFILES_FILE': 'x'}).said


@pytest.mark.parametrize('free, state', [(1 << 20, State.NOTE), (1 << 30, State.GOOD)])
def test_shared_memory_needs_room(tmp_path, monkeypatch, free, state):
    monkeypatch.setattr(shutil, 'disk_usage', lambda folder: Usage(free, 0, free))
    assert machine.shared_memory(tmp_path).state is state
    assert 'is not there' in machine.shared_memory(tmp_path / 'none').said


@pytest.mark.parametrize('cores, limit, state', [
    (4, '', State.GOOD), (4, '4', State.GOOD), (4, '8', State.NOTE), (1, '', State.NOTE)])
def test_threads_are_judged_by_cores(monkeypatch, cores, limit, state):
    monkeypatch.setattr('os.sched_getaffinity', lambda process: set(range(cores)))
    assert machine.threads({'OMP_NUM_THREADS': limit}).state is state


def test_missing_weights_are_named(monkeypatch, tmp_path):
    monkeypatch.setenv('LMSCO_WEIGHTS_DIR', str(tmp_path))
    finding = machine.weights()
    assert finding.state is State.NOTE and 'vgg_m_2048' in finding.said
    assert 'lmsco weights fetch' in finding.remedy


def test_folder_that_cannot_be_written_is_wrong(tmp_path, monkeypatch):
    assert machine.write_access('logs', tmp_path / 'made' / 'later').state is State.GOOD
    monkeypatch.setattr('os.access', lambda path, mode: False)
    assert machine.write_access('logs', tmp_path / 'made') == Finding(
        'logs', State.WRONG, f'{tmp_path}/made cannot be written',
        f'give this user {tmp_path}, or work elsewhere')

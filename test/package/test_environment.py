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

"""Every test runs on a ROS graph of its own that does not leave the machine."""

import importlib.util
import os
from pathlib import Path
import subprocess
import sys

from hypothesis import given, settings, strategies as st
import pytest


@pytest.fixture(scope='module')
def conftest():
    """Import the configuration under test a second time, beside the one that pytest uses."""
    path = Path(__file__).resolve().parents[1] / 'conftest.py'
    spec = importlib.util.spec_from_file_location('conftest_under_test', path)
    module = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        # Importing it sets the domain; the one of this run is put back afterwards.
        for name in ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE'):
            patch.setenv(name, os.environ[name])
        spec.loader.exec_module(module)
    return module


def test_discovery_stays_on_this_machine():
    """Nothing that a test starts looks for participants on the network."""
    assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    assert 1 <= int(os.environ['ROS_DOMAIN_ID']) <= 101


@given(run=st.text(), workers=st.integers(min_value=1, max_value=64))
def test_no_two_workers_share_a_domain(conftest, run, workers):
    """The controller and all workers of one run have different domains, all of them legal."""
    names = ['master', *(f'gw{number}' for number in range(workers))]
    domains = [conftest.ros_domain_id(run, name, workers) for name in names]
    assert len(set(domains)) == len(domains)
    assert 1 <= min(domains) and max(domains) <= 101


def test_runs_spread_over_the_domains(conftest):
    """Two runs at the same time rarely meet."""
    domains = {conftest.ros_domain_id(str(run), 'gw0', 2) for run in range(200)}
    assert len(domains) > 25


def test_properties_are_not_timed():
    """A loaded machine must not fail a property test."""
    assert settings().deadline is None


def test_launch_plugins_of_ros_do_not_break_the_run(tmp_path):
    """The plug-in of an installed ROS 2 asks for an argument that pytest 9 no longer gives."""
    (tmp_path / 'old_plugin.py').write_text('def pytest_pycollect_makemodule(path, parent): ...\n')
    for name in ('launch_testing', 'launch_ros'):
        information = tmp_path / f'{name}-1.0.dist-info'
        information.mkdir()
        (information / 'METADATA').write_text(f'Name: {name}\nVersion: 1.0\n')
        (information / 'entry_points.txt').write_text(f'[pytest11]\n{name} = old_plugin\n')
    path = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get('PYTHONPATH')]))
    done = subprocess.run(
        [sys.executable, '-m', 'pytest', '--collect-only', '-q', __file__],
        env={**os.environ, 'PYTHONPATH': path}, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr

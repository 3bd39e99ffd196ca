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

"""`colcon build` and `colcon test` work, and what they install starts as a node."""

import os
from pathlib import Path
import signal
import subprocess
import sys
import time

import pytest

rclpy = pytest.importorskip('rclpy', reason='needs ROS 2')

REPOSITORY = Path(__file__).resolve().parents[2]
STARTUP_SECONDS = 100
EXIT_SECONDS = 100


def colcon(workspace, verb, *options):
    """Run a verb of colcon on the repository, with everything it writes in the workspace."""
    return subprocess.run(
        [sys.executable, '-m', 'colcon', '--log-base', 'log', verb, *options],
        cwd=workspace, capture_output=True, text=True)


@pytest.fixture(scope='module')
def workspace(tmp_path_factory):
    """Build the package in a workspace of its own; the repository stays as it is."""
    pytest.importorskip('colcon_core', reason='needs colcon')
    workspace = tmp_path_factory.mktemp('workspace')
    done = colcon(workspace, 'build', '--base-paths', str(REPOSITORY))
    assert done.returncode == 0, done.stdout + done.stderr
    return workspace


def sourced(workspace, command):
    """Return the arguments that run a command in the built workspace, with its own process id."""
    return ['bash', '-c', f'source {workspace}/install/setup.bash && exec {command}']


def wait_for_node(name, namespace, process):
    """Wait until a node is seen on the graph, from a context and node of our own."""
    context = rclpy.Context()
    rclpy.init(context=context)
    try:
        observer = rclpy.create_node('observer', context=context)
        deadline = time.monotonic() + STARTUP_SECONDS
        while (name, namespace) not in observer.get_node_names_and_namespaces():
            assert process.poll() is None, process.communicate()[0]
            assert time.monotonic() < deadline, f'{name} is not on the graph'
            time.sleep(0.05)
        observer.destroy_node()
    finally:
        rclpy.shutdown(context=context)


def test_ros_finds_the_package(workspace):
    """The files are where `ros2 run`, `ros2 launch` and the resource index look."""
    prefix = workspace / 'install' / 'lmsco_ros'
    assert (prefix / 'share/ament_index/resource_index/packages/lmsco_ros').is_file()
    assert (prefix / 'share/lmsco_ros/package.xml').is_file()
    assert (prefix / 'share/lmsco_ros/launch/tracker.launch.py').is_file()
    assert (prefix / 'share/lmsco_ros/config/tracker.yaml').is_file()
    assert (prefix / 'share/lmsco_ros/launch/console.launch.py').is_file()
    for program in ('tracker_node', 'console'):
        assert (prefix / 'lib/lmsco_ros' / program).stat().st_mode & 0o111


def test_installed_code_is_what_runs(workspace):
    """Sourcing the workspace puts its copy before any other."""
    code = '"import lmsco_ros, msg_adapters; print(lmsco_ros.__file__, msg_adapters.__file__)"'
    done = subprocess.run(
        sourced(workspace, f'{sys.executable} -c {code}'), cwd=workspace,
        capture_output=True, text=True, check=True)
    assert all(path.startswith(str(workspace / 'install')) for path in done.stdout.split())


@pytest.mark.parametrize('stop', [signal.SIGINT, signal.SIGTERM])
def test_installed_node_starts_and_stops(workspace, stop):
    """`lib/lmsco_ros/tracker_node` appears on the graph and leaves it without a traceback."""
    executable = workspace / 'install/lmsco_ros/lib/lmsco_ros/tracker_node'
    # The graph may still remember a node of another test by its usual name.
    namespace = f'/{stop.name.lower()}_{os.getpid()}'
    with subprocess.Popen(
            sourced(workspace, f'{executable} --ros-args -r __ns:={namespace}'), cwd=workspace,
            text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        try:
            wait_for_node('lmsco_tracker', namespace, process)
            process.send_signal(stop)
            output, _ = process.communicate(timeout=EXIT_SECONDS)
        finally:
            process.kill()
    assert process.returncode == 0, output
    assert 'Traceback' not in output


def test_colcon_test_runs_pytest(workspace):
    """One quick test file stands for all, so that this test never meets itself."""
    done = colcon(
        workspace, 'test', '--base-paths', str(REPOSITORY), '--return-code-on-test-failure',
        '--pytest-args', 'test/package/test_environment.py')
    assert done.returncode == 0, done.stdout + done.stderr
    result = colcon(workspace, 'test-result', '--all')
    assert '0 errors, 0 failures' in result.stdout
    assert 'Summary: 0 tests' not in result.stdout

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

"""What is imported when, seen in fresh processes: nothing that is not needed for what is asked."""

from pathlib import Path
import subprocess
import sys

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
OF_EXTRAS = {'av', 'backports', 'dask', 'distributed', 'google', 'jinja2', 'lz4', 'matplotlib',
             'platformdirs', 'requests', 'rich', 'rosbags', 'scipy.io', 'starlette', 'typer',
             'urllib3', 'uvicorn', 'websockets'}
HCS_AT_WORK = """
import numpy as np
from lmsco_ros.core import LMSCOTracker

image = np.random.default_rng(1).integers(0, 255, (96, 128), np.uint8)
tracker = LMSCOTracker('hcs')
tracker.initialize(image, (50, 40, 24, 24))
tracker.update(image)
"""
TRACKER = 'from lmsco_ros.core import LMSCOTracker; LMSCOTracker({!r})'
NODE = """
import rclpy
from rclpy.parameter import Parameter
from lmsco_ros.node.tracker_node import TrackerNode

context = rclpy.Context()
rclpy.init(context=context)
node = TrackerNode(context=context, namespace='light',
                   parameter_overrides=[Parameter('preset', value='{}')])
assert node.is_active
node.destroy_node()
rclpy.shutdown(context=context)
"""


def imported_by(code):
    """Return the names of all modules that a process has imported once it has run the code."""
    done = subprocess.run(
        [sys.executable, '-c', f'{code}\nimport sys; print("modules", *sys.modules)'],
        cwd=REPOSITORY, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (line,) = (line for line in done.stdout.splitlines() if line.startswith('modules '))
    return set(line.split())


@pytest.mark.parametrize('code, needless', [
    ('import lmsco_ros.core', OF_EXTRAS | {'safetensors', 'torch'}),
    (TRACKER.format('hcs'), OF_EXTRAS | {'safetensors', 'torch'}),
    (HCS_AT_WORK, OF_EXTRAS | {'safetensors', 'torch'}),
    (TRACKER.format('default'), OF_EXTRAS),
    ('import lmsco_ros.core.weights.acquisition', OF_EXTRAS),
    ('import lmsco_ros.cli.main', OF_EXTRAS | {'numpy', 'torch'}),
    ('import lmsco_ros.visualization, lmsco_ros.media.video', OF_EXTRAS | {'torch'}),
])
def test_libraries_are_imported_when_they_are_used(code, needless):
    assert not imported_by(code) & needless


@pytest.mark.parametrize('preset, needless', [
    ('hcs', OF_EXTRAS | {'safetensors', 'torch'}), ('default', OF_EXTRAS)])
def test_a_node_at_work_has_imported_what_its_tracker_needs(preset, needless):
    pytest.importorskip('rclpy', reason='needs ROS 2')
    assert not imported_by(NODE.format(preset)) & needless


def test_what_is_imported_is_seen():
    """Or else the tests above would pass on anything."""
    assert imported_by(TRACKER.format('default')) >= {'numpy', 'safetensors', 'torch'}

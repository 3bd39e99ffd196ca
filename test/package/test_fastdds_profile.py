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

"""The Fast DDS profile is understood by the middleware and gives images enough shared memory."""

import os
from pathlib import Path
import re
import subprocess
import sys

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

PROFILE = Path(__file__).resolve().parents[2] / 'config' / 'fastdds_large_images.xml'
SEGMENT_BYTES = 32 * 2 ** 20
SHOW_MEMORY = """\
import rclpy
rclpy.init()
node = rclpy.create_node('probe')
print(open('/proc/self/maps').read())
node.destroy_node()
rclpy.shutdown()
"""


def largest_segment(**environment):
    """Return the size of the largest Fast DDS segment that a new process maps, and its errors."""
    inherited = {key: value for key, value in os.environ.items()
                 if key != 'FASTRTPS_DEFAULT_PROFILES_FILE'}
    done = subprocess.run(
        [sys.executable, '-c', SHOW_MEMORY], env={**inherited, **environment},
        capture_output=True, text=True, check=True)
    spans = re.findall(r'^(\w+)-(\w+) .*/fast(?:rtps|dds)_', done.stdout, re.M)
    return max((int(end, 16) - int(start, 16) for start, end in spans), default=0), done.stderr


@pytest.mark.skipif(
    os.environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp') != 'rmw_fastrtps_cpp',
    reason='another middleware is chosen')
def test_profile_enlarges_the_shared_memory_segment():
    """A 640x512 16-bit image does not fit the default segment; dozens fit this one."""
    default, _ = largest_segment()
    enlarged, errors = largest_segment(FASTRTPS_DEFAULT_PROFILES_FILE=str(PROFILE))
    assert default < SEGMENT_BYTES <= enlarged
    assert 'XML' not in errors

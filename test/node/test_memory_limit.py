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

"""A process whose memory is short gives up an image, and goes on."""

import os
from pathlib import Path
import resource
import subprocess
import sys

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import pytest
from sensor_msgs.msg import Image

from msg_adapters.image import message_from_image
from msg_adapters.status import diagnoses_from_message, status_from_message

REPOSITORY = Path(__file__).resolve().parents[2]
_MEBIBYTE = 2 ** 20


@pytest.fixture
def process(own_graph):
    """Run the node in a process of its own, beside the graph."""
    process = subprocess.Popen(
        [sys.executable, '-m', 'lmsco_ros.node.main', '--ros-args', '-r',
         f'__ns:={own_graph.namespace}', '-p', 'image_reliability:=reliable'], cwd=REPOSITORY,
        env={**os.environ, 'OMP_NUM_THREADS': '1'})
    yield process
    process.kill()
    process.wait()


def limit_memory(process, spare):
    """Allow a process so many bytes more than it has."""
    size = next(int(line.split()[1]) for line in Path(
        f'/proc/{process.pid}/status').read_text().splitlines() if line.startswith('VmSize'))
    resource.prlimit(process.pid, resource.RLIMIT_AS, (size * 1024 + spare,) * 2)


@pytest.mark.slow
def test_image_without_memory_for_it_costs_that_image(own_graph, process):
    images = own_graph.publisher(Image, 'image_raw')
    health = own_graph.listen(DiagnosticArray, '/diagnostics', connected=False)
    statuses = own_graph.listen(DiagnosticArray, 'lmsco_tracker/status')
    small = message_from_image(np.zeros((48, 64), np.uint8))

    def answered():
        """Send a small image, and tell whether the last one was answered."""
        images.publish(small)
        own_graph.executor.spin_once(timeout_sec=0.05)
        return statuses and status_from_message(statuses[-1]).state == 'idle'

    own_graph.spin_until(answered)
    # There is room to receive it, and none to make a message of it.
    limit_memory(process, 175 * _MEBIBYTE)
    images.publish(message_from_image(np.zeros((40 * 1024, 1024), np.uint8)))
    own_graph.spin_until(lambda: 'Memory' in last_error(health))
    statuses.clear()
    own_graph.spin_until(answered)
    assert process.poll() is None


def last_error(health):
    """Return what the last health report tells of the last error."""
    if not health:
        return ''
    return diagnoses_from_message(health[-1])[0].values.get('last_error', '')

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

"""A TraX server in a process of its own is evaluated like any other tracker."""

import os
import shlex
import sys

import numpy as np
import pytest

from lmsco_ros.core import BoundingBox
from lmsco_ros.evaluation.errors import TrackerError
from lmsco_ros.evaluation.trackers import resolve

# Answers with the start box moved right by one pixel a frame, and its level as confidence.
SERVER = """
import sys
import trax

channels = ['ir']
with trax.Server([trax.Region.RECTANGLE], [trax.Image.MEMORY], channels) as server:
    while True:
        request = server.wait()
        if request.type in ('quit', 'error'):
            break
        image = request.image['ir'].array()
        if request.type == 'initialize':
            x, y, width, height = request.objects[0][0].bounds()
            properties = {}
        else:
            x += 1
            properties = {'confidence': float(image.mean() / 255)}
        server.status([(trax.Rectangle.create(x, y, width, height), properties)])
"""


def test_an_external_tracker_answers_with_boxes_and_confidence(tmp_path):
    pytest.importorskip('trax')
    (tmp_path / 'server.py').write_text(SERVER, encoding='utf-8')
    command = shlex.join([sys.executable, str(tmp_path / 'server.py')])
    spec = resolve(f'trax:mover={command}')
    assert spec.name == 'mover'
    tracker = spec.build()
    image = np.full((48, 64), 51, np.uint8)
    for start in (10, 20):
        tracker.initialize(image, BoundingBox(start, 5, 8, 6))
        assert tracker.update(image).box.as_tuple() == (start + 1, 5, 8, 6)
        answer = tracker.update(image)
        assert answer.box.x == start + 2
        assert answer.score == pytest.approx(0.2)
    process = tracker._process
    tracker.close()
    assert process.returncode is not None


def test_a_command_that_is_no_tracker_is_named(tmp_path):
    pytest.importorskip('trax')
    tracker = resolve(f'trax:silent={shlex.quote(sys.executable)} -c pass').build()
    with pytest.raises(TrackerError, match='did not start'):
        tracker.initialize(np.zeros((48, 64), np.uint8), BoundingBox(1, 1, 8, 6))
    tracker.close()


def test_the_missing_library_is_named_with_its_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, 'trax', None)
    with pytest.raises(TrackerError, match='pip install'):
        resolve(f'trax:any={os.devnull}').build()


@pytest.mark.parametrize(('command', 'reason'), [
    ('/no/such/program --fast', "'any': there is no program '/no/such/program'"),
    ("'", 'no command line that can be read'), ('', 'no command line that can be read'),
])
def test_a_server_that_cannot_start_is_told_before_anything_runs(command, reason):
    pytest.importorskip('trax', reason='needs the extra [vot]')
    with pytest.raises(TrackerError, match=reason):
        resolve(f'trax:any={command}').build()

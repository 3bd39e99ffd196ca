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

"""What is public is on its page; a name that goes was deprecated before (RELEASING.md)."""

import importlib.util
from pathlib import Path
import re

import pytest

from lmsco_ros import core
import msg_adapters

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = (REPOSITORY / 'docs' / 'public_api.md').read_text(encoding='utf-8')
# What most programs use: written here a second time, so that the page cannot lose it.
CORNERSTONES = {
    'LMSCOTracker.initialize(image, box, time=)', 'LMSCOTracker.update(image, time=)',
    'LMSCOTracker.learn()', 'MultiTracker.learn()',
    'TrackResult.box', 'TrackResult.score', 'TrackResult.state', 'TrackResult.predicted_box',
    'TrackState.LOST', 'TrackerConfig.preset(name)', 'MultiTracker.ids', 'ConfigError(LMSCOError)',
    'image.image_from_message(message)', 'boxes.polygon_from_box(box, header=)',
    'preset: default', 'preset: paper', 'extent.network', 'lmsco track --init',
    'lmsco evaluate --tracker', 'lmsco weights fetch NAME', 'lmsco doctor',
    'topic ~/box out geometry_msgs/msg/PolygonStamped', 'service ~/reset std_srvs/srv/Trigger',
    'parameter frame_policy',
    'boxes.csv: frame, stamp, x, y, width, height, score, state, id, note', 'record: boxes'}


@pytest.fixture(scope='module')
def script():
    """Import the script, which belongs to no package."""
    path = REPOSITORY / 'scripts' / 'public_api.py'
    spec = importlib.util.spec_from_file_location('public_api', path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def names_of(page):
    """Return the names on a page."""
    return {line for block in re.findall(r'```text\n(.*?)```', page, re.S)
            for line in block.splitlines()}


def test_nothing_public_has_gone_or_come_unseen(script):
    there, listed = names_of(script.page()), names_of(PAGE)
    assert not listed - there, 'gone without a deprecation (RELEASING.md)'
    assert not there - listed, 'new: a promise; run: python scripts/public_api.py'
    assert script.page() == PAGE


def test_the_page_has_what_everybody_uses():
    assert not CORNERSTONES - names_of(PAGE)


def test_a_parameter_that_is_renamed_is_seen(script, monkeypatch):
    def update(self, picture, time=None):
        """Take the place of the method."""
    monkeypatch.setattr(core.LMSCOTracker, 'update', update)
    assert 'LMSCOTracker.update(picture, time=)' in set(script.python_names())


def test_a_name_that_is_no_longer_exported_is_seen(script, monkeypatch):
    monkeypatch.setattr(core, '__all__', [name for name in core.__all__ if name != 'TimeError'])
    gone = names_of(PAGE) - names_of(script.page())
    assert gone == {'TimeError(LMSCOError)'}


def test_whatever_is_exported_is_there():
    assert all(hasattr(core, name) for name in core.__all__)


def test_adapters_say_whose_they_are():
    assert msg_adapters.PART_OF == 'lmsco_ros'

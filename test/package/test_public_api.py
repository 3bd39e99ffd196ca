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

"""What is public is there; a name that goes was deprecated before (RELEASING.md)."""

from inspect import getmembers, isfunction

import pytest

from lmsco_ros import core
from lmsco_ros.cli.main import build_app
from lmsco_ros.core import TrackerConfig
import msg_adapters

NAMES = {
    'BoundingBox', 'BoxError', 'BusyError', 'ConfigError', 'ImageError', 'LMSCOError',
    'LMSCOTracker', 'MultiTracker', 'NotInitializedError', 'PointError', 'TimeError',
    'TrackerConfig', 'TrackResult', 'TrackState', 'UnknownTargetError', 'WeightsError'}
RESULT = {'box', 'score', 'state', 'confidence_map', 'search_region', 'predicted_box', 'velocity',
          'covariance'}
PRESETS = {'default', 'paper', 'hcs', 'a', 'ma', 'mas'}
COMMANDS = {'track', 'replay', 'make-bag', 'demo', 'console', 'evaluate', 'results', 'config',
            'weights', 'doctor'}


def test_names_of_the_core_are_those_of_the_list():
    """A new one belongs to the list, from which it can only go by a first number."""
    assert set(core.__all__) == NAMES
    assert all(hasattr(core, name) for name in NAMES)


@pytest.mark.parametrize('name', sorted(RESULT))
def test_results_have_their_fields(name):
    assert name in core.TrackResult.__dataclass_fields__ or hasattr(core.TrackResult, name)


def test_the_tracker_has_its_methods():
    methods = {name for name, _ in getmembers(core.LMSCOTracker, isfunction)}
    assert {'initialize', 'update', 'reset'} <= methods


def test_presets_and_commands_are_there():
    app = build_app()
    named = {command.name or command.callback.__name__.replace('_', '-')
             for command in app.registered_commands}
    assert PRESETS <= set(TrackerConfig.preset_names())
    assert COMMANDS <= named | {group.name for group in app.registered_groups}


def test_adapters_say_whose_they_are():
    assert msg_adapters.PART_OF == 'lmsco_ros'

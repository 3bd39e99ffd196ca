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

"""The command that shows configurations."""

import pytest

from lmsco_ros.core import TrackerConfig


@pytest.mark.parametrize('name', TrackerConfig.preset_names())
def test_what_is_shown_is_the_configuration(lmsco, tmp_path, name):
    outcome = lmsco('config', 'show', '--preset', name)
    (tmp_path / 'shown.yaml').write_text(outcome.output)
    assert outcome.exit_code == 0
    assert TrackerConfig.from_yaml(tmp_path / 'shown.yaml') == TrackerConfig.preset(name)


def test_values_of_a_file_are_shown_among_the_others(lmsco, tmp_path):
    (tmp_path / 'mine.yaml').write_text('{preset: hcs, search: {tiles: 7}}')
    outcome = lmsco('config', 'show', '--config', tmp_path / 'mine.yaml')
    assert 'tiles: 7' in outcome.output and 'memory_size: 30' in outcome.output


def test_unknown_preset_is_told(lmsco):
    outcome = lmsco('config', 'show', '--preset', 'hsc')
    assert outcome.exit_code == 2 and 'expected one of default' in outcome.words

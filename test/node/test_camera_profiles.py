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

"""Every camera profile loads into the parameters of the node, and says where it is from."""

from pathlib import Path
import re

import pytest
import yaml

from lmsco_ros.node.parameters import Settings
from lmsco_ros.node.target_temperature import celsius
from msg_adapters.status import Reading

CONFIG = Path(__file__).resolve().parents[2] / 'config'
PROFILES = sorted((CONFIG / 'cameras').glob('*.yaml'))
# What the manuals say: a count, and the degrees Celsius that it stands for.
TOLD = {
    'lepton': (27315, 0.0),
    'boson': (31015, 37.0),
    'flir_a': (50000, 226.85),
    'flir_ax5': (16384, 382.21),
    'optris': (1259, 25.9),
    'seek': (36.6, 36.6),
}


@pytest.fixture(params=PROFILES, ids=lambda path: path.stem)
def profile(request):
    """Return the path of a profile."""
    return request.param


def test_profile_is_loaded_behind_the_parameter_file(graph, capfd, profile):
    (told,) = yaml.safe_load(profile.read_text()).values()
    node = graph.start_tracker(cli_args=[
        '--ros-args', '--params-file', str(CONFIG / 'tracker.yaml'),
        '--params-file', str(profile)])
    assert node.is_active
    for name, value in told['ros__parameters'].items():
        assert getattr(node.settings, name) == value
        assert isinstance(value, type(getattr(Settings(), name)))
    errors = capfd.readouterr().err
    assert 'unknown' not in errors and 'nothing for this node' not in errors


def test_count_of_the_manual_is_its_temperature(graph, profile):
    node = graph.start_tracker(cli_args=['--ros-args', '--params-file', str(profile)])
    count, degrees = TOLD[profile.stem]
    settings = node.settings
    told = celsius(Reading(count, count, count), settings.radiometric_scale,
                   settings.radiometric_offset)
    assert told.mean == pytest.approx(degrees, abs=0.01)


def test_profile_names_its_source_and_its_use(profile):
    head = profile.read_text().split('/**/')[0]
    assert re.search(r'^# Source: \S+', head, re.M)
    # What nobody could look up is told from what was.
    assert re.search(r'^# Not verified: \S+', head, re.M)
    assert f'cameras/{profile.name}' in head and f'camera_profile:={profile.stem}' in head
    assert re.search(r'\d+ *\n?#? *Hz', head)

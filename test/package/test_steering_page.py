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

"""What docs/steering.md says of topics, of cameras and to robot_localization is so."""

from pathlib import Path
import re

import numpy as np
import pytest
import yaml

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = (REPOSITORY / 'docs' / 'steering.md').read_text()
PROFILES = {path.stem: yaml.safe_load(path.read_text())['/**/lmsco_tracker']['ros__parameters']
            for path in (REPOSITORY / 'config' / 'cameras').glob('*.yaml')}
# Of a state of robot_localization.
NAMES = ('x', 'y', 'z', 'roll', 'pitch', 'yaw', 'vx', 'vy', 'vz', 'vroll', 'vpitch', 'vyaw',
         'ax', 'ay', 'az')


def rows(heading):
    """Return the rows of the first table below a heading, as lists of cells."""
    section = PAGE.split(f'{heading}\n')[1].split('\n## ')[0]
    lines = [line for line in section.splitlines() if line.startswith('|')][2:]
    return [[cell.strip() for cell in line.strip('|').split('|')] for line in lines]


@pytest.fixture(scope='module')
def filter_parameters():
    """Return the parameters of the filter."""
    block, = re.findall(r'```yaml\n(.*?)```', PAGE, re.S)
    return yaml.safe_load(block)['ekf_target']['ros__parameters']


def test_filter_takes_position_and_velocity_of_the_first_target(filter_parameters):
    pytest.importorskip('nav_msgs', reason='needs ROS 2')
    from msg_adapters.state import odometry_from_state, State, UNKNOWN
    state = odometry_from_state(State(1, (5.0, 6.0), np.eye(2), (7.0, 8.0), np.eye(2)))
    assert filter_parameters['base_link_frame'] == state.child_frame_id
    assert filter_parameters['world_frame'] == filter_parameters['odom_frame']
    assert filter_parameters['odom0'] == '/lmsco_tracker/state'
    taken = {name for name, is_taken in zip(
        NAMES, filter_parameters['odom0_config'], strict=True) if is_taken}
    known = {f'{prefix}{axis}' for prefix, covariance in (
        ('', state.pose.covariance), ('v', state.twist.covariance))
        for axis, variance in zip('xyz', np.diag(np.reshape(covariance, (6, 6))))
        if variance < UNKNOWN}
    assert taken == known == {'x', 'y', 'vx', 'vy'}


def test_noise_of_the_filter_moves_what_is_told_and_turns_nothing(filter_parameters):
    noise = dict(zip(NAMES, filter_parameters['process_noise_covariance'], strict=True))
    # A number such as 1e-9 without a point is a text for YAML 1.1.
    assert all(isinstance(value, float) and value > 0 for value in noise.values())
    moved = {name for name, value in noise.items() if value > 1e-6}
    assert moved == {'x', 'y', 'vx', 'vy'}
    example = (REPOSITORY / 'examples' / 'ros_kalman.py').read_text()
    assert f'MANEUVERS, SHARED = {noise["vx"]}, ' in example


def test_topics_are_those_of_the_readme():
    readme = (REPOSITORY / 'README.md').read_text()
    told = re.findall(r'`(~/\w+)`', PAGE)
    assert {'~/state', '~/predicted_box', '~/bearing', '~/box', '~/boxes'} <= set(told)
    assert all(f'| `{topic}` | out |' in readme for topic in told)


def test_table_of_cameras_is_that_of_the_profiles():
    table = {name.strip('`'): formula for name, _, formula in rows('## Cameras')}
    assert set(table) == set(PROFILES)
    for name, formula in table.items():
        scale, offset = (PROFILES[name][f'radiometric_{word}'] for word in ('scale', 'offset'))
        for v in (0.0, 1000.0, 30000.0):
            told = eval(re.sub(r'(\d) v', r'\1 * v', formula), {'v': v})
            assert told == pytest.approx(scale * v + offset)

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


"""Parameters: what is declared, what is refused, what may change, and the shipped file."""

from dataclasses import fields
from pathlib import Path

import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter
from rclpy.qos import HistoryPolicy, ReliabilityPolicy
import yaml

from lmsco_ros.core.errors import ConfigError
from lmsco_ros.node.parameters import LIVE, Settings
from lmsco_ros.node.tracker_factory import make_tracker, tracker_config

CONFIG = Path(__file__).resolve().parents[2] / 'config' / 'tracker.yaml'
# Declared by rclpy for every node.
BUILT_IN = {'use_sim_time', 'start_type_description_service'}


def test_shipped_file_names_every_parameter_with_its_default(graph):
    shipped = yaml.safe_load(CONFIG.read_text())['/**/lmsco_tracker']['ros__parameters']
    node = graph.start_tracker(autostart=True)
    declared = {name: parameter.value for name, parameter in node._parameters.items()
                if name not in BUILT_IN}
    assert shipped == declared
    assert {type(value) for value in shipped.values()} == {bool, int, float, str}
    assert [type(shipped[name]) for name in declared] == [type(v) for v in declared.values()]


def test_shipped_file_is_read_by_ros(graph):
    node = graph.start_tracker(cli_args=['--ros-args', '--params-file', str(CONFIG)])
    assert node.settings == Settings()


def test_every_parameter_is_described_within_its_limits(graph):
    node = graph.start_tracker()
    for item in fields(Settings):
        descriptor = node.describe_parameter(item.name)
        assert descriptor.description.endswith('.')
        for limits in [*descriptor.integer_range, *descriptor.floating_point_range]:
            assert limits.from_value <= item.default <= limits.to_value


@pytest.mark.parametrize('name, value', [
    ('image_depth', -1), ('image_depth', 'many'), ('frame_policy', 'newest'),
    ('image_reliability', 'yes'), ('no_image_timeout', 0.0), ('threads', 1000),
    ('image_transport', 'theora'),
])
def test_wrong_values_are_refused_at_the_start(graph, name, value):
    with pytest.raises(ParameterException, match=name):
        graph.start_tracker(**{name: value})


@pytest.mark.parametrize('name', sorted(LIVE))
def test_live_parameters_change_while_running(graph, name):
    node = graph.start_tracker()
    value = {str: 'text', int: 3, float: 4.5}[type(getattr(Settings(), name))]
    result, = node.set_parameters([Parameter(name, value=value)])
    assert result.successful, result.reason
    assert getattr(node.settings, name) == value


def test_other_parameters_say_when_they_can_be_changed(graph):
    node = graph.start_tracker()
    request = [Parameter('frame_policy', value='all').to_parameter_msg()]
    result, = graph.call(SetParameters, 'lmsco_tracker/set_parameters',
                         parameters=request).results
    assert not result.successful and 'clean up' in result.reason
    node.trigger_deactivate()
    node.trigger_cleanup()
    result, = graph.call(SetParameters, 'lmsco_tracker/set_parameters',
                         parameters=request).results
    assert result.successful
    node.trigger_configure()
    assert node.settings.frame_policy == 'all'


def test_wrong_live_values_are_refused(graph):
    node = graph.start_tracker(autostart=False)
    result, = node.set_parameters([Parameter('overlay_interval', value=0)])
    assert not result.successful
    result, = node.set_parameters([Parameter('frame_policy', value='some')])
    assert not result.successful and 'latest, all' in result.reason
    for parameter in (Parameter('autostart', value=True),
                      Parameter('tracker_config', value='/etc/passwd')):
        result, = node.set_parameters([parameter])
        assert not result.successful and 'read-only' in result.reason


@pytest.mark.parametrize('name, policy', [
    ('best_effort', ReliabilityPolicy.BEST_EFFORT), ('reliable', ReliabilityPolicy.RELIABLE)])
def test_reliability_and_depth_reach_the_subscription(graph, name, policy):
    node = graph.start_tracker(image_reliability=name, image_depth=7)
    info, = node.get_subscriptions_info_by_topic('/image_raw')
    assert info.qos_profile.reliability == policy
    profile, = [s.qos_profile for s in node.subscriptions if s.topic_name == '/image_raw']
    assert profile.depth == 7


def test_depth_zero_keeps_everything(graph):
    node = graph.start_tracker(image_depth=0)
    profile, = [s.qos_profile for s in node.subscriptions if s.topic_name == '/image_raw']
    assert profile.history == HistoryPolicy.KEEP_ALL


def test_preset_file_device_and_threads_make_the_tracker_config(tmp_path):
    path = tmp_path / 'tracker.yaml'
    path.write_text('preset: hcs\nlearning: {update_interval: 7}\nruntime: {threads: 2}\n')
    config = tracker_config(Settings(tracker_config=str(path)))
    assert (config.learning.update_interval, config.runtime.threads) == (7, 2)
    config = tracker_config(Settings(tracker_config=str(path), threads=3, device='cuda'))
    assert (config.runtime.threads, config.runtime.device) == (3, 'cuda')


@pytest.mark.parametrize('values, words', [
    ({'preset': 'best'}, ['best', 'default']),
    ({'tracker_config': '/nowhere.yaml'}, ['/nowhere.yaml']),
])
def test_wrong_tracker_leaves_the_node_unconfigured(graph, values, words):
    with pytest.raises(ConfigError) as error:
        tracker_config(Settings(**values))
    assert all(word in str(error.value) for word in words)
    node = graph.start_tracker(tracker_factory=make_tracker, **values)
    assert not node.is_active
    assert node._state_machine.current_state[1] == 'unconfigured'

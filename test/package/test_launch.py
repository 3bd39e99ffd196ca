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

"""The launch file offers its arguments and hands them on to the one node."""

from dataclasses import fields
import importlib.util
from pathlib import Path
import sys
from types import ModuleType

import pytest
import yaml

from lmsco_ros.console.settings import ConsoleSettings

REPOSITORY = Path(__file__).resolve().parents[2]
LAUNCH_FILE = REPOSITORY / 'launch' / 'tracker.launch.py'
PAN_TILT_FILE = REPOSITORY / 'examples' / 'launch' / 'pan_tilt.launch.py'
ARGUMENTS = {'params_file', 'camera_profile', 'image_topic', 'camera_info_topic', 'namespace',
             'use_large_image_profile'}
CONSOLE_FILE = REPOSITORY / 'launch' / 'console.launch.py'


class Recorded:
    """Stands for any launch class: remembers how it was made."""

    def __init__(self, *positional, **named):
        self.positional = positional
        self.named = named


def load(file=LAUNCH_FILE):
    """Import a launch file and return its description."""
    spec = importlib.util.spec_from_file_location('launch_file', file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.generate_launch_description()


@pytest.fixture
def entities(monkeypatch):
    """Return {class name: [recorded, ...]} with stand-ins for the launch packages."""
    names = {
        'launch': ['LaunchDescription'],
        'launch.actions': ['DeclareLaunchArgument', 'SetEnvironmentVariable'],
        'launch.conditions': ['IfCondition'],
        'launch.substitutions': [
            'EqualsSubstitution', 'IfElseSubstitution', 'LaunchConfiguration'],
        'launch_ros': [],
        'launch_ros.actions': ['Node'],
    }
    for module_name, classes in names.items():
        module = ModuleType(module_name)
        for name in classes:
            setattr(module, name, type(name, (Recorded,), {}))
        monkeypatch.setitem(sys.modules, module_name, module)
    found = {}
    for entity in load().positional[0]:
        found.setdefault(type(entity).__name__, []).append(entity)
    return found


def test_arguments_are_declared_with_descriptions(entities):
    """`ros2 launch --show-args` explains each of them."""
    declared = {item.positional[0]: item.named for item in entities['DeclareLaunchArgument']}
    assert set(declared) == ARGUMENTS
    assert all(item['description'] for item in declared.values())


def test_default_files_exist(entities):
    """Both files lie where the launch file looks, in the source tree as in the installation."""
    declared = {item.positional[0]: item.named for item in entities['DeclareLaunchArgument']}
    assert Path(declared['params_file']['default_value']).is_file()
    (variable,) = entities['SetEnvironmentVariable']
    assert variable.positional[0] == 'FASTRTPS_DEFAULT_PROFILES_FILE'
    assert Path(variable.positional[1]).is_file()
    assert variable.named['condition'].positional[0].positional == ('use_large_image_profile',)


def test_node_takes_every_argument(entities):
    """The executable of this package, with parameters, namespace and image topic handed on."""
    (node,) = entities['Node']
    assert (node.named['package'], node.named['executable']) == ('lmsco_ros', 'tracker_node')
    assert node.named['namespace'].positional == ('namespace',)
    assert node.named['name'] == 'lmsco_tracker'
    assert node.named['parameters'][0].positional == ('params_file',)
    remapped = {topic: value.positional for topic, value in node.named['remappings']}
    assert remapped == {'image_raw': ('image_topic',), 'camera_info': ('camera_info_topic',)}


def test_camera_profile_counts_more_than_the_parameter_file(entities):
    """It comes behind that, or that itself again where there is none."""
    (node,) = entities['Node']
    _, profile = node.named['parameters']
    (condition,) = profile.positional
    assert (condition.positional[0].positional, condition.positional[1]) == (
        ('camera_profile',), 'none')
    assert profile.named['if_value'].positional == ('params_file',)
    folder, name, suffix = profile.named['else_value']
    assert name.positional == ('camera_profile',)
    declared, = (item.named for item in entities['DeclareLaunchArgument']
                 if item.positional == ('camera_profile',))
    assert declared['default_value'] == 'none' and {'lepton', 'boson'} < set(declared['choices'])
    assert all(Path(folder + choice + suffix).is_file() for choice in declared['choices'][1:])


def test_profile_is_set_before_the_node_starts(monkeypatch, entities):
    """Launch runs its entities in order, and the node inherits what was set before it."""
    order = [type(entity).__name__ for entity in load().positional[0]]
    assert order.index('SetEnvironmentVariable') < order.index('Node')


def test_real_launch_accepts_the_description():
    """Where ROS 2 is installed its own classes take the same description."""
    pytest.importorskip('launch_ros', reason='launch comes with an installed ROS 2')
    description = load()
    assert {argument.name for argument in description.get_launch_arguments()} == ARGUMENTS


def test_head_is_started_beside_the_tracker(entities, monkeypatch):
    """The example is run by this Python, and the tracker comes from its own launch file."""
    actions, sources = sys.modules['launch.actions'], ModuleType('launch.sources')
    for module, names in ((actions, ('ExecuteProcess', 'IncludeLaunchDescription')),
                          (sources, ('PythonLaunchDescriptionSource',))):
        for name in names:
            setattr(module, name, type(name, (Recorded,), {}))
    monkeypatch.setitem(sys.modules, 'launch.launch_description_sources', sources)
    included, head = load(PAN_TILT_FILE).positional[0]
    assert included.positional[0].positional == (str(LAUNCH_FILE),)
    python, program = head.named['cmd']
    assert python == sys.executable and Path(program).name == 'ros_pan_tilt.py'
    assert Path(program).is_file()


@pytest.fixture
def console(entities, monkeypatch):
    """Return what the launch file of the console starts, with stand-ins for the packages."""
    sources, descriptions = ModuleType('launch.sources'), ModuleType('launch_ros.descriptions')
    for module, name in ((sys.modules['launch.actions'], 'IncludeLaunchDescription'),
                         (sources, 'PythonLaunchDescriptionSource'),
                         (descriptions, 'ParameterValue')):
        setattr(module, name, type(name, (Recorded,), {}))
    monkeypatch.setitem(sys.modules, 'launch.launch_description_sources', sources)
    monkeypatch.setitem(sys.modules, 'launch_ros.parameter_descriptions', descriptions)
    return load(CONSOLE_FILE).positional[0]


def test_console_is_started_beside_the_tracker(console):
    """It gets namespace and topic, and the tracker comes from its own launch file."""
    *_, included, node = console
    assert included.positional[0].positional == (str(LAUNCH_FILE),)
    assert (node.named['package'], node.named['executable']) == ('lmsco_ros', 'console')
    assert node.named['namespace'].positional == ('namespace',)
    ((topic, replacement),) = node.named['remappings']
    assert topic == 'image_raw' and replacement.positional == ('image_topic',)


def test_parameters_of_the_console_are_arguments_of_its_launch_file(console):
    """All but the name of the tracker; each has its type, whatever the text looks like."""
    settings = {field.name: field.default for field in fields(ConsoleSettings)}
    del settings['tracker']
    declared = {item.positional[0]: item.named for item in console
                if type(item).__name__ == 'DeclareLaunchArgument'}
    assert set(declared) == {'image_topic', 'namespace', *settings}
    assert all(item['description'] for item in declared.values())
    handed = {name: (value.positional[0].positional[0], value.named['value_type'])
              for name, value in console[-1].named['parameters'][0].items()}
    assert handed == {name: (name, type(default)) for name, default in settings.items()}
    for name, default in settings.items():
        text = declared[name]['default_value']
        assert (text if isinstance(default, str) else yaml.safe_load(text)) == default

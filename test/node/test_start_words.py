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


"""What the process says of what it is started with: one clear line for each mistake."""

import gc
import os
from pathlib import Path
import subprocess
import sys
import threading

from hypothesis import given, strategies as st
import pytest
from rclpy.context import Context
from rclpy.node import Node
import yaml

import lmsco_ros
from lmsco_ros.node import parameter_files
from lmsco_ros.node.ros_arguments import split_arguments, StartError, values_of
from lmsco_ros.node.run import run

REPOSITORY = Path(__file__).resolve().parents[2]
COMMAND = [sys.executable, '-m', 'lmsco_ros.node.main']
PATIENCE = 100.0
NAMES = st.text('ab_', min_size=1, max_size=3)


@pytest.fixture
def started(capfd):
    """Return a function that starts the node, ends it at once, and returns code and words."""
    def start(*arguments):
        ending = threading.Event()
        ending.set()
        code = run(['--ros-args', *arguments], ending)
        return code, [line for line in capfd.readouterr().err.splitlines()
                      if 'waiting for images' not in line]
    yield start
    # The process of the node leaves its objects out of collections; this one goes on.
    gc.unfreeze()


@pytest.fixture(scope='module')
def context():
    """Return a context of the tests' own."""
    context = Context()
    context.init()
    yield context
    context.try_shutdown()


def command(*arguments, environment=None):
    """Run the command until it ends; return code, output and errors."""
    done = subprocess.run(
        [*COMMAND, *arguments], cwd=REPOSITORY, capture_output=True, text=True, timeout=PATIENCE,
        env={**os.environ, 'PYTHONPATH': str(REPOSITORY), **(environment or {})})
    return done.returncode, done.stdout, done.stderr


def parameters(path, names, values='preset: hcs'):
    """Write a parameter file and return its path."""
    lines = '\n'.join(f'{name}:\n  ros__parameters:\n    {values}' for name in names)
    path.write_text(lines + '\n')
    return str(path)


@pytest.mark.parametrize('content, words', [
    (None, 'cannot be read: No such file'),
    (b'lmsco_tracker:\n\tros__parameters:\n', "is no YAML: found character '\\t'"),
    (b'lmsco_tracker: {', 'is no YAML'),
    (b'\xff\xfe\xfa', 'is no YAML: it is no text'),
    (b'lmsco_tracker:\n  ros__parameters:\n    overlay_label: "\xe9"\n', 'it is no text in UTF-8'),
    (b'lmsco_tracker:\n  ros__parameters:\n    preset:\n', 'No value at line 3'),
    (b'lmsco_tracker:\n  preset: hcs\n', 'before ros__parameters at line 2'),
    (b'- preset\n', 'Sequences cannot be key'),
    (b'lmsco_tracker: &a\n  ros__parameters:\n    preset: *a\n', 'aliasing at line 3'),
    (b'a: &a [*a, *a]\n', 'refused by ROS'),
    (b'lmsco_tracker:\n  ros__parameters:\n    preset: ' + b'[' * 9000 + b']' * 9000, 'preset'),
    (b'lmsco_tracker:\n  ros__parameters:\n    threads: ' + b'9' * 5000, 'threads'),
    (b'lmsco_tracker:\n  ros__parameters:\n    threads: many\n', 'INTEGER'),
], ids=['missing', 'tabs', 'half', 'binary', 'Latin-1', 'without a value', 'without the mark',
        'a list', 'an alias', 'an alias of itself', 'deep', 'a long number', 'wrong type'])
def test_parameter_file_that_cannot_be_used_ends_in_one_line(started, tmp_path, content, words):
    path = tmp_path / 'wrong.yaml'
    if content is not None:
        path.write_bytes(content)
    code, (line,) = started('--params-file', str(path))
    assert code == 1 and line.startswith('tracker_node: ') and words in line
    assert content is None or 'config/tracker.yaml' in line
    assert len(line) < 800


def test_folder_for_a_parameter_file_is_named(started, tmp_path):
    code, (line,) = started('--params-file', str(tmp_path))
    assert code == 1 and str(tmp_path) in line and 'directory' in line


def test_parameters_from_a_pipe_are_not_asked_for_twice(tmp_path):
    pipe = tmp_path / 'pipe'
    os.mkfifo(pipe)
    writer = threading.Thread(target=lambda: pipe.write_text('lmsco_tracker:\n\tpreset: hcs\n'))
    writer.start()
    code, _, errors = command('--ros-args', '--params-file', str(pipe))
    writer.join()
    assert code == 1 and errors.count('\n') == 1 and str(pipe) in errors


@pytest.mark.parametrize('arguments, words', [
    (['-p', 'frame_policy:=newest'], ['latest, all']),
    (['-p', 'threads:=many'], ['threads', 'INTEGER']),
    (['-p', 'overlay_interval:=0'], ['overlay_interval', 'Min: 1']),
    (['-p', f'threads:={"9" * 5000}'], ['threads']),
    (['-p', 'preset'], ['preset', 'name:=value']),
    (['--param', 'preset:=[[['], ['preset:=[[[', 'name:=value']),
    (['-r', 'image_raw:=/9cam'], ['image_raw:=/9cam', 'starts with a digit']),
    (['-r', 'image_raw:=/a//b'], ['/a//b', 'not legal']),
    (['--remap', 'image_raw:=/a b'], ['/a b', 'not legal']),
    (['-r', 'image_raw'], ['image_raw', 'from:=to']),
    (['-r', f'image_raw:={"n" * 300}'], ['more than 200 letters']),
    (['-r', f'__node:={"n" * 300}'], ['more than 200 letters']),
    (['-r', '__node:=bad-name'], ['__node:=bad-name', 'letters, digits']),
    (['-r', '__ns:=left'], ['__ns:=left', 'starts with a slash']),
    (['--nosuch'], ['--nosuch']),
    (['--params-file'], ['--params-file', 'No file path']),
    (['--log-level', 'loud'], ['loud']),
    (['--enclave', '9'], ['nclave', 'absolute']),
], ids=lambda value: value[-1][:30])
def test_wrong_arguments_end_in_one_line(started, arguments, words):
    code, (line,) = started(*arguments)
    assert code == 1 and line.startswith('tracker_node: ')
    assert all(word in line for word in words), line
    assert len(line) < 800 and '/src/' not in line


def test_wrong_preset_ends_with_the_known_ones(started):
    code, (line,) = started('-p', 'preset:=best')
    assert code == 1 and 'default' in line


def test_unknown_parameters_are_warned_of_with_the_nearest_name(started, tmp_path):
    path = parameters(tmp_path / 'typo.yaml', ['/**/lmsco_tracker'], 'overlay_lable: hot')
    code, lines = started('--params-file', path, '-p', 'preest:=hcs', '-p', 'xyz:=1')
    assert code == 0 and len(lines) == 3 and all('WARN' in line for line in lines)
    assert 'overlay_lable' in lines[0] and 'mean overlay_label?' in lines[0]
    assert 'preest' in lines[1] and 'mean preset?' in lines[1]
    assert 'xyz' in lines[2] and 'config/tracker.yaml' in lines[2]


def test_unknown_parameters_are_told_when_the_node_does_not_start(started):
    code, lines = started('-p', 'preest:=hcs', '-p', 'preset:=best')
    assert code == 1 and any('mean preset?' in line for line in lines)


@pytest.mark.parametrize('names, arguments, words', [
    (['lmsco_tracker'], ['-r', '__ns:=/left'], ['/left/lmsco_tracker', '/**/lmsco_tracker']),
    (['/**/lmsco_tracker'], ['-r', '__node:=boson'], ['/boson', '/**/lmsco_tracker']),
    (['camera', 'lmsco_trackr'], [], ['/lmsco_tracker', 'there is /lmsco_trackr']),
    (['/*/lmsco_tracker'], [], ['/lmsco_tracker']),
    ([], [], ['no parameters']),
])
def test_parameter_file_for_others_is_warned_of(started, tmp_path, names, arguments, words):
    path = parameters(tmp_path / 'others.yaml', names)
    code, (line,) = started('--params-file', path, *arguments)
    assert code == 0 and 'WARN' in line and path in line
    assert all(word in line for word in words), line


def test_parameter_for_another_node_is_warned_of(started):
    code, (line,) = started('-p', 'lmsco_trackr:preset:=hcs')
    assert code == 0 and 'WARN' in line and '/lmsco_trackr, this is /lmsco_tracker' in line


def test_what_is_used_is_not_warned_of(started, tmp_path):
    path = parameters(tmp_path / 'robot.yaml', ['camera', '/**', '/left/lmsco_tracker'])
    shipped = str(REPOSITORY / 'config' / 'tracker.yaml')
    assert started('--params-file', path, '--params-file', shipped, '-r', '__ns:=/left',
                   '-p', 'use_sim_time:=true', '-p', 'preset:=hcs') == (0, [])


@given(st.lists(st.one_of(NAMES, st.sampled_from(['*', '**'])), min_size=1, max_size=3),
       st.lists(NAMES, max_size=2), NAMES)
def test_files_are_matched_as_ros_does(tmp_path_factory, context, keys, namespace, name):
    path = tmp_path_factory.mktemp('files') / 'file.yaml'
    parameters(path, ['"/' + '/'.join(keys) + '"'])
    arguments = ['--ros-args', '--params-file', str(path)]
    node = Node(name, namespace='/' + '/'.join(namespace), context=context, cli_args=arguments,
                enable_rosout=False, start_parameter_services=False)
    heard = bool(node._parameter_overrides)
    full_name = node.get_fully_qualified_name()
    node.destroy_node()
    assert (not parameter_files.unheard(arguments, full_name)) == heard


@given(st.recursive(st.integers() | st.text('ab', max_size=2), lambda inner: st.dictionaries(
    st.sampled_from(['a', 'b', 'ros__parameters']), inner, max_size=3)
    | st.lists(inner, max_size=2), max_leaves=6))
def test_any_file_is_gone_through(tmp_path_factory, content):
    path = tmp_path_factory.mktemp('files') / 'file.yaml'
    path.write_text(yaml.safe_dump(content))
    assert isinstance(parameter_files.unheard(['--params-file', str(path)], '/node'), list)


@given(st.lists(st.sampled_from(['--ros-args', '--', '-p', 'a:=b', '--help']), max_size=8))
def test_arguments_are_ours_or_those_of_ros(arguments):
    own, ros = split_arguments(arguments)
    assert len(own) + len(ros) == len(arguments)
    assert '--ros-args' not in own
    first = arguments.index('--ros-args') if '--ros-args' in arguments else len(arguments)
    assert own[:first] == arguments[:first]


def test_values_follow_both_names_of_an_option():
    arguments = ['--ros-args', '-p', 'a:=1', '--param', 'b:=2', '-r', 'c:=d', '--params-file', 'e']
    assert values_of('--param', arguments) == ['a:=1', 'b:=2']
    assert values_of('--params-file', arguments) == ['e']
    assert split_arguments(['x', *arguments, '--', 'y']) == (['x', 'y'], [*arguments, '--'])
    assert issubclass(StartError, ValueError)


@pytest.fixture
def without_libraries(tmp_path):
    """Return an environment in which nothing that is heavy can be imported."""
    for name in ('rclpy', 'numpy', 'torch', 'cv2', 'yaml'):
        (tmp_path / f'{name}.py').write_text(f'raise AssertionError("{name} was imported")')
    return {'PYTHONPATH': f'{tmp_path}:{REPOSITORY}'}


@pytest.mark.parametrize('more', [[], ['--ros-args', '-p', 'preset:=hcs']])
def test_help_and_version_need_no_library(without_libraries, more):
    for option in ('--help', '-h'):
        code, output, errors = command(option, *more, environment=without_libraries)
        assert (code, errors) == (0, '')
        assert all(word in output for word in ('--params-file', 'image_raw', '--version'))
    assert command('--version', *more, environment=without_libraries) == (
        0, f'lmsco_ros {lmsco_ros.__version__}\n', '')


def test_arguments_in_the_wrong_place_are_refused(without_libraries):
    code, _, errors = command('--params-file', 'x.yaml', environment=without_libraries)
    assert code == 2 and errors.count('\n') == 1
    assert '--params-file is not known' in errors and '--ros-args' in errors


def test_without_ros_the_remedy_is_told():
    done = subprocess.run([sys.executable, '-S', '-m', 'lmsco_ros.node.main'], cwd=REPOSITORY,
                          capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 1 and done.stderr.count('\n') == 1
    assert all(word in done.stderr for word in ('rclpy', 'source', '`ros`'))


@pytest.mark.parametrize('module', ['lmsco_ros.node.main', 'lmsco_ros.cli.main'])
@pytest.mark.parametrize('place, content', [
    ('msg_adapters.py', ''),
    ('msg_adapters/__init__.py', 'PART_OF = "another"'),
    ('msg_adapters/__init__.py', 'raise RuntimeError("of its own")'),
])
def test_foreign_package_with_the_name_of_ours_is_told(tmp_path, module, place, content):
    (tmp_path / place).parent.mkdir(exist_ok=True)
    (tmp_path / place).write_text(content)
    words = ['demo', '--output', 'demo'] if 'cli' in module else []
    # The folder that a module is run in comes before all others.
    done = subprocess.run(
        [sys.executable, '-m', module, *words], cwd=tmp_path, capture_output=True, text=True,
        timeout=60, env={**os.environ, 'PYTHONPATH': str(REPOSITORY)})
    assert done.returncode == 1 and len(done.stderr.splitlines()) == 1
    assert f'msg_adapters in {tmp_path / place} is not that of lmsco_ros' in done.stderr
    assert 'PYTHONPATH' in done.stderr and not (tmp_path / 'demo').exists()


def test_library_that_cannot_be_imported_is_told(tmp_path):
    (tmp_path / 'rclpy.py').write_text('raise ImportError("librcl.so is missing\\nand more")')
    code, _, errors = command(environment={'PYTHONPATH': f'{tmp_path}:{REPOSITORY}'})
    assert code == 1 and errors.count('\n') == 1 and 'librcl.so is missing' in errors

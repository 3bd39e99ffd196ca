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

"""The command line explains itself, quickly and also without ROS."""

import math
import subprocess
import sys

from hypothesis import given, strategies as st
import pytest
from typer import BadParameter, Exit

from lmsco_ros.cli.options import parse_box
from lmsco_ros.cli.ros import require_ros


@pytest.mark.parametrize('command', ['track', 'replay', 'make-bag', 'demo', 'evaluate'])
def test_every_command_has_help(lmsco, command):
    outcome = lmsco(command, '--help')
    assert outcome.exit_code == 0 and '--output' in outcome.words


def test_without_arguments_it_explains_itself(lmsco):
    assert 'make-bag' in lmsco().output


def test_unknown_command(lmsco):
    assert lmsco('fly').exit_code == 2


def test_help_needs_nothing_heavy():
    code = ('import sys\n'
            'from typer.testing import CliRunner\n'
            'from lmsco_ros.cli.main import build_app\n'
            'assert CliRunner().invoke(build_app(), ["--help"]).exit_code == 0\n'
            'print(*{"torch", "rclpy", "matplotlib"} & set(sys.modules))\n')
    ended = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                           timeout=100)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.strip() == ''


def test_missing_ros_is_told_with_its_remedy(monkeypatch, capsys):
    monkeypatch.setattr('importlib.util.find_spec', lambda name: None)
    with pytest.raises(Exit) as leaving:
        require_ros()
    assert leaving.value.exit_code == 1
    message = capsys.readouterr().err
    assert 'needs ROS 2' in message and 'rclpy' in message and 'extra `ros`' in message


@given(st.tuples(*[st.floats(-1e4, 1e4)] * 2, *[st.floats(1e-3, 1e4)] * 2))
def test_any_box_can_be_written_as_an_option(box):
    assert parse_box(','.join(map(repr, box))) == box


@given(st.text(alphabet='0123456789,.-+einfa x', max_size=20))
def test_other_texts_are_a_box_or_a_bad_parameter(text):
    try:
        x, y, width, height = parse_box(text)
    except BadParameter as error:
        assert 'box' in str(error) or 'positive' in str(error)
    else:
        assert width > 0 and height > 0 and math.isfinite(x + y)

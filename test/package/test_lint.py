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

"""The source obeys the ROS 2 style (flake8, pydocstyle) and the core its types (mypy)."""

import configparser
from pathlib import Path
import subprocess
import sys

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
SOURCES = ('benchmarks', 'docs', 'examples', 'launch', 'lmsco_ros', 'msg_adapters', 'scripts',
           'setup.py', 'test', 'training')


@pytest.mark.parametrize('command', [
    ('flake8', *SOURCES),
    ('pydocstyle', *SOURCES),
    ('mypy',),
], ids=lambda command: command[0])
def test_source_is_clean(command):
    """The tool finds nothing; what it finds is the message of the failure."""
    done = subprocess.run(
        [sys.executable, '-m', *command], cwd=REPOSITORY, capture_output=True, text=True)
    assert done.returncode == 0, f'\n{done.stdout}{done.stderr}'


@pytest.mark.parametrize('source, code', [
    ('x = "double"\n', 'Q000'),
    ('import sys\nimport os\n\nprint(os, sys)\n', 'I100'),
    (f"x = '{'x' * 99}'\n", 'E501'),
])
def test_style_settings_are_in_force(tmp_path, source, code):
    """A plug-in that is not installed would pass everything, so each rule is seen to bite."""
    file = tmp_path / 'sample.py'
    file.write_text(source)
    done = subprocess.run(
        [sys.executable, '-m', 'flake8', '--config', REPOSITORY / 'setup.cfg', file],
        capture_output=True, text=True)
    assert code in done.stdout


def test_every_python_file_carries_the_license():
    """The header is the first thing in each file."""
    header = Path(__file__).read_text().split('"""')[0]
    for source in SOURCES:
        for file in [REPOSITORY / source, *(REPOSITORY / source).rglob('*.py')]:
            if file.is_file():
                text = file.read_text().removeprefix('#!/usr/bin/env python3\n')
                assert text.startswith(header), f'{file}: license header missing or different'


def test_flake8_settings_are_those_of_ament():
    """The codes that the ROS 2 linters pass over, and no others."""
    config = configparser.ConfigParser()
    config.read(REPOSITORY / 'setup.cfg')
    ignored = set(config['flake8']['extend-ignore'].split(','))
    undocumented = {f'D10{digit}' for digit in range(8)}
    assert ignored == undocumented | {'B902', 'C816', 'D203', 'D212', 'D404', 'I202'}
    assert set(config['pydocstyle']['ignore'].split(',')) == {
        code for code in ignored if code.startswith('D')}

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
import os
import shutil
import subprocess
import sys

from hypothesis import given, strategies as st
import pytest
from typer import BadParameter, Exit

from lmsco_ros.cli.options import parse_box
from lmsco_ros.cli.ros import require_ros


@pytest.mark.parametrize('option', ['--help', '-h'])
@pytest.mark.parametrize('command', ['track', 'replay', 'make-bag', 'demo', 'evaluate'])
def test_every_command_has_help(lmsco, command, option):
    outcome = lmsco(command, option)
    assert outcome.exit_code == 0 and '--output' in outcome.words


@pytest.mark.parametrize('words', [(), ('weights',), ('weights', 'fetch'), ('results',)])
def test_short_option_for_help_is_known_everywhere(lmsco, words):
    outcome = lmsco(*words, '-h')
    assert outcome.exit_code == 0 and outcome.words == lmsco(*words, '--help').words


def test_version(lmsco):
    from lmsco_ros import __version__

    outcome = lmsco('--version')
    assert outcome.exit_code == 0 and outcome.output == f'lmsco {__version__}\n'


def test_without_arguments_it_explains_itself(lmsco):
    assert 'make-bag' in lmsco().output


def test_unknown_command(lmsco):
    assert lmsco('fly').exit_code == 2


@pytest.mark.parametrize('words', [['--help'], ['track', '-h'], ['--version']])
def test_words_need_nothing_heavy(words):
    code = ('import sys\n'
            'from typer.testing import CliRunner\n'
            'from lmsco_ros.cli.main import build_app\n'
            'assert CliRunner().invoke(build_app(), sys.argv[1:]).exit_code == 0\n'
            'print(*{"torch", "cv2", "scipy", "numpy", "av", "rosbags", "rclpy", "matplotlib",\n'
            '        "yaml", "requests"} & set(sys.modules))\n')
    ended = subprocess.run([sys.executable, '-c', code, *words], capture_output=True, text=True,
                           timeout=100)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.strip() == ''


@pytest.mark.parametrize('line, completions', [
    ('lmsco mak', {'make-bag'}), ('lmsco weights ver', {'verify'}),
    ('lmsco track --ground', {'--ground-truth'}), ('lmsco evaluate x --protocol v', {'vot'})])
def test_shell_completes(lmsco_process, line, completions):
    process = lmsco_process(env={
        **os.environ, '_LMSCO_COMPLETE': 'complete_bash', 'COMP_WORDS': line,
        'COMP_CWORD': str(len(line.split()) - 1)})
    told, _ = process.communicate(timeout=100)
    assert set(told.split()) == completions


@pytest.mark.skipif(shutil.which('bash') is None, reason='needs bash')
def test_completion_is_shown_and_installed(tmp_path):
    """The shell that asks is found among the parents of the process."""
    lmsco = f'"{sys.executable}" -m lmsco_ros.cli.main'
    script = f'{lmsco} --show-completion && {lmsco} --install-completion; exit $?'
    ended = subprocess.run(['bash', '-c', script], capture_output=True, text=True, timeout=100,
                           env={**os.environ, 'HOME': str(tmp_path)})
    assert ended.returncode == 0, ended.stderr
    assert 'complete -o default -F _lmsco_completion lmsco' in ended.stdout
    assert 'lmsco' in (tmp_path / '.bashrc').read_text()


@pytest.mark.parametrize('words', [['--help'], ['weights', 'list']])
def test_reader_who_left_is_no_error(lmsco_process, words):
    """As `lmsco ... | true`."""
    reading, writing = os.pipe()
    process = lmsco_process(*words, stdout=writing)
    os.close(writing)
    os.close(reading)
    assert process.communicate(timeout=100)[1] == ''
    assert process.returncode in (0, 1)


def test_results_are_written_without_a_reader(lmsco_process, tmp_path, scene_folder, start):
    reading, writing = os.pipe()
    process = lmsco_process('track', scene_folder, '--init', start, '--output', tmp_path,
                            stdout=writing, stderr=writing)
    os.close(writing)
    os.close(reading)
    assert process.wait(100) == 0
    assert (tmp_path / 'summary.png').exists()


@pytest.mark.skipif(not os.path.exists('/dev/full'), reason='needs /dev/full')
@pytest.mark.parametrize('words', [['--help'], ['weights', 'list']])
def test_standard_output_without_room_is_one_line(lmsco_process, words):
    with open('/dev/full', 'w') as full:
        process = lmsco_process(*words, stdout=full)
        complaints = process.communicate(timeout=100)[1]
    assert process.returncode == 1
    assert complaints.count('\n') == 1 and 'No space left on device' in complaints


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

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

"""The bootstrap names what a machine lacks, installs the pinned set once, and not twice."""

import importlib.util
import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
EXTRAS = 'cli,eval,cluster,weights,backbones,console'

# An interpreter that notes what it is asked to do instead of doing it.
FAKE_PYTHON = """\
#!/bin/sh
case "$*" in
  *version_info*) echo {version} ;;
  *'import ensurepip'*) exit {ensurepip} ;;
  *'from rclpy'*) exit {rclpy} ;;
  *'-m venv'*) echo "$*" >> {log}
    for venv; do :; done
    mkdir -p "$venv/bin"; cp "$0" "$venv/bin/python" ;;
  *'-m pip'*) echo "$*" >> {log}; exit {pip} ;;
esac
"""


@pytest.fixture(scope='module')
def bootstrap():
    """Import the script, which lies outside of every package."""
    spec = importlib.util.spec_from_file_location(
        'bootstrap', REPOSITORY / 'scripts' / 'bootstrap.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def fake_python(tmp_path):
    """Return a maker of fake interpreters that log to `calls.log`."""
    def make(name='python3', version='3 11', ensurepip=0, rclpy=1, pip=0):
        path = tmp_path / name
        path.write_text(FAKE_PYTHON.format(
            version=version, ensurepip=ensurepip, rclpy=rclpy, pip=pip,
            log=tmp_path / 'calls.log'))
        path.chmod(0o755)
        return str(path)
    return make


@pytest.fixture
def clone(tmp_path, bootstrap):
    """Return a directory with the files that the bootstrap reads, and the Makefile."""
    root = tmp_path / 'clone'
    for name in (*bootstrap.SOURCES, 'Makefile'):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(REPOSITORY / name, root / name)
    return root


def run(clone, python, **environment):
    """Run the bootstrap of the clone; return exit status, standard error and the new calls."""
    log = clone.parent / 'calls.log'
    log.unlink(missing_ok=True)
    inherited = {key: value for key, value in os.environ.items() if key != 'ROS_DISTRO'}
    done = subprocess.run(
        [sys.executable, clone / 'scripts' / 'bootstrap.py'],
        env={**inherited, 'PYTHON': python, **environment}, capture_output=True, text=True)
    return done.returncode, done.stderr, log.read_text().splitlines() if log.exists() else []


@pytest.mark.parametrize('version', ['3 10', '3 11', '3 12'])
def test_supported_interpreters_are_taken(bootstrap, fake_python, version):
    """Each of the three versions will do."""
    python = fake_python(version=version)
    assert bootstrap.find_python(python) == python


@pytest.mark.parametrize('version', ['2 7', '3 9', '3 13'])
def test_unsupported_interpreter_is_named_with_a_remedy(clone, fake_python, version):
    """The one line says what was found, what is needed and how to get it."""
    status, message, calls = run(clone, fake_python(version=version))
    assert status == 1 and not calls
    assert message.count('\n') == 1
    assert version.replace(' ', '.') in message and '3.10, 3.11 or 3.12' in message
    assert 'PYTHON=' in message and 'apt install' in message
    assert '3.13 will do' in message and 'pip install' in message


def test_interpreter_that_does_not_run_is_named(clone, tmp_path):
    """A wrong path in PYTHON is an error of its own kind."""
    status, message, _ = run(clone, str(tmp_path / 'nowhere'))
    assert status == 1 and message.count('\n') == 1
    assert f'{tmp_path}/nowhere does not run' in message


def test_search_passes_over_unsupported_interpreters(bootstrap, fake_python, monkeypatch):
    """Without a wish the first supported one of the search path is taken."""
    fake_python('python3', version='3 13')
    directory = Path(fake_python('python3.11', version='3 11')).parent
    monkeypatch.setenv('PATH', f'{directory}:/usr/bin:/bin')
    monkeypatch.setattr(bootstrap, 'INTERPRETERS', ('python3', 'python3.12.0', 'python3.11'))
    assert bootstrap.find_python() == 'python3.11'


def test_missing_venv_module_is_named_with_its_debian_package(clone, fake_python):
    """Debian and Ubuntu ship Python without the means to make an environment."""
    status, message, calls = run(clone, fake_python(version='3 12', ensurepip=1))
    assert status == 1 and not calls and message.count('\n') == 1
    assert 'sudo apt install python3.12-venv' in message


@pytest.mark.parametrize('system, machine', [('Linux', 'aarch64'), ('Darwin', 'x86_64')])
def test_other_platforms_are_sent_to_an_installed_ros(bootstrap, system, machine):
    """The wheels exist for x86-64 Linux only."""
    with pytest.raises(bootstrap.Remedy, match=f'{machine} {system}.*/opt/ros/jazzy') as raised:
        bootstrap.check_platform(system, machine)
    assert '\n' not in str(raised.value)


def test_x86_64_linux_is_accepted(bootstrap):
    """No remedy where none is needed."""
    bootstrap.check_platform('Linux', 'x86_64')


def test_first_run_installs_the_pinned_wheels_and_second_nothing(clone, fake_python):
    """The stamp makes the second run free."""
    python = fake_python()
    status, _, calls = run(clone, python)
    assert status == 0
    assert calls[0] == f'-m venv {clone}/.venv'
    assert all('--constraint constraints.txt' in call for call in calls[1:])
    assert calls[-1].endswith(f'--editable .[{EXTRAS},ros,test,browser-test]')
    assert (clone / '.venv' / 'COLCON_IGNORE').exists()
    assert run(clone, python) == (0, '', [])


@pytest.mark.parametrize('name', ['pyproject.toml', 'setup.py', 'constraints-common.txt'])
def test_changed_requirements_are_installed_into_what_is_there(clone, fake_python, name):
    """A new pin needs no new environment."""
    python = fake_python()
    run(clone, python)
    with (clone / name).open('a') as file:
        file.write('\n')
    status, _, calls = run(clone, python)
    assert status == 0
    assert calls[-1].endswith(f'--editable .[{EXTRAS},ros,test,browser-test]')
    assert not any('--clear' in call for call in calls)


def test_installed_jazzy_takes_the_place_of_the_wheels(clone, fake_python):
    """Its packages are seen from the environment, and the pins fit its message classes."""
    run(clone, fake_python(version='3 12', rclpy=0))
    python = fake_python(version='3 12', rclpy=0)
    status, _, calls = run(clone, python, ROS_DISTRO='jazzy')
    assert status == 0
    assert calls[0] == f'-m venv --clear --system-site-packages {clone}/.venv'
    assert all('--constraint constraints-jazzy.txt' in call for call in calls[1:])
    assert calls[-1].endswith(f'--editable .[{EXTRAS},test,browser-test]')


@pytest.mark.parametrize('distribution, rclpy', [('jazzy', 1), ('humble', 0)])
def test_wheels_are_used_where_jazzy_is_not_usable(clone, fake_python, distribution, rclpy):
    """A sourced ROS that gives this interpreter no Jazzy rclpy does not count."""
    _, _, calls = run(clone, fake_python(rclpy=rclpy), ROS_DISTRO=distribution)
    assert calls[-1].endswith(f'--editable .[{EXTRAS},ros,test,browser-test]')


@pytest.fixture
def script(tmp_path):
    """Return a script that tells which signals wait, as pip writes one."""
    python = tmp_path / 'python'
    python.symlink_to(sys.executable)
    script = tmp_path / 'tracker_node'
    script.write_text(f'#!{python}\nimport signal\n'
                      'print(*map(int, sorted(signal.pthread_sigmask(signal.SIG_BLOCK, []))))\n')
    script.chmod(0o755)
    return script


def test_signals_wait_while_the_interpreter_of_the_node_starts(bootstrap, script):
    """They are blocked when its first line runs; a second call changes nothing."""
    for _ in range(2):
        bootstrap.hold_signals_back(script)
        done = subprocess.run([script], capture_output=True, text=True, check=True)
        assert done.stdout.split() == ['1', '2', '15']


@pytest.mark.parametrize('hold_back, first_line', [
    ('/usr/bin/env -S --no-such-option ', None),
    ('/usr/bin/env -S ', '#!/bin/sh'),
])
def test_script_stays_as_it_is_where_signals_cannot_wait(
        bootstrap, script, monkeypatch, hold_back, first_line):
    """An `env` without the means, and a first line that names no interpreter."""
    monkeypatch.setattr(bootstrap, 'HOLD_BACK', hold_back)
    if first_line:
        script.write_text(f'{first_line}\n')
    before = script.read_text()
    bootstrap.hold_signals_back(script)
    assert script.read_text() == before


def test_failed_installation_is_tried_again(clone, fake_python):
    """A failure leaves no stamp behind, and names its step without a traceback."""
    status, message, _ = run(clone, fake_python(pip=1))
    assert status == 1 and 'pip install' in message and 'Traceback' not in message
    status, _, calls = run(clone, fake_python())
    assert status == 0 and calls


def test_make_names_a_missing_python(clone):
    """Where not even the bootstrap can run, make itself says so."""
    done = subprocess.run(
        ['make', 'venv', 'PYTHON=/nowhere/python3'], cwd=clone, capture_output=True, text=True)
    assert done.returncode != 0
    first_line = done.stderr.splitlines()[0]
    assert '/nowhere/python3 is not there' in first_line and 'sudo apt install' in first_line

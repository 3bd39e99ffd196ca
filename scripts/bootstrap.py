#!/usr/bin/env python3
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

"""
Make `.venv` hold the project and everything it needs; do nothing when it already does.

Runs with the standard library of any Python 3.7 or newer, so that a machine that lacks something
is told so in one line instead of a traceback. `PYTHON` in the environment chooses the interpreter.
"""

import hashlib
import os
from pathlib import Path
import platform
import subprocess
import sys

SUPPORTED = ((3, 10), (3, 11), (3, 12))
INTERPRETERS = ('python3', 'python3.12', 'python3.11', 'python3.10')
STAMP = 'lmsco_ros.stamp'
EXTRAS = 'cli,eval,cluster,weights,backbones,console'
HOLD_BACK = '/usr/bin/env -S --block-signal=INT,TERM,HUP '
LONGEST_FIRST_LINE = 250
SOURCES = (
    'constraints.txt', 'constraints-common.txt', 'constraints-jazzy.txt',
    'pyproject.toml', 'setup.py', 'scripts/bootstrap.py',
)


class Remedy(Exception):
    """Something is missing; the message says in one line what it is and how to get it."""


def answer(python, code):
    """Return what an interpreter prints for the code, or None where it cannot run it."""
    try:
        done = subprocess.run(
            [python, '-c', code], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            universal_newlines=True)
    except OSError:
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def version_of(python):
    """Return (major, minor) of an interpreter, or None where it does not run."""
    text = answer(python, 'import sys; print(*sys.version_info[:2])')
    return tuple(int(part) for part in text.split()) if text else None


def find_python(wanted=None):
    """
    Return the interpreter to build on.

    Parameters
    ----------
    wanted : str, optional
        The interpreter that the user asks for; without it the first supported one is taken.

    Raises
    ------
    Remedy
        When there is none of a supported version.

    """
    found = []
    for python in [wanted] if wanted else INTERPRETERS:
        version = version_of(python)
        if version in SUPPORTED:
            return python
        if version:
            found.append('{} is {}.{}'.format(python, *version))
    raise Remedy(
        'Python 3.10, 3.11 or 3.12 is needed, but {}; install one (Debian 12, Ubuntu: sudo apt '
        'install python3 python3-venv) or name one: make PYTHON=/path/to/python3.11. Without the '
        "ROS node 3.13 will do, too: pip install '.[cli,eval,weights]'"
        .format(', '.join(found) or '{} does not run'.format(wanted or 'python3')))


def provides_jazzy(python, environment):
    """Tell whether a sourced ROS 2 Jazzy gives this interpreter its rclpy."""
    return (environment.get('ROS_DISTRO') == 'jazzy'
            and answer(python, 'from rclpy.node import Node') is not None)


def check_platform(system, machine):
    """Raise Remedy where the index has no ROS 2 wheels for this machine."""
    if (system, machine) != ('Linux', 'x86_64'):
        raise Remedy(
            'ROS 2 from the package index exists for x86-64 Linux, this is {} {}; install ROS 2 '
            'Jazzy, run "source /opt/ros/jazzy/setup.bash" and try again'.format(machine, system))


def check_venv(python):
    """Raise Remedy where the interpreter cannot make virtual environments."""
    if answer(python, 'import ensurepip, venv') is None:
        version = '{}.{}'.format(*version_of(python))
        raise Remedy(
            '{} has no venv module; install it: sudo apt install python{}-venv'
            .format(python, version))


def fingerprint(root, base):
    """Return the text that names everything the environment was made from."""
    digest = hashlib.sha256()
    for name in SOURCES:
        digest.update((root / name).read_bytes())
    return '{}\n{}\n'.format(base, digest.hexdigest())


def install(root, python, jazzy, fresh):
    """
    Create or complete the environment.

    Parameters
    ----------
    root : Path
        The repository.
    python : str
        The interpreter to build on.
    jazzy : bool
        Use the ROS 2 that is installed on this machine instead of the wheels.
    fresh : bool
        Throw away what an older environment holds.

    """
    venv = root / '.venv'
    options = ['--clear'] * fresh + ['--system-site-packages'] * jazzy
    subprocess.run([python, '-m', 'venv'] + options + [str(venv)], check=True)
    (venv / 'COLCON_IGNORE').touch()
    pip = [str(venv / 'bin' / 'python'), '-m', 'pip', 'install', '--disable-pip-version-check',
           '--constraint', 'constraints-jazzy.txt' if jazzy else 'constraints.txt']
    extras = '{},{}test,browser-test'.format(EXTRAS, '' if jazzy else 'ros,')
    subprocess.run(pip + ['setuptools'], cwd=root, check=True)
    # Without PEP 517 an older pip would honor script_dir of setup.cfg, which is meant for colcon.
    subprocess.run(
        pip + ['--use-pep517', '--no-build-isolation', '--editable', '.[{}]'.format(extras)],
        cwd=root, check=True)
    script = venv / 'bin' / 'tracker_node'
    if script.is_file():
        hold_signals_back(script)


def hold_signals_back(script):
    """
    Let signals wait while the interpreter of the node starts, until the node heeds them.

    The interpreter starts twice, since the ROS 2 wheels set a library path: some 40 ms in which
    a signal would end the process with a traceback, or as killed.

    Parameters
    ----------
    script : Path
        What pip made of the entry point. It stays as it is where `env` cannot block signals, or
        where its first line does not name the interpreter.

    """
    first, rest = script.read_text().split('\n', 1)
    blocking = '#!' + HOLD_BACK + first[2:]
    if (first[2:] != str(script.parent / 'python') or len(blocking) > LONGEST_FIRST_LINE
            or subprocess.call(HOLD_BACK.split() + ['true'], stderr=subprocess.DEVNULL)):
        return
    script.write_text(blocking + '\n' + rest)


def bootstrap(root, environment):
    """Bring `.venv` up to date; return whether anything had to be installed."""
    python = find_python(environment.get('PYTHON'))
    jazzy = provides_jazzy(python, environment)
    if not jazzy:
        check_platform(platform.system(), platform.machine())
    # The path is part of it because a virtual environment does not survive being moved.
    base = 'Python {}.{}, {}, {}'.format(
        *version_of(python), 'installed ROS 2 Jazzy' if jazzy else 'ROS 2 wheels', root / '.venv')
    stamp = root / '.venv' / STAMP
    wanted = fingerprint(root, base)
    present = stamp.read_text() if stamp.is_file() else None
    if present == wanted:
        return False
    check_venv(python)
    print('Installing ({}); this takes some minutes.'.format(base), flush=True)
    install(root, python, jazzy, fresh=present is not None and present.splitlines()[0] != base)
    stamp.write_text(wanted)
    return True


def main():
    """Run for the repository that this file belongs to; the exit status says how it went."""
    try:
        bootstrap(Path(__file__).resolve().parent.parent, os.environ)
    except Remedy as remedy:
        print('lmsco_ros: {}'.format(remedy), file=sys.stderr)
        return 1
    except subprocess.CalledProcessError as error:
        print('lmsco_ros: this step failed, its own message is above: {}'.format(
            ' '.join(error.cmd)), file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())

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

"""The command line as a user meets it, and a scene to use it on."""

from dataclasses import dataclass
import os
import subprocess
import sys

import cv2
import pytest
from typer.testing import CliRunner

from lmsco_ros.cli.main import build_app
from lmsco_ros.synthetic import render_scene, SceneConfig

SCENE = SceneConfig(width=160, height=128, frames=15, target_height=0.3)


@dataclass(frozen=True)
class Outcome:
    """Exit code of a command, what it said, and the same without frames and line ends."""

    exit_code: int
    output: str
    words: str


@pytest.fixture
def lmsco():
    """Return a function that runs `lmsco` with the given arguments."""
    def run(*arguments):
        result = CliRunner().invoke(build_app(), [str(a) for a in arguments])
        words = ' '.join(result.output.replace('│', ' ').split())
        return Outcome(result.exit_code, result.output, words)
    return run


@pytest.fixture
def lmsco_process():
    """Return a function that starts `lmsco` as a process, which ends with the test."""
    started = []

    def start(*arguments, **options):
        process = subprocess.Popen(
            [sys.executable, '-m', 'lmsco_ros.cli.main', *map(str, arguments)],
            **{'stdout': subprocess.PIPE, 'stderr': subprocess.PIPE, 'text': True, **options})
        started.append(process)
        return process
    yield start
    for process in started:
        process.kill()
        process.communicate()


@pytest.fixture
def until_large(until):
    """Return a function that waits until a process has written some megabytes into a file."""
    def wait(file, process):
        def is_large():
            assert process.poll() is None, 'it ended before'
            return file.exists() and file.stat().st_size > 3_000_000
        until(is_large)
    return wait


@pytest.fixture(scope='session')
def scene():
    """Return the frames of a small scene."""
    return list(render_scene(SCENE))


@pytest.fixture(scope='session')
def scene_folder(tmp_path_factory, scene):
    """Return the scene as a folder of 16-bit images."""
    folder = tmp_path_factory.mktemp('scene') / 'ir'
    folder.mkdir()
    for frame in scene:
        cv2.imwrite(str(folder / f'{frame.index:08d}.png'), frame.image)
    return folder


@pytest.fixture(scope='session')
def endless_folder(scene_folder):
    """Return the scene with its last image over and over: more than a test waits for."""
    folder = scene_folder.parent / 'endless'
    folder.mkdir()
    images = sorted(scene_folder.iterdir())
    for index in range(20_000):
        os.link(images[min(index, len(images) - 1)], folder / f'{index:08d}.png')
    return folder


@pytest.fixture(scope='session')
def start(scene):
    """Return the target of the first frame as the option --init takes it."""
    return ','.join(f'{value:.2f}' for value in scene[0].box.as_tuple())


@pytest.fixture(scope='session')
def truth(scene_folder, scene):
    """Return the file with the true boxes."""
    path = scene_folder.parent / 'groundtruth.txt'
    path.write_text('\n'.join(','.join(map(str, f.box.as_tuple())) for f in scene))
    return path

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
The official VOT toolkit, driving our TraX server, finds what our own evaluation finds.

The toolkit lives in an environment of its own, made once and kept in the user's cache; the tracker
runs in the environment of the tests, with the TraX library beside it in a folder of its own.
"""

from __future__ import annotations

from contextlib import suppress
import hashlib
import json
import os
from pathlib import Path
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile

import cv2
import numpy as np
import pytest

from lmsco_ros.evaluation.datasets import scan_dataset
from lmsco_ros.evaluation.execution import run_one_pass, run_supervised
from lmsco_ros.evaluation.geometry import overlaps
from lmsco_ros.evaluation.protocols.expected_overlap import (
    curve_terms, expected_average_overlap, expected_overlap_curve, longest_fragment)
from lmsco_ros.evaluation.protocols.supervised import accuracy, fragments
from lmsco_ros.evaluation.trackers import resolve

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]

REPOSITORY = Path(__file__).resolve().parents[2]
PRESET = 'hcs'
TOOLKIT, CURRENT = 'vot-toolkit==0.7.4', 'vot-toolkit==0.9.0'
ATTRIBUTEE = 'attributee==0.1.9'
TRAX = ('vot-trax==4.0.2', 'six')
# What the toolkit asks for, with OpenCV's headless contrib build in place of its desktop one.
DEPENDENCIES = (
    'bidict', 'cachetools', 'colorama', 'dominate', 'jsonschema', 'lazy-object-proxy',
    'matplotlib', 'numba', 'numpy', 'opencv-contrib-python-headless', 'packaging',
    'phx-class-registry>=5,<6', 'pillow', 'pylatex', 'pyyaml', 'requests', 'tqdm')

FRAMES = 60
SIZE = 320, 240
TARGET = 36, 28
# Expected overlap is averaged over these frames; the toolkit counts from 0.
INTERVAL = 11, 41
STACK = f"""title: Agreement
experiments:
  baseline:
    type: supervised
    repetitions: 1
    skip_initialize: 5
    analyses:
      - type: supervised_ar
      - type: supervised_eao_score
        low: {INTERVAL[0] - 1}
        high: {INTERVAL[1] - 1}
"""


def call(*command, folder=None, may_fail=False):
    """Run a command to its end and return its output; a failure shows it, unless it may."""
    # The toolkit looks for newer versions of itself on the network; no proxy listens there.
    offline = {'VOT_REGISTRY': '', 'http_proxy': 'http://127.0.0.1:9',
               'https_proxy': 'http://127.0.0.1:9'} if folder else {}
    done = subprocess.run(list(map(str, command)), cwd=folder, env={**os.environ, **offline},
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert may_fail or done.returncode == 0, (
        f'{command} ended with {done.returncode}:\n{done.stdout}')
    return done.stdout


def build_environment(folder, toolkit):
    """Install a toolkit in `folder` and the TraX library in a folder within."""
    call(sys.executable, '-m', 'venv', folder)
    pip = folder / 'bin' / 'python', '-m', 'pip', 'install', '--quiet'
    probe = subprocess.run([*map(str, pip), '--retries', '1', '--timeout', '20', ATTRIBUTEE],
                           stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if probe.returncode:
        pytest.skip(f'pip reaches no package index: {probe.stdout.strip().splitlines()[-1]}')
    call(*pip, *DEPENDENCIES, *TRAX)
    call(*pip, '--no-deps', toolkit)
    call(*pip, '--no-deps', '--target', folder / 'trax', *TRAX)


def environment_of(toolkit):
    """Return the folder of a toolkit's environment; it is made when there is none."""
    pins = ' '.join((sys.version.split()[0], toolkit, ATTRIBUTEE, *TRAX, *DEPENDENCIES))
    cache = Path(os.environ.get('XDG_CACHE_HOME', Path.home() / '.cache')) / 'lmsco_ros'
    folder = cache / f'vot_toolkit_{hashlib.sha256(pins.encode()).hexdigest()[:12]}'
    if not folder.is_dir():
        cache.mkdir(parents=True, exist_ok=True)
        unfinished = Path(tempfile.mkdtemp(prefix='unfinished_', dir=cache))
        try:
            build_environment(unfinished, toolkit)
            with suppress(OSError):  # Another worker was faster.
                unfinished.rename(folder)
        finally:
            shutil.rmtree(unfinished, ignore_errors=True)
    return folder


@pytest.fixture(scope='module')
def environment():
    """Return the folder of the environment of the toolkit that runs all experiments."""
    return environment_of(TOOLKIT)


def render(folder, corners, dtype):
    """
    Write a VOT sequence: a warm textured target at `corners` (x, y) of each frame.

    It is annotated a few pixels off, as by hand, so that overlaps differ from frame to frame.
    """
    random = np.random.default_rng(1)
    background = cv2.GaussianBlur(random.random(SIZE[::-1]), (0, 0), 5)
    background = 0.4 * cv2.normalize(background, None, 0, 1, cv2.NORM_MINMAX)
    warm = 0.6 + 0.4 * cv2.resize(random.random((5, 6)), TARGET, interpolation=cv2.INTER_LINEAR)
    width, height = TARGET
    (folder / 'ir').mkdir(parents=True)
    for number, (x, y) in enumerate(corners, start=1):
        image = background.copy()
        inside = image[y:y + height, x:x + width]
        inside[:] = warm[:inside.shape[0], :inside.shape[1]]
        image += random.normal(0, 0.01, image.shape)
        counts = (np.clip(image, 0, 1) * np.iinfo(dtype).max).astype(dtype)
        cv2.imwrite(str(folder / 'ir' / f'{number:08d}.png'), counts)
    (folder / 'groundtruth.txt').write_text(''.join(
        f'{x + number % 5},{y - number % 3},{width},{height}\n'
        for number, (x, y) in enumerate(corners)))
    (folder / 'sequence').write_text(
        f'name={folder.name}\nfps=30\nformat=default\nchannel.default=ir\n'
        f'channels.ir=ir/%08d.png\nwidth={SIZE[0]}\nheight={SIZE[1]}\nlength={len(corners)}\n')


@pytest.fixture(scope='module')
def workspace(tmp_path_factory, environment):
    """Return a toolkit workspace with two sequences, a tracker and one that cannot start."""
    folder = tmp_path_factory.mktemp('workspace')
    time = np.arange(FRAMES)
    # It ends partly outside of the image, where overlap counts inside only.
    drift = np.stack([121 + 3 * time, 80 + 20 * np.sin(time / 8)], axis=1).astype(int)
    # Twice it is suddenly elsewhere, out of the reach of any search region.
    jump = np.where((time % 40 < 20)[:, None], (30, 40), (250, 180)) + time[:, None] % 5
    render(folder / 'sequences' / 'drift', drift.tolist(), np.uint8)
    render(folder / 'sequences' / 'jump', jump.tolist(), np.uint16)
    (folder / 'sequences' / 'list.txt').write_text('drift\njump\n')
    (folder / 'trackers.ini').write_text('\n'.join(
        f'[{name}]\nprotocol = trax\n'
        f'command = {shlex.quote(sys.executable)} -m lmsco_ros.evaluation.trax --preset {preset}\n'
        f'env_PYTHONPATH = {REPOSITORY}:{environment / "trax"}\n'
        for name, preset in (('lmsco', PRESET), ('broken', 'no_such_preset'))))
    stack = folder / 'stack.yaml'
    stack.write_text(STACK)
    call(environment / 'bin' / 'python', '-m', 'vot', 'initialize', stack,
         '--workspace', folder, '--nodownload', folder=folder.parent)
    return folder


def current_workspace(folder, sequences, experiment):
    """Make a workspace of the current toolkit, with one experiment and both ways to us."""
    shutil.copytree(sequences, folder / 'sequences')
    for path in (folder / 'sequences').glob('*/sequence'):
        marks = [1, *[0] * (FRAMES - 2), -1]
        (path.parent / 'anchor.value').write_text('\n'.join(map(str, marks)))
    (folder / 'trackers.ini').write_text(
        f'[python]\nprotocol = python\narg_preset = {PRESET}\n'
        'command = lmsco_ros.evaluation.vot_tracker:Tracker\n'
        f'[trax]\nprotocol = trax\n'
        f'command = {shlex.quote(sys.executable)} -m lmsco_ros.evaluation.trax '
        f'--preset {PRESET}\n')
    (folder / 'stack.yaml').write_text(
        f'title: Current\nexperiments:\n  one:\n    type: {experiment}\n')
    return folder


@pytest.fixture
def current(tmp_path, workspace):
    """Return a function that runs an experiment of the current toolkit and what it said."""
    environment = environment_of(CURRENT)
    # In Python the toolkit needs whatever the tracker needs.
    path = f'PYTHONPATH={REPOSITORY}:{environment / "trax"}:{sysconfig.get_path("purelib")}'
    vot = 'env', path, environment / 'bin' / 'python', '-m', 'vot'

    def run(experiment, tracker):
        folder = current_workspace(tmp_path, workspace / 'sequences', experiment)
        call(*vot, 'initialize', folder / 'stack.yaml', '--workspace', folder, '--nodownload',
             folder=folder.parent)
        return folder, call(*vot, 'evaluate', '--workspace', folder, tracker,
                            folder=folder.parent, may_fail=True)
    return run


@pytest.mark.parametrize('tracker', ['python', 'trax'])
def test_the_current_toolkit_finds_in_one_pass_what_we_find(current, tracker):
    folder, said = current('unsupervised', tracker)
    assert 'Evaluation concluded' in said
    for sequence in scan_dataset(folder / 'sequences').sequences:
        results = folder / 'results' / tracker / 'one' / sequence.name
        confidence = (results / f'{sequence.name}_001_confidence.value').read_text().split()
        ours = run_one_pass(resolve(PRESET).build(), sequence).scores[1:]
        np.testing.assert_allclose(np.array(confidence[1:], float), ours, atol=1e-3)


@pytest.mark.parametrize('experiment, tracker, reason', [
    ('supervised', 'python', "'list' object has no attribute 'properties'"),
    ('supervised', 'trax', 'multiple objects were provided for initialization'),
    ('multistart', 'python', 'ObjectQuery.state must be a Region'),
    ('multistart', 'trax', 'ObjectQuery.state must be a Region')])
def test_the_current_toolkit_cannot_start_again(current, experiment, tracker, reason):
    """With a toolkit in which this fails, `docs/vot.md` can promise more."""
    assert reason in current(experiment, tracker)[1]


@pytest.fixture(scope='module')
def toolkit_figures(workspace, environment):
    """Return the toolkit's accuracy and failures by sequence, and its expected overlap."""
    vot = environment / 'bin' / 'python', '-m', 'vot'
    for command in (('evaluate',), ('analysis', '--name', 'figures')):
        call(*vot, *command, '--workspace', workspace, 'lmsco', folder=workspace.parent)
    report = json.loads((workspace / 'analysis' / 'figures.json').read_text())
    by_sequence, ((expected,),) = report['results']['baseline']['results']
    return {name: figures[:2] for name, figures in zip(report['sequences'], by_sequence)}, expected


@pytest.fixture(scope='module')
def traces(workspace):
    """Return each sequence with what our own supervised run recorded on it."""
    tracker = resolve(PRESET).build()
    return {sequence.name: (sequence, run_supervised(tracker, sequence))
            for sequence in scan_dataset(workspace / 'sequences').sequences}


def whole_pixels(boxes):
    """Round boxes as the toolkit does before it counts common pixels."""
    return np.round(boxes)


def test_failures_agree(toolkit_figures, traces):
    by_sequence, _ = toolkit_figures
    ours = {name: len(trace.failures) for name, (_, trace) in traces.items()}
    assert ours == {name: failures for name, (_, failures) in by_sequence.items()}
    assert ours == {'drift': 0, 'jump': 2}


@pytest.mark.parametrize('rounding, tolerance', [(whole_pixels, 1e-3), (np.asarray, 2e-2)],
                         ids=['in whole pixels', 'as reported'])
def test_accuracy_agrees(rounding, tolerance, toolkit_figures, traces):
    by_sequence, _ = toolkit_figures
    for name, (sequence, trace) in traces.items():
        overlap = overlaps(sequence.ground_truth, rounding(trace.boxes), SIZE)
        ours = accuracy(overlap, trace.starts, trace.failures)
        theirs = by_sequence[name][0]
        print(f'{name}: toolkit {theirs:.4f}, ours {ours:.4f}')
        assert ours == pytest.approx(theirs, abs=tolerance)
        assert 0.5 < theirs < 0.95


@pytest.mark.parametrize('rounding, tolerance', [(whole_pixels, 1e-3), (np.asarray, 2e-2)],
                         ids=['in whole pixels', 'as reported'])
def test_expected_overlap_agrees(rounding, tolerance, toolkit_figures, traces):
    parts = [part for sequence, trace in traces.values() for part in fragments(
        overlaps(sequence.ground_truth, rounding(trace.boxes), SIZE),
        trace.starts, trace.failures)]
    curve = expected_overlap_curve(*curve_terms(parts, longest_fragment(parts)))
    ours = float(expected_average_overlap(curve, INTERVAL))
    print(f'expected overlap: toolkit {toolkit_figures[1]:.4f}, ours {ours:.4f}')
    assert ours == pytest.approx(toolkit_figures[1], abs=tolerance)


def test_the_toolkit_keeps_confidence_and_state(toolkit_figures, workspace, traces):
    results = workspace / 'results' / 'lmsco' / 'baseline' / 'drift'
    confidence = (results / 'drift_001_confidence.value').read_text().splitlines()
    np.testing.assert_allclose(np.array(confidence[1:], float), traces['drift'][1].scores[1:],
                               atol=1e-3)
    assert set((results / 'drift_001_state.value').read_text().split()) == {'tracking'}


def test_the_toolkit_learns_why_a_tracker_failed(workspace, environment):
    output = call(environment / 'bin' / 'python', '-m', 'vot', 'evaluate', '--workspace',
                  workspace, 'broken', folder=workspace.parent)
    assert 'Server terminated the session: unknown preset' in output
    assert 'Evaluation interrupted by tracker error' in output

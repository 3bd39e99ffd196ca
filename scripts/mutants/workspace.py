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

"""The tests run on a copy of the sources, in a process that has everything else imported."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
import multiprocessing
import os
from pathlib import Path
import shutil
import sys

__all__ = ['Outcome', 'Workspace']

# What takes long to import and is not changed.
_IMPORTED_ONCE = ('array_api_compat.numpy', 'cv2', 'hypothesis', 'numpy', 'pytest', 'scipy.fft',
                  'scipy.linalg', 'scipy.special', 'torch', 'yaml')


class Outcome(Enum):
    """What the tests made of a copy."""

    PASSED = 'passed'
    NOTICED = 'noticed'
    ENDLESS = 'endless'


class Workspace:
    """
    A copy of the sources and their tests.

    Parameters
    ----------
    repository : Path
        Where they are copied from.
    folder : Path
        Where they are copied to.
    contents : sequence of str
        Folders and files of the repository.

    """

    def __init__(self, repository: Path, folder: Path, contents: Sequence[str]) -> None:
        self._folder = folder
        for name in contents:
            if (repository / name).is_dir():
                shutil.copytree(repository / name, folder / name,
                                ignore=shutil.ignore_patterns('__pycache__', '.*'))
            else:
                shutil.copy(repository / name, folder / name)
        self._processes = multiprocessing.get_context('forkserver')
        self._processes.set_forkserver_preload(list(_IMPORTED_ONCE))

    def try_out(self, module: str, source: str, tests: Sequence[str],
                seconds: float | None = None) -> Outcome:
        """
        Return what the tests make of a module with another text; the copy is as before then.

        Parameters
        ----------
        module : str
            Path in the repository.
        source : str
            Its text in this run.
        tests : sequence of str
            Paths of tests in the repository, in the order in which they run.
        seconds : float, optional
            After which time the tests are taken for endless; by default they are waited for.

        """
        path = self._folder / module
        original = path.read_text(encoding='utf-8')
        self._write(path, source)
        try:
            return self._run(tests, seconds)
        finally:
            self._write(path, original)

    def _write(self, path: Path, source: str) -> None:
        """Write a module; what was compiled of a former text may look as new as this one."""
        path.write_text(source, encoding='utf-8')
        for compiled in path.parent.glob(f'__pycache__/{path.stem}.*.pyc'):
            compiled.unlink()

    def _run(self, tests: Sequence[str], seconds: float | None) -> Outcome:
        """Run the tests in a process of their own."""
        process = self._processes.Process(
            target=_run_tests, args=(str(self._folder), tuple(tests)))
        process.start()
        process.join(seconds)
        if process.is_alive():
            process.kill()
            process.join()
            return Outcome.ENDLESS
        return Outcome.NOTICED if process.exitcode else Outcome.PASSED


def _run_tests(folder: str, tests: tuple[str, ...]) -> None:
    """Run tests against the sources in a folder, and end with the status of pytest."""
    silence = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(silence, stream)
    os.chdir(folder)
    os.environ.update(CI='1', PYTHONPATH=folder)
    sys.path.insert(0, folder)
    sys.dont_write_bytecode = False
    import pytest

    # The search for unraisable exceptions at the end takes as long as many a test.
    os._exit(pytest.main(['-x', '-q', '-p', 'no:cacheprovider', '-p', 'no:unraisableexception',
                          *tests]))

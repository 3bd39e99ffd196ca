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

"""A missing extra is told in one line that names it, by every command and library call."""

from pathlib import Path
import subprocess
import sys

import pytest

from lmsco_ros.extras import MissingExtraError, MODULES, require_extra

REPOSITORY = Path(__file__).resolve().parents[2]
# In front of everything else, as if they had never been installed.
HIDE = """
import sys

class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name in {hidden!r}:
            raise ModuleNotFoundError(f'No module named {{name!r}}', name=name)

sys.meta_path.insert(0, Hidden())
"""
COMMAND = "sys.argv = ['lmsco', *{words!r}]; from lmsco_ros.cli.main import main; main()"


def run_without(extras, code):
    """Run code in a process that has the modules hidden which only these extras bring."""
    others = {name for extra in set(MODULES) - set(extras) for name in MODULES[extra]}
    names = {name for extra in extras for name in MODULES[extra]} - others
    hidden = names | {name.split('.')[0] for name in names}
    return subprocess.run(
        [sys.executable, '-c', HIDE.format(hidden=hidden) + code], cwd=REPOSITORY,
        capture_output=True, text=True)


@pytest.mark.parametrize('words, extra', [
    (('--help',), 'cli'),
    (('track', 'frames', '--init', '1,2,3,4'), 'cli'),
    (('weights', 'list'), 'cli'),
    (('evaluate', '.', '--output', 'never'), 'eval'),
    (('evaluate', '.', '--output', 'never', '--engine', 'dask'), 'cluster'),
    (('results', '.', '--page', 'never'), 'eval'),
    (('weights', 'fetch', 'vgg_m_2048', '--directory', 'never'), 'weights'),
    (('weights', 'list'), 'weights'),
])
def test_every_command_names_the_extra_that_it_lacks(words, extra):
    done = run_without([extra], COMMAND.format(words=list(words)))
    assert done.returncode == 1 and not done.stdout
    (line,) = done.stderr.splitlines()
    assert line.startswith('error: ') and line.endswith(f"pip install 'lmsco_ros[{extra}]'")


@pytest.mark.parametrize('call, extra', [
    ("from lmsco_ros.core.weights.acquisition import fetch_weights; fetch_weights('vgg_m_2048')",
     'weights'),
    ("from lmsco_ros.core import LMSCOTracker; LMSCOTracker('paper')", 'weights'),
    ("from lmsco_ros.core.weights.formats import read_arrays; read_arrays(Path('a.caffemodel'))",
     'weights'),
    ("from lmsco_ros.media.video import VideoFile; VideoFile(Path('a.mp4'))", 'cli'),
    ("from lmsco_ros.media.film import FilmWriter; FilmWriter(Path('a.mp4'), 30)", 'cli'),
    ('import lmsco_ros.replay.sources', 'cli'),
    ('import lmsco_ros.evaluation.report.page', 'eval'),
])
def test_library_calls_name_the_extra_that_they_lack(tmp_path, call, extra):
    (tmp_path / 'a.caffemodel').touch()
    begin = f'import os; os.environ.pop("LMSCO_WEIGHTS_DIR", 0); os.chdir({str(tmp_path)!r})'
    # What films and plots need comes with either of the two.
    done = run_without({extra, 'eval'}, f'sys.path.insert(0, {str(REPOSITORY)!r}); {begin}\n'
                       f'from pathlib import Path; {call}')
    last = done.stderr.splitlines()[-1]
    assert last.startswith('lmsco_ros.extras.MissingExtraError: ')
    assert last.endswith(f"pip install 'lmsco_ros[{extra}]'")


@pytest.mark.parametrize('preset', ['default', 'hcs'])
def test_trackers_need_no_extra(preset):
    code = f"from lmsco_ros.core import LMSCOTracker; LMSCOTracker('{preset}')"
    assert run_without(MODULES, code).returncode == 0


def test_only_what_is_missing_is_told(monkeypatch):
    monkeypatch.setitem(MODULES, 'cli', ('json', 'no_such_module', 'no_such.module'))
    require_extra('cli', 'reading', 'json')
    with pytest.raises(MissingExtraError, match='^reading needs the extra `cli`, of which '
                                                'no_such_module, no_such.module is not'):
        require_extra('cli', 'reading')

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

"""What docs/performance.md names is there: benchmarks with their options, and pictures."""

from importlib import import_module
from pathlib import Path
import re

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = (REPOSITORY / 'docs' / 'performance.md').read_text()
COMMANDS = re.findall(r'^python -m (benchmarks\.\w+)(.*)$', PAGE, re.M)
CONFIGURATIONS = re.findall(r'config:\$C/([\w.]+)', PAGE)
PICTURES = re.findall(r'\]\((images/[\w.]+)\)', PAGE)
PICTURE_BYTES = 100_000


def test_page_has_commands_configurations_and_pictures():
    """Or else the tests below would pass on an empty page."""
    assert len(COMMANDS) >= 6 and len(CONFIGURATIONS) >= 2 and len(PICTURES) >= 3


@pytest.mark.parametrize('module, options', COMMANDS)
def test_commands_have_the_options_that_are_given(module, options, capsys):
    with pytest.raises(SystemExit) as end:
        import_module(module).main(['--help'])
    assert end.value.code == 0
    known = set(re.findall(r'--[\w-]+', capsys.readouterr().out))
    assert set(re.findall(r'--[\w-]+', options)) <= known


@pytest.mark.parametrize('name', CONFIGURATIONS)
def test_configurations_are_there(name):
    assert (REPOSITORY / 'benchmarks' / 'configurations' / name).is_file()


@pytest.mark.parametrize('picture', PICTURES)
def test_pictures_are_there_and_small(picture):
    assert (REPOSITORY / 'docs' / picture).stat().st_size < PICTURE_BYTES

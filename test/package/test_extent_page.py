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

"""What docs/extent.md and training/README.md say of networks and fusion is what there is."""

import csv
from dataclasses import astuple
from importlib import import_module
from pathlib import Path
import re
import sys

import pytest

from lmsco_ros.core import track
from lmsco_ros.core.extent import fusion
from lmsco_ros.core.imaging import regions
from lmsco_ros.core.presence import trust
from lmsco_ros.core.weights.registry import find_source
from training.extent.bodies import PLANS

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = (REPOSITORY / 'docs' / 'extent.md').read_text()
CARD = (REPOSITORY / 'training' / 'README.md').read_text()
LOGS = REPOSITORY / 'training' / 'logs'
WEIGHTS = REPOSITORY / 'lmsco_ros' / 'core' / 'weights'
COMMANDS = sorted(set(re.findall(r'^(?:  )?python -m ((?:training|benchmarks)[\w.]+)([^#\n]*)',
                                 PAGE + CARD, re.M)))
NETWORKS = [path.stem for path in WEIGHTS.glob('*.safetensors')]
UNITS = {'kB': 1e3, 'MB': 1e6}


def rows(text, heading):
    """Return the cells below the row of headings that begins so, in a table of a page."""
    table = text.split(f'\n| {heading} |')[1].split('\n\n')[0]
    return [[cell.strip() for cell in line.strip('|').split('|')]
            for line in table.splitlines()[2:]]


def records(name):
    """Return the rows of a log or a report."""
    with (LOGS / f'{name}.csv').open(encoding='utf-8') as stream:
        return list(csv.DictReader(stream))


def number(text):
    """Return a number as the pages write it: without a leading zero, with a real minus sign."""
    return float(text.replace('−', '-').replace(',', ''))


def test_pages_name_commands_and_networks():
    """Or else the tests below would pass on empty pages."""
    assert len(COMMANDS) >= 8 and len(NETWORKS) == 3


def test_report_of_the_network_is_that_of_its_training():
    told = rows(PAGE, 'source | expected')
    assert [[name, *map(number, figures)] for name, *figures in told] == [
        [name, *map(float, figures)]
        for name, *figures in (row.values() for row in records('extent_report'))]


@pytest.mark.parametrize('name', [*NETWORKS, 'extent_first'])
def test_log_on_the_card_is_that_of_the_training(name):
    first, *_, last = records(f'{name}_log')
    (steps, loss, accuracy), = (row[1:] for row in rows(CARD, 'network | steps')
                                if row[0] == name)
    assert number(steps) == float(last['step'])
    for told, key in ((loss, 'validation_loss'), (accuracy, 'validation_accuracy')):
        figures = [number(part) for part in re.findall(r'−?\d*\.\d+', told)]
        assert figures == pytest.approx([float(first[key]), float(last[key])], abs=6e-4)


@pytest.mark.parametrize('name', NETWORKS)
def test_size_on_the_card_is_that_of_the_network(name):
    source = find_source(name)
    row, = (row for row in rows(CARD, 'network | file') if row[1] == f'`{source.file_name}`')
    parameters, size = row[4:]
    assert row[0] == f'`{source.architecture.__name__}`'
    counted = sum(value.numel() for value in source.architecture().parameters())
    assert int(parameters.split()[0]) == round(counted / 1000)
    value, unit = size.split(',')[0].split()
    assert float(value) * UNITS[unit] == pytest.approx(
        (WEIGHTS / source.file_name).stat().st_size, rel=2e-2)


@pytest.mark.parametrize('module, options', COMMANDS)
def test_commands_have_the_options_that_are_given(module, options, capsys, monkeypatch):
    monkeypatch.setattr(sys, 'argv', [module, '--help'])
    with pytest.raises(SystemExit) as end:
        import_module(module).main()
    assert end.value.code == 0
    known = set(re.findall(r'--[\w-]+', capsys.readouterr().out))
    assert set(re.findall(r'--[\w-]+', options)) <= known


def test_constants_of_the_fusion_are_those_of_the_code():
    told = {name: float(value) for name, value, *_ in rows(PAGE, 'name | value')}
    assert told == {
        'drawn': fusion._DRAWN, 'drawn pixels': fusion._DRAWN_PIXELS, 'found': fusion._FOUND,
        'change': fusion._CHANGE,
        'border': fusion._CHANGE_AT_BORDER, 'convention': fusion._CONVENTION,
        'unclear': fusion._UNCLEAR, 'sharp': fusion._SHARP_PIXELS,
        'settling': fusion._SETTLING, 'anchoring': fusion._ANCHORING,
        'outgrown': track._OUTGROWN, 'sure': track._SURE}
    assert f'{regions._BORDER_PIXELS} pixels away' in PAGE
    assert f'at least {fusion._SMALLEST_SIDE:g} pixels' in PAGE


def test_coefficients_on_the_card_are_those_of_the_code():
    told = [[number(figure) for figure in figures]
            for _, *figures in rows(CARD, 'coefficients in use')]
    assert told == [[*astuple(model)] for model in (
        trust.MEASURED, trust.UNMEASURED, trust.BELIEF_MEASURED, trust.BELIEF_UNMEASURED)]


def test_all_plans_of_bodies_are_named():
    told = re.search(r'plans \(([^)]*)\)', PAGE)[1]
    told = told.replace('low and sitting animal', 'low animal, sitting animal')
    assert ' '.join(told.split()).split(', ') == list(PLANS)

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

"""The pages are built without a warning, and say of configurations and versions what is so."""

from dataclasses import fields
import importlib.util
from pathlib import Path
import re
import shutil
import subprocess
import sys

from catkin_pkg.package import parse_package
import pytest
import yaml

import lmsco_ros
from lmsco_ros.core import TrackerConfig
from lmsco_ros.core.config import ChannelConfig, FeatureConfig

REPOSITORY = Path(__file__).resolve().parents[2]
DOCS = REPOSITORY / 'docs'
TUNING = (DOCS / 'tuning.md').read_text()
PAPER_TITLE = 'Large Margin Structured Convolution Operator for Thermal Infrared Object Tracking'
AUTHORS = ('Peng Gao', 'Yipeng Ma', 'Ke Song', 'Chao Li', 'Fei Wang', 'Liyi Xiao')
YEAR = 2018


def load_script(name):
    """Import a script, which belongs to no package."""
    spec = importlib.util.spec_from_file_location(name, REPOSITORY / 'scripts' / f'{name}.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def yaml_blocks(text):
    """Return the parsed YAML blocks of a page."""
    return [yaml.safe_load(block) for block in re.findall(r'```yaml\n(.*?)```', text, re.S)]


def keys(config):
    """Return section.key of everything that can be set, and the sections."""
    sections = {field.name: getattr(config, field.name) for field in fields(config)}
    return {*sections, *(f'{name}.{field.name}' for name, section in sections.items()
                         if name != 'features' for field in fields(section))}


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_pages_are_built_without_a_warning(tmp_path):
    pytest.importorskip('sphinx', reason='needs Sphinx')
    pytest.importorskip('myst_parser', reason='needs MyST')
    pytest.importorskip('rclpy', reason='needs ROS 2')
    # Of a copy, since the list of modules is written beside the pages.
    for folder in ('docs', 'examples'):
        shutil.copytree(REPOSITORY / folder, tmp_path / folder,
                        ignore=shutil.ignore_patterns('api', '__pycache__'))
    done = subprocess.run(
        [sys.executable, '-m', 'sphinx', '-W', '--keep-going', '-q', 'docs', 'pages'],
        cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    built = (tmp_path / 'pages' / 'api' / 'lmsco_ros.core.tracker.html').read_text()
    assert 'LMSCOTracker' in built and 'BusyError' in built


def test_every_page_is_in_the_table_of_contents():
    listed = re.findall(r'^(\w+)$', (DOCS / 'index.md').read_text(), re.M)
    assert sorted(listed) == sorted(page.stem for page in DOCS.glob('*.md')
                                    if page.stem != 'index')


@pytest.mark.parametrize('page', sorted(DOCS.glob('*.md')), ids=lambda path: path.stem)
def test_links_lead_to_files_and_headings(page):
    for target, _, heading in re.findall(r'\]\(([^)#:\s]*)(#([\w-]+))?\)', page.read_text()):
        linked = (page.parent / target).resolve() if target else page
        assert linked.exists(), f'{page.name} links to {target}'
        if heading:
            headings = {re.sub(r'[^\w -]', '', line.lstrip('# ').lower()).replace(' ', '-')
                        for line in linked.read_text().splitlines() if line.startswith('#')}
            assert heading in headings, f'{page.name} links to {target}#{heading}'


def test_reference_of_the_configuration_is_up_to_date():
    page = load_script('configuration_page').page()
    assert (DOCS / 'configuration.md').read_text() == page, (
        'run: python scripts/configuration_page.py')


def test_reference_of_the_configuration_has_every_key():
    page = (DOCS / 'configuration.md').read_text()
    for name in keys(TrackerConfig.preset('default')):
        section, _, key = name.partition('.')
        text = page.split(f'\n## {section}\n')[-1].split('\n## ')[0]
        assert f'`{key or section}`' in text or not key, name
    for field in (*fields(FeatureConfig), *fields(ChannelConfig)):
        assert f'`{field.name}`' in page.split('\n## Feature blocks\n')[1]


def test_ranges_in_the_reference_are_those_of_the_checks():
    page = (DOCS / 'configuration.md').read_text()
    assert re.search(r'\| `margin_weight` \|.*\| \(0, 1e\+06\] \|', page)
    assert re.search(r'\| `update_interval` \|.*\| \[1, 1000\] \|', page)
    assert re.search(r'\| `kind` \|.*\| `hog`, `intensity`, `appearance`, `motion`, `flow` \|',
                     page)
    assert re.search(r'\| `uncertain`, `certain` \|.*\| \[`lost`, 1\], \[`uncertain`, 1\] \|',
                     page)


@pytest.mark.parametrize('page', ['tuning', 'configuration'])
def test_configurations_on_the_pages_are_accepted_and_change_something(page):
    blocks = yaml_blocks((DOCS / f'{page}.md').read_text())
    assert len(blocks) >= 3
    default = TrackerConfig.preset('default')
    for block in blocks:
        same = block.get('features') == default.to_dict()['features'] or page == 'configuration'
        assert TrackerConfig.from_dict(block) != default or same


@pytest.mark.parametrize('page', ['tuning', 'paper', 'architecture', 'extent'])
def test_keys_that_the_pages_name_exist(page):
    known = keys(TrackerConfig.preset('default'))
    sections = '|'.join(field.name for field in fields(TrackerConfig))
    named = set(re.findall(rf'`((?:{sections})\.\w+)`', (DOCS / f'{page}.md').read_text()))
    assert {name for name in named if not name.endswith('.py')} <= known


def test_tuning_says_for_every_scene_how_to_see_that_it_helped():
    scenes = TUNING.split('\n## ')[2:]
    assert len(scenes) == 5
    assert all('```yaml' in scene and '\nSee: ' in scene for scene in scenes)


def test_the_paper_is_named_where_people_look():
    readme = (REPOSITORY / 'README.md').read_text()
    citation = yaml.safe_load((REPOSITORY / 'CITATION.cff').read_text())['preferred-citation']
    names = [f'{author["given-names"]} {author["family-names"]}'
             for author in citation['authors']]
    assert (citation['title'], citation['year'], tuple(names)) == (PAPER_TITLE, YEAR, AUTHORS)
    for text in (readme, (DOCS / 'paper.md').read_text(), lmsco_ros.__doc__):
        plain = ' '.join(text.replace('>', ' ').split())
        assert PAPER_TITLE in plain and str(YEAR) in plain
        assert all(author in plain for author in AUTHORS)


def test_version_is_the_same_everywhere():
    citation = yaml.safe_load((REPOSITORY / 'CITATION.cff').read_text())
    package = parse_package(REPOSITORY / 'package.xml')
    assert lmsco_ros.__version__ == package.version == str(citation['version'])
    changes = (REPOSITORY / 'CHANGELOG.rst').read_text()
    released = re.findall(r'^(\d+\.\d+\.\d+) \(', changes, re.M)
    assert released[:1] == [package.version]


def test_rosdoc2_finds_its_settings():
    package = parse_package(REPOSITORY / 'package.xml')
    name, = (export.content for export in package.exports if export.tagname == 'rosdoc2')
    head, settings = yaml.safe_load_all((REPOSITORY / name).read_text())
    assert head == {'type': 'rosdoc2 config', 'version': 1}
    folders = [builder['sphinx']['sphinx_sourcedir'] for builder in settings['builders']]
    assert [(REPOSITORY / folder / 'conf.py').is_file() for folder in folders] == [True]


def test_release_names_every_place_of_the_version():
    text = (REPOSITORY / 'RELEASING.md').read_text()
    for place in ('lmsco_ros/__init__.py', 'package.xml', 'CITATION.cff', 'CHANGELOG.rst'):
        assert f'`{place}`' in text


def test_the_version_that_is_released_is_one_that_is_mended():
    """And the declaration says of 1.0.0 and more what it says of nothing less."""
    policy = (REPOSITORY / 'SECURITY.md').read_text()
    rows = re.findall(r'^\| (\d+\.\d+).*\| yes \|$', policy, re.M)
    assert lmsco_ros.__version__.rpartition('.')[0] in rows
    declaration = (REPOSITORY / 'QUALITY_DECLARATION.md').read_text()
    stated = re.search(r'^\| 1\.ii stable version \| (.*) \|$', declaration, re.M)
    assert stated[1] == lmsco_ros.__version__ and not stated[1].startswith('0.')


def test_what_is_deprecated_and_how_long_is_told():
    promise = (REPOSITORY / 'RELEASING.md').read_text().split('\n## What a number promises\n')[1]
    assert '`DeprecationWarning`' in promise and '(docs/public_api.md)' in promise


def test_page_of_the_paper_quotes_figures_of_the_results():
    results = (DOCS / 'results.md').read_text().split('## All sequences')[1]
    quoted = re.findall(r'\[in all\]\(results\.md\): ([^|]*)', (DOCS / 'paper.md').read_text())
    figures = {figure for cell in quoted for figure in re.findall(r'\.\d{2,3}\b', cell)}
    assert len(quoted) == 2 and figures
    assert figures <= set(re.findall(r'\.\d{2,3}\b', results))

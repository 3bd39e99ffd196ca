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

"""What others' machines run of the repository is well formed and names what is there."""

import json
from pathlib import Path
import re

import pytest
import yaml

REPOSITORY = Path(__file__).resolve().parents[2]
WORKFLOWS = sorted((REPOSITORY / '.github' / 'workflows').glob('*.yml'))
FORMS = sorted((REPOSITORY / '.github' / 'ISSUE_TEMPLATE').glob('*.yml'))
DOCKERFILES = sorted((REPOSITORY / 'docker').glob('Dockerfile*'))
TARGETS = set(re.findall(r'^(\w+):', (REPOSITORY / 'Makefile').read_text(), re.M))


def steps(path):
    """Return the commands of a workflow."""
    jobs = yaml.safe_load(path.read_text(encoding='utf-8'))['jobs'].values()
    return [step['run'] for job in jobs for step in job['steps'] if 'run' in step]


def test_there_are_workflows_forms_and_containers():
    """Or else the tests below would pass on nothing."""
    assert {path.stem for path in WORKFLOWS} == {'docs', 'release', 'test'}
    assert len(FORMS) == 2 and len(DOCKERFILES) == 2


@pytest.mark.parametrize('path', WORKFLOWS, ids=lambda path: path.stem)
def test_workflows_call_targets_that_there_are_and_end(path):
    content = yaml.safe_load(path.read_text(encoding='utf-8'))
    # YAML reads the key `on` as true.
    assert content[True] and content['permissions']
    assert all(job['timeout-minutes'] <= 60 for job in content['jobs'].values())
    called = {name for command in steps(path) for name in re.findall(r'\bmake (\w+)', command)}
    assert called <= TARGETS and called


def test_python_versions_are_those_of_the_package():
    (test,) = (path for path in WORKFLOWS if path.stem == 'test')
    jobs = yaml.safe_load(test.read_text(encoding='utf-8'))['jobs']
    wheels = {item['python'] for item in jobs['wheels']['strategy']['matrix']['include']}
    tested = wheels | set(jobs['plain']['strategy']['matrix']['python'])
    listed = re.findall(r'Python :: (3\.\d+)', (REPOSITORY / 'pyproject.toml').read_text())
    assert tested == set(listed) and jobs['jazzy']['container'] == 'ros:jazzy'


def test_what_runs_without_ros_is_there():
    (test,) = (path for path in WORKFLOWS if path.stem == 'test')
    (command,) = (line for line in steps(test) if '-m pytest' in line)
    folders = re.findall(r'\btest/\w+', command)
    assert len(folders) >= 5 and all((REPOSITORY / folder).is_dir() for folder in folders)
    assert 'test/node' not in folders


@pytest.mark.parametrize('path', FORMS, ids=lambda path: path.stem)
def test_forms_ask_for_something(path):
    form = yaml.safe_load(path.read_text(encoding='utf-8'))
    assert form['name'] and form['description']
    identities = [item['id'] for item in form['body']]
    assert len(set(identities)) == len(identities)
    assert any(item['validations']['required'] for item in form['body'] if 'validations' in item)


@pytest.mark.parametrize('path', DOCKERFILES, ids=lambda path: path.name)
def test_what_containers_copy_is_there(path):
    sources = re.findall(r'^COPY (\S+) ', path.read_text(), re.M)
    assert sources and all((REPOSITORY / source).exists() for source in sources)
    extras = re.findall(r"'\.\[(.*?)\]'", path.read_text())
    known = re.findall(r'^([\w-]+) = \[', (REPOSITORY / 'pyproject.toml').read_text(), re.M)
    assert all(set(names.split(',')) <= set(known) for names in extras)


def test_development_container_is_that_of_the_tests():
    content = json.loads((REPOSITORY / '.devcontainer' / 'devcontainer.json').read_text())
    assert content['image'] == 'ros:jazzy' and 'make venv' in content['postCreateCommand']

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

"""What docs/field.md names is there: tests, challenges and pictures."""

from pathlib import Path
import re

import pytest

from lmsco_ros.evaluation.challenges import CHALLENGES

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = (REPOSITORY / 'docs' / 'field.md').read_text()
TESTS = sorted(set(re.findall(r'`(test/[\w/]+\.py)::(\w+)`', PAGE)))
PICTURES = sorted(set(re.findall(r'\]\((images/[\w.]+)\)', PAGE)))
PICTURE_BYTES = 400_000


def test_every_case_names_a_test():
    cases = [line for line in PAGE.split('\n## Half an hour')[0].splitlines()
             if line.startswith('| ') and not line.startswith('| case')]
    assert len(cases) > 30 and all('`test/' in line for line in cases)


@pytest.mark.parametrize('file, name', TESTS)
def test_named_tests_exist(file, name):
    assert re.search(rf'^ *def {name}\(', (REPOSITORY / file).read_text(), re.M)


def test_every_challenge_stands_beside_a_case():
    cases = PAGE.split('\n## Half an hour')[0]
    assert not [name for name in CHALLENGES if f'`{name}`' not in cases]


def test_links_within_the_page_lead_somewhere():
    headings = {re.sub(r'[^\w -]', '', line.lstrip('# ').lower()).replace(' ', '-')
                for line in PAGE.splitlines() if line.startswith('#')}
    assert set(re.findall(r'\]\(#([\w-]+)\)', PAGE)) <= headings


@pytest.mark.parametrize('picture', PICTURES)
def test_pictures_are_there_and_small(picture):
    assert (REPOSITORY / 'docs' / picture).stat().st_size < PICTURE_BYTES

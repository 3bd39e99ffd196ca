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

"""Every layout and every form of rows that the page of datasets shows is read as it says."""

from pathlib import Path
import re

import cv2
import numpy as np
import pytest

from lmsco_ros.evaluation.datasets import scan_dataset
from lmsco_ros.evaluation.datasets.boxes_text import read_boxes
from lmsco_ros.evaluation.errors import SequenceError

PAGE = (Path(__file__).resolve().parents[2] / 'docs/datasets.md').read_text(encoding='utf-8')
LAYOUTS = [(title, block) for title, chapter in re.findall(
    r'^### (.*?)\n(.*?)(?=^##)', PAGE, re.M | re.S)
    for block in re.findall(r'```text\n(.*?)```', chapter, re.S)]
ROW_TABLES = PAGE.split('## Rows of ground truth')[1].split('\n|---')


def rows_of(text):
    """Return the rows that are parted by the sign of the return key."""
    return [row.strip() for row in text.split('⏎')]


def boxes_of(text):
    """Return boxes as the page writes them."""
    return np.array([[np.nan] * 4 if row == 'absent' else [float(word) for word in row.split(',')]
                     for row in rows_of(text)])


def write(path, content):
    """Write a file of a tree, by the ending of its name."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix in ('.jpg', '.png'):
        cv2.imwrite(str(path), np.full((48, 64), 90, np.uint8))
    elif path.suffix == '.avi':
        film = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*'MJPG'), 25, (64, 48))
        for _ in range(int(content.split()[0])):
            film.write(np.full((48, 64, 3), 90, np.uint8))
        film.release()
    else:
        path.write_text('\n'.join(rows_of(content)) + '\n', encoding='utf-8')


def build(root, tree):
    """Write the files of a tree below `root`."""
    folders = []
    for line in tree.splitlines():
        depth = (len(line) - len(line.lstrip())) // 2
        names, _, content = line.strip().partition('  ')
        folders[depth:] = [names.rstrip('/')] if names.endswith('/') else []
        if not names.endswith('/'):
            for name in names.split():
                write(root.joinpath(*folders, name), content.strip())


@pytest.mark.parametrize(('title', 'block'), LAYOUTS, ids=[title for title, _ in LAYOUTS])
def test_tree_of_the_page_is_read_as_it_says(tmp_path, title, block):
    """The tree is built as a miniature."""
    tree, *outcomes = re.split(r'^=> ', block, flags=re.M)
    build(tmp_path, tree)
    scan = scan_dataset(tmp_path)
    found = {item.full_name: item.ground_truth for item in scan.sequences}
    refusals = [item.reason for item in scan.broken]
    for outcome in map(str.strip, outcomes):
        name, told = outcome.split(': ', 1)
        if name == 'refused':
            assert told in refusals.pop(0)
        else:
            np.testing.assert_allclose(found.pop(name), boxes_of(told), atol=1e-9)
    assert not found and not refusals


def table(number):
    """Return the cells of a table of the page."""
    lines = ROW_TABLES[number].split('\n\n')[0].splitlines()[1:]
    return [[cell.strip() for cell in line.strip('|').split('|')] for line in lines]


def write_rows(path, cell):
    path.write_text('\n'.join(rows_of(cell.strip('`'))), encoding='utf-8')
    return path


@pytest.mark.parametrize(('form', 'rows', 'told'), table(1))
def test_rows_of_the_page_are_read_as_it_says(tmp_path, form, rows, told):
    found = read_boxes(write_rows(tmp_path / 'rows.txt', rows))
    np.testing.assert_array_equal(found, boxes_of(told))


@pytest.mark.parametrize(('rows', 'reason'), table(2))
def test_rows_that_the_page_refuses_are_refused(tmp_path, rows, reason):
    with pytest.raises(SequenceError, match=re.escape(reason)):
        read_boxes(write_rows(tmp_path / 'rows.txt', rows))


def test_the_page_shows_every_layout():
    titles = {title for title, _ in LAYOUTS}
    assert titles == {'VOT and VOT-TIR', 'OTB, PTB-TIR and LSOTB-TIR', 'LaSOT', 'GOT-10k',
                      'TrackingNet', 'Anti-UAV', 'RGBT234, LasHeR and GTOT', 'VTUAV',
                      'A recording of your own'}
    assert len(LAYOUTS) == 14 and len(table(1)) == 8 and len(table(2)) == 9

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

"""The benchmark of the page: what it reckons, and a run of it."""

import numpy as np
import pytest

from benchmarks import page_latency
from msg_adapters.status import FrameStatus


def statuses(count, milliseconds, state='tracking'):
    """Return what a tracker says that takes a time for each frame."""
    return [FrameStatus(state, 1, 0.5, 0.0, milliseconds, 0)] * count


def test_report_compares_the_page_open_with_the_page_closed():
    closed, opened = page_latency.Turns(), page_latency.Turns()
    closed.add(10.0, statuses(300, 8.0))
    opened.add(5.0, statuses(130, 10.0))
    opened.add(5.0, statuses(130, 10.0) + statuses(10, 500.0, 'refused'))
    # 1 to 100 ms.
    printed = page_latency.report('somebody', np.arange(1, 101) / 1e3, closed, opened)
    assert '100 frames, somebody: median 50.5 ms, 95th percentile 95.0 ms' in printed
    rows = [[cell.strip() for cell in line.split('|')[2:5]] for line in printed.splitlines()[-3:]]
    assert rows == [['30.0', '27.0', '0.900'], ['8.00', '10.0', '0.800'], ['125', '100', '0.800']]


def test_report_tells_that_nothing_was_drawn():
    turns = page_latency.Turns()
    turns.add(1.0, statuses(30, 8.0))
    assert '0 frames, nobody: median nan' in page_latency.report('nobody', [], turns, turns)


def test_missing_browser_is_replaced_and_told(monkeypatch):
    monkeypatch.setattr(page_latency.shutil, 'which', lambda name: None)
    viewer = page_latency.make_viewer(with_browser=True)
    assert isinstance(viewer, page_latency.Client) and 'in place of a browser' in viewer.name


@pytest.mark.slow
def test_run_prints_all_figures(capsys, monkeypatch):
    monkeypatch.setattr(page_latency, 'WARM_UP_SECONDS', 0.5)
    page_latency.main(['--seconds', '1', '--turns', '2', '--no-browser'])
    printed = capsys.readouterr().out
    assert 'Camera to drawn frame, ' in printed and 'nan' not in printed
    assert '| frames answered in a second | ' in printed

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


"""A short run of the soak test: nothing grows, and what grows would be told."""

import importlib.util
from pathlib import Path
import sys

import pytest

SOAK = Path(__file__).resolve().parents[2] / 'benchmarks' / 'soak.py'


@pytest.fixture(scope='module')
def soak():
    """Load the script, which is no part of the package."""
    spec = importlib.util.spec_from_file_location('soak_script', SOAK)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


def test_nothing_grows_over_six_hundred_frames(soak, tmp_path):
    plan = soak.Plan(frames=600, every=60, warm_up=240, width=128, height=96, pictures=True)
    samples = list(soak.soak(plan))
    assert [sample.frames for sample in samples] == list(range(60, 601, 60))
    assert all(sample.tracked > 0 for sample in samples)
    # How long a frame takes is the machine's affair as long as tests run beside this one.
    assert not [text for text in soak.complaints(samples, plan.warm_up) if 'latency' not in text]
    soak.write_csv(samples, tmp_path / 'soak.csv')
    soak.plot(samples, plan.warm_up, tmp_path / 'soak.png')
    header, *rows = (tmp_path / 'soak.csv').read_text().splitlines()
    assert header.startswith('frames,elapsed_s,rss_mib,threads') and len(rows) == 10
    assert (tmp_path / 'soak.png').stat().st_size > 10_000


@pytest.mark.parametrize('field, values, word', [
    ('rss_mib', [100, 101, 101.9, 101.5, 90], ''),
    ('rss_mib', [100, 101, 102, 103, 104], 'memory grew by 4.0%'),
    ('threads', [5, 5, 5, 6, 5], 'threads grew from 5 to 6'),
    ('open_files', [9, 9, 9, 9, 10], 'open_files grew from 9 to 10'),
    ('latency_p99_ms', [10, 10, 11, 12, 14], ''),
    ('latency_p99_ms', [10, 10, 11, 12, 20], '2.00 times'),
])
def test_growth_after_the_warm_up_is_told(soak, field, values, word):
    steady = {'elapsed_s': 0, 'rss_mib': 100, 'threads': 5, 'open_files': 9, 'latency_p50_ms': 5,
              'latency_p95_ms': 8, 'latency_p99_ms': 10, 'tracked': 1.0}
    # Before the warm-up everything may change.
    samples = [soak.Sample(100, **{**steady, field: 1})] + [
        soak.Sample(100 * number, **{**steady, field: value})
        for number, value in enumerate(values, 2)]
    told = soak.complaints(samples, 200)
    assert word in told[0] if word else not told
    assert 'too few' in soak.complaints(samples[:3], 200)[0]


def test_run_without_a_sample_is_refused(soak, monkeypatch, capsys):
    monkeypatch.setattr('sys.argv', ['soak.py', '--frames', '59', '--every', '60'])
    with pytest.raises(SystemExit):
        soak.main()
    assert 'give 60 or more' in capsys.readouterr().err

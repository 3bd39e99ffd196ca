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

"""What a cluster costs is measured, and what is started in containers is well formed."""

from pathlib import Path

import pytest
import yaml

from benchmarks import cluster_cost
from benchmarks.cluster_cost import Costs, model

pytest.importorskip('distributed', reason='needs the extra `cluster`')

COMPOSE = Path(__file__).resolve().parents[2] / 'docker' / 'cluster.compose.yaml'


def test_model_is_limited_by_the_time_of_the_client():
    found = dict(model(Costs(seconds=.005, sent=2000, received=10500), 100))
    assert found['tasks per second that one client handles'] == pytest.approx(200)
    assert found['seconds that a task must take to keep 100 workers busy'] == pytest.approx(.5)
    assert found['workers that tasks of 10 seconds keep busy'] == pytest.approx(2000)
    carried = 'seconds for a network of 1 Gbit/s to carry the tasks of 100 workers'
    assert found[carried] == pytest.approx(.01)


def test_comparison_runs(capsys):
    cluster_cost.main(['--tracker', 'mil', '--sequences', '2', '--frames', '3', '--rounds', '1',
                       '--tasks', '4', '--workers', '7'])
    said = capsys.readouterr().out
    assert '2 tasks of 3 frames' in said and 'keep 7 workers busy' in said


def test_compose_file_starts_a_scheduler_and_two_workers():
    services = yaml.safe_load(COMPOSE.read_text(encoding='utf-8'))['services']
    assert set(services) == {'scheduler', 'worker'}
    assert services['scheduler']['command'][:2] == ['dask', 'scheduler']
    worker = services['worker']
    assert worker['command'][1:3] == ['worker', 'tcp://scheduler:8786']
    assert worker['deploy']['replicas'] == 2 and worker['depends_on'] == ['scheduler']
    # Nobody else's machine is to reach what runs code for whoever asks.
    assert all(port.startswith('127.0.0.1:') for port in services['scheduler']['ports'])
    assert all(item['volumes'] == ['${DATASETS:?the folder of the datasets}:${DATASETS}:ro']
               for item in services.values())

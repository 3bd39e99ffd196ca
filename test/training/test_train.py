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

"""Train for a few minutes on the real data, as `python -m training.train` does."""

import csv
from dataclasses import replace

import pytest
import yaml

from lmsco_ros.core.networks.thermal import ThermalNet
from lmsco_ros.core.weights.formats import read_arrays
from training.loop import Schedule
from training.train import CONFIG, run


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_few_minutes_of_training_lower_the_validation_loss(test_data, tmp_path):
    config = yaml.safe_load(CONFIG.read_text(encoding='utf-8'))
    config['clip_stride'] = 10
    config['validation']['batches'] = 4
    schedule = replace(Schedule(**config['thermal']['schedule'], device='cpu'),
                       minutes=20.0, steps=120, log_interval=40)
    run('thermal', config, test_data, schedule, tmp_path)
    with (tmp_path / 'thermal_log.csv').open(encoding='utf-8') as stream:
        rows = list(csv.DictReader(stream))
    losses = [float(row['validation_loss']) for row in rows]
    assert losses[-1] < 0.8 * losses[0]
    assert float(rows[-1]['validation_accuracy']) > float(rows[0]['validation_accuracy'])
    arrays = read_arrays(tmp_path / 'thermal.safetensors')
    assert {name: array.shape for name, array in arrays.items()} == ThermalNet.file_shapes()
    assert (tmp_path / 'thermal_curve.png').stat().st_size > 0

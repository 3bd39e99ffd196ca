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

"""
Train one of the bundled feature networks.

    python -m training.train NETWORK --data DATA [--output FOLDER] [--minutes N] [--device NAME]

NETWORK is thermal or thermal_flow; DATA holds `thermal_dev` and
`training_stills`. Written are NETWORK.safetensors, NETWORK_log.csv and NETWORK_curve.png.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
import torch
import yaml

from lmsco_ros.core.networks.thermal import ThermalFlowNet, ThermalNet
from training.correlation_filter import CorrelationFilter
from training.examples import ExampleSource, Spread
from training.features import feature_batches, FeatureObjective
from training.flow_examples import FlowSource
from training.loop import Batch, Objective, Schedule, take, train
from training.sources import Clip, data_folder, load_clips, load_stills, Still

CONFIG = Path(__file__).with_name('config.yaml')

Source = ExampleSource | FlowSource
Batches = Callable[[Source, int], Iterator[Batch]]


def main() -> None:
    """Train the network that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('network', choices=('thermal', 'thermal_flow'))
    parser.add_argument('--data', type=data_folder('thermal_dev', 'training_stills'),
                        required=True)
    parser.add_argument('--output', type=Path, default=Path('training/output'))
    parser.add_argument('--minutes', type=float)
    parser.add_argument('--device', default='')
    options = parser.parse_args()
    config = yaml.safe_load(CONFIG.read_text(encoding='utf-8'))
    schedule = Schedule(**config[options.network]['schedule'], device=options.device)
    if options.minutes:
        schedule = replace(schedule, minutes=options.minutes)
    run(options.network, config, options.data, schedule, options.output)


def run(name: str, config: Mapping[str, Any], data: Path, schedule: Schedule,
        output: Path) -> None:
    """
    Train a network and write its weights, its log and the picture of the log.

    Parameters
    ----------
    name : str
        Network.
    config : mapping
        Content of `config.yaml`.
    data : Path
        Folder with `thermal_dev` and `training_stills`.
    schedule : Schedule
        How long and how fast.
    output : Path
        Folder to write to.

    """
    torch.manual_seed(config['seed'])
    clips = load_clips(data / 'thermal_dev', 'train', config['clip_stride'])
    every = config['validation']['every']
    known = [clip for i, clip in enumerate(clips) if i % every]
    stills = load_stills(data / 'training_stills')
    network, objective, batches, source = _parts(name, config[name])
    validation = take(batches(source(clips[::every], []), config['seed'] + 1),
                      config['validation']['batches'])
    train(network, objective, batches(source(known, stills), config['seed']), validation,
          schedule, output / name)
    draw_curve(output / f'{name}_log.csv', output / f'{name}_curve.png')


def _parts(name: str, settings: Mapping[str, Any]) -> tuple[
        torch.nn.Module, Objective, Batches,
        Callable[[Sequence[Clip], Sequence[Still]], Source]]:
    """Return network, objective, batches of a source, and source of clips and stills."""
    correlation = CorrelationFilter(**settings['filter'])
    objective = FeatureObjective(correlation, settings['layer'], settings['core'])
    searched = Spread(**settings['searched'])
    size, factor = settings['patch_size'], correlation.search_factor

    def batches(source: Source, seed: int) -> Iterator[Batch]:
        return feature_batches(source, settings['batch_size'], settings['views'], searched, seed)

    if name == 'thermal_flow':
        return (ThermalFlowNet(), objective, batches,
                lambda clips, stills: FlowSource(clips, size, factor))
    return ThermalNet(), objective, batches, lambda clips, stills: ExampleSource(
        clips, stills, size, factor, True, settings['clip_share'], settings['bystanders'])


def draw_curve(log: Path, picture: Path) -> None:
    """Draw the losses and the accuracy of a log."""
    with log.open(encoding='utf-8') as stream:
        rows = list(csv.DictReader(stream))
    figure = Figure(figsize=(7, 3.2), layout='constrained')
    losses, shares = figure.subplots(1, 2)
    steps = [int(row['step']) for row in rows]
    for key, label in (('training_loss', 'training'), ('validation_loss', 'validation')):
        pairs = [(step, float(row[key])) for step, row in zip(steps, rows, strict=True)
                 if row[key]]
        losses.plot(*zip(*pairs, strict=True), label=label)
    losses.set(xlabel='step', ylabel='loss', ylim=(0, None))
    losses.legend()
    shares.plot(steps, [float(row['validation_accuracy']) for row in rows])
    shares.set(xlabel='step', ylabel='validation accuracy', ylim=(None, 1))
    figure.savefig(picture, dpi=110)


if __name__ == '__main__':
    main()

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
Train the network that measures the extent of a target.

    python -m training.extent.train --windows WINDOWS.npz [--output FOLDER] [--minutes N]
        [--batch N] [--device NAME] [--start WEIGHTS] [--without rendered|stills|clips|variance]

WINDOWS.npz is written by `python -m training.extent.windows`. Written are extent.safetensors,
extent_log.csv, extent_curve.png and extent_report.csv.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping
import csv
from dataclasses import replace
from pathlib import Path

import torch
from torch.nn import functional
import yaml

from lmsco_ros.core.networks.extent import ExtentNet
from lmsco_ros.core.weights.formats import read_arrays, write_arrays
from training.extent.examples import Examples, examples
from training.extent.pairs import ClipPairs, Pairs, RenderedPairs, StillPairs
from training.extent.sensor import through_a_sensor
from training.extent.windows import read_windows
from training.loop import Schedule, take, train
from training.train import CONFIG, draw_curve

__all__ = ['ExtentObjective', 'batches', 'overlaps']

PairSource = Callable[[int], Pairs]

_VARIANCE = 'variance'
_SMALLEST_SCALE = -5.0


class ExtentObjective:
    """
    Likelihood of the edges under Laplace distributions, and cross-entropy of the presence.

    Parameters
    ----------
    variance : bool
        Whether the scales of the distributions are learned; they are 1 otherwise.

    """

    def __init__(self, variance: bool = True) -> None:
        self._variance = variance

    def __call__(self, network: ExtentNet, batch: Examples) -> torch.Tensor:
        """Return the mean loss of a batch."""
        edges, scales, presence = answers(network, batch)
        scales = scales if self._variance else 0 * scales
        missed = (edges - batch.edges).abs()
        fit = (missed * torch.exp(-scales) + scales).mean(dim=1)
        measured = (fit * batch.measurable).sum() / batch.measurable.sum().clamp(min=1)
        return measured + functional.binary_cross_entropy_with_logits(
            presence, batch.present.float())

    def accuracy(self, network: ExtentNet, batch: Examples) -> float:
        """Return the mean overlap of measured boxes with the truth."""
        edges = answers(network, batch)[0]
        return float(overlaps(batch.boxed(edges), batch.truth)[batch.measurable].mean())


def answers(network: ExtentNet,
            batch: Examples) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return edges (n, 4), logarithms of their scales (n, 4), log-odds of presence (n,)."""
    first, now = network(torch.cat([batch.first, batch.now]))[0].chunk(2)
    first = first * batch.known[:, None, None, None]
    answer = network.measure(network.reference(first), now, batch.sides)
    return answer[:, :4], answer[:, 4:8].clamp(min=_SMALLEST_SCALE), answer[:, 8]


def overlaps(boxes: torch.Tensor, others: torch.Tensor) -> torch.Tensor:
    """Return intersection over union of boxes (n, 4) as (x0, y0, x1, y1)."""
    low, high = (f(boxes[:, i], others[:, i]) for f, i in (
        (torch.maximum, slice(0, 2)), (torch.minimum, slice(2, 4))))
    common = (high - low).clamp(min=0).prod(dim=1)
    areas = [(box[:, 2:] - box[:, :2]).clamp(min=0).prod(dim=1) for box in (boxes, others)]
    return common / (areas[0] + areas[1] - common).clamp(min=1e-9)


def batches(sources: Mapping[str, PairSource], shares: Mapping[str, float],
            size: int) -> Iterator[Examples]:
    """
    Yield batches of about `size` examples without end.

    Parameters
    ----------
    sources : mapping of str to callable
        Return a number of pairs.
    shares : mapping of str to float
        Of each source.
    size : int
        Examples in a batch.

    """
    total = sum(shares[name] for name in sources)
    while True:
        parts = [source(max(1, round(size * shares[name] / total)))
                 for name, source in sources.items()]
        pairs = Pairs.joined(parts)
        pairs = replace(pairs, images=through_a_sensor(pairs.images))
        yield examples(pairs, ExtentNet.size, ExtentNet.context)


@torch.no_grad()
def report(network: ExtentNet, held_out: Mapping[str, list[Examples]]) -> list[dict[str, str]]:
    """Return, for each source, what the network makes of examples that it was not trained on."""
    rows = []
    for name, parts in held_out.items():
        expected, measured, errors, odds, present = [], [], [], [], []
        for batch in parts:
            edges, scales, presence = answers(network, batch)
            shown = batch.measurable
            expected.append(overlaps(batch.boxed(0 * edges), batch.truth)[shown])
            measured.append(overlaps(batch.boxed(edges), batch.truth)[shown])
            # A Laplace distribution deviates by the root of two times its scale.
            deviation = 2**0.5 * torch.exp(scales)
            errors.append(((edges - batch.edges).abs() / deviation)[shown])
            odds.append(presence)
            present.append(batch.present)
        error, answer, there = torch.cat(errors), torch.cat(odds), torch.cat(present)
        wins = (answer[there][:, None] > answer[~there][None]).float().mean()
        rows.append({'source': name, **{key: f'{float(value):.3f}' for key, value in {
            'expected_overlap': torch.cat(expected).mean(),
            'measured_overlap': torch.cat(measured).mean(),
            'within_one_deviation': (error < 1).float().mean(),
            'within_two_deviations': (error < 2).float().mean(),
            'presence_auroc': wins}.items()}})
    return rows


def main() -> None:
    """Train as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--windows', type=Path, required=True)
    parser.add_argument('--output', type=Path, default=Path('training/output'))
    parser.add_argument('--minutes', type=float)
    parser.add_argument('--batch', type=int)
    parser.add_argument('--device', default='')
    parser.add_argument('--start', type=Path, help='weights to go on from')
    parser.add_argument('--without', choices=('rendered', 'stills', 'clips', _VARIANCE))
    options = parser.parse_args()
    config = yaml.safe_load(CONFIG.read_text(encoding='utf-8'))
    settings = config['extent']
    schedule = Schedule(**settings['schedule'], device=options.device)
    if options.minutes:
        schedule = replace(schedule, minutes=options.minutes)
    held = settings['validation']
    torch.manual_seed(config['seed'])
    device = schedule.torch_device
    windows = {name: read_windows(options.windows, name).to(device)
               for name in ('clips', 'held_out', 'stills', 'textures')}
    sources: dict[str, PairSource] = {
        'rendered': RenderedPairs(windows['textures']),
        'stills': StillPairs(windows['stills'], windows['textures']),
        'clips': ClipPairs(windows['clips'])}
    held_out = {name: take(batches({name: source}, {name: 1.0}, held['size']), held['batches'])
                for name, source in {**sources, 'clips': ClipPairs(windows['held_out'])}.items()}
    trained = {name: source for name, source in sources.items() if name != options.without}
    network = _network(options.start)
    name = f'extent_without_{options.without}' if options.without else 'extent'
    train(network, ExtentObjective(options.without != _VARIANCE),
          batches(trained, settings['shares'], options.batch or settings['batch_size']),
          [batch for parts in held_out.values() for batch in parts], schedule,
          options.output / name)
    _finish(network.to(device), held_out, options.output, name)


def _network(start: Path | None) -> ExtentNet:
    """Return the network with the weights of a file, or with random ones."""
    network = ExtentNet()
    if start is not None:
        network.load_state_dict({name: torch.from_numpy(array.astype('float32'))
                                 for name, array in read_arrays(start).items()})
    return network


def _finish(network: ExtentNet, held_out: Mapping[str, list[Examples]], folder: Path,
            name: str) -> None:
    """Write the weights in half the bytes, the curve, and the report."""
    path = folder / f'{name}.safetensors'
    halves = {key: value.astype('float16') for key, value in read_arrays(path).items()}
    write_arrays(path, halves, {'source': 'training/extent/train.py'})
    draw_curve(folder / f'{name}_log.csv', folder / f'{name}_curve.png')
    rows = report(network, held_out)
    with (folder / f'{name}_report.csv').open('w', encoding='utf-8') as stream:
        table = csv.DictWriter(stream, list(rows[0]), lineterminator='\n')
        table.writeheader()
        table.writerows(rows)


if __name__ == '__main__':
    main()

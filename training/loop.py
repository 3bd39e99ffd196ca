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

"""The training loop that all networks share."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
import csv
from dataclasses import dataclass
from pathlib import Path
import time
from typing import Protocol

import numpy as np
import torch

from lmsco_ros.core.weights.formats import write_arrays

__all__ = ['Batch', 'Objective', 'Schedule', 'train']


@dataclass(frozen=True)
class Batch:
    """
    Examples for one step.

    Attributes
    ----------
    inputs : tensor, shape (n, views, channels, S, S)
        Patches.
    targets : tensor, shape (n, views, d)
        What is true of each of them.

    """

    inputs: torch.Tensor
    targets: torch.Tensor

    def to(self, device: torch.device) -> Batch:
        """Return the batch on a device."""
        return Batch(self.inputs.to(device), self.targets.to(device))


class Objective(Protocol):
    """What is minimized, and the share of right answers that people understand."""

    def __call__(self, network: torch.nn.Module, batch: Batch) -> torch.Tensor:
        """Return the loss."""

    def accuracy(self, network: torch.nn.Module, batch: Batch) -> float:
        """Return a share in [0, 1]."""


@dataclass(frozen=True)
class Schedule:
    """
    How long and how fast.

    Attributes
    ----------
    minutes : float
        Time limit; the learning rate falls along a cosine of the time or the steps, whichever
        is nearer to its end.
    steps : int
        Limit of the steps.
    learning_rate : float
        Of Adam, at the start.
    weight_decay : float
        Of Adam.
    log_interval : int
        Steps between two lines of the log, each with a validation.
    device : str
        'cpu' or a GPU; empty for a GPU where there is one.

    """

    minutes: float
    steps: int
    learning_rate: float
    weight_decay: float
    log_interval: int
    device: str = ''

    @property
    def torch_device(self) -> torch.device:
        """Device to train on."""
        return torch.device(self.device or ('cuda' if torch.cuda.is_available() else 'cpu'))


def train(network: torch.nn.Module, objective: Objective, batches: Iterator[Batch],
          validation: Sequence[Batch], schedule: Schedule, output: Path) -> None:
    """
    Train a network and write its weights and its log.

    Parameters
    ----------
    network : Module
        Trained in place.
    objective : Objective
        What is minimized.
    batches : iterator of Batch
        Training examples without end; drawn in a thread of its own.
    validation : sequence of Batch
        Examples of targets that are never trained on.
    schedule : Schedule
        How long and how fast.
    output : Path
        `output`.safetensors and `output`_log.csv are written.

    """
    device = schedule.torch_device
    network.to(device)
    optimizer = torch.optim.AdamW(network.parameters(), schedule.learning_rate,
                                  weight_decay=schedule.weight_decay)
    output.parent.mkdir(parents=True, exist_ok=True)
    start = time.monotonic()
    with (output.parent / f'{output.name}_log.csv').open('w', encoding='utf-8') as stream, \
            ThreadPoolExecutor(2) as drawer:
        log = csv.writer(stream, lineterminator='\n')
        log.writerow(['step', 'minutes', 'training_loss', 'validation_loss',
                      'validation_accuracy'])
        upcoming = [drawer.submit(next, batches)]
        recent: list[float] = []
        for step in range(schedule.steps + 1):
            minutes = (time.monotonic() - start) / 60
            progress = max(minutes / schedule.minutes, step / schedule.steps)
            if step % schedule.log_interval == 0 or progress >= 1:
                log.writerow([step, f'{minutes:.2f}', _mean(recent),
                              *_validate(network, objective, validation, device)])
                stream.flush()
                recent.clear()
                write_arrays(output.parent / f'{output.name}.safetensors',
                             {name: value.cpu().numpy()
                              for name, value in network.state_dict().items()},
                             {'source': f'training/train.py, step {step}'})
            if progress >= 1:
                break
            batch = upcoming.pop().result().to(device)
            upcoming.append(drawer.submit(next, batches))
            recent.append(_step(network, objective, optimizer, batch,
                                schedule.learning_rate * _cosine(progress)))
    network.to('cpu').eval()


def _step(network: torch.nn.Module, objective: Objective, optimizer: torch.optim.Optimizer,
          batch: Batch, rate: float) -> float:
    """Take one step and return its loss."""
    for group in optimizer.param_groups:
        group['lr'] = rate
    network.train()
    loss = objective(network, batch)
    optimizer.zero_grad()
    loss.backward()
    torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
    optimizer.step()
    return float(loss.detach())


def _cosine(progress: float) -> float:
    """Return the factor of the learning rate, after a short warm-up."""
    return min(1.0, 0.05 + progress / 0.02) * 0.5 * (1 + float(np.cos(np.pi * progress)))


def _validate(network: torch.nn.Module, objective: Objective, validation: Sequence[Batch],
              device: torch.device) -> tuple[str, str]:
    """Return loss and accuracy, as the log writes them."""
    network.eval()
    with torch.no_grad():
        batches = [batch.to(device) for batch in validation]
        losses = [float(objective(network, batch)) for batch in batches]
        shares = [objective.accuracy(network, batch) for batch in batches]
    return _mean(losses), _mean(shares)


def _mean(values: Sequence[float]) -> str:
    """Return a mean as the log writes it; empty where there is nothing to average."""
    return f'{np.mean(values):.4f}' if values else ''


def take(batches: Iterator[Batch], count: int, prepare: Callable[[Batch], Batch] = lambda b: b
         ) -> list[Batch]:
    """Return the next `count` batches."""
    return [prepare(next(batches)) for _ in range(count)]

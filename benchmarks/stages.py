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

"""Where the time of a frame goes: stages of the core, and what of them cannot be saved."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
import contextlib
from dataclasses import dataclass
import functools
from importlib import import_module
from typing import Any

import scipy.fft
import torch

from lmsco_ros.core.networks.backbone import Backbone
from lmsco_ros.core.weights import registry

__all__ = ['CallRecorder', 'FORWARD', 'FOURIER', 'STAGES', 'Stage', 'StageClock', 'TRAINING',
           'instrumented']

FORWARD, FOURIER, TRAINING = 'forward pass', 'Fourier transforms', 'training'


@dataclass(frozen=True)
class Stage:
    """
    A function of the core whose time is taken.

    Attributes
    ----------
    name : str
        In tables; several functions may share one.
    module : str
        Module below `lmsco_ros.core`.
    attribute : str
        Function, or class and method, in that module.

    """

    name: str
    module: str
    attribute: str

    def place(self) -> tuple[Any, str]:
        """
        Return the object that holds the function, and its name there.

        Raises
        ------
        LookupError
            When the core has no such function.

        """
        try:
            owner: Any = import_module(f'lmsco_ros.core.{self.module}')
            *classes, name = self.attribute.split('.')
            for part in classes:
                owner = getattr(owner, part)
            getattr(owner, name)
        except (ImportError, AttributeError) as error:
            raise LookupError(f'stage {self.name!r}: there is no {self.attribute} in '
                              f'lmsco_ros.core.{self.module}') from error
        return owner, name


# A stage counts its own time only: a patch taken for the extent belongs to `patch`.
STAGES = (
    Stage('gain', 'targets', 'survey'),
    Stage('gain', 'imaging.gain', 'AutomaticGain.examine'),
    Stage('patch', 'imaging.view', 'FrameView.patch'),
    Stage('motion', 'features.motion', 'MotionObserver.images'),
    Stage('optical flow', 'features.optical_flow', 'DenseFlow.__call__'),
    Stage('network in and out', 'features.network_channels', 'NetworkChannels.__call__'),
    Stage('features', 'features.extractor', 'FeatureExtractor._series'),
    Stage('scores', 'learning.structured_operator', 'StructuredOperator.scores'),
    Stage('peak', 'detection.detector', 'locate'),
    Stage('sharpness', 'detection.detector', 'peak_to_sidelobe_ratio'),
    Stage('extent', 'networks.extent', 'ExtentNet.answers'),
    Stage('extent', 'extent.measurement', '_patch'),
    Stage('fusion', 'extent.fusion', 'EdgeFilter.__call__'),
    Stage('sample', 'detection.detector', 'Detection.sample_around'),
    Stage('memory', 'learning.structured_operator', 'StructuredOperator.remember'),
    Stage(TRAINING, 'learning.structured_operator', 'StructuredOperator.train'),
)
_TRANSFORMS = (
    Stage(FOURIER, 'fourier.series', 'rfft2'),
    Stage(FOURIER, 'fourier.series', 'irfft2'),
)


class StageClock:
    """
    Adds up the time that each stage spends in itself.

    Parameters
    ----------
    now : callable
        Returns seconds.

    """

    def __init__(self, now: Callable[[], float]) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._now = now
        self._running: list[float] = []

    def spent(self, function: Callable[[], object]) -> float:
        """Return the seconds of one call."""
        start = self._now()
        function()
        return self._now() - start

    def wrap(self, name: Callable[..., str], function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function with its time taken; `name` tells the stage from the arguments."""
        @functools.wraps(function)
        def clocked(*args: Any, **kwargs: Any) -> Any:
            self._running.append(0.0)
            start = self._now()
            try:
                return function(*args, **kwargs)
            finally:
                spent = self._now() - start
                self.seconds[name(*args)] += spent - self._running.pop()
                if self._running:
                    self._running[-1] += spent
        return clocked


class CallRecorder:
    """Remembers calls with their arguments, to make them again on their own."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, Callable[[], Any]]] = []
        self.shapes: dict[str, tuple[int, ...]] = {}
        self._depth = 0

    def wrap(self, kind: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function with its outermost calls remembered under `kind`."""
        @functools.wraps(function)
        def recorded(*args: Any, **kwargs: Any) -> Any:
            if self._depth == 0:
                self.calls.append((kind, functools.partial(function, *args, **kwargs)))
                if kind == FORWARD:
                    self.shapes[type(args[0]).__name__] = tuple(args[1].shape)
            self._depth += 1
            try:
                return function(*args, **kwargs)
            finally:
                self._depth -= 1
        return recorded

    def replay(self, kind: str, spent: Callable[[Callable[[], Any]], float]) -> float:
        """Make the remembered calls of a kind again, twice; return the sum of the faster times."""
        self._depth += 1
        try:
            with torch.inference_mode():
                return sum(min(spent(call), spent(call))
                           for name, call in self.calls if name == kind)
        finally:
            self._depth -= 1


@contextlib.contextmanager
def instrumented(clock: StageClock, recorder: CallRecorder | None = None,
                 stages: Sequence[Stage] = STAGES) -> Iterator[list[str]]:
    """
    Take the time of stages inside the context, and remember forward passes and transforms.

    Parameters
    ----------
    clock : StageClock
        Takes the time.
    recorder : CallRecorder, optional
        Where given, forward passes and Fourier transforms are stages as well.
    stages : sequence of Stage
        Those to be seen.

    Yields
    ------
    list of str
        What is missing: one line for each stage that this version of the core does not have,
        whose time then counts for the one around it.

    """
    missing = []
    with contextlib.ExitStack() as changes:
        for stage in stages:
            try:
                _replace(changes, *stage.place(),
                         functools.partial(clock.wrap, _named(stage.name)))
            except LookupError as error:
                missing.append(str(error))
        if recorder is not None:
            _record(changes, clock, recorder)
        yield missing


def _record(changes: contextlib.ExitStack, clock: StageClock, recorder: CallRecorder) -> None:
    """Clock and remember what is the floor of a frame: forward passes and transforms."""
    def transform(function: Callable[..., Any]) -> Callable[..., Any]:
        return clock.wrap(_named(FOURIER), recorder.wrap(FOURIER, function))

    def forward(function: Callable[..., Any]) -> Callable[..., Any]:
        return clock.wrap(lambda network, *_: f'{FORWARD}, {type(network).__name__}',
                          recorder.wrap(FORWARD, function))

    for owner, name in (*(stage.place() for stage in _TRANSFORMS),
                        (scipy.fft, 'rfft'), (scipy.fft, 'irfft')):
        _replace(changes, owner, name, transform)
    for network in {base for source in registry.WEIGHTS for base in source.architecture.__mro__
                    if issubclass(base, Backbone) and base is not Backbone}:
        for name in ('forward', 'compare'):
            if name in vars(network):
                _replace(changes, network, name, forward)


def _named(name: str) -> Callable[..., str]:
    """Return a function that answers any arguments with `name`."""
    return lambda *_: name


def _replace(changes: contextlib.ExitStack, owner: Any, name: str,
             change: Callable[[Callable[..., Any]], Callable[..., Any]]) -> None:
    """Put a changed function in the place of the one there, until the changes are undone."""
    original = getattr(owner, name)
    setattr(owner, name, change(original))
    changes.callback(setattr, owner, name, original)

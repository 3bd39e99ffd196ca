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

"""Training of the filter."""

from __future__ import annotations

from dataclasses import dataclass

from lmsco_ros.core.config.validation import check_choice, check_range

__all__ = ['LearningConfig']


@dataclass(frozen=True)
class LearningConfig:
    """
    Training of the structured correlation filter.

    Attributes
    ----------
    loss : {'unit', 'coupled', 'ridge'}
        The margin of the paper's (7), with s(y0) held at its desired value 1 or moving with the
        filter, or ridge regression.
    margin_weight : float
        C of the paper's (7).
    label_sigma : float
        Standard deviation of the label over sqrt(target width * height).
    window_minimum, window_edge : float
        Spatial window at the center of the target and in the middle of its sides.
    window_sparsity : float
        Window coefficients below this part of the largest are dropped.
    memory_size : int
        Training samples kept.
    learning_rate : float
        Of the prior weights of the samples.
    initial_iterations : int
        Outer iterations in the first frame.
    iterations : int
        Outer iterations of an update.
    gradient_steps : int
        Conjugate gradient steps in each outer iteration.
    update_interval : int
        Frames between two updates; every frame is stored.

    """

    loss: str = 'unit'
    margin_weight: float = 1.0
    label_sigma: float = 1 / 12
    window_minimum: float = 0.02
    window_edge: float = 0.06
    window_sparsity: float = 0.05
    memory_size: int = 30
    learning_rate: float = 0.01
    initial_iterations: int = 30
    iterations: int = 3
    gradient_steps: int = 2
    update_interval: int = 5

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_choice(self, 'loss', ('unit', 'coupled', 'ridge'))
        check_range(self, 'margin_weight', 0, 1e6, open_low=True)
        check_range(self, 'label_sigma', 0, 1, open_low=True)
        check_range(self, 'window_minimum', 0, 1e3, open_low=True)
        check_range(self, 'window_edge', self.window_minimum, 1e3)
        check_range(self, 'window_sparsity', 0, 1)
        check_range(self, 'memory_size', 1, 1000)
        check_range(self, 'learning_rate', 0, 0.5)
        for name in ('initial_iterations', 'iterations', 'gradient_steps', 'update_interval'):
            check_range(self, name, 1, 1000)

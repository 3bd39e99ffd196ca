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

"""The structured convolution operator: filters, their training samples, and their training."""

from __future__ import annotations

from collections.abc import Sequence

from lmsco_ros.core.backend import Array, array_namespace, Backend
from lmsco_ros.core.config import LearningConfig
from lmsco_ros.core.fourier.series import bandwidth, grid_size
from lmsco_ros.core.learning.collaborative import CollaborativeOptimizer
from lmsco_ros.core.learning.margin import gaussian_label, make_margin_loss
from lmsco_ros.core.learning.memory import SampleMemory, score
from lmsco_ros.core.learning.regularization import SpatialWindow, window_series

__all__ = ['StructuredOperator']


class StructuredOperator:
    """
    Filters of all blocks, trained together.

    Parameters
    ----------
    config : LearningConfig
        Loss, window, memory and schedule.
    sample : sequence of array, shape (2K_l + 1, K_l + 1, C_l)
        Series of the first sample, the target at the origin.
    target : tuple of float
        (h, w) of the target in periods.
    backend : Backend
        Where the series live.

    """

    def __init__(self, config: LearningConfig, sample: Sequence[Array],
                 target: tuple[float, float], backend: Backend) -> None:
        self._config = config
        self._memory = SampleMemory(config.memory_size, config.learning_rate,
                                    [block.shape for block in sample], backend)
        self._memory.add(sample)
        self._unseen = {index for index, block in enumerate(sample) if not _shows(block)}
        side = (target[0] * target[1])**0.5
        label = gaussian_label(grid_size(self._memory.order), (config.label_sigma * side,) * 2)
        series = window_series(target, config.window_minimum, config.window_edge,
                               config.window_sparsity)
        self._optimizer = CollaborativeOptimizer(
            self._memory, make_margin_loss(config.loss, label, backend),
            [SpatialWindow(series, bandwidth(block), backend) for block in sample],
            config.margin_weight)
        self._optimizer.optimize(config.initial_iterations, config.gradient_steps)

    @property
    def filters(self) -> list[Array]:
        """Filter coefficients of every block, shape (2K_l + 1, K_l + 1, C_l)."""
        return self._optimizer.filters

    def scores(self, samples: Sequence[Array]) -> Array:
        """
        Return the scores of several samples.

        Parameters
        ----------
        samples : sequence of array, shape (2K_l + 1, K_l + 1, n, C_l)
            Series, n samples per block.

        Returns
        -------
        array, shape (2K + 1, K + 1, n)
            Series of the scores (paper, (5)).

        """
        return score(samples, self.filters)

    def remember(self, sample: Sequence[Array]) -> None:
        """
        Add a training sample, the target at the origin.

        Where a block shows something for the first time, as motion is in no first frame, the
        filters are trained at once and as long as in the first frame: by the few steps of an
        update it would get what the others leave.
        """
        self._memory.add(sample)
        seen = {index for index in self._unseen if _shows(sample[index])}
        if seen:
            self._unseen -= seen
            self._optimizer.optimize(self._config.initial_iterations, self._config.gradient_steps)

    def train(self) -> None:
        """Adapt the filters to the samples in memory."""
        self._optimizer.optimize(self._config.iterations, self._config.gradient_steps)

    def objective(self) -> float:
        """Return the objective of the training problem at the current filters."""
        return self._optimizer.objective()


def _shows(block: Array) -> bool:
    """Return whether a block is not zero."""
    return bool(array_namespace(block).any(block != 0))

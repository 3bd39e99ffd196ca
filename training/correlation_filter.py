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

"""A correlation filter that gradients flow through, and the loss of what it finds."""

from __future__ import annotations

from dataclasses import dataclass

import torch

__all__ = ['CorrelationFilter', 'margin_loss']


@dataclass(frozen=True)
class CorrelationFilter:
    """
    The tracker's filter in a form that can be trained through.

    Minimizes ||gamma w||^2 + mean_j ||s_j - m||^2 over the filter w with a few steps of
    preconditioned conjugate gradient, as `core/learning` does with one more constraint; the
    features are discrete here, without interpolation.

    Attributes
    ----------
    search_factor : float
        Side of the search region over that of the target.
    label_sigma : float
        Standard deviation of the label over the side of the target.
    window_minimum, window_edge : float
        Spatial window at the center of the target and in the middle of its sides.
    steps : int
        Conjugate gradient steps.

    """

    search_factor: float
    label_sigma: float
    window_minimum: float
    window_edge: float
    steps: int

    def label(self, cells: int, shift: torch.Tensor) -> torch.Tensor:
        """
        Return the desired scores.

        Parameters
        ----------
        cells : int
            Points per axis.
        shift : tensor, shape (n, 2)
            Displacement (x, y) of the targets from the middle, in periods.

        Returns
        -------
        tensor, shape (n, cells, cells)
            Gaussians of peak 1; no displacement is at [0, 0].

        """
        sigma = max(self.label_sigma / self.search_factor, 0.6 / cells)
        grid = torch.arange(cells, dtype=shift.dtype, device=shift.device) / cells
        away = (grid[None, :, None] - shift[:, None, :] + 0.5) % 1.0 - 0.5
        axes = torch.exp(-0.5 * (away / sigma)**2)
        return axes[:, :, 1, None] * axes[:, None, :, 0]

    def window(self, cells: int) -> torch.Tensor:
        """
        Return gamma on the grid.

        The label is at the origin and the target in the middle of the patch, so what the filter
        has to say of the target lives half a period away from the origin.
        """
        away = (torch.arange(cells) + (cells - 1) / 2) / cells
        parabola = (2 * self.search_factor * ((away + 0.5) % 1.0 - 0.5))**2
        rise = self.window_edge - self.window_minimum
        return self.window_minimum + rise * (parabola[:, None] + parabola[None, :])

    def prepare(self, maps: torch.Tensor) -> torch.Tensor:
        """Return spectra (..., C, N, N // 2 + 1) of normalized, windowed maps (..., C, N, N)."""
        energy = maps.square().mean(dim=(-3, -2, -1), keepdim=True)
        cells = maps.shape[-1]
        hann = torch.hann_window(cells + 2, periodic=False, dtype=maps.dtype,
                                 device=maps.device)[1:-1]
        windowed = maps * torch.rsqrt(energy + 1e-6) * (hann[:, None] * hann[None, :])
        return torch.fft.rfft2(windowed) / cells**2

    def train(self, samples: torch.Tensor) -> torch.Tensor:
        """
        Return the filters.

        Parameters
        ----------
        samples : tensor, shape (n, j, C, N, N // 2 + 1)
            Spectra of j samples of each target, the target in the middle.

        Returns
        -------
        tensor, shape (n, C, N, N // 2 + 1)
            Filters W; scores are the sum over c of Z_c W_c.

        """
        cells = samples.shape[-2]
        strength = samples.abs().square().mean(dim=1)
        label = torch.fft.rfft2(self.label(cells, strength.new_zeros(1, 2))) / cells**2
        gamma = self.window(cells).square().to(strength)
        energy = strength + gamma.mean()
        # How often each column of the half spectrum stands in the whole one.
        columns = torch.full_like(strength[0, 0, 0], 2.0)
        columns[0] = 1.0
        if cells % 2 == 0:
            columns[-1] = 1.0

        def normal(filters: torch.Tensor) -> torch.Tensor:
            scores = (samples * filters[:, None]).sum(dim=2, keepdim=True)
            penalty = torch.fft.rfft2(gamma * torch.fft.irfft2(filters, s=(cells, cells)))
            return penalty + (samples.conj() * scores).mean(dim=1)

        def inner(left: torch.Tensor, right: torch.Tensor) -> torch.Tensor:
            return ((left.conj() * right).real * columns).sum(dim=(-3, -2, -1), keepdim=True)

        residual = (samples.conj() * label[:, None, None]).mean(dim=1)
        filters = torch.zeros_like(residual)
        direction = descent = residual / energy
        power = inner(residual, descent)
        for _ in range(self.steps):
            image = normal(direction)
            length = power / (inner(direction, image) + 1e-12)
            filters = filters + length * direction
            residual = residual - length * image
            descent = residual / energy
            power, before = inner(residual, descent), power
            direction = descent + power / (before + 1e-12) * direction
        return filters

    @staticmethod
    def scores(sample: torch.Tensor, filters: torch.Tensor) -> torch.Tensor:
        """Return scores, shape (n, N, N), of a spectrum (n, C, N, N // 2 + 1) per target."""
        cells = sample.shape[-2]
        product = (sample * filters).sum(dim=1)
        return torch.fft.irfft2(product, s=(cells, cells)) * cells**2


def margin_loss(scores: torch.Tensor, label: torch.Tensor, core: float) -> torch.Tensor:
    """
    Return the one-sided loss of each target, as a part of the label's energy.

    Parameters
    ----------
    scores, label : tensor, shape (n, N, N)
        What the filter says and what it should say.
    core : float
        Label from which falling short counts as well.

    """
    gap = scores - label
    violation = torch.where(label >= core, gap, gap.clamp_min(0))
    return violation.square().sum(dim=(1, 2)) / label.square().sum(dim=(1, 2))

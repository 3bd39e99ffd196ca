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
The margin loss on a grid of shifts: objective, slack step, and the operator M.

Two readings of the anchor s(y0) in the margin constraint of the paper, (7)-(12), share one
interface. In each outer iteration `slack_targets` solves for the slack (9), and the filter then
fits  M S = q  in the least squares sense (10); `normal` is M^H M and the targets are M^H q::

    unit     s(y0) has its desired value m(y0) = 1:  M S = s, q = m - eps, a one-sided loss,
             two-sided on the core {m >= 1/2}; with all shifts in the core it is ridge regression
    coupled  s(y0) moves with the filter:            M S = s(0) - s, q = max(l, s(0) - s)

The literal (11)-(12), in which s(y0) is that of the last filter, is not monotone and not offered.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from lmsco_ros.core.backend import Array, array_namespace, Backend
from lmsco_ros.core.fourier.series import analyze, synthesize, value_at_origin

__all__ = ['CoupledAnchor', 'MarginLoss', 'UnitAnchor', 'gaussian_label', 'make_margin_loss']

# Label from which the loss of the unit anchor is two-sided: half of the peak.
_CORE = 0.5


def gaussian_label(size: int, sigma: tuple[float, float]) -> np.ndarray:
    """
    Return the desired score m on a grid of shifts (paper, (3)).

    Parameters
    ----------
    size : int
        Points per axis.
    sigma : tuple of float
        Standard deviations (y, x) in periods.

    Returns
    -------
    ndarray, shape (size, size)
        Periodic Gaussian of peak 1 at [0, 0], of the bandwidth that the grid carries.

    Notes
    -----
    Per axis m[k] = sqrt(2 pi) sigma exp(-2 (pi sigma k)^2).

    """
    k = np.fft.fftfreq(size, 1 / size)
    axes = [np.fft.ifft(np.exp(-2 * (np.pi * s * k)**2)).real for s in sigma]
    label = axes[0][:, None] * axes[1][None, :]
    return label / label[0, 0]


class MarginLoss(Protocol):
    """
    What the collaborative optimization needs to know of the loss.

    Attributes
    ----------
    couples_frequencies : bool
        Whether M^H M mixes frequencies or is the identity.

    """

    couples_frequencies: bool

    def normal(self, scores: Array) -> Array:
        """Return M^H M S for series of scores, shape (2K + 1, K + 1, n)."""

    def slack_targets(self, scores: Array) -> Array:
        """Solve for the slack (paper, (8)) and return M^H q, of the shape of the scores."""

    def losses(self, scores: Array) -> Array:
        """Return the mean squared hinge loss of each sample, shape (n,) (paper, (2))."""


class UnitAnchor:
    """
    Anchor held at its desired value: a one-sided loss off the core (paper, (11)).

    With s(y0) = 1 the label rho of the paper is m - eps, and the filter fits it as it is.

    Parameters
    ----------
    label : array, shape (N, N)
        Desired score m on the grid of shifts.
    core : float
        The loss is two-sided where m >= core; -inf gives ridge regression.

    """

    couples_frequencies = False

    def __init__(self, label: Array, core: float) -> None:
        xp = array_namespace(label)
        self._size = int(label.shape[0])
        self._label = label[:, :, None]
        self._floor = xp.where(self._label >= core, self._label, -xp.inf * xp.ones_like(
            self._label))

    def normal(self, scores: Array) -> Array:
        """Return S: M is the identity."""
        return scores

    def slack_targets(self, scores: Array) -> Array:
        """Return the series of q = m on the core, min(m, s) elsewhere (paper, (9))."""
        return analyze(self._targets(synthesize(scores, self._size)))

    def losses(self, scores: Array) -> Array:
        """Return the mean of (s - m)^2 on the core and max(0, s - m)^2 elsewhere."""
        values = synthesize(scores, self._size)
        return _mean_of_squares(values - self._targets(values))

    def _targets(self, values: Array) -> Array:
        """Return q on the grid."""
        xp = array_namespace(values)
        return xp.maximum(xp.minimum(self._label, values), self._floor)


class CoupledAnchor:
    """
    Anchor that moves with the filter: the problem as it stands (paper, (10)).

    Parameters
    ----------
    label : array, shape (N, N)
        Desired score m on the grid of shifts.

    """

    couples_frequencies = True

    def __init__(self, label: Array) -> None:
        self._size = int(label.shape[0])
        self._margin = 1 - label[:, :, None]

    def normal(self, scores: Array) -> Array:
        """Return S[k] plus the sum of S over all k' != 0; 0 at k = 0."""
        order = int(scores.shape[1]) - 1
        result = scores + (value_at_origin(scores) - array_namespace(scores).real(
            scores[order, 0, :]))
        result[order, 0, :] = 0
        return result

    def slack_targets(self, scores: Array) -> Array:
        """Return M^H q = Q[0] - Q[k], q = max(l, s(0) - s); 0 at k = 0 (paper, (9))."""
        series = analyze(self._targets(self._differences(scores)))
        order = int(scores.shape[1]) - 1
        return series[order, 0, :] - series

    def losses(self, scores: Array) -> Array:
        """Return the mean of max(0, l - (s(0) - s))^2."""
        differences = self._differences(scores)
        return _mean_of_squares(self._targets(differences) - differences)

    def _differences(self, scores: Array) -> Array:
        """Return d = s(0) - s on the grid."""
        values = synthesize(scores, self._size)
        return values[:1, :1, :] - values

    def _targets(self, differences: Array) -> Array:
        """Return q = l + eps = max(l, d)."""
        return array_namespace(differences).maximum(differences, self._margin)


def _mean_of_squares(values: Array) -> Array:
    """Return the mean over the grid, per sample."""
    return array_namespace(values).mean(values**2, axis=(0, 1))


def make_margin_loss(loss: str, label: np.ndarray, backend: Backend) -> MarginLoss:
    """
    Return the loss of a name.

    Parameters
    ----------
    loss : {'unit', 'coupled', 'ridge'}
        The margin by a reading of s(y0), or ridge regression.
    label : ndarray, shape (N, N)
        Desired score on the grid of shifts.
    backend : Backend
        Where the scores live.

    """
    values = backend.asarray(label)
    if loss == 'coupled':
        return CoupledAnchor(values)
    return UnitAnchor(values, _CORE if loss == 'unit' else -np.inf)

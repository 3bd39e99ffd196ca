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
How probable it is that a detection is the target, and that a box there covers more than half.

Logistic regressions on all that speaks for the detection, fitted by `python -m training.trust
--data DATA --rendered FOLDER` on clips of the train part and rendered sequences that the extent
network never saw, as they are and under challenges.
"""

from __future__ import annotations

from dataclasses import dataclass
import math

__all__ = ['belief', 'log_odds', 'trust', 'TrustModel', 'MEASURED', 'UNMEASURED']

# The first is taken for what is not a number: it speaks against the target.
_QUALITY_LIMITS = 0.02, 5.0
_LIKENESS_LIMITS = -0.5, 1.5
_PRESENCE_LIMITS = -8.0, 8.0
_VAGUENESS_LIMITS = 0.5, 0.03
_PROBABILITY_LIMITS = 1e-4, 1 - 1e-4


@dataclass(frozen=True)
class TrustModel:
    """
    Coefficients of the log-odds.

    Attributes
    ----------
    quality : float
        Of the logarithm of the sharpness over what is expected.
    likeness : float
        Of the score of the first frame's filter, over what is expected.
    presence : float
        Of the log-odds of the extent network.
    vagueness : float
        Of the logarithm of the deviation of the edges that it measures.
    constant : float
        Added.

    """

    quality: float
    likeness: float
    presence: float
    vagueness: float
    constant: float


MEASURED = TrustModel(
    quality=0.53, likeness=1.33, presence=0.27, vagueness=-3.27, constant=-8.83)
UNMEASURED = TrustModel(
    quality=1.35, likeness=4.51, presence=0.0, vagueness=0.0, constant=-0.85)
BELIEF_MEASURED = TrustModel(
    quality=1.34, likeness=1.08, presence=0.18, vagueness=-0.71, constant=-0.38)
BELIEF_UNMEASURED = TrustModel(
    quality=1.30, likeness=3.65, presence=0.0, vagueness=0.0, constant=0.47)


def regressors(quality: float, likeness: float, presence: float | None,
               vagueness: float | None) -> tuple[float, float, float, float]:
    """
    Return what the coefficients multiply: bounded, so that no single hint decides alone.

    The last two are 0 where nothing was measured.
    """
    measured = ((0.0, 0.0) if presence is None or vagueness is None else (
        _clip(presence, _PRESENCE_LIMITS), math.log(_clip(vagueness, _VAGUENESS_LIMITS))))
    return (math.log(_clip(quality, _QUALITY_LIMITS)), _clip(likeness, _LIKENESS_LIMITS),
            *measured)


def trust(quality: float, likeness: float, presence: float | None = None,
          vagueness: float | None = None) -> float:
    """
    Return the probability that a box at a detection covers the target by more than half.

    Parameters
    ----------
    quality : float
        Sharpness of the score as a part of what is expected.
    likeness : float
        Score of the first frame's filter at the peak, as a part of what is expected.
    presence : float or None
        Log-odds of the extent network; None where there is none.
    vagueness : float or None
        Mean deviation of the edges that it measures, in sides of the target; None with
        `presence`.

    """
    unmeasured = presence is None or vagueness is None
    return _probability(UNMEASURED if unmeasured else MEASURED,
                        regressors(quality, likeness, presence, vagueness))


def belief(quality: float, likeness: float, presence: float | None = None,
           vagueness: float | None = None) -> float:
    """Return the probability that a detection is the target, even in a part; as `trust`."""
    unmeasured = presence is None or vagueness is None
    return _probability(BELIEF_UNMEASURED if unmeasured else BELIEF_MEASURED,
                        regressors(quality, likeness, presence, vagueness))


def log_odds(probability: float) -> float:
    """Return the logarithm of a probability over that of the opposite; bounded."""
    likely = _clip(probability, _PROBABILITY_LIMITS)
    return math.log(likely / (1 - likely))


def _probability(model: TrustModel, values: tuple[float, ...]) -> float:
    """Return what a model says of what its coefficients multiply."""
    weights = model.quality, model.likeness, model.presence, model.vagueness
    odds = model.constant + sum(
        weight * value for weight, value in zip(weights, values, strict=True))
    return 1 / (1 + math.exp(-odds))


def _clip(value: float, limits: tuple[float, float]) -> float:
    """Return a value within limits; the first one for what is not a number."""
    if not math.isfinite(value):
        return limits[0]
    return min(max(value, min(limits)), max(limits))

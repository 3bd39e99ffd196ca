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
The probability that a detection is the target, from all that speaks for it.

A logistic regression, fitted by `python -m training.trust --data DATA --rendered FOLDER` on clips
of the train part and rendered sequences that the extent network never saw, as they are and under
challenges, on detections that overlap the target by more than a half or not at all. The former
weigh nine times as much as the latter, as while a target is followed: a score of 0.5 is rather a
sign of its absence.
"""

from __future__ import annotations

from dataclasses import dataclass
import math

__all__ = ['trust', 'TrustModel', 'MEASURED', 'UNMEASURED']

_QUALITY_LIMITS = 0.02, 5.0
_LIKENESS_LIMITS = -0.5, 1.5
_PRESENCE_LIMITS = -8.0, 8.0


@dataclass(frozen=True)
class TrustModel:
    """
    Coefficients of the log-odds.

    Attributes
    ----------
    quality : float
        Of the logarithm of the sharpness over its reference.
    likeness : float
        Of the score of the first frame's filter.
    presence : float
        Of the log-odds of the extent network.
    constant : float
        Added.

    """

    quality: float
    likeness: float
    presence: float
    constant: float


MEASURED = TrustModel(quality=1.01, likeness=0.60, presence=1.01, constant=0.08)
UNMEASURED = TrustModel(quality=2.45, likeness=1.81, presence=0.0, constant=3.74)


def regressors(quality: float, likeness: float, presence: float) -> tuple[float, float, float]:
    """Return what the coefficients multiply: bounded, so that no single hint decides alone."""
    return (math.log(_clip(quality, _QUALITY_LIMITS)), _clip(likeness, _LIKENESS_LIMITS),
            _clip(presence, _PRESENCE_LIMITS))


def trust(quality: float, likeness: float, presence: float | None) -> float:
    """
    Return the probability that a detection is the target.

    Parameters
    ----------
    quality : float
        Sharpness of the score as a part of the reference.
    likeness : float
        Score of the first frame's filter at the peak, as a part of that in the first frame.
    presence : float or None
        Log-odds of the extent network; None where there is none.

    """
    model = UNMEASURED if presence is None else MEASURED
    values = regressors(quality, likeness, presence or 0.0)
    odds = model.constant + sum(
        weight * value for weight, value in zip(
            (model.quality, model.likeness, model.presence), values, strict=True))
    return 1 / (1 + math.exp(-odds))


def _clip(value: float, limits: tuple[float, float]) -> float:
    """Return a value within limits; the lower one for what is not a number."""
    return min(max(value, limits[0]), limits[1]) if math.isfinite(value) else limits[0]

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

"""Figures as short text, the same in the page and in tables."""

from __future__ import annotations

import math

from lmsco_ros.evaluation.protocols.bootstrap import Estimate
from lmsco_ros.evaluation.summaries.differences import enough_sequences, FEWEST_SEQUENCES

NONE = '–'


def number(value: float, decimals: int = 3) -> str:
    """Return a figure as text, without the zero before the point; a dash for NaN."""
    if not math.isfinite(value):
        return NONE
    text = f'{value:.{decimals}f}'
    if decimals >= 2 and abs(value) < 1:
        text = text.replace('0.', '.', 1)
    return text.replace('-', '−')


def interval(estimate: Estimate, decimals: int = 3) -> str:
    """Return the interval as `low – high`, empty where there is none."""
    if not math.isfinite(estimate.low):
        return ''
    return f'{number(estimate.low, decimals)} – {number(estimate.high, decimals)}'


def signed(estimate: Estimate, decimals: int = 3) -> str:
    """Return a difference with its sign."""
    text = number(estimate.value, decimals)
    return f'+{text}' if estimate.value > 0 else text


def spread_warning(sequences: int) -> str:
    """Return what must be said of intervals over so few sequences; empty when enough."""
    if enough_sequences(sequences):
        return ''
    return (f'With fewer than {FEWEST_SEQUENCES} sequences an interval shows no more than the '
            'spread between them, and no difference can be called real.')

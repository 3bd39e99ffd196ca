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

"""Plots of a one-pass run: success, precision, speed against accuracy."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
import numpy as np

from lmsco_ros.evaluation.geometry import Array
from lmsco_ros.evaluation.protocols.one_pass import (
    NORMALIZED_THRESHOLDS, PRECISION_THRESHOLDS, SUCCESS_THRESHOLDS)
from lmsco_ros.evaluation.report.formatting import number
from lmsco_ros.evaluation.report.style import legend, looks, new_axes, Place
from lmsco_ros.evaluation.summaries.one_pass import OnePassSummary

Summaries = Sequence[OnePassSummary]
_REAL_TIME = 30.0


def one_pass_plots(summaries: Summaries) -> dict[str, Figure]:
    """Return all plots of a one-pass run by their file names, without ending."""
    return {
        'success': _curves(
            'Success', 'overlap threshold', 'share of frames', SUCCESS_THRESHOLDS,
            [(item.tracker, item.success, item.success_auc.value) for item in summaries],
            'upper right'),
        'precision': _curves(
            'Precision (legend: at 20 px)', 'center error threshold [px]', 'share of frames',
            PRECISION_THRESHOLDS,
            [(item.tracker, item.precision, item.precision_20.value) for item in summaries],
            'lower right'),
        'normalized_precision': _curves(
            'Normalized precision', 'center error threshold [target sizes]', 'share of frames',
            NORMALIZED_THRESHOLDS,
            [(item.tracker, item.normalized, item.normalized_auc.value) for item in summaries],
            'lower right'),
        'speed': _speed(summaries),
    }


def _curves(title: str, x_label: str, y_label: str, thresholds: Array,
            curves: list[tuple[str, Array, float]], place: Place) -> Figure:
    figure, axes = new_axes(title, x_label, y_label)
    style = looks(name for name, _, _ in curves)
    for name, values, score in sorted(curves, key=lambda curve: -curve[2]):
        axes.plot(thresholds, values, color=style[name].color, linewidth=1.8,
                  label=f'{name}  {number(score)}')
    axes.set(xlim=(thresholds[0], thresholds[-1]), ylim=(0, 1.01))
    legend(axes, place)
    return figure


def _speed(summaries: Summaries) -> Figure:
    figure, axes = new_axes('Speed against accuracy',
                            'frames per second of processor time, one thread (log scale)',
                            'success AUC')
    style = looks(item.tracker for item in summaries)
    timed = [item for item in summaries if np.isfinite(item.cpu_rate.value)]
    for item in timed:
        look, score = style[item.tracker], item.success_auc
        axes.errorbar(item.cpu_rate.value, score.value,
                      yerr=[[score.value - score.low], [score.high - score.value]],
                      color=look.color, marker=look.marker, markersize=8, elinewidth=1,
                      capsize=3, alpha=0.95)
        axes.annotate(item.tracker, (item.cpu_rate.value, score.value), xytext=(8, 5),
                      textcoords='offset points', fontsize=9, color=look.color)
    axes.set_xscale('log')
    rates = [item.cpu_rate.value for item in timed] + [_REAL_TIME]
    low, high = min(rates) / 1.5, max(rates) * 2.2
    ticks = [base * power for power in (1, 10, 100, 1000) for base in (1, 2, 5)]
    axes.xaxis.set_major_locator(FixedLocator([tick for tick in ticks if low <= tick <= high]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
    axes.axvline(_REAL_TIME, color='#aab2bd', linestyle='--', linewidth=1)
    axes.annotate('30 Hz', (_REAL_TIME, 0.02), xytext=(4, 0), textcoords='offset points',
                  fontsize=8, color='#7a828e')
    axes.set(xlim=(low, high), ylim=(0, 1))
    return figure

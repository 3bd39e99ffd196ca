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

"""Plots of a supervised run: accuracy-robustness, raw and ranked, and expected overlap."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
import numpy as np

from lmsco_ros.evaluation.report.formatting import number
from lmsco_ros.evaluation.report.style import legend, legend_beside, looks, new_axes
from lmsco_ros.evaluation.summaries.anchors import AnchorSummary
from lmsco_ros.evaluation.summaries.supervised import SupervisedSummary

Summaries = Sequence[SupervisedSummary]
Point = Callable[[SupervisedSummary], tuple[float, float]]


def supervised_plots(summaries: Summaries, interval: tuple[int, int]) -> dict[str, Figure]:
    """
    Return all plots of a supervised run by their file names, without ending.

    Parameters
    ----------
    summaries : sequence of SupervisedSummary
        All trackers of the run.
    interval : (int, int)
        Sequence lengths, in frames, that EAO is the mean over.

    """
    return {
        'ar_raw': _accuracy_robustness_raw(summaries),
        'ar_rank': _accuracy_robustness_ranks(summaries),
        'eao_curve': expected_overlap_plot(summaries, interval),
        'eao_order': _order(summaries),
    }


def _accuracy_robustness_raw(summaries: Summaries) -> Figure:
    figure, axes = new_axes('Accuracy–robustness, raw',
                            'reliability: chance to survive 30 frames', 'accuracy')
    style = looks(item.tracker for item in summaries)
    for item in summaries:
        look, a, r = style[item.tracker], item.accuracy, item.reliability
        axes.errorbar(r.value, a.value, xerr=[[r.value - r.low], [r.high - r.value]],
                      yerr=[[a.value - a.low], [a.high - a.value]], color=look.color,
                      elinewidth=0.8, alpha=0.35)
        axes.plot(r.value, a.value, marker=look.marker, color=look.color, markersize=9,
                  linestyle='none', label=item.tracker)
    axes.set(xlim=(0, 1.02), ylim=(0, 1))
    legend_beside(figure)
    return figure


def _accuracy_robustness_ranks(summaries: Summaries) -> Figure:
    figure, axes = new_axes('Accuracy–robustness, ranked', 'mean robustness rank (1 is best)',
                            'mean accuracy rank (1 is best)')
    style = looks(item.tracker for item in summaries)
    for item in summaries:
        look = style[item.tracker]
        axes.plot(item.robustness_rank, item.accuracy_rank, marker=look.marker,
                  color=look.color, markersize=9, linestyle='none', label=item.tracker)
    worst = len(summaries) + 0.4
    axes.set(xlim=(worst, 0.6), ylim=(worst, 0.6))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    legend_beside(figure)
    return figure


def expected_overlap_plot(summaries: Sequence[SupervisedSummary | AnchorSummary],
                          interval: tuple[int, int]) -> Figure:
    """Return the expected-overlap curves, with the interval that EAO is the mean over."""
    figure, axes = new_axes('Expected average overlap', 'sequence length [frames]',
                            'expected overlap')
    style = looks(item.tracker for item in summaries)
    axes.axvspan(*interval, color='#eef2f7', zorder=0)
    axes.annotate(f'EAO interval {interval[0]}–{interval[1]}', (interval[0], 0.97),
                  xytext=(6, 0), textcoords='offset points', fontsize=8, color='#7a828e')
    for item in sorted(summaries, key=lambda item: -item.eao.value):
        lengths = np.arange(2, len(item.curve) + 1)
        axes.plot(lengths, item.curve[1:], color=style[item.tracker].color, linewidth=1.8,
                  label=f'{item.tracker}  {number(item.eao.value)}')
    axes.set(xlim=(2, max(len(summaries[0].curve), 3)), ylim=(0, 1.02))
    legend(axes, 'lower left')
    return figure


def _order(summaries: Summaries) -> Figure:
    figure, axes = new_axes('EAO order', 'order (best on the right)',
                            'expected average overlap')
    style = looks(item.tracker for item in summaries)
    ordered = sorted(summaries, key=lambda item: -item.eao.value)
    for place, item in enumerate(ordered, start=1):
        look, eao = style[item.tracker], item.eao
        axes.vlines(place, eao.low, eao.high, color=look.color, linewidth=1, alpha=0.5)
        axes.plot(place, eao.value, marker=look.marker, color=look.color, markersize=9,
                  linestyle='none', label=f'{item.tracker}  {number(eao.value)}')
    axes.set(xlim=(len(ordered) + 0.6, 0.4), ylim=(0, 1))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    legend_beside(figure)
    return figure

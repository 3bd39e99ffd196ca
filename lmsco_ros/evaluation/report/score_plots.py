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

"""The reliability diagram: how often frames of a score are good."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure
import numpy as np

from lmsco_ros.evaluation.report.formatting import number
from lmsco_ros.evaluation.report.style import legend, looks, new_axes
from lmsco_ros.evaluation.summaries.score import ScoreSummary

_LARGEST_MARK = 160.0


def score_plots(summaries: Sequence[ScoreSummary]) -> dict[str, Figure]:
    """Return the diagram by its file name, nothing where no score is a probability."""
    style = looks(item.tracker for item in summaries)
    told = [item for item in summaries if item.calibration.frames.any()]
    if not told:
        return {}
    figure, axes = new_axes('Reliability (legend: calibration error; area: frames)', 'mean score',
                            'share of frames with an overlap above one half')
    axes.plot([0, 1], [0, 1], color='#aab2bd', linestyle='--', linewidth=1)
    for item in told:
        look, found = style[item.tracker], item.calibration
        there = found.frames > 0
        score, share = found.mean_scores[there], found.shares[there]
        axes.plot(score, share, color=look.color, linewidth=1.4,
                  label=f'{item.tracker}  {number(item.calibration_error.value)}')
        axes.scatter(score, share, color=look.color, marker=look.marker, alpha=0.8,
                     s=8 + _LARGEST_MARK * np.sqrt(found.frames[there] / found.frames.sum()))
    axes.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
    legend(axes, 'lower right')
    return {'reliability': figure}

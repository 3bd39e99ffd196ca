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

"""A whole run on one page: frames, target close up, confidence and score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import cv2
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
import numpy as np
import numpy.typing as npt

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.media.colors import TRUTH_COLOR
from lmsco_ros.visualization.overlay import state_color

_COLUMNS = 6
_LEAST_CONTRAST = 40
_INK, _MUTED, _PAPER = '#1f2933', '#7b8794', '#ffffff'


@dataclass(frozen=True, eq=False)
class Moment:
    """
    One frame that may be shown.

    Attributes
    ----------
    index : int
        Number of the frame.
    view : ndarray, shape (H, W) or (H, W, 3), uint8
        8-bit view of the image.
    result : TrackResult
        What the tracker said.
    truth : BoundingBox or None
        Known box.

    """

    index: int
    view: npt.NDArray[np.uint8]
    result: TrackResult
    truth: BoundingBox | None = None


class ContactSheet:
    """
    Collects a run of any length and draws it on one page.

    Only a few evenly spread frames are kept, however long the run gets.
    """

    def __init__(self) -> None:
        self._moments: list[Moment] = []
        self._stride = 1
        self._count = 0
        self._indices: list[int] = []
        self._scores: list[float] = []
        self._states: list[TrackState] = []
        self._overlaps: list[float] = []

    def add(self, moment: Moment) -> None:
        """Take the next frame into account."""
        truth, result = moment.truth, moment.result
        self._indices.append(moment.index)
        self._scores.append(result.score)
        self._states.append(result.state)
        self._overlaps.append(float('nan') if truth is None else
                              0.0 if result.state is TrackState.LOST else
                              result.box.overlap(truth))
        if self._count % self._stride == 0:
            self._moments.append(moment)
            if len(self._moments) > 8 * _COLUMNS:
                self._moments = self._moments[::2]
                self._stride *= 2
        self._count += 1

    def save(self, path: Path, title: str) -> None:
        """
        Draw the page.

        Parameters
        ----------
        path : Path
            Picture file, such as summary.png.
        title : str
            Headline.

        Raises
        ------
        ValueError
            When nothing was added.

        """
        if not self._moments:
            raise ValueError('nothing to draw; add frames first')
        moments = _evenly(self._moments, _COLUMNS)
        shape = moments[0].view.shape
        # Rows are as high as their pictures, so that no page has holes.
        heights = [15.2 / _COLUMNS * shape[0] / shape[1], 15.2 / _COLUMNS, 15.2 / _COLUMNS, 2.6]
        figure = Figure(figsize=(16, sum(heights) + 2.5), facecolor=_PAPER)
        FigureCanvasAgg(figure)
        rows = figure.add_gridspec(4, 1, height_ratios=heights, left=0.045, right=0.985,
                                   top=1 - 1.0 / figure.get_figheight(),
                                   bottom=0.6 / figure.get_figheight(), hspace=0.15)
        self._headline(figure, title)
        for row, draw in enumerate((_draw_frame, _draw_close_up, _draw_confidence)):
            cells = rows[row].subgridspec(1, _COLUMNS, wspace=0.04)
            for column, moment in enumerate(moments):
                axes = figure.add_subplot(cells[column])
                _bare(axes)
                draw(axes, moment)
                if column == 0:
                    axes.set_ylabel(('frame', 'search region', 'confidence')[row],
                                    color=_MUTED, fontsize=11)
        self._draw_curve(figure.add_subplot(rows[3]), [m.index for m in moments])
        figure.savefig(path, dpi=100)

    def _headline(self, figure: Figure, title: str) -> None:
        top = 1 - 0.42 / figure.get_figheight()
        figure.text(0.045, top, title, fontsize=17, color=_INK, weight='bold', va='center')
        shares = [f'{state.name.lower()} {self._states.count(state)}'
                  for state in TrackState if state in self._states]
        facts = f'{self._count} frames  ·  {"  ·  ".join(shares)}'
        if not np.isnan(self._overlaps).all():
            facts += f'  ·  mean overlap {np.nanmean(self._overlaps):.3f}'
        figure.text(0.985, top, facts, fontsize=12, color=_MUTED, va='center', ha='right')

    def _draw_curve(self, axes: Axes, shown: Sequence[int]) -> None:
        """Draw score and overlap over time, on bands for the states."""
        for state, run in groupby(range(self._count), key=self._states.__getitem__):
            span = list(run)
            axes.axvspan(self._indices[span[0]] - 0.5, self._indices[span[-1]] + 0.5,
                         color=_rgb(state), alpha=0.16, linewidth=0)
        axes.plot(self._indices, self._scores, color=_INK, linewidth=1.4)
        legend: list[Line2D | Patch] = [Line2D([], [], color=_INK, label='score')]
        if not np.isnan(self._overlaps).all():
            axes.plot(self._indices, self._overlaps, color='#2f6fde', linewidth=1.2)
            legend.append(Line2D([], [], color='#2f6fde', label='overlap with the truth'))
        legend += [Patch(color=_rgb(state), alpha=0.3, label=state.name.lower())
                   for state in TrackState if state in self._states]
        for index in shown:
            axes.axvline(index, color=_MUTED, linewidth=0.8, linestyle=':')
        axes.set(xlim=(self._indices[0] - 0.5, self._indices[-1] + 0.5), ylim=(0, 1.05),
                 xlabel='frame')
        axes.legend(handles=legend, loc='lower center', bbox_to_anchor=(0.5, 1.0),
                    ncols=len(legend), frameon=False, fontsize=10)
        axes.tick_params(colors=_MUTED)
        axes.grid(axis='y', color=_MUTED, alpha=0.25)
        for side in ('top', 'right'):
            axes.spines[side].set_visible(False)


def _evenly(moments: Sequence[Moment], count: int) -> list[Moment]:
    """Return at most `count` of `moments`, first and last among them."""
    places = np.linspace(0, len(moments) - 1, min(count, len(moments)))
    return [moments[i] for i in sorted(set(np.round(places).astype(int)))]


def _bare(axes: Axes) -> None:
    axes.set(xticks=[], yticks=[])
    for spine in axes.spines.values():
        spine.set_visible(False)


def _rgb(state: TrackState) -> tuple[float, float, float]:
    blue, green, red = (value / 255 for value in state_color(state))
    return red, green, blue


def _draw_frame(axes: Axes, moment: Moment) -> None:
    """Draw the whole image with its box and the search region."""
    height, width = moment.view.shape[:2]
    _show(axes, moment.view, (0, width, height, 0))
    _outline(axes, moment.result.search_region, _MUTED, 0.8, '-')
    _draw_boxes(axes, moment)
    axes.set(xlim=(0, width), ylim=(height, 0))
    axes.set_title(f'{moment.index}', fontsize=12, color=_INK, loc='left', pad=4)
    axes.set_title(f'{moment.result.state.name.lower()} {moment.result.score:.2f}',
                   fontsize=11, color=[0.72 * c for c in _rgb(moment.result.state)],
                   loc='right', pad=4)


def _draw_close_up(axes: Axes, moment: Moment) -> None:
    """Draw the part of the image in which the target was searched, in its own contrast."""
    height, width = moment.view.shape[:2]
    region = moment.result.search_region
    part = moment.view[max(0, int(region.y)):max(0, int(region.y + region.height)),
                       max(0, int(region.x)):max(0, int(region.x + region.width))]
    picture = _show(axes, moment.view, (0, width, height, 0))
    if part.size:
        low, high = np.percentile(part, (1, 99.8))
        picture.set_clim(low, max(high, low + _LEAST_CONTRAST))
    _draw_boxes(axes, moment)
    _frame_region(axes, region)


def _draw_confidence(axes: Axes, moment: Moment) -> None:
    """Draw the confidence map over the same part of the image."""
    region = moment.result.search_region
    scores = moment.result.confidence_map
    axes.imshow(scores, cmap='magma', interpolation='bilinear', aspect='auto',
                vmin=min(0.0, float(scores.min())), vmax=max(float(scores.max()), 1e-6),
                extent=(region.x, region.x + region.width, region.y + region.height, region.y))
    _outline(axes, moment.result.box, '#ffffff', 1.0,
             '--' if moment.result.state is TrackState.LOST else '-')
    _frame_region(axes, region)


def _show(axes: Axes, view: npt.NDArray[np.uint8],
          extent: tuple[float, float, float, float]) -> AxesImage:
    picture = cv2.cvtColor(view, cv2.COLOR_BGR2RGB) if view.ndim == 3 else view
    return axes.imshow(picture, cmap='gray', vmin=0, vmax=255, extent=extent, aspect='auto')


def _frame_region(axes: Axes, region: BoundingBox) -> None:
    """Show the square around `region`, so that nothing is distorted."""
    (x, y), side = region.center, max(region.size)
    axes.set(xlim=(x - side / 2, x + side / 2), ylim=(y + side / 2, y - side / 2),
             facecolor='#d9dee3')


def _draw_boxes(axes: Axes, moment: Moment) -> None:
    if moment.truth is not None:
        _outline(axes, moment.truth, TRUTH_COLOR, 1.6, (0, (2, 1.5)))
    _outline(axes, moment.result.box, _rgb(moment.result.state), 1.8,
             '--' if moment.result.state is TrackState.LOST else '-')


def _outline(axes: Axes, box: BoundingBox, color: object, width: float,
             style: object) -> None:
    axes.add_patch(Rectangle((box.x, box.y), box.width, box.height, fill=False,
                             edgecolor=color, linewidth=width, linestyle=style))

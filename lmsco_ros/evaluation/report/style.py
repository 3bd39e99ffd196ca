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

"""How trackers look in plots: the same color and marker everywhere."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure

_COLORS = ('#c1121f', '#1d4e89', '#0096c7', '#e09f3e', '#6a4c93', '#3a3a3a',
           '#d36ba0', '#7f9c3b', '#b5838d', '#8d5a2b', '#9a9a9a', '#5f0f40')
# Of trackers that are in tables only.
PUBLISHED_COLOR = '#c4c9d1'
_MARKERS = 'osD^vP*X<>hp'
_SIZE = (5.6, 4.2)
_GRID = '#e3e6ea'
_TEXT = '#333a44'

Place = Literal['lower left', 'lower right', 'upper right']


@dataclass(frozen=True)
class Look:
    """Color and marker of one tracker."""

    color: str
    marker: str


def looks(trackers: Iterable[str]) -> dict[str, Look]:
    """Return a look for each tracker, by its place in the run."""
    return {name: Look(_COLORS[index % len(_COLORS)], _MARKERS[index % len(_MARKERS)])
            for index, name in enumerate(trackers)}


def new_axes(title: str, x_label: str, y_label: str) -> tuple[Figure, Axes]:
    """Return a figure with one set of axes in the style of the report."""
    figure = Figure(figsize=_SIZE, dpi=150, layout='constrained')
    axes = figure.add_subplot()
    style_axes(axes, title, x_label, y_label)
    return figure, axes


def style_axes(axes: Axes, title: str, x_label: str, y_label: str) -> None:
    """Give axes the style of the report."""
    axes.set_title(title, fontsize=11, color=_TEXT, loc='left', fontweight='bold')
    axes.set_xlabel(x_label, fontsize=9, color=_TEXT)
    axes.set_ylabel(y_label, fontsize=9, color=_TEXT)
    axes.tick_params(labelsize=8, colors=_TEXT, length=3)
    axes.grid(color=_GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    for side in ('top', 'right'):
        axes.spines[side].set_visible(False)
    for side in ('left', 'bottom'):
        axes.spines[side].set_color('#aab2bd')


def legend(axes: Axes, place: Place) -> None:
    """Add a legend of the trackers."""
    axes.legend(loc=place, fontsize=8, frameon=True, framealpha=0.9, edgecolor=_GRID)


def legend_beside(figure: Figure) -> None:
    """Add a legend of the trackers outside the axes, where any place may hold a point."""
    figure.legend(loc='outside right upper', fontsize=8, frameon=False)

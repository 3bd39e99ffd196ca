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

"""What `lmsco evaluate` may be told."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from lmsco_ros.cli.options import MOST_FRAMES


class Protocol(str, Enum):
    """How trackers are run."""

    OPE = 'ope'
    VOT = 'vot'
    ANCHORS = 'anchors'


class EngineName(str, Enum):
    """Who runs trackers."""

    LOCAL = 'local'
    DASK = 'dask'


class Share(NamedTuple):
    """A share of the sequences as given: its number from 1 on, and how many there are."""

    number: int
    total: int


def parse_shard(text: str) -> Share:
    """Return the share of `i/n`, or tell what a share looks like."""
    number, _, count = text.partition('/')
    if not (number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count)):
        raise typer.BadParameter(f'{text!r} is no share; give its number and how many there are, '
                                 'from 1/8 to 8/8')
    return Share(int(number), int(count))


class PublishedTable(NamedTuple):
    """What a file of published figures holds, and the file."""

    figure: str
    path: Path


def parse_published(text: str) -> PublishedTable:
    """Return the parts of `FIGURE=FILE`, or tell what they look like."""
    figure, equals, path = text.partition('=')
    if not (figure and equals and path):
        raise typer.BadParameter(f'{text!r} names no figure and file; give them as in '
                                 'success_auc=auc.csv')
    return PublishedTable(figure, Path(path).expanduser())


DatasetArgument = Annotated[Path, typer.Argument(
    show_default=False,
    help='Folder of a VOT, OTB, PTB-TIR, LSOTB-TIR, LaSOT, GOT-10k, TrackingNet, Anti-UAV or '
         'video dataset; docs/datasets.md shows them.')]
OutputOption = Annotated[Path, typer.Option(
    file_okay=False, show_default=False,
    help='Folder for records, plots and report.html; finished work in it is kept.')]
TrackerOption = Annotated[list[str] | None, typer.Option(
    show_default='all that work here',
    help='Preset, config:FILE (YAML), csrt, kcf, mil, mosse, medianflow, '
         'nanotrack:BACKBONE,HEAD, vittrack:NET, trax:NAME=COMMAND or '
         'python:MODULE:CALLABLE. For the peers of OpenCV, images of more than 8 bits are '
         'stretched from the 1st to the 99th percentile of the image of each start. '
         'May be repeated.')]
ProtocolOption = Annotated[Protocol, typer.Option(
    help='ope: one pass; vot: start again after each failure; anchors: start at several '
         'frames of each sequence.')]
EveryOption = Annotated[int | None, typer.Option(
    min=1, show_default='50', help='anchors: frames from one start to the next.')]
LengthOption = Annotated[int | None, typer.Option(
    min=2, show_default='to the end or back to the beginning, whichever is farther',
    help='anchors: track N frames forward from each start.')]
SequencesOption = Annotated[str, typer.Option(
    help='Pattern of names, such as "vot_tir/*" or "bird*".')]
FramesOption = Annotated[int | None, typer.Option(
    min=2, max=MOST_FRAMES, show_default=False,
    help='Only the first N frames of each sequence.')]
JobsOption = Annotated[int | None, typer.Option(
    min=1, show_default='1', help='Number of single-threaded processes on this machine.')]
EngineOption = Annotated[EngineName, typer.Option(
    help='local: processes of this machine; dask: workers of a Dask cluster, which --jobs '
         'starts here unless --scheduler names one.')]
SchedulerOption = Annotated[str | None, typer.Option(
    metavar='ADDRESS', show_default=False,
    help='dask: scheduler that is there already, such as tcp://10.0.0.1:8786; its workers must '
         'see the dataset at the same path.')]
ShardOption = Annotated[Share | None, typer.Option(
    parser=parse_shard, metavar='I/N', show_default=False,
    help='Only the I-th of N shares of the sequences, for queues of jobs that know nothing of '
         'each other; `lmsco results` puts the folders together.')]
SplitOption = Annotated[Path | None, typer.Option(
    exists=True, dir_okay=False, show_default=False,
    help='YAML file of a split of the dataset: names of sequences by part and group.')]
PublishedOption = Annotated[list[PublishedTable] | None, typer.Option(
    '--published', parser=parse_published, metavar='FIGURE=FILE', show_default=False,
    help='Set figures that others published beside those of the one-pass run: success_auc, '
         'precision_5, precision_20 or normalized_precision of each sequence; '
         'docs/datasets.md shows the file. May be repeated.')]
PartOption = Annotated[str, typer.Option(help='Part of the split that is evaluated.')]
ChallengeOption = Annotated[list[str] | None, typer.Option(
    show_default='the sequences as they are',
    help='Make the sequences harder: disappear_1s, disappear_3s, leave, leave_edge, cut, '
         'cut_other_view, twin, twin_crosses, twin_remains, camouflage, shutter, gain_jump, '
         'noise_step, contrast_step, stretch_step, polarity, dead_pixels, telemetry, nan, text, '
         'sixteen_bit, start_on_background, start_on_noise or all. May be repeated.')]

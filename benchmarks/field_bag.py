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
Ten minutes of a camera through the real node: many sequences, losses and shutter events.

Joins the sequences of a dataset to one bag of 30 frames a second, with the target taken away
for one and for three seconds and the shutter closed now and then; a mark on
`init_box_stamped`, as a person makes it, starts the target of each sequence. Plays it through
the node at the pace of the camera, and writes what was answered: figures for each event and
each part, and a picture of chosen moments. What is in the output folder already is kept; with
`--page`, the figures take the place of what stands between `<!-- recording -->` and
`<!-- /recording -->` there. With the package on the path:
python -m benchmarks.field_bag --data DATASET --output FOLDER [--help]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
from rclpy.serialization import serialize_message
from rosbags.typesys import get_typestore, Stores

from benchmarks.challenge_table import insert
from benchmarks.field_answers import Answers, in_parts, read_answers, write_answers
from benchmarks.field_sheet import draw_sheet
from benchmarks.joined_recording import join, Part, read_truth, stamp_of, write_truth
from benchmarks.measurement import markdown_table
from lmsco_ros.evaluation.report.formatting import NONE, number
from lmsco_ros.evaluation.run_file import EvaluationRun, SequenceInfo
from lmsco_ros.evaluation.session import Request, select_sequences
from lmsco_ros.evaluation.summaries.confidence import summarize_confidence
from lmsco_ros.replay.bag_images import RAW
from lmsco_ros.replay.bag_maker import image_message
from lmsco_ros.replay.bag_replay import MARKS_TOPIC, Replay, ReplayPlan
from lmsco_ros.replay.bags.output import BagOutput
from lmsco_ros.replay.headers import header_at
from lmsco_ros.replay.player import Exchange
from lmsco_ros.replay.storage import Storage
from msg_adapters.boxes import polygon_from_box

MARK = 'geometry_msgs/msg/PolygonStamped'
SIZE = 640, 512
EVENT_NAMES = {'': 'as recorded', 'disappear_1s': 'gone for 1 s', 'disappear_3s': 'gone for 3 s',
               'shutter': 'shutter'}
COLUMNS = ('frames', 'answered', 'p50 ms', 'p95 ms', 'p99 ms', 'tracking', 'uncertain', 'lost',
           'mean overlap', 'LOST declared', 'median frames to LOST', 'found again',
           'median frames to that')


def write_bag(parts: Sequence[Part], path: Path) -> None:
    """Write images, and a mark for each part just before its first image."""
    store = get_typestore(Stores.ROS2_JAZZY)
    with BagOutput(path, Storage.MCAP) as writer:
        images = writer.add_connection('/image_raw', RAW, typestore=store)
        marks = writer.add_connection(MARKS_TOPIC, MARK, typestore=store)
        index = 0
        for part in parts:
            writer.write(marks, stamp_of(index) - 1, _mark(part, stamp_of(index)))
            for image in part.images():
                stamp = stamp_of(index)
                message = image_message(store, image, stamp, 'thermal_camera')
                writer.write(images, stamp, store.serialize_cdr(message, RAW))
                index += 1


def _mark(part: Part, stamp: int) -> bytes:
    """Return the message that starts the target of a part."""
    header = header_at(stamp, 'thermal_camera')
    return serialize_message(polygon_from_box(part.mark.as_tuple(), header))


def play(bag: Path, output: Path, parameters: dict[str, object],
         rate: float = 1.0) -> list[Exchange]:
    """Play the bag through the node at the pace of the camera, or at another rate."""
    plan = ReplayPlan(bag=bag, output=output, storage=Storage.MCAP, boxes=(), topic='/image_raw',
                      rate=rate, frames=None, parameters=parameters, outputs=('overlay',))
    done = 0

    def on_frame() -> None:
        nonlocal done
        done += 1
        if done % 900 == 0:
            print(f'{done} frames played', flush=True)

    return Replay(plan).run(lambda total: None, on_frame)


def figures(parts: Sequence[SequenceInfo], answers: Sequence[Answers]) -> list[str]:
    """Return the figures of some parts in the order of `COLUMNS`."""
    states = np.concatenate([item.states for item in answers])
    latencies = np.concatenate([item.latencies for item in answers])
    answered = states != ''
    traces = tuple(item.trace for item in answers)
    overlap = np.concatenate([part.overlaps(trace, in_image=True)
                              for part, trace in zip(parts, traces)])
    summary, = summarize_confidence(EvaluationRun('ope', tuple(parts), {'node': traces}))
    shares = [number((states[answered] == state).mean()) for state in
              ('tracking', 'uncertain', 'lost')]
    times = np.percentile(latencies[answered], (50, 95, 99)) if answered.any() else [np.nan] * 3
    left, back = summary.departures, summary.returns
    return [str(len(states)), str(answered.sum()), *(number(time, 1) for time in times), *shares,
            number(float(np.nanmean(overlap))),
            f'{summary.declared} of {left}' if left else NONE, number(summary.delay, 0),
            f'{summary.found} of {back}' if back else NONE, number(summary.found_delay, 0)]


def event_table(parts: Sequence[SequenceInfo], answers: Sequence[Answers]) -> str:
    """Return the figures for each event, and in all, as a Markdown table."""
    events = {part.challenge for part in parts}
    groups = [(name, [index for index, part in enumerate(parts) if part.challenge == event])
              for event, name in EVENT_NAMES.items() if event in events]
    groups.append(('**in all**', list(range(len(parts)))))
    return markdown_table(('event', *COLUMNS), [
        [f'{name} ({len(chosen)} parts)',
         *figures([parts[index] for index in chosen], [answers[index] for index in chosen])]
        for name, chosen in groups])


def part_table(parts: Sequence[SequenceInfo], answers: Sequence[Answers]) -> str:
    """Return the figures for each part as a Markdown table."""
    return markdown_table(('part', *COLUMNS), [
        [f'{part.full_name}, {EVENT_NAMES[part.challenge]}', *figures([part], [answer])]
        for part, answer in zip(parts, answers)])


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--data', type=Path, required=True,
                        help='folder of a dataset, as for lmsco evaluate')
    parser.add_argument('--output', type=Path, required=True)
    parser.add_argument('--sequences', default='*', help='pattern of names, such as "drone_ir/*"')
    parser.add_argument('--split', type=Path, help='only the test part of the split in this file')
    parser.add_argument('--frames', type=int, default=18_000)
    parser.add_argument('--preset', default='default')
    parser.add_argument('--threads', type=int, default=0)
    parser.add_argument('--overlay-interval', type=int, default=3)
    parser.add_argument('--picture', default='*', help='pattern of sequences to show')
    parser.add_argument('--page', type=Path, help='Markdown page that takes the figures')
    return parser.parse_args()


def _make(options: argparse.Namespace, bag: Path, truth: Path) -> None:
    selection = select_sequences(Request(options.data, options.sequences, split=options.split))
    parts = join(selection.sequences, options.frames, SIZE)
    write_bag(parts, bag)
    write_truth(parts, truth)


def main() -> None:
    """Make, play, and report."""
    options = _options()
    output = options.output
    recording, played = output / 'recording', output / 'played'
    truth, answered = output / 'truth.csv', output / 'answers.csv'
    if not truth.exists():
        _make(options, recording, truth)
    parts = read_truth(truth, SIZE)
    if not answered.exists():
        write_answers(play(recording, played, {
            'preset': options.preset, 'threads': options.threads,
            'overlay_interval': options.overlay_interval}), answered)
    answers = list(in_parts(parts, read_answers(answered)))
    events = event_table(parts, answers)
    text = f'{events}\n\n{part_table(parts, answers)}\n'
    (output / 'report.md').write_text(text, encoding='utf-8')
    print(text)
    if options.page is not None:
        page = insert(options.page.read_text(encoding='utf-8'), 'recording', events)
        options.page.write_text(page, encoding='utf-8')
    shown = [fnmatch(part.full_name, options.picture) for part in parts]
    draw_sheet(parts, answers, shown, played, output / 'moments.jpg')


if __name__ == '__main__':
    main()

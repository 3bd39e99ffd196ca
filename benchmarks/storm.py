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
Send a node everything that it may be asked for, and more, while images come.

Two clients ask a process of its own for random lifecycle transitions, valid and not, parameters of
known and unknown types, resets, pauses, and starts with boxes that are good and bad, as fast as it
answers. Transitions that shut the node down for good are left out. Then the node has to be alive
and, configured and active, to answer images. Printed is a table of what was sent, answered and
refused, and what became of the process; with `--page` it takes the place of what stands between
`<!-- storm -->` and `<!-- /storm -->` there. The exit code is 1 when there is something to
complain of. Linux only. With the package on the path:
python -m benchmarks.storm [--seconds N] [--rate HZ] [--page docs/field.md]
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
import contextlib
from dataclasses import dataclass, field
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import threading
import time

from benchmarks.challenge_table import insert
from benchmarks.measurement import markdown_table
from benchmarks.storm_members import Camera, Counts, PATIENCE_SECONDS, TAKEN_AWAY, Troublemaker

COMMAND = (sys.executable, '-m', 'lmsco_ros.node.main')
COLUMNS = ('what', 'sent', 'answered', 'refused', 'not answered')
# In the first part caches fill and the allocator settles.
_SHARES = (0.25, 0.75)
_MEBIBYTE = 2 ** 20
_LAST_LINES = 20


@dataclass
class Report:
    """What a storm did to the node."""

    requests: dict[str, Counts] = field(default_factory=dict)
    published: Counter = field(default_factory=Counter)
    lives: bool = False
    answers: bool = False
    code: int | None = None
    faults: int = -1
    tracebacks: int = 0
    memory: tuple[float, float] = (0.0, 0.0)
    last_lines: str = ''

    @property
    def complaints(self) -> list[str]:
        """What should not have happened, in words."""
        lost = {name: counts.lost for name, counts in self.requests.items() if counts.lost
                and name not in TAKEN_AWAY}
        return [text for wrong, text in (
            (not self.lives, 'the process ended'),
            (not self.answers, 'no image is answered after the storm'),
            (self.code != 0, f'the process ended with code {self.code}'),
            (self.faults != 0, f'{self.faults} faults are counted in /diagnostics'),
            (self.tracebacks, f'{self.tracebacks} tracebacks in the log'),
            (lost, f'requests without an answer: {lost}')) if wrong]


def storm(seconds: float, *, rate: float = 60.0, seed: int = 0,
          command: Sequence[str] = COMMAND) -> Report:
    """
    Let a storm pass over a node, and tell what it did.

    Parameters
    ----------
    seconds : float
        How long it lasts.
    rate : float
        Images per second.
    seed : int
        Of everything that is chosen.
    command : sequence of str
        Starts the node.

    """
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    namespace = f'/storm_{os.getpid()}_{seed}'
    report = Report()
    with tempfile.TemporaryFile('w+') as log, contextlib.ExitStack() as members:
        process = subprocess.Popen([*command, '--ros-args', '-r', f'__ns:={namespace}'],
                                   stdout=log, stderr=subprocess.STDOUT)
        members.callback(process.kill)
        camera = Camera(namespace, rate, seed)
        members.callback(camera.close)
        clients = [Troublemaker(f'client_{number}', namespace, seed + number)
                   for number in (1, 2)]
        for client in clients:
            members.callback(client.close)
        if camera.wait_for_node():
            report.memory = tuple(
                _blow(process, camera, clients, share * seconds) for share in _SHARES)
            report.answers = camera.answers()
        report.lives = process.poll() is None
        report.faults = camera.told_faults() if report.lives else -1
        process.send_signal(signal.SIGINT)
        report.code = _exit_code(process)
        log.seek(0)
        text = log.read()
        report.tracebacks = text.count('Traceback')
        report.last_lines = '\n'.join(text.splitlines()[-_LAST_LINES:])
        for client in clients:
            _add(report, client)
        report.published += camera.published
    return report


def _blow(process: subprocess.Popen, camera: Camera, clients: Sequence[Troublemaker],
          seconds: float) -> float:
    """Let the clients make trouble; return the memory of the node, active again, in MiB."""
    began = time.monotonic()
    threads = [threading.Thread(target=client.make_trouble, args=(began + seconds,))
               for client in clients]
    for thread in threads:
        thread.start()
    camera.spin(lambda: not any(thread.is_alive() for thread in threads),
                seconds + PATIENCE_SECONDS)
    for thread in threads:
        thread.join()
    camera.activate_node()
    return _memory(process)


def _memory(process: subprocess.Popen) -> float:
    """Return the resident memory of a process in MiB; 0 when it has ended."""
    if process.poll() is not None:
        return 0.0
    pages = int(Path(f'/proc/{process.pid}/statm').read_text(encoding='ascii').split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE') / _MEBIBYTE


def _exit_code(process: subprocess.Popen) -> int | None:
    """Return the exit code of a process that was asked to end; None when it does not."""
    try:
        return process.wait(PATIENCE_SECONDS)
    except subprocess.TimeoutExpired:
        return None


def _add(report: Report, client: Troublemaker) -> None:
    report.published += client.published
    for name, counts in client.requests.items():
        total = report.requests.setdefault(name, Counts())
        total.sent += counts.sent
        total.answered += counts.answered
        total.refused += counts.refused


def storm_table(report: Report) -> str:
    """Return what was sent and what became of it, and of the process, as Markdown."""
    rows = [(name, str(counts.sent), str(counts.answered), str(counts.refused),
             str(counts.lost)) for name, counts in sorted(report.requests.items())]
    rows += [(name, str(count), '–', '–', '–') for name, count in
             sorted(report.published.items())]
    before, after = report.memory
    end = (f'The process {"lived" if report.lives else "ended"} and '
           f'{"answers" if report.answers else "does not answer"} images, configured and '
           f'active; {report.faults} faults, {report.tracebacks} tracebacks, memory {before:.0f} '
           f'MiB, active after a quarter of the time, and {after:.0f} MiB at the end; exit code '
           f'{report.code}.')
    return f'{markdown_table(COLUMNS, rows)}\n\n{end}'


def main(arguments: Sequence[str] | None = None) -> int:
    """Let the storm pass, and print the table or write it into a page."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--seconds', type=float, default=120.0)
    parser.add_argument('--rate', type=float, default=60.0, help='images per second')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--page', type=Path)
    parser.add_argument('--name', default='storm')
    options = parser.parse_args(arguments)
    report = storm(options.seconds, rate=options.rate, seed=options.seed)
    if options.page is None:
        print(storm_table(report))
    else:
        page = insert(options.page.read_text(encoding='utf-8'), options.name,
                      storm_table(report))
        options.page.write_text(page, encoding='utf-8')
    for complaint in report.complaints:
        print(f'storm: {complaint}', file=sys.stderr)
    if report.complaints:
        print(f'storm: the log of the node ends with\n{report.last_lines}', file=sys.stderr)
    return 1 if report.complaints else 0


if __name__ == '__main__':
    sys.exit(main())

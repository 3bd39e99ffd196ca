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
What it costs to import: time, memory and modules of fresh processes, of two checkouts in turns.

In the folder of the repository:
git worktree add --detach output/before COMMIT
python -m benchmarks.import_cost --before output/before [--runs N]
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
import json
import os
from pathlib import Path
from statistics import median
import subprocess
import sys

from benchmarks.measurement import markdown_table, positive

__all__ = ['Cost', 'CASES', 'import_cost']

_TRACKER = ('from lmsco_ros.core import LMSCOTracker, TrackerConfig; '
            'LMSCOTracker(TrackerConfig.preset({!r}))')
CASES = {
    '`import lmsco_ros.core`': 'import lmsco_ros.core',
    'a tracker of preset `hcs`': _TRACKER.format('hcs'),
    'a tracker of preset `default`': _TRACKER.format('default'),
    'the module of the node': 'import lmsco_ros.node.tracker_node',
}
_MEASURED = """
import json, sys, time
before = set(sys.modules)
began = time.perf_counter(), time.process_time()
exec({code!r})
ended = time.perf_counter(), time.process_time()
pages = int(open('/proc/self/statm').read().split()[1])
print(json.dumps([ended[0] - began[0], ended[1] - began[1], pages,
                  len(set(sys.modules) - before)]))
"""
_MEBIBYTE = 1 << 20


@dataclass(frozen=True)
class Cost:
    """
    What a fresh process spends.

    Attributes
    ----------
    wall, processor : float
        Milliseconds.
    resident : float
        Memory afterwards in MiB, with that of the interpreter.
    modules : float
        Number of modules that were imported.

    """

    wall: float
    processor: float
    resident: float
    modules: float


def import_cost(code: str, checkout: Path) -> Cost:
    """Run code once in a new process that imports from a checkout."""
    done = subprocess.run(
        [sys.executable, '-c', _MEASURED.format(code=code)], cwd=checkout, check=True,
        stdout=subprocess.PIPE, env={**os.environ, 'PYTHONPATH': str(checkout)})
    wall, processor, pages, modules = json.loads(done.stdout)
    return Cost(1e3 * wall, 1e3 * processor, pages * os.sysconf('SC_PAGE_SIZE') / _MEBIBYTE,
                modules)


def medians(costs: list[Cost]) -> Cost:
    """Return the median of each figure."""
    return Cost(*(median(getattr(cost, name) for cost in costs)
                  for name in Cost.__dataclass_fields__))


def main(arguments: list[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--before', type=Path, required=True, help='folder of a checkout')
    parser.add_argument('--after', type=Path, default=Path(__file__).parents[1])
    parser.add_argument('--runs', type=positive, default=9)
    options = parser.parse_args(arguments)
    checkouts = options.before.resolve(), options.after.resolve()
    rows = []
    for name, code in CASES.items():
        # The first run of each reads files that the others find in memory.
        runs = [[import_cost(code, checkout) for checkout in checkouts]
                for _ in range(options.runs + 1)][1:]
        before, after = (medians(list(costs)) for costs in zip(*runs, strict=True))
        rows.append((name, after.wall / before.wall, after.processor / before.processor,
                     before.resident, after.resident, f'{before.modules:.0f}',
                     f'{after.modules:.0f}'))
    print(markdown_table(
        ('in a fresh process', 'time on the clock, after / before',
         'processor time, after / before',
         'memory before (MiB)', 'after (MiB)', 'modules before', 'after'), rows))


if __name__ == '__main__':
    main()

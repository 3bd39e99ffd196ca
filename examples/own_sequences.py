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
Evaluate two configurations on sequences of your own.

    python examples/own_sequences.py sequences/ --config mine.yaml

Needs this package, and sequences with true boxes: a folder for each, in it `groundtruth.txt` with
x,y,width,height in pixels, a row a frame, and the images in a folder `ir`. Other layouts that
are read, restarts, intervals and pages with plots: `lmsco evaluate --help`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from lmsco_ros.core import TrackerConfig
from lmsco_ros.evaluation.datasets import scan_dataset
from lmsco_ros.evaluation.execution import run_one_pass
from lmsco_ros.evaluation.protocols.one_pass import one_pass_figures
from lmsco_ros.evaluation.trackers.configured import ConfiguredTracker


def main(arguments: list[str] | None = None) -> None:
    """Print the success AUC of each sequence, with the preset and with the configuration."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('folder', type=Path, help='folder of sequences')
    parser.add_argument('--config', type=Path, help='YAML file to compare with the default')
    options = parser.parse_args(arguments)

    configs = {'default': TrackerConfig.preset('default')}
    if options.config:
        configs[options.config.stem] = TrackerConfig.from_yaml(options.config)
    found = scan_dataset(options.folder)
    for broken in found.broken:
        print(f'{broken.name} is left out: {broken.reason}')
    for sequence in found.sequences:
        for name, config in configs.items():
            trace = run_one_pass(ConfiguredTracker(config), sequence)
            figures = one_pass_figures(sequence.ground_truth, trace.boxes)
            print(f'{sequence.name}: {name} {figures.success_auc:.3f}', trace.error or '')


if __name__ == '__main__':
    main()

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

"""What a result was measured with: machine and versions, and nothing that names a host."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import metadata
import os
from pathlib import Path
import platform

import cv2

from lmsco_ros.evaluation.trackers.code_version import core_version

_DISTRIBUTIONS = ('lmsco_ros', 'numpy', 'scipy', 'torch')


def machine() -> dict[str, str]:
    """Return the processor's model and the number of cores."""
    cores = len(os.sched_getaffinity(0))
    return {'processor': _processor(Path('/proc/cpuinfo')), 'cores': str(cores)}


def versions() -> Mapping[str, str]:
    """Return the versions of Python and of the libraries that decide results."""
    found = {'python': platform.python_version(), 'opencv': cv2.__version__}
    for name in _DISTRIBUTIONS:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    found['tracker core'] = core_version()
    return found


def _processor(cpuinfo: Path) -> str:
    if cpuinfo.is_file():
        for line in cpuinfo.read_text(encoding='utf-8').splitlines():
            if line.startswith('model name'):
                return line.split(':', 1)[1].strip()
    return platform.machine()

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
From a name on the command line to a tracker.

`hcs` (any preset), `config:FILE` (any configuration), `csrt` (any of OpenCV's),
`nanotrack:backbone.onnx,head.onnx`, `vittrack:net.onnx`, `trax:NAME=command line` and
`python:module:callable`.
"""

from __future__ import annotations

from pathlib import Path

from lmsco_ros.core import TrackerConfig
from lmsco_ros.evaluation.errors import TrackerError
from lmsco_ros.evaluation.trackers.configured import ConfiguredSpec
from lmsco_ros.evaluation.trackers.interface import TrackerSpec
from lmsco_ros.evaluation.trackers.nanotrack import (
    answer_side, NANO_V3_NAME, NanoSpec, OPENCV_SIDE)
from lmsco_ros.evaluation.trackers.opencv_peer import MODEL_FILES, OPENCV_NAMES, OpenCVSpec
from lmsco_ros.evaluation.trackers.python_peer import PythonSpec
from lmsco_ros.evaluation.trackers.trax_peer import TraxSpec


# Trackers that see images of more than 8 bits through `EightBitView`.
EIGHT_BIT_NAMES = (*OPENCV_NAMES, NANO_V3_NAME)


def available_names() -> tuple[str, ...]:
    """Return all presets, then the peers that work here without further files."""
    peers = tuple(name for name in OPENCV_NAMES if OpenCVSpec(name).available)
    return tuple(TrackerConfig.preset_names()) + peers


def resolve(text: str) -> TrackerSpec:
    """
    Return the tracker that `text` names.

    Parameters
    ----------
    text : str
        A name as described above.

    Raises
    ------
    TrackerError
        When no tracker has that name.
    ConfigError
        When a configuration cannot be read or holds wrong values.

    """
    kind, _, rest = text.partition(':')
    if kind == 'trax' and '=' in rest:
        return TraxSpec(*rest.split('=', 1))
    if kind == 'python' and ':' in rest:
        return PythonSpec(*rest.split(':', 1))
    if kind in OPENCV_NAMES:
        models = tuple(Path(name).expanduser().resolve() for name in rest.split(',') if name)
        missing = [path for path in models if not path.is_file()]
        if missing:
            raise TrackerError(f'tracker {kind!r}: there is no model file {missing[0]}')
        return _nanotrack(models) if kind == 'nanotrack' else OpenCVSpec(kind, models)
    if text in TrackerConfig.preset_names():
        return ConfiguredSpec(text, TrackerConfig.preset(text))
    if kind == 'config' and rest:
        return ConfiguredSpec.from_file(Path(rest).expanduser())
    known = ', '.join((*TrackerConfig.preset_names(), *OPENCV_NAMES))
    raise TrackerError(f'there is no tracker {text!r}; known are {known}, '
                       'config:FILE, trax:NAME=COMMAND and python:MODULE:CALLABLE')


def name_with_files(name: str) -> str:
    """Return how the tracker of that name is asked for, with words for its model files."""
    kind = 'nanotrack' if name == NANO_V3_NAME else name
    files = MODEL_FILES.get(kind, ())
    return f'{kind}:{",".join(file.upper() for file in files)}' if files else name


def _nanotrack(models: tuple[Path, ...]) -> TrackerSpec:
    """Return NanoTrack by OpenCV's own class where that can read what the head answers."""
    opencv = OpenCVSpec('nanotrack', models)
    if len(models) != 2 or answer_side(*models) in (None, OPENCV_SIDE):
        return opencv
    return NanoSpec(*models)

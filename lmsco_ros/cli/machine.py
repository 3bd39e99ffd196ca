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

"""What of a machine a tracker needs, looked at without starting anything; each with its remedy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from importlib.util import find_spec
import os
from pathlib import Path
import shutil
import sys
import tempfile

from lmsco_ros.extras import MissingExtraError, MODULES, require_extra

_OLDEST, _NEWEST, _NEWEST_OF_ROS = (3, 10), (3, 13), (3, 12)
_PROFILE = 'FASTRTPS_DEFAULT_PROFILES_FILE'
_MISSPELT_PROFILE = 'FASTDDS_DEFAULT_PROFILES_FILE'
_MIDDLEWARE = 'rmw_fastrtps_cpp'
# Segments of some processes with large images.
_SHARED_BYTES = 64 << 20


class State(Enum):
    """How much a finding matters."""

    GOOD = 'good'
    NOTE = 'note'
    WRONG = 'wrong'


@dataclass(frozen=True)
class Finding:
    """
    One thing that was looked at.

    Attributes
    ----------
    name : str
        What was looked at.
    state : State
        NOTE where something is missing that not everybody needs, WRONG where nothing works.
    said : str
        What there is.
    remedy : str
        What to do; empty where it is good.

    """

    name: str
    state: State
    said: str
    remedy: str = ''


def examine(environment: Mapping[str, str] = os.environ) -> tuple[Finding, ...]:
    """Return what there is to say of this machine, in the order in which it matters."""
    return (python(sys.version_info[:2]), *extras(), ros(), middleware(environment),
            profile(environment), shared_memory(Path('/dev/shm')), threads(environment),
            gpu(), weights(), *(write_access(name, folder)
                                for name, folder in _folders(environment).items()))


def python(version: tuple[int, ...]) -> Finding:
    """Judge the version (major, minor) of the interpreter."""
    said = '.'.join(map(str, version))
    if version < _OLDEST:
        return Finding('Python', State.WRONG, said, 'use Python 3.10 to 3.13, 3.12 at most for '
                       'the node')
    if version > _NEWEST:
        return Finding('Python', State.NOTE, said, 'the package is tested on 3.10 to 3.13')
    if version > _NEWEST_OF_ROS:
        return Finding('Python', State.NOTE, said, 'ROS 2 wheels end at 3.12: for the node use '
                       'Python 3.12; all else runs on this one')
    return Finding('Python', State.GOOD, said)


def extras() -> tuple[Finding, ...]:
    """Tell of each extra that is not whole."""
    found = []
    for extra in MODULES:
        try:
            require_extra(extra, 'what is in it')
            found.append(Finding(f'extra {extra}', State.GOOD, 'installed'))
        except MissingExtraError:
            missing = ', '.join(name for name in MODULES[extra] if not _is_there(name))
            found.append(Finding(f'extra {extra}', State.NOTE, f'lacks {missing}',
                                 f"where it is needed: pip install 'lmsco_ros[{extra}]'"))
    return tuple(found)


def ros() -> Finding:
    """Tell whether the node can run."""
    from lmsco_ros.node.installation import obstacle

    reason = obstacle()
    if not reason:
        return Finding('ROS 2', State.GOOD, 'all packages of the node are there')
    said, _, remedy = reason.partition('; ')
    return Finding('ROS 2', State.NOTE, said, remedy)


def middleware(environment: Mapping[str, str]) -> Finding:
    """Judge the implementation that ROS 2 is told to use."""
    chosen = environment.get('RMW_IMPLEMENTATION', '')
    if chosen in ('', _MIDDLEWARE):
        return Finding('middleware', State.GOOD, chosen or f'the default, {_MIDDLEWARE}')
    return Finding('middleware', State.NOTE, chosen, 'the node is tested with '
                   f'{_MIDDLEWARE}; where images do not arrive: unset RMW_IMPLEMENTATION')


def profile(environment: Mapping[str, str]) -> Finding:
    """Tell whether large images get through shared memory."""
    name, path = 'profile for large images', environment.get(_PROFILE)
    remedy = (f'where images above 512 kB arrive rarely, for node and camera: export {_PROFILE}='
              '$(ros2 pkg prefix --share lmsco_ros)/config/fastdds_large_images.xml')
    if path is None and _MISSPELT_PROFILE in environment:
        return Finding(name, State.NOTE, f'{_MISSPELT_PROFILE} is not read by Jazzy', remedy)
    if path is None:
        return Finding(name, State.NOTE, 'not set', remedy)
    if not Path(path).is_file():
        return Finding(name, State.WRONG, f'{path} is no file', f'correct or unset {_PROFILE}')
    return Finding(name, State.GOOD, path)


def shared_memory(folder: Path) -> Finding:
    """Tell whether there is room for images between processes of one machine."""
    name = 'shared memory'
    if not folder.is_dir():
        return Finding(name, State.NOTE, f'{folder} is not there',
                       'images go over loopback, which costs time; mount a tmpfs there')
    free = shutil.disk_usage(folder).free
    said = f'{free >> 20} MiB free in {folder}'
    if free < _SHARED_BYTES:
        return Finding(name, State.NOTE, said, 'remove what is left there, or start a container '
                       'with --shm-size=256m or --ipc=host')
    return Finding(name, State.GOOD, said)


def threads(environment: Mapping[str, str]) -> Finding:
    """Tell how many cores there are, and what limits libraries to fewer or more."""
    cores = len(os.sched_getaffinity(0))
    said, limit = f'{cores} cores', environment.get('OMP_NUM_THREADS', '')
    if limit.isdecimal() and int(limit) > cores:
        return Finding('threads', State.NOTE, f'{said}, OMP_NUM_THREADS={limit}',
                       'more threads than cores cost time: unset OMP_NUM_THREADS')
    if cores < 2:
        return Finding('threads', State.NOTE, said,
                       'the tracker takes one; give the process a second for images')
    return Finding('threads', State.GOOD, said)


def gpu() -> Finding:
    """Tell whether PyTorch has a GPU; no preset needs one."""
    import torch

    if torch.cuda.is_available():
        return Finding('GPU', State.GOOD, torch.cuda.get_device_name())
    return Finding('GPU', State.GOOD, 'none; every preset runs on the processor')


def weights() -> Finding:
    """Tell which weights are here."""
    from lmsco_ros.core.weights.registry import WEIGHTS
    from lmsco_ros.core.weights.store import locate

    try:
        missing = [source for source in WEIGHTS if locate(source) is None]
    except MissingExtraError as error:
        return Finding('weights', State.NOTE, 'those of the default preset',
                       f'for others: {str(error).rpartition("; ")[2]}')
    bundled = [source.name for source in missing if source.bundled]
    if bundled:
        return Finding('weights', State.WRONG, f'{", ".join(bundled)} is not in the package',
                       'install lmsco_ros again')
    if missing:
        names = ', '.join(source.name for source in missing)
        return Finding('weights', State.NOTE, f'without {names}', 'the default preset needs none '
                       'of them; for others: lmsco weights list, lmsco weights fetch NAME')
    return Finding('weights', State.GOOD, 'all')


def write_access(name: str, folder: Path) -> Finding:
    """Tell whether files can be made in a folder, or in that in which it would be made."""
    place = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if place.is_dir() and os.access(place, os.W_OK | os.X_OK):
        return Finding(name, State.GOOD, f'{folder} can be written')
    return Finding(name, State.WRONG, f'{folder} cannot be written',
                   f'give this user {place}, or work elsewhere')


def _folders(environment: Mapping[str, str]) -> dict[str, Path]:
    """Return where commands and the node write."""
    home = Path(environment.get('ROS_HOME') or Path.home() / '.ros')
    return {'this folder': Path.cwd(), 'temporary files': Path(tempfile.gettempdir()),
            'logs of the node': Path(environment.get('ROS_LOG_DIR') or home / 'log')}


def _is_there(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:
        return False

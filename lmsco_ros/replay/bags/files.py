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

"""Which files belong to a bag."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
import warnings

import yaml

from lmsco_ros.replay.errors import SourceError, SourceWarning

MCAP, SQLITE, ROS1 = '.mcap', '.db3', '.bag'
COMPRESSED_SUFFIX = '.zstd'
_METADATA = 'metadata.yaml'


@dataclass(frozen=True)
class BagFiles:
    """
    The storage files of a bag.

    Attributes
    ----------
    files : tuple of Path
        One, or several where the recorder started a new one now and then.
    digests : mapping
        Digest of the message type by topic and type, as far as known.

    """

    files: tuple[Path, ...]
    digests: Mapping[tuple[str, str], str] = field(default_factory=dict)


def is_bag(path: Path) -> bool:
    """Tell whether `path` is a bag: a folder with storage files, or a storage file."""
    if path.is_dir():
        return (path / _METADATA).is_file() or bool(_storage_files(path))
    return bool(storage_suffix(path))


def storage_suffix(path: Path) -> str:
    """Return .mcap, .db3 or .bag, also of a compressed file; empty for another file."""
    name = path.name.removesuffix(COMPRESSED_SUFFIX).removesuffix('.active')
    return next((suffix for suffix in (MCAP, SQLITE, ROS1) if name.endswith(suffix)), '')


def find_files(path: Path) -> BagFiles:
    """
    Return the files of a bag.

    Files that metadata.yaml lists belong to a bag; without that file, all storage files of
    the folder do. What is missing or left out is told by a `SourceWarning`.

    Raises
    ------
    SourceError
        When there is none, or it is not clear which ones.

    """
    if not path.is_dir():
        if not storage_suffix(path):
            raise SourceError(f'{path} is no bag; give a folder with its metadata.yaml, or an '
                              'mcap, db3 or bag file')
        return BagFiles((path,))
    present = _storage_files(path)
    if not present:
        raise SourceError(f'{path} has no mcap or db3 file; give the folder of a bag, with its '
                          'metadata.yaml and storage files')
    try:
        metadata = yaml.safe_load((path / _METADATA).read_text(encoding='utf-8'))
        information = metadata['rosbag2_bagfile_information']
        names = [Path(name).name for name in information['relative_file_paths']]
        digests = _digests(information)
    # A file that was cut or edited can hold anything.
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError,
            yaml.YAMLError) as error:
        return BagFiles(_unlisted(path, present, error))
    return BagFiles(_listed(path, present, names), digests)


def _storage_files(folder: Path) -> list[Path]:
    return sorted(file for file in folder.iterdir() if storage_suffix(file) and file.is_file())


def _digests(information: Mapping) -> dict[tuple[str, str], str]:
    topics = [item['topic_metadata'] for item in information['topics_with_message_count']]
    return {(topic['name'], topic['type']): str(topic.get('type_description_hash') or '')
            for topic in topics}


def _unlisted(path: Path, present: Sequence[Path], error: Exception) -> tuple[Path, ...]:
    """Return all files of a folder whose metadata.yaml does not help."""
    if len({storage_suffix(file) for file in present}) > 1:
        raise SourceError(f'{path} has files of several kinds ({_names(present)}) and no '
                          'metadata.yaml that says which belong together; give one file')
    reason = 'has no metadata.yaml' if isinstance(error, FileNotFoundError) else \
        f'has a damaged metadata.yaml ({_first_line(error)})'
    _tell(f'{path} {reason}, as after a recorder that was killed; {_names(present)} is read. '
          f'"ros2 bag reindex {path}" writes it again')
    return tuple(present)


def _listed(path: Path, present: Sequence[Path], names: Sequence[str]) -> tuple[Path, ...]:
    """Return the files that metadata.yaml names and that are there."""
    listed = tuple(file for file in present if file.name in names)
    missing = sorted(set(names) - {file.name for file in listed})
    others = [file for file in present if file not in listed]
    if not listed:
        raise SourceError(f'{path} lacks what its metadata.yaml lists: {", ".join(missing)}; '
                          'copy the whole folder, or write the list again with '
                          f'"ros2 bag reindex {path}"')
    if missing:
        _tell(f'{path} lacks {", ".join(missing)}, which its metadata.yaml lists; '
              'only the rest is read')
    if others:
        _tell(f'{path} has {_names(others)}, which its metadata.yaml does not list and which is '
              f'left out; "ros2 bag reindex {path}" writes the list again')
    return listed


def _names(files: Sequence[Path]) -> str:
    return ', '.join(file.name for file in files)


def _first_line(error: Exception) -> str:
    return f'{type(error).__name__}: {error}'.splitlines()[0]


def _tell(message: str) -> None:
    warnings.warn(message, SourceWarning, stacklevel=1)

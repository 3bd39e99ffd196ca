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

"""Storage files that have to be unpacked or put together before they can be read."""

from __future__ import annotations

from contextlib import ExitStack
import os
from pathlib import Path
import shutil
import sqlite3
import struct
from tempfile import gettempdir, TemporaryDirectory
import warnings

from backports import zstd

from lmsco_ros.replay.bags.files import COMPRESSED_SUFFIX, SQLITE, storage_suffix
from lmsco_ros.replay.errors import SourceError, SourceWarning

_BLOCK = 2 ** 20
_LEFT_BEHIND = ('-wal', '-journal')
_SQLITE_START = b'SQLite format 3\0'


def plain_file(file: Path, stack: ExitStack) -> Path:
    """
    Return a storage file that can be read as it is: the file itself, or a copy.

    A compressed file is unpacked. A database whose recorder was killed has messages in a file
    beside it; in the copy they are where they belong. Of one that was cut within a page, the
    copy has the whole pages: sqlite3 would fill the last one with zeros, and say nothing. The
    file itself is never changed.

    Parameters
    ----------
    file : Path
        A file of a bag.
    stack : ExitStack
        Removes the copy.

    Raises
    ------
    OSError
        When the file cannot be opened.
    SourceError
        When there is no room for the copy.

    """
    file.open('rb').close()
    try:
        return _readable(file, stack)
    except OSError as error:
        raise SourceError(f'{file} cannot be unpacked ({error.strerror or error}); it needs room '
                          f'in {gettempdir()}, or in another folder that TMPDIR names') from error


def _readable(file: Path, stack: ExitStack) -> Path:
    """Return the file or a copy."""
    beside = [Path(f'{file}{end}') for end in _LEFT_BEHIND]
    left = [item for item in beside if item.is_file() and item.stat().st_size]
    if file.name.endswith(COMPRESSED_SUFFIX):
        return _unpack(file, _folder(stack) / file.name.removesuffix(COMPRESSED_SUFFIX))
    if storage_suffix(file) == SQLITE and left:
        return _put_together(file, left, _folder(stack))
    if storage_suffix(file) == SQLITE and _odd_bytes(file):
        return _whole_pages(file, _folder(stack) / file.name)
    return file


def _odd_bytes(file: Path) -> int:
    """Return how many bytes of a database are behind its last whole page."""
    with file.open('rb') as stream:
        head = stream.read(18)
    if not head.startswith(_SQLITE_START) or len(head) < 18:
        return 0
    page, = struct.unpack_from('>H', head, 16)
    # What does not fit into two bytes is written as 1.
    return file.stat().st_size % {0: 1, 1: 65536}.get(page, page)


def _whole_pages(file: Path, copy: Path) -> Path:
    shutil.copy(file, copy)
    os.truncate(copy, file.stat().st_size - _odd_bytes(file))
    return copy


def _folder(stack: ExitStack) -> Path:
    return Path(stack.enter_context(TemporaryDirectory(prefix='lmsco_bag_')))


def _unpack(file: Path, copy: Path) -> Path:
    """Unpack a file as far as it goes."""
    with file.open('rb') as packed, copy.open('wb') as plain:
        unpacked = zstd.open(packed, 'rb')
        try:
            shutil.copyfileobj(unpacked, plain, _BLOCK)
        except (zstd.ZstdError, EOFError) as error:
            warnings.warn(f'{file} is cut or damaged ({error}); what comes before that is read',
                          SourceWarning, stacklevel=1)
    return copy


def _put_together(file: Path, left: list[Path], folder: Path) -> Path:
    """Copy a database with what its recorder left beside it, and let sqlite3 join them."""
    for item in (file, *left):
        shutil.copy(item, folder / item.name)
    copy = folder / file.name
    try:
        database = sqlite3.connect(copy)
        try:
            database.execute('PRAGMA wal_checkpoint(TRUNCATE)')
            database.execute('SELECT count(*) FROM sqlite_master').fetchall()
        finally:
            database.close()
    except sqlite3.Error:
        # What is damaged is found out by whoever reads the copy.
        pass
    return copy

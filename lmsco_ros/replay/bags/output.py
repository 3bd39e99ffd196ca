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
New bags that appear whole or not at all.

A bag is written beside its place, into a folder `NAME.partial`, and moved when it is finished.
What a process that was killed leaves never looks like a bag that was asked for.
"""

from __future__ import annotations

from collections.abc import Mapping
import os
from pathlib import Path
import shutil
import sqlite3
from types import TracebackType
from typing import Any

from rosbags.interfaces import Connection
from rosbags.rosbag2 import StoragePlugin, Writer, WriterError

from lmsco_ros.replay.bags.uninterrupted import uninterrupted
from lmsco_ros.replay.errors import OutputError
from lmsco_ros.replay.storage import Storage

_PLUGINS: Mapping[Storage, StoragePlugin] = {
    Storage.MCAP: StoragePlugin.MCAP, Storage.SQLITE3: StoragePlugin.SQLITE3}
# Messages keep their times when they are copied, and no storage holds every one.
_WRITE_ERRORS = (OSError, sqlite3.Error, WriterError, OverflowError)


class BagOutput:
    """
    A new bag; use as a context manager.

    When the work is broken off, by an error or by a signal, the bag is finished with what is
    in it, provided that somebody said `keep_from_now_on`; otherwise nothing is left.

    Parameters
    ----------
    path : Path
        The bag's folder; it must not exist.
    storage : Storage
        File format.

    Attributes
    ----------
    count : int
        Messages written so far.
    is_complete : bool
        Whether the bag is in its place, readable by anybody.

    Raises
    ------
    OutputError
        When there is something already, the place cannot be written to, or is full.

    """

    def __init__(self, path: Path, storage: Storage) -> None:
        self._path = path
        self._partial = path.parent / f'{path.name}.partial'
        self._is_worth_keeping = False
        self.count = 0
        self.is_complete = False
        self._require_free()
        if storage is Storage.SQLITE3 and set(str(path)) & set('?#%'):
            raise OutputError(f'{path} cannot be written: rosbags writes no database into a place '
                              'with ?, # or % in its name; choose another name, or mcap')
        try:
            self._writer = Writer(self._partial / path.name, version=9,
                                  storage_plugin=_PLUGINS[storage])
        except OSError as error:
            raise self._no_place(error) from error

    def __enter__(self) -> BagOutput:
        """Open the bag."""
        self._require_free()
        with uninterrupted():
            self._open()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Finish the bag, or remove what is not worth keeping."""
        if error is not None and not self._is_worth_keeping:
            self._discard()
            return
        with uninterrupted():
            try:
                self._finish()
            except _WRITE_ERRORS as problem:
                self._discard()
                # The first thing that went wrong is what counts.
                if error is None:
                    raise self._failure(problem) from problem

    def keep_from_now_on(self) -> None:
        """Finish the bag also when the work is broken off: it holds results."""
        self._is_worth_keeping = True

    def add_connection(self, topic: str, msgtype: str, **description: Any) -> Connection:
        """Add a topic; takes what the writer of rosbags takes."""
        try:
            return self._writer.add_connection(topic, msgtype, **description)
        except _WRITE_ERRORS as error:
            raise self._failure(error) from error

    def write(self, connection: Connection, logged: int, data: bytes | memoryview) -> None:
        """Write a serialized message with its time of recording, in nanoseconds."""
        with uninterrupted():
            try:
                self._writer.write(connection, logged, data)
            except _WRITE_ERRORS as error:
                # What is half written cannot be finished.
                self._is_worth_keeping = False
                raise self._failure(error) from error
            self.count += 1

    def _require_free(self) -> None:
        if os.path.lexists(self._path):
            raise OutputError(f'{self._path} exists; choose another output, or remove it')
        if os.path.lexists(self._partial):
            raise OutputError(f'{self._partial} exists: another command is writing it, or one '
                              'that was killed left it; remove it when it is not needed')

    def _open(self) -> None:
        try:
            self._partial.mkdir(parents=True)
        except OSError as error:
            raise self._no_place(error) from error
        try:
            self._writer.open()
        except _WRITE_ERRORS as error:
            self._discard()
            raise self._no_place(error) from error

    def _finish(self) -> None:
        self._writer.close()
        os.rename(self._partial / self._path.name, self._path)
        self.is_complete = True
        self._partial.rmdir()

    def _no_place(self, error: BaseException) -> OutputError:
        return OutputError(f'{self._path} cannot be created ({_reason(error)}); '
                           'choose a place that can be written to')

    def _failure(self, error: BaseException) -> OutputError:
        return OutputError(f'{self._path} cannot be written ({_reason(error)}); nothing of it '
                           'is kept: check the place and its free space, or choose another '
                           'output')

    def _discard(self) -> None:
        """Remove what was written so far."""
        try:
            self._writer.abort()
        # Whatever keeps it from being closed, it is removed.
        except Exception:  # noqa: B902
            pass
        shutil.rmtree(self._partial, ignore_errors=True)


def _reason(error: BaseException) -> str:
    return getattr(error, 'strerror', None) or str(error) or type(error).__name__

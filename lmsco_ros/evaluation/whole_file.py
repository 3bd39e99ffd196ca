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

"""Files that several may write and read at once, and that a cut leaves whole."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
import fcntl
import json
import os
from pathlib import Path
import tempfile
from typing import Any

_LOCK = '.lock'


def write_json(path: Path, content: Any) -> None:
    """Write a JSON file that is either complete or as it was before; see `write_whole`."""
    write_whole(path, json.dumps(content).encode())


def write_whole(path: Path, content: bytes) -> None:
    """
    Write a file that is either complete or as it was before, whoever writes it as well.

    Parameters
    ----------
    path : Path
        The file; folders that it needs are made. What is no plain file, such as a pipe, is
        written to directly, and a link stays one.
    content : bytes
        All of it.

    Raises
    ------
    OSError
        With the file's name, when it cannot be written.

    """
    path = path.resolve()
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.exists() and not path.is_file():
        path.write_bytes(content)
        return
    temporary: str | None = None
    try:
        descriptor, temporary = tempfile.mkstemp(dir=path.parent, prefix='.', suffix='.partial')
        with os.fdopen(descriptor, 'wb') as stream:
            stream.write(content)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException as error:
        if temporary is not None:
            with suppress(OSError):
                os.unlink(temporary)
        if isinstance(error, OSError):
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Wait until no other process is in this block for the same folder, which is made."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / _LOCK).open('w') as lock:
        # A file system without locks: files are whole all the same.
        with suppress(OSError):
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield

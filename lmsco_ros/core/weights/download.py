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

"""Downloads that go on where they stopped and are complete or not there."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import re

import requests
from requests.adapters import HTTPAdapter
from urllib3.exceptions import NewConnectionError, ReadTimeoutError
from urllib3.util import Retry

from lmsco_ros.core.errors import WeightsError
from lmsco_ros.core.weights.checksum import file_sha256

__all__ = ['Progress', 'download']

Progress = Callable[[int, int | None], None]

# What a broken connection has brought of a chunk is lost.
_CHUNK_BYTES = 1 << 16
_TIMEOUT_SECONDS = (10.0, 60.0)
_FRUITLESS_TRIES = 3
_PAGE_BEGINS = (b'<!doctype html', b'<html')


def download(url: str, path: Path, sha256: str | None = None,
             progress: Progress = lambda done, total: None) -> str:
    """
    Download a file.

    What arrived of it stays beside `path`, so that after a broken connection, or in a later
    call, only the rest is asked for, provided that the server's file is still the same.

    Parameters
    ----------
    url : str
        Address of the file.
    path : Path
        Where it goes once it is complete; what was there is replaced.
    sha256 : str, optional
        What the checksum must be.
    progress : callable
        Called with the bytes that are here and, where the server tells it, the number of all.

    Returns
    -------
    str
        The checksum of the file.

    Raises
    ------
    WeightsError
        When the server cannot be reached, has no such file or sends a page in its place, when
        the connection breaks again and again without bringing anything, when there is no room
        for the file, or when the checksum is another. Names the address.

    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = _PartialFile(path)
    with requests.Session() as session:
        retry = Retry(connect=2, read=0, redirect=5, other=0, backoff_factor=0.3)
        for scheme in ('http://', 'https://'):
            session.mount(scheme, HTTPAdapter(max_retries=retry))
        most, fruitless = partial.size, 0
        while True:
            try:
                _receive(session, url, partial, progress)
                break
            except requests.RequestException as error:
                fruitless = 0 if partial.size > most else fruitless + 1
                most = max(most, partial.size)
                if fruitless == _FRUITLESS_TRIES or _is_final(error):
                    raise WeightsError(f'{url} could not be downloaded: {_reason(error)}; try '
                                       'again later, what has arrived is kept') from error
    return partial.finish(sha256, url)


class _PartialFile:
    """
    What has arrived of a file, and which version of it that is.

    Parameters
    ----------
    path : Path
        Where the complete file will go.

    """

    def __init__(self, path: Path) -> None:
        self._goal = path
        self.path = path.with_name(f'{path.name}.part')
        self._version = path.with_name(f'{path.name}.version')

    @property
    def size(self) -> int:
        """Number of bytes that are here."""
        return self.path.stat().st_size if self.path.exists() else 0

    @property
    def version(self) -> str | None:
        """What the server called the version of which the bytes are."""
        return self._version.read_text() if self._version.exists() else None

    def begin(self, version: str | None) -> None:
        """Throw away what is here, which is of another version."""
        self.path.write_bytes(b'')
        if version:
            self._version.write_text(version)
        else:
            self._version.unlink(missing_ok=True)

    def append(self, data: bytes) -> None:
        """Add what has arrived, or as much of it as there is room for."""
        try:
            with self.path.open('ab', buffering=0) as file:
                while data:
                    data = data[file.write(data):]
        except OSError as error:
            raise WeightsError(f'{self.path}: {error.strerror}; make room and try again, what '
                               'has arrived is kept') from error

    def drop(self) -> None:
        """Remove all traces."""
        self.path.unlink(missing_ok=True)
        self._version.unlink(missing_ok=True)

    def finish(self, sha256: str | None, url: str) -> str:
        """Move the complete file to its goal, or refuse it, and return its checksum."""
        found = file_sha256(self.path)
        if sha256 is not None and found != sha256:
            self.drop()
            raise WeightsError(f'what {url} sent has the SHA-256 checksum {found}, expected '
                               f'{sha256}; it was thrown away: try again, and if that does not '
                               'help, the file at that address was replaced')
        os.replace(self.path, self._goal)
        self.drop()
        return found


def _receive(session: requests.Session, url: str, partial: _PartialFile,
             progress: Progress) -> None:
    """Ask for what is missing and append it, until the connection ends."""
    headers = {'Accept-Encoding': 'identity'}
    if partial.size and partial.version:
        headers |= {'Range': f'bytes={partial.size}-', 'If-Range': partial.version}
    with session.get(url, headers=headers, stream=True, timeout=_TIMEOUT_SECONDS) as response:
        if response.status_code == requests.codes.requested_range_not_satisfiable:
            partial.drop()
            raise requests.ConnectionError('the server no longer has the part that is missing')
        if not response.ok:
            raise WeightsError(f'{url} answers {response.status_code} {response.reason}; the '
                               'file may have moved: get it elsewhere and import it')
        if not _continues(response, partial.size):
            partial.begin(_version(response))
        rest = response.headers.get('Content-Length')
        total = partial.size + int(rest) if rest and rest.isdigit() else None
        done = partial.size
        for chunk in response.iter_content(_CHUNK_BYTES):
            if not done and chunk.lstrip()[:14].lower().startswith(_PAGE_BEGINS):
                raise WeightsError(f'{url} answers with a web page in place of the file; look at '
                                   'it in a browser: there may be a login, or the file has moved')
            partial.append(chunk)
            done += len(chunk)
            progress(done, total)


def _continues(response: requests.Response, size: int) -> bool:
    """Tell whether an answer is the rest of a file of which `size` bytes are here."""
    if response.status_code != requests.codes.partial_content:
        return False
    start = re.match(r'bytes (\d+)-', response.headers.get('Content-Range', ''))
    if start is None or int(start[1]) != size:
        raise requests.ConnectionError('the server sent another part than was asked for')
    return True


def _version(response: requests.Response) -> str | None:
    """Return what tells this version of the file from others, or None."""
    tag = response.headers.get('ETag')
    return tag if tag and not tag.startswith('W/') else response.headers.get('Last-Modified')


def _is_final(error: requests.RequestException) -> bool:
    """Tell whether another try is of no use: nobody was there, tried several times already."""
    return isinstance(error, (requests.ConnectTimeout, requests.TooManyRedirects)) or \
        isinstance(_pool_reason(error), NewConnectionError)


def _reason(error: requests.RequestException) -> str:
    """Return what went wrong in a few words: those of the system where it has some."""
    if isinstance(error, requests.Timeout) or isinstance(_pool_reason(error), ReadTimeoutError):
        return 'there was no answer in time'
    if isinstance(error, requests.TooManyRedirects):
        return 'the address leads to itself again and again'
    way = 'through the proxy: ' if isinstance(error, requests.exceptions.ProxyError) else ''
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, OSError) and cause.strerror:
            return way + cause.strerror
        cause = cause.__cause__ or cause.__context__
    return way + ' '.join(str(error).split())


def _pool_reason(error: requests.RequestException) -> object:
    """Return why the pool of connections gave up, or None when it was something else."""
    return getattr(error.args[0], 'reason', None) if error.args else None

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

"""Who may use the page: origins, the token, and what browsers are told to refuse."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
import hashlib
import hmac
import ipaddress
from urllib.parse import urlsplit

COOKIE = 'lmsco_console'
SHORTEST_TOKEN = 16
HEADERS = {
    'Content-Security-Policy': (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"),
    'X-Content-Type-Options': 'nosniff',
    'Referrer-Policy': 'same-origin',
    'Cross-Origin-Opener-Policy': 'same-origin',
    'Cross-Origin-Resource-Policy': 'same-origin',
    'Cache-Control': 'no-cache',
}
"""Sent with every page and file."""
_LOOPBACK_NAMES = ('localhost', '127.0.0.1', '::1')


class AccessError(ValueError):
    """The page would be open to others than it should; says what to do."""


def is_loopback(host: str) -> bool:
    """Tell whether an address to listen on is reached from this machine alone."""
    if host == 'localhost':
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


@dataclass(frozen=True)
class Access:
    """
    The rules of one server.

    Attributes
    ----------
    token : str
        What a person has to enter; empty: nobody is asked.
    origins : collection of str
        Of pages that may connect although they were not loaded under the name of the server,
        such as ``https://robot.example``: those behind a reverse proxy.

    """

    token: str = ''
    origins: Collection[str] = ()

    @classmethod
    def of_server(cls, host: str, token: str, origins: Collection[str]) -> Access:
        """
        Return the rules for a server on an address.

        Raises
        ------
        AccessError
            When the address is reached from other machines and there is no token, or the token
            is too short.

        """
        if not token and not is_loopback(host):
            raise AccessError(
                f'{host} is reached from other machines, and there is no token; put one of '
                f'{SHORTEST_TOKEN} letters or more into LMSCO_CONSOLE_TOKEN, or listen on '
                '127.0.0.1')
        if token and len(token) < SHORTEST_TOKEN:
            raise AccessError(f'the token in LMSCO_CONSOLE_TOKEN has {len(token)} letters; '
                              f'expected {SHORTEST_TOKEN} or more')
        return cls(token, frozenset(origin.strip().rstrip('/').lower() for origin in origins))

    @property
    def cookie(self) -> str:
        """What the cookie of who entered the token holds."""
        return hmac.new(self.token.encode(), b'console', hashlib.sha256).hexdigest()

    def knows(self, cookie: str | None) -> bool:
        """Tell whether a browser has entered the token, or need not."""
        return not self.token or _same(cookie or '', self.cookie)

    def opens(self, entered: str) -> bool:
        """Tell whether what was entered is the token."""
        return bool(self.token) and _same(entered, self.token)

    def is_own(self, origin: str | None, host: str | None) -> bool:
        """
        Tell whether a connection comes from our own page.

        A page of somebody else has another origin. One whose name was made to lead here has
        the right one, but then the name is not that of this machine, and it has no cookie.

        Parameters
        ----------
        origin : str or None
            Header `Origin`.
        host : str or None
            Header `Host`.

        """
        if not origin or not host:
            return False
        if origin.lower() in self.origins:
            return True
        try:
            parts, asked = urlsplit(origin), urlsplit(f'//{host}')
            name = asked.hostname
        except ValueError:
            return False
        return parts.netloc.lower() == host.lower() and (
            bool(self.token) or name in _LOOPBACK_NAMES)


def _same(given: str, expected: str) -> bool:
    """Compare in a time that does not tell how much is right."""
    return hmac.compare_digest(given.encode(errors='replace'), expected.encode())

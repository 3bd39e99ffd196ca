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

"""The parameters of the console; all are read once."""

from __future__ import annotations

from dataclasses import dataclass
import re
from urllib.parse import urlsplit

from lmsco_ros.node.ros_arguments import shortened, StartError

TOKEN_VARIABLE = 'LMSCO_CONSOLE_TOKEN'
"""Of the environment, not of ROS: everybody on the graph may read parameters."""
_NODE_NAME = re.compile(r'/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*', re.ASCII)
_TRANSPORTS = ('raw', 'compressed')


@dataclass(frozen=True)
class ConsoleSettings:
    """
    Parameters of the console; all are read once.

    Attributes
    ----------
    tracker : str
        Name of the node of the tracker.
    image_transport : str
        raw or compressed, as the tracker's.
    host, port : str, int
        Where the page is offered; port 0 takes any that is free.
    read_only : bool
        Whether pages may only look.
    allowed_origins : str
        Of pages behind a reverse proxy, separated by commas.
    record_folder : str
        Gets the bags that pages have recorded; empty: they cannot.
    history_megabytes : float
        Of images that are kept for stepping back.

    Raises
    ------
    StartError
        When a value means nothing.

    """

    tracker: str = 'lmsco_tracker'
    image_transport: str = 'raw'
    host: str = '127.0.0.1'
    port: int = 8080
    read_only: bool = False
    allowed_origins: str = ''
    record_folder: str = ''
    history_megabytes: float = 64.0

    def __post_init__(self) -> None:
        """Refuse what would be ignored later."""
        if not _NODE_NAME.fullmatch(self.tracker):
            raise StartError(f'tracker is {shortened(repr(self.tracker))}; expected the name of a '
                             'node, such as lmsco_tracker or /robot/lmsco_tracker')
        if self.image_transport not in _TRANSPORTS:
            raise StartError(f'image_transport is {self.image_transport!r}; expected '
                             f'{" or ".join(_TRANSPORTS)}')
        # NaN is no number of megabytes either.
        if not self.history_megabytes >= 0:
            raise StartError(f'history_megabytes is {self.history_megabytes}; expected 0 or more')
        for origin in self.origins:
            parts = urlsplit(origin)
            if parts.scheme not in ('http', 'https') or not parts.netloc \
                    or parts.path not in ('', '/'):
                raise StartError(f'{origin!r} in allowed_origins is no origin; expected a scheme '
                                 'and a name without a path, such as https://robot.example')

    @property
    def origins(self) -> tuple[str, ...]:
        """The allowed origins one by one."""
        parts = map(str.strip, self.allowed_origins.split(','))
        return tuple(part for part in parts if part)

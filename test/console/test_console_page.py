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

"""What docs/console.md says is so: the parameters, the topics and the limits."""

from pathlib import Path
import re

import yaml

from lmsco_ros.console import connection, requests, web
from lmsco_ros.console.access import SHORTEST_TOKEN
from lmsco_ros.console.settings import ConsoleSettings

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = (REPOSITORY / 'docs' / 'console.md').read_text()


def test_parameters_are_those_of_the_node():
    rows = re.findall(r'^\| `(\w+)` \| (\S+) \|', PAGE, re.M)
    told = {name: '' if value == 'empty' else yaml.safe_load(value.strip('`'))
            for name, value in rows if name in ConsoleSettings.__dataclass_fields__}
    assert ConsoleSettings(**told) == ConsoleSettings()
    assert len(told) == len(ConsoleSettings.__dataclass_fields__)


def test_limits_are_those_of_the_code():
    assert f'{requests.MOST_BYTES // 1024} KiB a message' in PAGE
    assert f'{connection._MOST_COMMANDS} commands a second' in PAGE
    assert f'At most {web._MOST_CONNECTIONS} pages' in PAGE
    assert f'at least {SHORTEST_TOKEN} letters' in PAGE

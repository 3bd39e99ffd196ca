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

"""`lmsco config`: every key of a configuration with its value."""

from __future__ import annotations

import typer

from lmsco_ros.cli.configuration import requested_config
from lmsco_ros.cli.console import plain_errors, say
from lmsco_ros.cli.options import ConfigOption, PresetOption


def register(app: typer.Typer) -> None:
    """Add the commands of this module to `app`."""
    config = typer.Typer(no_args_is_help=True, help='Look at configurations of the tracker.')
    config.command('show')(show)
    app.add_typer(config, name='config')


def show(preset: PresetOption = 'default', config: ConfigOption = None) -> None:
    """Show a configuration as YAML: a file to begin with, or what a file of yours means."""
    with plain_errors():
        say(requested_config(preset, config).to_yaml().rstrip())

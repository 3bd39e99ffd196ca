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

"""`lmsco`: track recordings, try the node, evaluate."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lmsco_ros.cli.interruption import ended_by_signals
from lmsco_ros.extras import MissingExtraError, require_extra

if TYPE_CHECKING:
    import typer


def build_app() -> typer.Typer:
    """Return the application with all its commands."""
    import typer

    from lmsco_ros.cli import (
        config, demo, doctor, evaluate, make_bag, page, record, replay, results, track, version,
        weights)

    app = typer.Typer(
        name='lmsco', no_args_is_help=True, pretty_exceptions_enable=False,
        context_settings={'help_option_names': ['-h', '--help']})
    for command in (
            version, track, replay, make_bag, demo, page, record, evaluate, results, config,
            weights, doctor):
        command.register(app)
    return app


def main() -> None:
    """
    Run the command line and leave with its exit code.

    0 is ok, 1 failed, 2 misused, 128 + number ended by a signal.
    """
    # The imports take long enough to be interrupted.
    with ended_by_signals():
        try:
            require_extra('cli', 'the command line')
            build_app()(prog_name='lmsco')
        except (MissingExtraError, OSError) as error:
            # Commands tell theirs; this one of OSError is a help that found no room on standard
            # output.
            raise SystemExit(f'error: {error}') from error


if __name__ == '__main__':
    main()

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

"""`lmsco doctor`: what is missing on this machine, and the remedy."""

from __future__ import annotations

import typer

from lmsco_ros.cli.console import FAILED, say, show_table


def register(app: typer.Typer) -> None:
    """Add the command of this module to `app`."""
    app.command()(doctor)


def doctor() -> None:
    """Look at what this machine has for the tracker and say what is missing."""
    from lmsco_ros.cli.machine import examine, State

    findings = examine()
    show_table(('', 'what', 'found'), [
        (finding.state.value, finding.name, finding.said) for finding in findings])
    for finding in findings:
        if finding.remedy:
            say(f'{finding.name}: {finding.remedy}')
    if any(finding.state is State.WRONG for finding in findings):
        raise typer.Exit(FAILED)

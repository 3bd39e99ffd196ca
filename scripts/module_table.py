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
Write the table of the modules of the core in `docs/architecture.md`, from their docstrings.

Run this after a module has come, gone or changed its first line.
"""

from __future__ import annotations

import ast
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
CORE = REPOSITORY / 'lmsco_ros' / 'core'
PAGE = REPOSITORY / 'docs' / 'architecture.md'
HEAD = '| module | what it is for |\n|---|---|\n'


def table() -> str:
    """Return the rows, the modules outside of rooms first."""
    files = [file for file in CORE.rglob('*.py') if file.name != '__init__.py']
    files.sort(key=lambda file: (file.parent != CORE, file))
    rows = ''
    for file in files:
        docstring = ast.get_docstring(ast.parse(file.read_text(encoding='utf-8'))) or ''
        rows += f'| `{file.relative_to(CORE)}` | {docstring.splitlines()[0]} |\n'
    return rows


def page(text: str) -> str:
    """Return the text of the page with the table as it should be."""
    before, _, rest = text.partition(HEAD)
    return before + HEAD + table() + '\n' + rest.partition('\n\n')[2]


if __name__ == '__main__':
    PAGE.write_text(page(PAGE.read_text(encoding='utf-8')), encoding='utf-8')

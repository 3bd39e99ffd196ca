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

"""Text of any origin: encodings told by their mark, lines as an editor counts them."""

from __future__ import annotations

import codecs
from pathlib import Path
import re

from lmsco_ros.evaluation.errors import SequenceError

# The mark of UTF-32 begins with that of UTF-16.
_MARKS = (
    (codecs.BOM_UTF8, 'utf-8'),
    (codecs.BOM_UTF32_LE, 'utf-32-le'), (codecs.BOM_UTF32_BE, 'utf-32-be'),
    (codecs.BOM_UTF16_LE, 'utf-16-le'), (codecs.BOM_UTF16_BE, 'utf-16-be'))

# Text that passed twice through Windows has lines that end in \r\r\n.
_LINE_END = re.compile(r'\r*\n|\r')


def read_text(path: Path) -> str:
    """
    Return the text of a file, without its byte order mark.

    Parameters
    ----------
    path : Path
        UTF-8, or UTF-16 and UTF-32 that begin with a byte order mark; other bytes become
        U+FFFD, which is part of no number.

    Raises
    ------
    SequenceError
        When it is UTF-16 without a mark, or no text at all.

    """
    data = path.read_bytes()
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return data[len(mark):].decode(encoding, errors='replace')
    if b'\0' in data:
        raise SequenceError(f'{path.name} is neither UTF-8 text nor marked as UTF-16; '
                            'save it as UTF-8')
    return data.decode('utf-8', errors='replace')


def read_lines(path: Path) -> list[str]:
    """Return the lines of a text file, whatever they end in; see `read_text`."""
    return _LINE_END.split(read_text(path))

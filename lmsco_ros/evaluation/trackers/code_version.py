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

"""Version of the code behind a result, so that no result outlives it."""

from __future__ import annotations

import hashlib
from pathlib import Path

import lmsco_ros


def core_version() -> str:
    """Return a digest over code and bundled weights of the core, 12 hexadecimal digits."""
    root = Path(lmsco_ros.__file__).parent / 'core'
    return sources_digest((*sorted(root.rglob('*.py')), *sorted(root.rglob('*.safetensors'))))


def sources_digest(paths: tuple[Path, ...]) -> str:
    """Return a digest over names and contents of files, 12 hexadecimal digits."""
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.name.encode() + b'\0' + path.read_bytes() + b'\0')
    return digest.hexdigest()[:12]

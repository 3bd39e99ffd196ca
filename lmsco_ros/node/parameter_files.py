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
What parameter files and overrides say to whom, and what of it nobody hears.

ROS leaves out without a word what is meant for another node or for no parameter at all.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
import difflib
from pathlib import Path
import re

import yaml

from lmsco_ros.node.ros_arguments import shortened, values_of

_PARAMETERS = 'ros__parameters'
TRACKER_FILE = 'config/tracker.yaml'
_EXPECTED = f'expected the layout of {TRACKER_FILE}'


def file_problem(path: str, reason: str) -> str:
    """
    Say why ROS refuses a parameter file.

    Parameters
    ----------
    path : str
        The file.
    reason : str
        What ROS says; it knows what it expects, but not why a file cannot be read.

    """
    subject = f'the parameter file {shortened(path)}'
    refused = f'{subject} is refused by ROS: {reason}; {_EXPECTED}'
    if Path(path).is_fifo():
        # What came through it is gone.
        return refused
    try:
        _addressees(path)
    except OSError as error:
        return f'{subject} cannot be read: {error.strerror}'
    except yaml.MarkedYAMLError as error:
        line = '' if error.problem_mark is None else f' in line {error.problem_mark.line + 1}'
        return f'{subject} is no YAML: {error.problem}{line}; {_EXPECTED}'
    except yaml.YAMLError:
        return f'{subject} is no YAML: it is no text in UTF-8; {_EXPECTED}'
    return refused


def unheard(arguments: Sequence[str], node: str) -> list[str]:
    """
    Say which parameters of the command line are for other nodes only.

    Parameters
    ----------
    arguments : sequence of str
        Those for ROS, which ROS has accepted.
    node : str
        Full name of the node.

    """
    warnings = [_nothing_for(node, path, names) for path, names in _files(arguments)
                if not any(_means(name, node) for name in names)]
    for rule in values_of('--param', arguments):
        name, colon, _ = rule.partition(':=')[0].partition(':')
        if colon and not _means(f'/{name}', node):
            warnings.append(f'the parameter {shortened(rule)} is for the node /{name}, this is '
                            f'{node}; leave the name out')
    return warnings


def unknown(given: Iterable[str], known: Iterable[str], listed_in: str) -> list[str]:
    """
    Say which parameters do not exist, each with the nearest name that does.

    Parameters
    ----------
    given, known : iterable of str
        Names of parameters.
    listed_in : str
        Where a user finds them all.

    """
    known = sorted(known)
    warnings = []
    for name in sorted(set(given).difference(known)):
        nearest = difflib.get_close_matches(name, known, n=1)
        remedy = f'did you mean {nearest[0]}?' if nearest else f'{listed_in} lists all'
        warnings.append(
            f'the parameter {shortened(name)} is unknown and changes nothing; {remedy}')
    return warnings


def _files(arguments: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Return the parameter files that can be read again, with the names of nodes in them."""
    return [(path, _addressees(path)) for path in values_of('--params-file', arguments)
            if Path(path).is_file()]


def _nothing_for(node: str, path: str, names: list[str]) -> str:
    if not names:
        return f'the parameter file {path} has no parameters'
    nearest, = difflib.get_close_matches(node, names, n=1, cutoff=0.0)
    return (f'the parameter file {path} has nothing for this node, {node}; the nearest name '
            f'there is {shortened(nearest)}; write {node}, or /**/{node.rpartition("/")[2]} for '
            'any namespace')


def _means(name: str, node: str) -> bool:
    """Tell whether a name in a parameter file, with its wildcards, is that of the node."""
    pattern = re.escape(name).replace(r'/\*\*', r'(/\w+)*').replace(r'/\*', r'(/\w+)')
    return re.fullmatch(pattern, node) is not None


def _addressees(path: str) -> list[str]:
    """
    Return the names of nodes in a parameter file.

    The file is gone through without building what it describes: no depth and no number in it
    can do harm.
    """
    with open(path, 'rb') as file:
        return list(_node_names(yaml.parse(file, Loader=yaml.SafeLoader)))


def _node_names(events: Iterable[yaml.Event]) -> Iterator[str]:
    """Yield the keys that lead to each `ros__parameters`, joined."""
    # One for each open collection; None where a key comes next.
    keys: list[str | None] = []
    for event in events:
        if isinstance(event, yaml.CollectionStartEvent):
            keys.append(None)
        elif isinstance(event, yaml.CollectionEndEvent):
            keys.pop()
            if keys:
                keys[-1] = None
        elif isinstance(event, yaml.ScalarEvent) and keys:
            keys[-1] = event.value if keys[-1] is None else None
            if keys[-1] == _PARAMETERS:
                names = '/'.join(key or '' for key in keys[:-1])
                yield re.sub('/+', '/', f'/{names}')

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
Write `docs/configuration.md` from the classes of the configuration.

Keys, values and their meaning stand in the code alone: run this after a change there.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
import dataclasses
import inspect
from pathlib import Path
import re
import textwrap
from typing import Any

import yaml

from lmsco_ros.core.config import ChannelConfig, FeatureConfig, TrackerConfig

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'configuration.md'
SHOWN = ('default', 'paper')
CHECKS = ('check_range', 'check_choice')
HEAD = """\
# Configuration reference

Written by `scripts/configuration_page.py` from the classes in `lmsco_ros/core/config`; do not
change by hand.

A configuration is a preset and what differs from it, in a YAML file:

```yaml
preset: default
extent: {network: ''}
```

The command line takes the file as `--config`, the node as `tracker_config`, Python as
`TrackerConfig.from_yaml`. Without `preset` the file changes `default`. A list, such as `features`,
replaces the whole list. An unknown key or a value out of its range is refused, with what was
expected.
The tables show the values of the presets `default` and `paper`; `mas` is another name of `paper`.
What to change for which scene: [tuning](tuning.md).
"""
BLOCKS = """
## Feature blocks

`features` is a list of blocks. Each block has a list of channels, and the values below where none
are given.
"""


def described(section: type) -> list[tuple[list[str], str]]:
    """Return the attributes of a dataclass with what its docstring says of them, together."""
    text = inspect.cleandoc(section.__doc__ or '')
    attributes = text.partition('Attributes\n----------\n')[2]
    entries = re.findall(r'^(\w.*)\n((?:    .*\n?)+)', attributes, re.M)
    return [(names.partition(' : ')[0].split(', '), ' '.join(meaning.split()))
            for names, meaning in entries]


def summary(section: type) -> str:
    """Return the first sentence of a docstring."""
    return inspect.cleandoc(section.__doc__ or '').partition('\n')[0]


def allowed(section: type) -> dict[str, str]:
    """Return the range or the choices of each field, as a dataclass checks them."""
    check = getattr(section, '__post_init__', None)
    if check is None:
        return {}
    tree = ast.parse(textwrap.dedent(inspect.getsource(check)))
    return dict(_ranges(tree, vars(inspect.getmodule(section))))


def _ranges(tree: ast.AST, names: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield (field, range) of every check below a node, where `names` have their values."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.For) and isinstance(node.target, ast.Name):
            for value in ast.literal_eval(node.iter):
                yield from _ranges(node, {**names, node.target.id: value})
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in CHECKS:
            field, *limits = node.args[1:]
            stated = _interval(node, limits) if len(limits) == 2 else ', '.join(
                f'`{choice}`' for choice in _values(limits[0], names))
            yield _value(field, names), stated
        else:
            yield from _ranges(node, names)


def _interval(check: ast.Call, limits: list[ast.expr]) -> str:
    """Return the text of a range; limits may be other fields."""
    low, high = (f'`{limit.attr}`' if isinstance(limit, ast.Attribute)
                 else f'{ast.literal_eval(limit):g}' for limit in limits)
    return f'{"(" if check.keywords else "["}{low}, {high}]'


def _value(node: ast.expr, names: dict[str, Any]) -> Any:
    """Return the value of a literal or a name."""
    return names[node.id] if isinstance(node, ast.Name) else ast.literal_eval(node)


def _values(node: ast.expr, names: dict[str, Any]) -> Iterator[Any]:
    """Yield the items of a tuple of literals, some of which are in other tuples."""
    for item in node.elts if isinstance(node, ast.Tuple) else [ast.Starred(node)]:
        if isinstance(item, ast.Starred):
            yield from _value(item.value, names)
        else:
            yield _value(item, names)


def table(section: type, columns: dict[str, Any], *, left_out: str = '') -> list[str]:
    """Return the rows of a section's table; `columns` maps headings to its instances."""
    ranges = allowed(section)
    rows = [f'| key | {" | ".join(columns)} | allowed | meaning |',
            '|---' * (len(columns) + 3) + '|']
    for keys, meaning in described(section):
        if keys != [left_out]:
            values = (', '.join(shown(getattr(instance, key)) for key in keys)
                      for instance in columns.values())
            cells = [', '.join(f'`{key}`' for key in keys), *values,
                     ', '.join(ranges[key] for key in keys if key in ranges), meaning]
            rows.append(f'| {" | ".join(cells)} |')
    return rows


def shown(value: Any) -> str:
    """Return a value as YAML writes it."""
    if isinstance(value, float):
        return f'{value:.4g}'
    return yaml.safe_dump(value).split('\n')[0] if value != '' else '(empty)'


def without_defaults(block: FeatureConfig) -> dict[str, Any]:
    """Return a feature block as one would write it."""
    def changed(item: Any) -> dict[str, Any]:
        return {field.name: getattr(item, field.name) for field in dataclasses.fields(item)
                if getattr(item, field.name) != field.default}
    return {**changed(block), 'channels': [changed(group) for group in block.channels]}


def features() -> list[str]:
    """Return the part of the page on feature blocks."""
    group = ChannelConfig('hog')
    block = table(FeatureConfig, {'otherwise': FeatureConfig((group,))}, left_out='channels')
    lines = [*BLOCKS.splitlines(), '', *block, '', 'Of each of its `channels`:', '',
             *table(ChannelConfig, {'otherwise': group})]
    for name in SHOWN:
        written = {'features': [without_defaults(b) for b in TrackerConfig.preset(name).features]}
        lines += ['', f'The blocks of `{name}`:', '', '```yaml',
                  yaml.safe_dump(written, sort_keys=False, default_flow_style=None).rstrip(),
                  '```']
    return lines


def page() -> str:
    """Return the whole page."""
    presets = {f'`{name}`': TrackerConfig.preset(name) for name in SHOWN}
    lines = HEAD.splitlines()
    for field in dataclasses.fields(TrackerConfig):
        if field.name == 'features':
            continue
        columns = {name: getattr(config, field.name) for name, config in presets.items()}
        section = type(next(iter(columns.values())))
        lines += ['', f'## {field.name}', '', summary(section), '', *table(section, columns)]
    return '\n'.join([*lines, *features()]) + '\n'


if __name__ == '__main__':
    PAGE.write_text(page(), encoding='utf-8')

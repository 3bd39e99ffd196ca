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

"""What the README promises is there: interface, parameters, commands, links and examples."""

import importlib.util
from pathlib import Path
import re
import time

import cv2
import numpy as np
import pytest
import yaml

from lmsco_ros import core
from msg_adapters.encodings import ALIASES, ENCODINGS

REPOSITORY = Path(__file__).resolve().parents[2]
README = (REPOSITORY / 'README.md').read_text()
PICTURE_BYTES = 300_000
PATIENCE_SECONDS = 20.0


def table(heading):
    """Return the rows of the table below a heading, as lists of cells without back-ticks."""
    section = README.split(f'\n## {heading}\n')[1].split('\n## ')[0]
    rows = [line for line in section.splitlines() if line.startswith('|')][2:]
    return [[cell.strip().strip('`') for cell in row.strip('|').split('|')] for row in rows]


def blocks(language):
    """Return the fenced code blocks of a language."""
    return re.findall(rf'```{language}\n(.*?)```', README, re.S)


def test_parameter_table_is_the_parameter_file():
    """Names, order and defaults agree with config/tracker.yaml."""
    (node,) = yaml.safe_load((REPOSITORY / 'config' / 'tracker.yaml').read_text()).values()
    documented = {name: yaml.safe_load(default) for name, default, _ in table('Parameters')}
    assert list(documented.items()) == list(node['ros__parameters'].items())


@pytest.fixture(scope='module')
def node():
    """Run the real node in a context, and under a name, of its own."""
    rclpy = pytest.importorskip('rclpy', reason='needs ROS 2')
    from lmsco_ros.node.tracker_node import TrackerNode
    context = rclpy.Context()
    rclpy.init(context=context)
    node = TrackerNode(context=context, namespace='described')
    yield node
    node.destroy_node()
    rclpy.shutdown(context=context)


def documented_names(node, rows):
    """Return {full name: type} of table rows that begin with the name and end with a meaning."""
    return {node.resolve_topic_name(row[0]): row[-2] for row in rows}


def offered_names(query, node, expected):
    """Return {full name: type} that the graph tells of the node, once it tells of `expected`."""
    deadline = time.monotonic() + PATIENCE_SECONDS
    while True:
        told = {name: types[0] for name, types in query(node.get_name(), node.get_namespace())}
        if expected.items() <= told.items() or time.monotonic() > deadline:
            return told
        time.sleep(0.05)


@pytest.mark.parametrize('direction', ['in', 'out'])
def test_topic_table_is_the_interface_of_the_node(node, direction):
    """Every documented topic is offered with its type, and none is left out."""
    documented = documented_names(node, [row for row in table('Topics') if row[1] == direction])
    optional = {'vision_msgs': ('~/detections', 'init_detections'),
                'foxglove_msgs': ('~/annotations',)}
    for package in (name for name in optional if importlib.util.find_spec(name) is None):
        for name in optional[package]:
            documented.pop(node.resolve_topic_name(name), None)
    query = (node.get_subscriber_names_and_types_by_node if direction == 'in'
             else node.get_publisher_names_and_types_by_node)
    offered = offered_names(query, node, documented)
    for everybodys in ('/parameter_events', '/rosout', '/clock', '~/transition_event'):
        offered.pop(node.resolve_topic_name(everybodys), None)
    assert documented == offered


def test_service_table_is_offered_by_the_node(node):
    """Both services exist with the documented types."""
    documented = documented_names(node, table('Services'))
    offered = offered_names(node.get_service_names_and_types_by_node, node, documented)
    assert documented.items() <= offered.items()


def test_encoding_table_is_that_of_the_adapters():
    """Every name and further spelling is told, and no other one."""
    told = [name.lower() for names, _ in table('Image encodings')
            for name in re.findall(r'\w+', ' '.join(re.findall(r'`(\w+)`', f'`{names}`')))]
    assert sorted(set(told)) == sorted({*map(str.lower, ENCODINGS), *ALIASES})


def test_python_example_runs(tmp_path, monkeypatch, capsys):
    """The block is executed on a small 16-bit scene with a warm target where it starts."""
    (tmp_path / 'frames').mkdir()
    noise = np.random.default_rng(0)
    for number in range(4):
        image = noise.normal(30_000, 20, (240, 320))
        image[90:120, 120 + 2 * number:160 + 2 * number] += 400
        cv2.imwrite(str(tmp_path / 'frames' / f'{number}.png'), image.astype(np.uint16))
    monkeypatch.chdir(tmp_path)
    (example,) = blocks('python')
    exec(example, {})
    assert len(capsys.readouterr().out.splitlines()) == 3


def test_commands_of_the_command_line_exist():
    """Each `lmsco` line names a command and only options that it has."""
    import typer

    from lmsco_ros.cli.main import build_app
    commands = typer.main.get_command(build_app()).commands
    lines = re.findall(r'^lmsco (?!-)(\S+)(.*)$', '\n'.join(blocks('bash')), re.M)
    assert len(lines) >= 4
    for name, arguments in [*lines, ('demo', ''), ('evaluate', '')]:
        command = commands[name]
        if hasattr(command, 'commands'):
            command = command.commands[arguments.split()[0]]
        options = {option for parameter in command.params for option in parameter.opts}
        assert set(re.findall(r'--[\w-]+', arguments.split('#')[0])) <= options


def test_make_targets_exist():
    """Each `make ...` of the README and of CONTRIBUTING is a target."""
    text = README + (REPOSITORY / 'CONTRIBUTING.md').read_text()
    targets = set(re.findall(r'^([\w-]+):', (REPOSITORY / 'Makefile').read_text(), re.M))
    mentioned = set(re.findall(r'(?:^|`|&& )make(?: -C \S+)? ([a-z]+)', text, re.M))
    assert {'demo', 'test', 'lint', 'venv'} <= mentioned <= targets


@pytest.mark.parametrize('page', ['README.md', 'CONTRIBUTING.md', 'RELEASING.md', 'SECURITY.md',
                                  'QUALITY_DECLARATION.md'])
def test_links_lead_somewhere(page):
    """Every relative link is a file of the repository."""
    text = (REPOSITORY / page).read_text()
    for target in re.findall(r'\]\(([^)#:]+)\)', text):
        assert (REPOSITORY / target).exists(), f'{page} links to {target}'


def test_picture_is_small_enough_to_load():
    """It is shown to everybody who opens the page."""
    assert (REPOSITORY / 'docs/images/demo.png').stat().st_size < PICTURE_BYTES


def test_all_that_the_core_exports_is_what_the_pages_name():
    """Users import from `lmsco_ros.core`, and every name there is in the reference."""
    pages = [REPOSITORY / 'README.md', *(REPOSITORY / 'docs').glob('*.md'),
             *(REPOSITORY / 'examples').glob('*.py')]
    used = {name.strip() for page in pages for names in re.findall(
        r'from lmsco_ros\.core import (.+)', page.read_text()) for name in names.split(',')}
    exported = set(core.__all__)
    reference = (REPOSITORY / 'docs' / 'api.md').read_text()
    named = set(re.findall(r'`~lmsco_ros\.core\.[\w.]+\.(\w+)`', reference))
    errors = {name for name in exported if issubclass(getattr(core, name), core.LMSCOError)}
    assert used <= exported and named | errors == exported

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

"""What the README says about security is so: the policy, the files and the weights."""

import ast
from pathlib import Path
import time
from xml.etree import ElementTree

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
POLICY = REPOSITORY / 'config' / 'sros2_policy.xml'
PATIENCE_SECONDS = 100.0
# Element: its attributes, and what may be in it; as in the schema of SROS 2 policies 0.2.0.
SCHEMA = {
    'policy': ({'version': {'0.2.0'}}, {'contexts'}),
    'contexts': ({}, {'context'}),
    'context': ({'path': None}, {'profiles'}),
    'profiles': ({}, {'profile'}),
    'profile': ({'ns': None, 'node': None}, {'topics', 'services'}),
    'topics': ({'publish': {'ALLOW'}, 'subscribe': {'ALLOW'}}, {'topic'}),
    'services': ({'reply': {'ALLOW'}, 'request': {'ALLOW'}}, {'service'}),
    'topic': ({}, set()),
    'service': ({}, set()),
}
# Modules and functions that make objects, or run programs, from what they read.
FORBIDDEN = {'pickle.load', 'pickle.loads', 'pickle.Unpickler', 'cPickle', 'dill', 'joblib',
             'marshal', 'shelve', 'torch.load', 'torch.jit.load', 'yaml.load',
             'yaml.unsafe_load', 'os.system', 'eval', 'exec'}
# What keeps a reader from making anything but numbers.
HARMLESS = {'torch.load': ('weights_only', 'True')}


@pytest.fixture(scope='module')
def policy():
    """Parse the policy."""
    return ElementTree.parse(POLICY).getroot()


def granted(policy, node, group, rule):
    """Return the full names that the policy allows to a node."""
    profile = policy.find(f".//profile[@node='{node}']")
    own = f'/{profile.get("node")}'
    names = [entry.text for element in profile.iter(group) if element.get(rule) == 'ALLOW'
             for entry in element]
    assert len(names) == len(set(names))
    return {name.replace('~', own) if name.startswith('~') else '/' + name.lstrip('/')
            for name in names}


def test_policy_is_written_as_sros2_reads_it(policy):
    for element in policy.iter():
        attributes, children = SCHEMA[element.tag]
        assert {child.tag for child in element} <= children
        for name, value in element.items():
            assert attributes[name] is None or value in attributes[name]
        if element.tag in ('topics', 'services'):
            assert len(element.attrib) == 1 and len(element)
    profiles = [(profile.get('ns'), profile.get('node')) for profile in policy.iter('profile')]
    assert profiles == [('/', 'lmsco_tracker'), ('/', 'lmsco_console'), ('/', 'lmsco_recorder')]
    assert [context.get('path') for context in policy.iter('context')] == [
        f'/{node}' for _, node in profiles]


def _tracker(transport, **kwargs):
    from lmsco_ros.node.tracker_node import TrackerNode
    return TrackerNode(f'{transport}_under_policy', **kwargs)


def _console(transport, **kwargs):
    """Make a console that does all that it ever does at once."""
    from lmsco_ros.console.console_node import ConsoleNode
    node = ConsoleNode(f'{transport}_console_under_policy', **kwargs)
    node.want_map('somebody', True)
    node.record(True, lambda done, text: None)
    node._tick()
    return node


NODES = {'lmsco_tracker': _tracker, 'lmsco_console': _console}


@pytest.fixture(scope='module', params=NODES)
def interface(request, tmp_path_factory):
    """Return the name of a node and what the graph tells of it, over all ways to configure it."""
    rclpy = pytest.importorskip('rclpy', reason='needs ROS 2')
    from rclpy.parameter import Parameter

    found = {'publish': set(), 'subscribe': set(), 'reply': set(), 'request': set()}
    for transport in ('raw', 'compressed'):
        context = rclpy.Context()
        rclpy.init(context=context)
        # A name of its own: the graph may still know of another that is called the same.
        node = NODES[request.param](transport, context=context, parameter_overrides=[
            Parameter('image_transport', value=transport), Parameter('use_sim_time', value=True),
            Parameter('record_folder', value=str(tmp_path_factory.mktemp('bags')))])
        for rule, names in _told(node).items():
            found[rule] |= {full.replace(f'/{node.get_name()}', f'/{request.param}')
                            for full in names}
        node.destroy_node()
        rclpy.shutdown(context=context)
    return request.param, found


def _told(node):
    """Ask the graph until it knows of everything that the node itself knows of."""
    queries = {'publish': node.get_publisher_names_and_types_by_node,
               'subscribe': node.get_subscriber_names_and_types_by_node,
               'reply': node.get_service_names_and_types_by_node,
               'request': node.get_client_names_and_types_by_node}
    known = {'publish': {entity.topic_name for entity in node.publishers},
             'subscribe': {entity.topic_name for entity in node.subscriptions},
             'reply': {node.resolve_service_name(entity.srv_name) for entity in node.services},
             'request': {node.resolve_service_name(entity.srv_name) for entity in node.clients}}
    deadline = time.monotonic() + PATIENCE_SECONDS
    while True:
        told = {rule: {name for name, _ in query(node.get_name(), node.get_namespace())}
                for rule, query in queries.items()}
        if all(names <= told[rule] for rule, names in known.items()) \
                or time.monotonic() > deadline:
            return told
        time.sleep(0.05)


def test_policy_allows_exactly_what_the_nodes_have(policy, interface):
    from msg_adapters.annotations import annotations_available
    from msg_adapters.boxes import detections_available
    node, found = interface
    publish, subscribe = (granted(policy, node, 'topics', way) for way in ('publish', 'subscribe'))
    if not detections_available():
        publish.discard('/lmsco_tracker/detections')
        subscribe.discard('/init_detections')
    if not annotations_available():
        publish.discard('/lmsco_tracker/annotations')
    assert publish == found['publish']
    assert subscribe == found['subscribe']
    assert granted(policy, node, 'services', 'reply') == found['reply']
    assert granted(policy, node, 'services', 'request') == found['request']


def test_recorder_may_hear_what_it_records(policy):
    pytest.importorskip('rclpy', reason='needs ROS 2')
    from lmsco_ros.replay.live_recording import LivePlan, NODE_NAME
    heard = {f'/{topic}' for compressed in (False, True)
             for topic in LivePlan(REPOSITORY, compressed=compressed).topics}
    assert granted(policy, NODE_NAME, 'topics', 'subscribe') == heard


def _names(tree):
    """Yield every imported module and every function that is called, by its dotted name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.split('.')[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module.split('.')[0]
            yield from (f'{node.module}.{alias.name}' for alias in node.names)
        elif isinstance(node, ast.Call):
            name = ast.unparse(node.func)
            arguments = {(word.arg, ast.unparse(word.value)) for word in node.keywords}
            if HARMLESS.get(name) not in arguments:
                yield name
            if {('allow_pickle', 'True'), ('shell', 'True')} & arguments:
                yield 'eval'


@pytest.mark.parametrize('library', ['lmsco_ros', 'msg_adapters'])
def test_nothing_that_is_read_becomes_code(library):
    for file in (REPOSITORY / library).rglob('*.py'):
        found = FORBIDDEN & set(_names(ast.parse(file.read_text())))
        assert not found, f'{file} uses {found}'


@pytest.mark.parametrize('source', [
    'import marshal', 'from torch import load', 'torch.load(path)', 'pickle.loads(data)',
    'torch.load(path, weights_only=False)', 'np.load(p, allow_pickle=True)',
    'subprocess.run(text, shell=True)', 'exec(text)'])
def test_the_search_finds_what_it_looks_for(source):
    assert FORBIDDEN & set(_names(ast.parse(source)))

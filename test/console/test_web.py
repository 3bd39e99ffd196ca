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

"""The page's server in one process: frames with their state, requests, and who may ask."""

import json

import cv2
import numpy as np
import pytest
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from lmsco_ros.console import connection, frames
from lmsco_ros.console.access import Access
from lmsco_ros.console.web import make_app
from msg_adapters.state import State

TOKEN = 'a long enough token'
OWN = {'origin': 'http://127.0.0.1:8080', 'host': '127.0.0.1:8080'}


@pytest.fixture
def client():
    """Return a maker of browsers without JavaScript."""
    def make(desk, access=Access(), **more):
        return TestClient(make_app(desk, access), base_url='http://127.0.0.1:8080', **more)
    return make


@pytest.fixture
def page(client, desk):
    """Return a connected page that was greeted."""
    with client(desk).websocket_connect('/socket', headers=OWN) as socket:
        assert socket.receive_json()['type'] == 'hello'
        yield socket


def test_frame_and_its_state_come_in_one_message(page, feed, moment, read_frame):
    feed.add(moment(5))
    page.send_json({'type': 'next', 'drawn': 0})
    state, picture = read_frame(page.receive_bytes())
    assert (state['number'], state['stamp']) == (5, '1000000000000000005')
    assert (state['width'], state['height'], state['state']) == (64, 48, 'tracking')
    (target,) = state['targets']
    assert target['id'] == 1 and target['box'] == [5, 12, 8, 6] and target['score'] == 0.75
    assert state['health']['latency_ms'] == 12.5 and state['health']['dropped'] == 3
    assert cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_UNCHANGED).shape == (48, 64)


def test_expected_place_is_told_with_its_ellipse(page, feed, moment, read_frame):
    """The covariance is that of half axes 3 and 1 px, turned by 30 degrees from x to y."""
    turn = np.array([[np.cos(np.pi / 6), -np.sin(np.pi / 6)],
                     [np.sin(np.pi / 6), np.cos(np.pi / 6)]])
    covariance = turn @ np.diag([9.0, 1.0]) @ turn.T
    states = {1: State(1, (20.0, 30.0), covariance, (30.0, -40.0), np.eye(2))}
    feed.add(moment(5, 'lost', boxes={}, states=states))
    page.send_json({'type': 'next', 'drawn': 0})
    (target,) = read_frame(page.receive_bytes())[0]['targets']
    expected = target['expected']
    assert expected['center'] == [20, 30] and expected['speed'] == pytest.approx(50)
    assert expected['axes'] == pytest.approx([6, 2])
    assert expected['turn'] % np.pi == pytest.approx(np.pi / 6)
    feed.add(moment(6))
    page.send_json({'type': 'next', 'drawn': 5})
    assert read_frame(page.receive_bytes())[0]['targets'][0]['expected'] is None


@pytest.mark.parametrize('asked', [{'type': 'next', 'drawn': 0},
                                   {'type': 'step', 'number': 5, 'by': 0}])
def test_a_fault_costs_the_frame_that_it_is_in(
        page, desk, feed, moment, read_frame, monkeypatch, asked):
    def broken(*arguments):
        raise ZeroDivisionError('no side')
    feed.add(moment(5))
    with monkeypatch.context() as patch:
        patch.setattr(desk.pictures, 'jpeg', broken)
        page.send_json(asked)
        told = page.receive_json()
    assert told['type'] == 'answer' and not told['done'] and 'no side (test_web' in told['text']
    feed.add(moment(6))
    page.send_json({'type': 'next', 'drawn': 0})
    while 'bytes' not in (message := page.receive()):
        pass
    assert read_frame(message['bytes'])[0]['number'] == 6


def test_a_page_that_asks_late_gets_the_newest_frame(page, feed, moment, read_frame):
    for number in range(1, 30):
        feed.add(moment(number))
    page.send_json({'type': 'next', 'drawn': 0})
    assert read_frame(page.receive_bytes())[0]['number'] == 29
    feed.add(moment(30))
    page.send_json({'type': 'next', 'drawn': 29})
    state, _ = read_frame(page.receive_bytes())
    assert state['number'] == 30 and state['health']['delay_ms'] > 0


def test_a_frame_that_comes_later_is_sent_when_it_comes(page, feed, moment, read_frame):
    page.send_json({'type': 'next', 'drawn': 0})
    feed.add(moment(1))
    assert read_frame(page.receive_bytes())[0]['number'] == 1


def test_silence_is_told(page, desk, monkeypatch):
    monkeypatch.setattr(frames, '_SILENCE_SECONDS', 0.01)
    page.send_json({'type': 'next', 'drawn': 0})
    told = page.receive_json()
    assert told['type'] == 'silence' and told['seconds'] is None
    assert told['topic'] == '/image_raw'


@pytest.mark.parametrize('message, asked', [
    ({'type': 'start', 'stamp': '1234567890123456789', 'box': [1, 2.5, 30, 40]},
     ('start', 1234567890123456789, (1, 2.5, 30, 40))),
    ({'type': 'point', 'stamp': '7', 'x': 3.5, 'y': 4}, ('point', 7, 3.5, 4)),
    ({'type': 'select', 'id': 4}, ('select', 4)),
    ({'type': 'reset'}, ('reset',)),
    ({'type': 'record', 'on': True}, ('record', True)),
    ({'type': 'enable', 'on': False}, ('enable', False))])
def test_commands_reach_the_operator(page, desk, message, asked):
    page.send_json(message)
    # Requests are worked on one after the other.
    page.send_json({'type': 'nothing'})
    while 'known type' not in page.receive_json()['text']:
        pass
    assert desk.operator.asked == [asked]


def test_services_are_answered(page):
    page.send_json({'type': 'reset'})
    assert page.receive_json() == {
        'type': 'answer', 'done': True, 'text': 'all targets are dropped'}
    page.send_json({'type': 'enable', 'on': True})
    assert page.receive_json()['done'] is False


def test_a_tracker_that_does_not_answer_is_told(page, desk, monkeypatch):
    monkeypatch.setattr(connection, '_ANSWER_SECONDS', 0.01)
    desk.operator.reset = lambda answer: None
    page.send_json({'type': 'reset'})
    assert 'does not answer' in page.receive_json()['text']


def test_pages_step_through_what_is_kept(page, feed, moment, read_frame):
    for number in range(1, 6):
        feed.add(moment(number))
    for number, by, shown in [(5, -1, 4), (4, -2, 2), (2, -10, 1), (1, 1, 2), (4, 100, 5)]:
        page.send_json({'type': 'step', 'number': number, 'by': by})
        assert read_frame(page.receive_bytes())[0]['number'] == shown


def test_step_where_nothing_came_yet_is_answered(page):
    page.send_json({'type': 'step', 'number': 1, 'by': 1})
    assert 'no frame' in page.receive_json()['text']


def test_palette_and_layer_change_the_picture(page, feed, desk, moment, read_frame):
    confidence = np.zeros((48, 64), np.float32)
    confidence[10:20, 10:30] = 1
    feed.add(moment(1, confidence=confidence))

    def picture(palette, layer):
        page.send_json({'type': 'look', 'palette': palette, 'confidence': layer})
        page.send_json({'type': 'step', 'number': 1, 'by': 0})
        _, file = read_frame(page.receive_bytes())
        return cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_COLOR).astype(float)

    white, black = picture('white_hot', False), picture('black_hot', False)
    assert np.abs(white + black - 255).mean() < 12
    layered = picture('white_hot', True)
    changed = np.abs(layered - white).mean(axis=2) > 30
    assert changed[11:19, 12:28].mean() > 0.9 and changed[30:].mean() == 0
    assert len(desk.operator.maps) == 1
    assert (picture('inferno', False)[..., 2] - picture('inferno', False)[..., 0]).mean() > 20
    assert not desk.operator.maps


def test_maps_are_no_longer_wanted_when_the_page_has_left(client, desk):
    with client(desk).websocket_connect('/socket', headers=OWN) as socket:
        socket.receive_json()
        socket.send_json({'type': 'look', 'palette': 'ironbow', 'confidence': True})
        socket.send_json({'type': 'reset'})
        socket.receive_json()
        assert desk.operator.maps
    assert not desk.operator.maps


def test_what_happened_is_told_once_and_again_when_it_changed(
        page, feed, desk, moment, status, read_frame):
    def events(number):
        page.send_json({'type': 'step', 'number': number, 'by': 0})
        return read_frame(page.receive_bytes())[0]['events']

    feed.add(moment(1))
    desk.chronicle.hear(1, [status(start='accepted')])
    (event,) = events(1)
    assert (event['kind'], event['track_id'], event['thumbnail']) == ('accepted', 1, '')
    assert events(1) == []
    desk.chronicle.see(moment(2))
    (again,) = events(1)
    assert again['number'] == event['number'] and again['thumbnail']


def test_read_only_pages_may_only_look(client, make_desk, feed, moment, read_frame):
    desk = make_desk(read_only=True)
    feed.add(moment(1))
    with client(desk).websocket_connect('/socket', headers=OWN) as socket:
        assert socket.receive_json()['read_only'] is True
        for message in ({'type': 'reset'}, {'type': 'select', 'id': 1},
                        {'type': 'record', 'on': True}, {'type': 'absent', 'stamp': '1'},
                        {'type': 'enable', 'on': False}, {'type': 'point', 'stamp': '1', 'x': 1,
                                                          'y': 1},
                        {'type': 'start', 'stamp': '1', 'box': [1, 1, 1, 1]}):
            socket.send_json(message)
            assert 'may only look' in socket.receive_json()['text']
        socket.send_json({'type': 'next', 'drawn': 0})
        assert read_frame(socket.receive_bytes())[0]['number'] == 1
    assert not desk.operator.asked


def test_commands_are_limited(page, desk, monkeypatch):
    monkeypatch.setattr(connection, '_PER_SECONDS', 3600.0)
    for _ in range(30):
        page.send_json({'type': 'select', 'id': 1})
    assert 'commands in a second' in page.receive_json()['text']
    assert len(desk.operator.asked) == 20


@pytest.mark.parametrize('headers', [
    {'host': 'localhost:8080'},
    {'origin': 'http://elsewhere.example', 'host': 'localhost:8080'},
    {'origin': 'http://localhost:8081', 'host': 'localhost:8080'},
    {'origin': 'null', 'host': 'localhost:8080'},
    # A name that was made to lead to this machine.
    {'origin': 'http://elsewhere.example:8080', 'host': 'elsewhere.example:8080'}])
def test_other_pages_may_not_connect(client, desk, headers):
    browser = TestClient(make_app(desk, Access()), base_url=f'http://{headers["host"]}')
    with pytest.raises(WebSocketDisconnect), \
            browser.websocket_connect('/socket', headers=headers):
        pass


@pytest.mark.parametrize('headers', [
    {'origin': 'http://127.0.0.1:8080', 'host': '127.0.0.1:8080'},
    {'origin': 'http://[::1]:8080', 'host': '[::1]:8080'},
    {'origin': 'https://robot.example', 'host': '127.0.0.1:8080'}])
def test_own_pages_may_connect(client, desk, headers):
    access = Access.of_server('127.0.0.1', '', ['https://Robot.example/'])
    browser = TestClient(make_app(desk, access), base_url=f'http://{headers["host"]}')
    with browser.websocket_connect('/socket', headers=headers) as socket:
        assert socket.receive_json()['type'] == 'hello'


def test_token_opens_page_and_socket(client, desk):
    access = Access.of_server('0.0.0.0', TOKEN, [])
    browser = client(desk, access)
    asked = browser.get('/')
    assert asked.status_code == 401 and 'Token' in asked.text and TOKEN not in asked.text
    with pytest.raises(WebSocketDisconnect), browser.websocket_connect('/socket', headers=OWN):
        pass
    wrong = browser.post('/login', data={'token': TOKEN + '!'}, headers=OWN)
    assert wrong.status_code == 401 and not browser.cookies
    foreign = browser.post('/login', data={'token': TOKEN}, headers={'origin': 'http://a.b'})
    assert foreign.status_code == 403 and not browser.cookies
    assert browser.post('/login', content=b'token=' + b'a' * 9000, headers=OWN).status_code == 401
    opened = browser.post('/login', data={'token': TOKEN}, headers=OWN, follow_redirects=False)
    cookie = opened.headers['set-cookie'].lower()
    assert 'httponly' in cookie and 'samesite=strict' in cookie and TOKEN not in cookie
    assert browser.get('/').status_code == 200
    # The client of these tests keeps its cookies from sockets.
    known = {**OWN, 'cookie': opened.headers['set-cookie'].split(';')[0]}
    with browser.websocket_connect('/socket', headers=known) as socket:
        assert socket.receive_json()['type'] == 'hello'


def test_seventeenth_page_is_turned_away(client, desk):
    browser = client(desk)
    with browser:
        pages = [browser.websocket_connect('/socket', headers=OWN) for _ in range(17)]
        for socket in pages[:16]:
            socket.__enter__()
        with pytest.raises(WebSocketDisconnect):
            pages[16].__enter__()
        for socket in pages[:16]:
            socket.__exit__(None, None, None)
        with browser.websocket_connect('/socket', headers=OWN) as socket:
            assert socket.receive_json()['type'] == 'hello'


def test_files_and_headers(client, desk):
    browser = client(desk)
    for path, kind in [('/', 'text/html'), ('/main.js', 'text/javascript'),
                       ('/style.css', 'text/css'), ('/icon.svg', 'image/svg+xml')]:
        answer = browser.get(path)
        assert answer.status_code == 200 and answer.headers['content-type'].startswith(kind)
        policy = answer.headers['content-security-policy']
        assert "default-src 'none'" in policy and 'unsafe' not in policy
        assert answer.headers['x-content-type-options'] == 'nosniff'
    # Pages that the policy would break, or that would fetch from elsewhere.
    for name in ('/', '/main.js', '/stage.js', '/style.css'):
        text = browser.get(name).text
        assert 'https://' not in text and ' style="' not in text and ' onclick' not in text


@pytest.mark.parametrize('path', [
    '/../access.py', '/%2e%2e/access.py', '/page/index.html', '/index.html', '/login.html',
    '/main.js/../../access.py', '//etc/passwd', '/main.js%00', '/.'])
def test_no_path_leads_anywhere_else(client, desk, path):
    assert client(desk).get(path).status_code in (200, 404)
    assert 'import' not in client(desk).get(path).text


def test_ten_thousand_foul_messages(page, feed, moment, read_frame):
    rng = np.random.default_rng(7)
    kinds = ['next', 'step', 'look', 'start', 'point', 'select', 'reset', 'enable', 'x', None, 1]
    values = [None, True, -1, 0, 1e400, 'a' * 3000, '', [], {}, [1, 2, 3, 4], [float('nan')] * 4,
              '9' * 19, '12', 2 ** 64, 'white_hot', [[]] * 4]
    feed.add(moment(1))
    for number in range(10_000):
        fields = {'type': kinds[rng.integers(len(kinds))]}
        for name in ('stamp', 'box', 'x', 'y', 'id', 'on', 'by', 'number', 'drawn', 'palette'):
            if rng.random() < 0.5:
                fields[name] = values[rng.integers(len(values))]
        text = json.dumps(fields)
        if rng.random() < 0.3:
            text = text[:rng.integers(len(text))] + chr(rng.integers(1, 0xd7ff))
        if rng.random() < 0.05:
            page.send_bytes(rng.bytes(50))
        else:
            page.send_text(text)
    # The next frame can still be had, behind all the answers.
    feed.add(moment(2))
    page.send_json({'type': 'step', 'number': 2, 'by': 0})
    numbers = []
    while 2 not in numbers:
        data = page.receive().get('bytes')
        numbers += [read_frame(data)[0]['number']] if data else []

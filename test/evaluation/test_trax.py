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

"""The TraX server answers requests, and failures, without a toolkit or a TraX library."""

from __future__ import annotations

from collections import deque
import sys
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from lmsco_ros.core import (
    BoundingBox, BoxError, ConfigError, ImageError, NotInitializedError, TrackResult, TrackState)
from lmsco_ros.evaluation import trax

GRAY = np.arange(48, dtype=np.uint8).reshape(6, 8)
DEEP = GRAY.astype(np.uint16) * 300
BGR = np.stack([GRAY, GRAY + 60, GRAY + 120], axis=2)


class File:
    """A TraX image that names a file."""

    def __init__(self, path):
        self._path = path

    def type(self):
        return 'path'

    def path(self):
        return str(self._path)


class Buffer:
    """A TraX image that carries an encoded file."""

    def __init__(self, encoded):
        self._encoded = encoded

    def type(self):
        return 'buffer'

    def buffer(self):
        return self._encoded


class Memory:
    """A TraX image that carries pixels, gray as (H, W, 1) and color as RGB."""

    def __init__(self, pixels):
        self._pixels = pixels if pixels.ndim == 3 else pixels[..., None]

    def type(self):
        return 'memory'

    def array(self):
        return self._pixels


class Handle:
    """A TraX server whose requests are known in advance; keeps what it is told."""

    def __init__(self, *requests):
        self._requests = deque(requests)
        self.statuses = []
        self.reasons = []

    def wait(self):
        return self._requests.popleft()

    def status(self, objects):
        self.statuses.append(objects)

    def quit(self, reason=None):
        self.reasons.append(reason)


class FollowingTracker:
    """Moves its box by one pixel a frame; keeps the images it is given."""

    def __init__(self):
        self.images = []
        self._box = None

    def initialize(self, image, box):
        if box.x + box.width <= 0:
            raise BoxError('box lies outside of the image; choose one inside')
        self.images.append(image)
        self._box = box
        return self._result(1.0, TrackState.TRACKING)

    def update(self, image):
        if self._box is None:
            raise NotInitializedError('update before initialize; give a box first')
        self.images.append(image)
        box = self._box
        self._box = BoundingBox(box.x + 1, box.y, box.width, box.height)
        return self._result(0.25, TrackState.UNCERTAIN)

    def _result(self, score, state):
        return TrackResult(self._box, score, state, np.zeros((4, 4), np.float32), self._box)


def start(box, image=None, channel='ir'):
    """Return the request that starts on `box` (x, y, width, height)."""
    region = SimpleNamespace(type='rectangle', bounds=lambda: box)
    return SimpleNamespace(type='initialize', image={channel: image or Memory(GRAY)},
                           objects=[(region, {})])


def frame(image=None, channel='ir'):
    """Return the request that asks for the box in `image`."""
    return SimpleNamespace(type='frame', image={channel: image or Memory(GRAY)}, objects=None)


QUIT = SimpleNamespace(type='quit', image=None, objects=None)


def serve(handle, make_tracker=FollowingTracker, channel='ir'):
    """Serve `handle`; regions are plain tuples."""
    trax.serve(handle, make_tracker, channel, lambda *box: box)


def png(image):
    """Return `image` as the bytes of a png file."""
    return cv2.imencode('.png', image)[1].tobytes()


def test_every_request_is_answered_with_box_confidence_and_state():
    handle = Handle(start((1, 2, 3, 4)), frame(), frame(), QUIT)
    serve(handle)
    assert handle.statuses == [
        [((1, 2, 3, 4), {'confidence': 1.0, 'state': 'tracking'})],
        [((2, 2, 3, 4), {'confidence': 0.25, 'state': 'uncertain'})],
        [((3, 2, 3, 4), {'confidence': 0.25, 'state': 'uncertain'})]]
    assert handle.reasons == []


def test_one_process_serves_many_sequences():
    made = []

    def make_tracker():
        made.append(FollowingTracker())
        return made[-1]

    handle = Handle(start((1, 2, 3, 4)), frame(), start((5, 0, 2, 2), Memory(DEEP)), frame(), QUIT)
    serve(handle, make_tracker)
    assert [status[0][0] for status in handle.statuses] == [
        (1, 2, 3, 4), (2, 2, 3, 4), (5, 0, 2, 2), (6, 0, 2, 2)]
    assert len(made) == 1
    np.testing.assert_array_equal(made[0].images[2], DEEP)


@pytest.mark.parametrize('stored', [GRAY, DEEP, BGR], ids=['gray', '16 bit', 'color'])
@pytest.mark.parametrize('kind', ['path', 'buffer', 'memory'])
def test_images_reach_the_tracker_unchanged(stored, kind, tmp_path):
    file = tmp_path / 'a frame.png'
    file.write_bytes(png(stored))
    in_memory = stored if stored.ndim == 2 else stored[..., ::-1]
    resource = {'path': File(file), 'buffer': Buffer(png(stored)), 'memory': Memory(in_memory)}
    image = trax.read_image(resource[kind])
    assert image.dtype == stored.dtype
    np.testing.assert_array_equal(image, stored)


def test_gray_stored_as_color_becomes_one_channel():
    image = trax.read_image(Buffer(png(np.repeat(GRAY[..., None], 3, axis=2))))
    np.testing.assert_array_equal(image, GRAY)


def test_the_declared_channel_is_read():
    tracker = FollowingTracker()
    request = start((1, 1, 2, 2), channel='color')
    request.image['ir'] = Memory(DEEP)
    serve(Handle(request, QUIT), lambda: tracker, channel='color')
    np.testing.assert_array_equal(tracker.images[0], GRAY)


@pytest.mark.parametrize('resource, expected', [
    (File('/no/such/frame.png'), '/no/such/frame.png cannot be read'),
    (Buffer(b''), 'no complete image'),
    (Buffer(png(GRAY)[:20]), 'no complete image'),
    (SimpleNamespace(type=lambda: 'url'), 'url image'),
])
def test_a_broken_image_is_named(resource, expected):
    with pytest.raises(ImageError, match=expected):
        trax.read_image(resource)


@pytest.mark.parametrize('requests, expected', [
    ([start((-9, 0, 3, 3))], 'box lies outside of the image; choose one inside'),
    ([start((1, 1, 0, 3))], 'is empty'),
    ([frame()], 'update before initialize'),
    ([start((1, 1, 2, 2)), frame(Buffer(b''))], 'no complete image'),
], ids=['outside', 'empty', 'not started', 'broken frame'])
def test_a_failure_ends_the_session_with_its_reason(requests, expected):
    handle = Handle(*requests)
    with pytest.raises(ValueError, match=expected):
        serve(handle)
    assert len(handle.reasons) == 1
    assert expected in handle.reasons[0]
    assert len(handle.statuses) == len(requests) - 1


@pytest.mark.parametrize('objects', [None, [], [1, 2]])
def test_exactly_one_object_is_tracked(objects):
    with pytest.raises(BoxError, match='objects; this tracker follows one'):
        trax.read_box(objects)


def test_a_tracker_that_cannot_be_made_is_reported_in_the_session():
    def make_tracker():
        raise ConfigError('the weights are not there; run make weights')

    handle = Handle(start((1, 1, 2, 2)))
    with pytest.raises(ConfigError):
        serve(handle, make_tracker)
    assert handle.reasons == ['the weights are not there; run make weights']


def test_an_unforeseen_error_names_its_type_in_plain_characters():
    def make_tracker():
        raise RuntimeError('größer')

    handle = Handle(start((1, 1, 2, 2)))
    with pytest.raises(RuntimeError):
        serve(handle, make_tracker)
    assert handle.reasons == ['RuntimeError: gr\\xf6\\xdfer']


class FakeLibrary(SimpleNamespace):
    """Stands for the module `trax`; keeps how its server was announced."""

    def __init__(self, handle):
        super().__init__(
            Region=SimpleNamespace(RECTANGLE='rectangle'),
            Image=SimpleNamespace(PATH='path', MEMORY='memory', BUFFER='buffer'),
            Rectangle=SimpleNamespace(create=lambda *box: box),
            TraxException=type('TraxException', (Exception,), {}))
        self.handle = handle
        self.announced = None

    def Server(self, *announced):  # noqa: N802
        self.announced = announced
        return self.handle


def test_main_asks_for_rectangles_and_the_channel_of_the_sequences(monkeypatch):
    library = FakeLibrary(Handle(QUIT))
    monkeypatch.setitem(sys.modules, 'trax', library)
    assert trax.main(['--preset', 'hcs', '--channel', 'color']) == 0
    regions, images, channels = library.announced[:3]
    assert regions == ['rectangle']
    assert set(images) == {'path', 'memory', 'buffer'}
    assert channels == ['color']


@pytest.mark.parametrize('arguments, expected', [
    (['--preset', 'no_such'], 'no_such'),
    (['--config', 'no_such.yaml'], 'no_such.yaml'),
])
def test_main_tells_the_client_that_its_settings_are_wrong(
        arguments, expected, monkeypatch, capsys):
    library = FakeLibrary(Handle(start((1, 1, 2, 2))))
    monkeypatch.setitem(sys.modules, 'trax', library)
    assert trax.main(arguments) == 1
    assert expected in library.handle.reasons[0]
    assert expected in capsys.readouterr().err


def test_main_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, 'trax', None)
    assert trax.main([]) == 2
    assert "pip install 'lmsco_ros[vot]'" in capsys.readouterr().err

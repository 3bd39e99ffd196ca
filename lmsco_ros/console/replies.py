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

"""What a browser is told: JSON, and frames with their state in one message."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
import json
import math
import struct
from typing import Any

import numpy as np

from lmsco_ros.console.chronicle import Event
from lmsco_ros.console.desk import Desk
from lmsco_ros.console.moments import Moment
from lmsco_ros.console.picture import PALETTES
from msg_adapters.state import State
from msg_adapters.status import FrameStatus, Reading

_SHOWN_MESSAGE = 400
# Of what else is told of a frame, as a start that is refused, the number is another target's.
_WITH_TARGET = ('tracking', 'uncertain', 'lost', 'marked', 'interpolated')


def greeting(desk: Desk) -> str:
    """Return what a page is told first: what it may do, and what happened before."""
    return _text({
        'type': 'hello', 'is_recording': desk.marker is not None, 'length': desk.length,
        'can_record': desk.recorded is not None, 'read_only': desk.read_only,
        'topic': desk.image_topic, 'palettes': list(PALETTES),
        'strip': [asdict(sample) for sample in desk.chronicle.strip()]})


def answer(done: bool, text: str) -> str:
    """Return the answer to something that was asked for."""
    return _text({'type': 'answer', 'done': done, 'text': text[:_SHOWN_MESSAGE]})


def silence(desk: Desk, events: Iterable[Event]) -> str:
    """Return what is sent in place of a frame when none comes."""
    return _text({'type': 'silence', 'seconds': desk.images.silence, 'topic': desk.image_topic,
                  'events': [asdict(event) for event in events]})


def frame(moment: Moment, picture: bytes, desk: Desk, events: Iterable[Event],
          delay: float | None, asked: str) -> bytes:
    """
    Return a frame: the length of the state (4 bytes, big-endian), the state, the picture.

    Parameters
    ----------
    moment : Moment
        What is shown.
    picture : bytes
        JPEG file.
    desk : Desk
        For the rates.
    events : iterable of Event
        That the page does not know yet.
    delay : float or None
        Seconds from the arrival of the last frame until it was on the screen.
    asked : str
        The kind of request that it answers.

    """
    height, width = moment.image.shape[:2]
    selected = moment.statuses[0] if moment.statuses else None
    state = _text({
        'type': 'frame', 'asked': asked, 'number': moment.number, 'stamp': str(moment.stamp),
        'width': width, 'height': height,
        'selected': selected.track_id if selected is not None else 0,
        'state': selected.state if selected is not None else '',
        'message': selected.message[:_SHOWN_MESSAGE] if selected is not None else '',
        'targets': [_target(status, moment) for status in moment.statuses if status.track_id
                    and status.state in _WITH_TARGET],
        'health': {
            'image_rate': desk.images.per_second, 'answer_rate': desk.answers.per_second,
            'tracker_silence': desk.answers.silence,
            'latency_ms': selected.latency_ms if selected is not None else None,
            'tracker_ms': selected.tracker_ms if selected is not None else None,
            'recorded': desk.recorded() if desk.recorded is not None else None,
            'dropped': selected.dropped_frames if selected is not None else None,
            'delay_ms': None if delay is None else 1e3 * delay},
        'events': [asdict(event) for event in events]}).encode()
    return struct.pack('>I', len(state)) + state + picture


def _target(status: FrameStatus, moment: Moment) -> dict[str, Any]:
    box = moment.boxes.get(status.track_id)
    return {'id': status.track_id, 'state': status.state, 'score': status.score,
            'box': None if box is None else list(box), 'message': status.message[:_SHOWN_MESSAGE],
            'counts': _reading(status.target), 'celsius': _reading(status.target_celsius),
            'expected': _expected(moment.states.get(status.track_id))}


def _expected(state: State | None) -> dict[str, Any] | None:
    """
    Return where a target is expected, in pixels, and its speed in pixels per second.

    Of the ellipse in which it is with two standard deviations: half the axes, the longer one
    first, and by how much that is turned from x to y, in radians.
    """
    if state is None:
        return None
    variances, directions = np.linalg.eigh(state.covariance)
    x, y = directions[:, 1]
    return {'center': list(state.center), 'speed': math.hypot(*state.velocity),
            'axes': [float(axis) for axis in 2 * np.sqrt(np.maximum(variances[::-1], 0))],
            'turn': math.atan2(y, x)}


def _reading(reading: Reading | None) -> dict[str, float] | None:
    return None if reading is None else reading._asdict()


def _text(fields: dict[str, Any]) -> str:
    """Return JSON as browsers read it, which have no NaN."""
    return json.dumps(_finite(fields), separators=(',', ':'))


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    return [_finite(each) for each in value] if isinstance(value, list) else value

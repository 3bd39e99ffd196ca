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

"""A bag from images, so that anybody can try the node on a file."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
import re
import sys

import numpy as np
import numpy.typing as npt
from rosbags.typesys import get_typestore, Stores
from rosbags.typesys.store import Typestore

from lmsco_ros.replay.bag_images import RAW
from lmsco_ros.replay.bags.output import BagOutput
from lmsco_ros.replay.bags.stamps import END_OF_TIME
from lmsco_ros.replay.errors import OutputError
from lmsco_ros.replay.frame import RecordedFrame
from lmsco_ros.replay.storage import Storage

_ENCODINGS = {(np.dtype(np.uint8), 2): 'mono8', (np.dtype(np.uint16), 2): 'mono16',
              (np.dtype(np.float32), 2): '32FC1', (np.dtype(np.uint8), 3): 'bgr8'}
_TOPIC = re.compile(r'(/[A-Za-z_][A-Za-z0-9_]*)+')
_LONGEST_TOPIC = 247


def make_bag(frames: Iterable[RecordedFrame], path: Path, *, topic: str, frame_id: str,
             storage: Storage, start_ns: int) -> int:
    """
    Write frames into a new bag and return how many there were; see `write_frames`.

    Parameters
    ----------
    frames : iterable of RecordedFrame
        8 bit becomes mono8 or bgr8, 16 bit mono16, float 32FC1.
    path : Path
        The bag's folder; it must not exist.
    topic, frame_id : str
        Where the images appear, and in which coordinate frame.
    storage : Storage
        File format.
    start_ns : int
        Added to the stamps of the frames, in nanoseconds.

    Raises
    ------
    OutputError
        When the bag cannot be created or written.

    """
    return write_frames(frames, BagOutput(path, storage), topic=topic, frame_id=frame_id,
                        start_ns=start_ns)


def write_frames(frames: Iterable[RecordedFrame], output: BagOutput, *, topic: str, frame_id: str,
                 start_ns: int) -> int:
    """
    Write frames as sensor_msgs/Image into a bag and return how many there were.

    When the frames break off, by an error or by a signal, those before are kept.

    Parameters
    ----------
    frames : iterable of RecordedFrame
        8 bit becomes mono8 or bgr8, 16 bit mono16, float 32FC1.
    output : BagOutput
        The bag, not opened yet.
    topic, frame_id : str
        Where the images appear, and in which coordinate frame.
    start_ns : int
        Added to the stamps of the frames, in nanoseconds.

    Raises
    ------
    OutputError
        When the bag cannot be created or written, or the topic is none that ROS can play.

    """
    name = _full_topic(topic)
    store = get_typestore(Stores.ROS2_JAZZY)
    with output:
        connection = output.add_connection(name, RAW, typestore=store)
        for frame in frames:
            stamp = start_ns + frame.stamp_ns
            message = image_message(store, frame.image, stamp, frame_id)
            output.write(connection, stamp, store.serialize_cdr(message, RAW))
            output.keep_from_now_on()
    return output.count


def _full_topic(topic: str) -> str:
    """Return the name of a topic from its root on."""
    name = '/' + topic.lstrip('/')
    if not _TOPIC.fullmatch(name) or len(name) > _LONGEST_TOPIC:
        raise OutputError(
            f'"{topic[:_LONGEST_TOPIC]}" is no name of a topic; expected names of letters, digits '
            'and underscores between slashes, none of which begins with a digit, and at most '
            f'{_LONGEST_TOPIC} characters')
    return name


def image_message(store: Typestore, image: npt.NDArray, stamp_ns: int, frame_id: str) -> object:
    """Return a sensor_msgs/Image of the type store, which needs no ROS, with `image`."""
    types = store.types
    encoding = _ENCODINGS.get((image.dtype, image.ndim))
    if encoding is None:
        raise OutputError(f'no message holds an image of shape {image.shape} and type '
                          f'{image.dtype}; use 8 or 16 bit gray, or 8 bit color')
    if not 0 <= stamp_ns < END_OF_TIME:
        raise OutputError(f'no message holds the stamp {stamp_ns * 1e-9:.3f} s; expected one '
                          'from 1970 to 2038: check the times of the source')
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    pixels = np.ascontiguousarray(image)
    return types[RAW](
        header=types['std_msgs/msg/Header'](
            stamp=types['builtin_interfaces/msg/Time'](sec=seconds, nanosec=nanoseconds),
            frame_id=frame_id),
        height=image.shape[0], width=image.shape[1], encoding=encoding,
        is_bigendian=int(sys.byteorder == 'big'), step=pixels.strides[0],
        data=pixels.view(np.uint8).reshape(-1))

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

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
import shutil
import sys

import numpy as np
import numpy.typing as npt
from rosbags.rosbag2 import StoragePlugin, Writer, WriterError
from rosbags.typesys import get_typestore, Stores
from rosbags.typesys.store import Typestore

from lmsco_ros.replay.bag_images import RAW
from lmsco_ros.replay.errors import OutputError
from lmsco_ros.replay.frame import Frame
from lmsco_ros.replay.storage import Storage

_ENCODINGS = {(np.dtype(np.uint8), 2): 'mono8', (np.dtype(np.uint16), 2): 'mono16',
              (np.dtype(np.float32), 2): '32FC1', (np.dtype(np.uint8), 3): 'bgr8'}


@contextmanager
def create_bag(path: Path, storage: Storage) -> Iterator[Writer]:
    """
    Create a bag that does not exist yet; it is finished also when the user interrupts.

    Raises
    ------
    OutputError
        When there is something already, or the place cannot be written to.

    """
    plugin = {Storage.MCAP: StoragePlugin.MCAP, Storage.SQLITE3: StoragePlugin.SQLITE3}[storage]
    require_free(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        writer = Writer(path, version=9, storage_plugin=plugin)
        writer.open()
    except (OSError, WriterError) as error:
        raise OutputError(f'{path} cannot be created ({error}); '
                          'choose a place that can be written to') from error
    try:
        yield writer
    except Exception:
        # Half a bag is no use, and would stand in the way of the next try.
        writer.close()
        shutil.rmtree(path)
        raise
    except BaseException:
        writer.close()
        raise
    writer.close()


def require_free(path: Path) -> None:
    """
    Check that a new bag can be called `path`.

    Raises
    ------
    OutputError
        When there is something already.

    """
    if path.exists():
        raise OutputError(f'{path} exists; choose another output, or remove it')


def make_bag(frames: Iterable[Frame], path: Path, *, topic: str, frame_id: str,
             storage: Storage, start_ns: int) -> int:
    """
    Write frames as sensor_msgs/Image and return how many there were.

    Parameters
    ----------
    frames : iterable of Frame
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
        When the bag cannot be created.

    """
    store = get_typestore(Stores.ROS2_JAZZY)
    count = 0
    with create_bag(path, storage) as writer:
        connection = writer.add_connection('/' + topic.lstrip('/'), RAW, typestore=store)
        for frame in frames:
            stamp = start_ns + frame.stamp_ns
            message = image_message(store, frame.image, stamp, frame_id)
            writer.write(connection, stamp, store.serialize_cdr(message, RAW))
            count += 1
    return count


def image_message(store: Typestore, image: npt.NDArray, stamp_ns: int, frame_id: str) -> object:
    """Return a sensor_msgs/Image of the type store, which needs no ROS, with `image`."""
    types = store.types
    encoding = _ENCODINGS.get((image.dtype, image.ndim))
    if encoding is None:
        raise OutputError(f'no message holds an image of shape {image.shape} and type '
                          f'{image.dtype}; use 8 or 16 bit gray, or 8 bit color')
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    pixels = np.ascontiguousarray(image)
    return types[RAW](
        header=types['std_msgs/msg/Header'](
            stamp=types['builtin_interfaces/msg/Time'](sec=seconds, nanosec=nanoseconds),
            frame_id=frame_id),
        height=image.shape[0], width=image.shape[1], encoding=encoding,
        is_bigendian=int(sys.byteorder == 'big'), step=pixels.strides[0],
        data=pixels.view(np.uint8).reshape(-1))

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

"""An image as the middleware handed it over, and when to leave one with the middleware."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CompressedImage, Image

from lmsco_ros.core.errors import ImageError
from lmsco_ros.node.crop import Crop
from msg_adapters.errors import MessageError


# A message is held so often at once while it is made.
_COPIES = 3


@dataclass(frozen=True, eq=False)
class ReceivedImage:
    """
    A message as it came over the wire.

    rclpy hands the bytes over as an object of their own, and every reading makes a message of
    them anew: nobody else writes its memory, and pixels may be read out of it without a copy.

    Parameters
    ----------
    serialized : bytes
        As received.
    kind : type
        Image or CompressedImage.
    decode : callable
        Turns the message into pixels.
    crop : Crop
        Edges that the tracker does not see.

    """

    serialized: bytes
    kind: type[Image] | type[CompressedImage]
    decode: Callable[[Any], npt.NDArray]
    crop: Crop

    @property
    def nbytes(self) -> int:
        """Size of the message, in bytes."""
        return len(self.serialized)

    def read(self) -> npt.NDArray:
        """
        Decode the message; takes as long as that takes.

        Raises
        ------
        ImageError
            When the message does not hold an image that can be used.
        MemoryError
            When there is not enough memory for it.

        """
        # The generated code of the messages ends the process where memory is short.
        np.empty(_COPIES * self.nbytes, np.uint8)
        message = deserialize_message(self.serialized, self.kind)
        try:
            return self.crop.trim(self.decode(message))
        except MessageError as error:
            raise ImageError(str(error)) from error


class WhileThereIsRoom(MutuallyExclusiveCallbackGroup):
    """
    Leaves images with the middleware while there is no room for them.

    The executor does not wait for them, and does its other work. It has to be woken when
    there is room again.

    Parameters
    ----------
    has_room : callable
        Tells whether another image can be taken.

    """

    def __init__(self, has_room: Callable[[], bool]) -> None:
        super().__init__()
        self._has_room = has_room

    def can_execute(self, entity: object) -> bool:
        """Tell the executor whether to take what has come in."""
        return self._has_room() and super().can_execute(entity)

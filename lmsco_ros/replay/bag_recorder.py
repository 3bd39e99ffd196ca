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

"""What the node said, beside the messages of the bag that it heard."""

from __future__ import annotations

from rosbags.typesys import get_typestore, Stores

from lmsco_ros.replay.bags.channel import Channel
from lmsco_ros.replay.bags.copies import copy_channels
from lmsco_ros.replay.bags.output import BagOutput
from lmsco_ros.replay.bags.reader import BagReader
from lmsco_ros.replay.node_session import Heard, NODE_NAME, OUTPUTS


class BagRecorder:
    """
    Writes the original messages and what the node says.

    Answers come after their image by what the node took, on the clock of the recording:
    at twice the rate twice as much of it passes, at rate 0 none.

    Parameters
    ----------
    output : BagOutput
        The new bag, open.
    reader : BagReader
        The bag that is played.
    outputs : tuple of str
        What to record of the node.
    rate : float
        Speed relative to the recording.

    """

    def __init__(self, output: BagOutput, reader: BagReader, outputs: tuple[str, ...],
                 rate: float) -> None:
        self._output = output
        self._rate = rate
        self._logged: dict[int, int] = {}
        store = get_typestore(Stores.ROS2_JAZZY)
        topics = {name: f'/{NODE_NAME}/{name}' for name in outputs}
        self._answers = {
            name: output.add_connection(topic, _type_name(OUTPUTS[name]), typestore=store)
            for name, topic in topics.items()}
        # Answers of an earlier replay make room for ours.
        self._copies = copy_channels(output, [channel for channel in reader.channels
                                              if channel.topic not in topics.values()])

    def copy(self, channel: Channel, logged: int, data: bytes) -> None:
        """Write an original message."""
        if channel in self._copies:
            self._output.write(self._copies[channel], logged, data)

    def copy_image(self, channel: Channel, logged: int, data: bytes, stamp: int) -> None:
        """Write the image with `stamp`, which the node is going to answer."""
        self._logged[stamp] = logged
        self.copy(channel, logged, data)

    def record(self, heard: Heard, stamp: int, seconds: float) -> None:
        """Write what the node says about the image with `stamp`, `seconds` after it."""
        # One more, for viewers that would sort what comes at the same time.
        moment = self._logged[stamp] + round(1e9 * self._rate * seconds) + 1
        self._output.write(self._answers[heard.output], moment, heard.data)


def _type_name(message_type: type) -> str:
    """Return the name of a message class, such as std_msgs/msg/Header."""
    return f'{message_type.__module__.split(".")[0]}/msg/{message_type.__name__}'

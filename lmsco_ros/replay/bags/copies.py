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

"""Channels of one bag in another."""

from __future__ import annotations

from collections.abc import Iterable

from rosbags.interfaces import Connection
from rosbags.typesys import get_types_from_idl, get_types_from_msg, get_typestore, Stores

from lmsco_ros.replay.bags.channel import Channel
from lmsco_ros.replay.bags.output import BagOutput

_IDL_START = f'{"=" * 80}\nIDL: '
# Of a type that is not known; readers compare a digest only with what they can compute.
_NO_DIGEST = f'RIHS01_{"0" * 64}'


def copy_channels(output: BagOutput, channels: Iterable[Channel]) -> dict[Channel, Connection]:
    """
    Add channels to a bag as they were: type definition, quality of service and all.

    Channels that differ in nothing, such as those of split files, become one.

    Parameters
    ----------
    output : BagOutput
        The open bag.
    channels : iterable of Channel
        What is to be copied.

    Returns
    -------
    dict
        What to write the messages of each channel to.

    """
    made: dict[tuple, Connection] = {}
    copies = {}
    for channel in channels:
        key = (channel.topic, channel.msgtype, channel.serialization, channel.qos)
        if key not in made:
            definition = channel.definition or _known_definition(channel.msgtype)
            made[key] = output.add_connection(
                channel.topic, channel.msgtype, msgdef=definition,
                rihs01=channel.digest or _digest(definition, channel.msgtype),
                serialization_format=channel.serialization, offered_qos_profiles=channel.qos)
        copies[channel] = made[key]
    return copies


def _known_definition(msgtype: str) -> str:
    """Return the definition of a type that ROS has; of another, nothing."""
    store = get_typestore(Stores.ROS2_JAZZY)
    if msgtype not in store.fielddefs:
        return ''
    return store.generate_msgdef(msgtype, ros_version=2)[0]


def _digest(definition: str, msgtype: str) -> str:
    """Return what identifies a message type, as far as its definition can be read."""
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(get_types_from_idl(definition) if definition.startswith(_IDL_START)
                       else get_types_from_msg(definition, msgtype))
        return store.hash_rihs01(msgtype)
    # Definitions of others may be anything, and are copied all the same.
    except Exception:  # noqa: B902
        return _NO_DIGEST

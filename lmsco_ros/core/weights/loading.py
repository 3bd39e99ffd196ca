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

"""The networks that a configuration asks for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import cast, TYPE_CHECKING

from lmsco_ros.core.config import NETWORK_KINDS, TrackerConfig

if TYPE_CHECKING:
    from lmsco_ros.core.networks.backbone import Backbone
    from lmsco_ros.core.networks.extent import ExtentNet

__all__ = ['load_networks', 'Networks']


@dataclass(frozen=True)
class Networks:
    """
    Networks in memory; None where the configuration needs none.

    Attributes
    ----------
    appearance, motion : Backbone or None
        Behind the feature channels of that kind.
    extent : ExtentNet or None
        Measures the extent of a target.

    """

    appearance: Backbone | None = None
    motion: Backbone | None = None
    extent: ExtentNet | None = None


def load_networks(config: TrackerConfig) -> Networks:
    """
    Load the networks that a configuration needs; torch is imported only if there is one.

    Raises
    ------
    WeightsError
        When weights are missing or damaged; says how to get them.

    """
    wanted = {'appearance': config.networks.appearance_backbone,
              'motion': config.networks.motion_backbone}
    used = {group.kind for block in config.features for group in block.channels}
    names = {kind: wanted[kind] for kind in NETWORK_KINDS if kind in used}
    if config.extent.network:
        names['extent'] = config.extent.network
    if not names:
        return Networks()
    from lmsco_ros.core.weights.store import load_backbone

    folder = Path(config.networks.directory) if config.networks.directory else None
    found = {kind: load_backbone(name, folder) for kind, name in names.items()}
    return Networks(found.get('appearance'), found.get('motion'),
                    cast('ExtentNet | None', found.get('extent')))

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

"""What the tracker sees with: channels, networks and optical flow."""

from __future__ import annotations

from dataclasses import dataclass

from lmsco_ros.core.config.validation import check_choice, check_range, shown
from lmsco_ros.core.errors import ConfigError

__all__ = ['ChannelConfig', 'FeatureConfig', 'MOTION_KINDS', 'MotionConfig', 'NETWORK_KINDS',
           'NetworkConfig']

NETWORK_KINDS = ('appearance', 'motion')
"""Kinds of channels that are layers of a network."""

MOTION_KINDS = ('motion', 'flow')
"""Kinds of channels that show motion, and nothing in the first frame."""


@dataclass(frozen=True)
class ChannelConfig:
    """
    A group of feature channels, normalized on its own.

    Attributes
    ----------
    kind : {'hog', 'intensity', 'appearance', 'motion', 'flow'}
        What the channels are; `appearance` and `motion` are a layer of the network that
        `NetworkConfig.appearance_backbone` or `motion_backbone` names, `flow` is the optical
        flow itself.
    weight : float
        Factor on the normalized channels.
    power : float
        Exponent on the length of each cell's feature vector: 1 keeps it, below 1 dims the cells
        that stand out most, so that a bright neighbor does not drown the target.
    layer : str
        Layer of the network, by its own name or as `shallow` or `deep`; averaged over the cell
        of the block where its own cells are smaller.

    """

    kind: str
    weight: float = 1.0
    power: float = 1.0
    layer: str = ''

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_choice(self, 'kind', ('hog', 'intensity', *NETWORK_KINDS, 'flow'))
        check_range(self, 'weight', 0, 100, open_low=True)
        check_range(self, 'power', 0, 1)
        if bool(self.layer) != (self.kind in NETWORK_KINDS):
            raise ConfigError(f'ChannelConfig.layer is {shown(self.layer)} for kind '
                              f'{self.kind!r}; expected a layer such as shallow or deep for '
                              f'{" and ".join(NETWORK_KINDS)}, none for the others')


@dataclass(frozen=True)
class FeatureConfig:
    """
    One block: groups of channels on a common grid.

    Attributes
    ----------
    channels : tuple of ChannelConfig
        The groups.
    cell : int
        Side of a cell in patch pixels.
    projection : int
        Channels that are left after a projection to the principal components of the first
        sample; 0 keeps all.

    """

    channels: tuple[ChannelConfig, ...]
    cell: int = 4
    projection: int = 0

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not self.channels:
            raise ConfigError('FeatureConfig.channels is empty; name at least one group, '
                              'for instance {kind: hog}')
        check_range(self, 'cell', 1, 32)
        check_range(self, 'projection', 0, 4096)


@dataclass(frozen=True)
class NetworkConfig:
    """
    Networks behind the feature channels.

    Attributes
    ----------
    appearance_backbone, motion_backbone : str
        Names of weights; `lmsco weights list` shows them all.
    directory : str
        Folder of weights that the package does not bring, or brings otherwise trained; empty for
        the user's cache.

    """

    appearance_backbone: str = 'thermal'
    motion_backbone: str = 'thermal_flow'
    directory: str = ''


@dataclass(frozen=True)
class MotionConfig:
    """
    Optical flow between two frames.

    Attributes
    ----------
    remove_camera_motion : bool
        Whether the motion that most of the search region shares is taken out.
    least_motion : float
        Pixels of the patch that the fastest hundredth has to move, or else nothing does and the
        motion channels are left out.

    """

    remove_camera_motion: bool = True
    least_motion: float = 0.3

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_range(self, 'least_motion', 0, 100)

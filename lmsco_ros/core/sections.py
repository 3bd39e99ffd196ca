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

"""Sections of the tracker's configuration: frozen and validated."""

from __future__ import annotations

from dataclasses import dataclass

from lmsco_ros.core.errors import ConfigError
from lmsco_ros.core.validation import check_choice, check_range

__all__ = [
    'ChannelConfig', 'ConfidenceConfig', 'FeatureConfig', 'IntensityConfig', 'LearningConfig',
    'MotionConfig', 'NETWORK_KINDS', 'NetworkConfig', 'RuntimeConfig', 'SamplingConfig',
    'ScaleConfig', 'VerificationConfig',
]

NETWORK_KINDS = ('appearance', 'motion')
"""Kinds of channels that are layers of a network."""

_LARGEST_SCALE = 4.0


@dataclass(frozen=True)
class IntensityConfig:
    """
    From counts to the working range.

    Attributes
    ----------
    low_percentile, high_percentile : float
        Percentiles of the frame that become 0 and 1.
    smoothing : float
        Part of the way that the range follows a small change in one frame, in (0, 1].
    jump : float
        Change, as a part of the range, above which the range is adopted at once.

    """

    low_percentile: float = 1.0
    high_percentile: float = 99.0
    smoothing: float = 0.2
    jump: float = 0.1

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_range(self, 'low_percentile', 0, 49)
        check_range(self, 'high_percentile', 51, 100)
        check_range(self, 'smoothing', 0, 1, open_low=True)
        check_range(self, 'jump', 0, 1)


@dataclass(frozen=True)
class SamplingConfig:
    """
    The search region and its patch.

    Attributes
    ----------
    search_factor : float
        Side of the square search region over sqrt(target width * height).
    patch_size_min, patch_size_max : int
        Limits of the side of the patch, in pixels, into which the search region is resampled;
        the nearest size that fits the cells and the Fourier transform is taken.

    """

    search_factor: float = 5.0
    patch_size_min: int = 140
    patch_size_max: int = 140

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_range(self, 'search_factor', 1.5, 10)
        check_range(self, 'patch_size_min', 32, 1024)
        check_range(self, 'patch_size_max', self.patch_size_min, 1024)


@dataclass(frozen=True)
class ChannelConfig:
    """
    A group of feature channels, normalized on its own.

    Attributes
    ----------
    kind : {'hog', 'intensity', 'appearance', 'motion'}
        What the channels are; the last two are a layer of the network that
        `NetworkConfig.appearance_backbone` or `motion_backbone` names.
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
        check_choice(self, 'kind', ('hog', 'intensity', *NETWORK_KINDS))
        check_range(self, 'weight', 0, 100, open_low=True)
        check_range(self, 'power', 0, 1)
        if bool(self.layer) != (self.kind in NETWORK_KINDS):
            raise ConfigError(f'ChannelConfig.layer is {self.layer!r} for kind {self.kind!r}; '
                              f'expected a layer such as shallow or deep for '
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


@dataclass(frozen=True)
class LearningConfig:
    """
    Training of the structured correlation filter.

    Attributes
    ----------
    anchor : {'unit', 'coupled', 'frozen'}
        Reading of s(y0) in the margin; `frozen` is the literal (11)-(12) and diverges.
    solve : {'joint', 'per_block'}
        One problem for all blocks, or one for each.
    core : float
        Label above which the unit anchor's loss is two-sided; 0 is ridge regression.
    margin_weight : float
        C of the paper's (7).
    label_sigma : float
        Standard deviation of the label over sqrt(target width * height).
    window_minimum, window_edge : float
        Spatial window at the center of the target and in the middle of its sides.
    window_sparsity : float
        Window coefficients below this part of the largest are dropped.
    memory_size : int
        Training samples kept.
    learning_rate : float
        Of the prior weights of the samples.
    initial_iterations : int
        Outer iterations in the first frame.
    iterations : int
        Outer iterations of an update.
    gradient_steps : int
        Conjugate gradient steps in each outer iteration.
    update_interval : int
        Frames between two updates; every frame is stored.

    """

    anchor: str = 'unit'
    solve: str = 'joint'
    core: float = 0.5
    margin_weight: float = 1.0
    label_sigma: float = 1 / 12
    window_minimum: float = 0.02
    window_edge: float = 0.06
    window_sparsity: float = 0.05
    memory_size: int = 30
    learning_rate: float = 0.01
    initial_iterations: int = 30
    iterations: int = 3
    gradient_steps: int = 2
    update_interval: int = 5

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_choice(self, 'anchor', ('unit', 'coupled', 'frozen'))
        check_choice(self, 'solve', ('joint', 'per_block'))
        check_range(self, 'core', 0, 1)
        check_range(self, 'margin_weight', 0, 1e6, open_low=True)
        check_range(self, 'label_sigma', 0, 1, open_low=True)
        check_range(self, 'window_minimum', 0, 1e3, open_low=True)
        check_range(self, 'window_edge', self.window_minimum, 1e3)
        check_range(self, 'window_sparsity', 0, 1)
        check_range(self, 'memory_size', 1, 1000)
        check_range(self, 'learning_rate', 0, 0.5)
        for name in ('initial_iterations', 'iterations', 'gradient_steps', 'update_interval'):
            check_range(self, name, 1, 1000)


@dataclass(frozen=True)
class ScaleConfig:
    """
    How the size of the target is followed.

    Attributes
    ----------
    estimator : {'filter', 'search', 'none'}
        One-dimensional scale filter (DSST), search over scaled patches (the paper), or a
        constant size.
    step : float
        Ratio of two neighboring scales.
    exponent_min, exponent_max : int
        Range of the exponents of `step`.
    learning_rate : float
        Of the scale filter, which learns in the frames in which the filter is trained.
    slow_rate, slow_share : float
        Learning rate of the scale filter that holds on to the first frames, and its share in
        the response.
    model_area : float
        Area of a scale sample in pixels.
    padding : float
        Side of a scale sample over that of the target.
    regularization : float
        Ridge term of the scale filter.
    label_sigma : float
        Standard deviation of its label, in scales.

    """

    estimator: str = 'filter'
    step: float = 1.02
    exponent_min: int = -8
    exponent_max: int = 8
    learning_rate: float = 0.12
    slow_rate: float = 0.01
    slow_share: float = 0.0
    model_area: float = 512.0
    padding: float = 1.0
    regularization: float = 0.01
    label_sigma: float = 1.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_choice(self, 'estimator', ('filter', 'search', 'none'))
        check_range(self, 'step', 1, 2, open_low=True)
        check_range(self, 'exponent_min', -50, 0)
        check_range(self, 'exponent_max', 0, 50)
        check_range(self, 'learning_rate', 0, 1)
        check_range(self, 'slow_rate', 0, 1)
        check_range(self, 'slow_share', 0, 1)
        check_range(self, 'model_area', 64, 65536)
        check_range(self, 'padding', 1, 4)
        check_range(self, 'regularization', 0, 100, open_low=True)
        check_range(self, 'label_sigma', 0, 50, open_low=True)
        reach = self.step**max(self.exponent_max, -self.exponent_min)
        if reach > _LARGEST_SCALE:
            raise ConfigError(f'ScaleConfig.step and its exponents reach a factor of {reach:g} '
                              f'from one frame to the next; expected at most {_LARGEST_SCALE:g}')


@dataclass(frozen=True)
class VerificationConfig:
    """
    Comparison of what is found with the first frame.

    Attributes
    ----------
    backbone : str
        Name of the weights of the network that compares; empty for no comparison.

    """

    backbone: str = ''


@dataclass(frozen=True)
class ConfidenceConfig:
    """
    When the target counts as lost and as found again.

    Attributes
    ----------
    learn : {'tracking', 'always'}
        Whether the box follows and the filter learns only what is believed, or every frame, as
        in the paper, whatever the state says.
    reference_frames : int
        Frames after the start whose median sharpness is the measure of all later ones.
    uncertain, certain : float
        Score below which TRACKING becomes UNCERTAIN, and from which UNCERTAIN becomes TRACKING
        again.
    lost : float
        Score below which a frame is not believed; after a jump by more than the target's side,
        `uncertain` is.
    lost_frames : int
        Frames in a row that are not believed until the state is LOST.
    found : float
        Score from which a target is found again, or found where it was not expected.
    sharp, alike : float
        Sharpness, as a part of the reference, and score of the first frame's filter, as a part
        of that in the first frame, that a target has to reach for this.
    candidates, tiles : int
        Salient places, and other regions of the image, that are searched per frame while the
        target is missing.
    distractors : bool
        Whether other peaks of the score are remembered, so that they do not take the place of
        a target that vanishes.

    """

    learn: str = 'tracking'
    reference_frames: int = 10
    uncertain: float = 0.7
    certain: float = 0.75
    lost: float = 0.3
    lost_frames: int = 5
    found: float = 0.9
    sharp: float = 0.4
    alike: float = 0.3
    candidates: int = 4
    tiles: int = 2
    distractors: bool = True

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_choice(self, 'learn', ('tracking', 'always'))
        check_range(self, 'reference_frames', 1, 1000)
        check_range(self, 'lost', 0, 1)
        check_range(self, 'uncertain', self.lost, 1)
        check_range(self, 'certain', self.uncertain, 1)
        check_range(self, 'found', self.lost, 1)
        check_range(self, 'sharp', 0, 2)
        check_range(self, 'alike', -1, 2)
        check_range(self, 'lost_frames', 1, 1000)
        check_range(self, 'candidates', 0, 64)
        check_range(self, 'tiles', 0, 64)


@dataclass(frozen=True)
class RuntimeConfig:
    """
    Where the tracker computes.

    Attributes
    ----------
    device : str
        'cpu', 'cuda' or 'cuda:N'.
    threads : int
        Threads of the numerical libraries in this process.

    """

    device: str = 'cpu'
    threads: int = 1

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_range(self, 'threads', 1, 256)

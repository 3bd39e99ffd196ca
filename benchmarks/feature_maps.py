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

"""
Look at what the tracker sees: channels of its first block and its confidence map.

    python -m benchmarks.feature_maps DATASET SEQUENCE [--preset NAME] [--frame N] [--output PNG]

SEQUENCE is a name such as vot_tir/crowd. The tracker starts on the first frame; drawn is frame N
with its box, the search region as the features see it, the strongest channels, and the map.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from matplotlib.figure import Figure
import numpy as np
import numpy.typing as npt

from lmsco_ros.core import BoundingBox, LMSCOTracker, TrackerConfig, TrackResult
from lmsco_ros.core.backend import select_backend, to_numpy
from lmsco_ros.core.features.extractor import FeatureExtractor
from lmsco_ros.core.fourier.series import grid_size, synthesize
from lmsco_ros.core.imaging.gain import AutomaticGain
from lmsco_ros.core.imaging.regions import patch_size
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.weights.loading import load_networks
from lmsco_ros.evaluation.datasets import scan_dataset, TrackingSequence

CHANNELS = 10


def track(sequence: TrackingSequence, config: TrackerConfig, frame: int) -> TrackResult:
    """Return the result of a tracker that was started on the first frame."""
    tracker = LMSCOTracker(config)
    result = tracker.initialize(sequence.frames[0], BoundingBox(*sequence.ground_truth[0]))
    for index in range(1, frame + 1):
        result = tracker.update(sequence.frames[index])
    return result


def first_block(patch: npt.NDArray[np.float32], config: TrackerConfig) -> npt.NDArray:
    """Return the channels of the first block, (N, N, C), windowed, the strongest first."""
    backend = select_backend('cpu')
    extractor = FeatureExtractor(config, load_networks(config), patch.shape[0], backend)
    series = extractor(patch[None])[0][:, :, 0, :]
    values = to_numpy(synthesize(series, grid_size(series.shape[1] - 1)))
    return values[:, :, np.argsort(-np.mean(values**2, axis=(0, 1)))]


def draw(image: npt.NDArray, result: TrackResult, patch: npt.NDArray, channels: npt.NDArray,
         output: Path) -> None:
    """Draw frame, patch, channels and map into one picture."""
    figure = Figure(figsize=(14, 5), layout='constrained')
    axes = figure.subplots(2, 2 + CHANNELS // 2, width_ratios=[1.6, 1, *[1] * (CHANNELS // 2)])
    axes[0, 0].imshow(image, cmap='gray')
    for box, color in ((result.box, 'lime'), (result.search_region, 'orange')):
        x, y, width, height = box.as_tuple()
        axes[0, 0].plot([x, x + width, x + width, x, x], [y, y, y + height, y + height, y],
                        color=color)
    axes[0, 0].set_title(f'{result.state.name}, score {result.score:.2f}')
    axes[1, 0].imshow(result.confidence_map)
    axes[1, 0].set_title(f'confidence map, maximum {result.confidence_map.max():.2f}')
    axes[0, 1].imshow(patch, cmap='gray')
    axes[0, 1].set_title('search region')
    axes[1, 1].imshow(np.sqrt(np.mean(channels**2, axis=-1)))
    axes[1, 1].set_title(f'energy of {channels.shape[-1]} channels')
    for axis, channel in zip(axes[:, 2:].flat, np.moveaxis(channels, -1, 0)):
        axis.imshow(channel, cmap='coolwarm', vmin=-np.abs(channel).max(),
                    vmax=np.abs(channel).max())
    for axis in axes.flat:
        axis.set_axis_off()
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=100)


def main() -> None:
    """Draw the picture that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('dataset', type=Path)
    parser.add_argument('sequence')
    parser.add_argument('--preset', default='default')
    parser.add_argument('--frame', type=int, default=20)
    parser.add_argument('--output', type=Path, default=Path('output/feature_maps.png'))
    options = parser.parse_args()
    found = {item.full_name: item for item in scan_dataset(options.dataset).sequences}
    if options.sequence not in found:
        parser.error(f'there is no sequence {options.sequence}; there are {", ".join(found)}')
    sequence, config = found[options.sequence], TrackerConfig.preset(options.preset)
    result = track(sequence, config, options.frame)
    image = sequence.frames[options.frame]
    view = FrameView(image, AutomaticGain(config.intensity).observe(image))
    size = patch_size(result.box.size, config.sampling, config.cell)
    patch = view.patch(result.search_region, (size, size))
    draw(image, result, patch, first_block(patch, config), options.output)


if __name__ == '__main__':
    main()

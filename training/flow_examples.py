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

"""Drawing of flow images: what has moved around one target, at several moments."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lmsco_ros.core.config import MotionConfig, SamplingConfig
from lmsco_ros.core.features.motion import MotionObserver
from lmsco_ros.core.imaging.regions import region_around
from training.examples import Example, jitter, offset_of, Spread
from training.sources import Clip

__all__ = ['FlowSource']

_TRIES = 8


class FlowSource:
    """
    Draws examples at random, from clips in which the target moves by itself.

    Parameters
    ----------
    clips : sequence of Clip
        Real motion.
    size : int
        Side of the patches.
    factor : float
        Side of a region over sqrt(width * height) of its target.

    """

    def __init__(self, clips: Sequence[Clip], size: int, factor: float) -> None:
        self._clips = clips
        self._size = size
        self._sampling = SamplingConfig(search_factor=factor)

    def draw(self, count: int, known: Spread, searched: Spread,
             rng: np.random.Generator) -> Example:
        """Return an example of `count` flow images of one clip; as `ExampleSource.draw`."""
        while True:
            clip = self._clips[rng.integers(len(self._clips))]
            spreads = [known] * (count - 1) + [searched]
            views = [self._moment(clip, spread, rng) for spread in spreads]
            found = [view for view in views if view is not None]
            if len(found) == count:
                images, offsets = zip(*found, strict=True)
                return Example(np.stack(images), np.array(offsets, np.float32))

    def _moment(self, clip: Clip, spread: Spread, rng: np.random.Generator
                ) -> tuple[np.ndarray, tuple[float, float, float, float]] | None:
        """Return a flow image and where the target is in it, or None where nothing moves."""
        present = clip.present
        for _ in range(_TRIES):
            index = int(present[rng.integers(1, len(present))])
            if index - 1 not in present:
                continue
            box = clip.box(index)
            guess = jitter(box, spread, rng)
            region = region_around(guess, self._sampling)
            before, after = (clip.view(i).patch(region, (self._size,) * 2)
                             for i in (index - 1, index))
            motion = MotionObserver(MotionConfig())
            motion.remember(region, before)
            images = motion.images(region, after, (1.0,))
            if images is not None:
                side = guess.area**0.5
                return images[0], offset_of(box, guess, (side, side))
        return None

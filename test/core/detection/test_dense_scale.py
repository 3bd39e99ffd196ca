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

"""The scale filter answers as its definition does, which is computed densely here."""

from dataclasses import replace
import math

import numpy as np
import pytest

from lmsco_ros.core.config import ScaleConfig
from lmsco_ros.core.detection.scale import ScaleFilter
from lmsco_ros.core.features.hog import hog
from lmsco_ros.core.types import BoundingBox

CENTER = (83.3, 60.7)


class DenseFilter:
    """
    The scale filter from its definition: every scale is cut out and transformed on its own.

    The ridge regression of a Gaussian over scale, with full Fourier transforms.
    """

    def __init__(self, config, size):
        self.config = config
        self.offsets = np.arange(config.exponent_min, config.exponent_max + 1)
        shrink = math.sqrt(config.model_area / (size[0] * size[1]))
        self.model = [max(8, 4 * round(side * shrink / 4)) for side in size]
        self.label = np.fft.fft(np.exp(-0.5 * (self.offsets / config.label_sigma)**2))
        self.filters = None

    def spectrum(self, view, box):
        """Return the spectrum over scale of the features, which a Hann window dims."""
        top = self.config.step**self.config.exponent_max
        width, height = (math.ceil(side * top) for side in self.model)
        size = [self.config.padding * top * side for side in box.size]
        whole = view.patch(BoundingBox.from_center(box.center, size), (width, height))
        rows = []
        for offset in self.offsets:
            patch = whole
            for axis in (0, 1):
                patch = np.apply_along_axis(
                    self.zoomed, axis, patch, self.config.step**offset / top,
                    self.model[1 - axis])
            gray = patch - patch.mean()
            rows.append(np.concatenate([
                hog(patch[None].astype(np.float32), 4).ravel(),
                0.1 * gray[::2, ::2].ravel() / (patch.std() + 1e-6)]))
        window = np.sin(np.pi * np.arange(1, len(rows) + 1) / (len(rows) + 1))**2
        return np.fft.fft(window[:, None] * rows, axis=0)

    @staticmethod
    def zoomed(line, part, count):
        """Return the middle part of a line in another number of pixels."""
        places = len(line) * ((1 - part) / 2 + part * (np.arange(count) + 0.5) / count) - 0.5
        return np.interp(places, np.arange(len(line)), line)

    def learn(self, view, box):
        spectrum = self.spectrum(view, box)
        new = np.conj(self.label)[:, None] * spectrum, np.mean(abs(spectrum)**2, axis=1)
        rates = (self.config.learning_rate, self.config.slow_rate)
        self.filters = [new, new] if self.filters is None else [
            tuple(old + rate * (part - old) for old, part in zip(filter_, new, strict=True))
            for filter_, rate in zip(self.filters, rates, strict=True)]

    def response(self, view, box):
        """Return the response at every scale."""
        spectrum = self.spectrum(view, box)
        one, other = (np.fft.ifft(np.mean(np.conj(numerator) * spectrum, axis=1) / (
            energy + self.config.regularization)).real for numerator, energy in self.filters)
        return (1 - self.config.slow_share) * one + self.config.slow_share * other

    def estimate(self, view, box):
        values = self.response(view, box)
        best = int(np.argmax(values))
        if 0 < best < len(values) - 1:
            left, middle, right = values[best - 1:best + 2]
            best += 0.5 * (left - right) / (left - 2 * middle + right)
        change = (self.config.exponent_min + best) * math.log(self.config.step)
        return math.exp(change * box.area / (box.area + self.config.damping**2))


DENSE = ScaleConfig(step=1.04, exponent_min=-5, exponent_max=4, learning_rate=0.4, slow_rate=0.15,
                    slow_share=0.3, model_area=300, padding=1.4, regularization=0.02,
                    label_sigma=1.7, damping=12.0)


@pytest.mark.parametrize('size', [(24.0, 18.0), (9.0, 30.0), (60.0, 44.0)])
def test_filter_answers_as_its_definition_does(view, box_at, size):
    fast, dense = ScaleFilter(DENSE, size), DenseFilter(DENSE, size)
    for factor, moved in ((1.0, 0.0), (1.05, 0.7), (0.93, -0.4), (0.97, 0.2)):
        shown = view((size[0] * factor, size[1] * factor))
        box = box_at((CENTER[0] + moved, CENTER[1]), size)
        for estimator in (fast, dense):
            estimator.learn(shown, box)
        for other in (0.9, 0.96, 1.01, 1.07, 1.3):
            later = box_at(CENTER, (size[0] * other, size[1] * other))
            assert fast.estimate(shown, later) == pytest.approx(dense.estimate(shown, later),
                                                                rel=2e-4)


def test_models_of_thin_targets_have_two_cells(view, box_at):
    config = replace(DENSE, model_area=64)
    fast, dense = (kind(config, (4.0, 80.0)) for kind in (ScaleFilter, DenseFilter))
    assert dense.model == [8, 36]
    shown, box = view((4.0, 80.0)), box_at(CENTER, (4.0, 80.0))
    for estimator in (fast, dense):
        estimator.learn(shown, box)
    larger = view((4.4, 88.0))
    assert fast.estimate(larger, box) == pytest.approx(dense.estimate(larger, box), rel=2e-4)

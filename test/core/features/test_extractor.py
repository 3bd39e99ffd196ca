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

"""Blocks of features from patches: shapes, strengths, silence, and one pass per network."""

import cv2
import numpy as np
import pytest

from lmsco_ros.core.backend import to_numpy
from lmsco_ros.core.config import ChannelConfig, FeatureConfig, NetworkConfig, TrackerConfig
from lmsco_ros.core.features.extractor import compress, FeatureExtractor, hann_window, normalize
from lmsco_ros.core.features.hog import hog
from lmsco_ros.core.features.intensity_channels import intensity_channels
from lmsco_ros.core.fourier.interpolation import interpolation_series
from lmsco_ros.core.fourier.series import analyze, mean_of_squares, synthesize
from lmsco_ros.core.networks.thermal import ThermalFlowNet, ThermalNet
from lmsco_ros.core.weights.loading import Networks

PLAIN = FeatureConfig((ChannelConfig('intensity'),), 4)
BOTH = (
    FeatureConfig((ChannelConfig('appearance', layer='features'), ChannelConfig('hog', 0.5)), 4),
    FeatureConfig((ChannelConfig('appearance', layer='conv1'),), 8, projection=6),
    FeatureConfig((ChannelConfig('motion', layer='deep'),), 8))


@pytest.fixture
def networks(random_network):
    """Return an appearance and a motion network with random weights."""
    return {'appearance': random_network(ThermalNet), 'motion': random_network(ThermalFlowNet)}


def extractor(backend, size, *blocks, networks=()):
    """Return the extractor of some blocks, with those of the networks that they need."""
    used = {group.kind for block in blocks for group in block.channels}
    needed = {kind: networks[kind] for kind in networks if kind in used}
    return FeatureExtractor(TrackerConfig(features=blocks), Networks(**needed), size, backend)


def textures(rng, count, size):
    """Return smooth random patches."""
    noise = rng.normal(size=(count, size, size)).astype(np.float32)
    return np.stack([cv2.GaussianBlur(patch, (0, 0), 1.2) for patch in noise])


def flows(rng, count, size):
    """Return random flow images."""
    return rng.uniform(0, 255, (count, size, size, 3)).astype(np.float32)


@pytest.mark.parametrize('trailing', [(5, 3), (6, 6, 2)])
def test_normalization_is_to_unit_mean_square_of_each_sample(rng, trailing):
    channels = rng.normal(size=(4, *trailing)).astype(np.float32)
    channels *= np.float32([17, 1e-3, 0, 2]).reshape(4, *(1,) * len(trailing))
    result = normalize(channels)
    assert result.dtype == np.float32
    for sample, given in zip(result, channels, strict=True):
        if given.any():
            assert np.mean(sample**2) == pytest.approx(1, rel=1e-5)
            np.testing.assert_allclose(sample / sample.flat[0], given / given.flat[0], rtol=1e-4)
        else:
            np.testing.assert_array_equal(sample, 0)


def test_window_has_no_zero_ends():
    window = hann_window(9)
    assert window.shape == (9, 9)
    n = np.arange(1, 10)
    axis = np.sin(np.pi * n / 10)**2
    np.testing.assert_allclose(window, axis[:, None] * axis[None, :], atol=1e-12)


def test_blocks_have_the_order_and_resolution_of_the_configuration(backend, rng, networks):
    blocks = (FeatureConfig((ChannelConfig('hog'), ChannelConfig('intensity')), cell=4),
              FeatureConfig((ChannelConfig('intensity'),), cell=8), *BOTH)
    series = extractor(backend, 72, *blocks, networks=networks)(
        textures(rng, 3, 72), flows(rng, 3, 72))
    assert [block.shape for block in series] == [
        (17, 9, 3, 33), (9, 5, 3, 2), (17, 9, 3, 63), (9, 5, 3, 6), (9, 5, 3, 16)]


def test_series_are_those_of_the_windowed_channels(backend, rng):
    patches = textures(rng, 2, 36)
    block, = extractor(backend, 36, FeatureConfig(
        (ChannelConfig('hog'), ChannelConfig('intensity', 3.0)), 4))(patches)
    for i, patch in enumerate(patches):
        groups = [hog(patch[None], 4)[0], intensity_channels(patch, 4)]
        groups = [weight * group / np.sqrt(np.mean(group**2))
                  for weight, group in zip((1, 3), groups, strict=True)]
        channels = np.concatenate(groups, axis=-1) * hann_window(9)[:, :, None]
        expected = analyze(channels) * interpolation_series(9)[:, :, None]
        np.testing.assert_allclose(block[:, :, i], expected, atol=1e-6)


def test_patches_do_not_touch_each_other(backend, rng, networks):
    patches, flow = textures(rng, 3, 72), flows(rng, 3, 72)
    extract = extractor(backend, 72, *BOTH, networks=networks)
    together = extract(patches, flow)
    for i in range(3):
        alone = extract(patches[i:i + 1], flow[i:i + 1])
        for block, single in zip(together, alone, strict=True):
            np.testing.assert_allclose(block[:, :, i], single[:, :, 0], atol=1e-5)


def test_flow_itself_is_a_group_without_a_network(backend, rng):
    flow = flows(rng, 2, 36)
    blocks = (PLAIN, FeatureConfig((ChannelConfig('flow', 2.0),), 4))
    extract = extractor(backend, 36, *blocks)
    _, found = extract(textures(rng, 2, 36), flow)
    for i in range(2):
        cells = np.array([[flow[i, 4 * y:4 * y + 4, 4 * x:4 * x + 4].mean(axis=(0, 1)) - 128
                           for x in range(9)] for y in range(9)])
        channels = 2 * cells / np.sqrt(np.mean(cells**2)) * hann_window(9)[:, :, None]
        expected = analyze(channels) * interpolation_series(9)[:, :, None]
        np.testing.assert_allclose(found[:, :, i], expected, atol=1e-5)
    # Without motion it is silent, as many channels as ever.
    _, silent = extract(textures(rng, 2, 36))
    assert silent.shape == found.shape and not to_numpy(silent).any()


def test_weight_scales_a_group(backend, rng):
    patches = textures(rng, 1, 36)
    one, two = (extractor(backend, 36, FeatureConfig(
        (ChannelConfig('hog'), ChannelConfig('intensity', weight)), 4))(patches)[0]
        for weight in (1.0, 2.5))
    np.testing.assert_allclose(two[..., :31], one[..., :31], atol=1e-6)
    np.testing.assert_allclose(two[..., 31:], 2.5 * one[..., 31:], atol=1e-5)


def test_groups_share_a_block_at_equal_strength(backend, rng, networks):
    patches, flow = textures(rng, 2, 60), flows(rng, 2, 60)
    groups = (ChannelConfig('hog'), ChannelConfig('intensity'),
              ChannelConfig('appearance', layer='conv2'), ChannelConfig('motion', layer='conv1'))
    together, = extractor(backend, 60, FeatureConfig(groups, 4), networks=networks)(patches, flow)
    parts = np.split(together, np.cumsum([31, 2, 48]), axis=-1)
    for group, part in zip(groups, parts, strict=True):
        alone, _ = extractor(backend, 60, FeatureConfig((group,), 4), PLAIN, networks=networks)(
            patches, flow)
        np.testing.assert_allclose(part, alone, atol=1e-6)
        assert 0.01 < mean_of_squares(part).mean() < 1


def test_no_motion_leaves_zeros_in_the_motion_block_alone(backend, rng, networks):
    patches = textures(rng, 2, 72)
    extract = extractor(backend, 72, *BOTH, networks=networks)
    moving, still = extract(patches, flows(rng, 2, 72)), extract(patches)
    for with_motion, without in zip(moving[:2], still[:2], strict=True):
        np.testing.assert_array_equal(with_motion, without)
        assert without.any()
    assert still[2].shape == moving[2].shape and still[2].dtype == moving[2].dtype
    assert moving[2].any() and not still[2].any()


def test_projection_of_a_motion_block_waits_for_motion(backend, rng, networks):
    block = FeatureConfig((ChannelConfig('motion', layer='deep'),), 8, projection=5)
    patches, flow = textures(rng, 1, 72), flows(rng, 1, 72)
    late = extractor(backend, 72, block, PLAIN, networks=networks)
    silent, _ = late(patches)
    assert silent.shape == (9, 5, 1, 5) and not silent.any()
    at_once = extractor(backend, 72, block, PLAIN, networks=networks)
    np.testing.assert_array_equal(late(patches, flow)[0], at_once(patches, flow)[0])


def test_one_pass_of_a_network_serves_all_blocks(backend, rng, networks):
    passes = []
    for kind, network in networks.items():
        network.conv1.register_forward_pre_hook(
            lambda module, given, kind=kind: passes.append((kind, len(given[0]))))
    extract = extractor(backend, 72, *BOTH, networks=networks)
    extract(textures(rng, 3, 72), flows(rng, 3, 72))
    assert sorted(passes) == [('appearance', 3), ('motion', 3)]
    extract(textures(rng, 2, 72))
    assert passes[2:] == [('appearance', 2)]


def test_configuration_of_no_network_loads_none(random_weights, monkeypatch):
    from lmsco_ros.core import LMSCOTracker
    from lmsco_ros.core.weights import store
    load, asked = store.load_backbone, []
    monkeypatch.setattr(store, 'load_backbone',
                        lambda name, directory: asked.append((name, directory)) or load(name))
    LMSCOTracker(TrackerConfig.preset('hcs'))
    assert asked == []
    LMSCOTracker(TrackerConfig(features=BOTH, networks=NetworkConfig('thermal', 'thermal_flow')))
    assert asked == [('thermal', None), ('thermal_flow', None)]


@pytest.mark.parametrize('power', [0.0, 0.3, 0.5, 1.0])
def test_compression_raises_the_length_of_each_feature_vector_to_a_power(backend, rng, power):
    channels = rng.normal(size=(2, 5, 5, 7)).astype(np.float32)
    channels[0, 2, 3] *= 40
    channels[1, 4, 0] = 0
    result = to_numpy(compress(backend.asarray(channels), power))
    length, given = (np.sqrt(np.mean(values**2, axis=-1)) for values in (result, channels))
    shown = given > 0
    np.testing.assert_allclose(length[shown], given[shown]**power, rtol=1e-3)
    np.testing.assert_allclose(result[shown] / length[shown][:, None],
                               channels[shown] / given[shown][:, None], rtol=1e-3, atol=1e-5)
    assert not result[1, 4, 0].any()


def test_a_bright_neighbor_takes_less_from_a_compressed_group(backend, networks, rng):
    """What the power leaves to the other cells once one cell stands out."""
    patch = textures(rng, 1, 40)
    patch[0, 4:8, 4:8] += 30
    energies = []
    for power in (1.0, 0.5):
        block = FeatureConfig((ChannelConfig('appearance', power=power, layer='features'),), 4)
        series, = extractor(backend, 40, block, networks=networks)(patch)
        values = to_numpy(synthesize(series, 9))[:, :, 0]
        energies.append(np.mean(values[5:]**2) / np.mean(values**2))
    assert energies[1] > 1.5 * energies[0]

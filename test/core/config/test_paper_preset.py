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

"""Every number of the preset `paper`, with the sentence of the paper that it comes from."""

from pathlib import Path

import pytest

from lmsco_ros.core import TrackerConfig
from lmsco_ros.core.config.presets import PRESETS
from lmsco_ros.core.detection.scale import scale_factors
from lmsco_ros.core.imaging.regions import patch_size

PAGE = Path(__file__).resolve().parents[3] / 'docs' / 'paper.md'
PAPER = TrackerConfig.preset('paper')
# What the paper says (section), the key, and its value.
QUOTED = (
    ('we crop the original sample image patch to 5^2 times the previously estimated target '
     'bounding box', 'IV-A', 'sampling.search_factor', 5.0),
    ('set the search image patch in a restricted area [200, 300]', 'IV-A',
     'sampling.patch_size_min', 200),
    ('set the search image patch in a restricted area [200, 300]', 'IV-A',
     'sampling.patch_size_max', 300),
    ('we combine the deep appearance features [30], [32] and deep motion features [12]', 'IV-A',
     'networks.appearance_backbone', 'vgg_m_2048'),
    ('we combine the deep appearance features [30], [32] and deep motion features [12]', 'IV-A',
     'networks.motion_backbone', 'motion_cnn'),
    ('Similar to CFWCR [31], 10 scale layers are used to the adaptive scale estimation', 'IV-A',
     'scale.exponent_min', -4),
    ('Similar to CFWCR [31], 10 scale layers are used to the adaptive scale estimation', 'IV-A',
     'scale.exponent_max', 5),
    ('The online collaborative optimization updates in every 5 frames', 'IV-A',
     'learning.update_interval', 5),
    ('takes three iterations for each SVM classifiers', 'IV-A', 'learning.iterations', 3),
    ('while the initial iterations are 30 in the first frame', 'IV-A',
     'learning.initial_iterations', 30),
    ('each online collaborative optimization iteration involves two Conjugate Gradient '
     'iterations', 'IV-A', 'learning.gradient_steps', 2),
)
# Where it is silent: ours, for a reason that the page or the class gives.
SILENT = {
    'sampling.newton_steps': 5, 'scale.step': 1.03, 'scale.calibrated': True,
    'scale.rate': 0.5,
    'motion.remove_camera_motion': True, 'motion.least_motion': 0.3,
    'learning.loss': 'unit', 'learning.margin_weight': 1.0, 'learning.label_sigma': 1 / 12,
    'learning.window_minimum': 0.02, 'learning.window_edge': 0.06,
    'learning.window_sparsity': 0.05, 'learning.memory_size': 30, 'learning.learning_rate': 0.01,
    'networks.directory': '', 'extent.network': '', 'presence.learn': 'always',
    'presence.distractors': False, 'search.candidates': 0, 'search.tiles': 0,
}
# Of these sections everything has to be accounted for; the others do not decide the box.
SECTIONS = ('sampling', 'networks', 'motion', 'learning', 'scale', 'extent', 'search')


def value(key):
    """Return what the preset has under `section.key`."""
    section, name = key.split('.')
    return getattr(getattr(PAPER, section), name)


@pytest.mark.parametrize('sentence, section, key, number', QUOTED,
                         ids=[quoted[2] for quoted in QUOTED])
def test_preset_has_the_numbers_of_the_paper(sentence, section, key, number):
    assert value(key) == number
    row = f'| "{sentence}" ({section}) | `{key}` | {number:g} |' if isinstance(
        number, (int, float)) else f'| "{sentence}" ({section}) | `{key}` | {number} |'
    assert row in PAGE.read_text(encoding='utf-8')


@pytest.mark.parametrize('key', SILENT)
def test_where_the_paper_is_silent_the_preset_keeps_its_own(key):
    assert value(key) == SILENT[key]


def test_no_value_is_left_without_a_source():
    told = {key for _, _, key, _ in QUOTED} | set(SILENT)
    sections = PAPER.to_dict()
    everything = {f'{section}.{name}' for section in SECTIONS for name in sections[section]}
    assert everything <= told


def test_ten_scales_are_searched():
    assert len(scale_factors(PAPER.scale)) == 10


@pytest.mark.parametrize('side, patch', [(10, 208), (44, 208), (46, 240), (200, 240)])
def test_patches_are_five_targets_wide_within_the_restricted_area(side, patch):
    """In odd numbers of cells of 16 pixels on which Fourier transforms are fast: 13 or 15."""
    assert patch_size((side, side), PAPER.sampling, PAPER.cell) == patch


@pytest.mark.parametrize('kind, layers', [
    # "deep appearance features": "conv1" and "conv5" of VGG-M in DMSRDCF, which [13] is.
    ('appearance', ['shallow', 'deep']),
    # "deep motion features which extracted from a pre-trained optical flow network".
    ('motion', ['deep'])])
def test_layers_are_those_of_the_tracker_that_the_paper_follows(kind, layers):
    found = [group.layer for block in PAPER.features for group in block.channels
             if group.kind == kind]
    assert found == layers
    assert not any(block.projection for block in PAPER.features)


@pytest.mark.parametrize('preset, kinds, scales', [
    # "LMSCO-hcs exploits the conventional handcraft features, including HOG and Color Names, and
    # uses the scale estimation strategy"; thermal images have no colors.
    ('hcs', {'hog', 'intensity'}, 10),
    # "LMSCO-a uses the deep appearance features without the scale estimation strategy".
    ('a', {'appearance'}, 1),
    # "LMSCO-ma is the model that combine the deep motion features with the LMSCO-a tracker".
    ('ma', {'appearance', 'motion'}, 1),
    # "LMSCO employ the same features as well as LMSCO-ma and uses the scale estimation strategy".
    ('mas', {'appearance', 'motion'}, 10)])
def test_variants_are_those_of_the_ablation(preset, kinds, scales):
    config = TrackerConfig(**PRESETS[preset])
    assert {group.kind for block in config.features for group in block.channels} == kinds
    assert len(scale_factors(config.scale)) == scales
    # "We keep all parameters fixed in all the following experiments."
    assert (config.learning, config.sampling) == (PAPER.learning, PAPER.sampling)

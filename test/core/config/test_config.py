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

"""Configurations: round trips, bounds, and errors that say what to do."""

from dataclasses import asdict, FrozenInstanceError, is_dataclass, replace

from hypothesis import given, strategies as st
import pytest
import yaml

from lmsco_ros.core import ConfigError, TrackerConfig
from lmsco_ros.core.config import (
    ChannelConfig, ExtentConfig, FeatureConfig, IntensityConfig, LearningConfig, MotionConfig,
    NetworkConfig, PresenceConfig, RuntimeConfig, SamplingConfig, ScaleConfig, SearchConfig)

weights = st.floats(0.01, 100)
words = st.text(st.characters(codec='utf-8', exclude_categories=['Cc', 'Cs']), min_size=1)
channels = st.builds(ChannelConfig, st.sampled_from(['hog', 'intensity']), weights) | st.builds(
    ChannelConfig, st.sampled_from(['appearance', 'motion']), weights, st.floats(0, 1), words)
features = st.builds(
    FeatureConfig, st.lists(channels, min_size=1, max_size=2).map(tuple),
    cell=st.sampled_from([2, 4, 8]), projection=st.integers(0, 4096))
configs = st.builds(
    TrackerConfig,
    features=st.lists(features, min_size=1, max_size=3).map(tuple).filter(
        lambda blocks: {group.kind for block in blocks for group in block.channels} != {'motion'}),
    intensity=st.builds(IntensityConfig, low_percentile=st.floats(0, 49),
                        high_percentile=st.floats(51, 100), jump=st.floats(0, 1)),
    sampling=st.builds(SamplingConfig, search_factor=st.floats(1.5, 10),
                       patch_size_min=st.integers(64, 200),
                       patch_size_max=st.integers(200, 1024), newton_steps=st.integers(0, 100)),
    networks=st.builds(NetworkConfig, words, words, words | st.just('')),
    motion=st.builds(MotionConfig, st.booleans(), st.floats(0, 100)),
    extent=st.builds(ExtentConfig, words | st.just('')),
    learning=st.builds(LearningConfig, loss=st.sampled_from(['unit', 'coupled', 'ridge']),
                       window_minimum=st.floats(1e-6, 1), window_edge=st.floats(1, 1e3),
                       memory_size=st.integers(1, 1000)),
    scale=st.builds(ScaleConfig, step=st.floats(1.001, 1.15), exponent_min=st.integers(-9, 0),
                    exponent_max=st.integers(0, 9)),
    presence=st.builds(PresenceConfig, lost=st.floats(0, 0.1),
                       uncertain=st.floats(0.1, 0.5), certain=st.floats(0.5, 1),
                       found=st.floats(0.1, 1), sharp=st.floats(0, 2), alike=st.floats(-1, 2),
                       learn=st.sampled_from(['tracking', 'always'])),
    search=st.builds(SearchConfig, st.integers(0, 64), st.integers(0, 64)),
    runtime=st.builds(RuntimeConfig, device=st.sampled_from(['cpu', 'cuda', 'cuda:1']),
                      threads=st.integers(1, 256)))


@given(config=configs)
def test_dictionary_round_trip(config):
    assert TrackerConfig.from_dict(config.to_dict()) == config


@given(config=configs)
def test_plain_values_survive_yaml(config):
    assert TrackerConfig.from_dict(yaml.safe_load(yaml.safe_dump(config.to_dict()))) == config


def test_file_round_trip(tmp_path):
    config = replace(TrackerConfig(), sampling=SamplingConfig(newton_steps=3),
                     scale=ScaleConfig(step=1.07),
                     features=(FeatureConfig((ChannelConfig('intensity', 0.5),), 8),
                               FeatureConfig((ChannelConfig('hog'),), 4)))
    (tmp_path / 'c.yaml').write_text(config.to_yaml())
    assert TrackerConfig.from_yaml(tmp_path / 'c.yaml') == config
    assert TrackerConfig.from_yaml(str(tmp_path / 'c.yaml')) == config


@pytest.mark.parametrize('name', TrackerConfig.preset_names())
def test_presets_are_valid_and_plain(name):
    config = TrackerConfig.preset(name)
    assert TrackerConfig.from_dict({'preset': name}) == config
    assert TrackerConfig.from_dict(config.to_dict()) == config


def test_named_presets_exist():
    assert {'default', 'paper', 'mas', 'ma', 'a', 'hcs'} == set(TrackerConfig.preset_names())
    with pytest.raises(ConfigError, match="unknown preset 'hsc'; expected one of .*hcs"):
        TrackerConfig.preset('hsc')
    with pytest.raises(ConfigError, match='unknown preset'):
        TrackerConfig.from_dict({'preset': 'nothing'})


def differences(one, other):
    """Return the settings in which two presets differ."""
    one, other = (TrackerConfig.preset(name).to_dict() for name in (one, other))
    return {name for name in one if one[name] != other[name]}


def test_presets_of_the_ablation_are_one_factor_apart():
    assert differences('paper', 'mas') == set()
    assert differences('mas', 'ma') == {'scale'}
    assert differences('ma', 'a') == {'features'}
    assert differences('mas', 'hcs') == {'features'}
    appearance, motion_too = (TrackerConfig.preset(name).features for name in ('a', 'ma'))
    assert motion_too[:-1] == appearance
    assert {group.kind for block in appearance for group in block.channels} == {'appearance'}
    assert [group.kind for group in motion_too[-1].channels] == ['motion']
    assert TrackerConfig.preset('ma').scale == ScaleConfig(exponent_min=0, exponent_max=0)
    scale = TrackerConfig.preset('paper').scale
    assert (scale.exponent_min, scale.exponent_max) == (-4, 5)


def test_partial_configuration_changes_only_what_it_names():
    base = TrackerConfig.preset('hcs')
    changed = TrackerConfig.from_dict(
        {'preset': 'hcs', 'learning': {'memory_size': 7}, 'search': {'tiles': 3}})
    assert changed == replace(base, search=replace(base.search, tiles=3),
                              learning=replace(base.learning, memory_size=7))


def test_list_replaces_the_whole_list():
    blocks = [{'channels': [{'kind': 'intensity'}], 'cell': 8}]
    changed = TrackerConfig.from_dict({'features': blocks})
    assert changed.features == (FeatureConfig((ChannelConfig('intensity'),), cell=8),)


def test_empty_configuration_is_the_default(tmp_path):
    assert TrackerConfig.from_dict({}) == TrackerConfig.preset('default')
    (tmp_path / 'empty.yaml').write_text('')
    assert TrackerConfig.from_yaml(tmp_path / 'empty.yaml') == TrackerConfig.preset('default')


def test_whole_numbers_may_be_written_either_way():
    config = TrackerConfig.from_dict({'learning': {'memory_size': 5.0}, 'scale': {'step': 2}})
    assert config.learning.memory_size == 5 and isinstance(config.learning.memory_size, int)
    assert config.scale.step == 2.0 and isinstance(config.scale.step, float)


def test_given_mapping_is_left_alone():
    data = {'preset': 'hcs', 'scale': {'step': 1.1}}
    TrackerConfig.from_dict(data)
    assert data == {'preset': 'hcs', 'scale': {'step': 1.1}}


@pytest.mark.parametrize('data, path, nearest', [
    ({'lerning': {}}, 'lerning', 'learning'),
    ({'learning': {'memory_sise': 3}}, 'learning.memory_sise', 'memory_size'),
    ({'scale': {'exponent_mx': 3}}, 'scale.exponent_mx', 'exponent_max'),
    ({'features': [{'channels': [], 'cels': 3}]}, r'features\[0\].cels', 'cell'),
    ({'features': [{'channels': [{'knd': 'hog'}]}]},
     r'features\[0\].channels\[0\].knd', 'kind'),
    ({'features': [{'channels': [{'kind': 'motion', 'layr': 'deep'}]}]},
     r'features\[0\].channels\[0\].layr', 'layer'),
    ({'networks': {'motion_backbon': 'x'}}, 'networks.motion_backbon', 'motion_backbone'),
    ({'motion': {'least_motoin': 1}}, 'motion.least_motoin', 'least_motion'),
    ({'sampling': {'newton_step': 3}}, 'sampling.newton_step', 'newton_steps'),
    ({7: 3}, '7', ''),
])
def test_unknown_key_names_the_nearest(data, path, nearest):
    with pytest.raises(ConfigError, match=f"unknown key '{path}'; did you mean '{nearest}"):
        TrackerConfig.from_dict(data)


@pytest.mark.parametrize('data, where, missing', [
    ({'features': [{}]}, r'features\[0\] is {}', 'channels'),
    ({'features': [{'channels': [{'weight': 2}]}]}, r'features\[0\].channels\[0\] is', 'kind')])
def test_missing_key_without_a_default_is_named(data, where, missing):
    with pytest.raises(ConfigError, match=f"{where}.*, without '{missing}'"):
        TrackerConfig.from_dict(data)


def test_flow_alone_shows_nothing_in_the_first_frame():
    with pytest.raises(ConfigError, match='motion channels only'):
        TrackerConfig.from_dict({'features': [{'channels': [{'kind': 'flow'}]}]})
    assert TrackerConfig.from_dict({'features': [
        {'channels': [{'kind': 'hog'}]}, {'channels': [{'kind': 'flow'}]}]}).sees_motion
    assert TrackerConfig.preset('ma').sees_motion and not TrackerConfig.preset('a').sees_motion


@given(config=configs, section=st.sampled_from(
    ['learning', 'scale', 'sampling', 'networks', 'motion']),
       position=st.integers(0, 40), letter=st.sampled_from('qzx'))
def test_misspelled_key_is_found_again(config, section, position, letter):
    data = config.to_dict()
    key = max(data[section], key=len)
    wrong = key[:position] + letter + key[position:]
    data[section][wrong] = data[section].pop(key)
    with pytest.raises(ConfigError, match=f'{section}.{wrong}.*did you mean {key!r}'):
        TrackerConfig.from_dict(data)


@pytest.mark.parametrize('data, reason', [
    ({'learning': {'memory_size': 2.5}}, 'learning.memory_size is 2.5; expected an? int'),
    ({'learning': {'memory_size': '5'}}, "learning.memory_size is '5'; expected a int"),
    ({'learning': {'memory_size': True}}, 'learning.memory_size is True; expected an? int'),
    ({'learning': {'margin_weight': None}}, 'learning.margin_weight is None; expected a float'),
    ({'learning': {'margin_weight': False}}, 'learning.margin_weight is False; expected a float'),
    ({'learning': {'loss': 3}}, 'learning.loss is 3; expected a str'),
    ({'learning': 3}, 'learning is 3; expected keys and values'),
    ({'scale': {'step': [1.1]}}, r'scale.step is \[1.1\]; expected a float'),
    ({'features': 'hog'}, "features is 'hog'; expected a list"),
    ({'features': ['hog']}, r"features\[0\] is 'hog'; expected keys and values"),
    ({'features': [{'channels': 'hog'}]}, r"features\[0\].channels is 'hog'; expected a list"),
    ({'features': [{'channels': [3]}]}, r'channels\[0\] is 3; expected keys and values'),
    ({'features': [{'channels': [{'kind': 3}]}]}, r'channels\[0\].kind is 3; expected a str'),
    ({'networks': {'appearance_backbone': 3}}, 'appearance_backbone is 3; expected a str'),
    ({'motion': {'remove_camera_motion': 1}}, 'remove_camera_motion is 1; expected a bool'),
    ({'features': []}, 'features is empty; name at least one block'),
])
def test_wrong_types_are_refused(data, reason):
    with pytest.raises(ConfigError, match=reason):
        TrackerConfig.from_dict(data)


# Section, field, a value below, and a value above the allowed range (None: there is no bound).
BOUNDS = [
    (IntensityConfig, 'low_percentile', -1, 50), (IntensityConfig, 'high_percentile', 50, 101),
    (IntensityConfig, 'smoothing', 0, 1.1), (IntensityConfig, 'jump', -0.1, 1.1),
    (SamplingConfig, 'search_factor', 1.4, 10.5), (SamplingConfig, 'patch_size_min', 31, 1025),
    (SamplingConfig, 'patch_size_max', 31, 1025),
    (LearningConfig, 'margin_weight', 0, 2e6),
    (LearningConfig, 'label_sigma', 0, 1.1), (LearningConfig, 'window_minimum', 0, 1001),
    (LearningConfig, 'window_edge', 0, 1001), (LearningConfig, 'window_sparsity', -0.1, 1.1),
    (LearningConfig, 'memory_size', 0, 1001), (LearningConfig, 'learning_rate', -0.1, 0.6),
    (LearningConfig, 'initial_iterations', 0, 1001), (LearningConfig, 'iterations', 0, 1001),
    (LearningConfig, 'gradient_steps', 0, 1001), (LearningConfig, 'update_interval', 0, 1001),
    (ScaleConfig, 'step', 1, 2.1), (ScaleConfig, 'exponent_min', -51, 1),
    (ScaleConfig, 'exponent_max', -1, 51),
    (MotionConfig, 'least_motion', -0.1, 101),
    (PresenceConfig, 'found', 0.05, 1.1), (PresenceConfig, 'certain', 0.2, 1.1),
    (PresenceConfig, 'sharp', -0.1, 2.1), (PresenceConfig, 'alike', -1.1, 2.1),
    (PresenceConfig, 'reference_frames', 0, 1001), (PresenceConfig, 'lost_frames', 0, 1001),
    (SearchConfig, 'candidates', -1, 65), (SearchConfig, 'tiles', -1, 65),
    (RuntimeConfig, 'threads', 0, 257),
    (SamplingConfig, 'newton_steps', -1, 101),
]


@pytest.mark.parametrize('kind, name, low, high', BOUNDS,
                         ids=lambda v: v if isinstance(v, str) else getattr(v, '__name__', None))
def test_bounds_name_the_field_the_value_and_the_range(kind, name, low, high):
    for value in (low, high, float('nan'), float('inf')):
        with pytest.raises(ConfigError) as caught:
            kind(**{name: value})
        assert f'{kind.__name__}.{name} is {value}; expected a value in ' in str(caught.value)


@pytest.mark.parametrize('values', [
    {'sampling': {'patch_size_min': 200, 'patch_size_max': 100}},
    {'learning': {'window_minimum': 0.5, 'window_edge': 0.1}},
    {'presence': {'lost': 0.5, 'uncertain': 0.3, 'found': 0.6}},
    {'presence': {'lost': 0.5, 'uncertain': 0.6, 'found': 0.3}},
    {'presence': {'uncertain': 0.5, 'certain': 0.3}},
])
def test_ranges_must_not_be_turned_round(values):
    with pytest.raises(ConfigError, match='expected a value in'):
        TrackerConfig.from_dict(values)


@pytest.mark.parametrize('values, words', [
    ({'sampling': {'patch_size_min': 64, 'patch_size_max': 64},
      'features': [{'channels': [{'kind': 'hog'}], 'cell': 16}]}, '64 pixels .* cells of 16'),
    ({'features': [{'channels': [{'kind': 'hog'}], 'cell': cell} for cell in (7, 11)]},
     'cells of 77 pixels'),
    ({'features': [{'channels': [{'kind': 'motion', 'layer': 'deep'}], 'cell': 16}]},
     'motion channels only, which show nothing in the first frame; add a block of appearance'),
    ({'scale': {'step': 2, 'exponent_max': 50}}, 'reach a factor of 1.1259e\\+15'),
])
def test_values_that_do_not_go_together_are_refused(values, words):
    with pytest.raises(ConfigError, match=words):
        TrackerConfig.from_dict(values)


@pytest.mark.parametrize('section, name, choices', [
    ('learning', 'loss', 'unit, coupled, ridge'),
    ('presence', 'learn', 'tracking, always'),
])
def test_choices_are_listed(section, name, choices):
    with pytest.raises(ConfigError, match=f"{name} is 'other'; expected one of {choices}"):
        TrackerConfig.from_dict({section: {name: 'other'}})


@pytest.mark.parametrize('block, reason', [
    ({'channels': []}, 'channels is empty; name at least one'),
    ({'channels': [{'kind': 'hog'}], 'cell': 0}, r'FeatureConfig.cell is 0; expected'),
    ({'channels': [{'kind': 'hog'}], 'cell': 33}, r'FeatureConfig.cell is 33; expected'),
    ({'channels': [{'kind': 'hog', 'weight': 0}]}, r'ChannelConfig.weight is 0.*; expected'),
    ({'channels': [{'kind': 'hog'}], 'projection': -1}, r'FeatureConfig.projection is -1; exp'),
    ({'channels': [{'kind': 'hog'}], 'projection': 4097}, r'projection is 4097; expected'),
    ({'channels': [{'kind': 'color'}]},
     "kind is 'color'; expected one of hog, intensity, appearance, motion"),
    ({'channels': [{'kind': 'motion'}]}, "layer is '' for kind 'motion'; expected a layer such"),
    ({'channels': [{'kind': 'hog', 'layer': 'deep'}]},
     "layer is 'deep' for kind 'hog'; expected .*none for the others"),
])
def test_features_are_checked(block, reason):
    with pytest.raises(ConfigError, match=reason):
        TrackerConfig.from_dict({'features': [block]})


def nested_merges(levels):
    """Return a text whose merged keys are nine times as many on every level."""
    lines = ['a0: &a0 {k: 1}']
    lines += [f'a{i}: &a{i} {{<<: [{", ".join([f"*a{i - 1}"] * 9)}]}}' for i in range(1, levels)]
    return '\n'.join(lines)


def nested_aliases(levels):
    """Return a text that stands for 9 ** levels values."""
    lines = ['a0: &a0 [1]'] + [
        f'a{i}: &a{i} [{", ".join([f"*a{i - 1}"] * 9)}]' for i in range(1, levels)]
    return '\n'.join(lines)


@pytest.mark.parametrize('text, reason', [
    ('- 1\n- 2\n', 'it holds a list'),
    ('just words\n', 'it holds a str'),
    ('a: [1,\n', "line 2, column 1: .* but found '<stream end>'"),
    ('learning:\n\tanchor: unit\n', r'line 2, column 1: .*cannot start any token'),
    ('newton_steps: 1\n---\nnewton_steps: 2\n', 'line 2, column 1: but found another document'),
    ('newton_steps: 1\nnewton_steps: 2\n', "line 2: the key 'newton_steps' is there twice"),
    ('scale: {step: 1.02, step: 1.03}\n', "line 1: the key 'step' is there twice"),
    ('features: ' + '[' * 5000 + ']' * 5000, 'nested too deeply'),
    ('features: ' + '[' * 50 + ']' * 50, 'nested more than 20 levels deep'),
    ('features: &all [*all]\n', 'nested more than 20 levels deep'),
    ('scale: &all {step: *all}\n', 'nested more than 20 levels deep'),
    ('&all\n<<: *all\n', 'nested more than 20 levels deep'),
    (nested_aliases(12), 'more than 10000 values'),
    (nested_merges(8), 'more than 10000 values'),
    ('features: [' + '1, ' * 11_000 + ']', 'more than 10000 values'),
    ('newton_steps: ' + '9' * 5000, r'Exceeds the limit \(4300 digits\)'),
    ('newton_steps: 2024-13-45', 'month must be in'),
    ('newton_steps: *unknown', "found undefined alias 'unknown'"),
    ('newton_steps: !!python/object/apply:os.getpid []', 'could not determine a constructor'),
    ('newton_steps: 5\0', 'special characters are not allowed'),
    ('#' + 'x' * 200_000, 'more than 100000 bytes'),
    ('words: caf\udce9', 'it is not text in UTF-8 .character 10: '),
])
def test_file_that_is_no_configuration_is_refused_in_one_line(tmp_path, text, reason):
    path = tmp_path / 'broken.yaml'
    path.write_bytes(text.encode('utf-8', 'surrogateescape'))
    with pytest.raises(ConfigError, match=reason) as refusal:
        TrackerConfig.from_yaml(path)
    message = str(refusal.value)
    assert message.startswith(f'cannot read the configuration {path}: ')
    assert message.endswith('; expected a YAML file with keys and values')
    assert '\n' not in message and len(message) < 500


@pytest.mark.parametrize('name, reason', [
    ('missing.yaml', 'No such file or directory'), ('.', 'Is a directory'),
    ('missing\0.yaml', 'embedded null byte'), ('\udfff\ud800', 'surrogates not allowed')])
def test_place_without_a_file_is_named(tmp_path, name, reason):
    with pytest.raises(ConfigError, match=f'cannot read the configuration .*{reason}'):
        TrackerConfig.from_yaml(str(tmp_path / name))


@pytest.mark.parametrize('text, reason', [
    ('learning: {loss: best}\n', "loss is 'best'; expected one of"),
    ('sampling: {newton_steps: ' + '9' * 400 + '}',
     'newton_steps is a number with 40 digits or more'),
    ('sampling: {newton_steps: 0x' + 'f' * 5000 + '}',
     'newton_steps is a number with 40 digits or more'),
    ('scale: {step: ' + '9' * 400 + '}', 'scale.step is a number with 40 digits or more'),
    ('sampling: {newton_steps: .inf}', 'newton_steps is inf'),
    ('sampling: {newton_steps: 1e999}', 'newton_steps is'),
    ('preset: [default]', "unknown preset .'default'.; expected one of default"),
    ('features: ' + 'x' * 10_000, "features is 'xxx.*[.][.][.].*xxx'; expected a list"),
    ('x' * 1000 + ': 1', 'unknown key .xxx'),
    ('? ' + '9' * 4000 + '\n: 1', 'unknown key .a number with 40 digits or more'),
])
def test_wrong_value_is_named_with_its_file_in_one_line(tmp_path, text, reason):
    path = tmp_path / 'wrong.yaml'
    path.write_text(text)
    with pytest.raises(ConfigError, match=reason) as refusal:
        TrackerConfig.from_yaml(path)
    message = str(refusal.value)
    assert message.startswith(f'{path}: ') and '\n' not in message and len(message) < 700


@pytest.mark.parametrize('encoding', ['utf-8', 'utf-8-sig', 'utf-16'])
def test_encodings_that_yaml_knows_are_read(tmp_path, encoding):
    (tmp_path / 'c.yaml').write_bytes('# Größe\nsampling: {newton_steps: 3}\n'.encode(encoding))
    assert TrackerConfig.from_yaml(tmp_path / 'c.yaml').sampling.newton_steps == 3


def test_values_may_be_written_once_and_used_twice(tmp_path):
    (tmp_path / 'c.yaml').write_text('sampling: {patch_size_min: &size 96, patch_size_max: *size}')
    sampling = TrackerConfig.from_yaml(tmp_path / 'c.yaml').sampling
    assert sampling.patch_size_min == sampling.patch_size_max == 96


@given(st.one_of(st.binary(max_size=200), st.text(max_size=200).map(str.encode),
                 st.text(alphabet='&*a<:{}[],-\n ?!|>\'"#%@`0x.', max_size=80).map(str.encode)))
def test_any_bytes_are_a_configuration_or_refused(tmp_path_factory, content):
    path = tmp_path_factory.mktemp('any') / 'c.yaml'
    path.write_bytes(content)
    try:
        TrackerConfig.from_yaml(path)
    except ConfigError as error:
        assert str(path) in str(error) and '\n' not in str(error)


_KEYS = [(section, key) for section, value in TrackerConfig().to_dict().items()
         for key in (value if isinstance(value, dict) else [None])]


@given(st.sampled_from(_KEYS), st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=9)
    | st.just(10 ** 400) | st.dates(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner,
                                                                max_size=3), max_leaves=6))
def test_any_value_of_a_key_is_taken_or_refused(place, value):
    section, key = place
    try:
        TrackerConfig.from_dict({section: value if key is None else {key: value}})
    except ConfigError as error:
        assert '\n' not in str(error)


def test_configurations_do_not_change():
    config = TrackerConfig()
    for part in (config, *(v for v in vars(config).values() if is_dataclass(v))):
        name = next(iter(asdict(part)))
        with pytest.raises(FrozenInstanceError):
            setattr(part, name, None)

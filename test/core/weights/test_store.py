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

"""Weights by name: where they are looked for, what is refused, and what the messages say."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from lmsco_ros.core.errors import LMSCOError, WeightsError
from lmsco_ros.core.networks.motion_cnn import MotionCNN
from lmsco_ros.core.networks.squeezenet import SqueezeNet
from lmsco_ros.core.networks.thermal import ThermalNet
from lmsco_ros.core.networks.vgg_m import VGGM
from lmsco_ros.core.weights import registry, store
from lmsco_ros.core.weights.acquisition import fetch_weights, import_weights, verify_weights
from lmsco_ros.core.weights.checksum import file_sha256
from lmsco_ros.core.weights.formats import read_arrays, write_arrays
from lmsco_ros.core.weights.store import DIRECTORY_VARIABLE, load_backbone, weights_directory

SQUEEZENET = 'squeezenet_v1.0'
FOREIGN_FIRES = (('squeeze', 'squeeze1x1'), ('expand1', 'expand1x1'), ('expand3', 'expand3x3'))


@pytest.fixture
def squeezenet(random_arrays):
    """Return random arrays of SqueezeNet."""
    return random_arrays(SqueezeNet)


@pytest.fixture
def change_source(monkeypatch):
    """Return a function that changes what the registry tells of some weights."""
    def change(name, **changes):
        monkeypatch.setattr(registry, 'WEIGHTS', tuple(
            replace(source, **changes) if source.name == name else source
            for source in registry.WEIGHTS))
    return change


def test_registered_names_are_unique_and_every_network_has_its_shapes():
    names = [source.name for source in registry.WEIGHTS]
    assert len(set(names)) == len(names)
    assert {'vgg_m_2048', 'motion_cnn', SQUEEZENET} <= set(names)
    for source in registry.WEIGHTS:
        assert source.bundled or source.url or source.page or source.brought_by
        assert all(min(shape) > 0 for shape in source.architecture.file_shapes().values())


def foreign(arrays):
    """Return the arrays of SqueezeNet under the names of its authors."""
    renamed = {}
    for name, array in arrays.items():
        for own, other in FOREIGN_FIRES:
            name = name.replace(f'.{own}.', f'/{other}.')
        renamed[name] = array
    del renamed['mean']
    return renamed


@pytest.mark.parametrize('name, architecture, kind', [
    ('vgg_m_2048', VGGM, 'matconvnet'), ('vgg_m_2048', VGGM, 'old matconvnet'),
    ('motion_cnn', MotionCNN, 'old caffe'), (SQUEEZENET, SqueezeNet, 'caffe'),
    (SQUEEZENET, SqueezeNet, 'checkpoint')])
def test_published_files_become_networks(name, architecture, kind, tmp_path, random_arrays,
                                         write_file):
    arrays = random_arrays(architecture)
    if 'caffe' in kind:
        arrays['mean'] = np.array(architecture.mean, np.float32)
    published = {**(foreign(arrays) if architecture is SqueezeNet else arrays),
                 'fc6.weight': np.ones((2, 5, 1, 1), np.float32),
                 'fc6.bias': np.ones(2, np.float32)}
    if architecture is SqueezeNet and kind == 'checkpoint':
        published['mean'] = arrays['mean']
    file = write_file(kind, published)
    path = import_weights(file, name, tmp_path / 'weights')
    converted = read_arrays(path)
    assert converted.keys() == arrays.keys()
    for key, array in arrays.items():
        np.testing.assert_allclose(converted[key], array, rtol=1e-6, err_msg=key)
    image = torch.rand(1, architecture.input_channels, 64, 64)
    expected = architecture.from_arrays(arrays)(image, ['deep'])
    for network in (load_backbone(name, tmp_path / 'weights') for _ in range(2)):
        assert isinstance(network, architecture) and not network.training
        torch.testing.assert_close(network(image, ['deep']), expected)
    found = verify_weights(name, tmp_path / 'weights')
    assert found.path == path and found.source_sha256 == file_sha256(file)
    assert found.numbers == sum(array.size for array in arrays.values())


def test_folder_is_the_argument_the_variable_or_the_cache(tmp_path, monkeypatch):
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    monkeypatch.delenv(DIRECTORY_VARIABLE, raising=False)
    assert weights_directory() == tmp_path / 'cache' / 'lmsco_ros' / 'weights'
    monkeypatch.setenv(DIRECTORY_VARIABLE, str(tmp_path / 'variable'))
    assert weights_directory() == tmp_path / 'variable'
    assert weights_directory(tmp_path / 'argument') == tmp_path / 'argument'


def test_unknown_name_is_told_with_the_known(tmp_path):
    with pytest.raises(WeightsError, match="'vgg_19'; expected one of .*vgg_m_2048, motion_cnn"):
        load_backbone('vgg_19', tmp_path)
    assert issubclass(WeightsError, LMSCOError)


def test_missing_weights_are_told_with_the_ways_to_get_them(tmp_path):
    with pytest.raises(WeightsError) as missing:
        load_backbone('vgg_m_2048', tmp_path)
    for part in (str(tmp_path), '`lmsco weights fetch vgg_m_2048`',
                 '`lmsco weights import FILE --as vgg_m_2048`', 'default and hcs need none'):
        assert part in str(missing.value)
    with pytest.raises(WeightsError, match='`lmsco weights import FILE --as motion_cnn`') as gone:
        load_backbone('motion_cnn', tmp_path)
    assert 'fetch' not in str(gone.value)


def save(folder, arrays):
    """Write arrays where SqueezeNet is looked for."""
    write_arrays(folder / f'{SQUEEZENET}.safetensors', arrays, {})


def test_missing_array_is_named_with_its_shape(tmp_path, squeezenet):
    del squeezenet['fire4.expand3.weight']
    save(tmp_path, squeezenet)
    with pytest.raises(WeightsError, match=r'no array fire4\.expand3\.weight of shape '
                                           r'\(128, 32, 3, 3\).*import FILE --as'):
        load_backbone(SQUEEZENET, tmp_path)


def test_misshaped_array_is_named_with_both_shapes(tmp_path, squeezenet):
    squeezenet['conv1.weight'] = squeezenet['conv1.weight'][:, :, :3, :3]
    save(tmp_path, squeezenet)
    with pytest.raises(WeightsError, match=r'array conv1\.weight has shape \(96, 3, 3, 3\), but '
                                           r'squeezenet_v1\.0 needs \(96, 3, 7, 7\)'):
        load_backbone(SQUEEZENET, tmp_path)


@pytest.mark.parametrize('value', [
    np.full(64, np.nan, np.float32), np.full(64, np.inf, np.float32), np.ones(64, np.int32)])
def test_other_than_finite_numbers_are_refused(tmp_path, squeezenet, value):
    squeezenet['fire2.expand1.bias'] = value
    save(tmp_path, squeezenet)
    with pytest.raises(WeightsError, match=r'fire2\.expand1\.bias .*finite'):
        load_backbone(SQUEEZENET, tmp_path)


def test_another_network_is_refused_and_nothing_is_written(tmp_path, squeezenet, write_file):
    file = write_file('numpy', squeezenet)
    with pytest.raises(WeightsError, match=r'imagenet-vgg-m-2048\.mat'):
        import_weights(file, 'vgg_m_2048', tmp_path / 'weights')
    assert not (tmp_path / 'weights').exists()


def test_published_file_with_another_checksum_is_refused(tmp_path, squeezenet, write_file,
                                                         change_source):
    file = write_file('numpy', squeezenet)
    change_source(SQUEEZENET, file_name=file.name, sha256='0' * 64)
    with pytest.raises(WeightsError, match=f'{file_sha256(file)}, expected {"0" * 64}'):
        import_weights(file, SQUEEZENET, tmp_path / 'weights')
    renamed = file.rename(tmp_path / 'another.npz')
    import_weights(renamed, SQUEEZENET, tmp_path / 'weights')
    with pytest.raises(WeightsError, match='get the published file and import it'):
        verify_weights(SQUEEZENET, tmp_path / 'weights')
    change_source(SQUEEZENET, sha256=file_sha256(renamed))
    assert verify_weights(SQUEEZENET, tmp_path / 'weights').source_sha256 == file_sha256(renamed)


def test_published_file_can_be_used_as_it_is(tmp_path, squeezenet, write_file, change_source):
    file = write_file('state', squeezenet)
    change_source(SQUEEZENET, file_name=file.name)
    assert isinstance(load_backbone(SQUEEZENET, tmp_path), SqueezeNet)
    assert verify_weights(SQUEEZENET, tmp_path).source_sha256 == file_sha256(file)


def test_bundled_weights_are_looked_for_in_the_package(tmp_path, change_source):
    change_source(SQUEEZENET, bundled=True, file_name='nowhere.safetensors')
    with pytest.raises(WeightsError, match=r'package lacks nowhere\.safetensors'):
        load_backbone(SQUEEZENET, tmp_path)
    for get in (fetch_weights, lambda name: import_weights(tmp_path, name)):
        with pytest.raises(WeightsError, match='come with the package'):
            get(SQUEEZENET)


def test_bundled_weights_give_way_to_those_that_a_user_trained(tmp_path, random_arrays):
    arrays = random_arrays(ThermalNet)
    write_arrays(tmp_path / 'thermal.safetensors', arrays, {})
    own, bundled = (load_backbone('thermal', folder).state_dict()['conv1.weight'].numpy()
                    for folder in (tmp_path, None))
    np.testing.assert_array_equal(own, arrays['conv1.weight'])
    assert not np.array_equal(own, bundled)


def test_fetched_weights_are_converted(tmp_path, squeezenet, write_file, change_source,
                                       file_server):
    file = write_file('caffe', foreign(squeezenet))
    file_server.content = file.read_bytes()
    change_source(SQUEEZENET, url=file_server.url('net'), sha256=file_sha256(file))
    path = fetch_weights(SQUEEZENET, tmp_path / 'weights')
    assert [path] == list(path.parent.iterdir())
    assert isinstance(load_backbone(SQUEEZENET, tmp_path / 'weights'), SqueezeNet)
    assert verify_weights(SQUEEZENET, tmp_path / 'weights').source_sha256 == file_sha256(file)


def test_fetching_a_wrong_file_keeps_what_is_here(tmp_path, squeezenet, change_source,
                                                  file_server):
    save(tmp_path, squeezenet)
    file_server.content = b'other bytes' * 100
    change_source(SQUEEZENET, url=file_server.url('net'))
    with pytest.raises(WeightsError, match='damaged, or no file of Caffe'):
        fetch_weights(SQUEEZENET, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [f'{SQUEEZENET}.safetensors']
    assert isinstance(load_backbone(SQUEEZENET, tmp_path), SqueezeNet)


def test_weights_without_an_address_cannot_be_fetched(tmp_path):
    with pytest.raises(WeightsError, match='no address .*; look at .* then run `lmsco'):
        fetch_weights('motion_cnn', tmp_path)


def test_names_and_shapes_are_checked_before_an_archive_is_unfolded(tmp_path, monkeypatch,
                                                                    random_arrays):
    arrays = random_arrays(SqueezeNet)
    right, wrong = tmp_path / 'right.npz', tmp_path / 'wrong.npz'
    np.savez(right, **arrays)
    np.savez(wrong, **{**arrays, 'conv1.bias': np.zeros(7, np.float32)})
    np.savez(tmp_path / 'other.npz', junk=np.zeros(100))
    import_weights(right, SQUEEZENET, tmp_path / 'weights')
    monkeypatch.setattr(store, 'read_arrays', lambda path: pytest.fail('it was unfolded'))
    for path, reason in ((wrong, r'conv1\.bias has shape \(7,\), but'),
                         (tmp_path / 'other.npz', r'has no array conv1\.weight')):
        with pytest.raises(WeightsError, match=reason):
            import_weights(path, SQUEEZENET, tmp_path / 'weights')

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

"""`lmsco weights` as a user meets it."""

from dataclasses import replace
import hashlib

import numpy as np
import pytest

from lmsco_ros.core.networks.squeezenet import SqueezeNet
from lmsco_ros.core.weights import registry

NAME = 'squeezenet_v1.0'


@pytest.fixture
def published(tmp_path):
    """Return a file with random weights of SqueezeNet."""
    generator = np.random.default_rng(1)
    path = tmp_path / 'published.npz'
    np.savez(path, **{name: generator.normal(size=shape).astype(np.float32)
                      for name, shape in SqueezeNet.file_shapes().items()})
    return path


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Return the folder of the weights, by the environment variable."""
    monkeypatch.setenv('LMSCO_WEIGHTS_DIR', str(tmp_path / 'weights'))
    return tmp_path / 'weights'


@pytest.fixture
def served(published, file_server, monkeypatch):
    """Let the registry find the file on a server of this machine, which is returned."""
    file_server.content = published.read_bytes()
    monkeypatch.setattr(registry, 'WEIGHTS', tuple(
        replace(source, url=file_server.url('net'), file_name=published.name,
                sha256=hashlib.sha256(file_server.content).hexdigest())
        if source.name == NAME else source for source in registry.WEIGHTS))
    return file_server


def test_list_tells_what_is_here(lmsco, published, folder):
    assert lmsco('weights', 'import', published, '--as', NAME).exit_code == 0
    outcome = lmsco('weights', 'list')
    assert outcome.exit_code == 0
    (row,) = [line for line in outcome.output.splitlines() if line.startswith(NAME)]
    assert f'{NAME}.safetensors' in row and 'BSD' in row
    (row,) = [line for line in outcome.output.splitlines() if line.startswith('vgg_m_2048')]
    assert 'missing' in row
    assert f'folder: {folder}' in outcome.words


def test_import_and_verify(lmsco, published, folder):
    outcome = lmsco('weights', 'import', published, '--as', NAME)
    assert outcome.words == f'{NAME} is here: {folder / NAME}.safetensors'
    outcome = lmsco('weights', 'verify', NAME)
    assert outcome.exit_code == 0 and 'is whole and fits' in outcome.words
    assert hashlib.sha256(published.read_bytes()).hexdigest() in outcome.words


def test_fetch_goes_on_after_a_broken_connection(lmsco, served, folder):
    served.cuts = [16 << 16]
    outcome = lmsco('weights', 'fetch', NAME)
    assert outcome.exit_code == 0, outcome.output
    assert served.asked == [None, 'bytes=1048576-']
    assert f'{NAME} is here' in outcome.words and 'from the published file' in outcome.words
    assert lmsco('weights', 'fetch', NAME).words == f'{NAME} is here: {folder / NAME}.safetensors'
    assert len(served.asked) == 2
    assert lmsco('weights', 'fetch', NAME, '--force').exit_code == 0
    assert len(served.asked) == 3


def test_wrong_bytes_are_refused(lmsco, served, folder):
    served.content = served.content[:-1]
    outcome = lmsco('weights', 'fetch', NAME)
    assert outcome.exit_code == 1 and 'checksum' in outcome.words
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize('path', ['missing', 'circle', 'page'])
def test_what_cannot_be_fetched_is_told_in_one_line(lmsco, served, monkeypatch, path):
    served.content = b'<html>Log in</html>'
    url = served.url(path)
    monkeypatch.setattr(registry, 'WEIGHTS', tuple(
        replace(source, url=url) if source.name == NAME else source
        for source in registry.WEIGHTS))
    outcome = lmsco('weights', 'fetch', NAME)
    assert outcome.exit_code == 1
    line = outcome.output.splitlines()[-1]
    assert line.startswith(f'error: {url} ')
    assert line.endswith(f'or get the file by other means and run '
                         f'`lmsco weights import FILE --as {NAME}`')


def test_folder_that_cannot_be_made_is_named(lmsco, served, tmp_path):
    (tmp_path / 'file').write_text('')
    outcome = lmsco('weights', 'fetch', NAME, '--directory', tmp_path / 'file' / 'inner')
    assert outcome.exit_code == 1
    assert outcome.output.splitlines()[-1] == f'error: {tmp_path}/file/inner: Not a directory'


@pytest.mark.parametrize('arguments, words', [
    (('verify', 'vgg_m_2048'), 'lmsco weights fetch vgg_m_2048'),
    (('verify', 'nothing'), 'there are no weights called'),
    (('fetch', 'nothing'), 'there are no weights called'),
    (('fetch', 'motion_cnn'), 'no address'),
])
def test_errors_tell_what_to_do(lmsco, arguments, words):
    outcome = lmsco('weights', *arguments)
    assert outcome.exit_code == 1 and words in outcome.words


def test_import_needs_a_name(lmsco, published):
    assert lmsco('weights', 'import', published).exit_code == 2
    outcome = lmsco('weights', 'import', published, '--as', 'vgg_m_2048')
    assert outcome.exit_code == 1 and 'no array conv2.weight' in outcome.words


def test_without_a_command_it_explains_itself(lmsco):
    outcome = lmsco('weights')
    assert all(name in outcome.output for name in ('list', 'fetch', 'verify', 'import'))

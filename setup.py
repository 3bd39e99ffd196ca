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
What both installers, `colcon build` and `pip install`, need beyond `pyproject.toml`.

Version, packages and files: colcon has to find them here.
"""

from glob import glob
from pathlib import Path
import re

from setuptools import find_packages, setup

PACKAGE = 'lmsco_ros'
# colcon cannot read the `attr:` of pyproject.toml.
VERSION = re.search(r"^__version__ = '(.+)'$",
                    (Path(__file__).parent / PACKAGE / '__init__.py').read_text(), re.MULTILINE)

setup(
    name=PACKAGE,
    version=VERSION[1],
    packages=find_packages(include=[f'{PACKAGE}*', 'msg_adapters*']),
    package_data={
        PACKAGE: [
            'py.typed',
            'console/page/*',
            'core/weights/*.safetensors',
            'evaluation/**/*.html',
            'evaluation/**/*.txt',
        ],
        'msg_adapters': ['py.typed'],
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        (f'share/{PACKAGE}/config', sorted(glob('config/*.*'))),
        (f'share/{PACKAGE}/config/cameras', sorted(glob('config/cameras/*.yaml'))),
        (f'share/{PACKAGE}/config/viewers', sorted(glob('config/viewers/*.*'))),
        (f'share/{PACKAGE}/launch', sorted(glob('launch/*.launch.py'))),
    ],
    # colcon cannot read what setuptools makes of the same in pyproject.toml.
    python_requires='>=3.10,<3.14',
    zip_safe=False,
    # No way to write it into pyproject.toml suits both old and new versions of setuptools.
    license='Apache-2.0',
)

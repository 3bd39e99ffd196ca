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

"""The package for both installers: `colcon build` and `pip install`."""

from glob import glob
from pathlib import Path
import re

from setuptools import find_packages, setup

PACKAGE = 'lmsco_ros'
# colcon cannot read the `attr:` of setup.cfg.
VERSION = re.search(r"^__version__ = '(.+)'$",
                    (Path(__file__).parent / PACKAGE / '__init__.py').read_text(), re.MULTILINE)
DOCS = ['myst-parser>=4,<6', 'sphinx>=8,<10']

setup(
    name=PACKAGE,
    version=VERSION[1],
    packages=find_packages(include=[f'{PACKAGE}*', 'msg_adapters*']),
    package_data={PACKAGE: [
        'core/weights/*.safetensors',
        'evaluation/**/*.html',
        'evaluation/**/*.txt',
        'evaluation/**/*.yaml',
    ]},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        (f'share/{PACKAGE}/config', sorted(glob('config/*'))),
        (f'share/{PACKAGE}/launch', sorted(glob('launch/*.launch.py'))),
    ],
    python_requires='>=3.10,<3.13',
    install_requires=[
        'array-api-compat>=1.9,<2',
        'av>=15,<19',
        'jinja2>=3.0,<4',
        'lz4>=4,<5',
        'matplotlib>=3.5,<4',
        'numpy>=1.26,<3',
        'opencv-python-headless>=4.9,<6',
        'platformdirs>=4,<5',
        'protobuf>=4.22,<8',
        'pyyaml>=5.4,<7',
        'requests>=2.28,<3',
        'rich>=12,<16',
        'rosbags>=0.11,<0.12',
        'safetensors>=0.4.3,<1',
        'scipy>=1.11,<2',
        'threadpoolctl>=3.0,<4',
        'torch>=2.4,<3',
        'typer>=0.9,<1',
    ],
    extras_require={
        'ros': [
            'ros-rclpy[fastrtps]==7.1.6',
            'ros-jazzy-common-interfaces>=5.3,<6',
        ],
        'peers': ['opencv-contrib-python-headless>=4.9,<6'],
        'vot': ['vot-trax==4.0.2'],
        'docs': DOCS,
        'test': [
            *DOCS,
            'colcon-common-extensions>=0.3,<1',
            'colcon-ros>=0.5,<1',
            'flake8>=7,<8',
            'flake8-import-order>=0.18,<1',
            'flake8-quotes>=3.4,<4',
            'hypothesis>=6,<7',
            'mypy>=1.10,<3',
            'pydocstyle>=6.3,<7',
            'pytest>=8,<10',
            'pytest-timeout>=2.3,<3',
            'pytest-xdist>=3.5,<4',
            'vot-trax==4.0.2',
        ],
    },
    zip_safe=False,
    maintainer='lmsco_ros contributors',
    maintainer_email='maintainers@users.noreply.github.com',
    description='Thermal-camera tracker: large-margin structured correlation filters for ROS 2',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            f'tracker_node = {PACKAGE}.node.main:main',
            f'lmsco = {PACKAGE}.cli.main:main',
        ],
    },
)

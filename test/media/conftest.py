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

"""Small films of every kind."""

import av
import cv2
import numpy as np
import pytest


@pytest.fixture
def film(tmp_path):
    """Return a function that writes images as a film and returns its path."""
    def write(name, images, *, codec='ffv1', pixels='gray', stored='gray', times=None,
              rate=25, **options):
        path = tmp_path / name
        with av.open(str(path), 'w') as container:
            stream = container.add_stream(codec, rate=rate, options=options)
            stream.height, stream.width = images[0].shape[:2]
            stream.pix_fmt = pixels
            for index, image in enumerate(images):
                frame = av.VideoFrame.from_ndarray(image, format=stored).reformat(format=pixels)
                frame.pts = index if times is None else times[index]
                container.mux(stream.encode(frame))
            container.mux(stream.encode(None))
        return path
    return write


@pytest.fixture
def counts():
    """Return twelve images of 16-bit counts."""
    random = np.random.default_rng(0)
    return [random.integers(7000, 8000, (48, 64)).astype(np.uint16) for _ in range(12)]


@pytest.fixture
def levels():
    """Return twelve smooth images of 8 bits, each brighter than the one before."""
    random = np.random.default_rng(1)
    scene = cv2.GaussianBlur(random.integers(0, 200, (48, 64)).astype(np.float32), (0, 0), 3)
    return [(scene + 4 * index).astype(np.uint8) for index in range(12)]

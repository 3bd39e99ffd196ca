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

"""The film plays, and shows every frame."""

import cv2
import numpy as np
import pytest

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.visualization.overlay_video import enlargement, OverlayVideo


def result(x=20.0):
    box = BoundingBox(x, 10, 12, 16)
    return TrackResult(box, 0.8, TrackState.TRACKING, np.zeros((4, 4), np.float32), box)


def played(path):
    capture, frames = cv2.VideoCapture(str(path)), []
    while (item := capture.read())[0]:
        frames.append(item[1])
    return frames, capture.get(cv2.CAP_PROP_FPS)


@pytest.mark.parametrize('image', [
    np.random.default_rng(0).integers(7000, 8000, (120, 160)).astype(np.uint16),
    np.full((361, 479), 90, np.uint8), np.full((400, 500, 3), 90, np.uint8)],
    ids=['16 bit', 'odd size', 'color'])
def test_film_plays_with_all_frames(tmp_path, image):
    with OverlayVideo(tmp_path / 'overlay.mp4', 25) as film:
        for index in range(12):
            film.add(image, {1: result(20 + index)}, label=str(index))
    frames, fps = played(tmp_path / 'overlay.mp4')
    assert len(frames) == 12 and fps == pytest.approx(25)
    height = image.shape[0] * enlargement(image.shape[0])
    assert frames[0].shape[0] in (height, height + 1)


def test_box_moves_in_the_film(tmp_path):
    image = np.full((400, 400), 30, np.uint8)
    with OverlayVideo(tmp_path / 'overlay.mp4', 25) as film:
        for x in (100.0, 300.0):
            film.add(image, {1: result(x)})
    frames, _ = played(tmp_path / 'overlay.mp4')
    green = [f[5:35, 90:].astype(int) for f in frames]
    centers = [np.argwhere(g[..., 1] - g[..., 2] > 60)[:, 1].mean() + 90 for g in green]
    assert centers == pytest.approx([106, 306], abs=3)


def test_small_images_are_enlarged_and_large_ones_are_not():
    assert enlargement(120) == 4 and enlargement(60) == 8
    assert enlargement(256) == 2
    assert enlargement(356) == enlargement(512) == enlargement(1080) == 1


def test_a_size_that_changes_does_not_end_the_film(tmp_path):
    with OverlayVideo(tmp_path / 'overlay.mp4', 25) as film:
        film.add(np.full((400, 500), 90, np.uint8), {1: result()})
        film.add(np.full((480, 640), 90, np.uint8), {1: result()})
    assert len(played(tmp_path / 'overlay.mp4')[0]) == 2


def test_view_without_drawings_is_returned(tmp_path):
    image = np.full((400, 400), 30, np.uint8)
    with OverlayVideo(tmp_path / 'overlay.mp4', 25) as film:
        view = film.add(image, {1: result()}, truth=BoundingBox(50, 50, 20, 20))
    assert (view == 30).all()


def test_a_place_that_cannot_be_written_is_told(tmp_path):
    with pytest.raises(OSError, match=r'No such file.*overlay\.mp4'):
        with OverlayVideo(tmp_path / 'missing' / 'overlay.mp4', 25) as film:
            film.add(np.full((400, 400), 30, np.uint8), {1: result()})

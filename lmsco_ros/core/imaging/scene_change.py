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

"""What happens between two frames: the closed shutter, a switched polarity, a cut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ['same_picture', 'SceneChange', 'SceneMonitor', 'scene_pattern']

# Consecutive frames of real sequences, camera in motion or not, correlate above -0.02, and
# mostly above 0.8: an inverted one lies far on the other side.
_INVERTED_CORRELATION = -0.5

# Of 42,900 pairs of consecutive frames, 27 correlate less than this: all of them cuts but four,
# in which a camera swept over treetops.
_CUT_CORRELATION = 0.7

# A telemetry line counts on while the picture stands, so the outermost rows do not decide.
_MARGIN_SHARE = 16


def same_picture(previous: np.ndarray, probe: np.ndarray) -> bool:
    """
    Return whether the picture stands: the same bits as one frame before.

    Parameters
    ----------
    previous, probe : ndarray, shape (h, w)
        Probes of two frames. The outermost rows do not count, where telemetry counts on.

    """
    if previous.shape != probe.shape or previous.dtype != probe.dtype:
        return False
    margin = max(1, probe.shape[0] // _MARGIN_SHARE)
    return previous[margin:-margin].tobytes() == probe[margin:-margin].tobytes()


@dataclass(frozen=True)
class SceneChange:
    """
    What has happened between two frames.

    Attributes
    ----------
    switched : bool
        Warm and cold have changed places.
    cut : bool
        The picture shows another scene, or the same one from elsewhere.

    """

    switched: bool = False
    cut: bool = False


class SceneMonitor:
    """
    Tells when the camera switches its polarity (white hot, black hot), or its view.

    Two frames in a row show nearly the same scene. When their probes correlate negatively, warm
    and cold have changed places; when they hardly correlate, the view has been cut.
    """

    def __init__(self) -> None:
        self._pattern: np.ndarray | None = None
        self._inverted = False

    @property
    def inverted(self) -> bool:
        """Whether the polarity is not the one of the first frame."""
        return self._inverted

    def observe(self, pattern: np.ndarray | None) -> SceneChange:
        """
        Take note of a frame and return what has just changed.

        Parameters
        ----------
        pattern : ndarray or None
            What `scene_pattern` returns for the frame.

        """
        if pattern is None:
            return SceneChange()
        before, self._pattern = self._pattern, pattern
        if before is None or before.size != pattern.size:
            return SceneChange()
        correlation = float(np.dot(before, pattern))
        switched = correlation < _INVERTED_CORRELATION
        self._inverted ^= switched
        return SceneChange(switched, not switched and correlation < _CUT_CORRELATION)


def scene_pattern(probe: np.ndarray, low: float, high: float) -> np.ndarray | None:
    """
    Return a frame's probe as a vector of mean 0 and length 1, None when it shows nothing.

    Parameters
    ----------
    probe : ndarray, shape (h, w)
        Probe of the frame; pixels that are not finite do not count.
    low, high : float
        Range of its counts; what lies outside is cut off.

    """
    values = probe.astype(np.float32).ravel()
    values -= np.float32(low)
    values *= np.float32(1 / (high - low))
    if probe.dtype == np.float32:
        values[~np.isfinite(values)] = np.float32(0.5)
    np.clip(values, 0, 1, out=values)
    values -= values.mean()
    length = float(np.sqrt(np.dot(values, values)))
    return values / np.float32(length) if length > 0 else None

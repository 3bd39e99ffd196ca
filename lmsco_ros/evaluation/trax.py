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
TraX server: any preset as a tracker of the official VOT toolkit.

`python -m lmsco_ros.evaluation.trax --preset hcs --channel ir` speaks the TraX protocol
[1]_ over its standard streams, or over the socket named in `TRAX_SOCKET`. It is started by a TraX
client such as the VOT toolkit (`docs/vot.md`) and needs the extra `vot`.

References
----------
.. [1] L. Cehovin, "TraX: The visual Tracking eXchange protocol and library",
   Neurocomputing 260, 2017.

"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
import sys
from typing import Any, Protocol

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.core import (
    BoundingBox, BoxError, ImageError, LMSCOError, LMSCOTracker, TrackerConfig, TrackResult)
from lmsco_ros.extras import MissingExtraError, require_extra
from lmsco_ros.media.false_color import without_false_color


class ServedTracker(Protocol):
    """What the server asks of a tracker; `LMSCOTracker` is one."""

    def initialize(self, image: npt.NDArray[Any], box: BoundingBox) -> TrackResult:
        """Start on the target in `box`, whatever was tracked before."""

    def update(self, image: npt.NDArray[Any]) -> TrackResult:
        """Find the target in the next image."""


def read_image(resource: Any) -> npt.NDArray[Any]:
    """
    Return the pixels of a TraX image.

    Parameters
    ----------
    resource : trax.Image
        File, encoded buffer, or array in memory.

    Returns
    -------
    ndarray, shape (H, W) uint8 | uint16, or (H, W, 3) uint8 (BGR)
        One channel also where gray was stored as three; 16 bits stay 16 bits.

    Raises
    ------
    ImageError
        When the file or the buffer is no readable image.

    """
    kind = resource.type()
    if kind == 'memory':
        return without_false_color(_gray_or_bgr(resource.array()))
    if kind == 'path':
        return without_false_color(_decode(_read_bytes(resource.path()), resource.path()))
    if kind == 'buffer':
        return without_false_color(_decode(resource.buffer(), 'the encoded image of the client'))
    raise ImageError(f'the client sent a {kind} image; send a file path, an encoded buffer, '
                     'or an image in memory')


def _gray_or_bgr(pixels: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Turn (H, W, 1) or RGB, as TraX hands them out, into (H, W) or BGR."""
    return pixels[..., 0] if pixels.shape[2] == 1 else np.ascontiguousarray(pixels[..., ::-1])


def _read_bytes(path: str) -> bytes:
    """Return the content of a file, or say that it cannot be read."""
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise ImageError(f'{path} cannot be read ({error.strerror}); '
                         'check the sequence folder of the client') from error


def _decode(encoded: bytes, source: str) -> npt.NDArray[Any]:
    """Decode the bytes of an image file that came from `source`."""
    image = cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_UNCHANGED) \
        if encoded else None
    if image is None:
        raise ImageError(f'{source} ({len(encoded)} bytes) is no complete image; '
                         'expected a format that OpenCV reads, such as png or jpeg')
    return image


def read_box(objects: Sequence[tuple[Any, Any]] | None) -> BoundingBox:
    """
    Return the box of the one object that the client wants tracked.

    Parameters
    ----------
    objects : sequence of (trax.Rectangle, properties)
        Clients turn polygons into their axis-aligned boxes for a server of rectangles.

    Raises
    ------
    BoxError
        When there is not exactly one object, or its box is empty.

    """
    if not objects or len(objects) != 1:
        raise BoxError(f'the client sent {len(objects or ())} objects; this tracker follows one, '
                       'run a single-object experiment')
    return BoundingBox(*objects[0][0].bounds())


def answer(request: Any, tracker: ServedTracker, channel: str) -> TrackResult:
    """Give one TraX request (`trax.server.Request`) to the tracker."""
    image = read_image(request.image[channel])
    if request.type == 'initialize':
        return tracker.initialize(image, read_box(request.objects))
    return tracker.update(image)


def serve(handle: Any, make_tracker: Callable[[], ServedTracker], channel: str,
          make_region: Callable[[float, float, float, float], Any]) -> None:
    """
    Answer a TraX client until it quits.

    The tracker is made on the first request, not before the handshake: a client learns why a
    session ended only within one.

    Parameters
    ----------
    handle : trax.Server
        Requests come from its `wait`; results go to `status`, the reason of a failure to `quit`.
    make_tracker : callable
        Makes the tracker of the whole session.
    channel : str
        Image channel that `handle` announced, in TraX's name.
    make_region : callable
        Region from x, y, width, height; `trax.Rectangle.create`.

    Raises
    ------
    Exception
        Whatever the tracker raised, after the client was told the reason.

    """
    tracker = None
    while True:
        request = handle.wait()
        if request.type == 'quit':
            return
        try:
            tracker = make_tracker() if tracker is None else tracker
            result = answer(request, tracker, channel)
        except Exception as error:
            handle.quit(_reason(error))
            raise
        handle.status([(make_region(*result.box.as_tuple()),
                        {'confidence': float(result.score), 'state': result.state.value})])


def _reason(error: Exception) -> str:
    """Say why the session ended; the protocol carries ASCII only."""
    text = str(error) if isinstance(error, LMSCOError) else f'{type(error).__name__}: {error}'
    return text.encode('ascii', 'backslashreplace').decode('ascii')


def served_config(preset: str, path: Path | None) -> TrackerConfig:
    """Return the configuration in the YAML file `path` if there is one, else the preset."""
    return TrackerConfig.from_yaml(path) if path else TrackerConfig.preset(preset)


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog='python -m lmsco_ros.evaluation.trax',
        description='TraX server for the VOT toolkit; started by the toolkit, not by hand.')
    source = parser.add_mutually_exclusive_group()
    source.add_argument('--preset', default='default',
                        help=f'one of {", ".join(TrackerConfig.preset_names())} '
                             '(default: %(default)s)')
    source.add_argument('--config', type=Path, metavar='FILE', help='tracker settings as YAML')
    parser.add_argument('--channel', choices=('ir', 'color'), default='ir',
                        help='channel that the sequences declare; either may hold gray or color '
                             'images (default: %(default)s, as in VOT-TIR)')
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Run the server; the console entry of this module.

    Returns
    -------
    int
        0 after the client quit, 1 after a failure, 2 when the TraX library is missing.

    """
    options = parse(arguments)
    try:
        require_extra('vot', 'the TraX server')
    except MissingExtraError as error:
        print(error, file=sys.stderr)
        return 2
    import trax

    handle = trax.Server(
        [trax.Region.RECTANGLE], [trax.Image.PATH, trax.Image.MEMORY, trax.Image.BUFFER],
        [options.channel], 'lmsco', 'Large margin structured convolution operator', 'correlation')

    def make_tracker() -> ServedTracker:
        return LMSCOTracker(served_config(options.preset, options.config))

    try:
        serve(handle, make_tracker, options.channel, trax.Rectangle.create)
    except (LMSCOError, trax.TraxException) as error:
        print(f'session ended: {error}', file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())

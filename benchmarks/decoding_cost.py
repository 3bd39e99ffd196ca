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
What the costliest compressed images take that the default limits let through.

Each is decoded in a process of its own. In the folder of the repository:
python -m benchmarks.decoding_cost [--page docs/field.md]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from types import MappingProxyType

from sensor_msgs.msg import CompressedImage

from benchmarks.call_cost import call_cost, CallCost
from benchmarks.challenge_table import insert
from benchmarks.costly_images import noise_jpeg, noise_png, scans_jpeg
from benchmarks.measurement import markdown_table
from msg_adapters.compressed import DecodingLimits, image_from_compressed

__all__ = ['COSTLIEST', 'cost_table', 'decoding_cost']

_SIDE = int(DecodingLimits().pixels ** 0.5)
_SCANS = DecodingLimits().scans
_REPEATS = 3

COSTLIEST: Mapping[str, Callable[[], bytes]] = MappingProxyType({
    f'baseline jpeg, color, {_SIDE}x{_SIDE}': lambda: noise_jpeg(_SIDE, _SIDE, progressive=False),
    f'progressive jpeg as OpenCV writes it, color, {_SIDE}x{_SIDE}':
        lambda: noise_jpeg(_SIDE, _SIDE, progressive=True),
    f'progressive jpeg, {_SCANS} scans with next to nothing, color, {_SIDE}x{_SIDE}':
        lambda: scans_jpeg(_SIDE, _SIDE, _SCANS),
    f'progressive jpeg, {_SCANS} scans, as much data as fits, color, {_SIDE}x{_SIDE}':
        lambda: scans_jpeg(_SIDE, _SIDE, _SCANS, full=9),
    f'png, gray of 16 bits, {_SIDE}x{_SIDE}':
        lambda: noise_png(_SIDE, _SIDE, color=0, depth=16, interlace=False),
    f'png, interlaced, gray of 16 bits, {_SIDE}x{_SIDE}':
        lambda: noise_png(_SIDE, _SIDE, color=0, depth=16, interlace=True),
    f'png, color of 16 bits with transparency, {_SIDE}x{_SIDE // 2}':
        lambda: noise_png(_SIDE, _SIDE // 2, color=6, depth=16, interlace=False),
    f'png, interlaced, color of 16 bits with transparency, {_SIDE}x{_SIDE // 2}':
        lambda: noise_png(_SIDE, _SIDE // 2, color=6, depth=16, interlace=True),
    f'png, interlaced, color with transparency, {_SIDE}x{_SIDE}':
        lambda: noise_png(_SIDE, _SIDE, color=6, depth=8, interlace=True),
})
"""Files at the limits, by what they are."""


def decoding_cost(data: bytes, limits: DecodingLimits = DecodingLimits()) -> CallCost:
    """
    Return what a file takes in a fresh process: the most memory, and the median time, of three.

    Parameters
    ----------
    data : bytes
        The file.
    limits : DecodingLimits, optional
        What it may cost.

    Raises
    ------
    ImageMessageError
        When it is refused.

    """
    with ProcessPoolExecutor(1, mp_context=get_context('spawn')) as pool:
        return pool.submit(_decode, data, limits).result()


def cost_table(files: Mapping[str, Callable[[], bytes]] = COSTLIEST) -> str:
    """Return a table in Markdown of what each file takes."""
    rows = []
    for name, make in files.items():
        data = make()
        cost = decoding_cost(data)
        rows.append((name, len(data) / 2 ** 20, cost.seconds, cost.mebibytes))
    return markdown_table(('image', 'file (MiB)', 'processor time (s)', 'memory (MiB)'), rows)


def main(arguments: list[str] | None = None) -> None:
    """Print the table, or write it into a page."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('--page', type=Path, help='Markdown page that takes the table')
    options = parser.parse_args(arguments)
    table = cost_table()
    print(table)
    if options.page is not None:
        page = insert(options.page.read_text(encoding='utf-8'), 'decoding', table)
        options.page.write_text(page, encoding='utf-8')


def _decode(data: bytes, limits: DecodingLimits) -> CallCost:
    message = CompressedImage(data=data)
    costs = [call_cost(lambda: image_from_compressed(message, limits)) for _ in range(_REPEATS)]
    return CallCost(sorted(cost.seconds for cost in costs)[_REPEATS // 2],
                    max(cost.mebibytes for cost in costs))


if __name__ == '__main__':
    main()

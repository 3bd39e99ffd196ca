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

"""The commands on images: what the costliest take, and what becomes of generated ones."""

import pytest
from sensor_msgs.msg import CompressedImage

from benchmarks import image_fuzz
from benchmarks.costly_images import noise_jpeg, noise_png, scans_jpeg
from benchmarks.decoding_cost import cost_table, COSTLIEST
from benchmarks.image_fuzz import fuzz, Generator, KINDS, UnexpectedError
from msg_adapters.compressed import image_from_compressed


@pytest.mark.parametrize('seed', range(4))
def test_generated_images_are_read_or_refused(seed):
    tallies = fuzz(500, seed)
    assert sum(tally.read + tally.refused for tally in tallies.values()) == 500
    assert all(tally.read and tally.refused for tally in tallies.values())


@pytest.mark.parametrize('kind', KINDS)
def test_the_same_seed_makes_the_same_images(kind):
    first, second = Generator(3), Generator(3)
    assert [first.message(kind) for _ in range(5)] == [second.message(kind) for _ in range(5)]


def test_what_is_neither_read_nor_refused_ends_the_run(monkeypatch):
    def divide(message):
        return 1 / 0

    monkeypatch.setattr(image_fuzz, 'image_from_message', divide)
    with pytest.raises(UnexpectedError, match=r'image 0 \(raw\) of seed 5: ZeroDivisionError'):
        fuzz(1, seed=5)


@pytest.mark.parametrize('data', [
    noise_jpeg(64, 48, progressive=False), noise_jpeg(64, 48, progressive=True),
    scans_jpeg(64, 48, 20), scans_jpeg(64, 48, 20, full=5),
    noise_png(64, 48, color=2, depth=8, interlace=False),
    noise_png(64, 48, color=2, depth=8, interlace=True)])
def test_costly_images_are_whole(data):
    image = image_from_compressed(CompressedImage(data=data))
    assert image.shape == (48, 64, 3) and (image.std() > 0 or len(data) < 5000)


def test_costs_are_measured_in_a_process_of_their_own():
    (row,) = cost_table({'png': lambda: noise_png(
        1024, 1024, color=0, depth=16, interlace=False)}).splitlines()[2:]
    name, _, seconds, mebibytes = row.strip('| ').split(' | ')
    assert name == 'png' and float(seconds) > 0 and float(mebibytes) > 1


def test_the_costliest_files_are_at_the_limits():
    assert any('4096x4096' in name for name in COSTLIEST)

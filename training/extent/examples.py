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

"""From pairs of pictures to what the network sees and what it should say."""

from __future__ import annotations

from dataclasses import dataclass, replace
import math

import torch
from torch.nn import functional

from training.extent.pairs import Pairs
from training.extent.windows import SIDE

__all__ = ['Examples', 'examples', 'patches']

_OVERSAMPLING = 3


@dataclass(frozen=True)
class Examples:
    """
    What `ExtentNet` is trained on.

    Attributes
    ----------
    first, now : tensor, shape (n, 3, S, S)
        Patches around the first box and around an expected one.
    sides : tensor, shape (n, 2)
        Binary logarithms of the sides of both boxes in pixels; 0 where there is no first one.
    known : tensor, shape (n,), bool
        Whether there is a first one; otherwise the target was only pointed at.
    half : tensor, shape (n, 2)
        Halves of the sides of the expected box, in halves of a patch.
    edges : tensor, shape (n, 4)
        The target's from those of the expected box, in halves of a patch.
    measurable : tensor, shape (n,), bool
        Whether the target is in the second patch, so that the edges mean something.
    present : tensor, shape (n,), bool
        Whether the expected box is at the target.

    """

    first: torch.Tensor
    now: torch.Tensor
    sides: torch.Tensor
    known: torch.Tensor
    half: torch.Tensor
    edges: torch.Tensor
    measurable: torch.Tensor
    present: torch.Tensor

    def to(self, device: torch.device) -> Examples:
        """Return the examples on a device."""
        return Examples(*(value.to(device) for value in vars(self).values()))

    @property
    def truth(self) -> torch.Tensor:
        """Edges of the target from the middle of the patch, in its halves, shape (n, 4)."""
        return self.boxed(self.edges)

    def boxed(self, edges: torch.Tensor) -> torch.Tensor:
        """Return edges that are given from those of the expected box, from the middle."""
        return torch.cat([-self.half, self.half], dim=1) + edges


@torch.no_grad()
def examples(pairs: Pairs, size: int, context: float) -> Examples:
    """
    Return what a person would mark in the first frames, and a tracker expect in the later ones.

    A third of the targets is cut by a border of the image; the label is their visible part. All
    labels of a target have the margin of the first box, whoever drew it: the convention is
    learned from there. Boxes that persons draw, and those that trackers expect, are off.

    Parameters
    ----------
    pairs : Pairs
        Pictures and exact boxes.
    size : int
        Side of a patch in pixels.
    context : float
        Side of a patch over that of its box.

    """
    count, device = len(pairs.images), pairs.images.device
    bounds = _bordered(pairs)
    drawn = _with_margins(pairs)
    visible = _clipped(drawn, bounds)
    first = _clipped(_off(visible[:, 0], 0.1 * _draw(count, device), 0.4 / pairs.scales[:, 0]),
                     bounds[:, 0])
    entered = (visible[:, 0] != drawn[:, 0]).any(dim=1)
    expected, near = _expected(first, visible[:, 1], pairs.present, entered)
    known = torch.rand(count, device=device) >= 0.15
    square = _pointed_at(visible[:, 1])
    expected = torch.where((known | ~near)[:, None], expected, square)
    boxes = torch.stack([first, expected], 1)
    seen = patches(pairs.images, boxes, bounds, size, context)
    side = _side(boxes) * pairs.scales
    reach = context * _side(expected)[:, None] / 2
    middle = (expected[:, :2] + expected[:, 2:]).repeat(1, 2) / 2
    # What reaches out of the patch is seen to reach to its border.
    seen_edges = middle + ((visible[:, 1] - middle) / reach).clamp(-1, 1) * reach
    edges = (seen_edges - expected) / reach
    measurable = pairs.present & near
    sides = torch.log2(side)
    sides[:, 0] *= known
    flips = torch.rand(2, device=device) < 0.5
    half = (expected[:, 2:] - expected[:, :2]) / 2 / reach
    return _flipped(Examples(seen[:, 0], seen[:, 1], sides, known, half, edges, measurable,
                             pairs.present & near), *flips.tolist())


def patches(images: torch.Tensor, boxes: torch.Tensor, bounds: torch.Tensor, size: int,
            context: float) -> torch.Tensor:
    """
    Return the patches around boxes, as the tracker cuts them.

    Parameters
    ----------
    images : tensor, shape (n, k, SIDE, SIDE)
        Pictures.
    boxes : tensor, shape (n, k, 4)
        In their pixels.
    bounds : tensor, shape (n, k, 4)
        What the image covers; its border is repeated outside.
    size, context : int, float
        As for `examples`.

    Returns
    -------
    tensor, shape (n, k, 3, size, size)
        Intensity; 1 inside of the box; 1 inside of the image.

    """
    count, views = boxes.shape[:2]
    boxes, bounds = boxes.reshape(-1, 4), bounds.reshape(-1, 4)
    middle = (boxes[:, :2] + boxes[:, 2:]) / 2
    reach = context * _side(boxes)[:, None] / 2
    fine = _OVERSAMPLING * size
    axis = (2 * torch.arange(fine, device=boxes.device) + 1) / fine - 1
    lines = [middle[:, i, None] + reach * axis for i in range(2)]
    held = [torch.minimum(torch.maximum(line, bounds[:, i, None] + 0.5),
                          bounds[:, i + 2, None] - 0.5) for i, line in enumerate(lines)]
    grid = torch.stack([held[0][:, None].expand(-1, fine, -1), held[1][:, :, None].expand(
        -1, -1, fine)], dim=-1) * (2 / SIDE) - 1
    flat = images.reshape(-1, 1, SIDE, SIDE)
    intensity = functional.avg_pool2d(
        functional.grid_sample(flat, grid, padding_mode='border', align_corners=False),
        _OVERSAMPLING)
    masks = [(_inside(lines[0], limits[:, 0], limits[:, 2], size)[:, None, None]
              * _inside(lines[1], limits[:, 1], limits[:, 3], size)[:, None, :, None])
             for limits in (boxes, bounds)]
    return torch.cat([intensity, *masks], 1).reshape(count, views, 3, size, size)


def _inside(line: torch.Tensor, low: torch.Tensor, high: torch.Tensor, size: int) -> torch.Tensor:
    """Return how much of each of `size` pixels lies between limits, shape (n, size)."""
    inside = (line >= low[:, None]) & (line <= high[:, None])
    return inside.float().reshape(len(line), size, -1).mean(dim=2)


def _bordered(pairs: Pairs) -> torch.Tensor:
    """Return what the images cover, with a border through or near the target in a third."""
    count, device = len(pairs.images), pairs.images.device
    axis = torch.randint(2, (count,), device=device)
    far = torch.rand(count, device=device) < 0.5
    which = torch.where(far, axis + 2, axis)
    rows = torch.arange(count, device=device)
    bounds = pairs.bounds.clone()
    cut = torch.rand(count, device=device) < 0.4
    fates = torch.rand(count, device=device)
    # The first frame alone is cut, the later one alone, or both.
    hidden = torch.stack([fates < 0.75, fates >= 0.6], 1)
    for k in range(2):
        low, high = pairs.boxes[rows, k, axis], pairs.boxes[rows, k, axis + 2]
        length = high - low
        share = 0.15 + 0.8 * torch.rand(count, device=device)
        spare = 1.5 * length * torch.rand(count, device=device)
        inner = torch.where(hidden[:, k], -share * length, spare)
        edge = torch.where(far, high + inner, low - inner)
        shown = torch.where(far, edge - low, high - edge)
        used = cut & (shown >= torch.maximum(0.2 * length, torch.full_like(length, 2.0)))
        old = bounds[rows, k, which]
        inward = torch.where(far, torch.minimum(edge, old), torch.maximum(edge, old))
        bounds[rows, k, which] = torch.where(used, inward, old)
    return bounds


def _with_margins(pairs: Pairs) -> torch.Tensor:
    """Return the boxes with margins alike in both frames: parts of the sides, and pixels."""
    count, device = len(pairs.images), pairs.images.device
    some = torch.rand(count, 1, device=device) < 0.7
    part = -0.1 * torch.log(torch.rand(count, 1, device=device)) - 0.04
    part = part.clamp(max=0.5) + 0.03 * torch.randn(count, 4, device=device)
    pixels = 2.5 * torch.rand(count, 1, device=device).square()
    sides = (pairs.boxes[..., 2:] - pairs.boxes[..., :2]).repeat(1, 1, 2)
    margin = part[:, None] * sides + pixels[:, None] / pairs.scales[..., None]
    sign = torch.tensor([-1.0, -1, 1, 1], device=device)
    return pairs.boxes + sign * margin * some[:, None]


def _clipped(boxes: torch.Tensor, bounds: torch.Tensor) -> torch.Tensor:
    """Return the parts of boxes (..., 4) in images, at least two pixels wide and high."""
    low = torch.minimum(torch.maximum(boxes[..., :2], bounds[..., :2]), bounds[..., 2:] - 2)
    high = torch.maximum(torch.minimum(boxes[..., 2:], bounds[..., 2:]), low + 2)
    return torch.cat([low, high], dim=-1)


def _off(boxes: torch.Tensor, part: torch.Tensor, pixels: torch.Tensor) -> torch.Tensor:
    """Return boxes (n, 4) as a person draws them."""
    sides = (boxes[:, 2:] - boxes[:, :2]).repeat(1, 2)
    return boxes + (part[:, None] * sides + pixels[:, None]) * torch.randn_like(boxes)


def _expected(first: torch.Tensor, now: torch.Tensor, present: torch.Tensor,
              entered: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """
    Return where trackers expect the target, and whether that is near it.

    They are off by more than those of a tracker that goes well: otherwise the network would learn
    to trust them, and its answers would tell nothing new. Some expect the size of the first
    frame; of what had entered by a part then, that part, or more of it. Some look beside the
    target.
    """
    count, device = len(first), first.device
    wrong = 0.1 * 4.0**torch.rand(count, 1, device=device)
    size = (now[:, 2:] - now[:, :2]) * torch.exp(
        wrong * torch.randn(count, 1, device=device)
        + 0.7 * wrong * torch.randn(count, 2, device=device))
    as_first = torch.rand(count, 1, device=device) < 0.2
    size = torch.where(as_first, first[:, 2:] - first[:, :2], size)
    side = _side(now)[:, None]
    shift = (0.6 * wrong * torch.randn(count, 2, device=device)).clamp(-0.35, 0.35) * side
    part = (entered & (torch.rand(count, device=device) < 0.6))[:, None]
    whole = now[:, 2:] - now[:, :2]
    held = torch.minimum(first[:, 2:] - first[:, :2], whole)
    known = torch.rand(count, 1, device=device).square()
    size = torch.where(part, held * (whole / held)**known, size)
    room = (now[:, 2:] - now[:, :2] - size).clamp(min=0)
    shift = torch.where(part, room * (torch.rand(count, 2, device=device) - 0.5), shift)
    angle = 2 * math.pi * torch.rand(count, 1, device=device)
    away = torch.cat([torch.cos(angle), torch.sin(angle)], 1)
    away = away / away.abs().amax(dim=1, keepdim=True) * (
        0.75 + 2.25 * torch.rand(count, 1, device=device))
    near = ~present | (torch.rand(count, device=device) >= 0.15)
    away = away * (now[:, 2:] - now[:, :2])
    middle = (now[:, :2] + now[:, 2:]) / 2 + torch.where(near[:, None], shift, away)
    return torch.cat([middle - size / 2, middle + size / 2], 1), near


def _pointed_at(boxes: torch.Tensor) -> torch.Tensor:
    """Return squares around a point near the middle of boxes, of some size."""
    count, device = len(boxes), boxes.device
    sides = boxes[:, 2:] - boxes[:, :2]
    middle = (boxes[:, :2] + boxes[:, 2:]) / 2 + sides * 0.5 * (
        torch.rand(count, 2, device=device) - 0.5)
    half = 0.5 * _side(boxes) * torch.exp(0.4 * torch.randn(count, device=device))
    return torch.cat([middle - half[:, None], middle + half[:, None]], 1)


def _flipped(given: Examples, left_right: bool, up_down: bool) -> Examples:
    """Return a batch, or its mirror image."""
    first, now, edges = given.first, given.now, given.edges
    if left_right:
        first, now, edges = first.flip(3), now.flip(3), edges[:, [2, 1, 0, 3]] * edges.new_tensor(
            [-1, 1, -1, 1])
    if up_down:
        first, now, edges = first.flip(2), now.flip(2), edges[:, [0, 3, 2, 1]] * edges.new_tensor(
            [1, -1, 1, -1])
    return replace(given, first=first, now=now, edges=edges)


def _side(boxes: torch.Tensor) -> torch.Tensor:
    """Return the sides of squares as large as boxes (..., 4)."""
    return (boxes[..., 2:] - boxes[..., :2]).clamp(min=1e-3).prod(dim=-1).sqrt()


def _draw(count: int, device: torch.device) -> torch.Tensor:
    """Return evenly distributed numbers, shape (n,)."""
    return torch.rand(count, device=device)

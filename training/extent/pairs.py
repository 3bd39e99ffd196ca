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

"""Pairs of pictures of one target: rendered, cut from stills, or taken from clips."""

from __future__ import annotations

from dataclasses import dataclass
import math

import torch
from torch.nn import functional

from training.extent.bodies import (
    Bodies, chosen_of, draw, edges, posed, sample_bodies, transformed)
from training.extent.windows import SIDE, Windows

__all__ = ['ClipPairs', 'Pairs', 'RenderedPairs', 'StillPairs']

_SMALLEST, _LARGEST = 6.0, 56.0


@dataclass(frozen=True)
class Pairs:
    """
    First frames and later ones.

    Attributes
    ----------
    images : tensor, shape (n, 2, SIDE, SIDE)
        Intensities; range and offset mean nothing.
    boxes : tensor, shape (n, 2, 4)
        The target (x0, y0, x1, y1) in pixels; where it would be, if it is not there.
    bounds : tensor, shape (n, 2, 4)
        What the image covers.
    scales : tensor, shape (n, 2)
        Pixels of the camera in one of the picture.
    present : tensor, shape (n,), bool
        Whether the later frame shows the target.

    """

    images: torch.Tensor
    boxes: torch.Tensor
    bounds: torch.Tensor
    scales: torch.Tensor
    present: torch.Tensor

    @staticmethod
    def joined(parts: list[Pairs]) -> Pairs:
        """Return the pairs of several sources."""
        return Pairs(*(torch.cat(values) for values in zip(
            *(vars(part).values() for part in parts), strict=True)))


class RenderedPairs:
    """
    Bodies before real or made textures, with others beside them.

    Parameters
    ----------
    textures : Windows
        Pictures of anything.

    """

    def __init__(self, textures: Windows) -> None:
        self._textures = textures

    def __call__(self, count: int) -> Pairs:
        """Return pairs; a fifth of the later frames is without the target."""
        device = self._textures.images.device
        bodies = sample_bodies(count, device)
        side = _SMALLEST * (_LARGEST / _SMALLEST)**torch.rand(count, device=device)
        one = _seen(bodies, 0.1, device)
        unit = side / _side(edges(one))
        bent = 0.08 * torch.rand(count, device=device)
        bent = torch.where(torch.rand(count, device=device) < 0.25, 2.5 * bent, bent)
        two = _seen(posed(bodies, bent), 0.12, device)
        growth = torch.exp(0.4 * torch.randn(count, device=device))
        scales = torch.stack([unit, unit * growth], dim=1)
        places = SIDE / 2 + 0.1 * SIDE * (torch.rand(count, 2, 2, device=device) - 0.5)
        extents = torch.stack([edges(one), edges(two)], dim=1)
        middles = (extents[..., :2] + extents[..., 2:]) / 2
        origins = places - scales[..., None] * middles
        boxes = extents * scales[..., None] + origins.repeat(1, 1, 2)
        fate = torch.rand(count, device=device)
        pictures, contrast = self._backgrounds(count), _contrasts(count, device)
        for _ in range(2):
            pictures = _with_another(pictures, bodies, boxes, contrast, 0.5)
        softness = 0.4 + 1.2 * torch.rand(count, device=device)
        shades = self._shades(count)
        first = _painted(pictures[:, 0], draw(one, origins[:, 0], scales[:, 0], softness, SIDE),
                         contrast, shades)
        # One tenth is gone, another tenth has given its place to something else.
        other = sample_bodies(count, device)
        replaced = fate < 0.1
        two = chosen_of(replaced, other, two)
        cover, heat = draw(two, origins[:, 1], scales[:, 1], softness, SIDE)
        cover = cover * ((fate < 0.1) | (fate >= 0.2))[:, None, None]
        later = _painted(pictures[:, 1], (cover, heat), contrast, shades)
        pictures = _with_another(torch.stack([first, later], 1), bodies, boxes, contrast, 0.15)
        pictures = _behind_bars(pictures, boxes, torch.tensor([0.1, 0.3], device=device))
        bounds = torch.tensor([0.0, 0, SIDE, SIDE], device=device).expand(count, 2, 4)
        return Pairs(pictures, boxes, bounds, torch.ones(count, 2, device=device), fate >= 0.2)

    def _backgrounds(self, count: int) -> torch.Tensor:
        """Return backgrounds of both frames, (n, 2, SIDE, SIDE), of unit contrast at most."""
        device = self._textures.images.device
        turn = 0.3 * torch.randn(count, device=device)
        zoom = torch.exp(-0.6 * torch.rand(count, device=device))
        drift = 0.04 * torch.randn(count, 2, 2, device=device)
        chosen = torch.randint(len(self._textures), (count,), device=device)
        images = self._textures.images[chosen][:, None].float() / 255
        seen = torch.cat([warped(images, turn, zoom[:, None].expand(-1, 2), drift[:, k])
                          for k in range(2)], dim=1)
        seen = seen - seen.mean(dim=(1, 2, 3), keepdim=True)
        seen = seen / (seen.std(dim=(1, 2, 3), keepdim=True) + 0.02)
        strength = 1.2 * torch.rand(count, device=device)**1.5 * (
            torch.rand(count, device=device) < 0.85)
        # A town is as warm as those who walk in it.
        strength = torch.where(torch.rand(count, device=device) < 0.15, 2.5 * strength, strength)
        slope = torch.randn(count, 2, device=device) / SIDE
        axis = torch.arange(SIDE, device=device) - SIDE / 2
        ramp = (slope[:, 0, None, None] * axis[None, None]
                + slope[:, 1, None, None] * axis[None, :, None])
        smooth = blurred(seen, 3.0 * torch.rand(count, device=device))
        return smooth * strength[:, None, None, None] + ramp[:, None]

    def _shades(self, count: int) -> torch.Tensor:
        """Return the texture of bodies, shape (n, SIDE, SIDE)."""
        device = self._textures.images.device
        chosen = torch.randint(len(self._textures), (count,), device=device)
        shades = self._textures.images[chosen].float() / 255
        shades = shades - shades.mean(dim=(1, 2), keepdim=True)
        shades = shades / (shades.std(dim=(1, 2), keepdim=True) + 0.05)
        axis = (torch.arange(SIDE, device=device) - SIDE / 2) / SIDE
        slope = torch.randn(count, 2, device=device)
        ramp = slope[:, 0, None, None] * axis + slope[:, 1, None, None] * axis[:, None]
        part = torch.rand(count, 2, device=device)[:, :, None, None]
        return 0.3 * part[:, 0] * shades + part[:, 1] * ramp


class StillPairs:
    """
    Objects of stills, turned and stretched, half of them before another background.

    Parameters
    ----------
    stills : Windows
        Pictures with boxes.
    textures : Windows
        Other backgrounds.

    """

    def __init__(self, stills: Windows, textures: Windows) -> None:
        self._stills, self._textures = stills, textures

    def __call__(self, count: int) -> Pairs:
        """Return pairs; a sixth of the later frames is without the target."""
        device = self._stills.images.device
        chosen = self._stills[torch.randint(len(self._stills), (count,), device=device)]
        images, box = chosen.images[:, None].float() / 255, chosen.boxes
        middle = (box[:, :2] + box[:, 2:]) / 2
        images = self._elsewhere(images, box)
        turn = 0.12 * torch.randn(count, device=device)
        stretch = torch.exp(0.2 * torch.randn(count, 1, device=device)
                            + 0.1 * torch.randn(count, 2, device=device))
        later = warped(images, turn, 1 / stretch, middle / SIDE - 0.5)
        half = (box[:, 2:] - box[:, :2]) / 2 * stretch
        centered = torch.full_like(middle, SIDE / 2)
        boxes = torch.stack([box, torch.cat([centered - half, centered + half], 1)], 1)
        present = torch.rand(count, device=device) >= 1 / 6
        later = torch.where(present[:, None, None, None], later, erased(later, boxes[:, 1]))
        bounds = torch.stack([chosen.bounds, torch.tensor(
            [0.0, 0, SIDE, SIDE], device=device).expand(count, 4)], 1)
        return Pairs(torch.cat([images, later], 1), boxes, bounds,
                     chosen.scales[:, None].expand(-1, 2), present)

    def _elsewhere(self, images: torch.Tensor, box: torch.Tensor) -> torch.Tensor:
        """Return half of the pictures with another background around the box."""
        count, device = len(images), images.device
        chosen = torch.randint(len(self._textures), (count,), device=device)
        background = self._textures.images[chosen][:, None].float() / 255
        mean = background.mean(dim=(2, 3), keepdim=True)
        level = images.mean(dim=(2, 3), keepdim=True)
        background = level + (background - mean) * torch.rand(count, 1, 1, 1, device=device)
        mask = soft_box(box, 1.2, 0.3)[:, None]
        moved = background + mask * (images - background)
        kept = torch.rand(count, 1, 1, 1, device=device) < 0.5
        return torch.where(kept, images, moved)


class ClipPairs:
    """
    Two frames of a clip, with the labels of its annotators.

    Parameters
    ----------
    clips : Windows
        Windows of one clip stand together, in the order of time.

    """

    def __init__(self, clips: Windows) -> None:
        self._clips = clips
        starts = torch.searchsorted(clips.groups, clips.groups)
        ends = torch.searchsorted(clips.groups, clips.groups, right=True)
        self._starts, self._ends = starts, ends
        self._seen = torch.nonzero(clips.boxes.isfinite().all(dim=1))[:, 0]

    def __call__(self, count: int) -> Pairs:
        """Return pairs; where the target of the later frame is absent or erased, it is so."""
        device = self._seen.device
        one = self._seen[torch.randint(len(self._seen), (count,), device=device)]
        share = torch.rand(count, device=device)
        anywhere = (self._starts[one] + share * (self._ends - self._starts)[one]).long()
        near = one + torch.randint(-8, 9, (count,), device=device)
        two = torch.where(torch.rand(count, device=device) < 0.5, near, anywhere)
        two = torch.minimum(torch.maximum(two, self._starts[one]), self._ends[one] - 1)
        first, later = self._clips[one], self._clips[two]
        there = later.boxes.isfinite().all(dim=1)
        half = (first.boxes[:, 2:] - first.boxes[:, :2]) / 2
        zoom = (first.scales / later.scales)[:, None]
        absent = SIDE / 2 + zoom * torch.cat([-half, half], 1)
        boxes = torch.stack([first.boxes, torch.where(there[:, None], later.boxes, absent)], 1)
        images = torch.stack([first.images, later.images], 1).float() / 255
        gone = torch.rand(count, device=device) < 1 / 8
        images[:, 1:] = torch.where(gone[:, None, None, None],
                                    erased(images[:, 1:], boxes[:, 1]), images[:, 1:])
        return Pairs(images, boxes, torch.stack([first.bounds, later.bounds], 1),
                     torch.stack([first.scales, later.scales], 1), there & ~gone)


def warped(images: torch.Tensor, turn: torch.Tensor, zoom: torch.Tensor, drift: torch.Tensor
           ) -> torch.Tensor:
    """
    Return pictures turned and stretched about a point, which comes to their middle.

    Parameters
    ----------
    images : tensor, shape (n, 1, SIDE, SIDE)
        The pictures; they are mirrored at their borders.
    turn : tensor, shape (n,)
        Angle.
    zoom : tensor, shape (n, 2)
        Pixels of the given pictures in one of the result.
    drift : tensor, shape (n, 2)
        Where that point is, from the middle of the picture, in its sides.

    """
    source = 2 * drift
    cosine, sine = torch.cos(turn), torch.sin(turn)
    matrix = torch.stack([
        torch.stack([cosine * zoom[:, 0], -sine * zoom[:, 1], source[:, 0]], 1),
        torch.stack([sine * zoom[:, 0], cosine * zoom[:, 1], source[:, 1]], 1)], 1)
    grid = functional.affine_grid(matrix, list(images.shape), align_corners=False)
    return functional.grid_sample(images, grid, padding_mode='reflection', align_corners=False)


def blurred(images: torch.Tensor, sigma: torch.Tensor) -> torch.Tensor:
    """
    Return pictures under Gaussians of their own.

    Parameters
    ----------
    images : tensor, shape (n, k, SIDE, SIDE)
        The pictures.
    sigma : tensor, shape (n,)
        Standard deviations in pixels.

    """
    count, channels = images.shape[:2]
    axis = torch.arange(-6, 7, device=images.device)
    kernel = torch.exp(-0.5 * (axis / (sigma[:, None] + 1e-3))**2)
    kernel = (kernel / kernel.sum(1, keepdim=True)).repeat_interleave(channels, 0)
    flat = functional.pad(images.reshape(1, count * channels, SIDE, SIDE), (6,) * 4, 'reflect')
    flat = functional.conv2d(flat, kernel[:, None, None], groups=count * channels)
    flat = functional.conv2d(flat, kernel[:, None, :, None], groups=count * channels)
    return flat.reshape(images.shape)


def soft_box(box: torch.Tensor, grow: float, edge: float) -> torch.Tensor:
    """Return masks (n, SIDE, SIDE), 1 inside of boxes that were grown, and soft around them."""
    axis = torch.arange(SIDE, device=box.device) + 0.5
    middle, half = (box[:, :2] + box[:, 2:]) / 2, (box[:, 2:] - box[:, :2]) / 2 * grow
    x = (axis - middle[:, :1]).abs() / half[:, :1]
    y = (axis - middle[:, 1:]).abs() / half[:, 1:]
    away = (x[:, None]**4 + y[:, :, None]**4)**0.25
    return ((1 + edge - away) / edge).clamp(0, 1)


def erased(images: torch.Tensor, box: torch.Tensor) -> torch.Tensor:
    """Return pictures (n, 1, SIDE, SIDE) with what stands beside a box in its place."""
    count, device = len(images), images.device
    size = (box[:, 2:] - box[:, :2]) / SIDE
    side = torch.randint(4, (count,), device=device)
    away = torch.tensor([[1.5, 0], [-1.5, 0], [0, 1.5], [0, -1.5]], device=device)[side]
    zeros = torch.zeros(count, device=device)
    beside = warped(images, zeros, torch.ones(count, 2, device=device), away * size)
    mask = soft_box(box, 1.2, 0.3)[:, None]
    return images + mask * (beside - images)


def _with_another(pictures: torch.Tensor, targets: Bodies, boxes: torch.Tensor,
                  contrast: torch.Tensor, chance: float) -> torch.Tensor:
    """
    Return pictures (n, 2, SIDE, SIDE) with another body in front, by chance, beside the target.

    It is about as warm; half of the others are of the kind of the target, as in a crowd: they
    stand nearer, and touch it.
    """
    count, device = len(pictures), pictures.device
    alike = torch.rand(count, device=device) < 0.5
    bodies = chosen_of(alike, posed(targets, torch.full((count,), 0.06, device=device)),
                       sample_bodies(count, device))
    there = torch.rand(count, device=device) < chance
    side = _side(boxes[:, 0])
    angle = 2 * math.pi * torch.rand(count, device=device)
    nearest = torch.where(alike, 0.45, 0.75)
    reach = (nearest + 1.5 * torch.rand(count, device=device).square()) * side
    unit = side * torch.exp(0.3 * torch.randn(count, device=device)) / _side(edges(bodies))
    kind = contrast * torch.exp(torch.where(alike, 0.15, 0.4) * torch.randn(count, device=device))
    result = []
    for k in range(2):
        middle = (boxes[:, k, :2] + boxes[:, k, 2:]) / 2
        away = torch.stack([torch.cos(angle), torch.sin(angle)], 1) * reach[:, None]
        angle = angle + 0.4 * torch.randn(count, device=device)
        cover, heat = draw(_seen(bodies, 0.1, device), middle + away, unit,
                           torch.full_like(unit, 0.8), SIDE)
        result.append(_painted(pictures[:, k], (cover * there[:, None, None], heat), kind,
                               torch.zeros_like(cover)))
    return torch.stack(result, dim=1)


def _behind_bars(pictures: torch.Tensor, boxes: torch.Tensor,
                 chances: torch.Tensor) -> torch.Tensor:
    """Return pictures with bars in front of some targets: branches, rails, posts."""
    count, device = len(pictures), pictures.device
    axis = torch.arange(SIDE, device=device) + 0.5
    hidden = torch.rand(count, 2, device=device) < chances
    side = _side(boxes.flatten(0, 1)).view(count, 2)
    middle = (boxes[..., :2] + boxes[..., 2:]) / 2
    slant = math.pi * torch.rand(count, 1, device=device)
    level = pictures.mean(dim=(2, 3)) + 0.5 * pictures.std(dim=(2, 3)) * torch.randn(
        count, 1, device=device)
    for _ in range(3):
        angle = slant + 0.1 * torch.randn(count, 2, device=device)
        offset = 0.6 * side * torch.randn(count, 2, device=device)
        half = 0.5 * side * (0.03 + 0.25 * torch.rand(count, 2, device=device).square())
        x, y = (axis - middle[..., i, None] for i in range(2))
        away = (torch.cos(angle)[..., None] * x)[:, :, None] + (
            torch.sin(angle)[..., None] * y)[..., None] - offset[..., None, None]
        cover = torch.sigmoid(4 * (half[..., None, None] - away.abs()))
        cover = cover * hidden[..., None, None]
        pictures = pictures + cover * (level[..., None, None] - pictures)
    return pictures


def _seen(bodies: Bodies, stretch: float, device: torch.device) -> Bodies:
    """Return bodies as they stand in one frame."""
    count = len(bodies.turns)
    turn = 0.12 * torch.randn(count, device=device)
    turn = torch.where(torch.rand(count, device=device) < 0.1, 10 * turn, turn)
    factors = torch.exp(stretch * torch.randn(count, 2, device=device))
    # A body that turns shows its narrow side.
    factors[:, 0] *= torch.where(torch.rand(count, device=device) < 0.2,
                                 0.5 + 0.5 * torch.rand(count, device=device), 1.0)
    return transformed(bodies, turn, factors, torch.rand(count, device=device) < 0.5)


def _side(box: torch.Tensor) -> torch.Tensor:
    """Return the sides of squares as large as boxes, shape (n,)."""
    return (box[:, 2:] - box[:, :2]).prod(dim=1).sqrt()


def _contrasts(count: int, device: torch.device) -> torch.Tensor:
    """Return by how much bodies are warmer than backgrounds of unit contrast."""
    return torch.exp(math.log(0.5) + 2.6 * torch.rand(count, device=device))


def _painted(pictures: torch.Tensor, drawn: tuple[torch.Tensor, torch.Tensor],
             contrast: torch.Tensor, shades: torch.Tensor) -> torch.Tensor:
    """Return pictures (n, SIDE, SIDE) with bodies in front."""
    cover, heat = drawn
    level = contrast[:, None, None]
    return pictures * (1 - cover) + cover * level * (heat + shades)

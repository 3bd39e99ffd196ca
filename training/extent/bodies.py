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
Bodies to render: parts of superelliptic shape after a plan, posed anew in every frame.

The extent of a superellipse |x / a|^p + |y / b|^p = 1, turned, along a direction u is
((a u_1)^q + (b u_2)^q)^(1/q) with 1/p + 1/q = 1 and u in its own axes (Hoelder's inequality), so
that the edges of a body are exact. Here p is 2, or 4 for what was built.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
import math

import torch

__all__ = ['Bodies', 'PLANS', 'chosen_of', 'draw', 'edges', 'posed', 'sample_bodies']

PARTS = 8

# Of each part: middle (x, y), radii (a, b), turn in degrees, heat. Heights are about 2, y goes
# down. What is planned colder than _COUNTED is no part of the extent: a tail, a rotor.
PLANS: dict[str, tuple[tuple[float, ...], ...]] = {
    'walker': ((0, -.84, .13, .15, 0, 1.1), (0, -.35, .21, .37, 0, 1), (-.08, .2, .12, .3, 8, .9),
               (-.13, .7, .08, .3, 6, .8), (.08, .2, .12, .3, -8, .9), (.13, .7, .08, .3, -6, .8),
               (-.24, -.3, .07, .33, 12, .8), (.24, -.3, .07, .33, -12, .8)),
    'quadruped': ((0, 0, .7, .28, 0, 1), (.78, -.2, .22, .18, -15, 1.1), (-.5, .4, .08, .3, 5, .7),
                  (-.35, .4, .08, .3, -5, .7), (.4, .4, .08, .3, 5, .7),
                  (.55, .4, .08, .3, -5, .7), (-.95, -.1, .35, .05, 20, .25)),
    'low animal': ((0, 0, .6, .38, 0, 1), (.55, .12, .25, .16, 10, 1.1), (0, .3, .45, .12, 0, .8),
                   (-.7, .2, .3, .05, 0, .25)),
    'sitting animal': ((0, .25, .4, .55, 0, 1), (.15, -.5, .26, .26, 0, 1.1),
                       (.3, .35, .1, .4, 0, .8), (-.1, .7, .45, .15, 0, .8),
                       (-.6, .7, .35, .06, 20, .25)),
    'bird': ((0, 0, .4, .14, 0, 1), (.4, -.05, .13, .1, 0, 1), (-.1, -.3, .16, .5, 20, .7),
             (.1, .25, .14, .45, 30, .7), (-.5, .02, .2, .08, 0, .7)),
    'vehicle': ((0, .1, 1, .32, 0, .8), (-.1, -.25, .5, .28, 0, .7), (.65, .05, .3, .22, 0, 1.3),
                (-.6, .4, .18, .18, 0, 1), (.6, .4, .18, .18, 0, 1)),
    'boat': ((0, .2, 1, .18, 0, .8), (-.1, -.08, .3, .25, 0, 1), (-.6, .1, .2, .15, 0, 1.3),
             (.1, -.6, .03, .4, 0, .25)),
    'multicopter': ((0, 0, .3, .2, 0, 1), (-.55, -.12, .4, .07, 8, .9),
                    (.55, -.12, .4, .07, -8, .9), (-.9, -.2, .12, .1, 0, 1.2),
                    (.9, -.2, .12, .1, 0, 1.2), (0, .3, .14, .12, 0, .8)),
    'airplane': ((0, 0, 1, .13, 0, 1), (0, .05, .2, .75, 25, .8), (-.85, -.2, .13, .25, -20, .8),
                 (.15, .15, .25, .1, 0, 1.3)),
    'blob': ((0, 0, .8, .8, 0, 1),),
}

_COUNTED = 0.4
_BOXY = ('vehicle', 'boat')


@dataclass(frozen=True)
class Bodies:
    """
    Parts of n bodies in their own coordinates.

    Attributes
    ----------
    middles, radii : tensor, shape (n, PARTS, 2)
        Of the parts; radii of 0 for parts that are not there.
    turns : tensor, shape (n, PARTS)
        Angles.
    boxy : tensor, shape (n,), bool
        Whether the exponents p of the superellipses are 4, not 2.
    heat : tensor, shape (n, PARTS)
        Contrast to the background.
    counted : tensor, shape (n, PARTS), bool
        Which parts belong to the extent.

    """

    middles: torch.Tensor
    radii: torch.Tensor
    turns: torch.Tensor
    boxy: torch.Tensor
    heat: torch.Tensor
    counted: torch.Tensor

    @property
    def there(self) -> torch.Tensor:
        """Which parts there are, shape (n, PARTS)."""
        return self.radii[..., 0] > 0


def sample_bodies(count: int, device: torch.device) -> Bodies:
    """Return bodies of random plans, each as an individual of its kind."""
    table, boxy = _plan_table(device)
    kinds = torch.randint(len(table), (count,), device=device)
    parts = table[kinds]
    # A tenth follows no plan at all.
    free = _chance(0.1, count, device)[:, None]
    scatter = torch.stack([torch.randn(count, PARTS, device=device) * spread for spread in
                           (0.45, 0.45)], dim=-1)
    middles = torch.where(free[..., None], scatter, parts[..., :2])
    radii = parts[..., 2:4] * torch.exp(0.25 * torch.randn(count, PARTS, 2, device=device))
    turns = parts[..., 4] + free * math.pi * torch.rand(count, PARTS, device=device)
    counted = parts[..., 5] >= _COUNTED
    heat = torch.where(counted, _warmth(parts[..., 5]),
                       parts[..., 5] * torch.rand(count, PARTS, device=device))
    return posed(Bodies(middles, radii, turns, boxy[kinds], heat, counted),
                 torch.full((count,), 0.05, device=device))


def _warmth(planned: torch.Tensor) -> torch.Tensor:
    """
    Return the heat of parts, shape (n, PARTS), from the planned one.

    Some bodies are evenly warm; of others one part outshines the rest: an engine, or the warmest
    one, a face; and some are clothed: any part may be as cold as what is behind, or colder.
    """
    count, device = len(planned), planned.device
    spread = 0.45 * torch.rand(count, 1, device=device)
    heat = (planned * torch.exp(spread * torch.randn_like(planned))).clamp(min=1.1 * _COUNTED)
    some = torch.randint(PARTS, (count, 1), device=device)
    chosen = torch.where(_chance(0.5, count, device)[:, None], some,
                         planned.argmax(dim=1, keepdim=True))
    one = torch.arange(PARTS, device=device) == chosen
    kind = torch.rand(count, 1, device=device)
    hot = heat * torch.where(one, 1 + 2 * torch.rand(count, 1, device=device),
                             1 - 0.5 * torch.rand(count, 1, device=device))
    clothed = torch.where(one, 1.0, 1.6 * torch.rand_like(heat) - 0.4)
    return torch.where(kind < 0.4, hot, torch.where(kind > 0.75, clothed, heat))


def posed(bodies: Bodies, amount: torch.Tensor) -> Bodies:
    """
    Return bodies in another pose: parts moved, turned, stretched, and as warm as seen from there.

    Parameters
    ----------
    bodies : Bodies
        As they were.
    amount : tensor, shape (n,)
        Standard deviation of what a part moves; it turns by four times as much in radian.

    """
    spread = amount[:, None, None]
    return replace(
        bodies, middles=bodies.middles + spread * torch.randn_like(bodies.middles),
        radii=bodies.radii * torch.exp(2 * spread * torch.randn_like(bodies.radii)),
        turns=bodies.turns + 4 * spread[..., 0] * torch.randn_like(bodies.turns),
        heat=bodies.heat * torch.exp(2 * spread[..., 0] * torch.randn_like(bodies.heat)))


def transformed(bodies: Bodies, turn: torch.Tensor, stretch: torch.Tensor,
                mirrored: torch.Tensor) -> Bodies:
    """
    Return bodies mirrored, stretched along their axes, and turned as a whole.

    Parameters
    ----------
    bodies : Bodies
        As they were.
    turn : tensor, shape (n,)
        Angle.
    stretch : tensor, shape (n, 2)
        Factors. Parts are stretched along their own axes, as far as those lie along x or y.
    mirrored : tensor, shape (n,), bool
        Whether left becomes right.

    """
    sign = torch.where(mirrored, -1.0, 1.0)
    middles = bodies.middles * stretch[:, None]
    middles = torch.stack([sign[:, None] * middles[..., 0], middles[..., 1]], dim=-1)
    turns = sign[:, None] * bodies.turns
    share = torch.cos(turns).square()[..., None]
    own = share * stretch[:, None] + (1 - share) * stretch.flip(1)[:, None]
    cosine, sine = torch.cos(turn)[:, None], torch.sin(turn)[:, None]
    middles = torch.stack([cosine * middles[..., 0] - sine * middles[..., 1],
                           sine * middles[..., 0] + cosine * middles[..., 1]], dim=-1)
    return replace(bodies, middles=middles, radii=bodies.radii * own,
                   turns=turns + turn[:, None])


def chosen_of(which: torch.Tensor, ones: Bodies, others: Bodies) -> Bodies:
    """Return of each pair of bodies the one where `which` is true, shape (n,), or the other."""
    return Bodies(*(torch.where(which.view(-1, *[1] * (one.ndim - 1)), one, other)
                    for one, other in zip(vars(ones).values(), vars(others).values(),
                                          strict=True)))


def edges(bodies: Bodies) -> torch.Tensor:
    """Return the extents (x0, y0, x1, y1) of the parts that count, shape (n, 4)."""
    # q of 1 / p + 1 / q = 1.
    dual = torch.where(bodies.boxy, 4 / 3, 2.0)[:, None, None]
    cosine, sine = torch.cos(bodies.turns).abs(), torch.sin(bodies.turns).abs()
    along = torch.stack([torch.stack([cosine, sine], -1), torch.stack([sine, cosine], -1)], -2)
    reach = (bodies.radii[:, :, None] * along).pow(dual[..., None]).sum(-1).pow(1 / dual)
    counted = (bodies.there & bodies.counted)[..., None]
    low = torch.where(counted, bodies.middles - reach, math.inf).amin(dim=1)
    high = torch.where(counted, bodies.middles + reach, -math.inf).amax(dim=1)
    return torch.cat([low, high], dim=1)


def draw(bodies: Bodies, places: torch.Tensor, scales: torch.Tensor, softness: torch.Tensor,
         side: int) -> tuple[torch.Tensor, torch.Tensor]:
    """
    Return what bodies cover of a picture, and how warm they are there.

    Parameters
    ----------
    bodies : Bodies
        What to draw.
    places : tensor, shape (n, 2)
        Where their origins lie, in pixels.
    scales : tensor, shape (n,)
        Pixels for a unit of theirs.
    softness : tensor, shape (n,)
        Width of their edges in pixels.
    side : int
        Of the pictures.

    Returns
    -------
    cover : tensor, shape (n, side, side)
        From 0 to 1.
    heat : tensor, shape (n, side, side)
        Mean of the parts there; 0 where there are none.

    """
    axis = torch.arange(side, device=places.device) + 0.5
    free = torch.ones(len(places), side, side, device=places.device)
    weight, warmth = torch.zeros_like(free), torch.zeros_like(free)
    for part in range(PARTS):
        middle = places + scales[:, None] * bodies.middles[:, part]
        radii = (scales[:, None] * bodies.radii[:, part]).clamp(min=1e-2)
        x, y = (axis - middle[:, i, None] for i in range(2))
        axes = torch.stack([torch.cos(bodies.turns[:, part]), torch.sin(bodies.turns[:, part])], 1)
        along, across = axes / radii[:, :1], axes.flip(1) / radii[:, 1:]
        u = (along[:, :1] * x)[:, None] + (along[:, 1:] * y)[:, :, None]
        v = (across[:, 1:] * y)[:, :, None] - (across[:, :1] * x)[:, None]
        u, v = u.square_(), v.square_()
        round_shape, boxy = u + v, torch.hypot(u, v)
        away = torch.where(bodies.boxy[:, None, None], boxy, round_shape).sqrt_()
        steep = 4 * radii.amin(dim=1) / softness
        inside = torch.sigmoid_((1 - away).mul_(steep[:, None, None]))
        inside *= bodies.there[:, part, None, None]
        free.addcmul_(free, inside, value=-1)
        weight += inside
        warmth.addcmul_(inside, bodies.heat[:, part, None, None])
    return 1 - free, warmth / weight.clamp(min=1e-6)


def _plan_table(device: torch.device) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the plans, shape (plans, PARTS, 6) with angles in radian, and which are boxy."""
    table = torch.zeros(len(PLANS), PARTS, 6)
    for number, plan in enumerate(PLANS.values()):
        table[number, :len(plan)] = torch.tensor(plan)
    table[..., 4] = torch.deg2rad(table[..., 4])
    boxy = torch.tensor([kind in _BOXY for kind in PLANS])
    return table.to(device), boxy.to(device)


def _chance(probability: float, count: int, device: torch.device) -> torch.Tensor:
    """Return which of n events happen."""
    return torch.rand(count, device=device) < probability

"""Which of the triangles that a ray crosses it meets: the rules of the rasterizer, and its own.

A ray never meets the triangle it starts on. Single-sided triangles are passed through from behind.
Masked triangles are met where alpha reaches the cutoff, at the crossing. A reflected ray leaves its
surface upward, so a crossing X that is not above the tangent plane of its origin O is no hit:

    n·(X − O) ≤ 8u (|n·d_X| z_X + |n·d_O| z_O + ‖X − O‖₁),    u = 2⁻⁵³

with d the eye's ray to a point and z its depth (docs/specification.md 4.5, the first sum). With
X = O + t·r every term is linear in t, so there is no distance below which nothing is met.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._jit import inlined, kernel
from ..raster.geometry import MASKED
from ..raster.surface import Barycentric
from ..raster.textures import Textures, passes_mask
from ..typed import F64Array, I32Array
from .triangle import Meeting

NO_ID = 2**31 - 1
"""Higher than any triangle's number: at equal distance the lower wins."""


class Guard(NamedTuple):
    """The tangent plane that a ray leaves; n: its normal, r: the ray's direction."""

    rise: float  # n·r
    start: float  # n·d·z of the origin, d the eye's ray to it
    change: float  # how n·d·z changes with t
    length: float  # ‖r‖₁


class Cutout(NamedTuple):
    """What decides masked triangles: faces (nt, 3), materials (nt,), and the masks; None: solid.

    For the host alone: a parallel loop cannot take a tuple within a tuple.
    """

    faces: I32Array
    material: I32Array
    textures: Textures | None


def solid() -> Cutout:
    """No triangle is masked."""
    return Cutout(np.empty((0, 3), np.int32), np.empty(0, np.int32), None)


@inlined
def load_guard(guards: F64Array, i: int) -> Guard:
    """Row i of an (n, 4) array."""
    return Guard(guards[i, 0], guards[i, 1], guards[i, 2], guards[i, 3])


@kernel
def is_above(guard: Guard, t: float) -> bool:
    """Whether the point at t is above the tangent plane by more than rounding."""
    error = abs(guard.start + t * guard.change) + abs(guard.start) + t * guard.length
    return t * guard.rise > 8.0 * 2.0**-53 * error


@inlined
def accepts(
    faces: I32Array,
    material: I32Array,
    textures: Textures | None,
    guards: F64Array,
    i: int,
    triangle: int,
    flags: int,
    m: Meeting,
    t_best: float,
    id_best: int,
) -> bool:
    """Whether ray i's crossing of a triangle is a hit nearer than the best so far.

    guards: rows of `Guard`, or none; triangle, flags: its number and bits.
    """
    if not (m.met and m.t > 0.0 and m.t <= t_best):
        return False
    if m.t == t_best and triangle >= id_best:
        return False
    if guards.shape[0] > 0 and not is_above(load_guard(guards, i), m.t):
        return False
    if textures is not None:
        if (flags & MASKED) != 0:
            b = Barycentric(m.b0, m.b1, m.b2)
            return passes_mask(textures, faces, triangle, material[triangle], b)
    return True

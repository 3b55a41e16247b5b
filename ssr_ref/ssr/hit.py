"""The hit rule for constant-depth pixels: slab against ray interval, and the own tangent plane.

A pixel is a slab [front + bias, back] of view depth. An interval of the ray with depths near ≤ far
meets it if far ≥ front + bias and near ≤ back. A candidate whose surface point is not above the
origin's tangent plane cannot be met by a reflected ray and is refused (no bias constant can do
this without opening a gap at contacts).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._jit import kernel
from ..buffers import Flag
from ..camera import ViewParams, point_at, ray_through
from ..typed import F64Array, FloatArray
from ..vecmath.vec import Vec3, dot
from .ray import Ray, depth_at, position_x, position_y, s_of_depth

PASSED_BEHIND, SELF_REJECTED = int(Flag.PASSED_BEHIND), int(Flag.SELF_REJECTED)
BACK_FACE_REJECTED = int(Flag.BACK_FACE_REJECTED)
OVER_EMPTY, OPEN = int(Flag.OVER_EMPTY), int(Flag.OPEN)
MISS, BEHIND, IN_SLAB = 0, 1, 2


class SlabRules(NamedTuple):
    """What decides a hit, besides the buffers. Lengths in scene units.

    thickness: what a residual may not exceed at an open pixel; inf where the model is another one.
    rounding: unit roundoff of the buffers, 2⁻²⁴ or 2⁻⁵³. Scalars only: arrays in a tuple cost a
    reference count at each use, which is more than the test itself.
    """

    thickness: float
    bias: float
    rounding: float
    reject_self: bool
    facing_test: bool


class Slab(NamedTuple):
    """An accepted pixel: depths, and OPEN if back is not that of a back face."""

    front: float
    low: float  # where a ray enters: the front, pushed back by a bias
    back: float
    flags: int


class Hit(NamedTuple):
    """A found hit; `found` False leaves the rest meaningless."""

    found: bool
    px: float
    py: float
    s: float
    depth: float
    residual: float
    flags: int


@kernel
def no_hit() -> Hit:
    """The absence of a hit."""
    return Hit(False, np.nan, np.nan, np.nan, np.nan, np.nan, 0)


@kernel
def above_tangent_plane(
    view: ViewParams, rounding: float, ray: Ray, x: int, y: int, depth: float, m: Vec3
) -> bool:
    """Whether pixel (x, y)'s surface point is above the origin's tangent plane by more than ε.

    m: the pixel's geometric normal. ε bounds float32 rounding of depths and normals (first sum)
    and vertex snapping of at most 1/512 px, doubled (second sum): docs/specification.md 4.5.
    """
    n = ray.normal_vs
    px, py = x + 0.5, y + 0.5
    d = ray_through(view, px, py)
    q = point_at(view, px, py, depth)
    o = ray.origin_vs
    qo = Vec3(q.x - o.x, q.y - o.y, q.z - o.z)
    n_d = abs(dot(n, d))
    rho = n_d / abs(dot(m, d))
    z_q, z_o = (depth, ray.origin_depth) if view.perspective else (1.0, 1.0)
    by_rounding = (
        8.0
        * rounding
        * (
            n_d * depth
            + abs(ray.normal_dot_ray) * ray.origin_depth
            + (abs(qo.x) + abs(qo.y) + abs(qo.z))
        )
    )
    by_snapping = 2.0**-8 * (
        (z_q * (abs(n.x) + rho * abs(m.x)) + z_o * abs(n.x)) / view.fx
        + (z_q * (abs(n.y) + rho * abs(m.y)) + z_o * abs(n.y)) / view.fy
    )
    return dot(n, qo) > by_rounding + by_snapping


@kernel
def refusal(
    view: ViewParams, rules: SlabRules, ray: Ray, x: int, y: int, depth: float, m: Vec3
) -> int:
    """Why a candidate cannot be a hit, as a flag; 0 if it can.

    m: the pixel's geometric normal. A face whose normal the ray goes along is met from behind.
    """
    if rules.reject_self and not above_tangent_plane(view, rules.rounding, ray, x, y, depth, m):
        return SELF_REJECTED
    if rules.facing_test and not dot(m, ray.direction_vs) < 0.0:
        return BACK_FACE_REJECTED
    return 0


@kernel
def compare_with_slab(z_a: float, z_b: float, low: float, back: float) -> int:
    """Ray depths at an interval's ends against [low, back]: MISS, BEHIND or IN_SLAB."""
    near, far = (z_a, z_b) if z_a < z_b else (z_b, z_a)
    if near > back:
        return BEHIND
    return IN_SLAB if far >= low else MISS


@kernel
def load_slab(slabs: F64Array, depth: FloatArray, back: FloatArray, x: int, y: int) -> Slab:
    """The slab of pixel (x, y), which is not empty."""
    is_open = back.shape[0] == 0 or not back[y, x] < np.inf
    return Slab(np.float64(depth[y, x]), slabs[y, x, 0], slabs[y, x, 1], OPEN if is_open else 0)


@kernel
def load3(image: FloatArray, y: int, x: int) -> Vec3:
    """Pixel (x, y) of an (H, W, 3) image as float64."""
    return Vec3(np.float64(image[y, x, 0]), np.float64(image[y, x, 1]), np.float64(image[y, x, 2]))


@kernel
def locate_hit(
    rules: SlabRules,
    ray: Ray,
    slab: Slab,
    x: int,
    y: int,
    a: float,
    b: float,
    inside_cell: bool,
) -> Hit:
    """The first s of [a, b] whose depth is in the slab of the accepted pixel (x, y).

    hit_px is P(s). Where the interval lies inside the pixel (`inside_cell`) rounding may put P(s)
    outside by an ulp, and a ray that comes from the right or from below enters exactly on the
    border that belongs to its neighbour: both are moved to the nearest position in the pixel.
    """
    low = slab.low
    z = depth_at(ray, a)
    s = a
    if z < low or z > slab.back:
        z = low if z < low else slab.back
        s = s_of_depth(ray, z)
        if not s > a:
            s = a
        if s > b:
            s = b
    px = into_pixel(position_x(ray, s), x, inside_cell)
    py = into_pixel(position_y(ray, s), y, inside_cell)
    residual = z - slab.front
    if slab.flags & OPEN and residual > rules.thickness:
        residual = rules.thickness  # back = front + thickness, rounded, may exceed it by an ulp
    return Hit(True, px, py, s, z, residual, slab.flags)


@kernel
def into_pixel(p: float, index: int, inside_cell: bool) -> float:
    """p, or the nearest coordinate in pixel `index` if p is on its far border or must be inside."""
    if p == index + 1.0 or (inside_cell and p > index + 1.0):
        return np.nextafter(index + 1.0, 0.0)
    if inside_cell and p < index:
        return np.float64(index)
    return p

"""The surface at a pixel: the triangle's plane in view space, and barycentrics on it.

The plane is that of the unclipped float64 triangle. *Nearness* is k = 1/depth (perspective) or
−depth (orthographic): affine in the pixel for both, and larger is nearer.
"""

from typing import NamedTuple

import numpy as np

from .._jit import inlined, kernel
from ..camera import ViewParams
from ..typed import F64Array, I32Array
from ..vecmath.exact import (
    add_pairs,
    cross_pairs,
    difference_of_points,
    dot_pairs,
    scale_pair,
    subtract_pairs,
)
from ..vecmath.vec import Vec3, cross, dot, sub


class NearnessPlane(NamedTuple):
    """Nearness (c + b·y) + a·x at the centre of pixel (x, y)."""

    a: float
    b: float
    c: float


@inlined
def load(points: F64Array, i: int) -> Vec3:
    """Row i of an (n, 3) array."""
    return Vec3(points[i, 0], points[i, 1], points[i, 2])


@kernel
def nearness_of_depth(view: ViewParams, depth: float) -> float:
    """k of a view depth."""
    return 1.0 / depth if view.perspective else -depth


@kernel
def depth_of_nearness(view: ViewParams, k: float) -> float:
    """View depth of k."""
    return 1.0 / k if view.perspective else -k


@inlined
def plane_normal(v0: Vec3, v1: Vec3, v2: Vec3) -> Vec3:
    """Normal of the counter-clockwise triangle, length twice its area."""
    return cross(sub(v1, v0), sub(v2, v0))


@inlined
def nearest_vertex(view: ViewParams, v0: Vec3, v1: Vec3, v2: Vec3) -> Vec3:
    """The vertex nearest the eye (orthographic: of least depth); ties to the first."""
    if view.perspective:
        d0, d1, d2 = dot(v0, v0), dot(v1, v1), dot(v2, v2)
    else:
        d0, d1, d2 = -v0.z, -v1.z, -v2.z
    d01, x, y, z = (d1, v1.x, v1.y, v1.z) if d1 < d0 else (d0, v0.x, v0.y, v0.z)
    third = d2 < d01
    return Vec3(v2.x if third else x, v2.y if third else y, v2.z if third else z)


@inlined
def nearness_plane(view: ViewParams, n: Vec3, v0: Vec3, v1: Vec3, v2: Vec3) -> NearnessPlane:
    """k = (n·d)/(n·v_a) as an affine function of the pixel (orthographic: −depth).

    n: `plane_normal` of the triangle.

    A triangle seen exactly edge-on has no such function: it gets its nearest vertex's k.
    """
    va = nearest_vertex(view, v0, v1, v2)
    x0 = (0.5 - view.cx) * view.inverse_fx
    y0 = (view.cy - 0.5) * view.inverse_fy
    if not plane_is_well_conditioned(view, n, va, v0, v1, v2, x0, y0):
        return careful_nearness_plane(view, va, v0, v1, v2, x0, y0)
    if view.perspective:
        scale = 1.0 / dot(n, va)
        a = n.x * view.inverse_fx * scale
        b = -(n.y * view.inverse_fy * scale)
        c = (n.x * x0 + n.y * y0 - n.z) * scale
    else:
        scale = 1.0 / n.z
        a = -(n.x * view.inverse_fx * scale)
        b = n.y * view.inverse_fy * scale
        c = va.z - (n.x * (x0 - va.x) + n.y * (y0 - va.y)) * scale
    return NearnessPlane(a, b, c)


WELL_CONDITIONED = 4.0
"""Greatest ratio of the terms' magnitudes to their sum: the relative error of k then stays below
32 · 2⁻⁵³ · (|c| + |b|·H + |a|·W)/k (three roundings of each of two products, twice)."""


@inlined
def plane_is_well_conditioned(
    view: ViewParams, n: Vec3, va: Vec3, v0: Vec3, v1: Vec3, v2: Vec3, x0: float, y0: float
) -> bool:
    """Whether neither the normal nor its product with va has lost digits to cancellation."""
    ax, ay, az = abs(v1.x - v0.x), abs(v1.y - v0.y), abs(v1.z - v0.z)
    bx, by, bz = abs(v2.x - v0.x), abs(v2.y - v0.y), abs(v2.z - v0.z)
    tx, ty, tz = ay * bz + az * by, az * bx + ax * bz, ax * by + ay * bx
    across_x, across_y = view.width * view.inverse_fx, view.height * view.inverse_fy
    span = abs(n.x) * across_x + abs(n.y) * across_y
    if view.perspective:
        product = abs(dot(n, va))
        terms = tx * abs(va.x) + ty * abs(va.y) + tz * abs(va.z)
        numerator = tx * (abs(x0) + across_x) + ty * (abs(y0) + across_y) + tz
        return (
            numerator <= WELL_CONDITIONED * (abs(n.x * x0 + n.y * y0 - n.z) + span)
            and terms <= WELL_CONDITIONED * product
            and product > 0.0
        )
    depth = abs(n.z * va.z - n.x * (x0 - va.x) - n.y * (y0 - va.y))
    terms = (abs(n.x) + tx) * abs(x0 - va.x) + (abs(n.y) + ty) * abs(y0 - va.y)
    return (
        terms + abs(n.z * va.z) + tx * across_x + ty * across_y <= WELL_CONDITIONED * (depth + span)
        and tz <= WELL_CONDITIONED * abs(n.z)
        and tz > 0.0
    )


@kernel
def careful_nearness_plane(
    view: ViewParams, va: Vec3, v0: Vec3, v1: Vec3, v2: Vec3, x0: float, y0: float
) -> NearnessPlane:
    """The same function by pairs of twice the precision: slivers, and planes far from a vertex."""
    n = cross_pairs(difference_of_points(v1, v0), difference_of_points(v2, v0))
    product = dot_pairs(n, va)
    if view.perspective:
        scale = 1.0 / product.hi
        a = n.x.hi * view.inverse_fx * scale
        b = -(n.y.hi * view.inverse_fy * scale)
        c = (n.x.hi * x0 + n.y.hi * y0 - n.z.hi) * scale
    else:
        scale = 1.0 / n.z.hi
        a = -(n.x.hi * view.inverse_fx * scale)
        b = n.y.hi * view.inverse_fy * scale
        at_origin = add_pairs(scale_pair(n.x, x0), scale_pair(n.y, y0))
        c = subtract_pairs(product, at_origin).hi * scale
    if np.isfinite(a) and np.isfinite(b) and np.isfinite(c):
        return NearnessPlane(a, b, c)
    depth = min(-v0.z, -v1.z, -v2.z)
    if view.perspective and not depth > view.near:
        depth = view.near
    return NearnessPlane(0.0, 0.0, nearness_of_depth(view, depth))


@kernel
def nearness_at(plane: NearnessPlane, x: int, y: int) -> float:
    """k at the centre of pixel (x, y), from absolute indices, so no tiling can change it."""
    return (plane.c + plane.b * y) + plane.a * x


class Barycentric(NamedTuple):
    """Weights of the three vertices, each ≥ 0, sum 1 to rounding."""

    b0: float
    b1: float
    b2: float


class BarycentricFrame(NamedTuple):
    """Dual vectors: weight i of point p is scale · dual_i·(p − v0), i = 1, 2."""

    v0: Vec3
    dual1: Vec3
    dual2: Vec3
    scale: float


@inlined
def barycentric_frame(n: Vec3, v0: Vec3, v1: Vec3, v2: Vec3) -> BarycentricFrame:
    """Set-up of `barycentric_at`, n = `plane_normal`; without area vertex 0 has all the weight."""
    nn = dot(n, n)
    scale = 1.0 / nn if nn > 0.0 else 0.0
    return BarycentricFrame(v0, cross(sub(v2, v0), n), cross(n, sub(v1, v0)), scale)


@inlined
def barycentric_at(frame: BarycentricFrame, p: Vec3) -> Barycentric:
    """Weights of a point on the plane: perspective-correct, since p is the point in space.

    Snapping lets a covered centre lie just outside the true triangle: weights are clamped to ≥ 0
    and divided by their sum.
    """
    r = sub(p, frame.v0)
    b1 = dot(frame.dual1, r) * frame.scale
    b2 = dot(frame.dual2, r) * frame.scale
    if not b1 > 0.0:
        b1 = 0.0
    if not b2 > 0.0:
        b2 = 0.0
    b0 = 1.0 - b1 - b2
    if not b0 > 0.0:
        b0 = 0.0
    share = 1.0 / (b0 + b1 + b2)
    if not share > 0.0:  # NaN, or an infinite sum
        return Barycentric(1.0, 0.0, 0.0)
    return Barycentric(b0 * share, b1 * share, b2 * share)


@inlined
def surface_point(view: ViewParams, plane: NearnessPlane, x: int, y: int) -> Vec3:
    """View-space point of the plane at the centre of pixel (x, y)."""
    depth = depth_of_nearness(view, nearness_at(plane, x, y))
    px = (x + 0.5 - view.cx) * view.inverse_fx
    py = (view.cy - (y + 0.5)) * view.inverse_fy
    if view.perspective:
        return Vec3(px * depth, py * depth, -depth)
    return Vec3(px, py, -depth)


@kernel
def run_end(ids: I32Array, row: int, x: int) -> int:
    """One past the last column of the run of equal ids that starts at x."""
    width = ids.shape[1]
    first = ids[row, x]
    end = x + 1
    while end + 8 <= width:  # eight at a time while they are all equal
        differs = np.int32(0)
        for j in range(np.uint64(end), np.uint64(end + 8)):
            differs |= ids[row, j] ^ first
        if differs != 0:
            break
        end += 8
    while end < width and ids[row, end] == first:
        end += 1
    return end

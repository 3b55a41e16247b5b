"""The reflected rays of triangle meshes: where each starts, and where it goes.

Written again here, without the tracers' code or a G-buffer's depth and normals, so that a mistake
there cannot hide. All of it is *eye-centred*: world axes, origin at the eye. A scene moved on its
grid with its camera then keeps every bit, as in view space, but axis-aligned walls stay aligned,
and normals are the world's even where a camera's file has rounded its rotation.

The start is the point of the triangle's plane under the pixel's centre, in float64 rounded from
twice the precision. Its depth is kept within that of the corners, as the rasterizer keeps it: a
centre may lie up to 1/512 px outside the true triangle, and a plane seen nearly edge-on runs away.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from .._jit import driver, inlined, kernel
from ..analytic.reflections import mirrored
from ..camera import ViewParams, ray_through, rotate_to_view
from ..raster.geometry import DOUBLE_SIDED, HAS_NORMALS
from ..raster.surface import load
from ..typed import F64Array, I32Array, I64Array, U8Array
from ..vecmath.exact import (
    Pair,
    PairVec3,
    add_pairs,
    cross_pairs,
    difference_of_points,
    dot_pairs,
    dot_twice,
    multiply_pairs,
)
from ..vecmath.vec import Vec3, is_finite, normalize


@inlined
def to_world(axes: F64Array, v: Vec3) -> Vec3:
    """World direction of a view direction; axes: `analytic.arrays.world_axes`."""
    return Vec3(
        axes[0, 0] * v.x + axes[0, 1] * v.y + axes[0, 2] * v.z,
        axes[1, 0] * v.x + axes[1, 1] * v.y + axes[1, 2] * v.z,
        axes[2, 0] * v.x + axes[2, 1] * v.y + axes[2, 2] * v.z,
    )


@kernel
def unit_or_zero(n: Vec3) -> Vec3:
    """n / |n| for a vector of any size; 0 if it has no direction."""
    most = max(abs(n.x), abs(n.y), abs(n.z))
    if not (np.isfinite(most) and most > 0.0):
        return Vec3(0.0, 0.0, 0.0)
    return normalize(Vec3(n.x / most, n.y / most, n.z / most))


@kernel
def dot_of_pairs(a: PairVec3, b: PairVec3) -> Pair:
    """a·b."""
    first = add_pairs(multiply_pairs(a.x, b.x), multiply_pairs(a.y, b.y))
    return add_pairs(first, multiply_pairs(a.z, b.z))


@kernel
def corner_weights(a: Vec3, b: Vec3, c: Vec3, n: Vec3, p: Vec3) -> Vec3:
    """Barycentrics of p by the areas opposite each corner, clamped to ≥ 0, sum 1.

    n: the triangle's normal, any length.
    """
    to_a, to_b, to_c = (
        difference_of_points(a, p),
        difference_of_points(b, p),
        difference_of_points(c, p),
    )
    u = max(dot_pairs(cross_pairs(to_b, to_c), n).hi, 0.0)
    v = max(dot_pairs(cross_pairs(to_c, to_a), n).hi, 0.0)
    w = max(dot_pairs(cross_pairs(to_a, to_b), n).hi, 0.0)
    total = u + v + w
    if not (total > 0.0 and np.isfinite(total)):
        return Vec3(1.0, 0.0, 0.0)
    return Vec3(u / total, v / total, w / total)


@inlined
def interpolated_normal(normals_ws: F64Array, i0: int, i1: int, i2: int, b: Vec3) -> Vec3:
    """Weighted sum of three vertex normals, unit; as it is where the three are equal; 0 if none."""
    m, n, o = load(normals_ws, i0), load(normals_ws, i1), load(normals_ws, i2)
    if m == n and m == o:
        return m if is_finite(m) else Vec3(0.0, 0.0, 0.0)
    return unit_or_zero(
        Vec3(
            b.x * m.x + b.y * n.x + b.z * o.x,
            b.x * m.y + b.y * n.y + b.z * o.y,
            b.x * m.z + b.y * n.z + b.z * o.z,
        )
    )


@driver()
def set_up_rays(
    view: ViewParams,
    axes: F64Array,
    points: F64Array,
    normals_ws: F64Array,
    faces: I32Array,
    flags: U8Array,
    pixels: I64Array,
    triangle: I32Array,
    origin: F64Array,
    direction: F64Array,
    guard: F64Array,
) -> None:
    """Origin, unit direction and `accept.Guard` of the ray of each pixel y·W + x.

    points: eye-centred corners; triangle (n,): what each pixel shows. A pixel without a ray (the
    triangle is edge-on or has no normal, or the ray would go below the surface) gets NaN.
    """
    for k in prange(pixels.shape[0]):
        for c in range(3):
            origin[k, c] = np.nan
            direction[k, c] = np.nan
        for c in range(4):
            guard[k, c] = np.nan
        y, x = pixels[k] // view.width, pixels[k] % view.width
        t = triangle[k]
        i0, i1, i2 = faces[t, 0], faces[t, 1], faces[t, 2]
        p0, p1, p2 = load(points, i0), load(points, i1), load(points, i2)

        # The eye's ray: through the pixel's centre, t = view depth.
        d = to_world(axes, ray_through(view, x + 0.5, y + 0.5))
        start = Vec3(0.0, 0.0, 0.0)
        if not view.perspective:
            right, up = (x + 0.5 - view.cx) / view.fx, (view.cy - (y + 0.5)) / view.fy
            start = to_world(axes, Vec3(right, up, 0.0))

        # Where it meets the triangle's plane.
        normal = cross_pairs(difference_of_points(p1, p0), difference_of_points(p2, p0))
        slope = dot_pairs(normal, d).hi
        n = unit_or_zero(Vec3(normal.x.hi, normal.y.hi, normal.z.hi))
        height = dot_of_pairs(normal, difference_of_points(p0, start)).hi
        z0, z1, z2 = (
            -rotate_to_view(view, p0).z,
            -rotate_to_view(view, p1).z,
            -rotate_to_view(view, p2).z,
        )
        depth = min(max(height / slope, min(z0, z1, z2), view.near), max(z0, z1, z2))
        if not (slope != 0.0 and np.isfinite(depth) and is_finite(n)):
            continue
        o = Vec3(start.x + depth * d.x, start.y + depth * d.y, start.z + depth * d.z)

        # Geometric normal towards the eye; shading normal on the side that is seen.
        behind = slope > 0.0
        if behind:
            n = Vec3(-n.x, -n.y, -n.z)
        shading = n
        if (flags[t] & HAS_NORMALS) != 0:
            outward = Vec3(normal.x.hi, normal.y.hi, normal.z.hi)
            b = corner_weights(p0, p1, p2, outward, o)
            m = interpolated_normal(normals_ws, i0, i1, i2, b)
            if m.x != 0.0 or m.y != 0.0 or m.z != 0.0:
                away = behind and (flags[t] & DOUBLE_SIDED) != 0
                shading = Vec3(-m.x, -m.y, -m.z) if away else m

        # The mirror direction, and the tangent plane that it must leave.
        r = mirrored(d, shading)
        rise = dot_twice(n, r).hi
        if not (rise > 0.0 and is_finite(r)):
            continue
        along = dot_twice(n, d).hi
        for c in range(3):
            origin[k, c] = o.x if c == 0 else (o.y if c == 1 else o.z)
            direction[k, c] = r.x if c == 0 else (r.y if c == 1 else r.z)
        guard[k, 0] = rise
        guard[k, 1] = along * depth if not view.perspective else dot_twice(n, o).hi
        guard[k, 2] = -along * rotate_to_view(view, r).z if not view.perspective else rise
        guard[k, 3] = abs(r.x) + abs(r.y) + abs(r.z)

"""One ray at a time through the hierarchy: the definition of what a ray meets.

The first hit is the least (t, triangle number) of all that `accept.accepts` lets through; the tree
only leaves out what cannot be one, so no other tree, order or number of threads changes a byte.

For that a box test must never miss a triangle that the triangle test would accept, at the distance
that it computes. The boxes are padded by 32u (|O| + reach), u = 2⁻⁵³: `triangle` needs 9u of it,
the box test's own roundings 4u. A direction component below 2⁻⁶⁰ of the largest is raised to that:
over the length of the scene this moves the ray by far less than the padding. (The padding of Ize,
Robust BVH ray traversal, JCGT 2(2), 2013, covers the box test's roundings alone.)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from .._jit import driver, inlined, kernel
from ..raster.geometry import DOUBLE_SIDED
from ..raster.surface import load
from ..raster.textures import Textures
from ..typed import BoolArray, F32Array, F64Array, I32Array, I64Array
from ..vecmath.vec import Vec3
from .accept import NO_ID, Cutout, accepts, solid
from .bvh import STACK, Bvh
from .triangle import Meeting, apart, is_traced, meet, shear_of

CHUNK = 256
"""Rays that one thread takes at a time."""

PADDING = 2.0**-48
LEAST_SLOPE = 2.0**-60


class Rays(NamedTuple):
    """n rays in the tree's space.

    skip: a triangle that is not met, −1 for none; no rows: none for every ray. guard: rows of
    `accept.Guard`; no rows: all that is ahead may be met. t_max: greatest t of a hit.
    """

    origin: F64Array  # (n, 3)
    direction: F64Array  # (n, 3), any length: t is in its units
    skip: I32Array  # (n,) or none
    guard: F64Array  # (n, 4) or no rows
    t_max: float


class Hits(NamedTuple):
    """What each ray meets first; triangle_id −1, t inf and weights NaN where there is nothing.

    front: met from the side that sees its corners counter-clockwise.
    """

    triangle_id: I32Array  # (n,)
    t: F64Array  # (n,)
    weights: F64Array  # (n, 3) of the corners
    front: BoolArray  # (n,)


class Slabs(NamedTuple):
    """A ray as box tests read it: t = plane·inverse − offset, offsets moved by the padding."""

    inverse_x: float
    inverse_y: float
    inverse_z: float
    near_x: float
    near_y: float
    near_z: float
    far_x: float
    far_y: float
    far_z: float
    low_x: int  # column of the plane that is entered: 0, or 3 where the ray runs down
    low_y: int
    low_z: int


def rays_of(origin: F64Array, direction: F64Array, t_max: float = np.inf) -> Rays:
    """Rays that may meet every triangle."""
    return Rays(
        np.ascontiguousarray(origin, np.float64),
        np.ascontiguousarray(direction, np.float64),
        np.empty(0, np.int32),
        np.empty((0, 4)),
        float(t_max),
    )


def empty_hits(n: int) -> Hits:
    """Room for n rays' hits."""
    return Hits(np.empty(n, np.int32), np.empty(n), np.empty((n, 3)), np.empty(n, np.bool_))


def nearest_plain(bvh: Bvh, rays: Rays, cutout: Cutout | None = None) -> Hits:
    """What each ray meets first. cutout: None: masked triangles are solid."""
    hits = empty_hits(len(rays.origin))
    trace_nearest(bvh, *(cutout or solid()), False, *rays, *hits)
    return hits


def any_hit(bvh: Bvh, rays: Rays, cutout: Cutout | None = None) -> BoolArray:
    """(n,) whether each ray meets anything within t_max."""
    hits = empty_hits(len(rays.origin))
    trace_nearest(bvh, *(cutout or solid()), True, *rays, *hits)
    return np.asarray(hits.triangle_id >= 0)


@kernel
def slope_of(d: float, most: float) -> float:
    """A direction component that a box test can divide by; most: the largest of the three."""
    least = LEAST_SLOPE * most
    if abs(d) >= least:
        return d
    return -least if d < 0.0 else least


@kernel
def slabs_of(o: Vec3, d: Vec3, reach: float) -> Slabs:
    """Set up the box tests of the ray o + t·d in a scene whose coordinates are within reach."""
    most = max(abs(d.x), abs(d.y), abs(d.z))
    dx, dy, dz = slope_of(d.x, most), slope_of(d.y, most), slope_of(d.z, most)
    ix, iy, iz = 1.0 / dx, 1.0 / dy, 1.0 / dz
    pad = PADDING * (max(abs(o.x), abs(o.y), abs(o.z)) + reach)
    px = pad if dx > 0.0 else -pad
    py = pad if dy > 0.0 else -pad
    pz = pad if dz > 0.0 else -pad
    return Slabs(
        ix,
        iy,
        iz,
        (o.x + px) * ix,
        (o.y + py) * iy,
        (o.z + pz) * iz,
        (o.x - px) * ix,
        (o.y - py) * iy,
        (o.z - pz) * iz,
        0 if dx > 0.0 else 3,
        0 if dy > 0.0 else 3,
        0 if dz > 0.0 else 3,
    )


@inlined
def enters(boxes: F32Array, node: int, at: int, s: Slabs, t_best: float) -> float:
    """t at which the ray enters box boxes[node, at : at + 6], inf if not before t_best."""
    nx, ny, nz = at + s.low_x, at + 1 + s.low_y, at + 2 + s.low_z
    t = np.float64(boxes[node, nx]) * s.inverse_x - s.near_x
    t_y = np.float64(boxes[node, ny]) * s.inverse_y - s.near_y
    t_z = np.float64(boxes[node, nz]) * s.inverse_z - s.near_z
    t = max(t, t_y, t_z, 0.0)
    end = np.float64(boxes[node, at + 3 - s.low_x]) * s.inverse_x - s.far_x
    end_y = np.float64(boxes[node, at + 4 - s.low_y]) * s.inverse_y - s.far_y
    end_z = np.float64(boxes[node, at + 5 - s.low_z]) * s.inverse_z - s.far_z
    end = min(end, end_y, end_z, t_best)
    return t if t <= end else np.inf


@inlined
def root_of(children: I32Array) -> int:
    """The node to start at: 0 only if the whole scene is one leaf."""
    return 1 if children.shape[0] > 1 else 0


@kernel
def walk(
    bvh: Bvh,
    faces: I32Array,
    material: I32Array,
    textures: Textures | None,
    rays: Rays,
    i: int,
    first_only: bool,
    stack: I64Array,
    stack_t: F64Array,
) -> tuple[int, Meeting]:
    """The triangle (NO_ID: none) that ray i meets first, or (first_only) at all, and where.

    stack, stack_t: (STACK,) scratch.
    """
    o, d = load(rays.origin, i), load(rays.direction, i)
    t_best, id_best, best = rays.t_max, NO_ID, apart()
    if not is_traced(o, d):
        return NO_ID, best
    boxes, children, corners = bvh.boxes, bvh.children, bvh.corners
    ids, flags, guards = bvh.ids, bvh.flags, rays.guard
    skip = rays.skip[i] if rays.skip.shape[0] > 0 else np.int32(-1)
    ray = shear_of(o, d)
    slabs = slabs_of(o, d, bvh.reach)
    waiting = 0
    node = np.int64(root_of(children))
    while True:
        if node >= 0:
            t0 = enters(boxes, node, 0, slabs, t_best)
            t1 = enters(boxes, node, 6, slabs, t_best)
            c0, c1 = np.int64(children[node, 0]), np.int64(children[node, 1])
            if t0 < np.inf and t1 < np.inf:
                if t0 <= t1:
                    node, stack[waiting], stack_t[waiting] = c0, c1, t1
                else:
                    node, stack[waiting], stack_t[waiting] = c1, c0, t0
                waiting += 1
                continue
            if t0 < np.inf:
                node = c0
                continue
            if t1 < np.inf:
                node = c1
                continue
        else:
            leaf = ~node
            for k in range(leaf >> 3, (leaf >> 3) + (leaf & 7)):
                if ids[k] == skip:
                    continue
                m = meet(ray, corners, k, (flags[k] & DOUBLE_SIDED) != 0)
                if accepts(
                    faces, material, textures, guards, i, ids[k], flags[k], m, t_best, id_best
                ):
                    t_best, id_best, best = m.t, ids[k], m
                    if first_only:
                        return id_best, best
        while waiting > 0 and stack_t[waiting - 1] > t_best:
            waiting -= 1
        if waiting == 0:
            break
        waiting -= 1
        node = stack[waiting]
    return id_best, best


@kernel
def store_hit(
    i: int,
    triangle: int,
    m: Meeting,
    triangle_id: I32Array,
    t: F64Array,
    weights: F64Array,
    front: BoolArray,
) -> None:
    """Ray i meets a triangle, NO_ID for none."""
    triangle_id[i] = triangle if m.met else -1
    t[i] = m.t
    weights[i, 0] = m.b0
    weights[i, 1] = m.b1
    weights[i, 2] = m.b2
    front[i] = m.front


@driver()
def trace_nearest(
    bvh: Bvh,
    faces: I32Array,
    material: I32Array,
    textures: Textures | None,
    first_only: bool,
    origin: F64Array,
    direction: F64Array,
    skip: I32Array,
    guard: F64Array,
    t_max: float,
    triangle_id: I32Array,
    t: F64Array,
    weights: F64Array,
    front: BoolArray,
) -> None:
    """The first hit of every ray, or (first_only) any, into the arrays of `Hits`."""
    n = origin.shape[0]
    for chunk in prange((n + CHUNK - 1) // CHUNK):
        rays = Rays(origin, direction, skip, guard, t_max)
        stack = np.empty(STACK, np.int64)
        stack_t = np.empty(STACK)
        for i in range(chunk * CHUNK, min(n, (chunk + 1) * CHUNK)):
            triangle, m = walk(bvh, faces, material, textures, rays, i, first_only, stack, stack_t)
            store_hit(i, triangle, m, triangle_id, t, weights, front)

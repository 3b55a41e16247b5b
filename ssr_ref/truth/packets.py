"""Sixteen rays at a time through the hierarchy: the bytes of `nearest`, sooner.

Rays of a packet run the same way: they are sorted, within a chunk, by octant and by the axis that
they run along most. A node's planes and a triangle's corners are then one number for all lanes, and
both tests are loops over lanes without a branch, which the compiler turns into vector code (Wald,
Slusallek, Benthin and Wagner, Interactive rendering with coherent ray tracing, 2001).

Nothing here decides a hit. The vector loops only leave out what cannot be one, by bounds that hold
whatever is rounded; each lane that is left is asked by `triangle.meet` and `accept.accepts`, as a
ray alone would be. The first hit is the least (t, number) of what those let through, so the order
of packets, lanes and nodes changes no byte.
"""

from __future__ import annotations

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
from .nearest import Hits, Rays, empty_hits, root_of, slabs_of, store_hit
from .triangle import Shear, apart, is_traced, main_axis, meet, shear_of

LANES = 16
PACKET_CHUNK = 1024
"""Rays that are sorted, and that one thread takes, at a time."""

GROUPS = 24
"""Octants times axes."""

# Rows of a packet's state, LANES numbers each.
INVERSE, NEAR, FAR, ORIGIN = 0, 3, 6, 9
SHEAR_X, SHEAR_Y, SLOPE, BEST, ASKED = 12, 13, 14, 15, 16
ROWS = 17

EDGE_ERROR = 2.0**-51
"""Rounding of a·b − c·d, in shares of |a·b| + |c·d|, doubled."""

LEAST_ERROR = 2.0**-1020
DISTANCE_ERROR = 1.0 + 2.0**-48
"""More than `meet` rounds a distance by, relatively, where all corners are ahead."""


def nearest(bvh: Bvh, rays: Rays, cutout: Cutout | None = None) -> Hits:
    """What each ray meets first; the more rays beside each other run alike, the faster.

    cutout: None: masked triangles are solid.
    """
    hits = empty_hits(len(rays.origin))
    trace_packets(bvh, *(cutout or solid()), *rays, *hits)
    return hits


@kernel
def sort_rays(
    origin: F64Array,
    direction: F64Array,
    first: int,
    end: int,
    group: I64Array,
    order: I64Array,
    start: I64Array,
) -> None:
    """Write the chunk's rays to `order` by group: group g at start[g] : start[g + 1].

    Rays that are not traced come last. group: scratch; start: (GROUPS + 2,).
    """
    for g in range(GROUPS + 2):
        start[g] = 0
    for i in range(first, end):
        o, d = load(origin, i), load(direction, i)
        g = GROUPS
        if is_traced(o, d):
            octant = (1 if d.x < 0.0 else 0) | (2 if d.y < 0.0 else 0) | (4 if d.z < 0.0 else 0)
            g = octant * 3 + main_axis(d)
        group[i - first] = g
        start[g + 1] += 1
    for g in range(GROUPS + 1):
        start[g + 1] += start[g]
    for i in range(first, end):
        g = group[i - first]
        order[start[g]] = i
        start[g] += 1
    for g in range(GROUPS + 1, 0, -1):
        start[g] = start[g - 1]
    start[0] = 0


@kernel
def load_lane(o: Vec3, d: Vec3, reach: float, t_max: float, lane: int, p: F64Array) -> None:
    """Write the ray o + t·d into a lane of the packet's state."""
    s = slabs_of(o, d, reach)
    ray = shear_of(o, d)
    p[lane + LANES * INVERSE] = s.inverse_x
    p[lane + LANES * (INVERSE + 1)] = s.inverse_y
    p[lane + LANES * (INVERSE + 2)] = s.inverse_z
    p[lane + LANES * NEAR] = s.near_x
    p[lane + LANES * (NEAR + 1)] = s.near_y
    p[lane + LANES * (NEAR + 2)] = s.near_z
    p[lane + LANES * FAR] = s.far_x
    p[lane + LANES * (FAR + 1)] = s.far_y
    p[lane + LANES * (FAR + 2)] = s.far_z
    p[lane + LANES * ORIGIN] = ray.ox
    p[lane + LANES * (ORIGIN + 1)] = ray.oy
    p[lane + LANES * (ORIGIN + 2)] = ray.oz
    p[lane + LANES * SHEAR_X] = ray.sx
    p[lane + LANES * SHEAR_Y] = ray.sy
    p[lane + LANES * SLOPE] = ray.dz
    p[lane + LANES * BEST] = t_max


@inlined
def lane_shear(lead: Shear, j: int, p: F64Array) -> Shear:
    """The ray of lane j; lead: one of its group."""
    return Shear(
        lead.kx,
        lead.ky,
        lead.kz,
        p[j + ORIGIN * LANES],
        p[j + (ORIGIN + 1) * LANES],
        p[j + (ORIGIN + 2) * LANES],
        p[j + SHEAR_X * LANES],
        p[j + SHEAR_Y * LANES],
        p[j + SLOPE * LANES],
    )


@inlined
def greater(a: float, b: float) -> float:
    """The greater of two numbers, as one instruction."""
    return a if a > b else b


@inlined
def lesser(a: float, b: float) -> float:
    """The lesser of two numbers, as one instruction."""
    return a if a < b else b


@inlined
def enter_children(
    boxes: F32Array, node: int, low_x: int, low_y: int, low_z: int, p: F64Array
) -> tuple[int, int, int]:
    """How many lanes enter child 0, child 1, and both but child 0 first."""
    n0x, n0y = np.float64(boxes[node, low_x]), np.float64(boxes[node, 1 + low_y])
    n0z, f0x = np.float64(boxes[node, 2 + low_z]), np.float64(boxes[node, 3 - low_x])
    f0y, f0z = np.float64(boxes[node, 4 - low_y]), np.float64(boxes[node, 5 - low_z])
    n1x, n1y = np.float64(boxes[node, 6 + low_x]), np.float64(boxes[node, 7 + low_y])
    n1z, f1x = np.float64(boxes[node, 8 + low_z]), np.float64(boxes[node, 9 - low_x])
    f1y, f1z = np.float64(boxes[node, 10 - low_y]), np.float64(boxes[node, 11 - low_z])
    first, second, ordered = 0, 0, 0
    for j in range(LANES):
        ix, iy, iz = p[j], p[j + LANES], p[j + 2 * LANES]
        nx, ny, nz = p[j + 3 * LANES], p[j + 4 * LANES], p[j + 5 * LANES]
        fx, fy, fz = p[j + 6 * LANES], p[j + 7 * LANES], p[j + 8 * LANES]
        best = p[j + BEST * LANES]
        t0 = greater(greater(n0x * ix - nx, n0y * iy - ny), greater(n0z * iz - nz, 0.0))
        e0 = lesser(lesser(f0x * ix - fx, f0y * iy - fy), lesser(f0z * iz - fz, best))
        t1 = greater(greater(n1x * ix - nx, n1y * iy - ny), greater(n1z * iz - nz, 0.0))
        e1 = lesser(lesser(f1x * ix - fx, f1y * iy - fy), lesser(f1z * iz - fz, best))
        in_0, in_1 = t0 <= e0, t1 <= e1
        first += 1 if in_0 else 0
        second += 1 if in_1 else 0
        ordered += 1 if (in_0 & in_1 & (t0 <= t1)) else 0
    return first, second, ordered


@inlined
def ask_lanes(
    corners: F64Array, k: int, kx: int, ky: int, kz: int, sign: float, p: F64Array
) -> int:
    """Set ASKED of each lane that triangle k may be a better hit of to 1, of the others to 0.

    sign: of the direction along kz. Returns how many.
    """
    vax, vay, vaz = corners[k, kx], corners[k, ky], corners[k, kz]
    vbx, vby, vbz = corners[k, 3 + kx], corners[k, 3 + ky], corners[k, 3 + kz]
    vcx, vcy, vcz = corners[k, 6 + kx], corners[k, 6 + ky], corners[k, 6 + kz]
    asked = 0
    for j in range(LANES):
        ox, oy, oz = p[j + 9 * LANES], p[j + 10 * LANES], p[j + 11 * LANES]
        sx, sy = p[j + SHEAR_X * LANES], p[j + SHEAR_Y * LANES]
        az, bz, cz = vaz - oz, vbz - oz, vcz - oz
        ax, ay = (vax - ox) - sx * az, (vay - oy) - sy * az
        bx, by = (vbx - ox) - sx * bz, (vby - oy) - sy * bz
        cx, cy = (vcx - ox) - sx * cz, (vcy - oy) - sy * cz
        u0, u1 = cx * by, cy * bx
        v0, v1 = ax * cy, ay * cx
        w0, w1 = bx * ay, by * ax
        u_off = (abs(u0) + abs(u1)) * EDGE_ERROR + LEAST_ERROR
        v_off = (abs(v0) + abs(v1)) * EDGE_ERROR + LEAST_ERROR
        w_off = (abs(w0) + abs(w1)) * EDGE_ERROR + LEAST_ERROR
        u, v, w = u0 - u1, v0 - v1, w0 - w1
        below = (u < -u_off) | (v < -v_off) | (w < -w_off)
        above = (u > u_off) | (v > v_off) | (w > w_off)
        # The hit's distance lies between those of the corners.
        za, zb, zc = sign * az, sign * bz, sign * cz
        limit = p[j + BEST * LANES] * (p[j + SLOPE * LANES] * sign) * DISTANCE_ERROR
        beyond = lesser(za, lesser(zb, zc)) > limit
        behind = greater(za, greater(zb, zc)) < 0.0
        out = (below & above) | beyond | behind
        p[j + ASKED * LANES] = 0.0 if out else 1.0
        asked += 0 if out else 1
    return asked


@kernel
def walk_packet(
    bvh: Bvh,
    faces: I32Array,
    material: I32Array,
    textures: Textures | None,
    rays: Rays,
    order: I64Array,
    first: int,
    count: int,
    p: F64Array,
    lanes: I64Array,
    stack: I64Array,
    triangle_id: I32Array,
    t: F64Array,
    weights: F64Array,
    front: BoolArray,
) -> None:
    """Trace rays order[first : first + count], all of one group, into the arrays of `Hits`.

    p (ROWS·LANES,), lanes (LANES,) for the triangle of each, and stack (STACK,) are scratch.
    """
    boxes, children, corners = bvh.boxes, bvh.children, bvh.corners
    ids, flags = bvh.ids, bvh.flags
    origin, direction, guards, skips = rays.origin, rays.direction, rays.guard, rays.skip
    for j in range(LANES):
        i = order[first + min(j, count - 1)]
        load_lane(load(origin, i), load(direction, i), bvh.reach, rays.t_max, j, p)
        lanes[j] = NO_ID
        store_hit(i, NO_ID, apart(), triangle_id, t, weights, front)
        if j >= count:
            p[j + BEST * LANES] = -np.inf
    lead = shear_of(load(origin, order[first]), load(direction, order[first]))
    sign = 1.0 if lead.dz > 0.0 else -1.0
    low_x = 0 if p[0] > 0.0 else 3
    low_y = 0 if p[LANES] > 0.0 else 3
    low_z = 0 if p[2 * LANES] > 0.0 else 3
    waiting = 0
    node = np.int64(root_of(children))
    while True:
        if node >= 0:
            n0, n1, ordered = enter_children(boxes, node, low_x, low_y, low_z, p)
            c0, c1 = np.int64(children[node, 0]), np.int64(children[node, 1])
            if n0 > 0 and n1 > 0:
                if 2 * ordered >= min(n0, n1):
                    node, stack[waiting] = c0, c1
                else:
                    node, stack[waiting] = c1, c0
                waiting += 1
                continue
            if n0 > 0:
                node = c0
                continue
            if n1 > 0:
                node = c1
                continue
        else:
            leaf = ~node
            for k in range(leaf >> 3, (leaf >> 3) + (leaf & 7)):
                if ask_lanes(corners, k, lead.kx, lead.ky, lead.kz, sign, p) == 0:
                    continue
                for j in range(count):
                    if p[j + ASKED * LANES] == 0.0:
                        continue
                    i = order[first + j]
                    if skips.shape[0] > 0 and ids[k] == skips[i]:
                        continue
                    both_sides = (flags[k] & DOUBLE_SIDED) != 0
                    m = meet(lane_shear(lead, j, p), corners, k, both_sides)
                    t_best, id_best = p[j + BEST * LANES], lanes[j]
                    if accepts(
                        faces,
                        material,
                        textures,
                        guards,
                        i,
                        ids[k],
                        flags[k],
                        m,
                        t_best,
                        id_best,
                    ):
                        p[j + BEST * LANES] = m.t
                        lanes[j] = ids[k]
                        store_hit(i, ids[k], m, triangle_id, t, weights, front)
        if waiting == 0:
            break
        waiting -= 1
        node = stack[waiting]


@driver()
def trace_packets(
    bvh: Bvh,
    faces: I32Array,
    material: I32Array,
    textures: Textures | None,
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
    """The first hit of every ray, into the arrays of `Hits`."""
    n = origin.shape[0]
    for chunk in prange((n + PACKET_CHUNK - 1) // PACKET_CHUNK):
        rays = Rays(origin, direction, skip, guard, t_max)
        begin, end = chunk * PACKET_CHUNK, min(n, (chunk + 1) * PACKET_CHUNK)
        group, order = np.empty(PACKET_CHUNK, np.int64), np.empty(PACKET_CHUNK, np.int64)
        start = np.empty(GROUPS + 2, np.int64)
        p = np.zeros(ROWS * LANES)
        lanes = np.empty(LANES, np.int64)
        stack = np.empty(STACK, np.int64)
        sort_rays(origin, direction, begin, end, group, order, start)
        for g in range(GROUPS):
            first = start[g]
            while first < start[g + 1]:
                count = min(LANES, start[g + 1] - first)
                walk_packet(
                    bvh,
                    faces,
                    material,
                    textures,
                    rays,
                    order,
                    first,
                    count,
                    p,
                    lanes,
                    stack,
                    triangle_id,
                    t,
                    weights,
                    front,
                )
                first += count
        for slot in range(start[GROUPS], start[GROUPS + 1]):
            store_hit(order[slot], NO_ID, apart(), triangle_id, t, weights, front)

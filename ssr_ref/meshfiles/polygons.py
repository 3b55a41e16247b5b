"""Polygons to triangles: a fan where it is right, ears where it is not.

A polygon that turns left at every corner (collinear ones allowed), seen along its Newell normal, is
a fan from its first corner, as other readers make it: those files keep their triangles. The fan of
a concave one would lie partly outside, so its ears are clipped (Meisters 1975; Eberly,
"Triangulation by Ear Clipping"), projected along the greatest component of the normal. What no ear
can be found in crosses itself or has no area: a fan, counted.

Coordinates are float32 and their differences float64, so the sign of a turn is exact for corners
that are not more than 2²⁰ times apart in size.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._jit import driver, kernel
from ..typed import F32Array, F64Array, I64Array
from ..vecmath.vec import difference_of_products

MAX_TESTS = 2**28
"""Tests of a corner against an ear in one file, about a second; polygons after that are fans."""


class Triangles(NamedTuple):
    """corners (m, 3) int64 numbers of corners, polygon by polygon; polygon (m,) it is of.

    fans : polygons with neither a convex outline nor ears, drawn as fans all the same.
    """

    corners: I64Array
    polygon: I64Array
    fans: int


def triangulate(positions: F32Array, sizes: I64Array, vertex: I64Array) -> Triangles:
    """Triangles of polygons in their order; size − 2 of each, none of those with under 3 corners.

    positions (n, 3); sizes (p,) corners of each polygon; vertex (sum of sizes,) the position of
    each corner, in range.
    """
    starts = np.cumsum(sizes) - sizes
    counts = np.maximum(sizes - 2, 0)
    polygon = np.repeat(np.arange(len(sizes)), counts)
    offsets = np.cumsum(counts) - counts
    second = np.arange(len(polygon)) - offsets[polygon] + 1
    corners = starts[polygon][:, None] + np.stack([0 * second, second, second + 1], axis=1)
    large = np.flatnonzero(sizes > 3)
    fans = 0
    if len(large):
        work = np.empty((2, int(sizes.max())), np.int64)
        flat = np.empty((int(sizes.max()), 2))
        fans = _clip_ears(
            positions, starts[large], sizes[large], vertex, offsets[large], corners, work, flat
        )
    return Triangles(corners, polygon, int(fans))


@kernel
def _turn(points: F64Array, a: int, b: int, c: int) -> float:
    """Twice the signed area of a b c: positive for a left turn."""
    return difference_of_products(
        points[b, 0] - points[a, 0],
        points[c, 1] - points[a, 1],
        points[b, 1] - points[a, 1],
        points[c, 0] - points[a, 0],
    )


@kernel
def _project(positions: F32Array, vertex: I64Array, start: int, n: int, flat: F64Array) -> bool:
    """flat[:n] = the corners seen along the Newell normal; False where there is none."""
    o = vertex[start]
    normal_x, normal_y, normal_z = 0.0, 0.0, 0.0
    for i in range(1, n - 1):
        a, b = vertex[start + i], vertex[start + i + 1]
        ux = np.float64(positions[a, 0]) - np.float64(positions[o, 0])
        uy = np.float64(positions[a, 1]) - np.float64(positions[o, 1])
        uz = np.float64(positions[a, 2]) - np.float64(positions[o, 2])
        vx = np.float64(positions[b, 0]) - np.float64(positions[o, 0])
        vy = np.float64(positions[b, 1]) - np.float64(positions[o, 1])
        vz = np.float64(positions[b, 2]) - np.float64(positions[o, 2])
        normal_x += difference_of_products(uy, vz, uz, vy)
        normal_y += difference_of_products(uz, vx, ux, vz)
        normal_z += difference_of_products(ux, vy, uy, vx)
    largest = max(abs(normal_x), abs(normal_y), abs(normal_z))
    if not (np.isfinite(normal_x + normal_y + normal_z) and largest > 0.0):
        return False
    if abs(normal_z) == largest:
        first, second, sign = 0, 1, normal_z
    elif abs(normal_y) == largest:
        first, second, sign = 2, 0, normal_y
    else:
        first, second, sign = 1, 2, normal_x
    if sign < 0.0:
        first, second = second, first
    for i in range(n):
        v = vertex[start + i]
        flat[i, 0] = np.float64(positions[v, first])
        flat[i, 1] = np.float64(positions[v, second])
    return True


@driver(parallel=False)
def _clip_ears(
    positions: F32Array,
    starts: I64Array,
    sizes: I64Array,
    vertex: I64Array,
    offsets: I64Array,
    corners: I64Array,
    work: I64Array,
    flat: F64Array,
) -> int:
    """Rewrite the fan of each concave polygon in `corners`; returns how many must stay fans."""
    before, after = work[0], work[1]
    fans = 0
    tests = 0
    for p in range(len(sizes)):
        start, n, row = starts[p], sizes[p], offsets[p]
        if not _project(positions, vertex, start, n, flat):
            fans += 1
            continue
        convex = True
        for i in range(n):
            before[i] = (i + n - 1) % n
            after[i] = (i + 1) % n
            convex = convex and _turn(flat, before[i], i, after[i]) >= 0.0
        if convex:
            continue
        left = n
        i = 0
        passed = 0  # corners looked at since the last ear
        flat_ears = False  # collinear corners are taken only where no proper ear is left
        while left > 3 and tests < MAX_TESTS:
            a, b = before[i], after[i]
            turn = _turn(flat, a, i, b)
            ear = turn > 0.0 or (flat_ears and turn == 0.0)
            q = after[b]
            while ear and turn > 0.0 and q != a:
                tests += 1
                inside = _turn(flat, a, i, q) > 0.0 and _turn(flat, i, b, q) > 0.0
                ear = not (inside and _turn(flat, b, a, q) >= 0.0)
                q = after[q]
            if ear:
                at = row + n - left
                corners[at, 0], corners[at, 1], corners[at, 2] = start + a, start + i, start + b
                after[a], before[b] = b, a
                left -= 1
                passed = 0
                flat_ears = False
            else:
                passed += 1
                if passed > left:
                    if flat_ears:
                        break
                    flat_ears = True
                    passed = 0
            i = b
        if left == 3 and _turn(flat, before[i], i, after[i]) >= 0.0:
            at = row + n - 3
            corners[at, 0], corners[at, 1], corners[at, 2] = (
                start + before[i],
                start + i,
                start + after[i],
            )
            continue
        fans += 1
        for k in range(n - 2):
            corners[row + k, 0], corners[row + k, 1] = start, start + k + 1
            corners[row + k, 2] = start + k + 2
    return fans

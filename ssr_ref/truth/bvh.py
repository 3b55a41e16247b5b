"""A bounding volume hierarchy over triangles: binned surface area heuristic, two children a node.

A node holds the boxes of both its children, so a visit reads one place (Wald, On fast construction
of SAH-based bounding volume hierarchies, 2007, for the bins). Boxes are float32, rounded outward
from the float64 corners; triangles are tested in float64. Splits follow from the triangles' order
alone: the same tree on every machine and for any number of threads.

Where the heuristic would make the tree deeper than `SAH_DEPTH` ranges are halved in their order, so
a traversal needs no more than `STACK` places whatever the triangles are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._jit import driver, kernel
from ..raster.surface import load
from ..typed import F32Array, F64Array, I32Array, U8Array
from ..vecmath.exact import cross_pairs, difference_of_points
from ..vecmath.vec import Vec3, cross, is_finite, sub

LEAF = 4
"""Triangles of a leaf at most."""

BINS = 16
SAH_DEPTH = 48
STACK = SAH_DEPTH + 32

EMPTY_LEAF = -1
"""`children` of a side without triangles: ~(0·8 + 0)."""


class Bvh(NamedTuple):
    """The tree, depth first, and its triangles in the order of the leaves.

    boxes: of child 0, then of child 1: least x y z, greatest x y z. children: a node's number, or
    ~(first·8 + count) of a leaf's triangles. Node 0 stands above the root.
    """

    boxes: F32Array  # (n, 12)
    children: I32Array  # (n, 2)
    corners: F64Array  # (m, 9) x y z of each corner
    ids: I32Array  # (m,) the triangle's number
    flags: U8Array  # (m,) bits of `raster.geometry`
    reach: float  # largest |coordinate| of any corner


def build_bvh(points: F64Array, faces: I32Array, flags: U8Array) -> Bvh:
    """The tree of triangles faces (nt, 3) int32 over points (nv, 3) float64, in any space.

    flags (nt,) uint8 as in `raster.geometry.Geometry`. Triangles with a NaN or infinite corner, or
    without area, are left out: no ray meets them.
    """
    ids = np.empty(len(faces), np.int32)
    ids = ids[: keep_usable(points, faces, ids)]
    boxes, centroids, reach = bound_triangles(points, faces, ids)
    order = np.arange(len(ids), dtype=np.int32)
    node_boxes, children = build_nodes(boxes, centroids, order)
    del boxes, centroids
    ids = ids[order]
    corners = points[faces[ids].ravel()].reshape(-1, 9)
    return Bvh(node_boxes, children, corners, ids, flags[ids], float(reach))


@kernel
def has_area(a: Vec3, b: Vec3, c: Vec3) -> bool:
    """Whether three finite corners span an area, however small."""
    e, f = sub(b, a), sub(c, a)
    n = cross(e, f)
    size = max(abs(e.x), abs(e.y), abs(e.z)) * max(abs(f.x), abs(f.y), abs(f.z))
    if max(abs(n.x), abs(n.y), abs(n.z)) > 2.0**-40 * size:
        return True
    exact = cross_pairs(difference_of_points(b, a), difference_of_points(c, a))
    return exact.x.hi != 0.0 or exact.y.hi != 0.0 or exact.z.hi != 0.0


@driver(parallel=False)
def keep_usable(points: F64Array, faces: I32Array, ids: I32Array) -> int:
    """Write the numbers of triangles that a ray can meet to `ids`; how many."""
    n = 0
    for t in range(faces.shape[0]):
        a, b, c = load(points, faces[t, 0]), load(points, faces[t, 1]), load(points, faces[t, 2])
        if is_finite(a) and is_finite(b) and is_finite(c) and has_area(a, b, c):
            ids[n] = t
            n += 1
    return n


@kernel
def float_below(x: float) -> np.float32:
    """The greatest float32 that is not above x."""
    r = np.float32(x)
    return np.nextafter(r, np.float32(-np.inf)) if np.float64(r) > x else r


@kernel
def float_above(x: float) -> np.float32:
    """The least float32 that is not below x."""
    r = np.float32(x)
    return np.nextafter(r, np.float32(np.inf)) if np.float64(r) < x else r


@driver(parallel=False)
def bound_triangles(
    points: F64Array, faces: I32Array, ids: I32Array
) -> tuple[F32Array, F32Array, float]:
    """Boxes (m, 6) float32 rounded outward, their middles (m, 3), and the reach."""
    m = ids.shape[0]
    boxes = np.empty((m, 6), np.float32)
    centroids = np.empty((m, 3), np.float32)
    half = np.float32(0.5)
    reach = 0.0
    for i in range(m):
        t = ids[i]
        for axis in range(3):
            p, q, r = (
                points[faces[t, 0], axis],
                points[faces[t, 1], axis],
                points[faces[t, 2], axis],
            )
            low, high = min(p, q, r), max(p, q, r)
            reach = max(reach, abs(low), abs(high))
            boxes[i, axis] = float_below(low)
            boxes[i, 3 + axis] = float_above(high)
            centroids[i, axis] = boxes[i, axis] * half + boxes[i, 3 + axis] * half
    return boxes, centroids, reach


@kernel
def half_area(box: F32Array, row: int, at: int) -> float:
    """Half the surface of box[row, at : at + 6]; 0 if it is empty."""
    x = np.float64(box[row, at + 3]) - np.float64(box[row, at])
    y = np.float64(box[row, at + 4]) - np.float64(box[row, at + 1])
    z = np.float64(box[row, at + 5]) - np.float64(box[row, at + 2])
    return x * y + y * z + z * x if x >= 0.0 else 0.0


@kernel
def clear_box(box: F32Array, row: int, at: int) -> None:
    """Make box[row, at : at + 6] hold nothing."""
    for axis in range(3):
        box[row, at + axis] = np.float32(np.inf)
        box[row, at + 3 + axis] = np.float32(-np.inf)


@kernel
def grow_box(box: F32Array, row: int, at: int, other: F32Array, i: int, from_: int) -> None:
    """Make box[row, at : at + 6] hold other[i, from_ : from_ + 6] too."""
    for axis in range(3):
        low, high = other[i, from_ + axis], other[i, from_ + 3 + axis]
        if low < box[row, at + axis]:
            box[row, at + axis] = low
        if high > box[row, at + 3 + axis]:
            box[row, at + 3 + axis] = high


@kernel
def bin_of(c: np.float32, low: np.float32, scale: np.float32) -> int:
    """Bin of a centroid, 0 to BINS − 1, whatever the numbers are."""
    b = (c - low) * scale
    if not b >= np.float32(0.0):
        return 0
    return np.int64(b) if b < np.float32(BINS - 1) else BINS - 1


@kernel
def split_range(
    boxes: F32Array,
    centroids: F32Array,
    order: I32Array,
    first: int,
    end: int,
    area: float,
    spread: F32Array,
    bins: F32Array,
    counts: I32Array,
    costs: F64Array,
) -> int:
    """Reorder order[first:end] in two parts; where the second begins, `first` for a leaf.

    area: of the range's box; spread (1, 6): box of its centroids. The rest is scratch. The cost of
    a visit and that of a triangle are equal.
    """
    n = end - first
    axis = 0
    for other in range(1, 3):
        if spread[0, 3 + other] - spread[0, other] > spread[0, 3 + axis] - spread[0, axis]:
            axis = other
    width = spread[0, 3 + axis] - spread[0, axis]
    best, best_bin = np.inf, -1
    low = spread[0, axis]
    scale = np.float32(0.0)
    if width > np.float32(0.0):
        scale = np.float32(BINS) / width
        for b in range(BINS):
            counts[b] = 0
            clear_box(bins, b, 0)
        for slot in range(first, end):
            i = order[slot]
            b = bin_of(centroids[i, axis], low, scale)
            counts[b] += 1
            grow_box(bins, b, 0, boxes, i, 0)
        # Sweep from the right, then from the left.
        clear_box(bins, BINS, 0)
        behind = 0
        for b in range(BINS - 1, 0, -1):
            grow_box(bins, BINS, 0, bins, b, 0)
            behind += counts[b]
            costs[b] = half_area(bins, BINS, 0) * behind
        clear_box(bins, BINS, 0)
        before = 0
        for b in range(BINS - 1):
            grow_box(bins, BINS, 0, bins, b, 0)
            before += counts[b]
            if 0 < before < n:
                cost = half_area(bins, BINS, 0) * before + costs[b + 1]
                if cost < best:
                    best, best_bin = cost, b
    if n <= LEAF and not best + area < n * area:
        return first
    if best_bin < 0:
        return (first + end) >> 1
    i, j = first, end - 1
    while i <= j:
        if bin_of(centroids[order[i], axis], low, scale) <= best_bin:
            i += 1
        else:
            order[i], order[j] = order[j], order[i]
            j -= 1
    return i


@driver(parallel=False)
def build_nodes(boxes: F32Array, centroids: F32Array, order: I32Array) -> tuple[F32Array, I32Array]:
    """Nodes over the triangles; `order` becomes that of the leaves."""
    n = order.shape[0]
    node_boxes = np.empty((n + 1, 12), np.float32)
    children = np.full((n + 1, 2), EMPTY_LEAF, np.int32)
    clear_box(node_boxes, 0, 0)
    clear_box(node_boxes, 0, 6)
    # Ranges to do: first, end, node above, side, depth.
    todo = np.empty((2 * STACK, 5), np.int64)
    spread = np.empty((1, 6), np.float32)
    bins = np.empty((BINS + 1, 6), np.float32)
    counts = np.empty(BINS, np.int32)
    costs = np.empty(BINS)
    waiting = 0
    nodes = 1
    if n > 0:
        todo[0, 0] = 0
        todo[0, 1] = n
        todo[0, 2] = 0
        todo[0, 3] = 0
        todo[0, 4] = 0
        waiting = 1
    while waiting > 0:
        waiting -= 1
        first, end = todo[waiting, 0], todo[waiting, 1]
        above, side, depth = todo[waiting, 2], todo[waiting, 3], todo[waiting, 4]
        at = 6 * side
        clear_box(node_boxes, above, at)
        clear_box(spread, 0, 0)
        for slot in range(first, end):
            i = order[slot]
            grow_box(node_boxes, above, at, boxes, i, 0)
            for axis in range(3):
                c = centroids[i, axis]
                if c < spread[0, axis]:
                    spread[0, axis] = c
                if c > spread[0, 3 + axis]:
                    spread[0, 3 + axis] = c
        middle = first
        if end - first > 1:
            if depth < SAH_DEPTH:
                area = half_area(node_boxes, above, at)
                middle = split_range(
                    boxes, centroids, order, first, end, area, spread, bins, counts, costs
                )
            elif end - first > LEAF:
                middle = (first + end) >> 1
        if middle == first:
            children[above, side] = ~(first * 8 + (end - first))
            continue
        node = nodes
        nodes += 1
        children[above, side] = node
        clear_box(node_boxes, node, 0)
        clear_box(node_boxes, node, 6)
        for part in range(2):  # child 0 last, so that it is done first
            todo[waiting, 0] = middle if part == 0 else first
            todo[waiting, 1] = end if part == 0 else middle
            todo[waiting, 2] = node
            todo[waiting, 3] = 1 - part
            todo[waiting, 4] = depth + 1
            waiting += 1
    return node_boxes[:nodes].copy(), children[:nodes].copy()

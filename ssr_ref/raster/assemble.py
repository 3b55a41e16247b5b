"""Before anything is drawn: project vertices; clip, cull and classify triangles; bin them.

Each triangle becomes a draw record (or several, if clipping cut it) with its columns and rows. A
band of rows then finds its records in one list.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from .._jit import driver, kernel
from ..camera import ViewParams, clip_xyw, to_view
from ..typed import F64Array, I32Array, I64Array, U8Array
from . import clip, coverage, surface
from .geometry import DOUBLE_SIDED
from .records import BAND_ROWS, Projected

LEFT, RIGHT, TOP, BOTTOM, NEAR, GUARD, NON_FINITE, CUT = 1, 2, 4, 8, 16, 32, 64, 128
OUTSIDE = LEFT | RIGHT | TOP | BOTTOM | NEAR | CUT
CLIP = NEAR | GUARD | CUT

# Indices of the counters that `assemble` returns.
DRAWN, CULLED, ZERO_AREA, OUT_OF_VIEW, CLIPPED, UNUSABLE = 0, 1, 2, 3, 4, 5


@driver()
def project_vertices(
    view: ViewParams,
    gpu: bool,
    positions_ws: F64Array,
    positions_vs: F64Array,
    snapped: I32Array,
    outcode: U8Array,
) -> None:
    """View position, snapped window position and outcode of every vertex."""
    half_w, half_h = view.width * 0.5, view.height * 0.5
    for i in prange(positions_ws.shape[0]):
        p = to_view(view, surface.load(positions_ws, i))
        positions_vs[i, 0] = p.x
        positions_vs[i, 1] = p.y
        positions_vs[i, 2] = p.z
        q = clip_xyw(view, p)
        code = 0
        x = np.int64(0)
        y = np.int64(0)
        if not (np.isfinite(q.x) and np.isfinite(q.y) and np.isfinite(p.z)):
            code = NON_FINITE
        else:
            if q.x < -q.z:
                code |= LEFT
            if q.x > q.z:
                code |= RIGHT
            if q.y > q.z:
                code |= TOP
            if q.y < -q.z:
                code |= BOTTOM
            if -p.z < view.near:
                code |= NEAR
            elif (
                abs(q.x / q.z) * half_w > clip.GUARD_BAND
                or abs(q.y / q.z) * half_h > clip.GUARD_BAND
            ):
                code |= GUARD
            else:
                x, y = clip.snap(view, gpu, q.x, q.y, q.z)
        snapped[i, 0] = x
        snapped[i, 1] = y
        outcode[i] = code


@kernel
def column_range(low: int, high: int, last: int) -> tuple[int, int]:
    """Pixels whose centres lie within [low, high] (1/256 px), inside 0 … last."""
    return max(0, (low + 127) >> 8), min(last, (high - 128) >> 8)


@driver(parallel=False)
def assemble(
    view: ViewParams,
    gpu: bool,
    projected: Projected,
    faces: I32Array,
    flags: U8Array,
    want_back: bool,
    capacity: int,
    front: I32Array,
    back: I32Array,
    distance: F64Array,
) -> tuple[int, int, int, I32Array, I32Array, F64Array, I64Array]:
    """Clip, cull and classify all triangles in id order.

    distance: (nv,) to the user's clip plane, kept where ≥ 0; it has no elements, and no outcode has
    the bit CUT, where there is no such plane.

    Writes draw records to `front` and `back`, (n, 3) int32 each (see `Bins`). Returns the numbers
    of records, the number of pieces, the pieces' arrays, and the counters.
    """
    nt = faces.shape[0]
    width, height = view.width, view.height
    counts = np.zeros(6, np.int64)
    parent = np.empty(capacity, np.int32)
    piece_snapped = np.empty((capacity, 6), np.int32)
    piece_nearness = np.empty((capacity, 2), np.float64)
    polygon = np.empty((clip.MAX_POLYGON, clip.COLUMNS))
    scratch = np.empty((clip.MAX_POLYGON, clip.COLUMNS))
    corner = np.empty((clip.MAX_POLYGON, 2), np.int64)
    n_front = 0
    n_back = 0
    n_pieces = 0
    snapped = projected.snapped
    outcode = projected.outcode
    for t in range(nt):
        i0, i1, i2 = faces[t, 0], faces[t, 1], faces[t, 2]
        c0, c1, c2 = outcode[i0], outcode[i1], outcode[i2]
        union = c0 | c1 | c2
        if union & NON_FINITE:
            counts[UNUSABLE] += 1
            continue
        if c0 & c1 & c2 & OUTSIDE:
            counts[OUT_OF_VIEW] += 1
            continue
        pieces = 1
        if union & CLIP:
            counts[CLIPPED] += 1
            corners = clip_triangle(
                view, projected.positions_vs, distance, i0, i1, i2, polygon, scratch
            )
            if corners == 0:
                counts[OUT_OF_VIEW] += 1
                continue
            low_k, high_k = np.inf, -np.inf
            for c in range(corners):
                x, y = clip.snap(view, gpu, polygon[c, 0], polygon[c, 1], polygon[c, 2])
                corner[c, 0] = x
                corner[c, 1] = y
                k = surface.nearness_of_depth(view, polygon[c, 3])
                low_k, high_k = min(low_k, k), max(high_k, k)
            pieces = corners - 2
        drawn = False
        culled = False
        empty = False
        for piece in range(pieces):
            if union & CLIP:
                x0, y0 = corner[0, 0], corner[0, 1]
                x1, y1 = corner[piece + 1, 0], corner[piece + 1, 1]
                x2, y2 = corner[piece + 2, 0], corner[piece + 2, 1]
            else:
                x0, y0 = np.int64(snapped[i0, 0]), np.int64(snapped[i0, 1])
                x1, y1 = np.int64(snapped[i1, 0]), np.int64(snapped[i1, 1])
                x2, y2 = np.int64(snapped[i2, 0]), np.int64(snapped[i2, 1])
            xa, xb = column_range(min(x0, x1, x2), max(x0, x1, x2), width - 1)
            ya, yb = column_range(min(y0, y1, y2), max(y0, y1, y2), height - 1)
            area = coverage.doubled_area(x0, y0, x1, y1, x2, y2)
            if area == 0:
                empty = True
                continue
            if xa > xb or ya > yb:
                continue
            if xb - xa <= 1 and yb - ya <= 1:
                # Most of these small ones cover no centre; to know it now saves the record.
                if area > 0:
                    edges = coverage.make_edges(x0, y0, x1, y1, x2, y2)
                else:
                    edges = coverage.make_edges(x0, y0, x2, y2, x1, y1)
                covered = coverage.covers(edges, xa, ya)
                if xb > xa:
                    covered |= coverage.covers(edges, xb, ya)
                if yb > ya:
                    covered |= coverage.covers(edges, xa, yb) | coverage.covers(edges, xb, yb)
                if not covered:
                    continue
            is_front = (area < 0) != view.mirrored or flags[t] & DOUBLE_SIDED
            if not is_front and not want_back:
                culled = True
                continue
            draw_id = t
            if union & CLIP:
                draw_id = nt + n_pieces
                parent[n_pieces] = t
                piece_snapped[n_pieces, 0] = x0
                piece_snapped[n_pieces, 1] = y0
                piece_snapped[n_pieces, 2] = x1
                piece_snapped[n_pieces, 3] = y1
                piece_snapped[n_pieces, 4] = x2
                piece_snapped[n_pieces, 5] = y2
                piece_nearness[n_pieces, 0] = low_k
                piece_nearness[n_pieces, 1] = high_k
                n_pieces += 1
            if is_front:
                drawn = True
                front[n_front, 0] = draw_id
                front[n_front, 1] = xa | (xb << 16)
                front[n_front, 2] = ya | (yb << 16)
                n_front += 1
            else:
                culled = True
                back[n_back, 0] = draw_id
                back[n_back, 1] = xa | (xb << 16)
                back[n_back, 2] = ya | (yb << 16)
                n_back += 1
        if drawn:
            counts[DRAWN] += 1
        elif culled:
            counts[CULLED] += 1
        elif empty:
            counts[ZERO_AREA] += 1
        else:
            counts[OUT_OF_VIEW] += 1
    return n_front, n_back, n_pieces, parent, piece_snapped, piece_nearness, counts


@kernel
def clip_triangle(
    view: ViewParams,
    positions_vs: F64Array,
    distance: F64Array,
    i0: int,
    i1: int,
    i2: int,
    polygon: F64Array,
    scratch: F64Array,
) -> int:
    """Load a triangle's clip coordinates into `polygon` and clip it; the number of corners."""
    for c in range(3):
        i = i0 if c == 0 else (i1 if c == 1 else i2)
        p = surface.load(positions_vs, i)
        q = clip_xyw(view, p)
        polygon[c, 0] = q.x
        polygon[c, 1] = q.y
        polygon[c, 2] = q.z
        polygon[c, 3] = -p.z
        polygon[c, 4] = distance[i] if len(distance) else 0.0
    return clip.clip_polygon(view, len(distance) > 0, polygon, scratch)


@driver(parallel=False)
def count_pieces(faces: I32Array, outcode: U8Array) -> int:
    """Upper bound of the pieces that clipping can make."""
    n = 0
    for t in range(faces.shape[0]):
        union = outcode[faces[t, 0]] | outcode[faces[t, 1]] | outcode[faces[t, 2]]
        if union & CLIP:
            n += clip.MAX_POLYGON - 2
    return n


@driver(parallel=False)
def bin_records(records: I32Array, bands: int) -> tuple[I64Array, I32Array]:
    """Counting sort of records into bands of BAND_ROWS rows; the order within a band is kept."""
    start = np.zeros(bands + 1, np.int64)
    for r in range(records.shape[0]):
        rows = records[r, 2]
        for band in range((rows & 0xFFFF) // BAND_ROWS, (rows >> 16) // BAND_ROWS + 1):
            start[band + 1] += 1
    for band in range(bands):
        start[band + 1] += start[band]
    order = np.empty(start[bands], np.int32)
    position = start.copy()
    for r in range(records.shape[0]):
        rows = records[r, 2]
        for band in range((rows & 0xFFFF) // BAND_ROWS, (rows >> 16) // BAND_ROWS + 1):
            order[position[band]] = r
            position[band] += 1
    return start, order

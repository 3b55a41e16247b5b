"""Visibility first: for each pixel the nearest front face's id and depth, and the back depth.

Stages: transform and snap vertices; clip, cull and bin triangles into bands of rows; then each
band, alone and in any order, draws its triangles into a buffer that stays in cache. Nothing is
interpolated here. Every number is a function of the triangle and the absolute pixel, so bands and
threads cannot change a byte.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from .._jit import driver, inlined, kernel
from ..camera import ViewParams, clip_xyw, to_view
from ..typed import F64Array, FloatArray, I32Array, I64Array, U8Array
from . import clip, coverage, surface
from .geometry import DOUBLE_SIDED, Geometry

BAND_ROWS = 16
"""Rows of a band: whole rows keep stores sequential, 16 of them stay in the L2 cache."""

SPAN_COLUMNS = 8
"""Records at most this wide test each pixel; wider ones compute the covered span of a row."""

ANY_OBJECT = -2

LEFT, RIGHT, TOP, BOTTOM, NEAR, GUARD, NON_FINITE = 1, 2, 4, 8, 16, 32, 64
OUTSIDE = LEFT | RIGHT | TOP | BOTTOM | NEAR

# Indices of the counters that `assemble` returns.
DRAWN, CULLED, ZERO_AREA, OUT_OF_VIEW, CLIPPED, UNUSABLE = 0, 1, 2, 3, 4, 5


class Projected(NamedTuple):
    """Vertices after projection: view position, snapped position (1/256 px), outcode."""

    positions_vs: F64Array  # (nv, 3)
    snapped: I32Array  # (nv, 2)
    outcode: U8Array  # (nv,)


class Pieces(NamedTuple):
    """Triangles that clipping made. Piece i is drawn as id nt + i."""

    parent: I32Array  # (n,) the triangle it was cut from
    snapped: I32Array  # (n, 6) x0 y0 x1 y1 x2 y2
    nearness: F64Array  # (n, 2) least and greatest k of the clipped polygon


class Bins(NamedTuple):
    """Draw records by band: rows start[band] to start[band + 1] of `order` index `records`.

    records (n, 3) int32: draw id, first | last column << 16, first | last row << 16.
    """

    records: I32Array
    start: I64Array
    order: I32Array


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
) -> tuple[int, int, int, I32Array, I32Array, F64Array, I64Array]:
    """Clip, cull and classify all triangles in id order.

    Writes draw records to `front` and `back`, (n, 3) int32 each (see `Bins`). Returns the numbers
    of records, the number of pieces, the pieces' arrays, and the counters.
    """
    nt = faces.shape[0]
    width, height = view.width, view.height
    counts = np.zeros(6, np.int64)
    parent = np.empty(capacity, np.int32)
    piece_snapped = np.empty((capacity, 6), np.int32)
    piece_nearness = np.empty((capacity, 2), np.float64)
    polygon = np.empty((clip.MAX_POLYGON, 4))
    scratch = np.empty((clip.MAX_POLYGON, 4))
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
        if union & (NEAR | GUARD):
            counts[CLIPPED] += 1
            corners = clip_triangle(view, gpu, projected.positions_vs, i0, i1, i2, polygon, scratch)
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
            if union & (NEAR | GUARD):
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
            is_front = area < 0 or flags[t] & DOUBLE_SIDED
            if not is_front and not want_back:
                culled = True
                continue
            draw_id = t
            if union & (NEAR | GUARD):
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
    gpu: bool,
    positions_vs: F64Array,
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
    return clip.clip_polygon(view, polygon, scratch)


@driver(parallel=False)
def count_pieces(faces: I32Array, outcode: U8Array) -> int:
    """Upper bound of the pieces that clipping can make."""
    n = 0
    for t in range(faces.shape[0]):
        union = outcode[faces[t, 0]] | outcode[faces[t, 1]] | outcode[faces[t, 2]]
        if union & (NEAR | GUARD):
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


@inlined
def oriented_edges(
    draw_id: int, nt: int, snapped: I32Array, faces: I32Array, piece_snapped: I32Array
) -> coverage.Edges:
    """Edge functions of a draw record, positive inside whichever way it winds."""
    if draw_id >= nt:
        piece = draw_id - nt
        x0, y0 = np.int64(piece_snapped[piece, 0]), np.int64(piece_snapped[piece, 1])
        x1, y1 = np.int64(piece_snapped[piece, 2]), np.int64(piece_snapped[piece, 3])
        x2, y2 = np.int64(piece_snapped[piece, 4]), np.int64(piece_snapped[piece, 5])
    else:
        i0, i1, i2 = faces[draw_id, 0], faces[draw_id, 1], faces[draw_id, 2]
        x0, y0 = np.int64(snapped[i0, 0]), np.int64(snapped[i0, 1])
        x1, y1 = np.int64(snapped[i1, 0]), np.int64(snapped[i1, 1])
        x2, y2 = np.int64(snapped[i2, 0]), np.int64(snapped[i2, 1])
    if coverage.doubled_area(x0, y0, x1, y1, x2, y2) < 0:
        x1, x2 = x2, x1
        y1, y2 = y2, y1
    return coverage.make_edges(x0, y0, x1, y1, x2, y2)


@inlined
def triangle_plane(
    view: ViewParams, positions_vs: F64Array, faces: I32Array, t: int
) -> surface.NearnessPlane:
    """Nearness plane of the unclipped triangle t."""
    v0 = surface.load(positions_vs, faces[t, 0])
    v1 = surface.load(positions_vs, faces[t, 1])
    v2 = surface.load(positions_vs, faces[t, 2])
    return surface.nearness_plane(view, surface.plane_normal(v0, v1, v2), v0, v1, v2)


@kernel
def draw_front(
    view: ViewParams,
    projected: Projected,
    faces: I32Array,
    pieces: Pieces,
    bins: Bins,
    band: int,
    row0: int,
    nearness: F64Array,
    ids: I32Array,
) -> None:
    """Draw a band's front records; larger k wins, at equal k the lower id, drawn first."""
    nt = faces.shape[0]
    last = row0 + nearness.shape[0] - 1
    positions_vs, snapped = projected.positions_vs, projected.snapped
    parent, piece_snapped = pieces.parent, pieces.snapped
    records, order = bins.records, bins.order
    for slot in range(bins.start[band], bins.start[band + 1]):
        r = order[slot]
        draw_id = np.int64(records[r, 0])
        columns, rows = np.int64(records[r, 1]), np.int64(records[r, 2])
        x_first, x_last = columns & 0xFFFF, columns >> 16
        t = np.int64(parent[draw_id - nt]) if draw_id >= nt else draw_id
        edges = oriented_edges(draw_id, nt, snapped, faces, piece_snapped)
        plane = triangle_plane(view, positions_vs, faces, t)
        y_first, y_last = max(row0, rows & 0xFFFF), min(last, rows >> 16)
        if x_last - x_first < SPAN_COLUMNS:
            # Step the edge functions.
            c0 = edges.e0 + edges.a0 * x_first + edges.b0 * y_first
            c1 = edges.e1 + edges.a1 * x_first + edges.b1 * y_first
            c2 = edges.e2 + edges.a2 * x_first + edges.b2 * y_first
            for y in range(y_first, y_last + 1):
                f0, f1, f2 = c0, c1, c2
                for x in range(x_first, x_last + 1):
                    if (f0 | f1 | f2) >= 0:
                        k = surface.nearness_at(plane, x, y)
                        if k > nearness[y - row0, x]:
                            nearness[y - row0, x] = k
                            ids[y - row0, x] = draw_id
                    f0 += edges.a0
                    f1 += edges.a1
                    f2 += edges.a2
                c0 += edges.b0
                c1 += edges.b1
                c2 += edges.b2
        else:
            for y in range(y_first, y_last + 1):
                row = y - row0
                start = plane.c + plane.b * y
                low, high = coverage.row_span(edges, y, x_first, x_last)
                for x in range(np.uint64(low), np.uint64(max(low, high + 1))):
                    k = start + plane.a * x
                    before = nearness[row, x]
                    wins = k > before
                    nearness[row, x] = k if wins else before
                    ids[row, x] = draw_id if wins else ids[row, x]


@kernel
def draw_back(
    view: ViewParams,
    projected: Projected,
    faces: I32Array,
    triangle_object: I32Array,
    any_object: bool,
    pieces: Pieces,
    bins: Bins,
    band: int,
    row0: int,
    front: F64Array,
    owner: I32Array,
    nearness: F64Array,
) -> None:
    """Draw a band's back faces: nearest strictly behind the front, of the front's object."""
    nt = faces.shape[0]
    last = row0 + nearness.shape[0] - 1
    positions_vs, snapped = projected.positions_vs, projected.snapped
    parent, piece_snapped = pieces.parent, pieces.snapped
    records, order = bins.records, bins.order
    for slot in range(bins.start[band], bins.start[band + 1]):
        r = order[slot]
        draw_id = np.int64(records[r, 0])
        columns, rows = np.int64(records[r, 1]), np.int64(records[r, 2])
        x_first, x_last = columns & 0xFFFF, columns >> 16
        t = np.int64(parent[draw_id - nt]) if draw_id >= nt else draw_id
        edges = oriented_edges(draw_id, nt, snapped, faces, piece_snapped)
        mine = ANY_OBJECT if any_object else triangle_object[t]
        plane = triangle_plane(view, positions_vs, faces, t)
        y_first, y_last = max(row0, rows & 0xFFFF), min(last, rows >> 16)
        if x_last - x_first < SPAN_COLUMNS:
            # Step the edge functions.
            c0 = edges.e0 + edges.a0 * x_first + edges.b0 * y_first
            c1 = edges.e1 + edges.a1 * x_first + edges.b1 * y_first
            c2 = edges.e2 + edges.a2 * x_first + edges.b2 * y_first
            for y in range(y_first, y_last + 1):
                f0, f1, f2 = c0, c1, c2
                for x in range(x_first, x_last + 1):
                    if (f0 | f1 | f2) >= 0 and owner[y - row0, x] == mine:
                        k = surface.nearness_at(plane, x, y)
                        if k > nearness[y - row0, x] and k < front[y - row0, x]:
                            nearness[y - row0, x] = k
                    f0 += edges.a0
                    f1 += edges.a1
                    f2 += edges.a2
                c0 += edges.b0
                c1 += edges.b1
                c2 += edges.b2
        else:
            for y in range(y_first, y_last + 1):
                row = y - row0
                start = plane.c + plane.b * y
                low, high = coverage.row_span(edges, y, x_first, x_last)
                for x in range(np.uint64(low), np.uint64(max(low, high + 1))):
                    k = start + plane.a * x
                    before = nearness[row, x]
                    wins = (k > before) & (k < front[row, x]) & (owner[row, x] == mine)
                    nearness[row, x] = k if wins else before


@kernel
def polygon_range(
    view: ViewParams,
    projected: Projected,
    faces: I32Array,
    pieces: Pieces,
    draw_id: int,
) -> tuple[float, float]:
    """Least and greatest k of what a draw record may show: of the clipped polygon."""
    nt = faces.shape[0]
    if draw_id >= nt:
        return pieces.nearness[draw_id - nt, 0], pieces.nearness[draw_id - nt, 1]
    points = projected.positions_vs
    k0 = surface.nearness_of_depth(view, -points[faces[draw_id, 0], 2])
    k1 = surface.nearness_of_depth(view, -points[faces[draw_id, 1], 2])
    k2 = surface.nearness_of_depth(view, -points[faces[draw_id, 2], 2])
    return min(k0, k1, k2), max(k0, k1, k2)


@kernel
def settle_front(
    view: ViewParams,
    projected: Projected,
    geometry: Geometry,
    pieces: Pieces,
    farthest: float,
    row0: int,
    nearness: F64Array,
    ids: I32Array,
    owner: I32Array,
    want_back: bool,
    any_object: bool,
    depth: FloatArray,
    triangle_id: I32Array,
) -> int:
    """Clamp visible depths to their polygons and store depth and triangle id; pixels clamped."""
    faces = geometry.faces
    parent = pieces.parent
    nt = faces.shape[0]
    width = nearness.shape[1]
    clamped = 0
    for row in range(nearness.shape[0]):
        y = row0 + row
        x = 0
        while x < width:
            draw_id = np.int64(ids[row, x])
            end = surface.run_end(ids, row, x)
            t = np.int64(parent[draw_id - nt]) if draw_id >= nt else draw_id
            mine = np.int32(-1)
            low = np.inf
            if draw_id >= 0:
                # Count first, in a loop without branches; few runs have anything to clamp.
                low, high = polygon_range(view, projected, faces, pieces, draw_id)
                outside = 0
                for j in range(np.uint64(x), np.uint64(end)):
                    outside += (nearness[row, j] < low) | (nearness[row, j] > high)
                if outside > 0:
                    clamped += outside
                    for j in range(x, end):
                        nearness[row, j] = min(max(nearness[row, j], low), high)
                if want_back:
                    mine = np.int32(ANY_OBJECT) if any_object else geometry.triangle_object[t]
            if t != draw_id:
                for j in range(x, end):
                    ids[row, j] = t
            if want_back:
                for j in range(np.uint64(x), np.uint64(end)):
                    owner[row, j] = mine
            if draw_id >= 0 and low <= farthest:  # part of the polygon lies beyond far
                for j in range(x, end):
                    if nearness[row, j] <= farthest:
                        ids[row, j] = -1
                        if want_back:
                            owner[row, j] = -1
            x = end
        for j in range(width):
            triangle_id[y, j] = ids[row, j]
        for j in range(width):
            k = nearness[row, j]
            depth[y, j] = surface.depth_of_nearness(view, k) if ids[row, j] >= 0 else np.inf
    return clamped


@driver()
def draw_bands(
    view: ViewParams,
    farthest: float,
    projected: Projected,
    geometry: Geometry,
    pieces: Pieces,
    front: Bins,
    back: Bins,
    want_back: bool,
    any_object: bool,
    depth: FloatArray,
    triangle_id: I32Array,
    back_depth: FloatArray,
    clamped: I64Array,
) -> None:
    """Draw every band. farthest: the k that a front face must exceed, after it was clamped.

    back_depth is left alone unless want_back; clamped (bands,) counts pixels.
    """
    bands = clamped.shape[0]
    for band in prange(bands):
        row0 = band * BAND_ROWS
        rows = min(BAND_ROWS, view.height - row0)
        nearness = np.full((rows, view.width), -np.inf)
        ids = np.full((rows, view.width), -1, np.int32)
        owner = np.empty((rows, view.width if want_back else 0), np.int32)
        draw_front(view, projected, geometry.faces, pieces, front, band, row0, nearness, ids)
        clamped[band] = settle_front(
            view,
            projected,
            geometry,
            pieces,
            farthest,
            row0,
            nearness,
            ids,
            owner,
            want_back,
            any_object,
            depth,
            triangle_id,
        )
        if want_back:
            none = 0.0 if view.perspective else -np.inf
            behind = np.full((rows, view.width), none)
            draw_back(
                view,
                projected,
                geometry.faces,
                geometry.triangle_object,
                any_object,
                pieces,
                back,
                band,
                row0,
                nearness,
                owner,
                behind,
            )
            for row in range(rows):
                for x in range(view.width):
                    k = behind[row, x]
                    back_depth[row0 + row, x] = (
                        surface.depth_of_nearness(view, k) if k != none else np.inf
                    )

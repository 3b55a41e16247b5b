"""Visibility first: for each pixel the nearest front face's id and depth, and the back depth.

Each band of rows, alone and in any order, draws its triangles into a buffer that stays in cache.
Nothing is interpolated here. Every number is a function of the triangle and the absolute pixel, so
bands and threads cannot change a byte.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from .._jit import driver, inlined, kernel
from ..camera import ViewParams
from ..typed import F64Array, FloatArray, I32Array, I64Array
from . import coverage, surface
from .cutout import draw_back_cutouts, draw_cutouts
from .geometry import Geometry
from .records import ANY_OBJECT, BAND_ROWS, Bins, Pieces, Projected, oriented_edges
from .textures import Textures

SPAN_COLUMNS = 8
"""Records at most this wide test each pixel; wider ones compute the covered span of a row."""


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
    front_cutouts: Bins | None,
    back_cutouts: Bins | None,
    textures: Textures | None,
    want_back: bool,
    any_object: bool,
    depth: FloatArray,
    triangle_id: I32Array,
    back_depth: FloatArray,
    clamped: I64Array,
) -> None:
    """Draw every band. farthest: the k that a front face must exceed, after it was clamped.

    back_depth is left alone unless want_back; clamped (bands,) counts pixels. The cutouts and their
    textures are None, and cost nothing, where no masked triangle is in view.
    """
    bands = clamped.shape[0]
    for band in prange(bands):
        row0 = band * BAND_ROWS
        rows = min(BAND_ROWS, view.height - row0)
        nearness = np.full((rows, view.width), -np.inf)
        ids = np.full((rows, view.width), -1, np.int32)
        owner = np.empty((rows, view.width if want_back else 0), np.int32)
        draw_front(view, projected, geometry.faces, pieces, front, band, row0, nearness, ids)
        if front_cutouts is not None:
            draw_cutouts(
                view,
                projected,
                geometry,
                textures,
                pieces,
                front_cutouts,
                band,
                row0,
                nearness,
                ids,
            )
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
            if back_cutouts is not None:
                draw_back_cutouts(
                    view,
                    projected,
                    geometry,
                    textures,
                    any_object,
                    pieces,
                    back_cutouts,
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

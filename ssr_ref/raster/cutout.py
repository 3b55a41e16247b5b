"""Masked triangles: alpha at the pixel's centre decides coverage, for front and back faces.

Drawn after the opaque ones of a band, with the same rules: larger k wins, at equal k the lower
triangle id. A scene without a masked triangle in view neither compiles nor runs this.
"""

from __future__ import annotations

import numpy as np

from .._jit import kernel
from ..camera import ViewParams
from ..typed import F64Array, I32Array
from . import coverage, surface
from .geometry import Geometry
from .records import ANY_OBJECT, Bins, Pieces, Projected, oriented_edges
from .textures import Textures, passes_mask


@kernel
def draw_cutouts(
    view: ViewParams,
    projected: Projected,
    geometry: Geometry,
    textures: Textures,
    pieces: Pieces,
    bins: Bins,
    band: int,
    row0: int,
    nearness: F64Array,
    ids: I32Array,
) -> None:
    """Draw a band's masked front records over the opaque ones."""
    faces = geometry.faces
    nt = faces.shape[0]
    for slot in range(bins.start[band], bins.start[band + 1]):
        r = bins.order[slot]
        draw_id = np.int64(bins.records[r, 0])
        t = np.int64(pieces.parent[draw_id - nt]) if draw_id >= nt else draw_id
        m = geometry.triangle_material[t]
        edges = oriented_edges(draw_id, nt, projected.snapped, faces, pieces.snapped)
        plane, frame = plane_and_frame(view, projected.positions_vs, faces, t)
        x_first, x_last, y_first, y_last = extent(bins.records, r, row0, nearness.shape[0])
        for y in range(y_first, y_last + 1):
            row = y - row0
            for x in range(x_first, x_last + 1):
                if not coverage.covers(edges, x, y):
                    continue
                k = surface.nearness_at(plane, x, y)
                if k < nearness[row, x]:
                    continue
                if k == nearness[row, x]:
                    other = np.int64(ids[row, x])
                    if other >= nt:
                        other = np.int64(pieces.parent[other - nt])
                    if t >= other >= 0:
                        continue
                b = surface.barycentric_at(frame, surface.surface_point(view, plane, x, y))
                if passes_mask(textures, faces, t, m, b):
                    nearness[row, x] = k
                    ids[row, x] = draw_id


@kernel
def draw_back_cutouts(
    view: ViewParams,
    projected: Projected,
    geometry: Geometry,
    textures: Textures,
    any_object: bool,
    pieces: Pieces,
    bins: Bins,
    band: int,
    row0: int,
    front: F64Array,
    owner: I32Array,
    nearness: F64Array,
) -> None:
    """Draw a band's masked back records: nearest strictly behind the front, of its object."""
    faces = geometry.faces
    nt = faces.shape[0]
    for slot in range(bins.start[band], bins.start[band + 1]):
        r = bins.order[slot]
        draw_id = np.int64(bins.records[r, 0])
        t = np.int64(pieces.parent[draw_id - nt]) if draw_id >= nt else draw_id
        m = geometry.triangle_material[t]
        mine = ANY_OBJECT if any_object else geometry.triangle_object[t]
        edges = oriented_edges(draw_id, nt, projected.snapped, faces, pieces.snapped)
        plane, frame = plane_and_frame(view, projected.positions_vs, faces, t)
        x_first, x_last, y_first, y_last = extent(bins.records, r, row0, nearness.shape[0])
        for y in range(y_first, y_last + 1):
            row = y - row0
            for x in range(x_first, x_last + 1):
                if owner[row, x] != mine or not coverage.covers(edges, x, y):
                    continue
                k = surface.nearness_at(plane, x, y)
                if k > nearness[row, x] and k < front[row, x]:
                    b = surface.barycentric_at(frame, surface.surface_point(view, plane, x, y))
                    if passes_mask(textures, faces, t, m, b):
                        nearness[row, x] = k


@kernel
def plane_and_frame(
    view: ViewParams, positions_vs: F64Array, faces: I32Array, t: int
) -> tuple[surface.NearnessPlane, surface.BarycentricFrame]:
    """Nearness plane and barycentrics of the unclipped triangle, as shading uses them."""
    v0 = surface.load(positions_vs, faces[t, 0])
    v1 = surface.load(positions_vs, faces[t, 1])
    v2 = surface.load(positions_vs, faces[t, 2])
    n = surface.plane_normal(v0, v1, v2)
    plane = surface.nearness_plane(view, n, v0, v1, v2)
    return plane, surface.barycentric_frame(n, v0, v1, v2)


@kernel
def extent(records: I32Array, r: int, row0: int, rows: int) -> tuple[int, int, int, int]:
    """First and last column, first and last row of a record inside a band."""
    columns, lines = np.int64(records[r, 1]), np.int64(records[r, 2])
    return (
        columns & 0xFFFF,
        columns >> 16,
        max(row0, lines & 0xFFFF),
        min(row0 + rows - 1, lines >> 16),
    )

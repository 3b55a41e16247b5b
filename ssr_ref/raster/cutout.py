"""Masked triangles: alpha at the pixel's centre decides coverage, for front and back faces.

Drawn after the opaque ones of a band, with the same rules: larger k wins, at equal k the lower
triangle id. A scene without a masked triangle in view neither compiles nor runs this.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._jit import kernel
from ..camera import ViewParams
from ..typed import F64Array, I32Array
from . import coverage, surface
from .geometry import Geometry
from .records import ANY_OBJECT, Bins, Pieces, Projected, oriented_edges
from .textures import Textures, passes_mask


class Cutout(NamedTuple):
    """A draw record set up: its triangle, coverage, surface, and the band's pixels it may cover."""

    draw_id: int
    triangle: int
    material: int
    edges: coverage.Edges
    plane: surface.NearnessPlane  # and barycentrics: of the unclipped triangle, as shading has them
    frame: surface.BarycentricFrame
    x_first: int
    x_last: int
    y_first: int
    y_last: int


@kernel
def open_record(
    view: ViewParams,
    projected: Projected,
    geometry: Geometry,
    pieces: Pieces,
    records: I32Array,
    r: int,
    row0: int,
    rows: int,
) -> Cutout:
    """Set up record r for the band of `rows` rows from row0 on."""
    faces = geometry.faces
    nt = faces.shape[0]
    draw_id = np.int64(records[r, 0])
    t = np.int64(pieces.parent[draw_id - nt]) if draw_id >= nt else draw_id
    v0 = surface.load(projected.positions_vs, faces[t, 0])
    v1 = surface.load(projected.positions_vs, faces[t, 1])
    v2 = surface.load(projected.positions_vs, faces[t, 2])
    n = surface.plane_normal(v0, v1, v2)
    columns, lines = np.int64(records[r, 1]), np.int64(records[r, 2])
    return Cutout(
        draw_id,
        t,
        np.int64(geometry.triangle_material[t]),
        oriented_edges(draw_id, nt, projected.snapped, faces, pieces.snapped),
        surface.nearness_plane(view, n, v0, v1, v2),
        surface.barycentric_frame(n, v0, v1, v2),
        columns & 0xFFFF,
        columns >> 16,
        max(row0, lines & 0xFFFF),
        min(row0 + rows - 1, lines >> 16),
    )


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
        c = open_record(
            view,
            projected,
            geometry,
            pieces,
            bins.records,
            bins.order[slot],
            row0,
            nearness.shape[0],
        )
        for y in range(c.y_first, c.y_last + 1):
            row = y - row0
            for x in range(c.x_first, c.x_last + 1):
                if not coverage.covers(c.edges, x, y):
                    continue
                k = surface.nearness_at(c.plane, x, y)
                if k < nearness[row, x]:
                    continue
                if k == nearness[row, x]:
                    other = np.int64(ids[row, x])
                    if other >= nt:
                        other = np.int64(pieces.parent[other - nt])
                    if c.triangle >= other >= 0:
                        continue
                b = surface.barycentric_at(c.frame, surface.surface_point(view, c.plane, x, y))
                if passes_mask(textures, faces, c.triangle, c.material, b):
                    nearness[row, x] = k
                    ids[row, x] = c.draw_id


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
    for slot in range(bins.start[band], bins.start[band + 1]):
        c = open_record(
            view,
            projected,
            geometry,
            pieces,
            bins.records,
            bins.order[slot],
            row0,
            nearness.shape[0],
        )
        mine = ANY_OBJECT if any_object else geometry.triangle_object[c.triangle]
        for y in range(c.y_first, c.y_last + 1):
            row = y - row0
            for x in range(c.x_first, c.x_last + 1):
                if owner[row, x] != mine or not coverage.covers(c.edges, x, y):
                    continue
                k = surface.nearness_at(c.plane, x, y)
                if k > nearness[row, x] and k < front[row, x]:
                    b = surface.barycentric_at(c.frame, surface.surface_point(view, c.plane, x, y))
                    if passes_mask(textures, faces, c.triangle, c.material, b):
                        nearness[row, x] = k

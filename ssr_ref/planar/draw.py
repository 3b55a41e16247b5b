"""One mirror's picture: the scene before the mirror, drawn by the reflected view.

Kept is what lies on the viewer's side of the mirror, cut at its plane in homogeneous space, as by
a GPU's clip distance. Depth still comes from the plane of the uncut triangle.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..camera import ViewParams
from ..raster.geometry import Geometry
from ..raster.rasterize import RasterOptions, draw_visibility, project, visible_textures
from ..raster.textures import TextureStore
from ..shading.diffuse import LightArrays, shade_radiance
from ..typed import BoolArray, F64Array, FloatArray, I32Array
from .mirrors import PlanarMirror
from .reflected import reflected_view, side_of_viewer

ON_THE_PLANE = 2.0**-48
"""Share of the greatest coordinate below which a distance from the plane is only rounding: 32 ulps,
where a node's transform and the distance itself make at most 16."""


class MirrorImage(NamedTuple):
    """What one mirror shows at the pixels of a mask (H, W); elsewhere triangle_id is −1.

    depth: view depth in the reflected view, which is that of the mirrored point. triangle_id: of
    the scene; part: the triangles drawn, ids of `part_id`. draws, triangles: objects and triangles
    drawn.
    """

    view: ViewParams
    part: Geometry
    positions_vs: F64Array
    part_id: I32Array
    triangle_id: I32Array
    depth: FloatArray
    radiance: FloatArray
    draws: int
    triangles: int


def draw_mirror(
    view: ViewParams,
    mirror: PlanarMirror,
    geometry: Geometry,
    lights: LightArrays,
    store: TextureStore | None,
    mask: BoolArray,
    gpu_vertices: bool,
    dtype: Any,
) -> MirrorImage:
    """The picture that a viewer, itself perhaps a mirror image, sees in a mirror."""
    distance = side_of_viewer(view, mirror) * mirror.distance(geometry.positions_ws)
    part, kept = before(mirror, geometry, distance)
    seen = reflected_view(view, mirror)
    shape = mask.shape
    part_id = np.full(shape, -1, np.int32)
    depth = np.full(shape, np.inf, dtype)
    radiance = np.zeros((*shape, 3), dtype)
    positions_vs = np.empty((0, 3))
    if len(kept):
        options = RasterOptions(back_depth=False, gpu_vertices=gpu_vertices, dtype=dtype)
        projected = project(seen, part, gpu_vertices)
        positions_vs = projected.positions_vs
        nothing = np.empty((0, 0), dtype)
        draw_visibility(
            seen, part, projected, options, store, depth, part_id, nothing, distance=distance
        )
        part_id[~mask] = -1
        textures = visible_textures(part, part_id, store)
        shade_radiance(seen, part, textures, positions_vs, part_id, lights, radiance)
    triangle_id = np.where(part_id >= 0, np.append(kept, np.int32(-1))[part_id], np.int32(-1))
    return MirrorImage(
        seen,
        part,
        positions_vs,
        part_id,
        triangle_id,
        depth,
        radiance,
        len(np.unique(part.triangle_object)),
        len(kept),
    )


def before(
    mirror: PlanarMirror, geometry: Geometry, distance: F64Array
) -> tuple[Geometry, I32Array]:
    """The triangles with a corner before the mirror, less its own, and their ids (n,) int32.

    distance: (nv,) above 0 before it.
    """
    corners = distance[geometry.faces]
    keep = np.asarray((corners > ON_THE_PLANE * extent(geometry)).any(axis=1))
    keep[mirror.triangles] = False
    if keep.all():
        return geometry, np.arange(len(keep), dtype=np.int32)
    part = geometry._replace(
        faces=geometry.faces[keep],
        triangle_object=geometry.triangle_object[keep],
        triangle_material=geometry.triangle_material[keep],
        triangle_flags=geometry.triangle_flags[keep],
    )
    return part, np.flatnonzero(keep).astype(np.int32)


def extent(geometry: Geometry) -> float:
    """The greatest finite coordinate."""
    size = np.abs(geometry.positions_ws)
    return float(np.max(size, where=np.isfinite(size), initial=0.0))

"""From a scene and a camera to a G-buffer: the order of the stages, and the buffers' memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..buffers import GBuffer, RasterCounts
from ..camera import ViewParams
from ..typed import F64Array
from . import attributes, visibility
from .geometry import Geometry
from .visibility import Bins, Pieces, Projected


@dataclass(frozen=True, slots=True, kw_only=True)
class RasterOptions:
    """What to draw. Only what is asked for is allocated and computed."""

    back_depth: bool = True
    back_any_object: bool = False
    geo_normal: bool = True
    normal: bool = True
    material: bool = True
    fresnel: bool = False
    max_roughness: float = 0.5
    gpu_vertices: bool = False
    dtype: Any = np.float32


def project(view: ViewParams, geometry: Geometry, gpu_vertices: bool = False) -> Projected:
    """Vertices in view space, snapped window positions, outcodes."""
    nv = len(geometry.positions_ws)
    projected = Projected(np.empty((nv, 3)), np.empty((nv, 2), np.int32), np.empty(nv, np.uint8))
    visibility.project_vertices(view, gpu_vertices, geometry.positions_ws, *projected)
    return projected


def rasterize(
    view: ViewParams, geometry: Geometry, options: RasterOptions
) -> tuple[GBuffer, F64Array]:
    """The G-buffer without radiance, and the view-space vertices (nv, 3) for later stages."""
    height, width = view.height, view.width
    projected = project(view, geometry, options.gpu_vertices)

    # Visibility: depth, triangle id, back depth.
    depth = np.empty((height, width), options.dtype)
    triangle_id = np.empty((height, width), np.int32)
    shape = (height, width) if options.back_depth else (0, 0)
    back_depth = np.empty(shape, options.dtype)
    counts, clamped = draw_visibility(
        view, geometry, projected, options, depth, triangle_id, back_depth
    )

    # Attributes, only of visible surfaces.
    images: dict[str, Any] = {}
    repaired = np.zeros(height, np.int64)
    if options.geo_normal or options.normal:
        geo_normal = np.empty((height, width, 3), options.dtype)
        shape3 = (height, width, 3) if options.normal else (0, 0, 3)
        normal = np.empty(shape3, options.dtype)
        attributes.shade_normals(
            view,
            geometry,
            projected.positions_vs,
            triangle_id,
            options.normal,
            geo_normal,
            normal,
            repaired,
        )
        images["geo_normal_vs"] = geo_normal
        if options.normal:
            images["normal_vs"] = normal
    if options.material:
        images["object_id"] = np.empty((height, width), np.int32)
        images["material_id"] = np.empty((height, width), np.int32)
        images["albedo"] = np.empty((height, width, 3), options.dtype)
        images["reflectivity"] = np.empty((height, width, 3), options.dtype)
        images["roughness"] = np.empty((height, width), options.dtype)
        attributes.shade_materials(
            view,
            geometry,
            projected.positions_vs,
            triangle_id,
            options.fresnel,
            options.max_roughness,
            images["object_id"],
            images["material_id"],
            images["albedo"],
            images["reflectivity"],
            images["roughness"],
        )
    gbuffer = GBuffer(
        depth=depth,
        triangle_id=triangle_id,
        back_depth=back_depth if options.back_depth else None,
        counts=RasterCounts(
            triangles=len(geometry.faces),
            drawn=int(counts[visibility.DRAWN]),
            outside=int(counts[visibility.OUT_OF_VIEW]),
            clipped=int(counts[visibility.CLIPPED]),
            culled=int(counts[visibility.CULLED]),
            zero_area=int(counts[visibility.ZERO_AREA]),
            non_finite=int(counts[visibility.UNUSABLE]),
            clamped_depths=int(clamped),
            repaired_normals=int(repaired.sum()),
        ),
        **images,
    )
    return gbuffer, projected.positions_vs


def draw_visibility(
    view: ViewParams,
    geometry: Geometry,
    projected: Projected,
    options: RasterOptions,
    depth: Any,
    triangle_id: Any,
    back_depth: Any,
) -> tuple[Any, int]:
    """Fill depth, triangle id and back depth; the counters and the number of clamped pixels."""
    capacity = 0
    if (projected.outcode & (visibility.NEAR | visibility.GUARD)).any():
        capacity = visibility.count_pieces(geometry.faces, projected.outcode)
    room = len(geometry.faces) + capacity
    front = np.empty((room, 3), np.int32)
    back = np.empty((room if options.back_depth else 0, 3), np.int32)
    n_front, n_back, n_pieces, parent, snapped, nearness, counts = visibility.assemble(
        view,
        options.gpu_vertices,
        projected,
        geometry.faces,
        geometry.triangle_flags,
        options.back_depth,
        capacity,
        front,
        back,
    )
    pieces = Pieces(parent[:n_pieces], snapped[:n_pieces], nearness[:n_pieces])
    bands = -(-view.height // visibility.BAND_ROWS)
    front_bins = Bins(front[:n_front], *visibility.bin_records(front[:n_front], bands))
    back_bins = Bins(back[:n_back], *visibility.bin_records(back[:n_back], bands))
    clamped = np.zeros(bands, np.int64)
    visibility.draw_bands(
        view,
        farthest_nearness(view),
        projected,
        geometry,
        pieces,
        front_bins,
        back_bins,
        options.back_depth,
        options.back_any_object,
        depth,
        triangle_id,
        back_depth,
        clamped,
    )
    return counts, int(clamped.sum())


def farthest_nearness(view: ViewParams) -> float:
    """The greatest k that is not drawn: depth = far still is, anything deeper is not."""
    if view.perspective:
        return 0.0 if np.isinf(view.far) else float(np.nextafter(1.0 / view.far, 0.0))
    return -np.inf if np.isinf(view.far) else float(np.nextafter(-view.far, -np.inf))

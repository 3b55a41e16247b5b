"""From a scene and a camera to a G-buffer: the order of the stages, and the buffers' memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..buffers import GBuffer, RasterCounts
from ..camera import ViewParams
from ..typed import BoolArray, F64Array, I32Array
from . import assemble, attributes, visibility
from .geometry import MASKED, TEXTURED, Geometry
from .records import BAND_ROWS, Bins, Pieces, Projected
from .textures import Textures, TextureStore


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
    assemble.project_vertices(view, gpu_vertices, geometry.positions_ws, *projected)
    return projected


def rasterize(
    view: ViewParams,
    geometry: Geometry,
    options: RasterOptions,
    reuse: GBuffer | None = None,
    store: TextureStore | None = None,
) -> tuple[GBuffer, F64Array]:
    """The G-buffer without radiance, and the view-space vertices (nv, 3) for later stages.

    store: the scene's textures; None: materials show their factors and nothing is masked.
    reuse: an earlier G-buffer whose arrays may be overwritten where shape and dtype agree; touching
    fresh memory costs more than drawing into it.
    """
    size = (view.height, view.width)
    old = {} if reuse is None else reuse.arrays()
    images: dict[str, Any] = {}

    def image(name: str, dtype: Any, channels: int = 0, wanted: bool = True) -> Any:
        """A buffer by name; one that is not wanted has no pixels."""
        shape = (size if wanted else (0, 0)) + ((channels,) if channels else ())
        array = old.get(name)
        if array is None or array.shape != shape or array.dtype != dtype:
            array = np.empty(shape, dtype)
        if wanted:
            images[name] = array
        return array

    # Visibility: depth, triangle id, back depth.
    projected = project(view, geometry, options.gpu_vertices)
    triangle_id = image("triangle_id", np.int32)
    counts, clamped = draw_visibility(
        view,
        geometry,
        projected,
        options,
        store,
        image("depth", options.dtype),
        triangle_id,
        image("back_depth", options.dtype, wanted=options.back_depth),
    )

    # Attributes, only of visible surfaces.
    repaired = np.zeros(view.height, np.int64)
    if options.geo_normal or options.normal:
        attributes.shade_normals(
            view,
            geometry,
            projected.positions_vs,
            triangle_id,
            options.normal,
            image("geo_normal_vs", options.dtype, 3),
            image("normal_vs", options.dtype, 3, wanted=options.normal),
            repaired,
        )
    if options.material:
        attributes.shade_materials(
            view,
            geometry,
            visible_textures(geometry, triangle_id, store),
            projected.positions_vs,
            triangle_id,
            options.fresnel,
            options.max_roughness,
            image("object_id", np.int32),
            image("material_id", np.int32),
            image("albedo", options.dtype, 3),
            image("reflectivity", options.dtype, 3),
            image("roughness", options.dtype),
        )
    gbuffer = GBuffer(
        counts=RasterCounts(
            triangles=len(geometry.faces),
            drawn=int(counts[assemble.DRAWN]),
            outside=int(counts[assemble.OUT_OF_VIEW]),
            clipped=int(counts[assemble.CLIPPED]),
            culled=int(counts[assemble.CULLED]),
            zero_area=int(counts[assemble.ZERO_AREA]),
            non_finite=int(counts[assemble.UNUSABLE]),
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
    store: TextureStore | None,
    depth: Any,
    triangle_id: Any,
    back_depth: Any,
    distance: F64Array | None = None,
) -> tuple[Any, int]:
    """Fill depth, triangle id and back depth; the counters and the number of clamped pixels.

    distance: (nv,) of each vertex to a clip plane, as a GPU's clip distance: what is below 0 is cut
    away. None: no such plane.
    """
    if distance is None:
        distance = np.empty(0)
    else:
        projected.outcode[distance < 0.0] |= assemble.CUT
    capacity = 0
    if (projected.outcode & assemble.CLIP).any():
        capacity = assemble.count_pieces(geometry.faces, projected.outcode)
    room = len(geometry.faces) + capacity
    front = np.empty((room, 3), np.int32)
    back = np.empty((room if options.back_depth else 0, 3), np.int32)
    n_front, n_back, n_pieces, parent, snapped, nearness, counts = assemble.assemble(
        view,
        options.gpu_vertices,
        projected,
        geometry.faces,
        geometry.triangle_flags,
        options.back_depth,
        capacity,
        front,
        back,
        distance,
    )
    pieces = Pieces(parent[:n_pieces], snapped[:n_pieces], nearness[:n_pieces])
    bands = -(-view.height // BAND_ROWS)
    front, back = front[:n_front], back[:n_back]
    front_cutouts = back_cutouts = textures = None
    if store is not None and store.masked.any():
        # Only masked triangles that may be seen cost anything.
        front_masked, back_masked = (masked_records(geometry, pieces, r) for r in (front, back))
        if front_masked.any() or back_masked.any():
            front_cutouts = binned(front[front_masked], bands)
            back_cutouts = binned(back[back_masked], bands)
            front, back = front[~front_masked], back[~back_masked]
            textures = store.pack(geometry, store.masked)
    clamped = np.zeros(bands, np.int64)
    visibility.draw_bands(
        view,
        farthest_nearness(view),
        projected,
        geometry,
        pieces,
        binned(front, bands),
        binned(back, bands),
        front_cutouts,
        back_cutouts,
        textures,
        options.back_depth,
        options.back_any_object,
        depth,
        triangle_id,
        back_depth,
        clamped,
    )
    return counts, int(clamped.sum())


def binned(records: I32Array, bands: int) -> Bins:
    """Draw records sorted into bands of rows."""
    return Bins(records, *assemble.bin_records(records, bands))


def masked_records(geometry: Geometry, pieces: Pieces, records: I32Array) -> BoolArray:
    """(n,) which records belong to a masked material."""
    ids = records[:, 0]
    nt = len(geometry.faces)
    if len(pieces.parent):
        ids = np.where(ids < nt, ids, pieces.parent[np.maximum(ids - nt, 0)])
    return np.asarray((geometry.triangle_flags[ids] & MASKED) != 0)


def visible_textures(
    geometry: Geometry, triangle_id: I32Array, store: TextureStore | None
) -> Textures | None:
    """The textures of the materials that the image shows; None if it shows no textured one."""
    if store is None or not store.textured.any():
        return None
    seen = np.zeros(len(geometry.faces) + 1, np.bool_)
    seen[triangle_id] = True  # −1, nothing drawn, is the last
    textured = seen[:-1] & ((geometry.triangle_flags & TEXTURED) != 0)
    materials = np.zeros(len(geometry.metallic), np.bool_)
    materials[geometry.triangle_material[textured]] = True
    return store.pack(geometry, materials)


def farthest_nearness(view: ViewParams) -> float:
    """The greatest k that is not drawn: depth = far still is, anything deeper is not."""
    if view.perspective:
        return 0.0 if np.isinf(view.far) else float(np.nextafter(1.0 / view.far, 0.0))
    return -np.inf if np.isinf(view.far) else float(np.nextafter(-view.far, -np.inf))

"""The reflections of an image's flat mirrors, and of mirrors seen in mirrors.

Each mirror that has a pixel on screen is drawn once, and its picture is used at its own pixels. A
mirror that is seen in it shows its diffuse radiance (one bounce) or, with more bounces, is drawn
in turn from the mirror image of the mirror image of the camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ..buffers import GBuffer
from ..camera import ViewParams
from ..errors import SettingsError
from ..raster.attributes import shade_materials
from ..raster.geometry import Geometry
from ..raster.rasterize import visible_textures
from ..raster.textures import TextureStore
from ..scene import Lights
from ..settings import Settings
from ..shading.diffuse import LightArrays, light_arrays
from ..typed import BoolArray, F64Array, FloatArray, I32Array
from .composite import composite_rows
from .draw import MirrorImage, draw_mirror
from .mirrors import PlanarMirror
from .reflected import columns_of, direction_lengths, points_at, side_of_viewer

MAX_BOUNCES = 16


@dataclass(frozen=True, slots=True, eq=False)
class PlanarReflection:
    """What flat mirrors show. Floats have the G-buffer's dtype unless said.

    mask (H, W) bool: pixels of a mirror with R above 0. mirror (H, W) int32: which, −1 elsewhere.
    reflection (H, W, 3): linear RGB before the surface's R, the fallback where the mirror shows
    nothing, 0 outside the mask. composite (H, W, 3): L·(1 − R) + R·reflection; L outside the mask.
    triangle_id, object_id (H, W) int32: what the mirror shows, itself perhaps a mirror; −1 where
    there is nothing. point_ws (H, W, 3) float64: where that is, in the scene. distance (H, W)
    float64: along the reflected ray, scene units. Both NaN where there is nothing.
    passes: pictures drawn; draws, triangles: objects and triangles drawn in them, all bounces.
    """

    mask: BoolArray
    mirror: I32Array
    reflection: FloatArray
    composite: FloatArray
    triangle_id: I32Array
    object_id: I32Array
    point_ws: F64Array
    distance: F64Array
    passes: int
    draws: int
    triangles: int


class _World(NamedTuple):
    """What every pass needs and none changes. mirror_of: (nt,) index of its mirror, −1 for none."""

    geometry: Geometry
    mirrors: tuple[PlanarMirror, ...]
    mirror_of: I32Array
    lights: LightArrays
    store: TextureStore | None
    settings: Settings
    fallback: F64Array
    dtype: Any


@dataclass(slots=True)
class _Counts:
    """Pictures, objects and triangles drawn."""

    passes: int = field(default=0)
    draws: int = field(default=0)
    triangles: int = field(default=0)


def planar_reflections(
    view: ViewParams,
    geometry: Geometry,
    gbuffer: GBuffer,
    lights: Lights,
    mirrors: Sequence[PlanarMirror],
    settings: Settings | None = None,
    *,
    store: TextureStore | None = None,
    bounces: int = 1,
) -> PlanarReflection:
    """Draw each visible mirror's picture and put it at the mirror's pixels.

    geometry, gbuffer, lights, store: what `rasterize` and `with_radiance` took and made; the
    G-buffer with reflectivity, normals and radiance. mirrors: of `find_mirrors`, or given. Of the
    settings: fallback, fresnel, max_roughness, snap. bounces: mirrors on a path, 1 to 16.
    Raises SettingsError for a G-buffer that does not fit, a triangle out of range or in two
    mirrors, or bounces out of range.
    """
    settings = settings or Settings()
    if isinstance(bounces, bool) or not 1 <= int(bounces) <= MAX_BOUNCES or int(bounces) != bounces:
        raise SettingsError(f"bounces is {bounces}; expected a whole number, 1 to {MAX_BOUNCES}")
    _check_gbuffer(view, gbuffer)
    assert gbuffer.reflectivity is not None
    assert gbuffer.radiance is not None
    assert gbuffer.normal_vs is not None
    constant = settings.fallback == "constant"
    world = _World(
        geometry,
        tuple(mirrors),
        mirror_of_triangles(mirrors, len(geometry.faces)),
        light_arrays(lights),
        store,
        settings,
        np.array(settings.fallback_color if constant else (0.0, 0.0, 0.0)),
        gbuffer.depth.dtype,
    )
    shape = gbuffer.depth.shape
    mirror = _mirrors_seen(world, gbuffer.triangle_id, gbuffer.reflectivity)
    mask = mirror >= 0
    out = PlanarReflection(
        mask=mask,
        mirror=mirror,
        reflection=np.zeros((*shape, 3), world.dtype),
        composite=gbuffer.radiance.copy(),
        triangle_id=np.full(shape, -1, np.int32),
        object_id=np.full(shape, -1, np.int32),
        point_ws=np.full((*shape, 3), np.nan),
        distance=np.full(shape, np.nan),
        passes=0,
        draws=0,
        triangles=0,
    )
    counts = _Counts()
    endless = view._replace(far=np.inf)  # a mirror shows what lies beyond far, as its rays do
    for index in np.unique(mirror[mask]):
        pixels = mirror == index
        image = _picture(world, endless, int(index), pixels, int(bounces), counts)
        out.reflection[pixels] = image.radiance[pixels]
        there = pixels & (image.triangle_id >= 0)
        out.triangle_id[there] = image.triangle_id[there]
        out.object_id[there] = geometry.triangle_object[image.triangle_id[there]]
        out.point_ws[there] = points_at(image.view, there, image.depth[there])
        behind = image.depth[there].astype(np.float64) - gbuffer.depth[there]
        out.distance[there] = np.maximum(behind, 0.0) * direction_lengths(view, there)
    composite_rows(
        view,
        settings.fresnel,
        mask,
        gbuffer.reflectivity,
        gbuffer.normal_vs,
        out.reflection,
        out.composite,
    )
    return replace(out, passes=counts.passes, draws=counts.draws, triangles=counts.triangles)


def mirror_of_triangles(mirrors: Sequence[PlanarMirror], nt: int) -> I32Array:
    """(nt,) index of the mirror that each triangle belongs to, −1 for none."""
    found = np.full(nt, -1, np.int32)
    for index, mirror in enumerate(mirrors):
        if len(mirror.triangles) and mirror.triangles[-1] >= nt:
            raise SettingsError(
                f"mirror {index} has triangle {mirror.triangles[-1]} of {nt}; expected ids of this "
                "geometry"
            )
        taken = found[mirror.triangles]
        if (taken >= 0).any():
            t = int(mirror.triangles[taken >= 0][0])
            raise SettingsError(
                f"triangle {t} belongs to mirrors {found[t]} and {index}; expected one at most"
            )
        found[mirror.triangles] = index
    return found


def _check_gbuffer(view: ViewParams, gbuffer: GBuffer) -> None:
    size = (view.height, view.width)
    for name in ("depth", "reflectivity", "normal_vs", "radiance"):
        image = getattr(gbuffer, name)
        if image is None or image.shape[:2] != size:
            found = "not there" if image is None else "{1}x{0}".format(*image.shape)
            raise SettingsError(
                f"the G-buffer's {name} is {found}; expected {view.width}x{view.height}: draw it "
                "with this view, materials and radiance"
            )


def _mirrors_seen(world: _World, triangle_id: I32Array, reflectivity: FloatArray) -> I32Array:
    """(H, W) index of the mirror of each pixel that reflects, −1 elsewhere."""
    mirror = np.append(world.mirror_of, np.int32(-1))[triangle_id]
    reflects = (reflectivity != 0.0).any(axis=2)
    return np.where(reflects, mirror, np.int32(-1))


def _picture(
    world: _World, view: ViewParams, index: int, mask: BoolArray, left: int, counts: _Counts
) -> MirrorImage:
    """What a viewer sees in a mirror at the pixels of the mask; left: bounces, this one included.

    Nothing shows the fallback.
    """
    settings = world.settings
    image = draw_mirror(
        view,
        world.mirrors[index],
        world.geometry,
        world.lights,
        world.store,
        mask,
        settings.snap == "gpu_vertices",
        world.dtype,
    )
    counts.passes += 1
    counts.draws += image.draws
    counts.triangles += image.triangles
    image.radiance[mask & (image.part_id < 0)] = world.fallback
    if left > 1:
        _mirrors_in(world, image, mask, left - 1, counts)
    return image


def _mirrors_in(
    world: _World, image: MirrorImage, mask: BoolArray, left: int, counts: _Counts
) -> None:
    """Give the mirrors seen in a picture their own pictures, into its radiance."""
    if not (np.append(world.mirror_of, np.int32(-1))[image.triangle_id] >= 0).any():
        return
    reflectivity = _reflectivity(world, image)
    seen = _mirrors_seen(world, image.triangle_id, reflectivity)
    for index in np.unique(seen[seen >= 0]):
        pixels = mask & (seen == index)
        inner = _picture(world, image.view, int(index), pixels, left, counts)
        normal = np.empty_like(image.radiance)
        normal[:] = _normal_towards(image.view, world.mirrors[index])
        composite_rows(
            image.view,
            world.settings.fresnel,
            pixels,
            reflectivity,
            normal,
            inner.radiance,
            image.radiance,
        )


def _normal_towards(view: ViewParams, mirror: PlanarMirror) -> F64Array:
    """(3,) the mirror's unit normal in view space, towards the viewer."""
    n, s = mirror.normal_ws, side_of_viewer(view, mirror)
    axes = columns_of(view)[:3]
    return s * ((axes[:, 0] * n[0] + axes[:, 1] * n[1]) + axes[:, 2] * n[2])


def _reflectivity(world: _World, image: MirrorImage) -> FloatArray:
    """R at normal incidence (H, W, 3) of what a picture shows."""
    shape = image.depth.shape
    reflectivity = np.empty((*shape, 3), world.dtype)
    shade_materials(
        image.view,
        image.part,
        visible_textures(image.part, image.part_id, world.store),
        image.positions_vs,
        image.part_id,
        world.settings.fresnel,
        world.settings.max_roughness,
        np.empty(shape, np.int32),
        np.empty(shape, np.int32),
        np.empty((*shape, 3), world.dtype),
        reflectivity,
        np.empty(shape, world.dtype),
    )
    return reflectivity

"""What every reflective pixel of a triangle mesh really shows, by tracing the mesh itself.

Classes, the first that applies; X is the first hit of the pixel's ray:

    NO_RAY       not reflective, nothing drawn, or no ray above the surface (`origins`)
    NOTHING      no X within max_distance
    OFF_SCREEN   X lies outside the image, before near or beyond far; `side` says where
    BACK_FACING  the side that was met looks away from the eye
    VISIBLE      the pixel that X falls in shows X's triangle, or its plane's nearness differs from
                 X's by no more than the plane spans inside that pixel (docs/specification.md 6.2)
    OCCLUDED     it shows something else, or nothing

VISIBLE is asked last: OCCLUDED is what is left.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from .._jit import driver, inlined, kernel
from ..analytic.arrays import world_axes
from ..buffers import GBuffer, Truth
from ..camera import Camera, ViewParams, clip_xyw, rotate_to_view
from ..errors import SettingsError
from ..raster.attributes import SurfaceRun, rows_equal
from ..raster.geometry import DOUBLE_SIDED, HAS_NORMALS, Geometry, flatten
from ..raster.surface import (
    Barycentric,
    BarycentricFrame,
    NearnessPlane,
    load,
    nearness_of_depth,
    nearness_plane,
    plane_normal,
)
from ..raster.textures import Textures, texture_store
from ..scene import Scene
from ..shading.diffuse import LightArrays, flat_normal_ws, leaving_radiance, light_arrays
from ..typed import AnyArray, BoolArray, F64Array, I32Array, I64Array, Size, U8Array
from ..vecmath.vec import Vec3, dot
from .accept import Cutout
from .bvh import build_bvh
from .nearest import Hits, Rays
from .origins import set_up_rays, to_world
from .outcome import NO_RAY, NOTHING, class_of, side_of
from .packets import nearest

TILE = 8
"""Pixels of a tile's side: rays are traced tile by tile, so that neighbours meet the same boxes."""


def mesh_reflections(
    scene: Scene,
    camera: Camera,
    size: Size,
    gbuffer: GBuffer,
    max_distance: float = np.inf,
) -> Truth:
    """The truth of an image of (W, H) pixels.

    gbuffer: of the same scene, camera and size: its `reflectivity` (any channel not 0) and
    `triangle_id` say which pixels reflect and what they show, its `depth` what the camera sees; no
    other buffer is read. max_distance: a hit further along the ray is NOTHING, scene units.
    Raises SettingsError for a G-buffer of another size, scene, or without reflectivity.
    """
    view = camera.params(size)
    geometry = flatten(scene)
    check_inputs(view, gbuffer, len(geometry.faces), max_distance)
    store = texture_store(scene)
    points = geometry.positions_ws - np.array([view.eye_x, view.eye_y, view.eye_z])

    # The rays of reflective pixels, and what they meet.
    pixels = reflective_pixels(view, gbuffer)
    rays = reflected_rays(camera, view, geometry, points, gbuffer, pixels, max_distance)
    cutout = None
    if store is not None and store.masked.any():
        masks = store.pack(geometry, store.masked)
        cutout = Cutout(geometry.faces, geometry.triangle_material, masks)
    bvh = build_bvh(points, geometry.faces, geometry.triangle_flags)
    hits = nearest(bvh, rays, cutout)
    del bvh

    # What that is to the camera, and its radiance.
    textures = None if store is None else store.pack(geometry, met_materials(geometry, hits))
    found = Found(len(pixels))
    look_up(
        view,
        world_axes(camera),
        geometry,
        textures,
        light_arrays(scene.lights),
        points,
        np.ascontiguousarray(gbuffer.depth, np.float64),
        gbuffer.triangle_id,
        *rays[:2],
        *hits,
        found.truth,
        found.side,
        found.hit_px,
        found.hit_depth,
        found.radiance,
    )
    return found.images(view, pixels, hits, geometry.triangle_object)


def check_inputs(view: ViewParams, gbuffer: GBuffer, surfaces: int, max_distance: float) -> None:
    """Raise SettingsError if the G-buffer is not one of this view and scene."""
    if not max_distance > 0.0:
        raise SettingsError(f"max_distance is {max_distance:g}; expected above 0 (inf allowed)")
    for name in ("reflectivity", "triangle_id"):
        image = getattr(gbuffer, name)
        if image is None or image.shape[:2] != (view.height, view.width):
            found = "none" if image is None else "{1}x{0}".format(*image.shape)
            raise SettingsError(
                f"the G-buffer's {name} is {found}; expected {view.width}x{view.height}: make it "
                "with the size that is asked for"
            )
    highest = int(gbuffer.triangle_id.max(initial=-1))
    if highest >= surfaces:
        raise SettingsError(
            f"the G-buffer shows triangle {highest} and the scene has {surfaces}; expected 0 to "
            f"{surfaces - 1}: pass the scene that was rendered"
        )


def reflective_pixels(view: ViewParams, gbuffer: GBuffer) -> I64Array:
    """(n,) numbers y·W + x of the pixels that show something reflective, tile by tile."""
    assert gbuffer.reflectivity is not None
    wanted = (gbuffer.reflectivity != 0.0).any(axis=2) & (gbuffer.triangle_id >= 0)
    rows, columns = -(-view.height // TILE), -(-view.width // TILE)
    padded = np.full((rows * TILE, columns * TILE), -1, np.int64)
    numbers = np.arange(view.height * view.width).reshape(view.height, view.width)
    padded[: view.height, : view.width] = np.where(wanted, numbers, -1)
    tiled = padded.reshape(rows, TILE, columns, TILE).transpose(0, 2, 1, 3).ravel()
    return tiled[tiled >= 0]


def met_materials(geometry: Geometry, hits: Hits) -> BoolArray:
    """(nm,) which materials some ray meets."""
    met = np.zeros(len(geometry.metallic), np.bool_)
    met[geometry.triangle_material[hits.triangle_id[hits.triangle_id >= 0]]] = True
    return met


class Found:
    """What the look-up writes for each ray, and its way back into images."""

    def __init__(self, n: int) -> None:
        self.truth: U8Array = np.empty(n, np.uint8)
        self.side: U8Array = np.empty(n, np.uint8)
        self.hit_px: F64Array = np.empty((n, 2))
        self.hit_depth: F64Array = np.empty(n)
        self.radiance: F64Array = np.empty((n, 3))

    def images(
        self, view: ViewParams, pixels: I64Array, hits: Hits, triangle_object: I32Array
    ) -> Truth:
        """`Truth` of the whole image."""

        def image(values: AnyArray, empty: float) -> AnyArray:
            out = np.full((view.height * view.width, *values.shape[1:]), empty, values.dtype)
            out[pixels] = values
            return out.reshape(view.height, view.width, *values.shape[1:])

        met = hits.triangle_id >= 0
        return Truth(
            truth=image(self.truth, NO_RAY),
            side=image(self.side, 0),
            triangle_id=image(hits.triangle_id, -1),
            object_id=image(np.where(met, triangle_object[hits.triangle_id], np.int32(-1)), -1),
            distance=image(np.where(met, hits.t, np.nan), np.nan),
            hit_px=image(self.hit_px, np.nan),
            hit_depth=image(self.hit_depth, np.nan),
            radiance=image(self.radiance, np.nan),
        )


def reflected_rays(
    camera: Camera,
    view: ViewParams,
    geometry: Geometry,
    points: F64Array,
    gbuffer: GBuffer,
    pixels: I64Array,
    max_distance: float = np.inf,
) -> Rays:
    """The ray of each pixel, from the triangle that it shows; NaN where it has none.

    points: eye-centred corners. pixels: as `reflective_pixels` numbers them.
    """
    n = len(pixels)
    shown = gbuffer.triangle_id.ravel()[pixels]
    rays = Rays(np.empty((n, 3)), np.empty((n, 3)), shown, np.empty((n, 4)), float(max_distance))
    set_up_rays(
        view,
        world_axes(camera),
        points,
        geometry.normals_ws,
        geometry.faces,
        geometry.triangle_flags,
        pixels,
        shown,
        rays.origin,
        rays.direction,
        rays.guard,
    )
    return rays


@inlined
def met_surface(geometry: Geometry, t: int, front: bool) -> SurfaceRun:
    """What `leaving_radiance` must know of triangle t on the side that a ray met.

    The parts that place a pixel on the triangle are left empty: the weights are known.
    """
    i0, i1, i2 = geometry.faces[t, 0], geometry.faces[t, 1], geometry.faces[t, 2]
    smooth = (geometry.triangle_flags[t] & HAS_NORMALS) != 0
    zero = Vec3(0.0, 0.0, 0.0)
    return SurfaceRun(
        NearnessPlane(0.0, 0.0, 0.0),
        BarycentricFrame(zero, zero, zero, 0.0),
        zero,
        not front and (geometry.triangle_flags[t] & DOUBLE_SIDED) != 0,
        smooth,
        smooth and not rows_equal(geometry.normals_ws, i0, i1, i2),
        True,
    )


@kernel
def is_seen(
    view: ViewParams,
    points: F64Array,
    faces: I32Array,
    t: int,
    shown: int,
    front: float,
    depth: float,
) -> bool:
    """Whether a pixel that shows triangle `shown` at depth `front` shows the point of t at depth.

    The gradient is that of the shown triangle's plane: h = (|a| + |b|)/2 is half the range of
    nearness that it spans inside the pixel.
    """
    if shown == t:
        return True
    if shown < 0:
        return False
    v0 = rotate_to_view(view, load(points, faces[shown, 0]))
    v1 = rotate_to_view(view, load(points, faces[shown, 1]))
    v2 = rotate_to_view(view, load(points, faces[shown, 2]))
    plane = nearness_plane(view, plane_normal(v0, v1, v2), v0, v1, v2)
    apart = abs(nearness_of_depth(view, depth) - nearness_of_depth(view, front))
    return apart <= (abs(plane.a) + abs(plane.b)) * 0.5


@driver()
def look_up(
    view: ViewParams,
    axes: F64Array,
    geometry: Geometry,
    textures: Textures | None,
    lights: LightArrays,
    points: F64Array,
    depth: F64Array,
    triangle_id: I32Array,
    origin: F64Array,
    direction: F64Array,
    met: I32Array,
    distance: F64Array,
    weights: F64Array,
    front: BoolArray,
    truth: U8Array,
    side: U8Array,
    hit_px: F64Array,
    hit_depth: F64Array,
    radiance: F64Array,
) -> None:
    """Class, place on screen and radiance of every ray's hit; triangle met, −1 for none.

    A ray that was not traced has a NaN direction. textures: of the materials that were met; None,
    and not paid for, where none has any.
    """
    for k in prange(met.shape[0]):
        truth[k] = NOTHING if np.isfinite(direction[k, 0]) else NO_RAY
        side[k] = 0
        hit_px[k, 0] = np.nan
        hit_px[k, 1] = np.nan
        hit_depth[k] = np.nan
        for c in range(3):
            radiance[k, c] = np.nan
        t = np.int64(met[k])
        if t < 0:
            continue
        o, r, s = load(origin, k), load(direction, k), distance[k]
        p = rotate_to_view(view, Vec3(o.x + s * r.x, o.y + s * r.y, o.z + s * r.z))
        q = clip_xyw(view, p)
        px = view.width * 0.5 * (1.0 + q.x / q.z) if q.z > 0.0 else np.nan
        py = view.height * 0.5 * (1.0 - q.y / q.z) if q.z > 0.0 else np.nan
        hit_px[k, 0] = px
        hit_px[k, 1] = py
        hit_depth[k] = -p.z

        # Whether the camera sees it.
        place = side_of(view, px, py, -p.z)
        v0 = load(points, geometry.faces[t, 0])
        n = plane_normal(v0, load(points, geometry.faces[t, 1]), load(points, geometry.faces[t, 2]))
        from_eye = v0 if view.perspective else to_world(axes, Vec3(0.0, 0.0, -1.0))
        slope = dot(n, from_eye)
        away = not (slope < 0.0) if front[k] else not (slope > 0.0)
        seen = False
        if place == 0 and not away:
            x, y = int(px), int(py)
            shown = np.int64(triangle_id[y, x])
            seen = is_seen(view, points, geometry.faces, t, shown, depth[y, x], -p.z)
        side[k] = place
        truth[k] = class_of(place, away, seen)

        # What leaves it on the side that was met.
        b = Barycentric(weights[k, 0], weights[k, 1], weights[k, 2])
        flat = flat_normal_ws(geometry, t, not front[k])
        color = leaving_radiance(
            geometry, textures, lights, met_surface(geometry, t, front[k]), t, b, flat
        )
        radiance[k, 0] = color.x
        radiance[k, 1] = color.y
        radiance[k, 2] = color.z

"""Where every reflected ray really goes, in closed form, and whether the camera sees that place.

The ray starts at the float64 surface point of the pixel's centre and leaves along the mirror
direction of the closed-form normal; nothing here comes from a G-buffer's depth or a tracer's code.

Its first hit X is then looked up on screen. The classes, the first that applies:

    NOTHING      no surface within max_distance
    OFF_SCREEN   X projects outside the image, lies before near or behind far
    BACK_FACING  the side that was met looks away from the eye
    OCCLUDED     a surface that the camera draws stands on the eye's ray through X's exact position,
                 nearer than (1 − 2⁻²⁰) · depth of X
    VISIBLE      nothing does: the camera sees X itself

The look-up casts an eye ray at the sub-pixel position of X, not at a pixel's centre. It meets X's
own surface within a few ulps, but at a silhouette depth changes as the root of the position: ulps
of 2⁻⁵³ become √(8 · 2⁻⁵³) ≈ 3e-8 of the depth. 2⁻²⁰ ≈ 1e-6 is above that and far below any
distance between two surfaces that matters.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from .._jit import driver, kernel
from ..buffers import GBuffer, TruthClass
from ..camera import Camera, ViewParams, clip_xyw, to_view
from ..errors import SettingsError
from ..raster.surface import load
from ..typed import AnyArray, BoolArray, F64Array, I32Array, Size, U8Array
from ..vecmath.exact import dot_twice
from ..vecmath.vec import Vec3, normalize
from .arrays import shape_arrays
from .cast import Rays, cast, eye_rays, pixel_centers
from .gbuffer import analytic_gbuffer
from .ray import ABOVE_ZERO
from .scene import AnalyticScene

SAME_DEPTH = 2.0**-20
"""Relative difference of depths below which two points on one eye ray are the same."""


@dataclass(frozen=True, slots=True, eq=False)
class AnalyticReflections:
    """The first hit of every reflective pixel's ray. −1 and NaN where there is none.

    truth (H, W) uint8: `TruthClass`. leaves_front (H, W): whether the ray starts on the outside of
    its own shape, which it then never meets again: every shape is convex.
    shape_id, surface_id (H, W) int32: the shape that is hit, and its surface's number. front
    (H, W): whether it is met from its outside.
    distance (H, W) float64: along the ray, scene units. point_ws, point_vs (H, W, 3) float64.
    hit_px (H, W, 2) float64: sub-pixel position of the hit; outside the image too, NaN at and
    behind the eye. hit_depth (H, W) float64: its view depth, of either sign.
    """

    truth: U8Array
    leaves_front: BoolArray
    shape_id: I32Array
    surface_id: I32Array
    front: BoolArray
    distance: F64Array
    point_ws: F64Array
    point_vs: F64Array
    hit_px: F64Array
    hit_depth: F64Array

    def arrays(self) -> dict[str, AnyArray]:
        """The buffers by name."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


@kernel
def mirrored(d: Vec3, n: Vec3) -> Vec3:
    """Unit direction of d after a mirror of unit normal n: d less twice its part along n.

    Written again here, not shared with the tracers: a wrong sign there must not hide.
    """
    u = normalize(d)
    along = dot_twice(u, n).hi
    return normalize(
        Vec3(
            (u.x - along * n.x) - along * n.x,
            (u.y - along * n.y) - along * n.y,
            (u.z - along * n.z) - along * n.z,
        )
    )


@driver(parallel=False)
def mirror_directions(direction: F64Array, normal: F64Array, out: F64Array) -> None:
    """`mirrored` of every ray."""
    for k in range(out.shape[0]):
        r = mirrored(load(direction, k), load(normal, k))
        out[k, 0] = r.x
        out[k, 1] = r.y
        out[k, 2] = r.z


@driver(parallel=False)
def project_points(view: ViewParams, point_ws: F64Array, point_vs: F64Array, px: F64Array) -> None:
    """View-space points and pixel coordinates; NaN coordinates at depth ≤ 0 (perspective)."""
    for k in range(px.shape[0]):
        p = to_view(view, load(point_ws, k))
        point_vs[k, 0] = p.x
        point_vs[k, 1] = p.y
        point_vs[k, 2] = p.z
        q = clip_xyw(view, p)
        seen = q.z > 0.0
        px[k, 0] = view.width * 0.5 * (1.0 + q.x / q.z) if seen else np.nan
        px[k, 1] = view.height * 0.5 * (1.0 - q.y / q.z) if seen else np.nan


def analytic_reflections(
    scene: AnalyticScene,
    camera: Camera,
    size: Size,
    gbuffer: GBuffer | None = None,
    max_distance: float = np.inf,
) -> AnalyticReflections:
    """The closed-form reflections of an image of (W, H) pixels.

    gbuffer: whose `reflectivity` says which pixels reflect (any channel above 0); None: the scene's
    own, by the default settings. max_distance: a hit further along the ray is NOTHING.
    Raises SettingsError for a G-buffer of another size or without reflectivity.
    """
    view = camera.params(size)
    if not max_distance > 0.0:
        raise SettingsError(f"max_distance is {max_distance:g}; expected above 0 (inf allowed)")
    if gbuffer is None:
        gbuffer = analytic_gbuffer(scene, camera, size, outputs=("reflectivity",))
    reflectivity = gbuffer.reflectivity
    if reflectivity is None or reflectivity.shape[:2] != (view.height, view.width):
        found = "none" if reflectivity is None else "{1}x{0}".format(*reflectivity.shape)
        raise SettingsError(
            f"the G-buffer's reflectivity is {found}; expected {view.width}x{view.height}: make it "
            "with the size that is asked for"
        )
    shapes = shape_arrays(scene.shapes, scene.materials)

    # The surface points of reflective pixels.
    reflective = np.flatnonzero((reflectivity != 0.0).any(axis=2))
    eye = eye_rays(camera, view, pixel_centers(view)[reflective])
    start = cast(shapes, eye, view.near)
    drawn = (start.shape_id >= 0) & (start.t <= view.far)
    pixels = reflective[drawn]

    # Their rays, and what these meet.
    rays = Rays(
        start.point_ws[drawn],
        np.empty((len(pixels), 3)),
        start.shape_id[drawn],
        start.front[drawn],
    )
    mirror_directions(eye.direction[drawn], start.normal_ws[drawn], rays.direction)
    hits = cast(shapes, rays, ABOVE_ZERO)
    met = (hits.shape_id >= 0) & (hits.t <= max_distance)
    point_vs, px = np.empty((len(pixels), 3)), np.empty((len(pixels), 2))
    project_points(view, hits.point_ws, point_vs, px)

    # Whether the camera sees it: what is on the eye's ray through it.
    depth = -point_vs[:, 2]
    inside = (px >= 0.0).all(axis=1) & (px[:, 0] < view.width) & (px[:, 1] < view.height)
    inside &= met & (depth >= view.near) & (depth <= view.far)
    looks = eye_rays(camera, view, px[inside])
    before = cast(shapes, looks, view.near)
    n = hits.normal_ws[inside]
    away = (n[:, 0] * looks.direction[:, 0] + n[:, 1] * looks.direction[:, 1]) + (
        n[:, 2] * looks.direction[:, 2]
    ) >= 0.0
    occluded = before.t < depth[inside] * (1.0 - SAME_DEPTH)
    truth = np.full(len(pixels), TruthClass.NOTHING, np.uint8)
    truth[met] = TruthClass.OFF_SCREEN
    truth[inside] = np.where(
        away,
        TruthClass.BACK_FACING,
        np.where(occluded, TruthClass.OCCLUDED, TruthClass.VISIBLE),
    )

    # Back into images.
    def image(values: AnyArray, empty: float) -> AnyArray:
        out = np.full((view.height * view.width, *values.shape[1:]), empty, values.dtype)
        out[pixels[met]] = values[met]
        return out.reshape(view.height, view.width, *values.shape[1:])

    classes = np.zeros(view.height * view.width, np.uint8)
    classes[pixels] = truth
    leaves_front = np.zeros(view.height * view.width, bool)
    leaves_front[pixels] = rays.own_front
    return AnalyticReflections(
        truth=classes.reshape(view.height, view.width),
        leaves_front=leaves_front.reshape(view.height, view.width),
        shape_id=image(hits.shape_id, -1),
        surface_id=image(shapes.surface[hits.shape_id] + hits.face, -1),
        front=image(hits.front, False),
        distance=image(hits.t, np.nan),
        point_ws=image(hits.point_ws, np.nan),
        point_vs=image(point_vs, np.nan),
        hit_px=image(px, np.nan),
        hit_depth=image(depth, np.nan),
    )

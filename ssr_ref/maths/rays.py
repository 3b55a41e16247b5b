"""`clip_ray` and `ray_setup` over arrays: a reflected ray before it is walked in screen space."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .._jit import driver
from ..buffers import End, Status
from ..camera import Camera, ViewParams
from ..errors import MathsError
from ..ssr.ray import WALK, set_up_ray
from ..ssr.ray import clip_ray as clip_unit_ray
from ..typed import F64Array, I64Array, Size, U8Array
from ..vecmath.scaling import exponent, largest, times_power
from ..vecmath.vec import Vec3, is_finite, normalize
from .arrays import common_shape, flat, numbers, rows, vectors
from .registry import KernelInfo

BACKGROUND = int(Status.BACKGROUND)
NO_END = int(End.NONE)


STUDY_CAMERA = Camera.frustum(np.eye(4), -0.75, 1.25, -0.375, 0.625, near=0.125)
STUDY_SIZE = (37, 23)
"""The off-axis camera and the image that the stated bounds are measured with."""


class ClippedRay(NamedTuple):
    """Where rays leave the visible space.

    t : (...), length along the ray in scene units, ≥ 0, +inf for a ray that never leaves.
    end : (...) uint8, `End`: the bound met there; NONE for an origin that is no point in front of
        the eye or a direction that is none (then t and clip are NaN).
    clip : (..., 3), clip coordinates (x, y, w) at t, w > 0; for t = +inf the vanishing point.
    """

    t: F64Array
    end: U8Array
    clip: F64Array


class RaySetup(NamedTuple):
    """What a walk needs: P(s) = p0 + s·dp in pixels, k(s) = k0 + s·dk, 0 ≤ s ≤ s_end.

    status : (...) uint8, `Status`: NOT_COMPUTED for a ray that is ready to be walked, else why
        there is none (then all numbers are NaN). end : (...) uint8, `End`: the bound at s_end.
    p0, dp : (..., 2). k0, dk : (...), k = 1/depth, or depth if orthographic. s_end : (...), pixels
        along the longer axis; 0 (and dp = 0, dk = 0) for a ray along the pixel's own line of sight.
    """

    status: U8Array
    end: U8Array
    p0: F64Array
    dp: F64Array
    k0: F64Array
    dk: F64Array
    s_end: F64Array


@driver(parallel=False)
def clip_rays(
    view: ViewParams,
    origin: F64Array,
    direction: F64Array,
    max_distance: F64Array,
    t: F64Array,
    end: U8Array,
    clip: F64Array,
) -> None:
    """One ray a row, by `ray.clip_ray`."""
    for i in range(t.shape[0]):
        t[i] = np.nan
        end[i] = NO_END
        clip[i, 0], clip[i, 1], clip[i, 2] = np.nan, np.nan, np.nan
        o = Vec3(origin[i, 0], origin[i, 1], origin[i, 2])
        d = Vec3(direction[i, 0], direction[i, 1], direction[i, 2])
        size = largest(d.x, d.y, d.z)
        if not (is_finite(o) and o.z < 0.0 and is_finite(d) and size > 0.0):
            continue
        if not max_distance[i] >= 0.0:
            continue
        m = -exponent(size)
        r = normalize(Vec3(times_power(d.x, m), times_power(d.y, m), times_power(d.z, m)))
        found = clip_unit_ray(view, o, r, -o.z, max_distance[i])
        t[i] = found.t
        end[i] = found.end
        start, slope = found.start, found.slope
        if np.isinf(found.t):
            clip[i, 0], clip[i, 1], clip[i, 2] = slope.x, slope.y, slope.z
        else:
            clip[i, 0] = start.x + found.t * slope.x
            clip[i, 1] = start.y + found.t * slope.y
            clip[i, 2] = found.depth
        if not view.perspective:
            clip[i, 2] = 1.0


@driver(parallel=False)
def set_up_rays(
    view: ViewParams,
    pixel: I64Array,
    depth: F64Array,
    normal: F64Array,
    geo_normal: F64Array,
    max_distance: F64Array,
    status: U8Array,
    end: U8Array,
    p0: F64Array,
    dp: F64Array,
    k0: F64Array,
    dk: F64Array,
    s_end: F64Array,
) -> None:
    """One ray a row, by `ray.set_up_ray`."""
    for i in range(depth.shape[0]):
        end[i] = NO_END
        p0[i, 0], p0[i, 1], dp[i, 0], dp[i, 1] = np.nan, np.nan, np.nan, np.nan
        k0[i], dk[i], s_end[i] = np.nan, np.nan, np.nan
        status[i] = BACKGROUND
        if depth[i] == np.inf:
            continue
        found, ray = set_up_ray(
            view,
            pixel[i, 0],
            pixel[i, 1],
            depth[i],
            Vec3(normal[i, 0], normal[i, 1], normal[i, 2]),
            Vec3(geo_normal[i, 0], geo_normal[i, 1], geo_normal[i, 2]),
            max_distance[i],
        )
        status[i] = found
        if found == WALK:
            end[i] = ray.end
            p0[i, 0], p0[i, 1], dp[i, 0], dp[i, 1] = ray.p0_x, ray.p0_y, ray.dp_x, ray.dp_y
            k0[i], dk[i], s_end[i] = ray.k0, ray.dk, ray.s_end


def clip_ray(
    camera: Camera, size: Size, origin: Any, direction: Any, max_distance: Any = np.inf
) -> ClippedRay:
    """Clip rays in view space to the near plane and the window, before anything is divided by w.

    origin : (..., 3), view space, z < 0, inside the window and beyond the near plane (a bound that
        is already passed and moved away from ends the ray at t = 0). direction : (..., 3), view
        space, any length but 0. max_distance : (...) ≥ 0, scene units. All
        broadcast. size : (W, H).

    Rays are not clipped at the far plane. The bound met first wins, ties in the order of `End`.
    Raises MathsError for a bad shape or type, CameraError or SettingsError for the camera or size.
    Source: Blinn and Newell, Clipping Using Homogeneous Coordinates, SIGGRAPH 1978.
    """
    view = _view(camera, size)
    o, d = vectors(origin, "origin", 3), vectors(direction, "direction", 3)
    far = numbers(max_distance, "max_distance")
    shape = common_shape(origin=o.shape[:-1], direction=d.shape[:-1], max_distance=far.shape)
    o, d, far = rows(o, shape), rows(d, shape), flat(far, shape)
    t, clip = np.empty(far.shape[0]), np.empty((far.shape[0], 3))
    end = np.empty(far.shape[0], np.uint8)
    clip_rays(view, o, d, far, t, end, clip)
    return ClippedRay(t.reshape(shape), end.reshape(shape), clip.reshape(*shape, 3))


def ray_setup(
    camera: Camera,
    size: Size,
    pixel: Any,
    depth: Any,
    normal: Any,
    *,
    geo_normal: Any = None,
    max_distance: Any = np.inf,
) -> RaySetup:
    """The reflected rays of pixels, projected: what every screen-space walk starts from.

    pixel : (..., 2) whole numbers (x, y) inside the image. depth : (...), linear view depth > 0.
    normal : (..., 3), the shading normal in view space, any length. geo_normal : (..., 3), facing
        the eye; default: the shading normal. max_distance : (...), along the ray in scene units.
        All broadcast. size : (W, H).

    Raises MathsError for a bad shape or type, CameraError or SettingsError for the camera or size.
    Source: McGuire and Mara, Efficient GPU Screen-Space Ray Tracing, JCGT 3(4), 2014, listing 2.
    """
    view = _view(camera, size)
    xy = numbers(pixel, "pixel")
    if xy.ndim == 0 or xy.shape[-1] != 2:
        raise MathsError(f"pixel has shape {xy.shape}; expected (..., 2): x and y in the last axis")
    if not ((xy >= 0) & (xy < (view.width, view.height)) & (np.floor(xy) == xy)).all():
        raise MathsError(
            f"pixel holds a number that is no pixel of {view.width}x{view.height}; expected whole "
            "numbers from 0 to W - 1 and H - 1"
        )
    z = numbers(depth, "depth")
    n = vectors(normal, "normal", 3)
    g = n if geo_normal is None else vectors(geo_normal, "geo_normal", 3)
    far = numbers(max_distance, "max_distance")
    shape = common_shape(
        pixel=xy.shape[:-1],
        depth=z.shape,
        normal=n.shape[:-1],
        geo_normal=g.shape[:-1],
        max_distance=far.shape,
    )
    z = flat(z, shape)
    count = z.shape[0]
    status, end = np.empty(count, np.uint8), np.empty(count, np.uint8)
    p0, dp = np.empty((count, 2)), np.empty((count, 2))
    k0, dk, s_end = np.empty(count), np.empty(count), np.empty(count)
    set_up_rays(
        view, rows(xy, shape).astype(np.int64), z, rows(n, shape), rows(g, shape),
        flat(far, shape), status, end, p0, dp, k0, dk, s_end,
    )  # fmt: skip
    return RaySetup(
        status.reshape(shape),
        end.reshape(shape),
        p0.reshape(*shape, 2),
        dp.reshape(*shape, 2),
        k0.reshape(shape),
        dk.reshape(shape),
        s_end.reshape(shape),
    )


def _clip_length(origin: Any, direction: Any, max_distance: Any) -> F64Array:
    return clip_ray(STUDY_CAMERA, STUDY_SIZE, origin, direction, max_distance).t


def _end_position(pixel: Any, depth: Any, normal: Any, max_distance: Any) -> F64Array:
    found = ray_setup(STUDY_CAMERA, STUDY_SIZE, pixel, depth, normal, max_distance=max_distance)
    return found.p0 + found.s_end[..., None] * found.dp


def _inverse_depths(pixel: Any, depth: Any, normal: Any, max_distance: Any) -> F64Array:
    found = ray_setup(STUDY_CAMERA, STUDY_SIZE, pixel, depth, normal, max_distance=max_distance)
    return np.stack([found.k0, found.k0 + found.s_end * found.dk], axis=-1)


def _view(camera: Camera, size: Size) -> ViewParams:
    if not isinstance(camera, Camera):
        raise MathsError(f"camera is a {type(camera).__name__}; expected an ssr_ref.Camera")
    return camera.params(size)


_PATH = (
    "sight 2, point 1, unit vectors 5 + 5, reflection 9, unit again 5, clip 9, end point 3, window "
    "and differences 4; κ covers what cancels"
)
_SOURCE = "McGuire and Mara, JCGT 3(4), 2014, listing 2"
KERNELS = (
    KernelInfo(
        name="clip_ray",
        function=_clip_length,
        measure="component",
        bound=14.0,
        why="unit direction 5u, two sums of three products γ₄ each, their quotient 1u; κ covers "
        "what the sums cancel",
        source="Blinn and Newell, SIGGRAPH 1978",
    ),
    KernelInfo(
        name="ray_setup",
        form="end_position",
        function=_end_position,
        measure="norm",
        bound=43.0,
        why="P(s_end), γ₄₃ along the longest path: " + _PATH,
        source=_SOURCE,
    ),
    KernelInfo(
        name="ray_setup",
        form="inverse_depth",
        function=_inverse_depths,
        measure="norm",
        bound=43.0,
        why="k0 and k(s_end), γ₄₃ along the longest path: " + _PATH,
        source=_SOURCE,
    ),
)

"""The reflected ray of a pixel, clipped and projected once, before it is walked.

P is the pixel position and k = 1/depth (orthographic: depth itself); both are linear in s, the
distance along the major screen axis in pixels:

    P(s) = P0 + s·dP    k(s) = k0 + s·dk    0 ≤ s ≤ S = max(|ΔPx|, |ΔPy|)

Source: McGuire and Mara, Efficient GPU Screen-Space Ray Tracing, JCGT 3(4), 2014. Here the ray is
clipped to the viewport as well, and every sample is a function of its own s, never a carried sum.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._jit import kernel
from ..buffers import End, Status
from ..camera import ViewParams, point_at, ray_through
from ..vecmath.vec import Vec3, dot, is_finite, normalize, reflect

WALK = int(Status.NOT_COMPUTED)
INVALID_INPUT = int(Status.INVALID_INPUT)
BELOW_SURFACE = int(Status.BELOW_SURFACE)
LEFT_SCREEN_L, LEFT_SCREEN_R = int(End.LEFT_SCREEN_L), int(End.LEFT_SCREEN_R)
LEFT_SCREEN_T, LEFT_SCREEN_B = int(End.LEFT_SCREEN_T), int(End.LEFT_SCREEN_B)
BEHIND_CAMERA, MAX_DISTANCE = int(End.BEHIND_CAMERA), int(End.MAX_DISTANCE)


class Ray(NamedTuple):
    """A ray ready to be walked. Lengths in scene units, positions in pixels."""

    perspective: bool
    x: int  # the origin's pixel
    y: int
    p0_x: float
    p0_y: float
    dp_x: float
    dp_y: float
    k0: float  # 1/depth, or depth if orthographic
    dk: float
    s_end: float
    end: int  # `End`: the bound at s_end
    length_scale: float  # length(s) = s · length_scale / k(s) (orthographic: s · length_scale)
    origin_vs: Vec3
    direction_vs: Vec3  # unit
    origin_depth: float
    normal_vs: Vec3  # geometric, as stored
    normal_dot_ray: float  # n·d of the origin


@kernel
def position_x(ray: Ray, s: float) -> float:
    """Pixel coordinate x at s."""
    return ray.p0_x + s * ray.dp_x


@kernel
def position_y(ray: Ray, s: float) -> float:
    """Pixel coordinate y at s."""
    return ray.p0_y + s * ray.dp_y


@kernel
def depth_at(ray: Ray, s: float) -> float:
    """View depth at s; +inf where k ≤ 0 (at and beyond the vanishing point)."""
    k = ray.k0 + s * ray.dk
    if not ray.perspective:
        return k
    return 1.0 / k if k > 0.0 else np.inf


@kernel
def s_of_depth(ray: Ray, depth: float) -> float:
    """Where the ray has this view depth; only for a ray whose depth changes."""
    if ray.perspective:
        return (1.0 / depth - ray.k0) / ray.dk
    return (depth - ray.k0) / ray.dk


@kernel
def length_at(ray: Ray, s: float) -> float:
    """Distance from the origin along the unit ray at s."""
    if not ray.perspective:
        return s * ray.length_scale
    k = ray.k0 + s * ray.dk
    return s * ray.length_scale / k if k > 0.0 else np.inf


@kernel
def leaving_time(value: float, slope: float) -> float:
    """t ≥ 0 at which value + t·slope falls below 0; inf if it does not."""
    if not slope < 0.0:
        return np.inf
    return value / -slope if value > 0.0 else 0.0


class Clip(NamedTuple):
    """Where a ray leaves the visible space, in clip coordinates (x, y, w)."""

    t: float  # length along the unit ray; may be inf
    end: int  # `End`: the bound at t
    depth: float  # view depth at t
    start: Vec3  # clip coordinates at t = 0
    slope: Vec3  # and how they change with t


@kernel
def clip_ray(view: ViewParams, origin: Vec3, r: Vec3, depth: float, max_distance: float) -> Clip:
    """The bound that the unit ray from `origin` at view depth `depth` > 0 meets first.

    Depth at the end is never below that of the origin and the near plane both, whatever t rounds
    to: w stays above 0.
    """
    if view.perspective:
        w, dw = depth, -r.z
        cx = view.p00 * origin.x + view.offset_x * origin.z
        cy = view.p11 * origin.y + view.offset_y * origin.z
        dx = view.p00 * r.x + view.offset_x * r.z
        dy = view.p11 * r.y + view.offset_y * r.z
    else:
        w, dw = 1.0, 0.0
        cx = view.p00 * origin.x + view.offset_x
        cy = view.p11 * origin.y + view.offset_y
        dx = view.p00 * r.x
        dy = view.p11 * r.y
    t, end = leaving_time(w + cx, dw + dx), LEFT_SCREEN_L
    t_next = leaving_time(w - cx, dw - dx)
    if t_next < t:
        t, end = t_next, LEFT_SCREEN_R
    t_next = leaving_time(w - cy, dw - dy)
    if t_next < t:
        t, end = t_next, LEFT_SCREEN_T
    t_next = leaving_time(w + cy, dw + dy)
    if t_next < t:
        t, end = t_next, LEFT_SCREEN_B
    t_next = leaving_time(depth - view.near, -r.z)
    if t_next < t:
        t, end = t_next, BEHIND_CAMERA
    if max_distance < t or np.isinf(t):
        t, end = max_distance, MAX_DISTANCE

    depth1 = view.near if end == BEHIND_CAMERA else depth - t * r.z
    lowest = min(depth, view.near)
    if depth1 < lowest:
        depth1 = lowest
    return Clip(t, end, depth1, Vec3(cx, cy, w), Vec3(dx, dy, dw))


@kernel
def no_ray(status: int) -> tuple[int, Ray]:
    """A status that needs no walk, with an empty ray."""
    zero = Vec3(0.0, 0.0, 0.0)
    return status, Ray(
        True, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0.0, zero, zero, 0.0, zero, 0.0
    )


@kernel
def set_up_ray(
    view: ViewParams,
    x: int,
    y: int,
    depth: float,
    shading_normal: Vec3,
    geo_normal: Vec3,
    max_distance: float,
) -> tuple[int, Ray]:
    """Status (WALK, INVALID_INPUT or BELOW_SURFACE) and ray of pixel (x, y).

    depth is finite or bad, never the background's +inf. Normals need not be unit.
    """
    mirror = Vec3(0.0, 0.0, 0.0)
    return start_ray(view, x, y, depth, shading_normal, geo_normal, max_distance, 0.0, 0.0, mirror)


@kernel
def start_ray(
    view: ViewParams,
    x: int,
    y: int,
    depth: float,
    shading_normal: Vec3,
    geo_normal: Vec3,
    max_distance: float,
    move_x: float,
    move_y: float,
    direction: Vec3,
) -> tuple[int, Ray]:
    """`set_up_ray`, of a ray that may start beside the centre and leave another way.

    move_x, move_y: from the centre to the start, pixels; depth and mirror direction stay those of
    the centre. direction: unit, view space; zero: the mirror direction.
    """
    # Check the surface point.
    px, py = x + 0.5, y + 0.5
    if not (depth > 0.0 and np.isfinite(depth)):
        return no_ray(INVALID_INPUT)
    if not (is_finite(shading_normal) and is_finite(geo_normal)):
        return no_ray(INVALID_INPUT)
    if dot(shading_normal, shading_normal) == 0.0 or dot(geo_normal, geo_normal) == 0.0:
        return no_ray(INVALID_INPUT)
    d = ray_through(view, px, py)
    facing = dot(geo_normal, d)
    if not facing < 0.0:
        return no_ray(INVALID_INPUT)

    # Reflect the pixel's ray.
    px, py = px + move_x, py + move_y
    origin = point_at(view, px, py, depth)
    r = direction
    if not dot(direction, direction) > 0.0:
        r = normalize(reflect(normalize(d), normalize(shading_normal)))
    if not dot(r, geo_normal) > 0.0:
        return no_ray(BELOW_SURFACE)

    # Clip it; c and d are the clip coordinates of origin and direction.
    clip = clip_ray(view, origin, r, depth, max_distance)
    t, end, depth1 = clip.t, clip.end, clip.depth
    cx, cy = clip.start.x, clip.start.y
    dx, dy, dw = clip.slope.x, clip.slope.y, clip.slope.z

    # Project the end: in the limit of an endless ray, the window of its direction.
    k0 = 1.0 / depth
    if view.perspective:
        if np.isinf(t):
            w1, k1, scale = dw, 0.0, 1.0 / dw
            cx, cy = dx, dy
        else:
            w1, k1 = depth1, 1.0 / depth1
            scale = t * k1
            cx += t * dx
            cy += t * dy
        x1 = view.width * 0.5 + cx / w1 * (view.width * 0.5)
        y1 = view.height * 0.5 - cy / w1 * (view.height * 0.5)
    else:
        k0, k1, scale = depth, depth1, t
        x1 = view.width * 0.5 + (cx + t * dx) * (view.width * 0.5)
        y1 = view.height * 0.5 - (cy + t * dy) * (view.height * 0.5)
    # A side of the image is met exactly: many samples and ends fall on pixel borders if S is whole
    # or half, and an ulp must not choose between two pixels.
    if end == LEFT_SCREEN_L:
        x1 = 0.0
    elif end == LEFT_SCREEN_R:
        x1 = np.float64(view.width)
    elif end == LEFT_SCREEN_T:
        y1 = 0.0
    elif end == LEFT_SCREEN_B:
        y1 = np.float64(view.height)
    delta_x, delta_y = x1 - px, y1 - py
    s_end = max(abs(delta_x), abs(delta_y))
    if not (s_end > 0.0 and np.isfinite(s_end)):
        # Straight along the view axis (or beyond all numbers): the ray stays in its pixel.
        return WALK, Ray(
            view.perspective,
            x,
            y,
            px,
            py,
            0.0,
            0.0,
            k0,
            0.0,
            0.0,
            end,
            0.0,
            origin,
            r,
            depth,
            geo_normal,
            facing,
        )
    return WALK, Ray(
        view.perspective,
        x,
        y,
        px,
        py,
        delta_x / s_end,
        delta_y / s_end,
        k0,
        (k1 - k0) / s_end,
        s_end,
        end,
        scale / s_end,
        origin,
        r,
        depth,
        geo_normal,
        facing,
    )

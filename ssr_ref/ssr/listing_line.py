"""The line of the published DDA: where it ends, and P, Q and k as carried sums.

Q is the view position times k = 1/w, so that a view depth is Q.z/k. Here w is the depth: Q.z of a
perspective ray is 1 but for rounding, and k of an orthographic one is 1.
Source: McGuire and Mara, JCGT 3(4), 2014.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._jit import kernel
from ..camera import ViewParams
from .ray import BEHIND_CAMERA, MAX_DISTANCE, Ray, clip_ray, depth_at, leaving_time

DEGENERATE_PX = 0.01


class Target(NamedTuple):
    """What a line ends at: window position, k, and t·k (orthographic: t) of the distance t."""

    x: float
    y: float
    k: float
    scale: float


@kernel
def target_at(view: ViewParams, ray: Ray, t: float, depth: float) -> Target:
    """The ray at distance t, where its view depth is `depth`; t = inf: its vanishing point."""
    o, r = ray.origin_vs, ray.direction_vs
    if not view.perspective:
        x, y = o.x + t * r.x, o.y + t * r.y
        return Target(view.cx + view.fx * x, view.cy - view.fy * y, depth, t)
    if t == np.inf:
        if not r.z < 0.0:
            return Target(np.inf, np.inf, 0.0, np.inf)
        x, y = -r.x / r.z, -r.y / r.z
        return Target(view.cx + view.fx * x, view.cy - view.fy * y, 0.0, -1.0 / r.z)
    x, y, k = (o.x + t * r.x) / depth, (o.y + t * r.y) / depth, 1.0 / depth
    return Target(view.cx + view.fx * x, view.cy - view.fy * y, k, t * k)


@kernel
def aimed(ray: Ray, target: Target, end: int) -> Ray:
    """The ray with another end; as it is where that end is nowhere, or no pixel away."""
    delta_x, delta_y = target.x - ray.p0_x, target.y - ray.p0_y
    s_end = max(abs(delta_x), abs(delta_y))
    if not (s_end > 0.0 and np.isfinite(s_end)):
        return ray
    return Ray(
        ray.perspective,
        ray.x,
        ray.y,
        ray.p0_x,
        ray.p0_y,
        delta_x / s_end,
        delta_y / s_end,
        ray.k0,
        (target.k - ray.k0) / s_end,
        s_end,
        end,
        target.scale / s_end,
        ray.origin_vs,
        ray.direction_vs,
        ray.origin_depth,
        ray.normal_vs,
        ray.normal_dot_ray,
    )


@kernel
def unclipped(view: ViewParams, ray: Ray, max_distance: float) -> Ray:
    """The ray clipped to near plane and max_distance only, from the one clipped to the image."""
    if ray.end == BEHIND_CAMERA or ray.end == MAX_DISTANCE:
        return ray
    z = ray.origin_depth
    t, end = max_distance, MAX_DISTANCE
    t_near = leaving_time(z - view.near, -ray.direction_vs.z)
    if t_near < t:
        t, end = t_near, BEHIND_CAMERA
    depth = view.near if end == BEHIND_CAMERA else z - t * ray.direction_vs.z
    return aimed(ray, target_at(view, ray, t, max(depth, min(z, view.near))), end)


@kernel
def nudged(view: ViewParams, ray: Ray, max_distance: float) -> Ray:
    """The ray with its end moved by 0.01 px in x and y where it is shorter than that."""
    x, y = ray.s_end * ray.dp_x, ray.s_end * ray.dp_y
    if not x * x + y * y < DEGENERATE_PX * DEGENERATE_PX:
        return ray
    clip = clip_ray(view, ray.origin_vs, ray.direction_vs, ray.origin_depth, max_distance)
    at = target_at(view, ray, clip.t, clip.depth)
    return aimed(ray, Target(at.x + DEGENERATE_PX, at.y + DEGENERATE_PX, at.k, at.scale), ray.end)


class Sums(NamedTuple):
    """P, Q.z (positive) and k of a sample, carried from the one before."""

    px: float
    py: float
    q: float
    k: float


@kernel
def increments(ray: Ray, stride: float) -> Sums:
    """What a sample adds to the sums; orthographic: k is 1 and Q.z the depth."""
    if not ray.perspective:
        return Sums(stride * ray.dp_x, stride * ray.dp_y, stride * ray.dk, 0.0)
    k1 = ray.k0 + ray.s_end * ray.dk
    q0 = ray.origin_depth * ray.k0
    q1 = depth_at(ray, ray.s_end) * k1 if k1 > 0.0 else 1.0
    dq = (q1 - q0) / ray.s_end if ray.s_end > 0.0 else 0.0
    return Sums(stride * ray.dp_x, stride * ray.dp_y, stride * dq, stride * ray.dk)


@kernel
def first_sums(ray: Ray, by: Sums, offset: float) -> Sums:
    """The sums of sample 0."""
    q, k = ray.origin_depth * ray.k0, ray.k0
    if not ray.perspective:
        q, k = ray.k0, 1.0
    return Sums(
        ray.p0_x + by.px * offset, ray.p0_y + by.py * offset, q + by.q * offset, k + by.k * offset
    )


@kernel
def added(sums: Sums, by: Sums, times: float) -> Sums:
    """The sums some increments later."""
    return Sums(
        sums.px + by.px * times,
        sums.py + by.py * times,
        sums.q + by.q * times,
        sums.k + by.k * times,
    )


@kernel
def quotient(q: float, k: float) -> float:
    """Q.z/k, a view depth: negative behind the eye, where k is."""
    return q / k if k != 0.0 else np.inf


@kernel
def raw_depth(ray: Ray, s: float) -> float:
    """The ray's view depth without a guard: beyond the vanishing point it is below 0."""
    k = ray.k0 + s * ray.dk
    return quotient(1.0, k) if ray.perspective else k


@kernel
def raw_length(ray: Ray, s: float) -> float:
    """Distance from the origin at s, on either side of the eye."""
    k = ray.k0 + s * ray.dk if ray.perspective else 1.0
    return abs(quotient(s * ray.length_scale, k))

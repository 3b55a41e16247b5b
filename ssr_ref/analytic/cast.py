"""Many rays against a scene: rays in, hits out. The one driver that holds the closed forms."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from .._jit import driver
from ..camera import Camera, ViewParams, ray_through
from ..raster.surface import load
from ..typed import BoolArray, F64Array, I32Array
from ..vecmath.vec import Vec3
from .arrays import ShapeArrays, world_axes
from .ray import NO_BACK, nearest, side_normal


class Rays(NamedTuple):
    """n rays in world space; own: the shape each starts on, −1 for none, own_front: outside."""

    origin: F64Array  # (n, 3)
    direction: F64Array  # (n, 3), any length: t is in its units
    own: I32Array  # (n,)
    own_front: BoolArray  # (n,)


class Hits(NamedTuple):
    """What each ray meets first; where it meets nothing shape_id −1, t and back inf, vectors NaN.

    face: 0 to 5 of a box. front: met from the shape's outside. back: t of the nearest back face
    behind. normal_ws: unit, of the side that was met.
    """

    shape_id: I32Array  # (n,)
    face: I32Array
    t: F64Array
    front: BoolArray
    back: F64Array
    point_ws: F64Array  # (n, 3)
    normal_ws: F64Array  # (n, 3)


@driver()
def cast_rays(
    shapes: ShapeArrays,
    rays: Rays,
    t_least: float,
    back_of: int,
    shape_id: I32Array,
    face: I32Array,
    t: F64Array,
    front: BoolArray,
    back: F64Array,
    point_ws: F64Array,
    normal_ws: F64Array,
) -> None:
    """`ray.nearest` for every ray, into the arrays of `Hits`: as one tuple, a parallel loop would
    take what it writes for dead.
    """
    for k in prange(rays.own.shape[0]):
        hit = nearest(
            shapes,
            load(rays.origin, k),
            load(rays.direction, k),
            t_least,
            rays.own[k],
            rays.own_front[k],
            back_of,
        )
        n = side_normal(shapes, hit) if hit.shape_id >= 0 else hit.point
        shape_id[k] = hit.shape_id
        face[k] = hit.face
        t[k] = hit.t
        front[k] = hit.front
        back[k] = hit.back
        point_ws[k, 0] = hit.point.x
        point_ws[k, 1] = hit.point.y
        point_ws[k, 2] = hit.point.z
        normal_ws[k, 0] = n.x
        normal_ws[k, 1] = n.y
        normal_ws[k, 2] = n.z


@driver(parallel=False)
def aim_rays(
    view: ViewParams, axes: F64Array, px: F64Array, origin: F64Array, direction: F64Array
) -> None:
    """World origin and direction through pixel coordinates; t is the view depth."""
    for k in range(px.shape[0]):
        v = ray_through(view, px[k, 0], px[k, 1])
        start = Vec3(0.0, 0.0, 0.0)
        if not view.perspective:
            x = (px[k, 0] - view.cx) / view.fx
            y = (view.cy - px[k, 1]) / view.fy
            start = Vec3(x, y, 0.0)
        for r in range(3):
            direction[k, r] = axes[r, 0] * v.x + axes[r, 1] * v.y + axes[r, 2] * v.z
            origin[k, r] = axes[r, 0] * start.x + axes[r, 1] * start.y
        origin[k, 0] += view.eye_x
        origin[k, 1] += view.eye_y
        origin[k, 2] += view.eye_z


def eye_rays(camera: Camera, view: ViewParams, px: F64Array) -> Rays:
    """The camera's rays through (n, 2) pixel coordinates."""
    n = len(px)
    rays = Rays(np.empty((n, 3)), np.empty((n, 3)), np.full(n, -1, np.int32), np.ones(n, bool))
    aim_rays(view, world_axes(camera), px, rays.origin, rays.direction)
    return rays


def cast(shapes: ShapeArrays, rays: Rays, t_least: float, back_of: int = NO_BACK) -> Hits:
    """What each ray meets first at t ≥ t_least. back_of: NO_BACK, BACK_OF_SAME or BACK_OF_ANY."""
    n = len(rays.own)
    hits = Hits(
        np.empty(n, np.int32),
        np.empty(n, np.int32),
        np.empty(n),
        np.empty(n, bool),
        np.empty(n),
        np.empty((n, 3)),
        np.empty((n, 3)),
    )
    cast_rays(shapes, rays, float(t_least), back_of, *hits)
    return hits


def pixel_centers(view: ViewParams) -> F64Array:
    """(H·W, 2) pixel coordinates of every pixel's centre, row by row."""
    x, y = np.meshgrid(np.arange(view.width) + 0.5, np.arange(view.height) + 0.5)
    return np.stack([x.ravel(), y.ravel()], axis=1)

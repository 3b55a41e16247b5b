"""Each pixel as the plane through its surface point, in window space.

*Nearness* w is 1/depth (orthographic: −depth): larger is nearer, and both every plane and every ray
are linear in (px, py, w):

    plane   w = w_q + g_x·(px − x_q) + g_y·(py − y_q)
    e(s)  = plane at P(s) − nearness of the ray: negative in front of the plane, ≥ 0 behind it
    h     = (|g_x| + |g_y|)/2: half the range of w that the surface spans inside the pixel

For a normal n and the pixel's ray d, n·d < 0: g = n/(f·z·n·d) (orthographic: n/(f·n_z), signs for y
down). A pixel that cannot be hit has w_q = −inf, so every ray is in front of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from .._jit import driver, kernel
from ..camera import ViewParams, ray_through
from ..typed import F64Array, FloatArray
from ..vecmath.vec import dot
from .hit import load3
from .ray import Ray, position_x, position_y
from .solid import gradient, solid_end


class Plane(NamedTuple):
    """A pixel's plane, and where its solid ends."""

    x: float  # the pixel's centre
    y: float
    w: float  # nearness at the centre, −inf if the pixel cannot be hit
    gx: float
    gy: float
    back: float  # nearness of the solid's end


@kernel
def nearness_of(perspective: bool, depth: float) -> float:
    """w of a view depth."""
    return 1.0 / depth if perspective else -depth


@kernel
def depth_of(perspective: bool, w: float) -> float:
    """View depth of a nearness; +inf at and beyond the vanishing point."""
    if not perspective:
        return -w
    return 1.0 / w if w > 0.0 else np.inf


@kernel
def ray_nearness(ray: Ray, s: float) -> float:
    """w of the ray at s; not clipped at the vanishing point."""
    k = ray.k0 + s * ray.dk
    return k if ray.perspective else -k


@driver()
def prepare_planes(
    view: ViewParams,
    depth: FloatArray,
    geo_normal: FloatArray,
    back: FloatArray,
    model: int,
    thickness: float,
    thickness_image: FloatArray,
    planes: F64Array,
) -> None:
    """planes (H, W, 4) = w, g_x, g_y and back of every pixel; back is that of `solid_end`."""
    for y in prange(view.height):
        for x in range(view.width):
            z = np.float64(depth[y, x])
            n = load3(geo_normal, y, x)
            facing = dot(n, ray_through(view, x + 0.5, y + 0.5))
            w = -np.inf
            gx = 0.0
            gy = 0.0
            w_back = np.inf
            if z > 0.0 and z < np.inf and facing < 0.0:
                w = nearness_of(view.perspective, z)
                gx, gy = gradient(view, n, z, facing)
                z_back = solid_end(
                    view, model, thickness, thickness_image, back, x, y, n, z, facing
                )
                w_back = nearness_of(view.perspective, z_back)
            planes[y, x, 0] = w
            planes[y, x, 1] = gx
            planes[y, x, 2] = gy
            planes[y, x, 3] = w_back


@kernel
def load_plane(planes: F64Array, x: int, y: int) -> Plane:
    """The plane of pixel (x, y)."""
    return Plane(
        x + 0.5, y + 0.5, planes[y, x, 0], planes[y, x, 1], planes[y, x, 2], planes[y, x, 3]
    )


@kernel
def is_open(back: FloatArray, x: int, y: int) -> bool:
    """Whether pixel (x, y) has no back face, so that its solid ends at front + thickness."""
    return back.shape[0] == 0 or not back[y, x] < np.inf


@kernel
def behind_by(plane: Plane, ray: Ray, s: float) -> float:
    """e(s): how far the ray is behind the plane in nearness; negative in front of it."""
    across = plane.gx * (position_x(ray, s) - plane.x) + plane.gy * (position_y(ray, s) - plane.y)
    return (plane.w + across) - ray_nearness(ray, s)


@kernel
def span(plane: Plane) -> float:
    """2·h: the range of w that the surface spans inside its pixel."""
    return abs(plane.gx) + abs(plane.gy)

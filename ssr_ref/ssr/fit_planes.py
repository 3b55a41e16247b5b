"""Geometric normals fitted to neighbouring depths, for buffers that have none.

Nearness w (1/depth; orthographic −depth) of a plane is linear on screen, so its differences along a
row and a column give the plane, exactly up to rounding. Per axis there are three stencils of three
pixels that hold the pixel: it is their last, their middle or their first. The straightest one, of
the least second difference, is used: one that crosses a silhouette or a crease bends more than one
that does not, and on curved surfaces the parabola through three pixels is second order.

Source: Harten, Engquist, Osher and Chakravarthy, Uniformly High Order Accurate Essentially
Non-oscillatory Schemes III, J. Comput. Phys. 71, 1987: the choice of stencil. Game engines choose
between both sides by the same second differences and take the first difference, which is first
order ("accurate normal reconstruction from depth", five taps an axis).
"""

from __future__ import annotations

import numpy as np
from numba import prange

from .._jit import driver, kernel
from ..camera import ViewParams, ray_through
from ..typed import FloatArray
from ..vecmath.vec import Vec3, dot, normalize
from .hit import load3
from .planes import nearness_of


@kernel
def nearness_at(view: ViewParams, depth: FloatArray, x: int, y: int) -> float:
    """w of pixel (x, y); NaN outside the image and where there is no usable depth."""
    if x < 0 or y < 0 or x >= view.width or y >= view.height:
        return np.nan
    z = np.float64(depth[y, x])
    return nearness_of(view.perspective, z) if 0.0 < z < np.inf else np.nan


@kernel
def bend_of(a: float, b: float, c: float) -> float:
    """How far three pixels in a row are from a straight line; inf where one is missing."""
    bend = abs((a - b) + (c - b))
    return np.inf if np.isnan(bend) else bend


@kernel
def axis_slope(a: float, b: float, w: float, c: float, d: float, none: float) -> float:
    """Change of w per pixel at the middle of five in a row; NaN stands for a missing pixel.

    The derivative of the parabola through the straightest stencil: at equal bends the middle one,
    then the side of the smaller slope, then the first. With one neighbour alone, the difference to
    it; with none, `none`.
    """
    bend, slope = bend_of(a, b, w), 0.5 * (3.0 * (w - b) - (b - a))
    right, from_right = bend_of(w, c, d), 0.5 * (3.0 * (c - w) - (d - c))
    if right < bend or (right == bend and abs(from_right) < abs(slope)):
        bend, slope = right, from_right
    middle = bend_of(b, w, c)
    if middle <= bend and middle < np.inf:
        return 0.5 * (c - b)
    if bend < np.inf:
        return slope
    if not np.isnan(b):
        return w - b
    return none if np.isnan(c) else c - w


@kernel
def normal_of(view: ViewParams, d: Vec3, depth: float, gx: float, gy: float) -> Vec3:
    """Unit normal of the plane with w's gradient (gx, gy); it faces the eye, n·d < 0.

    The inverse of `solid.gradient`, scaled so that n·d = −1.
    """
    scale = depth if view.perspective else 1.0
    nx, ny = -(gx * view.fx * scale), gy * view.fy * scale
    return normalize(Vec3(nx, ny, 1.0 + (nx * d.x + ny * d.y)))


@kernel
def fitted_normal(view: ViewParams, depth: FloatArray, x: int, y: int, w: float, d: Vec3) -> Vec3:
    """The normal fitted at pixel (x, y) of nearness w and ray d."""
    z = np.float64(depth[y, x])
    # Without a neighbour along an axis the surface faces the eye along it: the slope of n = −d.
    scale = 1.0 / (z * dot(d, d)) if view.perspective else 0.0
    gx = axis_slope(
        nearness_at(view, depth, x - 2, y),
        nearness_at(view, depth, x - 1, y),
        w,
        nearness_at(view, depth, x + 1, y),
        nearness_at(view, depth, x + 2, y),
        d.x * view.inverse_fx * scale,
    )
    gy = axis_slope(
        nearness_at(view, depth, x, y - 2),
        nearness_at(view, depth, x, y - 1),
        w,
        nearness_at(view, depth, x, y + 1),
        nearness_at(view, depth, x, y + 2),
        -(d.y * view.inverse_fy * scale),
    )
    return normal_of(view, d, z, gx, gy)


@kernel
def store3(image: FloatArray, y: int, x: int, v: Vec3) -> None:
    """Write pixel (x, y) of an (H, W, 3) image, rounded to its dtype."""
    image[y, x, 0] = v.x
    image[y, x, 1] = v.y
    image[y, x, 2] = v.z


@driver()
def fit_rows(view: ViewParams, depth: FloatArray, normals: FloatArray) -> None:
    """normals (H, W, 3), of depth's dtype; 0 where there is no usable depth."""
    for y in prange(view.height):
        for x in range(view.width):
            w = nearness_at(view, depth, x, y)
            if np.isnan(w):
                store3(normals, y, x, Vec3(0.0, 0.0, 0.0))
                continue
            d = ray_through(view, x + 0.5, y + 0.5)
            store3(normals, y, x, fitted_normal(view, depth, x, y, w, d))
            if not dot(load3(normals, y, x), d) < 0.0:
                # Edge-on up to rounding: nothing is known but that it is seen.
                store3(normals, y, x, normalize(Vec3(-d.x, -d.y, -d.z)))


def fit_normals(view: ViewParams, depth: FloatArray) -> FloatArray:
    """(H, W, 3) unit geometric normals in view space that face the eye, of depth's dtype.

    depth (H, W): linear view depth; +inf, NaN and what is not above 0 are no neighbours, and get 0.
    On a plane the error of w's gradient is at most 4u·w, u = 2⁻²⁴ (float32) or 2⁻⁵³, and w the
    greatest of five pixels. Surfaces less than three pixels wide have no stencil of their own, and
    their slope is that of a neighbour or of a jump.
    """
    normals = np.empty((*depth.shape, 3), depth.dtype)
    fit_rows(view, depth, normals)
    return normals

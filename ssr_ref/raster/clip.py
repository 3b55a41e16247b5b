"""Clipping in homogeneous coordinates, before any divide: near plane, one plane of the user's, then
the guard band.

A cut is always interpolated from the inside vertex to the outside one, so that the two triangles
of a shared edge compute the same point and no crack opens (Sutherland and Hodgman 1974).
"""

import numpy as np

from .._jit import kernel
from ..camera import ViewParams
from ..typed import F64Array

GUARD_BAND = 65536.0
"""Pixels from the viewport's centre; snapped coordinates then fit 25 bits."""

MAX_POLYGON = 9
"""Vertices of a triangle after six planes."""

X, Y, W, DEPTH, BESIDE = 0, 1, 2, 3, 4
"""Columns of a polygon; BESIDE is the distance to the user's plane, kept where ≥ 0."""

COLUMNS = 5
NEAR_PLANE, USER_PLANE, PLANES = 0, 1, 6


@kernel
def plane_distance(view: ViewParams, plane: int, polygon: F64Array, i: int) -> float:
    """Signed distance of polygon vertex i, inside ≥ 0: near, the user's, 2 to 5 the guard band."""
    if plane == NEAR_PLANE:
        return polygon[i, DEPTH] - view.near
    if plane == USER_PLANE:
        return polygon[i, BESIDE]
    if plane == 2:
        return GUARD_BAND / (view.width * 0.5) * polygon[i, W] + polygon[i, X]
    if plane == 3:
        return GUARD_BAND / (view.width * 0.5) * polygon[i, W] - polygon[i, X]
    if plane == 4:
        return GUARD_BAND / (view.height * 0.5) * polygon[i, W] + polygon[i, Y]
    return GUARD_BAND / (view.height * 0.5) * polygon[i, W] - polygon[i, Y]


@kernel
def clip_polygon(view: ViewParams, cut: bool, polygon: F64Array, scratch: F64Array) -> int:
    """Clip the triangle in polygon[:3], rows (x, y, w, depth, distance), in place; the new count.

    cut: also at the user's plane. polygon and scratch are (MAX_POLYGON, COLUMNS) float64.
    """
    count = 3
    for plane in range(PLANES):
        if plane == USER_PLANE and not cut:
            continue
        kept = 0
        for i in range(count):
            j = i + 1 if i + 1 < count else 0
            di = plane_distance(view, plane, polygon, i)
            dj = plane_distance(view, plane, polygon, j)
            if di >= 0.0:
                for c in range(COLUMNS):
                    scratch[kept, c] = polygon[i, c]
                kept += 1
            if (di >= 0.0) != (dj >= 0.0):
                if di >= 0.0:
                    inside, outside, t = i, j, di / (di - dj)
                else:
                    inside, outside, t = j, i, dj / (dj - di)
                for c in range(COLUMNS):
                    start = polygon[inside, c]
                    scratch[kept, c] = start + t * (polygon[outside, c] - start)
                if plane == USER_PLANE:
                    scratch[kept, BESIDE] = 0.0
                if plane == NEAR_PLANE:
                    scratch[kept, DEPTH] = view.near
                    if view.perspective:
                        scratch[kept, W] = view.near
                kept += 1
        count = kept
        for i in range(count):
            for c in range(COLUMNS):
                polygon[i, c] = scratch[i, c]
        if count < 3:
            return 0
    return count


@kernel
def snap_float64(ndc: float, half: float) -> int:
    """Window coordinate half + ndc·half in whole 1/256 px, ties to even."""
    return np.int64(np.rint((half + ndc * half) * 256.0))


@kernel
def snap_float32(clip: float, w: float, half: float, sign: float) -> int:
    """As a GPU does: clip position, divide and viewport in float32, each rounded."""
    ndc = np.float32(np.float32(clip) / np.float32(w))
    scaled = np.float32(ndc * np.float32(sign * half))
    window = np.float32(scaled + np.float32(half))
    return np.int64(np.rint(np.float64(window) * 256.0))


@kernel
def snap(view: ViewParams, gpu: bool, x: float, y: float, w: float) -> tuple[int, int]:
    """Snapped window position (1/256 px, y down) of clip coordinates with w > 0."""
    half_w, half_h = view.width * 0.5, view.height * 0.5
    if gpu:
        return snap_float32(x, w, half_w, 1.0), snap_float32(y, w, half_h, -1.0)
    return snap_float64(x / w, half_w), snap_float64(-(y / w), half_h)

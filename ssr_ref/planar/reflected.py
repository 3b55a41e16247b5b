"""The camera's mirror image: what draws a mirror's picture from the scene as it stands.

    clip = clip_from_view · view_from_world · M · p          M = I − 2 n nᵀ with the plane's offset

View space is Rᵀ·(p − eye). M is its own inverse and its 3×3 block B is symmetric, so

    Rᵀ·(M·p − eye) = (B·R)ᵀ·(p − M·eye):

drawing mirrored geometry with the camera, and drawing the geometry with the mirrored camera, are
one and the same. The second leaves positions, normals and lights as they are: nothing is copied,
and a flat face has the bits of colour that it has seen directly. Its axes are left-handed, so that
front faces wind the other way (`ViewParams.mirrored`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import transforms
from .._jit import driver
from ..camera import ViewParams
from ..raster.surface import load
from ..typed import AnyArray, BoolArray, F64Array
from ..vecmath.mirror import mirror
from .mirrors import PlanarMirror

AXES = ("right", "up", "back", "eye")
EYE = 3


@driver(parallel=False)
def reflect_columns(normal: F64Array, offset: float, columns: F64Array, out: F64Array) -> None:
    """Three directions and a point, rows of (4, 3), through the mirror n·x + offset = 0."""
    m = mirror(load(normal, 0), offset)
    for i in range(4):
        c = load(columns, i)
        out[i, 0] = m.xx * c.x + m.xy * c.y + m.xz * c.z
        out[i, 1] = m.xy * c.x + m.yy * c.y + m.yz * c.z
        out[i, 2] = m.xz * c.x + m.yz * c.y + m.zz * c.z
    out[3, 0] += m.x
    out[3, 1] += m.y
    out[3, 2] += m.z


def columns_of(view: ViewParams) -> F64Array:
    """(4, 3): right, up, back and eye in world space."""
    return np.array([[getattr(view, f"{name}_{axis}") for axis in "xyz"] for name in AXES])


def reflected_view(view: ViewParams, plane: PlanarMirror) -> ViewParams:
    """The view's mirror image. Reflecting it again at a second plane shows the first plane's mirror
    image of that one: the planes are always those of the scene.
    """
    columns = np.empty((4, 3))
    reflect_columns(np.array([plane.normal_ws]), plane.offset, columns_of(view), columns)
    numbers: dict[str, Any] = {
        f"{name}_{axis}": float(columns[i, j])
        for i, name in enumerate(AXES)
        for j, axis in enumerate("xyz")
    }
    return view._replace(**numbers, mirrored=not view.mirrored)


def side_of_viewer(view: ViewParams, plane: PlanarMirror) -> float:
    """1 if the viewer is where the normal points, else −1."""
    if view.perspective:
        d = float(plane.distance(np.array([view.eye_x, view.eye_y, view.eye_z])))
    else:
        n = plane.normal_ws
        d = n[0] * view.back_x + n[1] * view.back_y + n[2] * view.back_z
    return 1.0 if d >= 0.0 else -1.0


def direction_lengths(view: ViewParams, pixels: BoolArray) -> F64Array:
    """(n,) length of the pixel's ray for each unit of view depth, of the chosen pixels (H, W)."""
    y, x = np.nonzero(pixels)
    if not view.perspective:
        return np.ones(len(x))
    dx = (x + 0.5 - view.cx) / view.fx
    dy = (view.cy - (y + 0.5)) / view.fy
    return np.asarray(np.sqrt(dx * dx + dy * dy + 1.0))


def points_at(view: ViewParams, pixels: BoolArray, depth: AnyArray) -> F64Array:
    """(n, 3) world points that the chosen pixels (H, W) of a view show at depths (n,).

    World = eye + R⁻ᵀ·view; R⁻ᵀ = cofactors / determinant, whether or not R is exactly rigid.
    """
    columns = columns_of(view)
    r = np.ascontiguousarray(columns[:EYE].T)
    world = transforms.cofactors(r) / transforms.determinant3(r)
    y, x = np.nonzero(pixels)
    z = depth.astype(np.float64)
    px, py = (x + 0.5 - view.cx) / view.fx, (view.cy - (y + 0.5)) / view.fy
    if view.perspective:
        px, py = px * z, py * z
    out = np.empty((len(x), 3))
    for i in range(3):
        out[:, i] = columns[EYE, i] + ((world[i, 0] * px + world[i, 1] * py) - world[i, 2] * z)
    return out

"""Where the solid behind a pixel begins and ends: one rule for constant depth and for planes.

A pixel that shows a surface stands for the solid behind it. Its end is the back face where there is
one, else a model's guess (`Settings.thickness_from`).
"""

from __future__ import annotations

import numpy as np

from .._jit import kernel
from ..camera import ViewParams
from ..typed import FloatArray
from ..vecmath.vec import Vec3

CONSTANT, RELATIVE, SLOPE, IMAGE = 0, 1, 2, 3
"""What a pixel without back face ends with."""
MODELS = {
    "back_faces": CONSTANT,
    "constant": CONSTANT,
    "relative": RELATIVE,
    "slope": SLOPE,
    "material": IMAGE,
}
"""The model of a `Settings.thickness_from`."""


@kernel
def gradient(view: ViewParams, n: Vec3, depth: float, facing: float) -> tuple[float, float]:
    """Change of nearness per pixel to the right and down; n any length, facing = n·d."""
    if view.perspective:
        scale = 1.0 / (depth * facing)
        return n.x * view.inverse_fx * scale, -(n.y * view.inverse_fy * scale)
    return -(n.x * view.inverse_fx / n.z), n.y * view.inverse_fy / n.z


@kernel
def depth_span(view: ViewParams, n: Vec3, depth: float, facing: float) -> float:
    """The range of depth that the surface spans inside its pixel, to first order, scene units."""
    gx, gy = gradient(view, n, depth, facing)
    return (abs(gx) + abs(gy)) * (depth * depth if view.perspective else 1.0)


@kernel
def solid_end(
    view: ViewParams,
    model: int,
    thickness: float,
    thickness_image: FloatArray,
    back: FloatArray,
    x: int,
    y: int,
    n: Vec3,
    depth: float,
    facing: float,
) -> float:
    """View depth at which the solid behind pixel (x, y) ends.

    The back-face depth where there is one, else by the model: CONSTANT front + thickness, RELATIVE
    front·(1 + thickness), SLOPE the constant and `depth_span`, IMAGE front + thickness_image. back
    and thickness_image have no pixels where they are not used.
    """
    if back.shape[0] > 0 and back[y, x] < np.inf:
        return np.float64(back[y, x])
    if model == RELATIVE:
        return depth * (1.0 + thickness)
    if model == IMAGE:
        return depth + np.float64(thickness_image[y, x])
    end = depth + thickness
    if model == SLOPE:
        end += depth_span(view, n, depth, facing)
    return end

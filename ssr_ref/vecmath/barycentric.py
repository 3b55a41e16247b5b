"""Perspective-correct barycentrics of a point on screen.

    E_a = (b − p) × (c − p), and so on: twice the signed areas, affine on screen
    b_a = (E_a/w_a) / (E_a/w_a + E_b/w_b + E_c/w_c)

Source: Heckbert and Moreton, Interpolation for Polygon Texture Mapping and Shading, 1991 (divide by
w, interpolate, divide back). Here each E is taken about the point itself, from exact differences
and products in pairs, so slivers keep their digits; and no plane equation is set up.
"""

import numpy as np

from .._jit import kernel
from .exact import Pair, multiply_pairs, subtract_pairs, two_difference
from .vec import Vec3


@kernel
def doubled_area(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> Pair:
    """(a − p) × (b − p), to about 2⁻⁹⁸ of its two products."""
    return subtract_pairs(
        multiply_pairs(two_difference(ax, px), two_difference(by, py)),
        multiply_pairs(two_difference(ay, py), two_difference(bx, px)),
    )


@kernel
def barycentrics(
    px: float, py: float, ax: float, ay: float, bx: float, by: float, cx: float, cy: float, w: Vec3
) -> Vec3:
    """Weights of a, b and c: each ≥ 0, sum 1. Either winding.

    Outside the triangle negative weights become 0 before the others are divided by their sum.
    Without area a has all the weight. NaN for w that is not > 0 and for non-finite input.
    """
    whole = doubled_area(ax, ay, bx, by, cx, cy).hi
    usable = w.x > 0.0 and w.y > 0.0 and w.z > 0.0
    if not (usable and np.isfinite(whole) and np.isfinite(px + py + w.x + w.y + w.z)):
        return Vec3(np.nan, np.nan, np.nan)
    if whole == 0.0:
        return Vec3(1.0, 0.0, 0.0)
    side = 1.0 if whole > 0.0 else -1.0
    a = max(0.0, side * doubled_area(px, py, bx, by, cx, cy).hi / w.x)
    b = max(0.0, side * doubled_area(px, py, cx, cy, ax, ay).hi / w.y)
    c = max(0.0, side * doubled_area(px, py, ax, ay, bx, by).hi / w.z)
    total = a + b + c
    if not (total > 0.0 and total < np.inf):  # the areas underflow or overflow
        return Vec3(1.0, 0.0, 0.0)
    return Vec3(a / total, b / total, c / total)

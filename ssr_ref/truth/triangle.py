"""A ray against one triangle, watertight: a ray through a shared edge or vertex never leaks.

Corners are moved to the ray's origin and sheared so that the ray runs along one axis; what is left
are three edge functions in the plane. Each corner is rounded by itself, alike in every triangle
that shares it, and the *sign* of an edge function is exact, so both triangles of an edge agree on
which side the ray passes. An edge function of 0 belongs to both.

The distance is a weighted mean of the corners' distances, taken in twice the precision and rounded
once: on a shared edge, where it is the same number for both triangles, both get the same bits, and
so do triangles that lie on each other, whatever corner they begin with.

Source: Woop, Benthin and Wald, Watertight Ray/Triangle Intersection, JCGT 2(1), 2013. They decide
zeros again in twice the precision; here Kahan's difference of products has the right sign always,
and what leaves its range is decided on scaled numbers.

With u = 2⁻⁵³ and M = the largest |corner − origin|, the line passes an accepted triangle at its
computed distance within 9u·M in every axis: 6u·M from the shear, 3u·M from the distance. `nearest`
pads boxes by more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._jit import inlined, kernel
from ..typed import F64Array
from ..vecmath.exact import (
    Pair,
    add_pairs,
    divide_pairs,
    scale_pair,
    subtract_pairs,
    two_prod,
)
from ..vecmath.scaling import exponent, times_power
from ..vecmath.vec import Vec3, difference_of_products, is_finite

SMALLEST, LARGEST = 2.0**-500, 2.0**500
"""A ray's greatest direction component lies in between, and its origin is not beyond: else it is
not traced. Squares and products of lengths are then numbers."""

SAFE_LOW, SAFE_HIGH = 2.0**-900, 2.0**1000
"""Products in between lose nothing when their rounding errors are taken."""


class Shear(NamedTuple):
    """A ray set up for `meet`: axes in cyclic order, z the one that it runs along most."""

    kx: int
    ky: int
    kz: int
    ox: float  # the origin in that order
    oy: float
    oz: float
    sx: float  # d_x/d_z, d_y/d_z
    sy: float
    dz: float


class Meeting(NamedTuple):
    """Where a line crosses a triangle; met False: nowhere.

    t: in units of the direction, of either sign, inf if not met. Weights of the corners, each ≥ 0,
    sum 1 to rounding. front: from the side that sees the corners counter-clockwise.
    """

    met: bool
    t: float
    b0: float
    b1: float
    b2: float
    front: bool


@inlined
def is_traced(o: Vec3, d: Vec3) -> bool:
    """Whether the ray o + t·d can be traced; one that cannot meets nothing."""
    most = max(abs(d.x), abs(d.y), abs(d.z))
    far = max(abs(o.x), abs(o.y), abs(o.z))
    return is_finite(o) and is_finite(d) and SMALLEST <= most <= LARGEST and far <= LARGEST


@inlined
def main_axis(d: Vec3) -> int:
    """The axis that d runs along most; ties to z, then x."""
    ax, ay, az = abs(d.x), abs(d.y), abs(d.z)
    if az >= ax and az >= ay:
        return 2
    return 0 if ax >= ay else 1


@kernel
def shear_of(o: Vec3, d: Vec3) -> Shear:
    """Set up the ray o + t·d, which `is_traced`."""
    axis = main_axis(d)
    if axis == 2:
        return Shear(0, 1, 2, o.x, o.y, o.z, d.x / d.z, d.y / d.z, d.z)
    if axis == 0:
        return Shear(1, 2, 0, o.y, o.z, o.x, d.y / d.x, d.z / d.x, d.x)
    return Shear(2, 0, 1, o.z, o.x, o.y, d.z / d.y, d.x / d.y, d.y)


@kernel
def scaled_sign(a: float, b: float, c: float, d: float) -> float:
    """Sign of a·b − c·d, exactly, for finite numbers of any size."""
    p = np.sign(a) * np.sign(b)
    q = np.sign(c) * np.sign(d)
    if p != q or p == 0.0:
        return np.sign(p - q)
    # Equal signs: each factor is brought to [1, 2), and the exponents compared first.
    ma, ea = normalised(a)
    mb, eb = normalised(b)
    mc, ec = normalised(c)
    md, ed = normalised(d)
    shift = (ea + eb) - (ec + ed)
    if shift >= 2:
        return p
    if shift <= -2:
        return -p
    return p * np.sign(difference_of_products(times_power(ma, shift), mb, mc, md))


@kernel
def normalised(x: float) -> tuple[float, int]:
    """(m, n) with |x| = m·2ⁿ exactly and 1 ≤ m < 2; x is finite and not 0."""
    x = abs(x)
    shift = 0
    if x < 2.0**-1000:  # subnormal numbers have no exponent of their own
        x = x * 2.0**200
        shift = -200
    n = exponent(x)
    if n == 1022 and x >= 2.0**1023:
        x = x * 0.5
        shift = 1
    return times_power(x, -n), n + shift


@kernel
def edge(a: float, b: float, c: float, d: float) -> float:
    """a·b − c·d to 2 ulp, its sign always right; NaN if a factor is not a number.

    Kahan's form has a relative error below 2u where nothing over- or underflows (Jeannerod,
    Louvet and Muller 2013, theorem 4.2), so it is 0 only if the difference is.
    """
    r = difference_of_products(a, b, c, d)
    largest = max(abs(a * b), abs(c * d))
    if SAFE_LOW < largest < SAFE_HIGH:
        return r
    if not (np.isfinite(a) and np.isfinite(b) and np.isfinite(c) and np.isfinite(d)):
        return np.nan
    sign = scaled_sign(a, b, c, d)
    if sign == 0.0:
        return 0.0
    size = abs(r)
    if not size >= 5e-324:
        size = 5e-324
    return sign * size


@kernel
def edge_pair(a: float, b: float, c: float, d: float) -> Pair:
    """a·b − c·d in twice the precision, also where it cancels."""
    return subtract_pairs(two_prod(a, b), two_prod(c, d))


@kernel
def apart() -> Meeting:
    """No meeting."""
    return Meeting(False, np.inf, np.nan, np.nan, np.nan, False)


@inlined
def meet(ray: Shear, corners: F64Array, k: int, both_sides: bool) -> Meeting:
    """The line against triangle k; corners (n, 9) float64: x y z of each corner.

    both_sides: False: it is passed through from behind.
    """
    az = corners[k, ray.kz] - ray.oz
    bz = corners[k, 3 + ray.kz] - ray.oz
    cz = corners[k, 6 + ray.kz] - ray.oz
    ax = (corners[k, ray.kx] - ray.ox) - ray.sx * az
    ay = (corners[k, ray.ky] - ray.oy) - ray.sy * az
    bx = (corners[k, 3 + ray.kx] - ray.ox) - ray.sx * bz
    by = (corners[k, 3 + ray.ky] - ray.oy) - ray.sy * bz
    cx = (corners[k, 6 + ray.kx] - ray.ox) - ray.sx * cz
    cy = (corners[k, 6 + ray.ky] - ray.oy) - ray.sy * cz
    u = edge(cx, by, cy, bx)
    v = edge(ax, cy, ay, cx)
    w = edge(bx, ay, by, ax)
    inside = (u >= 0.0 and v >= 0.0 and w >= 0.0) or (u <= 0.0 and v <= 0.0 and w <= 0.0)
    area = u + v + w  # 0: seen edge-on, its neighbours are met
    front = (area > 0.0) == (ray.dz > 0.0)
    if not (inside and area != 0.0 and (front or both_sides)):
        return apart()
    u2, v2, w2 = edge_pair(cx, by, cy, bx), edge_pair(ax, cy, ay, cx), edge_pair(bx, ay, by, ax)
    det = add_pairs(add_pairs(u2, v2), w2)
    mean = add_pairs(add_pairs(scale_pair(u2, az), scale_pair(v2, bz)), scale_pair(w2, cz))
    t = divide_pairs(mean, det).hi / ray.dz
    return Meeting(True, t, u2.hi / det.hi, v2.hi / det.hi, w2.hi / det.hi, front)

"""Mirroring at a plane: a vector about a normal of any length, and the matrix of the plane.

For the plane n·x + d = 0, n of any length but 0, column vectors:

    M = | I − 2 n nᵀ/(n·n)   −2 d n/(n·n) |        x' = M·x
        |        0                 1      |

Each element of the matrix is rounded once: products, n·n and quotients are carried as pairs. With
D = d/|n|, M·M = I to 2u in the 3×3 block and 6u|D| in the last column; det M = −1; points on the
plane stay.
Source: Goldman, Matrices and Transformations, Graphics Gems, 1990, section "Mirror image".
"""

from typing import NamedTuple

import numpy as np

from .._jit import kernel
from .exact import Pair, divide_pairs, dot_twice, two_prod, two_sum
from .scaling import exponent, largest, times_power
from .vec import Vec3, dot, is_finite


@kernel
def reflect_any(incident: Vec3, normal: Vec3) -> Vec3:
    """d − 2 (d·n)/(n·n)·n for a normal of any length; zero or non-finite normals give NaN."""
    size = largest(normal.x, normal.y, normal.z)
    if not (is_finite(normal) and size > 0.0):
        return Vec3(np.nan, np.nan, np.nan)
    m = -exponent(size)
    n = Vec3(times_power(normal.x, m), times_power(normal.y, m), times_power(normal.z, m))
    k = 2.0 * dot(incident, n) / dot(n, n)
    return Vec3(incident.x - k * n.x, incident.y - k * n.y, incident.z - k * n.z)


class Mirror(NamedTuple):
    """The nine numbers of the matrix: a symmetric block and the last column."""

    xx: float
    xy: float
    xz: float
    yy: float
    yz: float
    zz: float
    x: float
    y: float
    z: float


@kernel
def _twice_quotient(a: float, b: float, square: Pair) -> Pair:
    """2·a·b/square as a pair."""
    q = divide_pairs(two_prod(a, b), square)
    return Pair(2.0 * q.hi, 2.0 * q.lo)


@kernel
def _one_minus(a: Pair) -> float:
    """1 − a."""
    head = two_sum(1.0, -a.hi)
    return head.hi + (head.lo - a.lo)


@kernel
def mirror(normal: Vec3, offset: float) -> Mirror:
    """Mirror at the plane normal·x + offset = 0; a zero or non-finite normal gives all NaN."""
    size = largest(normal.x, normal.y, normal.z)
    if not (is_finite(normal) and size > 0.0):
        nan = np.nan
        return Mirror(nan, nan, nan, nan, nan, nan, nan, nan, nan)
    m = -exponent(size)
    n = Vec3(times_power(normal.x, m), times_power(normal.y, m), times_power(normal.z, m))
    d = times_power(offset, m)
    square = dot_twice(n, n)
    return Mirror(
        _one_minus(_twice_quotient(n.x, n.x, square)),
        -_twice_quotient(n.x, n.y, square).hi,
        -_twice_quotient(n.x, n.z, square).hi,
        _one_minus(_twice_quotient(n.y, n.y, square)),
        -_twice_quotient(n.y, n.z, square).hi,
        _one_minus(_twice_quotient(n.z, n.z, square)),
        -_twice_quotient(d, n.x, square).hi,
        -_twice_quotient(d, n.y, square).hi,
        -_twice_quotient(d, n.z, square).hi,
    )

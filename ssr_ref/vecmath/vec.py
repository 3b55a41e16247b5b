"""Three-component vectors as NamedTuples: no allocation, and fields that read like the formula.

Sums run left to right; nothing is contracted. Positions and directions alike.
"""

from typing import NamedTuple

import numpy as np

from .._jit import fma, kernel


class Vec3(NamedTuple):
    """A float64 vector; the space is in the name of the variable that holds it."""

    x: float
    y: float
    z: float


@kernel
def add(a: Vec3, b: Vec3) -> Vec3:
    """a + b."""
    return Vec3(a.x + b.x, a.y + b.y, a.z + b.z)


@kernel
def sub(a: Vec3, b: Vec3) -> Vec3:
    """a − b."""
    return Vec3(a.x - b.x, a.y - b.y, a.z - b.z)


@kernel
def scale(a: Vec3, s: float) -> Vec3:
    """s·a."""
    return Vec3(a.x * s, a.y * s, a.z * s)


@kernel
def dot(a: Vec3, b: Vec3) -> float:
    """a·b, summed x, y, z."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@kernel
def difference_of_products(a: float, b: float, c: float, d: float) -> float:
    """a·b − c·d to 1.5 ulp (Kahan; Jeannerod, Louvet and Muller 2013, section 3)."""
    cd = c * d
    error = fma(-c, d, cd)
    return fma(a, b, -cd) + error


@kernel
def cross(a: Vec3, b: Vec3) -> Vec3:
    """a × b, each component to 1.5 ulp: slivers keep the direction of their normal."""
    return Vec3(
        difference_of_products(a.y, b.z, a.z, b.y),
        difference_of_products(a.z, b.x, a.x, b.z),
        difference_of_products(a.x, b.y, a.y, b.x),
    )


@kernel
def length(a: Vec3) -> float:
    """Euclidean length; no guard against overflow beyond 1e154."""
    return np.sqrt(dot(a, a))


@kernel
def normalize(a: Vec3) -> Vec3:
    """a / |a|; the zero vector gives NaN, which callers test for."""
    n = length(a)
    return Vec3(a.x / n, a.y / n, a.z / n)


@kernel
def reflect(incident: Vec3, normal: Vec3) -> Vec3:
    """Mirror `incident` (towards the surface) about the unit `normal`."""
    k = 2.0 * dot(incident, normal)
    return Vec3(incident.x - k * normal.x, incident.y - k * normal.y, incident.z - k * normal.z)


@kernel
def is_finite(a: Vec3) -> bool:
    """True if no component is NaN or infinite."""
    return bool(np.isfinite(a.x) and np.isfinite(a.y) and np.isfinite(a.z))

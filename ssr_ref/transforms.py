"""4×4 matrices on the host: strict products, closed-form inverses, no BLAS.

A matrix product through BLAS changes with the processor, so everything that reaches a golden goes
through these few functions: plain float arithmetic, every sum from left to right. Matrices are
float64 (4, 4) arrays that act on column vectors; names read target-from-source.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ._jit import driver
from .typed import AnyArray, F64Array


def identity() -> F64Array:
    """The 4×4 identity."""
    return np.eye(4, dtype=np.float64)


def multiply(a: AnyArray, b: AnyArray) -> F64Array:
    """a·b of two (4, 4) matrices, each element summed left to right."""
    out = np.empty((4, 4), np.float64)
    for i in range(4):
        for j in range(4):
            total = float(a[i, 0]) * float(b[0, j])
            for k in range(1, 4):
                total = total + float(a[i, k]) * float(b[k, j])
            out[i, j] = total
    return out


def translation(x: float, y: float, z: float) -> F64Array:
    """Translation by (x, y, z)."""
    out = identity()
    out[:3, 3] = (x, y, z)
    return out


def scaling(x: float, y: float, z: float) -> F64Array:
    """Scale along the axes."""
    out = identity()
    out[0, 0], out[1, 1], out[2, 2] = x, y, z
    return out


def from_quaternion(x: float, y: float, z: float, w: float) -> F64Array:
    """Rotation of the unit quaternion (x, y, z, w), the order of glTF; not renormalised."""
    out = identity()
    out[0, :3] = (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w))
    out[1, :3] = (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w))
    out[2, :3] = (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y))
    return out


def cofactors(m: AnyArray) -> F64Array:
    """Cofactor matrix (3, 3) of the upper-left block: det(m)·(m⁻¹)ᵀ, defined for any m."""
    a = [[float(m[i, j]) for j in range(3)] for i in range(3)]
    out = np.empty((3, 3), np.float64)
    for i in range(3):
        for j in range(3):
            r, s = (i + 1) % 3, (i + 2) % 3
            p, q = (j + 1) % 3, (j + 2) % 3
            out[i, j] = a[r][p] * a[s][q] - a[r][q] * a[s][p]
    return out


def determinant3(m: AnyArray) -> float:
    """Determinant of the upper-left 3×3 block."""
    c = cofactors(m)
    return float(m[0, 0]) * c[0, 0] + float(m[0, 1]) * c[0, 1] + float(m[0, 2]) * c[0, 2]


def rigid_inverse(m: AnyArray) -> F64Array:
    """Inverse of a rotation followed by a translation: the rotation transposed."""
    out = identity()
    for i in range(3):
        for j in range(3):
            out[i, j] = float(m[j, i])
        out[i, 3] = -(
            float(m[0, i]) * float(m[0, 3])
            + float(m[1, i]) * float(m[1, 3])
            + float(m[2, i]) * float(m[2, 3])
        )
    return out


def normalized3(v: Sequence[float] | AnyArray) -> tuple[float, float, float]:
    """v / |v| of three numbers; scaled first, so lengths from 1e-300 to 1e300 work."""
    x, y, z = (float(c) for c in v)
    largest = max(abs(x), abs(y), abs(z))
    if not (0.0 < largest < np.inf):
        return (np.nan, np.nan, np.nan)
    x, y, z = x / largest, y / largest, z / largest
    n = float(np.sqrt(x * x + y * y + z * z))
    return (x / n, y / n, z / n)


def cross3(
    a: tuple[float, float, float], b: tuple[float, float, float]
) -> tuple[float, float, float]:
    """a × b of three numbers each."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@driver(parallel=False)
def transform_points(m: F64Array, points: AnyArray, out: F64Array) -> None:
    """out[i] = m·(points[i], 1): x, y, z terms left to right, the translation last."""
    for i in range(points.shape[0]):
        x = np.float64(points[i, 0])
        y = np.float64(points[i, 1])
        z = np.float64(points[i, 2])
        for r in range(3):
            out[i, r] = m[r, 0] * x + m[r, 1] * y + m[r, 2] * z + m[r, 3]


@driver(parallel=False)
def transform_normals(c: F64Array, normals: AnyArray, out: F64Array) -> None:
    """out[i] = unit(c·normals[i]) with c a (3, 3) matrix; a zero or non-finite one gives zeros."""
    for i in range(normals.shape[0]):
        x = np.float64(normals[i, 0])
        y = np.float64(normals[i, 1])
        z = np.float64(normals[i, 2])
        a = c[0, 0] * x + c[0, 1] * y + c[0, 2] * z
        b = c[1, 0] * x + c[1, 1] * y + c[1, 2] * z
        d = c[2, 0] * x + c[2, 1] * y + c[2, 2] * z
        largest = max(abs(a), abs(b), abs(d))
        finite = np.isfinite(a) and np.isfinite(b) and np.isfinite(d)
        if finite and largest > 0.0:
            a /= largest
            b /= largest
            d /= largest
            n = np.sqrt(a * a + b * b + d * d)
            out[i, 0] = a / n
            out[i, 1] = b / n
            out[i, 2] = d / n
        else:
            out[i, 0] = 0.0
            out[i, 1] = 0.0
            out[i, 2] = 0.0

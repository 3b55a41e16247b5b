"""A unit vector as a point of the square [−1, 1]²: the octahedron |x| + |y| + |z| = 1 unfolded.

The upper half (z ≥ 0) is projected along z; the four lower faces are folded outwards over the
square's sides. sign(0) = sign(−0) = +1, so a fold edge has one code.
Source: Cigolle, Donow, Evangelakos, Mara, McGuire and Meyer, A Survey of Efficient Representations
for Independent Unit Vectors, JCGT 3(2), 2014, section 3.7 and listings 1 and 2.

Differs here: a lower face is computed as |x| + |z| over the sum, not as 1 − |y| over the sum, which
cancels near the equator and loses every digit of a small coordinate.
"""

from __future__ import annotations

import numpy as np

from .._jit import kernel
from .vec import Vec3, normalize

_NAN = float("nan")


@kernel
def sign_not_zero(x: float) -> float:
    """+1 for x ≥ 0, so for both zeros; −1 otherwise."""
    return 1.0 if x >= 0.0 else -1.0


@kernel
def octahedral_encode(d: Vec3) -> tuple[float, float]:
    """(u, v) in [−1, 1]² of a direction of any length.

    NaN, NaN for the zero vector, for a NaN or infinity, and where |x| + |y| + |z| overflows.
    """
    ax, ay, az = abs(d.x), abs(d.y), abs(d.z)
    total = ax + ay + az
    if not (total > 0.0 and np.isfinite(total)):
        return _NAN, _NAN
    if d.z < 0.0:
        return (
            sign_not_zero(d.x) * ((ax + az) / total),
            sign_not_zero(d.y) * ((ay + az) / total),
        )
    return d.x / total, d.y / total


@kernel
def octahedral_decode(u: float, v: float) -> Vec3:
    """The unit vector of a code; NaN in every component outside [−1, 1]² and for NaN."""
    au, av = abs(u), abs(v)
    if not (au <= 1.0 and av <= 1.0):
        return Vec3(_NAN, _NAN, _NAN)
    z = (1.0 - au) - av
    if z < 0.0:
        return normalize(Vec3(sign_not_zero(u) * (1.0 - av), sign_not_zero(v) * (1.0 - au), z))
    return normalize(Vec3(u, v, z))

"""Logarithmic depth: two formulas in use, both from 0 to 1.

    with a constant C (metres⁻¹ or the like)   d = log(1 + C·z) / log(1 + C·f)    0 at the eye
    from near to far                           d = log(z/n) / log(f/n)            0 at near

The first is Brano Kemen, Logarithmic Depth Buffer, 2009 (OpenGL's clip value is 2·d − 1); with
C = 1 it is what `logarithmicDepthBuffer` of three.js's WebGLRenderer writes. The second is Thatcher
Ulrich, log depth buffer, and three.js's `viewZToLogarithmicDepth`.

2^x − 1 and log2(1 + x) cancel near x = 0; the quotients below undo the rounding of 1 + x (Higham,
Accuracy and Stability of Numerical Algorithms, 2nd ed., section 1.14.1 and problem 1.5).
"""

import numpy as np

from .._jit import kernel
from ..vecmath.elementary import exp2, log2
from ..vecmath.elementary import pow as power

_LN_2 = 0.6931471805599453
_ONE_OVER_LN_2 = 1.4426950408889634


@kernel
def exp2_minus_1(x: float) -> float:
    """2^x − 1 for x ≥ 0, to 4 · 2⁻⁵³."""
    y = exp2(x)
    if y == 1.0:
        return x * _LN_2
    if y > 2.0:
        return y - 1.0
    return (y - 1.0) * (x / log2(y))


@kernel
def log2_1_plus(x: float) -> float:
    """log2(1 + x) for x ≥ 0, to 4 · 2⁻⁵³."""
    y = 1.0 + x
    if y == 1.0:
        return x * _ONE_OVER_LN_2
    if y > 2.0:
        return log2(y)
    return log2(y) * (x / (y - 1.0))


@kernel
def log2_ratio(z: float, near: float) -> float:
    """log2(z/near) for z ≥ near; z − near is exact where the quotient is close to 1."""
    if z > 2.0 * near:
        return log2(z / near)
    return log2_1_plus((z - near) / near)


@kernel
def log_depth(d: float, far: float, constant: float) -> float:
    """z of d = log(1 + C·z)/log(1 + C·far); NaN outside [0, 1]; 0 gives 0 and 1 gives far."""
    if not (d >= 0.0 and d <= 1.0):
        return np.nan
    if d == 1.0:
        return far
    depth = exp2_minus_1(d * log2_1_plus(constant * far)) / constant
    return depth if depth < far else far


@kernel
def log_device(depth: float, far: float, constant: float) -> float:
    """log(1 + C·z)/log(1 + C·far); NaN outside [0, far]."""
    if not (depth >= 0.0 and depth <= far):
        return np.nan
    d = log2_1_plus(constant * depth) / log2_1_plus(constant * far)
    return d if d < 1.0 else 1.0


@kernel
def log_near_depth(d: float, near: float, far: float) -> float:
    """near·(far/near)^d; NaN outside [0, 1]; 0 gives near and 1 gives far."""
    if not (d >= 0.0 and d <= 1.0):
        return np.nan
    if d == 1.0:
        return far
    depth = near * power(far / near, d)
    return depth if depth < far else far


@kernel
def log_near_device(depth: float, near: float, far: float) -> float:
    """log(z/near)/log(far/near), for z in [near, far]."""
    d = log2_ratio(depth, near) / log2_ratio(far, near)
    return d if d < 1.0 else 1.0

"""Exact scaling by powers of two, so that squares neither over- nor underflow.

Whole formulas whose every term has the same degree give the same bits whatever the power is:
scaling by it costs no rounding and keeps answers invariant under a change of unit by 2ᵏ.
"""

import numpy as np

from .._jit import kernel

_LOWEST, _HIGHEST = -1022, 1022
_BIAS = 1023
_POWERS = np.array([float.fromhex(f"0x1p{n}") for n in range(_LOWEST, _HIGHEST + 1)])


@kernel
def exponent(x: float) -> int:
    """n with 2ⁿ ≤ |x| < 2ⁿ⁺¹, at least −1022 and at most 1022; −1022 for 0 and subnormal x."""
    bits = np.float64(x).view(np.int64)
    n = ((bits >> 52) & 0x7FF) - _BIAS
    return min(max(n, _LOWEST), _HIGHEST)


@kernel
def times_power(x: float, n: int) -> float:
    """x·2ⁿ in the type of x, |n| ≤ 2044; rounded only where the result is subnormal, else exact."""
    first = n >> 1
    scaled = np.float64(x) * _POWERS[first - _LOWEST] * _POWERS[n - first - _LOWEST]
    return type(x)(scaled)


@kernel
def largest(x: float, y: float, z: float) -> float:
    """max(|x|, |y|, |z|) of three numbers, none NaN, in their type."""
    most = abs(x)
    if abs(y) > most:
        most = abs(y)
    if abs(z) > most:
        most = abs(z)
    return most


@kernel
def unit_roundoff(x: float) -> float:
    """u of the type of x: 2⁻⁵³ for float64, 2⁻²⁴ for float32."""
    one = type(x)(1.0)
    if one + type(x)(2.0**-30) == one:
        return type(x)(2.0**-24)
    return type(x)(2.0**-53)

"""Numbers of twice the precision as pairs hi + lo, for sums that cancel.

Products are split exactly with a fused multiply-add, sums by Knuth's two-sum; a pair carries about
104 bits. Used where a rounded intermediate would decide the result, not for speed.
Source: Dekker 1971; Knuth, The Art of Computer Programming 2, 4.2.2; Ogita, Rump and Oishi 2005.
"""

from typing import NamedTuple

from .._jit import fma, kernel
from .vec import Vec3


class Pair(NamedTuple):
    """hi + lo with |lo| at most half an ulp of hi."""

    hi: float
    lo: float


@kernel
def two_sum(a: float, b: float) -> Pair:
    """a + b exactly."""
    s = a + b
    t = s - a
    return Pair(s, (a - (s - t)) + (b - t))


@kernel
def two_prod(a: float, b: float) -> Pair:
    """a·b exactly, unless it overflows or its error term underflows (|a·b| < 2**-969)."""
    p = a * b
    return Pair(p, fma(a, b, -p))


@kernel
def two_difference(a: float, b: float) -> Pair:
    """a − b exactly."""
    return two_sum(a, -b)


@kernel
def add_pairs(a: Pair, b: Pair) -> Pair:
    """a + b, also where they cancel."""
    high = two_sum(a.hi, b.hi)
    low = two_sum(a.lo, b.lo)
    first = two_sum(high.hi, high.lo + low.hi)
    return two_sum(first.hi, first.lo + low.lo)


@kernel
def subtract_pairs(a: Pair, b: Pair) -> Pair:
    """a − b, also where they cancel."""
    return add_pairs(a, Pair(-b.hi, -b.lo))


@kernel
def multiply_pairs(a: Pair, b: Pair) -> Pair:
    """a·b."""
    product = a.hi * b.hi
    error = fma(a.hi, b.hi, -product) + (a.hi * b.lo + a.lo * b.hi)
    return two_sum(product, error)


@kernel
def divide_pairs(a: Pair, b: Pair) -> Pair:
    """a / b, one step of long division after the leading quotient."""
    quotient = a.hi / b.hi
    rest = fma(-quotient, b.hi, a.hi) + (a.lo - quotient * b.lo)
    return two_sum(quotient, rest / b.hi)


@kernel
def dot_twice(a: Vec3, b: Vec3) -> Pair:
    """a·b as if summed in twice the precision: off by u² · 10 Σ|aᵢbᵢ| (Ogita, Rump, Oishi 2005)."""
    x, y, z = two_prod(a.x, b.x), two_prod(a.y, b.y), two_prod(a.z, b.z)
    first = two_sum(x.hi, y.hi)
    second = two_sum(first.hi, z.hi)
    return two_sum(second.hi, second.lo + (first.lo + (x.lo + (y.lo + z.lo))))


class PairVec3(NamedTuple):
    """A vector of pairs."""

    x: Pair
    y: Pair
    z: Pair


@kernel
def difference_of_points(a: Vec3, b: Vec3) -> PairVec3:
    """a − b exactly."""
    return PairVec3(two_difference(a.x, b.x), two_difference(a.y, b.y), two_difference(a.z, b.z))


@kernel
def cross_pairs(a: PairVec3, b: PairVec3) -> PairVec3:
    """a × b."""
    return PairVec3(
        subtract_pairs(multiply_pairs(a.y, b.z), multiply_pairs(a.z, b.y)),
        subtract_pairs(multiply_pairs(a.z, b.x), multiply_pairs(a.x, b.z)),
        subtract_pairs(multiply_pairs(a.x, b.y), multiply_pairs(a.y, b.x)),
    )


@kernel
def scale_pair(a: Pair, b: float) -> Pair:
    """b·a."""
    return multiply_pairs(a, Pair(b, 0.0))


@kernel
def dot_pairs(a: PairVec3, b: Vec3) -> Pair:
    """a·b."""
    first = add_pairs(scale_pair(a.x, b.x), scale_pair(a.y, b.y))
    return add_pairs(first, scale_pair(a.z, b.z))

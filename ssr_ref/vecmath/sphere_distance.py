"""Line against sphere by the distance of the centre from the line: the default form.

Subtracting o − c, the closest approach l and the power C are carried exactly or as if in twice the
precision, so that a small sphere far away and a huge one close by lose nothing. A hit point is
o + t·d or c + l ± half·d, whichever has the smaller error bound: the first is surer near the
origin, the second for a small sphere far away. See `sphere.py` for letters, contract and sources.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from .._jit import fma, kernel
from .exact import Pair, PairVec3, difference_of_points, dot_twice, two_prod, two_sum
from .scaling import times_power, unit_roundoff
from .vec import Vec3, dot


class SphereOutcome(IntEnum):
    """How a line meets a sphere; up to TWO, the number of distinct roots."""

    MISS = 0
    TANGENT = 1
    TWO = 2
    INVALID = 3


MISS, TANGENT = int(SphereOutcome.MISS), int(SphereOutcome.TANGENT)
TWO, INVALID = int(SphereOutcome.TWO), int(SphereOutcome.INVALID)


class SphereHit(NamedTuple):
    """Both meetings, t0 ≤ t1, with bounds on the errors (+inf: the form promises nothing).

    A t error is absolute; a point error is the distance between the given and the true point.
    """

    outcome: int
    t0: float
    t1: float
    point0: Vec3
    point1: Vec3
    t0_error: float
    t1_error: float
    point0_error: float
    point1_error: float


class Frame(NamedTuple):
    """A line and a sphere as given, and scaled: lengths by 2⁻ⁿ, the direction by 2⁻ᵐ."""

    o: Vec3
    d: Vec3
    c: Vec3
    unit_d: Vec3
    radius: float  # scaled
    n: int
    m: int


class Approach(NamedTuple):
    """Roots of DISTANCE in scaled units, ordered, and how far each number may be off."""

    outcome: int
    t0: float
    t1: float
    t0_error: float
    t1_error: float
    l: Vec3  # closest approach, from the centre  # noqa: E741
    half: float  # half the chord, in units of d
    offset_error: float  # of l ± half·d
    length_d: float


@kernel
def no_meeting(outcome: int, like: float) -> SphereHit:
    """A miss or a refusal: all NaN, in the type of `like`."""
    nan = type(like)(np.nan)
    nowhere = Vec3(nan, nan, nan)
    return SphereHit(outcome, nan, nan, nowhere, nowhere, nan, nan, nan, nan)


@kernel
def along_fused(o: Vec3, t: float, d: Vec3) -> Vec3:
    """o + t·d, each component rounded once."""
    return Vec3(fma(t, d.x, o.x), fma(t, d.y, o.y), fma(t, d.z, o.z))


@kernel
def one_norm(a: Vec3) -> float:
    """|x| + |y| + |z|, at least the length."""
    return abs(a.x) + abs(a.y) + abs(a.z)


@kernel
def scale_exactly(a: Pair, n: int) -> Pair:
    """a·2ⁿ."""
    return Pair(times_power(a.hi, n), times_power(a.lo, n))


@kernel
def power_of_origin(f: PairVec3, high: Vec3, r: float) -> float:
    """f·f − r² to 1 ulp and u² (f·f + r²)."""
    squares = dot_twice(high, high)
    radius = two_prod(r, r)
    total = two_sum(squares.hi, -radius.hi)
    low = high.x * f.x.lo + high.y * f.y.lo + high.z * f.z.lo
    return total.hi + (total.lo + ((squares.lo - radius.lo) + (low + low)))


@kernel
def approach_roots(f: PairVec3, d: Vec3, r: float) -> Approach:
    """Roots of DISTANCE; f exact, every length and |d| between ½ and 4 or smaller.

    Errors, to first order in u: l is rounded three times, 3u‖l‖; s once beside the l·d of its
    correction, u|s| + 7u‖l‖/|d|; Δ four times, 4u r² + 2‖l‖·3u‖l‖. Norms of the bounds are sums
    of magnitudes, counts are rounded up to cover u².
    """
    zero = type(r)(0.0)
    u = unit_roundoff(r)
    high = Vec3(f.x.hi, f.y.hi, f.z.hi)
    a = dot_twice(d, d).hi
    length_d = np.sqrt(a)

    # Closest approach: the error of s moves l along d, where the second step removes it.
    s = -dot(high, d) / a
    first = along_fused(high, s, d)
    first = Vec3(first.x + f.x.lo, first.y + f.y.lo, first.z + f.z.lo)
    step = -dot(first, d) / a
    l = along_fused(first, step, d)  # noqa: E741
    s = s + step
    size_l = one_norm(first)
    l_error = type(r)(4.0) * u * size_l
    s_error = u * (abs(s) + type(r)(8.0) * size_l / length_d)

    # Δ = r² − l·l, one rounding a term.
    square = r * r
    delta = fma(-l.x, l.x, square)
    delta = fma(-l.y, l.y, delta)
    delta = fma(-l.z, l.z, delta) + fma(r, r, -square)
    delta_error = type(r)(5.0) * u * square + type(r)(2.0) * size_l * l_error
    c = power_of_origin(f, high, r)
    if delta < zero:
        if c > zero:
            return Approach(MISS, s, s, zero, zero, l, zero, zero, length_d)
        delta = zero

    # |√Δ − √Δ'| is at most |Δ − Δ'|/√Δ and at most √|Δ − Δ'|.
    root = np.sqrt(delta)
    root_error = np.sqrt(delta_error)
    if root > root_error:
        root_error = delta_error / root
    half = root / length_d
    half_error = root_error / length_d + type(r)(4.0) * u * half
    offset_error = l_error + root_error + type(r)(8.0) * u * root
    if root == zero and c > zero:
        error = s_error + half_error
        return Approach(TANGENT, s, s, error, error, l, half, offset_error, length_d)

    # The far root adds two numbers of one sign; the near one is C/(a·far), unless far itself is not
    # known from 0.
    far = s - half if s < zero else s + half
    far_error = s_error + half_error + u * abs(far)
    size_far = abs(far)
    if far_error < type(r)(0.25) * size_far:
        c_error = type(r)(16.0) * u * u * (square + dot(high, high))
        near = c / (a * far)
        near_error = abs(near) * (type(r)(5.0) * u + far_error / (size_far - far_error))
        near_error += type(r)(2.0) * c_error / (a * size_far)
    else:
        near = s + half if s < zero else s - half
        near_error = s_error + half_error + u * abs(near)
        if c == zero:
            near = zero
    outcome = TANGENT if far == zero else TWO
    if near <= far:
        return Approach(outcome, near, far, near_error, far_error, l, half, offset_error, length_d)
    return Approach(outcome, far, near, far_error, near_error, l, half, offset_error, length_d)


@kernel
def on_sphere(c: Vec3, l: Vec3, half: float, d: Vec3, r: float, n: int) -> Vec3:  # noqa: E741
    """c + (l + half·d) brought back to length r, of lengths scaled by 2⁻ⁿ."""
    p = along_fused(l, half, d)
    size = np.sqrt(dot(p, p))
    k = r / size if size > type(r)(0.0) else type(r)(1.0)
    return Vec3(
        c.x + times_power(p.x * k, n), c.y + times_power(p.y * k, n), c.z + times_power(p.z * k, n)
    )


@kernel
def scaled_root(t: float, error: float, n: int) -> tuple[float, float]:
    """t·2ⁿ, and the error in units of t with what is lost where that is subnormal or infinite."""
    scaled = times_power(t, n)
    return scaled, error + abs(times_power(scaled, -n) - t)


@kernel
def surer_point(g: Frame, e: Approach, t: float, error: float, half: float) -> tuple[Vec3, float]:
    """The meeting at t = half a chord from the closest approach, and its error in true units.

    error : of t, in scaled units.
    """
    u = unit_roundoff(t)
    by_t = along_fused(g.o, t, g.d)
    by_t_error = times_power(error * e.length_d, g.n) + u * one_norm(by_t)
    by_chord = on_sphere(g.c, e.l, half, g.unit_d, g.radius, g.n)
    offset_error = e.offset_error + type(t)(6.0) * u * g.radius
    by_chord_error = times_power(offset_error, g.n) + u * one_norm(by_chord)
    if by_t_error < by_chord_error:
        return by_t, by_t_error
    return by_chord, by_chord_error


@kernel
def intersect_by_distance(g: Frame) -> SphereHit:
    """The DISTANCE form of `sphere.intersect`."""
    f = difference_of_points(g.o, g.c)
    f = PairVec3(scale_exactly(f.x, -g.n), scale_exactly(f.y, -g.n), scale_exactly(f.z, -g.n))
    e = approach_roots(f, g.unit_d, g.radius)
    if e.outcome == MISS:
        return no_meeting(MISS, g.radius)
    t0, t0_error = scaled_root(e.t0, e.t0_error, g.n - g.m)
    t1, t1_error = scaled_root(e.t1, e.t1_error, g.n - g.m)
    point0, point0_error = surer_point(g, e, t0, t0_error, -e.half)
    point1, point1_error = surer_point(g, e, t1, t1_error, e.half)
    t0_error, t1_error = times_power(t0_error, g.n - g.m), times_power(t1_error, g.n - g.m)
    return SphereHit(
        e.outcome, t0, t1, point0, point1, t0_error, t1_error, point0_error, point1_error
    )

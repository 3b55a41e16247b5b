"""Where a line meets a sphere, in six formulations that differ only in how they round.

Line o + t·d, centre c, radius r; f = o − c, a = d·d, b = −f·d, C = f·f − r² (the power of the
origin), l = f + (b/a)·d the closest approach seen from the centre, Δ = r² − l·l:

    TEXTBOOK       (b ± √(b² − aC)) / a, written with 2b and 4aC
    TEXTBOOK_UNIT  the same with a = 1 taken for granted
    STABLE         q = b + sign(b)·√(b² − aC), roots q/a and C/q: no cancellation in the roots
    KAHAN          STABLE with b² − aC to 1.5 ulp by fused multiply-add
    HEARN_BAKER    q form with √(aΔ): the discriminant from the distance, plain arithmetic
    DISTANCE       the same with l, b and C as if in twice the precision, and error bounds

Contract (the last four forms; the first two keep it only where nothing cancels or overflows):

    case                                     answer
    NaN or inf in an input, d = 0, r < 0     INVALID, all NaN (every form)
    the line passes by                       MISS, all NaN
    Δ = 0 as computed                        TANGENT, t0 = t1
    origin inside (C < 0)                    TWO, t0 < 0 < t1, whatever Δ rounds to
    origin on the sphere (C = 0)             a root that is exactly 0
    origin at the centre (b = ±0)            TWO, −r/|d| and +r/|d|
    r = 0                                    TANGENT where the distance computes as 0, else MISS
    r = 0, o = c                             TANGENT at t = 0
    |d| ≠ 1, from 1e-300 to 1e300            t in units of d; scaled inside by powers of two
    all lengths · 2ᵏ, or d · 2ᵏ              the same bits, scaled
    t beyond the range of the type           ±inf or 0, its error bound says so

The answer is that of the whole line: a ray takes the first root at or above its own start.

Sources: Haines, Günther and Akenine-Möller, Precision Improvements for Ray/Sphere Intersection,
Ray Tracing Gems, chapter 7, 2019; Hearn and Baker, Computer Graphics with OpenGL; W. Kahan, On the
Cost of Floating-Point Computation Without Extra-Precise Arithmetic, 2004; re-projection from Pharr,
Jakob and Humphreys, Physically Based Rendering, section 6.8. What differs here: nothing is rounded
before it cancels, and q = 0 is handled.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from .._jit import kernel
from .scaling import exponent, largest, times_power
from .sphere_distance import (
    INVALID,
    MISS,
    TANGENT,
    TWO,
    Frame,
    SphereHit,
    intersect_by_distance,
    no_meeting,
)
from .vec import Vec3, difference_of_products, dot, is_finite, sub


class SphereForm(IntEnum):
    """The formulations, in the order of the module's docstring."""

    TEXTBOOK = 0
    TEXTBOOK_UNIT = 1
    STABLE = 2
    KAHAN = 3
    HEARN_BAKER = 4
    DISTANCE = 5


TEXTBOOK, TEXTBOOK_UNIT = int(SphereForm.TEXTBOOK), int(SphereForm.TEXTBOOK_UNIT)
KAHAN, HEARN_BAKER = int(SphereForm.KAHAN), int(SphereForm.HEARN_BAKER)
DISTANCE = int(SphereForm.DISTANCE)


class Roots(NamedTuple):
    """Roots of one form in scaled units, before they are put in order."""

    outcome: int
    t0: float
    t1: float


@kernel
def along(o: Vec3, t: float, d: Vec3) -> Vec3:
    """o + t·d in plain arithmetic."""
    return Vec3(o.x + t * d.x, o.y + t * d.y, o.z + t * d.z)


@kernel
def plain_meeting(outcome: int, o: Vec3, d: Vec3, t0: float, t1: float) -> SphereHit:
    """Points by o + t·d, and no bounds."""
    unknown = type(t0)(np.inf)
    return SphereHit(
        outcome, t0, t1, along(o, t0, d), along(o, t1, d), unknown, unknown, unknown, unknown
    )


@kernel
def textbook_roots(form: int, f: Vec3, d: Vec3, r: float) -> Roots:
    """The quadratic formula as it is printed; TEXTBOOK_UNIT takes d·d = 1 for granted."""
    two, four = type(r)(2.0), type(r)(4.0)
    a = dot(d, d)
    if form == TEXTBOOK_UNIT:
        a = type(r)(1.0)
    b = two * dot(f, d)
    c = dot(f, f) - r * r
    discriminant = b * b - four * a * c
    if discriminant < type(r)(0.0):
        return Roots(MISS, b, b)
    root = np.sqrt(discriminant)
    outcome = TANGENT if root == type(r)(0.0) else TWO
    return Roots(outcome, (-b - root) / (two * a), (-b + root) / (two * a))


@kernel
def q_roots(form: int, f: Vec3, d: Vec3, r: float) -> Roots:
    """The three plain q forms: they differ in the discriminant alone."""
    zero = type(r)(0.0)
    a = dot(d, d)
    b = -dot(f, d)
    c = dot(f, f) - r * r
    if form == HEARN_BAKER:
        s = b / a
        l = Vec3(f.x + s * d.x, f.y + s * d.y, f.z + s * d.z)  # noqa: E741
        discriminant = a * (r * r - dot(l, l))
    elif form == KAHAN:
        discriminant = difference_of_products(b, b, a, c)
    else:
        discriminant = b * b - a * c

    # From inside or from the surface the line always meets the sphere.
    if discriminant < zero:
        if c > zero:
            return Roots(MISS, zero, zero)
        discriminant = zero
    root = np.sqrt(discriminant)
    q = b + root if b >= zero else b - root  # sign(±0) is +1
    if q == zero:
        return Roots(TANGENT, zero, zero)
    if root == zero and c > zero:
        return Roots(TANGENT, q / a, q / a)
    return Roots(TWO, q / a, c / q)


@kernel
def intersect(form: int, o: Vec3, d: Vec3, c: Vec3, r: float) -> SphereHit:
    """Line o + t·d against the sphere of centre c and radius r by one of the forms.

    All numbers are of one type, float64 or float32, and so are the results.
    """
    zero = type(r)(0.0)
    f = sub(o, c)
    size_d = largest(d.x, d.y, d.z)
    valid = is_finite(f) and is_finite(o) and is_finite(d) and np.isfinite(r)
    if not (valid and r >= zero and size_d > zero):
        return no_meeting(INVALID, r)
    if form == TEXTBOOK or form == TEXTBOOK_UNIT:
        roots = textbook_roots(form, f, d, r)
        if roots.outcome == MISS:
            return no_meeting(MISS, r)
        return plain_meeting(roots.outcome, o, d, roots.t0, roots.t1)

    # Bring lengths and direction near 1; t scales by the quotient.
    size_f = largest(f.x, f.y, f.z)
    n = exponent(r if r > size_f else size_f)
    m = exponent(size_d)
    unit_d = Vec3(times_power(d.x, -m), times_power(d.y, -m), times_power(d.z, -m))

    frame = Frame(o, d, c, unit_d, times_power(r, -n), n, m)
    if form == DISTANCE:
        return intersect_by_distance(frame)

    f = Vec3(times_power(f.x, -n), times_power(f.y, -n), times_power(f.z, -n))
    roots = q_roots(form, f, unit_d, frame.radius)
    if roots.outcome == MISS:
        return no_meeting(MISS, r)
    t0, t1 = times_power(roots.t0, n - m), times_power(roots.t1, n - m)
    if t1 < t0:
        t0, t1 = t1, t0
    return plain_meeting(roots.outcome, o, d, t0, t1)

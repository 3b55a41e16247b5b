"""Elementary functions whose bytes are the same on every x86-64 CPU, compiled or interpreted.

Only + − × ÷, comparisons, floor and rint in strict float64 are used, never libm. The leading terms
are carried as an unevaluated sum head + tail (T. J. Dekker, A floating-point technique for
extending the available precision, Numer. Math. 18, 1971), so one rounding dominates: every kernel
stays below 0.9 ulp. Arguments must be float64; special cases follow C99, Annex F.9.

Polynomials are Chebyshev fits of 60 digits (`mpmath.chebyfit`), rounded to float64, highest power
first; the comment above each is the call that repeats it. `tests/test_elementary.py` repeats them
all, measures the errors stated here and compares compiled with interpreted bytes.
"""

from __future__ import annotations

import numpy as np

from .._jit import driver, kernel

# _POWER[n + 1022] = 2**n for every normal exponent n, exactly.
_LOWEST = 1022
_POWER = np.array([float.fromhex(f"0x1p{n}") for n in range(-_LOWEST, 1024)])
_SPLITTER = 2.0**27 + 1.0  # Veltkamp: halves a 53-bit significand
_SQRT_2 = 1.4142135623730951
_INF = float("inf")
_NAN = float("nan")

# Arguments of sin, cos and tan: n = rint(x·2/π) must fit 20 bits, so that n·(33 bits) is exact.
TRIG_RANGE = 2.0**20
_TRIG_TINY = 2.0**-27  # below it sin x = tan x = x and cos x = 1, to 0.4 ulp

# π/2 = A + B + C + D: three parts of 33 bits and the rest, 152 bits in all.
_TWO_OVER_PI = 0.6366197723675814
_HALF_PI_A = 1.5707963267341256
_HALF_PI_B = 6.077100506303966e-11
_HALF_PI_C = 2.0222662487111665e-21
_HALF_PI_D = 8.4784276603689e-32

# k·π/4 for k = 0..4, head and tail.
_OCTANT_HEAD = (0.0, 0.7853981633974483, 1.5707963267948966, 2.356194490192345, 3.141592653589793)
_OCTANT_TAIL = (
    0.0,
    3.061616997868383e-17,
    6.123233995736766e-17,
    9.184850993605148e-17,
    1.2246467991473532e-16,
)
_TAN_PI_8 = 0.4142135623730951
_ATAN_TINY = 2.0**-28  # below it atan q = q to 0.01 ulp

# ln 2, and 2/((2k + 1)·ln 2) for k = 0, 1, 2, each head and tail.
_LN2_HEAD, _LN2_TAIL = 0.6931471805599453, 2.3190468138462996e-17
_LOG_0_HEAD, _LOG_0_TAIL = 2.8853900817779268, 4.0710547481862066e-17
_LOG_1_HEAD, _LOG_1_TAIL = 0.9617966939259756, 5.0577616648125907e-17
_LOG_2_HEAD, _LOG_2_TAIL = 0.5770780163555853, 5.2551030481378675e-17

# (exp h − 1 − h)/h²: chebyfit(lambda h: hyp1f1(1, 3, h) / 2, [-log(2) / 2, log(2) / 2], 12)
_EXP = (
    1.6086622436215554e-10,
    2.0918129454967065e-09,
    2.5052071109214447e-08,
    2.755726330147475e-07,
    2.755731924720479e-06,
    2.480158733642132e-05,
    0.00019841269841263304,
    0.0013888888888879082,
    0.008333333333333333,
    0.04166666666666668,
    0.16666666666666666,
    0.5,
)
# chebyfit(lambda z: 2 / log(2) * (atanh(sqrt(z)) / sqrt(z) - 1 - z / 3 - z**2 / 5) / z**3,
#          [0, (sqrt(2) - 1)**4], 8)
_LOG = (
    0.15317133249418124,
    0.15109210366035794,
    0.1697482179615719,
    0.1923590696777991,
    0.22195308523723004,
    0.2623081892450772,
    0.3205988979753357,
    0.4121985831111324,
)
# chebyfit(lambda z: (sin(sqrt(z)) / sqrt(z) - 1) / z, [0, (pi / 4)**2], 7)
_SIN = (
    -7.586697117706918e-13,
    1.6058531618986147e-10,
    -2.5052106232447578e-08,
    2.7557319219339167e-06,
    -0.00019841269841265065,
    0.008333333333333331,
    -0.16666666666666666,
)
# chebyfit(lambda z: (cos(sqrt(z)) - 1 + z / 2) / z**2, [0, (pi / 4)**2], 7)
_COS = (
    4.7458719020432915e-14,
    -1.1470460887609959e-11,
    2.087675579108042e-09,
    -2.7557319221402824e-07,
    2.4801587301584645e-05,
    -0.0013888888888888887,
    0.041666666666666664,
)
# chebyfit(lambda z: (atan(sqrt(z)) / sqrt(z) - 1) / z, [0, (sqrt(2) - 1)**2], 13)
_ATAN = (
    -0.01391822929102443,
    0.030635704112969498,
    -0.04104436265755082,
    0.04719395030027433,
    -0.05258041554297779,
    0.058819252531928636,
    -0.06666642020055166,
    0.07692306736000173,
    -0.0909090906700999,
    0.11111111110754729,
    -0.14285714285711518,
    0.19999999999999993,
    -0.3333333333333333,
)


# --- Sums and products as head + tail -------------------------------------------------------------


@kernel
def _two_sum(a: float, b: float) -> tuple[float, float]:
    """a + b exactly as head + tail (Knuth)."""
    head = a + b
    b_part = head - a
    return head, (a - (head - b_part)) + (b - b_part)


@kernel
def _fast_two_sum(a: float, b: float) -> tuple[float, float]:
    """a + b exactly as head + tail, for |a| ≥ |b| or a = 0 (Dekker)."""
    head = a + b
    return head, b - (head - a)


@kernel
def _two_product(a: float, b: float) -> tuple[float, float]:
    """a·b exactly as head + tail, for |a|, |b| < 2**996 and a product above 2**-969 (Dekker)."""
    scaled = _SPLITTER * a
    a_high = scaled - (scaled - a)
    a_low = a - a_high
    scaled = _SPLITTER * b
    b_high = scaled - (scaled - b)
    b_low = b - b_high
    head = a * b
    return head, ((a_high * b_high - head) + a_high * b_low + a_low * b_high) + a_low * b_low


@kernel
def _multiply(a: float, a_tail: float, b: float, b_tail: float) -> tuple[float, float]:
    """(a + a_tail)·(b + b_tail) to about 2**-102."""
    head, tail = _two_product(a, b)
    return _fast_two_sum(head, tail + (a * b_tail + a_tail * b))


@kernel
def _add(a: float, a_tail: float, b: float, b_tail: float) -> tuple[float, float]:
    """(a + a_tail) + (b + b_tail) to about 2**-102 where the heads do not cancel."""
    head, tail = _two_sum(a, b)
    return _fast_two_sum(head, tail + (a_tail + b_tail))


@kernel
def _horner(z: float, coefficients: tuple[float, ...]) -> float:
    """Polynomial in z, highest power first."""
    total = 0.0
    for coefficient in coefficients:
        total = total * z + coefficient
    return total


# --- Powers and logarithms ------------------------------------------------------------------------


@kernel
def _power(n: int) -> float:
    """2**n for a normal exponent n, −1022..1023."""
    return float(_POWER[n + _LOWEST])


@kernel
def _split_exponent(x: float) -> tuple[float, float]:
    """x = m·2**e exactly, √½ ≤ m ≤ √2, for finite x > 0."""
    m = x
    exponent = 0.0
    if m < _power(-_LOWEST):  # subnormal
        m *= _power(54)
        exponent = -54.0

    # Bring m into [1, 2) by a binary search for the exponent.
    below_one = m < 1.0
    step = 512
    while step > 0:
        if below_one:
            if m < _power(1 - step):
                m *= _power(step)
                exponent -= step
        elif m >= _power(step):
            m *= _power(-step)
            exponent += step
        step >>= 1

    if m > _SQRT_2:
        m *= 0.5
        exponent += 1.0
    return m, exponent


@kernel
def _log2_pair(x: float) -> tuple[float, float]:
    """log2 x as head + tail to 2**-68 relative, for finite x > 0.

    s = (m − 1)/(m + 1), z = s² ≤ 0.0295: log2 x = e + s·(c0 + z·(c1 + z·(c2 + z·P(z)))).
    """
    m, exponent = _split_exponent(x)

    # Divide with the remainder, so that s has a tail.
    numerator = m - 1.0  # exact
    denominator, denominator_tail = _two_sum(m, 1.0)
    s = numerator / denominator
    product, product_tail = _two_product(s, denominator)
    s_tail = (((numerator - product) - product_tail) - s * denominator_tail) / denominator

    # Sum the series; only its tail P is in plain float64.
    z, z_tail = _multiply(s, s_tail, s, s_tail)
    head, tail = _add(_LOG_2_HEAD, _LOG_2_TAIL, z * _horner(z, _LOG), 0.0)
    head, tail = _multiply(z, z_tail, head, tail)
    head, tail = _add(_LOG_1_HEAD, _LOG_1_TAIL, head, tail)
    head, tail = _multiply(z, z_tail, head, tail)
    head, tail = _add(_LOG_0_HEAD, _LOG_0_TAIL, head, tail)
    head, tail = _multiply(s, s_tail, head, tail)
    return _add(exponent, 0.0, head, tail)


@kernel
def _exp2_pair(x: float, x_tail: float) -> float:
    """2**(x + x_tail) rounded once, subnormal results too, for x not NaN."""
    if x >= 1024.0:
        return _INF
    if x <= -1075.0:
        return 0.0

    # x = n + r, |r| ≤ ½; h = r·ln 2, head and tail.
    nearest = np.rint(x)
    n = int(nearest)
    r = x - nearest
    h, h_tail = _two_product(r, _LN2_HEAD)
    h_tail += r * _LN2_TAIL + x_tail * _LN2_HEAD

    # exp(h + h_tail) = head + tail with head = fl(1 + h).
    curve = h * h * _horner(h, _EXP)
    head, tail = _fast_two_sum(1.0, h)
    tail += curve + h_tail * (head + curve)
    mantissa = head + tail
    if n > -_LOWEST or (n == -_LOWEST and mantissa >= 1.0):
        # In two steps, since 2**1024 is no float64.
        return float(2.0 * mantissa * _power(n - 1) if n > 0 else mantissa * _power(n))

    # A subnormal result: round at its last bit by adding 2**k, then scale exactly.
    anchor = _power(-_LOWEST - n)
    rounded, rest = _two_sum(anchor, head)
    return float(((rounded + (rest + tail)) - anchor) / anchor * _power(-_LOWEST))


@kernel
def exp2(x: float) -> float:
    """2**x for every x, subnormal results included; max error 0.65 ulp (measured 0.606).

    exp2(+inf) = +inf, exp2(−inf) = 0, exp2(NaN) = NaN; exact for integers.
    """
    if np.isnan(x):
        return _NAN
    return float(_exp2_pair(x, 0.0))


@kernel
def log2(x: float) -> float:
    """Binary logarithm for every x, subnormal included; max error 0.51 ulp (measured 0.500).

    log2(±0) = −inf, log2(x < 0) = NaN, log2(+inf) = +inf; exact for powers of two.
    """
    if np.isnan(x) or x < 0.0:
        return _NAN
    if x == 0.0:
        return -_INF
    if x == _INF:
        return _INF
    head, tail = _log2_pair(x)
    return head + tail


@kernel
def pow(x: float, y: float) -> float:
    """x**y for every x and y, subnormal results included; max error 0.65 ulp (measured 0.594).

    pow(x, ±0) = pow(1, y) = pow(−1, ±inf) = 1, even for NaN; NaN for finite x < 0 and y no integer;
    zeros and infinities as in C99 F.9.4.4. Exactly representable results are exact.
    """
    if y == 0.0 or x == 1.0:
        return 1.0
    if np.isnan(x) or np.isnan(y):
        return _NAN

    # The sign, from the parity of y (every float of 2**53 and above is even).
    magnitude = abs(x)
    integer = np.floor(y) == y
    odd = integer and np.isfinite(y) and 2.0 * np.floor(0.5 * y) != y
    sign = -1.0 if odd and np.copysign(1.0, x) < 0.0 else 1.0

    # Results that no exponent describes.
    if not np.isfinite(y):
        if magnitude == 1.0:
            return 1.0
        return _INF if (magnitude > 1.0) == (y > 0.0) else 0.0
    if magnitude == 0.0:
        return sign * (0.0 if y > 0.0 else _INF)
    if magnitude == _INF:
        return sign * (_INF if y > 0.0 else 0.0)
    if x < 0.0 and not integer:
        return _NAN

    # |x|**y = 2**(y·log2 |x|); the bounds keep y small enough to be split.
    log_head, log_tail = _log2_pair(magnitude)
    estimate = y * log_head
    if estimate > 1025.0:
        return sign * _INF
    if estimate < -1077.0:
        return sign * 0.0
    if abs(estimate) < 2.0**-60:  # also keeps the product's tail from underflow
        return sign
    head, tail = _two_product(y, log_head)
    head, tail = _fast_two_sum(head, tail + y * log_tail)
    return sign * _exp2_pair(head, tail)


# --- Sine, cosine, tangent ------------------------------------------------------------------------


@kernel
def _reduce(x: float) -> tuple[int, float, float]:
    """x = n·π/2 + (r + r_tail), |r| ≤ 0.7854: n mod 4, r, r_tail; for |x| ≤ `TRIG_RANGE`.

    n times A, B, C is exact (20 + 33 bits). No float64 of the range is nearer to a multiple of π/2
    than 2**-60.5 (x = 45.553093477052), so r + r_tail is good to 2**-70 relative.
    """
    n = np.rint(x * _TWO_OVER_PI)
    a = x - n * _HALF_PI_A  # exact
    b, b_tail = _two_sum(a, -(n * _HALF_PI_B))
    c, c_tail = _two_sum(b, -(n * _HALF_PI_C))
    r, r_tail = _fast_two_sum(c, (b_tail + c_tail) - n * _HALF_PI_D)
    return int(n - 4.0 * np.floor(0.25 * n)), float(r), float(r_tail)


@kernel
def _sin_pair(r: float, r_tail: float) -> tuple[float, float]:
    """sin(r + r_tail) as head + tail, |r| ≤ 0.7854."""
    z = r * r
    return r, r_tail * (1.0 - 0.5 * z) + r * (z * _horner(z, _SIN))


@kernel
def _cos_pair(r: float, r_tail: float) -> tuple[float, float]:
    """cos(r + r_tail) as head + tail, |r| ≤ 0.7854."""
    z, z_tail = _two_product(r, r)
    z_tail += 2.0 * r * r_tail
    head, tail = _fast_two_sum(1.0, -0.5 * z)
    return head, tail + (z * z * _horner(z, _COS) - 0.5 * z_tail)


@kernel
def sincos(x: float) -> tuple[float, float]:
    """(sin x, cos x), x in radians, |x| ≤ 2**20; max error 0.80 ulp each (measured 0.784).

    NaN beyond the range, for infinities and for NaN; sin(±0) = ±0.
    """
    if not abs(x) <= TRIG_RANGE:
        return _NAN, _NAN
    if abs(x) < _TRIG_TINY:
        return x, 1.0
    quadrant, r, r_tail = _reduce(x)
    head, tail = _sin_pair(r, r_tail)
    sine = head + tail
    head, tail = _cos_pair(r, r_tail)
    cosine = head + tail
    if quadrant == 0:
        return sine, cosine
    if quadrant == 1:
        return cosine, -sine
    if quadrant == 2:
        return -sine, -cosine
    return -cosine, sine


@kernel
def sin(x: float) -> float:
    """`sincos(x)[0]`: x in radians, |x| ≤ 2**20, else NaN; max error 0.80 ulp (measured 0.774)."""
    return sincos(x)[0]


@kernel
def cos(x: float) -> float:
    """`sincos(x)[1]`: x in radians, |x| ≤ 2**20, else NaN; max error 0.80 ulp (measured 0.784)."""
    return sincos(x)[1]


@kernel
def tan(x: float) -> float:
    """Tangent of x in radians, |x| ≤ 2**20; max error 0.90 ulp (measured 0.872).

    NaN beyond the range, for infinities and for NaN; tan(±0) = ±0.
    """
    if not abs(x) <= TRIG_RANGE:
        return _NAN
    if abs(x) < _TRIG_TINY:
        return x
    quadrant, r, r_tail = _reduce(x)
    top, top_tail = _sin_pair(r, r_tail)
    bottom, bottom_tail = _cos_pair(r, r_tail)
    top, top_tail = _fast_two_sum(top, top_tail)
    bottom, bottom_tail = _fast_two_sum(bottom, bottom_tail)
    if quadrant % 2 == 1:  # tan = −cos/sin
        top, top_tail, bottom, bottom_tail = -bottom, -bottom_tail, top, top_tail

    # One step of long division.
    quotient = top / bottom
    product, product_tail = _two_product(quotient, bottom)
    rest = ((top - product) - product_tail) + (top_tail - quotient * bottom_tail)
    return quotient + rest / bottom


# --- Arc tangent ----------------------------------------------------------------------------------


@kernel
def atan2(y: float, x: float) -> float:
    """Angle of (x, y) in radians, [−π, π], for every y and x; max error 0.65 ulp (measured 0.631).

    NaN if either is NaN; signed zeros and infinities as in C99 F.9.1.4.
    """
    if np.isnan(x) or np.isnan(y):
        return _NAN
    short, long = abs(y), abs(x)
    if short == _INF and long == _INF:
        short, long = 1.0, 1.0

    # |angle| = octant·π/4 + side·atan(short/long), short ≤ long.
    octant = 0
    side = 1.0
    if short > long:
        short, long = long, short
        octant = 2
        side = -1.0
    if np.copysign(1.0, x) < 0.0:
        octant = 4 - octant
        side = -side

    # A tiny quotient is its own arc tangent; one division rounds it, subnormal or not.
    ratio = 0.0 if long == 0.0 else short / long
    if ratio < _ATAN_TINY:
        angle = _OCTANT_HEAD[octant] + (_OCTANT_TAIL[octant] + side * ratio)
        return float(np.copysign(angle, y))

    # Scale into the range where products and sums are exact, both by the same power of two.
    if long > _power(500):
        short *= _power(-600)
        long *= _power(-600)
    elif long < _power(-400):
        short *= _power(600)
        long *= _power(600)

    # Beyond π/8, atan(s/l) = π/4 + atan((s − l)/(s + l)).
    top, top_tail, bottom, bottom_tail = short, 0.0, long, 0.0
    if ratio > _TAN_PI_8:
        top, top_tail = _two_sum(short, -long)
        bottom, bottom_tail = _two_sum(short, long)
        octant += 1 if side > 0.0 else -1

    # The quotient, with its tail from the remainder.
    q = top / bottom
    product, product_tail = _two_product(q, bottom)
    rest = ((top - product) - product_tail) + (top_tail - q * bottom_tail)
    q_tail = rest / bottom

    # atan q = q + q·z·P(z), z = q²; the derivative for the tail is 1/(1 + z).
    z = q * q
    curve = q * (z * _horner(z, _ATAN)) + q_tail / (1.0 + z)
    head, tail = _two_sum(_OCTANT_HEAD[octant], side * q)
    angle = head + (tail + (_OCTANT_TAIL[octant] + side * curve))
    return float(np.copysign(angle, y))


# --- For host code --------------------------------------------------------------------------------


@driver(parallel=False)
def tan_host(x: float) -> float:
    """`tan` of one float64, for host code such as cameras."""
    return tan(x)


@driver(parallel=False)
def atan2_host(y: float, x: float) -> float:
    """`atan2` of two float64, for host code."""
    return atan2(y, x)


@driver(parallel=False)
def sincos_host(x: float) -> tuple[float, float]:
    """`sincos` of one float64, for host code."""
    return sincos(x)

"""Directions to environment-map coordinates and back: cube, horizontal cross, lat-long, ball.

Directions have any length but 0; the world is right-handed, +Y up, −Z ahead. u runs right and v
down, from 0 to 1, as rows of an image do. A direction that is zero, NaN or infinite has face −1 and
NaN coordinates; coordinates that show no direction give a NaN vector.

    cube       OpenGL 4.6 core specification, section 8.13, table 8.19. GL leaves ties open: here
               z wins over y and y over x. The table's cube is left-handed; see `flipped`
    cross      4 columns, 3 rows:   ·  +Y   ·   ·
                                   −X  +Z  +X  −Z
                                    ·  −Y   ·   ·    each face as in the table, neighbours joined
    lat-long   Debevec's: (u, v) = (½ + atan2(x, −z)/2π, acos(y)/π). −Z in the middle, the seam at
               +Z, +Y in the top row. At a pole u = ½
    ball       orthographic photograph of a mirrored ball, taken along −Z: a direction at the angle
               θ from +Z is reflected at the radius sin(θ/2). The rim is the one direction −Z
"""

import numpy as np

from .._jit import fma, kernel
from .elementary import atan2, sincos
from .exact import two_sum
from .vec import Vec3, is_finite, length

PI = 3.141592653589793
_NAN = float("nan")
_BELOW_HALF = 0.5 - 2.0**-54
_BELOW_TWO_THIRDS = 2.0 / 3.0 - 2.0**-53
NO_FLIP, FLIP_X, FLIP_Y, FLIP_Z = 0, 1, 2, 3


@kernel
def flipped(d: Vec3, axis: int) -> Vec3:
    """d with one component negated: the way from a right-handed world to the left-handed cube.

    FLIP_Z puts our view ahead, −Z, on face +Z; FLIP_X keeps the names of the z faces.
    """
    if axis == FLIP_X:
        return Vec3(-d.x, d.y, d.z)
    if axis == FLIP_Y:
        return Vec3(d.x, -d.y, d.z)
    if axis == FLIP_Z:
        return Vec3(d.x, d.y, -d.z)
    return d


@kernel
def is_direction(d: Vec3) -> bool:
    """True if d is finite and not zero."""
    return is_finite(d) and (d.x != 0.0 or d.y != 0.0 or d.z != 0.0)


@kernel
def hypotenuse(a: float, b: float) -> float:
    """√(a² + b²) without overflow or underflow, to 2 · 2⁻⁵³."""
    largest = max(abs(a), abs(b))
    if largest > 2.0**500:
        a, b = a * 2.0**-600, b * 2.0**-600
        return np.sqrt(a * a + b * b) * 2.0**600
    if largest < 2.0**-450:
        a, b = a * 2.0**600, b * 2.0**600
        return np.sqrt(a * a + b * b) * 2.0**-600
    return np.sqrt(a * a + b * b)


@kernel
def sin_cos_pi(t: float) -> tuple[float, float]:
    """(sin πt, cos πt) for |t| ≤ 1, each to 3 · 2⁻⁵³: the quarter turns are taken off exactly."""
    quarter = int(np.rint(2.0 * t))
    sine, cosine = sincos(PI * (t - 0.5 * quarter))
    if quarter == 0:
        return sine, cosine
    if quarter == 1:
        return cosine, -sine
    if quarter == -1:
        return -cosine, sine
    return -sine, -cosine


# --- Cube and cross -------------------------------------------------------------------------------


@kernel
def _across(s: float, m: float) -> float:
    """½(s/m + 1) as (s + m)/2m, |s| ≤ m: two roundings of the result itself, also close to 0."""
    if m > 1.0:  # s + m may overflow
        return (0.5 * s + 0.5 * m) / m
    return 0.5 * ((s + m) / m)


@kernel
def cube_face(d: Vec3) -> tuple[int, float, float]:
    """(face, u, v) in the cube's own axes; faces 0 to 5 are +X, −X, +Y, −Y, +Z, −Z."""
    if not is_direction(d):
        return -1, _NAN, _NAN
    ax, ay, az = abs(d.x), abs(d.y), abs(d.z)
    if az >= ax and az >= ay:
        face, s, t, m = (4, d.x, -d.y, az) if d.z > 0.0 else (5, -d.x, -d.y, az)
    elif ay >= ax:
        face, s, t, m = (2, d.x, d.z, ay) if d.y > 0.0 else (3, d.x, -d.z, ay)
    else:
        face, s, t, m = (0, -d.z, -d.y, ax) if d.x > 0.0 else (1, d.z, -d.y, ax)
    return face, _across(s, m), _across(t, m)


@kernel
def cube_direction(face: int, u: float, v: float) -> Vec3:
    """The point of the face, not normalised: its own axis is ±1. (u, v) may lie beyond the face."""
    if not (face >= 0 and np.isfinite(u) and np.isfinite(v)):
        return Vec3(_NAN, _NAN, _NAN)
    s, t = fma(2.0, u, -1.0), fma(2.0, v, -1.0)
    if face == 0:
        return Vec3(1.0, -t, -s)
    if face == 1:
        return Vec3(-1.0, -t, s)
    if face == 2:
        return Vec3(s, 1.0, t)
    if face == 3:
        return Vec3(s, -1.0, -t)
    if face == 4:
        return Vec3(s, -t, 1.0)
    return Vec3(-s, -t, -1.0)


@kernel
def cross_uv(d: Vec3) -> tuple[float, float]:
    """(u, v) in the whole cross.

    An edge beside an empty cell is given one place before it, so that the texel floor(u·width) is
    never empty.
    """
    face, s, t = cube_face(d)
    column, row = 1, 1
    if face == 0:
        column = 2
    elif face == 1:
        column = 0
    elif face == 2:
        row = 0
    elif face == 3:
        row = 2
    elif face == 5:
        column = 3
    u, v = (column + s) / 4.0, (row + t) / 3.0
    if row != 1 and u > _BELOW_HALF:
        u = _BELOW_HALF
    elif row == 1 and v > _BELOW_TWO_THIRDS and (column != 1 or u > _BELOW_HALF):
        v = _BELOW_TWO_THIRDS
    return u, v


@kernel
def cross_direction(u: float, v: float) -> Vec3:
    """The point of the cube shown at (u, v), not normalised; NaN where the cross is empty.

    A cell owns its left and top edge, and its right and bottom one where no cell follows.
    """
    if not (u >= 0.0 and u <= 1.0 and v >= 0.0 and v <= 1.0):
        return Vec3(_NAN, _NAN, _NAN)
    x, y = 4.0 * u, 3.0 * v
    column, row = min(int(np.floor(x)), 3), min(int(np.floor(y)), 2)
    if row != 1 and column == 2 and x == 2.0:
        column = 1
    elif row == 2 and column != 1 and y == 2.0:
        row = 1
    s, t = x - column, y - row
    if row == 1:
        if column == 0:
            return cube_direction(1, s, t)
        if column == 1:
            return cube_direction(4, s, t)
        if column == 2:
            return cube_direction(0, s, t)
        return cube_direction(5, s, t)
    if column == 1:
        return cube_direction(2 if row == 0 else 3, s, t)
    return Vec3(_NAN, _NAN, _NAN)


# --- Latitude-longitude ---------------------------------------------------------------------------


@kernel
def latlong_uv(d: Vec3) -> tuple[float, float]:
    """(u, v), u in [0, 1), v in [0, 1]."""
    if not is_direction(d):
        return _NAN, _NAN
    if d.x == 0.0 and d.z == 0.0:
        return 0.5, (0.0 if d.y > 0.0 else 1.0)
    # The angle is counted from the seam, so that u has all its digits next to 0.
    u = atan2(-d.x, d.z) / (2.0 * PI)
    if u < 0.0:
        u += 1.0
        if u >= 1.0:  # within half an ulp of the seam
            u = 0.0
    return u + 0.0, atan2(hypotenuse(d.x, d.z), d.y) / PI  # + 0.0: no −0


@kernel
def latlong_direction(u: float, v: float) -> Vec3:
    """Unit direction; u wraps, v outside [0, 1] gives NaN. Whole rows v = 0 and 1 are ±Y."""
    if not (np.isfinite(u) and v >= 0.0 and v <= 1.0):
        return Vec3(_NAN, _NAN, _NAN)
    turn_sine, turn_cosine = sin_cos_pi(2.0 * (u - np.rint(u)))
    sine, cosine = sin_cos_pi(v)
    return Vec3(-(sine * turn_sine), cosine, sine * turn_cosine)


# --- Mirrored ball --------------------------------------------------------------------------------


@kernel
def ball_uv(d: Vec3) -> tuple[float, float]:
    """(u, v) of the point that reflects d; −Z itself gives the rim's right end, (1, ½)."""
    if not is_direction(d):
        return _NAN, _NAN
    largest = max(abs(d.x), abs(d.y), abs(d.z))
    if largest > 2.0**300:
        d = Vec3(d.x * 2.0**-600, d.y * 2.0**-600, d.z * 2.0**-600)
    elif largest < 2.0**-300:
        d = Vec3(d.x * 2.0**600, d.y * 2.0**600, d.z * 2.0**600)
    size = length(d)
    if d.z >= 0.0:  # r = sin(θ/2) = s/√(2·size·(size + z)), s = √(x² + y²)
        share = 1.0 / np.sqrt(2.0 * size * (size + d.z))
        x, y = d.x * share, d.y * share
    else:  # r = √((size − z)/(2·size)), which does not cancel here
        s = hypotenuse(d.x, d.y)
        r = np.sqrt((size - d.z) / (2.0 * size))
        x, y = (d.x / s * r, d.y / s * r) if s > 0.0 else (1.0, 0.0)
    u, v = 0.5 + 0.5 * x, 0.5 - 0.5 * y
    return max(0.0, min(1.0, u)), max(0.0, min(1.0, v))


@kernel
def ball_direction(u: float, v: float) -> Vec3:
    """Unit direction reflected at (u, v); NaN off the ball.

    With the normal n = (x, y, √q), q = 1 − x² − y²: (2√q·x, 2√q·y, 2q − 1). q is formed from exact
    squares, for next to the rim it is all rounding otherwise.
    """
    x, y = two_sum(2.0 * u, -1.0), two_sum(1.0, -2.0 * v)
    xx, yy = x.hi * x.hi, y.hi * y.hi
    rest = fma(x.hi, x.hi, -xx) + 2.0 * x.hi * x.lo + (fma(y.hi, y.hi, -yy) + 2.0 * y.hi * y.lo)
    first = two_sum(1.0, -max(xx, yy))
    q = (first.hi - min(xx, yy)) + (first.lo - rest)
    if not q >= 0.0:
        return Vec3(_NAN, _NAN, _NAN)
    w = 2.0 * np.sqrt(q)
    return Vec3(w * x.hi, w * y.hi, 2.0 * q - 1.0)

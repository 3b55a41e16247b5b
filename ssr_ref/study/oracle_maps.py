"""Exact answers, to 60 digits, for depth formats, barycentrics and environment-map directions.

Every oracle takes Python floats (or mpf) and returns a tuple of mpf, from the textbook formula and
with no regard to rounding: nothing of the kernels is used. Keys of `ORACLES` and `CONDITIONS` are a
KernelInfo's name, or name/form.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import mpmath

Mpf = Any
Answer = tuple[Mpf, ...]
DIGITS = 60

mp = mpmath.mp.clone()
mp.dps = DIGITS
_f = mp.mpf


# --- Depth ----------------------------------------------------------------------------------------


def depth_of_gl(ndc: float, near: float, far: float) -> Answer:
    """2·f·n/(f + n − z·(f − n)); far may be inf."""
    z, n, f = _f(ndc), _f(near), _f(far)
    if mp.isinf(f):
        return (2 * n / (1 - z) if z != 1 else mp.inf,)
    return (2 * f * n / (f + n - z * (f - n)),)


def depth_of_d3d(device: float, near: float, far: float) -> Answer:
    """f·n/(f − d·(f − n)); far may be inf."""
    d, n, f = _f(device), _f(near), _f(far)
    if mp.isinf(f):
        return (n / (1 - d) if d != 1 else mp.inf,)
    return (f * n / (f - d * (f - n)),)


def depth_of_reversed(device: float, near: float, far: float) -> Answer:
    """f·n/(n + d·(f − n)); far may be inf."""
    d, n, f = _f(device), _f(near), _f(far)
    if mp.isinf(f):
        return (n / d if d != 0 else mp.inf,)
    return (f * n / (n + d * (f - n)),)


def gl_of_depth(depth: float, near: float, far: float) -> Answer:
    """z_ndc by the projection matrix: (A·z + B)/z."""
    z, n, f = _f(depth), _f(near), _f(far)
    if mp.isinf(f):
        return (1 - 2 * n / z,)
    return ((f + n) / (f - n) - 2 * f * n / ((f - n) * z),)


def d3d_of_depth(depth: float, near: float, far: float) -> Answer:
    """(1 + z_ndc)/2 = f·(z − n)/(z·(f − n))."""
    z, n, f = _f(depth), _f(near), _f(far)
    return ((z - n) / z if mp.isinf(f) else f * (z - n) / (z * (f - n)),)


def reversed_of_depth(depth: float, near: float, far: float) -> Answer:
    """(1 − z_ndc)/2 = n·(f − z)/(z·(f − n))."""
    z, n, f = _f(depth), _f(near), _f(far)
    return (n / z if mp.isinf(f) else n * (f - z) / (z * (f - n)),)


def _orthographic_depth(part: Mpf, near: float, far: float) -> Answer:
    return (_f(near) + part * (_f(far) - _f(near)),)


def _orthographic_part(depth: float, near: float, far: float) -> Mpf:
    return (_f(depth) - _f(near)) / (_f(far) - _f(near))


def depth_of_log(device: float, far: float, constant: float) -> Answer:
    """((1 + C·far)^d − 1)/C."""
    c = _f(constant)
    return (((1 + c * _f(far)) ** _f(device) - 1) / c,)


def log_of_depth(depth: float, far: float, constant: float) -> Answer:
    """log(1 + C·z)/log(1 + C·far)."""
    c = _f(constant)
    return (mp.log(1 + c * _f(depth)) / mp.log(1 + c * _f(far)),)


def depth_of_log_near(device: float, near: float, far: float) -> Answer:
    """near·(far/near)^d."""
    return (_f(near) * (_f(far) / _f(near)) ** _f(device),)


def log_near_of_depth(depth: float, near: float, far: float) -> Answer:
    """log(z/near)/log(far/near)."""
    return (mp.log(_f(depth) / _f(near)) / mp.log(_f(far) / _f(near)),)


# --- Barycentrics ---------------------------------------------------------------------------------


def barycentrics(
    p: Sequence[float],
    a: Sequence[float],
    b: Sequence[float],
    c: Sequence[float],
    w: Sequence[float],
) -> Answer:
    """Σ β_i·w_i·(x_i, y_i, 1) = (p, 1), solved by elimination; β < 0 becomes 0, then Σβ = 1."""
    columns = [[_f(k) * _f(v) for v in (*q, 1.0)] for q, k in zip((a, b, c), w)]
    m = [[columns[j][i] for j in range(3)] + [_f(v)] for i, v in enumerate((*p, 1.0))]
    for i in range(3):
        best = max(range(i, 3), key=lambda row: abs(m[row][i]))
        m[i], m[best] = m[best], m[i]
        # 60 digits hold the products of float32 numbers exactly; what is left of 0 is rounding.
        if abs(m[i][i]) <= _f(10) ** -45 * max(abs(v) for column in columns for v in column):
            return _f(1), _f(0), _f(0)
        for row in range(3):
            if row != i:
                factor = m[row][i] / m[i][i]
                m[row] = [x - factor * y for x, y in zip(m[row], m[i])]
    beta = [max(_f(0), m[i][3] / m[i][i]) for i in range(3)]
    total = sum(beta)
    return tuple(v / total if v > total * _f(10) ** -45 else _f(0) for v in beta)


# --- Directions -----------------------------------------------------------------------------------

# Right, down and ahead of each face as vectors (GL 4.6, table 8.19 read as s_c, t_c, m_a).
_FACES = (
    ((0, 0, -1), (0, -1, 0), (1, 0, 0)),
    ((0, 0, 1), (0, -1, 0), (-1, 0, 0)),
    ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
    ((1, 0, 0), (0, 0, -1), (0, -1, 0)),
    ((1, 0, 0), (0, -1, 0), (0, 0, 1)),
    ((-1, 0, 0), (0, -1, 0), (0, 0, -1)),
)
_CELLS = {(2, 1): 0, (0, 1): 1, (1, 0): 2, (1, 2): 3, (1, 1): 4, (3, 1): 5}  # (column, row): face


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Mpf:
    return sum((x * y for x, y in zip(a, b)), _f(0))


def cube_face_index(d: Sequence[float]) -> Answer:
    """The face whose axis has the largest component along d; of equal ones z, then y, then x."""
    v = [_f(x) for x in d]
    order = (4, 5, 2, 3, 0, 1)
    return (_f(max(order, key=lambda face: (_dot(v, _FACES[face][2]), -order.index(face)))),)


def cube_uv(d: Sequence[float]) -> Answer:
    """½·(1 + d·right/d·ahead), ½·(1 + d·down/d·ahead)."""
    v = [_f(x) for x in d]
    right, down, ahead = _FACES[int(cube_face_index(d)[0])]
    along = _dot(v, ahead)
    return (1 + _dot(v, right) / along) / 2, (1 + _dot(v, down) / along) / 2


def cube_direction(face: float, uv: Sequence[float]) -> Answer:
    """ahead + (2u − 1)·right + (2v − 1)·down."""
    right, down, ahead = _FACES[int(face)]
    s, t = 2 * _f(uv[0]) - 1, 2 * _f(uv[1]) - 1
    return tuple(a + s * r + t * b for r, b, a in zip(right, down, ahead))


def cross_uv(d: Sequence[float]) -> Answer:
    """((column + u)/4, (row + v)/3)."""
    face = int(cube_face_index(d)[0])
    column, row = next(cell for cell, f in _CELLS.items() if f == face)
    u, v = cube_uv(d)
    return (column + u) / 4, (row + v) / 3


def cross_direction(uv: Sequence[float]) -> Answer:
    """Of the cell that holds uv, outer edges included; NaN where there is none."""
    x, y = 4 * _f(uv[0]), 3 * _f(uv[1])
    for (column, row), face in _CELLS.items():
        if column <= x <= column + 1 and row <= y <= row + 1:
            return cube_direction(face, (x - column, y - row))
    return mp.nan, mp.nan, mp.nan


def latlong_uv(d: Sequence[float]) -> Answer:
    """(½ + atan2(x, −z)/2π mod 1, acos(y/|d|)/π); u = ½ at the poles."""
    x, y, z = (_f(v) for v in d)
    with mp.extradps(DIGITS * 4):  # acos loses half of them next to a pole
        across = x * x + z * z
        v = mp.acos(y / mp.sqrt(across + y * y)) / mp.pi
        u = mp.frac(_f(1) / 2 + mp.atan2(x, -z) / (2 * mp.pi)) if across != 0 else _f(1) / 2
    return +u, +v


def latlong_direction(uv: Sequence[float]) -> Answer:
    """(sin φ·sin θ, cos φ, −sin φ·cos θ), θ = 2π·(u − ½), φ = π·v."""
    theta, phi = 2 * mp.pi * (_f(uv[0]) - _f(1) / 2), mp.pi * _f(uv[1])
    return (mp.sin(phi) * mp.sin(theta), mp.cos(phi), -mp.sin(phi) * mp.cos(theta))


def ball_uv(d: Sequence[float]) -> Answer:
    """The normal n halves d/|d| and +Z: (½ + ½·n_x, ½ − ½·n_y); (1, ½) for −Z."""
    with mp.extradps(DIGITS * 4):
        v = [_f(x) for x in d]
        size = mp.sqrt(_dot(v, v))
        half = [v[0] / size, v[1] / size, v[2] / size + 1]
        length = mp.sqrt(_dot(half, half))
        if length == 0:
            return _f(1), _f(1) / 2
        u, w = (1 + half[0] / length) / 2, (1 - half[1] / length) / 2
    return +u, +w


def ball_direction(uv: Sequence[float]) -> Answer:
    """(0, 0, −1) reflected about the ball's normal."""
    x, y = 2 * _f(uv[0]) - 1, 1 - 2 * _f(uv[1])
    rest = 1 - x * x - y * y
    if rest < 0:
        return mp.nan, mp.nan, mp.nan
    n = (x, y, mp.sqrt(rest))
    return tuple(i + 2 * n[2] * v for i, v in zip((0, 0, -1), n))


# --- Tables ---------------------------------------------------------------------------------------

Oracle = Callable[..., Answer]

ORACLES: dict[str, Oracle] = {
    "linear_depth/gl_ndc": depth_of_gl,
    "linear_depth/d3d": depth_of_d3d,
    "linear_depth/reversed": depth_of_reversed,
    "linear_depth/gl_ndc_infinite": lambda d, n: depth_of_gl(d, n, mp.inf),
    "linear_depth/d3d_infinite": lambda d, n: depth_of_d3d(d, n, mp.inf),
    "linear_depth/reversed_infinite": lambda d, n: depth_of_reversed(d, n, mp.inf),
    "linear_depth/gl_ndc_orthographic": lambda d, n, f: _orthographic_depth((1 + _f(d)) / 2, n, f),
    "linear_depth/d3d_orthographic": lambda d, n, f: _orthographic_depth(_f(d), n, f),
    "linear_depth/reversed_orthographic": lambda d, n, f: _orthographic_depth(1 - _f(d), n, f),
    "linear_depth/logarithmic": depth_of_log,
    "linear_depth/logarithmic_near": depth_of_log_near,
    "linear_depth/negative_z": lambda d: (-_f(d),),
    "linear_depth/distance": lambda d, length: (_f(d) / _f(length),),
    "device_depth/gl_ndc": gl_of_depth,
    "device_depth/d3d": d3d_of_depth,
    "device_depth/reversed": reversed_of_depth,
    "device_depth/gl_ndc_infinite": lambda z, n: gl_of_depth(z, n, mp.inf),
    "device_depth/d3d_infinite": lambda z, n: d3d_of_depth(z, n, mp.inf),
    "device_depth/reversed_infinite": lambda z, n: reversed_of_depth(z, n, mp.inf),
    "device_depth/gl_ndc_orthographic": lambda z, n, f: (2 * _orthographic_part(z, n, f) - 1,),
    "device_depth/d3d_orthographic": lambda z, n, f: (_orthographic_part(z, n, f),),
    "device_depth/reversed_orthographic": lambda z, n, f: (1 - _orthographic_part(z, n, f),),
    "device_depth/logarithmic": log_of_depth,
    "device_depth/logarithmic_near": log_near_of_depth,
    "device_depth/negative_z": lambda z: (-_f(z),),
    "device_depth/distance": lambda z, length: (_f(z) * _f(length),),
    "barycentrics": barycentrics,
    "cube_face/face": cube_face_index,
    "cube_face/uv": cube_uv,
    "cube_direction": cube_direction,
    "cross_uv": cross_uv,
    "cross_direction": cross_direction,
    "latlong_uv": latlong_uv,
    "latlong_direction": latlong_direction,
    "ball_uv": ball_uv,
    "ball_direction": ball_direction,
}


def _log_condition(device: float, far: float, constant: float) -> Mpf:
    """Of 2^x − 1 in its exponent."""
    x = _f(device) * mp.log(1 + _f(constant) * _f(far))
    return x / -mp.expm1(-x) if x != 0 else _f(1)


def _log1p_condition(x: Mpf) -> Mpf:
    return x / ((1 + x) * mp.log1p(x))


def _ndc_condition(slope: Callable[..., Mpf], oracle: str) -> Callable[..., Mpf]:
    """|z·slope/z_ndc|; the sign change of z_ndc makes it large there."""

    def condition(*args: float) -> Mpf:
        value = ORACLES[oracle](*args)[0]
        return abs(_f(args[0]) * slope(*args) / value) if value != 0 else _f(0)

    return condition


CONDITIONS: dict[str, Callable[..., Mpf]] = {
    "linear_depth/logarithmic": _log_condition,
    "device_depth/logarithmic": lambda z, f, c: (
        _log1p_condition(_f(c) * _f(z)) + _log1p_condition(_f(c) * _f(f))
    ),
    "device_depth/logarithmic_near": lambda z, n, f: (
        (1 / mp.log(_f(z) / _f(n)) if z != n else _f(0)) + 1 / mp.log(_f(f) / _f(n))
    ),
    "device_depth/gl_ndc": _ndc_condition(
        lambda z, n, f: 2 * _f(n) * _f(f) / ((_f(f) - _f(n)) * _f(z) ** 2), "device_depth/gl_ndc"
    ),
    "device_depth/gl_ndc_infinite": _ndc_condition(
        lambda z, n: 2 * _f(n) / _f(z) ** 2, "device_depth/gl_ndc_infinite"
    ),
    "device_depth/gl_ndc_orthographic": _ndc_condition(
        lambda z, n, f: 2 / (_f(f) - _f(n)), "device_depth/gl_ndc_orthographic"
    ),
}
"""Relative condition number of a case; a key that is not here has 0: its bound holds as it is."""

"""Exact answers, to 60 digits, for error-free transforms, mirrors, lines, spheres and rays.

Every oracle takes what the formula takes, Python floats or mpf and sequences of them, and returns a
flat tuple of mpf. They follow the mathematics with no regard to rounding; nothing of the kernels is
used. Keys of `ORACLES` and `CONDITIONS` are a KernelInfo's name, or name/form.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np

from ..camera import Camera
from ..maths.rays import STUDY_CAMERA, STUDY_SIZE
from ..typed import Size

Mpf = Any
Answer = tuple[Mpf, ...]
Vector = Sequence[Any]
DIGITS = 60

mp = mpmath.mp.clone()
mp.dps = DIGITS
_f = mp.mpf
_STEP = _f(10) ** -30  # a relative step whose square is out of sight at 60 digits


def _vector(v: Vector) -> list[Mpf]:
    return [_f(x) for x in v]


def _dot(a: Vector, b: Vector) -> Mpf:
    return mp.fsum(x * y for x, y in zip(a, b))


def _rational(x: Any) -> Fraction:
    """The exact value of a float or mpf."""
    if isinstance(x, float | int | np.floating):
        return Fraction(float(x))
    sign, mantissa, exponent, _ = x._mpf_
    return Fraction((-1) ** sign * int(mantissa)) * Fraction(2) ** int(exponent)


def _number(x: Fraction) -> Mpf:
    return _f(x.numerator) / _f(x.denominator)


# --- Error-free transforms ------------------------------------------------------------------------


def two_sum(a: float, b: float) -> Answer:
    """a + b rounded to float64, and the rest."""
    return _rounded(Fraction(a) + Fraction(b))


def two_prod(a: float, b: float) -> Answer:
    """a·b rounded to float64, and the rest."""
    return _rounded(Fraction(a) * Fraction(b))


def _rounded(exact: Fraction) -> Answer:
    nearest = float(exact)  # correctly rounded, ties to even
    return _f(nearest), _number(exact - Fraction(nearest))


def difference_of_products(a: float, b: float, c: float, d: float) -> Answer:
    """a·b − c·d."""
    return (_number(_rational(a) * _rational(b) - _rational(c) * _rational(d)),)


# --- Mirrors --------------------------------------------------------------------------------------


def reflect(incident: Vector, normal: Vector) -> Answer:
    """The part along n turned round, the part across it kept."""
    d, n = _vector(incident), _vector(normal)
    along = _dot(d, n) / _dot(n, n)
    across = [x - along * y for x, y in zip(d, n)]
    return tuple(x - along * y for x, y in zip(across, n))


def reflect_published(incident: Vector, normal: Vector) -> Answer:
    """d − 2 (d·n) n, n as given."""
    d, n = _vector(incident), _vector(normal)
    return tuple(x - 2 * _dot(d, n) * y for x, y in zip(d, n))


def mirror_matrix(normal: Vector, offset: float) -> Answer:
    """Row by row: the columns are the images of the unit vectors and of the origin."""
    n, d = _vector(normal), _f(offset)

    def image(p: list[Mpf], w: int) -> list[Mpf]:
        height = (_dot(n, p) + d * w) / _dot(n, n)
        return [x - 2 * height * y for x, y in zip(p, n)] + [_f(w)]

    columns = [image([_f(i == j) for i in range(3)], 0) for j in range(3)]
    columns.append(image([_f(0)] * 3, 1))
    return tuple(columns[j][i] for i in range(4) for j in range(4))


# --- Lines ----------------------------------------------------------------------------------------


def dda_line(start: Vector, end: Vector, index: int) -> Answer:
    """floor(start + ½ + i·Δ/S) in rationals."""
    a, b = [int(x) for x in start], [int(x) for x in end]
    steps = max(abs(b[0] - a[0]), abs(b[1] - a[1]))
    part = Fraction(int(index), steps) if steps else Fraction(0)
    return tuple(_f((x + Fraction(1, 2) + part * (y - x)).__floor__()) for x, y in zip(a, b))


# --- Spheres --------------------------------------------------------------------------------------


def sphere_discriminant(o: Vector, d: Vector, c: Vector, r: float) -> Fraction:
    """(f·d)² − (d·d)(f·f − r²), exactly: > 0 two meetings, 0 tangent, < 0 none."""
    f = [_rational(x) - _rational(y) for x, y in zip(o, c)]
    v = [_rational(x) for x in d]
    across = sum(x * y for x, y in zip(f, v))
    power = sum(x * x for x in f) - _rational(r) ** 2
    return Fraction(across * across - sum(x * x for x in v) * power)


def sphere_roots(o: Vector, d: Vector, c: Vector, r: float) -> Answer:
    """Both t, t0 ≤ t1, of |o + t·d − c| = r; NaN where there are none.

    The textbook formula: cancellation costs digits, and those are cheap here (a root is taken to
    twice the digits).
    """
    discriminant = sphere_discriminant(o, d, c, r)
    v = [_rational(x) for x in d]
    a = sum(x * x for x in v)
    if discriminant < 0 or a == 0:
        return mp.nan, mp.nan
    middle = -sum((_rational(x) - _rational(y)) * z for x, y, z in zip(o, c, v)) / a
    with mp.workdps(3 * DIGITS):
        half = mp.sqrt(_number(discriminant)) / _number(a)
        first, second = _number(middle) - half, _number(middle) + half
    return +first, +second


def sphere_points(o: Vector, d: Vector, c: Vector, r: float) -> Answer:
    """Both meetings, x, y, z each."""
    roots = sphere_roots(o, d, c, r)
    return tuple(_f(x) + t * _f(y) for t in roots for x, y in zip(o, d))


# --- Rays -----------------------------------------------------------------------------------------


def view_numbers(camera: Camera, size: Size) -> tuple[float, ...]:
    """W, H, P00, P11, P02, P12 (orthographic: P03, P13), near: what a camera is given as."""
    v = camera.params(size)
    return (
        float(v.width), float(v.height), v.p00, v.p11, v.offset_x, v.offset_y, v.near,
    )  # fmt: skip


def _clip_coordinates(view: Vector, p: Vector, w: int, perspective: bool) -> list[Mpf]:
    """Clip x, y, w of a point (w = 1) or direction (w = 0)."""
    _, _, p00, p11, p02, p12, _ = (_f(x) for x in view)
    x, y, z = (_f(k) for k in p)
    if perspective:
        return [p00 * x + p02 * z, p11 * y + p12 * z, -z]
    return [p00 * x + p02 * w, p11 * y + p12 * w, _f(w)]


def clip_ray_end(
    view: Vector, origin: Vector, direction: Vector, max_distance: float, perspective: bool = True
) -> tuple[Mpf, int, list[Mpf]]:
    """t along the unit ray, the number of the bound (`End`), clip coordinates there.

    Bounds: left w + x, right w − x, top w − y, bottom w + y ≥ 0, near: depth ≥ near.
    """
    near = _f(view[6])
    d = _vector(direction)
    size = mp.sqrt(_dot(d, d))
    r = [x / size for x in d]
    start = _clip_coordinates(view, origin, 1, perspective)
    slope = _clip_coordinates(view, r, 0, perspective)
    (x, y, w), (dx, dy, dw) = start, slope
    bounds = [
        (w + x, dw + dx), (w - x, dw - dx), (w - y, dw - dy), (w + y, dw + dy),
        (-_f(origin[2]) - near, -r[2]),
    ]  # fmt: skip
    leaving = [max(value, 0) / -change if change < 0 else mp.inf for value, change in bounds]
    leaving.append(_f(max_distance))
    t = min(leaving)
    if mp.isinf(t):
        return t, 6, slope
    return t, leaving.index(t) + 1, [p + t * q for p, q in zip(start, slope)]


def _clip_answer(view: Vector, origin: Vector, direction: Vector, max_distance: float) -> Answer:
    return (clip_ray_end(view, origin, direction, max_distance)[0],)


def ray_setup_numbers(
    view: Vector, pixel: Vector, depth: float, normal: Vector, max_distance: float
) -> Answer:
    """P0, dP, k0, dk, S of a perspective camera's pixel whose two normals are one."""
    width, height, p00, p11, p02, p12, _ = (_f(x) for x in view)
    px, py, z = _f(pixel[0]) + 0.5, _f(pixel[1]) + 0.5, _f(depth)
    sight = [(2 * px / width - 1 + p02) / p00, (1 - 2 * py / height + p12) / p11, _f(-1)]
    origin = [z * x for x in sight]
    t, _, (x, y, w) = clip_ray_end(view, origin, reflect(sight, normal), max_distance)
    p1 = ((1 + x / w) * width / 2, (1 - y / w) * height / 2)
    dx, dy = p1[0] - px, p1[1] - py
    s = max(abs(dx), abs(dy))
    k0 = 1 / z
    k1 = _f(0) if mp.isinf(t) else 1 / w
    return px, py, dx / s, dy / s, k0, (k1 - k0) / s, s


def _end_position(*args: Any) -> Answer:
    p0_x, p0_y, dx, dy, _, _, s = ray_setup_numbers(*args)
    return p0_x + s * dx, p0_y + s * dy


def _inverse_depths(*args: Any) -> Answer:
    _, _, _, _, k0, dk, s = ray_setup_numbers(*args)
    return k0, k0 + s * dk


def _study_view() -> tuple[float, ...]:
    return view_numbers(STUDY_CAMERA, STUDY_SIZE)


# --- Tables ---------------------------------------------------------------------------------------


def condition(oracle: Callable[..., Answer], args: Sequence[Any]) -> Answer:
    """Σ |x·∂y/∂x|/|y| of each number y of the answer, over all numbers x of the arguments.

    How many times u an answer moves if every input moves by u; +inf where the answer ends.
    """
    answer, moves = _moves(oracle, args)
    return tuple(
        mp.fsum(move[k] for move in moves) / abs(y) if y != 0 else _f(0)
        for k, y in enumerate(answer)
    )


def norm_condition(oracle: Callable[..., Answer], args: Sequence[Any]) -> Mpf:
    """The same for an answer that is one vector: lengths of the moves over its length."""
    answer, moves = _moves(oracle, args)
    return mp.fsum(mp.norm(move, 2) for move in moves) / mp.norm(answer, 2)


def _moves(oracle: Callable[..., Answer], args: Sequence[Any]) -> tuple[Answer, list[list[Mpf]]]:
    """The answer, and |x·∂y/∂x| of its numbers for each input x that is not 0 or infinite."""
    answer = oracle(*args)
    moves = []
    for i, arg in enumerate(args):
        vector = np.ndim(arg) > 0
        for j, x in enumerate(arg if vector else [arg]):
            if x == 0 or mp.isinf(x):
                continue
            moved = _f(x) * (1 + _STEP)
            if vector:
                moved = [moved if k == j else y for k, y in enumerate(arg)]
            changes = [
                abs(new - old) / _STEP
                for new, old in zip(oracle(*args[:i], moved, *args[i + 1 :]), answer)
            ]
            moves.append([mp.inf if mp.isnan(change) else change for change in changes])
    return answer, moves


ORACLES: dict[str, Callable[..., Answer]] = {
    "two_sum": two_sum,
    "two_prod": two_prod,
    "difference_of_products": difference_of_products,
    "reflect/normalizing": reflect,
    "reflect/published": reflect_published,
    "mirror_matrix": mirror_matrix,
    "dda_line": dda_line,
    **{
        f"intersect_sphere/{form}": sphere_roots
        for form in ("textbook", "textbook_unit", "stable", "kahan", "hearn_baker", "distance")
    },
    "clip_ray": lambda *args: _clip_answer(_study_view(), *args),
    "ray_setup/end_position": lambda *args: _end_position(_study_view(), *args),
    "ray_setup/inverse_depth": lambda *args: _inverse_depths(_study_view(), *args),
}

CONDITIONS: dict[str, Callable[..., Any]] = {
    "mirror_matrix": lambda *args: condition(mirror_matrix, args),
    **{
        key: lambda *args: condition(sphere_roots, args)
        for key in ORACLES
        if key.startswith("intersect_sphere")
    },
    "clip_ray": lambda *args: condition(_clip_answer, (_study_view(), *args)),
    "ray_setup/end_position": lambda *args: norm_condition(_end_position, (_study_view(), *args)),
    "ray_setup/inverse_depth": lambda *args: norm_condition(
        _inverse_depths, (_study_view(), *args)
    ),
}
"""Condition numbers, one for each number of the answer; a key that is not here has 0: its bound
holds as it is."""

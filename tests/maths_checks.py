"""What must hold of the formulas, as functions of the formula: the tests call them with the real
one, `test_maths_mutations.py` with broken ones, which they must refuse.

Exact answers are rationals, or come from `study.oracle_ray` (mpmath, 60 digits).
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np

from ssr_ref import Camera, SphereOutcome
from ssr_ref.study import oracle_ray
from ssr_ref.study.accuracy import case
from ssr_ref.study.sampling import examples
from ssr_ref.study.sampling_ray import near_spheres, spheres

U = 2.0**-53
MISS, TANGENT, TWO, INVALID = (int(v) for v in SphereOutcome)
Function = Callable[..., Any]


def lengths(v: np.ndarray) -> np.ndarray:
    return np.sqrt((v * v).sum(axis=-1))


# --- Error-free transforms ------------------------------------------------------------------------


def check_two_sum(two_sum: Function, n: int = 300) -> None:
    """The two parts are the exact sum, and the first is it rounded."""
    a, b = examples("two_sum", n, 3)
    value, error = two_sum(a, b)
    for x, y, s, e in zip(a.tolist(), b.tolist(), value.tolist(), error.tolist()):
        assert Fraction(s) + Fraction(e) == Fraction(x) + Fraction(y)
        assert s == x + y
    assert (error != 0.0).sum() > n // 3, "most sums round: a residual of 0 is an optimised one"


def check_two_prod(two_prod: Function, n: int = 300) -> None:
    """The two parts are the exact product, and the first is it rounded."""
    a, b = examples("two_prod", n, 3)
    value, error = two_prod(a, b)
    for x, y, p, e in zip(a.tolist(), b.tolist(), value.tolist(), error.tolist()):
        assert Fraction(p) + Fraction(e) == Fraction(x) * Fraction(y)
        assert p == x * y
    assert (error != 0.0).sum() > n // 2


def check_difference_of_products(f: Function, n: int = 300) -> None:
    """Within 2u of the result, whatever cancels (theorem 1.2 of Jeannerod, Louvet, Muller)."""
    args = examples("difference_of_products", n, 3)
    for found, *numbers in zip(f(*args).tolist(), *(a.tolist() for a in args)):
        a, b, c, d = map(Fraction, numbers)
        exact = a * b - c * d
        assert abs(Fraction(found) - exact) <= Fraction(2.0 * U) * abs(exact)


# --- Mirrors --------------------------------------------------------------------------------------


def check_reflect(reflect: Function, n: int = 300, key: str = "reflect/normalizing") -> None:
    """|r| = |d|, r·n = −d·n, and the mirror of the mirror image is the original."""
    d, normal = examples(key, n, 5)
    r = reflect(d, normal)
    tolerance = 17.0 * U * lengths(d)
    assert (np.abs(lengths(r) - lengths(d)) <= tolerance + 4.0 * U * lengths(d)).all()
    along = (d * normal).sum(axis=-1) + (r * normal).sum(axis=-1)
    assert (np.abs(along) <= (17.0 + 6.0) * U * lengths(d) * lengths(normal)).all()
    assert (lengths(reflect(r, normal) - d) <= 2.1 * tolerance).all()


def check_mirror_matrix(mirror_matrix: Function, n: int = 100) -> None:
    """An involution to the stated bound, det −1, points on the plane stay; row by row exact."""
    normal, offset = examples("mirror_matrix", n, 7)
    m = mirror_matrix(normal, offset)
    with mpmath.workdps(60):
        for i in range(n):
            distance = abs(offset[i]) / lengths(normal[i])
            exact = mpmath.matrix(m[i].tolist())
            off = exact * exact - mpmath.eye(4)
            assert max(abs(x) for x in off) <= 8.0 * U * (1.0 + distance)
            assert abs(mpmath.det(exact[:3, :3]) + 1) <= 8.0 * U
            p = -offset[i] / (normal[i] ** 2).sum() * normal[i]
            moved = exact * mpmath.matrix([*p.tolist(), 1.0])
            size = lengths(p) + distance
            assert max(abs(moved[k] - p[k]) for k in range(3)) <= 8.0 * U * (size + 1e-300)


# --- Lines ----------------------------------------------------------------------------------------


def check_line(dda_line: Function, n: int = 300) -> None:
    """Every pixel is the one that rationals give, in all octants and at ties."""
    start, end, index = examples("dda_line", n, 2)
    found = dda_line(start, end, index)
    for i in range(n):
        exact = oracle_ray.dda_line(start[i].tolist(), end[i].tolist(), int(index[i]))
        assert found[i].tolist() == [int(x) for x in exact], (start[i], end[i], index[i])


# --- Spheres --------------------------------------------------------------------------------------

CENTER = (0.0, 0.0, 0.0)
# origin, direction, radius, outcome, t0, t1 of a sphere at the origin of the world, by hand
SPHERE_CASES = {
    "through": ((-5.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0, TWO, 4.0, 6.0),
    "behind": ((5.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0, TWO, -6.0, -4.0),
    "beside": ((-5.0, 1.5, 0.0), (1.0, 0.0, 0.0), 1.0, MISS, np.nan, np.nan),
    "tangent": ((-2.0, 1.0, 0.0), (1.0, 0.0, 0.0), 1.0, TANGENT, 2.0, 2.0),
    "tangent at the origin": ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), 1.0, TANGENT, 0.0, 0.0),
    "inside": ((0.5, 0.0, 0.0), (1.0, 0.0, 0.0), 2.0, TWO, -2.5, 1.5),
    "at the centre": ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 2.0, TWO, -2.0, 2.0),
    "at the centre, -0": ((-0.0, 0.0, 0.0), (1.0, -0.0, 0.0), 2.0, TWO, -2.0, 2.0),
    "on the surface, out": ((0.0, 2.0, 0.0), (0.0, 1.0, 0.0), 2.0, TWO, -4.0, 0.0),
    "on the surface, in": ((0.0, 2.0, 0.0), (0.0, -1.0, 0.0), 2.0, TWO, 0.0, 4.0),
    "abeam, b = 0": ((0.0, 0.5, 0.0), (1.0, 0.0, 0.0), 0.5, TANGENT, 0.0, 0.0),
    "abeam inside, b = 0": ((0.0, 3.0, 0.0), (1.0, 0.0, 0.0), 5.0, TWO, -4.0, 4.0),
    "a point, met": ((-3.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0, TANGENT, 3.0, 3.0),
    "a point, passed": ((-3.0, 1e-9, 0.0), (1.0, 0.0, 0.0), 0.0, MISS, np.nan, np.nan),
    "a point, at it": ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0, TANGENT, 0.0, 0.0),
    "negative radius": ((-5.0, 0.0, 0.0), (1.0, 0.0, 0.0), -1.0, INVALID, np.nan, np.nan),
    "no direction": ((-5.0, 0.0, 0.0), (0.0, -0.0, 0.0), 1.0, INVALID, np.nan, np.nan),
    "double length": ((-5.0, 0.0, 0.0), (2.0, 0.0, 0.0), 1.0, TWO, 2.0, 3.0),
    "above a planet": ((0.0, 6400010.0, 0.0), (0.0, -1.0, 0.0), 6.4e6, TWO, 10.0, 12800010.0),
}  # fmt: skip


def check_sphere_contract(intersect: Function) -> None:
    """The table of `vecmath/sphere.py`, case by case; power-of-two lengths come out exactly."""
    for name, (o, d, r, outcome, t0, t1) in SPHERE_CASES.items():
        hit = intersect(o, d, CENTER, r)
        assert hit.outcome == outcome, name
        assert np.array_equal(hit.t, [t0, t1], equal_nan=True), (name, hit.t)
        assert np.isnan(hit.point).all() == (outcome in (MISS, INVALID)), name
        if outcome in (TANGENT, TWO):
            want = np.array(o) + np.array([[t0], [t1]]) * np.array(d)
            assert np.abs(hit.point - want).max() <= 4.0 * U * max(r, 1.0), name
    for bad in (np.nan, np.inf, -np.inf):
        for place in range(10):
            numbers = np.array([-5.0, 0.1, 0.2, 1.0, 0.1, 0.0, 0.0, 0.3, 0.1, 1.0])
            numbers[place] = bad
            hit = intersect(numbers[:3], numbers[3:6], numbers[6:9], numbers[9])
            assert hit.outcome == INVALID, (bad, place)
            assert np.isnan(hit.t).all() and np.isnan(hit.point_error).all()


def check_sphere_far(intersect: Function) -> None:
    """A sphere of radius 0.1 seen from 1e7: Δ = 0.01 − 0.095² = 9.75e-4, roots √Δ = 0.031225 about
    1e7; and the hit points, which t alone cannot give, to 1e-16.
    """
    hit = intersect((-1e7, 0.095, 0.0), (1.0, 0.0, 0.0), CENTER, 0.1)
    half = np.sqrt((0.1 - 0.095) * (0.1 + 0.095))
    assert hit.outcome == TWO
    assert np.abs(hit.t - (1e7 + np.array([-half, half]))).max() <= 2e-9
    assert np.abs(hit.point - [[-half, 0.095, 0.0], [half, 0.095, 0.0]]).max() <= 2e-16


def sphere_regions(n: int) -> dict[str, tuple[np.ndarray, ...]]:
    """Where the quadratic is hard: see numbers of the name."""
    return {
        "1e2": spheres(n, 1, 1e2, unit=False),
        "1e4": spheres(n, 2, 1e4, unit=False, single=False),
        "1e8": spheres(n, 3, 1e8, unit=False, single=False),
        "inside": spheres(n, 4, 0.9, unit=False),
        "tangent 1e-3": spheres(n, 5, 20.0, tangent=1e-3),
        "tangent 1e-7": spheres(n, 6, 20.0, tangent=1e-7),
        "planet": near_spheres(n, 7, 6.4e6, 10.0, single=False),
        "on it": spheres(n, 8, 1.0, unit=False),
    }


def check_sphere_bounds(intersect: Function, n: int = 40) -> None:
    """Hit or miss is right beyond 16u of tangency; t and points are within the returned bounds,
    which are themselves within 32u (1 + κ) of |t|; |p − c| = r within them; t0 ≤ t1.
    """
    with mpmath.workdps(60):
        for name, arguments in sphere_regions(n).items():
            hit = intersect(*arguments)
            for i in range(n):
                args = case(arguments, i)
                roots = oracle_ray.sphere_roots(*args)
                missed = bool(mpmath.isnan(roots[0]))
                if (hit.outcome[i] == MISS) != missed:
                    assert clearance(args) <= 16.0 * U, (name, args)
                    continue
                if missed:
                    continue
                assert hit.t[i, 0] <= hit.t[i, 1], (name, args)
                kappa = oracle_ray.condition(oracle_ray.sphere_roots, args)
                points = oracle_ray.sphere_points(*args)
                for k in range(2):
                    t, bound = mpmath.mpf(hit.t[i, k]), hit.t_error[i, k]
                    assert abs(t - roots[k]) <= bound, (name, args, k)
                    assert bound <= 32.0 * U * (1 + kappa[k]) * abs(roots[k]), (name, args, k)
                    p = [mpmath.mpf(x) for x in hit.point[i, k].tolist()]
                    away = mpmath.norm([x - y for x, y in zip(p, points[3 * k : 3 * k + 3])])
                    assert away <= hit.point_error[i, k], (name, args, k)
                    radius = mpmath.norm([x - mpmath.mpf(y) for x, y in zip(p, args[2])])
                    assert abs(radius - args[3]) <= hit.point_error[i, k], (name, args, k)


def clearance(args: tuple[Any, ...]) -> float:
    """|Δ|/r² of the exact line."""
    o, d, c, r = args
    squared = sum(Fraction(x) ** 2 for x in d)
    return abs(float(oracle_ray.sphere_discriminant(o, d, c, r) / squared / Fraction(r) ** 2))


def check_sphere_accuracy(intersect: Function, n: int = 40) -> None:
    """Roots of spheres well inside their outline, to 8u of t: a condition number of t is not spent
    on the subtractions of the method.
    """
    for name in ("1e2", "inside", "planet"):
        arguments = sphere_regions(n)[name]
        hit = intersect(*arguments)
        for i in range(n):
            args = case(arguments, i)
            roots = oracle_ray.sphere_roots(*args)
            if mpmath.isnan(roots[0]) or clearance(args) < 0.05:
                continue
            # Inside, s may cancel against half the chord; the far root never does.
            kept = [
                k for k in range(2) if name != "inside" or abs(roots[k]) == max(map(abs, roots))
            ]
            for k in kept:
                assert abs(hit.t[i, k] - roots[k]) <= 8.0 * U * abs(roots[k]), (name, args, k)


def check_sphere_scaling(intersect: Function, n: int = 40) -> None:
    """Lengths · 2ᵏ, or the direction · 2ᵏ, give the same bits, scaled."""
    for name, (o, d, c, r) in sphere_regions(n).items():
        base = intersect(o, d, c, r)
        for k in (-500, -40, 7, 480):
            s = 2.0**k
            for hit, t_scale, p_scale in (
                (intersect(o * s, d, c * s, r * s), s, s),
                (intersect(o, d * s, c, r), 1.0 / s, 1.0),
            ):
                assert np.array_equal(hit.outcome, base.outcome), name
                assert np.array_equal(hit.t, base.t * t_scale, equal_nan=True), (name, k)
                assert np.array_equal(hit.point, base.point * p_scale, equal_nan=True), (name, k)
                assert np.array_equal(
                    hit.point_error, base.point_error * p_scale, equal_nan=True
                ), (name, k)


# --- Rays -----------------------------------------------------------------------------------------


def check_clip(clip_ray: Function, camera_of: Function = Camera.frustum, n: int = 200) -> None:
    """The exact bound, and t to 1e-9; w is never 0 or below, also for a near plane below the
    rounding of the origin's depth.
    """
    from ssr_ref.maths.rays import STUDY_SIZE

    rng = np.random.default_rng(4)
    camera = camera_of(np.eye(4), -0.75, 1.25, -0.375, 0.625, near=0.125)
    view = oracle_ray.view_numbers(camera, STUDY_SIZE)
    origin, direction, limit = examples("clip_ray", n, 8)
    found = clip_ray(camera, STUDY_SIZE, origin, direction, limit)
    for i in range(n):
        args = (origin[i].tolist(), direction[i].tolist(), float(limit[i]))
        t, end, _ = oracle_ray.clip_ray_end(view, *args)
        assert found.end[i] == end, args
        if mpmath.isinf(t):
            assert np.isinf(found.t[i])
        else:
            assert abs(found.t[i] - t) <= 1e-9 * t
    assert set(found.end.tolist()) == {1, 2, 3, 4, 5, 6}
    assert (found.clip[:, 2] > 0.0).all()

    close = camera_of(np.eye(4), -0.75, 1.25, -0.375, 0.625, near=1e-13)
    o = np.array([3.0, -2.0, -40.0]) * rng.uniform(1.0, 2.0, (2000, 1))
    aim = rng.normal(size=(2000, 3)) * 1e-13
    found = clip_ray(close, STUDY_SIZE, o, aim - o)
    assert (found.t > 0.0).all()
    assert (found.clip[:, 2] >= 1e-13).all()

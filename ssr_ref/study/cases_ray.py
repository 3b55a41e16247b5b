"""Test cases of error-free transforms, mirrors, lines, spheres and rays."""

from __future__ import annotations

import random
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np

from ..maths.rays import STUDY_CAMERA, STUDY_SIZE
from ..vecmath.sphere_distance import SphereOutcome
from . import oracle_ray as oracle
from .rounding import FLOAT32, Format
from .sampling_codes import any_size, sign, single, steps
from .sampling_ray import SAMPLES
from .vectors import Case, Field, Subject

SEED = 30
NAN, INF = float("nan"), float("inf")
UP = 1.0 + 2.0**-23


def _samples(key: str, count: int) -> Iterator[Case]:
    """Cases of a sampler's arrays, rounded to float32: "sample 0", "sample 1" and so on."""
    with np.errstate(over="ignore"):
        arrays = [
            a.astype(np.float32) if a.dtype.kind == "f" else a for a in SAMPLES[key](count, SEED)
        ]
    for i in range(count):
        row = [a[i].tolist() for a in arrays]
        yield Case(f"sample {i}", tuple(tuple(x) if isinstance(x, list) else x for x in row))


# --- Error-free transforms ------------------------------------------------------------------------


def _rounded(exact: Fraction, to: Format) -> tuple[float, float]:
    """The nearest float of the format and the rest, which is a float of it too."""
    value = float(exact)
    if to is FLOAT32:
        value = _nearest_float32(exact)
    return value, float(exact - Fraction(value))


def _nearest_float32(exact: Fraction) -> float:
    """To nearest even by comparing the neighbours: rounding twice, over float64, can be wrong."""
    guess = np.float32(float(exact))
    around = (np.nextafter(guess, np.float32(-INF)), guess, np.nextafter(guess, np.float32(INF)))
    even = [int(x.view(np.uint32)) & 1 for x in around]
    distance = [abs(exact - Fraction(float(x))) for x in around]
    return float(min(zip(distance, even, around))[2])


def two_sum(a: Any, b: Any, *, to: Format) -> tuple[float, float]:
    """a + b in a format, and what its rounding lost."""
    return _rounded(_exact(a) + _exact(b), to)


def two_prod(a: Any, b: Any, *, to: Format) -> tuple[float, float]:
    """a·b in a format, and what its rounding lost."""
    return _rounded(_exact(a) * _exact(b), to)


def _exact(x: Any) -> Fraction:
    return oracle._rational(x)


def _pairs(product: bool) -> Iterator[Case]:
    """Ties, cancellation to the last bit, terms far apart."""
    for name, a, b in (
        ("nothing is lost", 3.0, 0.5),
        ("a tie to even downwards", 1.0, 2.0**-24),
        ("a tie to even upwards", UP, 2.0**-24),
        ("one bit over a tie", 1.0, 2.0**-24 * UP),
        ("cancels exactly", 1.5, -1.5),
        ("cancels to one bit", UP, -1.0),
        ("far apart", 1.0, 2.0**-60),
        ("two full significands", 16777215.0, 16777213.0),
        ("opposite signs", -3.0, single(0.1)),
        ("zero", 0.0, 2.5),
    ):
        yield Case(name, (a, b))
    source = random.Random(SEED)
    for i in range(90):
        a = sign(source) * any_size(source, -20, 20)
        b = sign(source) * any_size(source, -20, 20)
        if i % 3 == 1 and not product:
            b = -steps(abs(a), i % 5 - 2) * (1.0 if a > 0 else -1.0)
        yield Case(f"sample {i}", (a, b))


def _differences() -> Iterator[Case]:
    """a·b − c·d where the rounded products are equal, or nearly."""
    yield Case("exactly 0", (3.0, 4.0, 2.0, 6.0))
    yield Case("rounded products are equal", (UP, UP, 1.0, 1.0 + 2.0**-22))
    yield Case("nothing cancels", (3.0, 4.0, -2.0, 6.0))
    yield Case("sliver", (4097.0, 4095.0, 4096.0, 4096.0))
    yield Case("first product 0", (0.0, 4.0, 2.0, 6.0))
    source = random.Random(SEED + 1)
    for i in range(100):
        a, b, c = (sign(source) * any_size(source, -10, 10) for _ in range(3))
        d = sign(source) * any_size(source, -10, 10)
        if i % 4:
            d = single(a * b / c * (1.0 + (int(source.random() * 7.0) - 3) * 2.0**-23))
        yield Case(f"sample {i}", (a, b, c, d))


# --- Mirrors --------------------------------------------------------------------------------------


def _reflections(form: str) -> Iterator[Case]:
    tilted = (single(0.6), single(0.8), 0.0)
    for name, d, n in (
        ("along the normal", (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)),
        ("at 45 degrees", (1.0, -1.0, 0.0), (0.0, 1.0, 0.0)),
        ("grazing", (1.0, -(2.0**-20), 0.0), (0.0, 1.0, 0.0)),
        ("perpendicular to the normal", (1.0, 0.0, 2.0), (0.0, 1.0, 0.0)),
        ("from behind", (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)),
        ("tilted", (1.0, -2.0, 3.0), tilted),
        ("result next to an axis", (-0.28125, -0.9599609375, 0.0), tilted),
        ("tiny incident", (2.0**-30, -(2.0**-31), 2.0**-33), tilted),
        ("huge incident", (2.0**30, -(2.0**31), 2.0**33), tilted),
        ("zero incident", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ):
        yield Case(name, (d, n))
    if form == "normalizing":
        yield Case("normal of length 2", ((1.0, -1.0, 0.5), (0.0, 2.0, 0.0)))
        yield Case("normal of length 2^-20", ((1.0, -1.0, 0.5), (0.0, 2.0**-20, 0.0)))
        nothing = (NAN, NAN, NAN)
        yield Case("zero normal gives NaN", ((1.0, -1.0, 0.5), (0.0, 0.0, 0.0)), nothing)
    else:
        yield Case("normal of length 2: not a mirror", ((1.0, -1.0, 0.5), (0.0, 2.0, 0.0)))
    yield from _samples(f"reflect/{form}", 100)


def _planes() -> Iterator[Case]:
    for name, n, offset in (
        ("floor", (0.0, 1.0, 0.0), 0.0),
        ("floor at y = 3", (0.0, 1.0, 0.0), -3.0),
        ("normal of length 2", (0.0, 0.0, 2.0), 1.0),
        ("diagonal: 1 - 2x^2 cancels", (1.0, 1.0, 2.0**-12), 0.25),
        ("all three", (1.0, -2.0, 3.0), 4.0),
    ):
        yield Case(name, (n, offset))
    yield Case("zero normal gives NaN", ((0.0, 0.0, 0.0), 1.0), (*[NAN] * 12, 0.0, 0.0, 0.0, 1.0))
    yield from _samples("mirror_matrix", 70)


# --- Lines ----------------------------------------------------------------------------------------


def _lines() -> Iterator[Case]:
    for name, start, end, index in (
        ("one pixel", (3, 4), (3, 4), 0),
        ("tie to the higher pixel", (0, 0), (2, 1), 1),
        ("tie backwards", (2, 1), (0, 0), 1),
        ("tie downwards", (0, 0), (2, -1), 1),
        ("diagonal", (0, 0), (-5, 5), 3),
        ("steep", (1, 1), (3, 100), 50),
        ("largest", (-(2**29), -(2**29)), (2**29, 2**29 - 1), 2**29),
    ):
        yield Case(name, (start, end, index))
    yield from _samples("dda_line", 100)


# --- Spheres --------------------------------------------------------------------------------------

_BALL = ((0.0, 0.0, 0.0), 1.0)
_EARTH = ((0.0, -6.4e6, 0.0), 6.4e6)


def _sphere(o: Any, d: Any, c: Any, r: Any) -> tuple[Any, ...]:
    """Outcome and both t; NaN where the line misses."""
    exact = oracle.sphere_discriminant(o, d, c, r)
    outcome = SphereOutcome.TWO if exact > 0 else SphereOutcome.MISS
    if exact == 0:
        outcome = SphereOutcome.TANGENT
    return int(outcome), oracle.sphere_roots(o, d, c, r)


def _spheres() -> Iterator[Case]:
    ahead = (0.0, 0.0, -1.0)
    for name, o, d, ball in (
        ("through the middle", (0.0, 0.0, 5.0), ahead, _BALL),
        ("behind", (0.0, 0.0, -5.0), ahead, _BALL),
        ("from the middle", (0.0, 0.0, 0.0), ahead, _BALL),
        ("from inside", (0.0, 0.25, 0.5), ahead, _BALL),
        ("from the surface", (0.0, 0.0, 1.0), ahead, _BALL),
        ("miss", (0.0, 2.0, 5.0), ahead, _BALL),
        ("direction of length 1/4", (0.25, 0.5, 5.0), (0.0, 0.0, -0.25), _BALL),
        ("far: 4100 radii", (0.25, 0.5, 4100.0), ahead, _BALL),
        ("far: 10^5 radii", (0.25, 0.5, 1e5), ahead, _BALL),
        ("huge sphere below the eye", (0.0, 10.0, 0.0), (0.0, -1.0, 0.25), _EARTH),
        ("almost a tangent", (0.0, 1.0 - 2.0**-10, 5.0), ahead, _BALL),
    ):
        yield Case(name, (o, d, *ball))
    tangent, invalid = int(SphereOutcome.TANGENT), int(SphereOutcome.INVALID)
    nothing = (invalid, (NAN, NAN))
    yield Case("tangent", ((0.0, 1.0, 5.0), ahead, *_BALL), (tangent, (5.0, 5.0)))
    yield Case("zero direction", ((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), *_BALL), nothing)
    yield Case("negative radius", ((0.0, 0.0, 5.0), ahead, (0.0, 0.0, 0.0), -1.0), nothing)
    yield Case("NaN origin", ((NAN, 0.0, 5.0), ahead, *_BALL), nothing)
    yield from _samples("intersect_sphere/distance", 90)


# --- Rays -----------------------------------------------------------------------------------------

_VIEW = oracle.view_numbers(STUDY_CAMERA, STUDY_SIZE)


def _with_view(key: str, count: int) -> Iterator[Case]:
    for case in _samples(key, count):
        yield Case(case.name, (_VIEW, *case.inputs))


def _clip(view: Any, origin: Any, direction: Any, max_distance: Any) -> tuple[Any, ...]:
    t, end, clip = oracle.clip_ray_end(view, origin, direction, max_distance)
    return t, int(end), clip


def _call_clip(function: Any, view: Any, *arrays: Any) -> tuple[Any, ...]:
    """The stated camera is that of every case."""
    from ..maths.rays import clip_ray

    found = clip_ray(STUDY_CAMERA, STUDY_SIZE, *arrays)
    return found.t, found.end, found.clip


def _setup(*arguments: Any) -> tuple[Any, ...]:
    """Where the ray starts and ends on screen, and k = 1/depth there."""
    px, py, dx, dy, k0, dk, s = oracle.ray_setup_numbers(*arguments)
    with oracle.mp.workdps(oracle.DIGITS):
        return px, py, px + s * dx, py + s * dy, k0, k0 + s * dk


def _call_setup(function: Any, view: Any, pixel: Any, depth: Any, normal: Any, limit: Any) -> Any:
    from ..maths.rays import ray_setup

    found = ray_setup(STUDY_CAMERA, STUDY_SIZE, pixel, depth, normal, max_distance=limit)
    end = found.p0 + found.s_end[:, None] * found.dp
    return found.p0, end, np.stack([found.k0, found.k0 + found.s_end * found.dk], axis=-1)


_PAIR = (Field("a"), Field("b"))
_PARTS = (Field("value"), Field("error"))
_MIRROR = (Field("incident", (3,)), Field("normal", (3,)))
_CAMERA = Field("view", (7,))


def _call_parts(function: Any, a: Any, b: Any) -> tuple[Any, Any]:
    found = function(a, b)
    return found[..., 0], found[..., 1]


SUBJECTS: tuple[Subject, ...] = (
    Subject(
        kernel="two_sum",
        inputs=_PAIR,
        outputs=_PARTS,
        oracle=two_sum,
        cases=lambda: _pairs(False),
        call=_call_parts,
        safe_exponent=62,
        by_format=True,
    ),
    Subject(
        kernel="two_prod",
        inputs=_PAIR,
        outputs=_PARTS,
        oracle=two_prod,
        cases=lambda: _pairs(True),
        call=_call_parts,
        safe_exponent=62,
        by_format=True,
    ),
    Subject(
        kernel="difference_of_products",
        inputs=tuple(map(Field, "abcd")),
        outputs=(Field("difference"),),
        oracle=oracle.difference_of_products,
        cases=_differences,
        conditioned=False,
    ),
    *(
        Subject(
            kernel="reflect",
            form=form,
            inputs=_MIRROR,
            outputs=(Field("reflected", (3,)),),
            oracle=exact,
            cases=lambda form=form: _reflections(form),  # type: ignore[misc]
        )
        for form, exact in (
            ("normalizing", oracle.reflect),
            ("published", oracle.reflect_published),
        )
    ),
    Subject(
        kernel="mirror_matrix",
        inputs=(Field("normal", (3,)), Field("offset")),
        outputs=(Field("matrix", (4, 4)),),
        oracle=oracle.mirror_matrix,
        cases=_planes,
    ),
    Subject(
        kernel="dda_line",
        inputs=(
            Field("start", (2,), "int"),
            Field("end", (2,), "int"),
            Field("index", kind="int"),
        ),
        outputs=(Field("pixel", (2,), "int"),),
        oracle=lambda *line: tuple(int(x) for x in oracle.dda_line(*line)),
        cases=_lines,
    ),
    Subject(
        kernel="intersect_sphere",
        form="distance",
        name="intersect_sphere",
        inputs=(
            Field("origin", (3,)),
            Field("direction", (3,)),
            Field("center", (3,)),
            Field("radius"),
        ),
        outputs=(Field("outcome", kind="int"), Field("t", (2,))),
        oracle=_sphere,
        cases=_spheres,
        call=lambda function, *arrays: _call_sphere(*arrays),
        chooses_by_input=False,
    ),
    Subject(
        kernel="clip_ray",
        inputs=(_CAMERA, Field("origin", (3,)), Field("direction", (3,)), Field("max_distance")),
        outputs=(Field("t"), Field("end", kind="int"), Field("clip", (3,), measure="norm")),
        oracle=_clip,
        cases=lambda: _with_view("clip_ray", 70),
        call=_call_clip,
        chooses_by_input=False,
        safe_exponent=60,
    ),
    Subject(
        kernel="ray_setup",
        form="end_position",
        name="ray_setup",
        inputs=(
            _CAMERA,
            Field("pixel", (2,), "int"),
            Field("depth"),
            Field("normal", (3,)),
            Field("max_distance"),
        ),
        outputs=(Field("start_px", (2,)), Field("end_px", (2,)), Field("k", (2,))),
        oracle=_setup,
        cases=lambda: _with_view("ray_setup/end_position", 60),
        call=_call_setup,
        chooses_by_input=False,
    ),
)


def _call_sphere(*arrays: Any) -> tuple[Any, Any]:
    from ..maths.sphere import intersect_sphere

    found = intersect_sphere(*arrays)
    return found.outcome, found.t

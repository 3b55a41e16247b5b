"""Test cases of octahedral codes, sRGB, fades and hashes: the hard ones by name, then samples."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ..vecmath.srgb import CODE_THRESHOLD, LINEAR_THRESHOLD
from . import oracle_codes as oracle
from . import sampling_codes as sampling
from .sampling_codes import single, steps
from .vectors import Case, Field, Subject, numbered

SAMPLES = 120
NAN, INF = float("nan"), float("inf")
TINY = 2.0**-149
"""The smallest float32."""
WORD = 2**32 - 1

_AXES = {"+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0)}
_AXES |= {"+z": (0, 0, 1), "-z": (0, 0, -1)}


def _floats(values: Any) -> tuple[float, ...]:
    return tuple(float(v) for v in values)


def _directions() -> Iterator[Case]:
    third = single(3.0**-0.5)
    for name, axis in _AXES.items():
        yield Case(f"axis {name}", (_floats(axis),))
    for x in (third, -third):
        for y in (third, -third):
            for z in (third, -third):
                signs = "".join("+" if c > 0 else "-" for c in (x, y, z))
                yield Case(f"face centre {signs}", ((x, y, z),))
    yield Case("axis -z with x = -0", ((-0.0, 0.0, -1.0),))
    yield Case("axis -z with y = -0", ((0.0, -0.0, -1.0),))
    yield Case("fold edge x = 0 below", ((0.0, 0.6015625, -0.796875),))
    yield Case("fold edge x = -0 below", ((-0.0, 0.6015625, -0.796875),))
    yield Case("equator z = -0", ((0.6015625, -0.796875, -0.0),))
    yield Case("just below the equator", ((0.6015625, -0.796875, -(2.0**-40)),))
    yield Case("just below +x", ((1.0, 2.0**-30, -(2.0**-35)),))
    yield Case("just below -y", ((2.0**-38, -1.0, -(2.0**-36)),))
    yield Case("length 2^30", ((3.0 * 2.0**30, -5.0 * 2.0**28, -7.0 * 2.0**29),))
    yield Case("subnormal", ((TINY, -3 * TINY, -2 * TINY),))
    for name, bad in (
        ("zero", (0.0, 0.0, 0.0)),
        ("NaN", (NAN, 0.0, 1.0)),
        ("inf", (0.0, INF, 1.0)),
    ):
        yield Case(f"{name} gives NaN", (bad,), ((NAN, NAN),))
    yield from numbered("sample", ((d,) for d in sampling.directions(SAMPLES)))


def _square() -> Iterator[Case]:
    for u in (-1.0, 1.0):
        for v in (-1.0, 1.0):
            yield Case(f"corner {u:+g} {v:+g}", ((u, v),))
    for name, uv in {
        "middle": (0.0, 0.0),
        "middle of the right side": (1.0, 0.0),
        "equator": (0.25, -0.75),
        "one step above the equator": (0.25, -steps(0.75, -1)),
        "one step below the equator": (0.25, -steps(0.75, 1)),
        "fold edge u = 0": (0.0, 0.8125),
        "fold edge v = -0": (-1.0, -0.0),
        "8-bit snorm 127 -126": (1.0, single(-126.0 / 127.0)),
        "16-bit snorm 1 32766": (single(1.0 / 32767.0), single(32766.0 / 32767.0)),
    }.items():
        yield Case(name, (uv,))
    yield Case("NaN gives NaN", ((NAN, 0.5),), ((NAN, NAN, NAN),))
    yield from numbered("sample", ((c,) for c in sampling.square_codes(SAMPLES)))


def _transfer(threshold: float, *, bytes_too: bool) -> Iterator[Case]:
    near = single(threshold)
    for name, x in {
        "zero": 0.0,
        "one": 1.0,
        "half": 0.5,
        "two": 2.0,
        "negative": -0.25,
        "subnormal": 5 * TINY,
        "two steps below the threshold": steps(near, -2),
        "one step below the threshold": steps(near, -1),
        "at the threshold": near,
        "one step above the threshold": steps(near, 1),
        "two steps above the threshold": steps(near, 2),
    }.items():
        yield Case(name, (x,))
    for name, x in {"NaN": NAN, "+inf": INF, "-inf": -INF}.items():
        yield Case(f"{name} stays", (x,), (x,))
    if bytes_too:
        yield from (Case(f"byte {i}", (single(i / 255.0),)) for i in range(1, 256, 6))
    samples = sampling.intensities(SAMPLES, threshold)
    yield from numbered("sample", ((x,) for x in samples))


def _edges() -> Iterator[Case]:
    for p in (2.0, 3.0, 2.5):
        yield Case(f"middle with power {p:g}", ((0.5, 0.5), p))
        yield Case(f"corner with power {p:g}", ((0.0, 1.0), p))
        yield Case(f"a step inside with power {p:g}", ((2.0**-24, 0.5), p))
        yield Case(f"beyond both sides with power {p:g}", ((-0.25, 1.25), p))
    yield Case("quarter with power 2: 3/4", ((0.25, 0.5), 2.0))
    yield Case("quarter with power 3: 7/8", ((0.25, 0.5), 3.0))
    yield Case("a step from the middle", ((0.5, steps(0.5, 1)), 1.0))
    yield Case("NaN gives NaN", ((NAN, 0.5), 3.0), (NAN,))
    yield from numbered("sample", sampling.faded_positions(SAMPLES))


def _distances() -> Iterator[Case]:
    for kind, name in ((oracle.NONE, "none"), (oracle.PUBLISHED, "published"), (2, "linear")):
        yield Case(f"{name}: no length", (0.0, 4.0, kind))
        yield Case(f"{name}: the maximum", (4.0, 4.0, kind))
        yield Case(f"{name}: beyond the maximum", (5.0, 4.0, kind))
        yield Case(f"{name}: a step before the maximum", (steps(4.0, -1), 4.0, kind))
        yield Case(f"{name}: no maximum", (5.0, INF, kind), (1.0,))
        yield Case(f"{name}: NaN", (NAN, 4.0, kind), (NAN if kind else 1.0,))
        yield Case(f"{name}: infinite length", (INF, 4.0, kind), (0.0 if kind else 1.0,))
    for i, (length, limit) in enumerate(sampling.lengths(SAMPLES)):
        yield Case(f"sample {i}", (length, limit, 1 + i % 2))


def _words() -> Iterator[Case]:
    for x, y, z in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (WORD, WORD, WORD), (WORD, 0, 1)):
        yield Case(f"words {x} {y} {z}", (x, y, z))
    yield Case("last pixel of 1080p", (1919, 1079, 0))
    yield from numbered("sample", sampling.words(SAMPLES))


def _fade_of_kinds(function: Any, length: Any, max_distance: Any, kind: Any) -> Any:
    """`distance_fade` takes one kind a call."""
    import numpy as np

    names = ("none", "published", "linear")
    fades = [function(length, max_distance, name) for name in names]
    return np.choose(kind, fades)


_WORDS = tuple(Field(name, kind="uint") for name in ("x", "y", "z"))
_PIXEL = tuple(Field(name, kind="uint") for name in ("x", "y", "seed"))

SUBJECTS = (
    Subject(
        kernel="octahedral_encode",
        inputs=(Field("direction", (3,)),),
        # The published form of a lower face, 1 − |y| over the sum, is exact to u of 1, not of a
        # small coordinate; it is what most renderers have, so they are held to that.
        outputs=(Field("code", (2,), measure="norm"),),
        oracle=lambda d: oracle.octahedral_encode(*d),
        cases=_directions,
    ),
    Subject(
        kernel="octahedral_decode",
        inputs=(Field("code", (2,)),),
        outputs=(Field("direction", (3,)),),
        oracle=lambda c: oracle.octahedral_decode(*c),
        cases=_square,
    ),
    Subject(
        kernel="srgb_encode",
        inputs=(Field("linear"),),
        outputs=(Field("code"),),
        oracle=oracle.srgb_encode,
        cases=lambda: _transfer(LINEAR_THRESHOLD, bytes_too=False),
        safe_exponent=120,
    ),
    Subject(
        kernel="srgb_decode",
        inputs=(Field("code"),),
        outputs=(Field("linear"),),
        oracle=oracle.srgb_decode,
        cases=lambda: _transfer(CODE_THRESHOLD, bytes_too=True),
    ),
    Subject(
        kernel="edge_fade",
        inputs=(Field("uv", (2,)), Field("power")),
        outputs=(Field("fade"),),
        oracle=lambda uv, power: oracle.edge_fade(uv[0], uv[1], power),
        cases=_edges,
    ),
    Subject(
        kernel="distance_fade",
        inputs=(Field("length"), Field("max_distance"), Field("kind", kind="int")),
        outputs=(Field("fade"),),
        oracle=oracle.distance_fade,
        cases=_distances,
        call=_fade_of_kinds,
    ),
    Subject(
        kernel="pcg3d",
        inputs=_WORDS,
        outputs=(Field("hash", (3,), "uint"),),
        oracle=oracle.pcg3d,
        cases=_words,
        call=lambda function, *words: function(*words),
    ),
    Subject(
        kernel="jitter",
        inputs=_PIXEL,
        outputs=(Field("noise"),),
        oracle=oracle.jitter,
        cases=_words,
    ),
)

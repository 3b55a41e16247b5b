"""Test cases of depth formats, barycentrics and environment-map directions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from . import oracle_maps as oracle
from .oracle_maps import ORACLES
from .sampling_codes import single
from .sampling_maps import SAMPLES
from .vectors import Case, Field, Subject

SEED = 20
NAN, INF = float("nan"), float("inf")

# What a depth format takes after the depth.
_TAKES = {
    **dict.fromkeys(("gl_ndc", "d3d", "reversed", "logarithmic_near"), ("near", "far")),
    **{f"{kind}_infinite": ("near",) for kind in ("gl_ndc", "d3d", "reversed")},
    **{f"{kind}_orthographic": ("near", "far") for kind in ("gl_ndc", "d3d", "reversed")},
    "logarithmic": ("far", "constant"),
    "negative_z": (),
    "distance": ("ray_length",),
}


def _samples(key: str, count: int) -> Iterator[Case]:
    """Cases of a sampler's arrays: "sample 0", "sample 1" and so on."""
    arrays = [array.tolist() for array in SAMPLES[key](count, SEED)]
    for i, row in enumerate(zip(*arrays)):
        yield Case(f"sample {i}", tuple(tuple(x) if isinstance(x, list) else x for x in row))


def _depth_ends(kernel: str, form: str) -> Iterator[Case]:
    """Both ends of the range at near 0.1 and far 1000, and what lies outside it."""
    near, far = single(0.1), 1000.0
    rest = tuple({"near": near, "far": far}[name] for name in _TAKES[form])
    low = -1.0 if form.startswith("gl_ndc") else 0.0
    infinite = form.endswith("infinite")
    ends = (1.0, low) if form.startswith("reversed") else (low, 1.0)
    if kernel == "device_depth":
        yield Case("near", (near, *rest))
        if not infinite:
            yield Case("far", (far, *rest))
            yield Case("one float before far", (single(999.99994), *rest))
        yield Case("before near gives NaN", (near / 2.0, *rest), (NAN,))
    else:
        yield Case("at near", (ends[0], *rest))
        yield Case("at far", (ends[1], *rest), (INF,) if infinite else None)
        yield Case("middle of the range", (0.5 * (low + 1.0), *rest))
        yield Case("above the range gives NaN", (1.0 + 2.0**-23, *rest), (NAN,))
    yield Case("NaN", (NAN, *rest), (NAN,))


def _depth(kernel: str, form: str) -> Subject:
    key = f"{kernel}/{form}"
    depth, answer = ("device", "linear") if kernel == "linear_depth" else ("linear", "device")

    def cases() -> Iterator[Case]:
        if _TAKES[form] in (("near",), ("near", "far")):
            yield from _depth_ends(kernel, form)
        yield from _samples(key, 64)

    return Subject(
        kernel=kernel,
        form=form,
        inputs=tuple(Field(name) for name in (depth, *_TAKES[form])),
        outputs=(Field(answer),),
        oracle=ORACLES[key],
        cases=cases,
        safe_exponent=60,
    )


def _triangles() -> Iterator[Case]:
    a, b, c = (1.0, 2.0), (9.0, 2.5), (3.0, 8.0)
    w = (1.0, 2.0, 4.0)
    yield Case("at a", (a, a, b, c, w))
    yield Case("at b", (b, a, b, c, w))
    yield Case("at c", (c, a, b, c, w))
    yield Case("middle of ab", ((5.0, 2.25), a, b, c, w))
    yield Case("inside", ((4.0, 4.0), a, b, c, w))
    yield Case("inside and other winding", ((4.0, 4.0), a, c, b, w))
    yield Case("outside of ab", ((5.0, 0.0), a, b, c, w))
    yield Case("no area", ((4.0, 4.0), a, a, c, w), (1.0, 0.0, 0.0))
    yield Case("w of 0 gives NaN", ((4.0, 4.0), a, b, c, (0.0, 1.0, 1.0)), (NAN, NAN, NAN))
    yield from _samples("barycentrics", 100)


_AXES = {"+x": (1.0, 0.0, 0.0), "-x": (-1.0, 0.0, 0.0), "+y": (0.0, 1.0, 0.0)}
_AXES |= {"-y": (0.0, -1.0, 0.0), "+z": (0.0, 0.0, 1.0), "-z": (0.0, 0.0, -1.0)}
_NO_DIRECTION = {"zero": (0.0, 0.0, 0.0), "NaN": (NAN, 0.0, 1.0), "inf": (0.0, INF, 1.0)}


def _directions(key: str, nothing: tuple[Any, ...], *, ties: bool = False) -> Iterator[Case]:
    """Axes, what is no direction, the cube's edges and corners, then samples."""
    for name, axis in _AXES.items():
        yield Case(f"axis {name}", (axis,))
    for name, bad in _NO_DIRECTION.items():
        yield Case(f"{name} is no direction", (bad,), nothing)
    for x, y, z in ((1, 1, 1), (-1, 1, -1), (1, -1, 0.5), (0.5, 1, -1), (-1, 0.25, 1)) * ties:
        yield Case(f"edge {x:+g} {y:+g} {z:+g}", ((float(x), float(y), float(z)),))
    yield from _samples(key, 110)


def _latlong() -> Iterator[Case]:
    """Without samples within 2⁻¹⁸ of the seam, where rounding may step over it."""
    for case in _directions("latlong_uv", (NAN, NAN)):
        if case.outputs is None:
            u = float(oracle.latlong_uv(*case.inputs)[0])
            if 0.0 < u < 2.0**-18 or u > 1.0 - 2.0**-18:
                continue
        yield case


def _points(key: str, special: dict[str, tuple[float, float]]) -> Iterator[Case]:
    for name, uv in special.items():
        yield Case(name, (uv,))
    yield Case("NaN gives NaN", ((NAN, 0.5),), (NAN, NAN, NAN))
    yield from _samples(key, 100)


def _cube_points() -> Iterator[Case]:
    for face in range(6):
        yield Case(f"middle of face {face}", (face, (0.5, 0.5)))
        yield Case(f"a corner of face {face}", (face, (0.0, 1.0)))
    yield Case("no face gives NaN", (-1, (0.5, 0.5)), (NAN, NAN, NAN))
    for case in _samples("cube_direction", 100):
        yield Case(case.name, (int(case.inputs[0]), case.inputs[1]))


_DIRECTION = (Field("direction", (3,)),)
_UV = (Field("uv", (2,)),)
# Coordinates of [0, 1] cross 0, or ½, at nothing in particular: they are held to u of 1.
_UV_OUT = (Field("uv", (2,), measure="absolute"),)


def _map(name: str, cases: Callable[[], Iterator[Case]], **more: Any) -> Subject:
    """A subject of one of the maps' functions."""
    to_map = name.endswith("_uv")
    return Subject(
        kernel=name,
        inputs=_DIRECTION if to_map else _UV,
        outputs=_UV_OUT if to_map else _DIRECTION,
        oracle=ORACLES[name],
        cases=cases,
        safe_exponent=60,
        **more,
    )


SUBJECTS: tuple[Subject, ...] = (
    *(_depth(kernel, form) for kernel in ("linear_depth", "device_depth") for form in _TAKES),
    Subject(
        kernel="barycentrics",
        inputs=(*(Field(n, (2,)) for n in ("point", "a", "b", "c")), Field("w", (3,))),
        outputs=(Field("weights", (3,), measure="absolute"),),
        oracle=oracle.barycentrics,
        cases=_triangles,
    ),
    Subject(
        kernel="cube_face",
        form="uv",
        name="cube_face",
        inputs=_DIRECTION,
        outputs=(Field("face", kind="int"), *_UV_OUT),
        oracle=lambda d: (int(oracle.cube_face_index(d)[0]), oracle.cube_uv(d)),
        cases=lambda: _directions("cube_face/uv", (-1, NAN, NAN), ties=True),
        call=lambda function, d: _cube_face(d),
        safe_exponent=60,
    ),
    Subject(
        kernel="cube_direction",
        inputs=(Field("face", kind="int"), *_UV),
        outputs=(Field("direction", (3,), measure="absolute"),),
        oracle=oracle.cube_direction,
        cases=_cube_points,
    ),
    _map("cross_uv", lambda: _directions("cross_uv", (NAN, NAN), ties=True)),
    _map(
        "cross_direction",
        lambda: _points("cross_direction", {"middle of +z": (0.375, 0.5)}),
        chooses_by_input=False,
    ),
    _map("latlong_uv", _latlong),
    _map(
        "latlong_direction",
        lambda: _points(
            "latlong_direction",
            {"pole +y": (0.25, 0.0), "pole -y": (0.25, 1.0), "ahead": (0.5, 0.5)},
        ),
    ),
    _map("ball_uv", lambda: _directions("ball_uv", (NAN, NAN))),
    _map(
        "ball_direction",
        lambda: _points("ball_direction", {"middle": (0.5, 0.5), "top": (0.5, 0.0)}),
        chooses_by_input=False,
    ),
)


def _cube_face(direction: Any) -> Any:
    """Face and coordinates at once, as a user calls it."""
    from ..maths.directions import cube_face

    return cube_face(direction)

"""Plain float32 code, as shaders have it, held against the test vectors' float32 tolerances.

Each function is the textbook formula in NumPy float32, written here: a tolerance that such code
cannot keep would be of no use to anyone, one that a wrong formula keeps would be none.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ssr_ref.maths.sphere import intersect_sphere
from ssr_ref.study.rounding import FLOAT32
from ssr_ref.study.subjects import select
from ssr_ref.study.vectors import VectorSet, check, make

f32 = np.float32
Function = Callable[..., Any]


def dot(a: Any, b: Any) -> Any:
    return (a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])[:, None]


def reflect(d: Any, n: Any) -> Any:
    return d - f32(2) * dot(d, n) * n


def mirror_matrix(n: Any, offset: Any) -> Any:
    s = np.sqrt(dot(n, n))
    n, offset = n / s, offset / s[:, 0]
    m = np.zeros((n.shape[0], 4, 4), f32)
    m[:, :3, :3] = np.eye(3, dtype=f32) - f32(2) * n[:, :, None] * n[:, None, :]
    m[:, :3, 3] = f32(-2) * offset[:, None] * n
    m[:, 3, 3] = 1
    m[np.isnan(n).any(axis=1), 3, :] = (0, 0, 0, 1)
    return m


def decode_d3d(d: Any, near: Any, far: Any) -> Any:
    return near * far / (far - d * (far - near))


def decode_gl(d: Any, near: Any, far: Any) -> Any:
    return f32(2) * near * far / (far + near - d * (far - near))


def encode_d3d(z: Any, near: Any, far: Any) -> Any:
    return far / (far - near) - far * near / (far - near) / z


def octahedral_decode(c: Any) -> Any:
    z = f32(1) - np.abs(c[:, :1]) - np.abs(c[:, 1:])
    folded = (f32(1) - np.abs(c[:, ::-1])) * np.where(c >= 0, f32(1), f32(-1))
    d = np.concatenate([np.where(z < 0, folded, c), z], axis=1)
    return d / np.sqrt(dot(d, d))


def srgb_encode(x: Any) -> Any:
    curve = f32(1.055) * np.power(np.maximum(x, f32(1e-9)), f32(1 / 2.4)) - f32(0.055)
    return np.where(x <= f32(0.0031308), f32(12.92) * x, np.where(np.isnan(x), x, curve))


def srgb_decode(c: Any) -> Any:
    base = (np.maximum(c, f32(0)) + f32(0.055)) / f32(1.055)
    curve = np.power(base, f32(2.4))
    return np.where(c <= f32(0.04045), c / f32(12.92), np.where(np.isnan(c), c, curve))


def edge_fade(uv: Any, power: Any) -> Any:
    q = f32(2) * np.abs(uv - f32(0.5))
    f = np.clip(f32(1) - np.power(q, power[:, None]), f32(0), f32(1))
    return f[:, 0] * f[:, 1]


def cube_face(d: Any) -> Any:
    a = np.abs(d)
    face = np.where(
        (a[:, 2] >= a[:, 0]) & (a[:, 2] >= a[:, 1]), 4, np.where(a[:, 1] >= a[:, 0], 2, 0)
    )
    x, y, z = d.T
    along = np.take_along_axis(d, face[:, None] // 2, 1)[:, 0]
    face = face + (along < 0)
    s = np.choose(face, [-z, z, x, x, x, -x])
    t = np.choose(face, [-y, -y, z, -z, -y, -y])
    uv = f32(0.5) * (np.stack([s, t], 1) / np.abs(along)[:, None] + f32(1))
    none = ~(np.isfinite(d).all(axis=1) & (a.max(axis=1) > 0))
    return np.where(none, -1, face), np.where(none[:, None], f32(np.nan), uv)


def latlong_uv(d: Any) -> Any:
    x, y, z = d.T
    across = np.sqrt(x * x + z * z)
    u = np.where(across > 0, np.arctan2(x, -z) / f32(2 * np.pi) + f32(0.5), f32(0.5))
    uv = np.stack([u - np.floor(u), np.arctan2(across, y) / f32(np.pi)], 1)
    none = ~(np.isfinite(d).all(axis=1) & (np.abs(d).max(axis=1) > 0))
    return np.where(none[:, None], f32(np.nan), uv)


def sphere(form: Any) -> Function:
    def call(*arrays: Any) -> Any:
        found = intersect_sphere(*arrays, form=form, dtype=np.float32)
        return found.outcome, found.t

    return call


def two_sum(a: Any, b: Any) -> Any:
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


PLAIN: dict[str, Function] = {
    "two_sum": two_sum,
    "reflect_published": reflect,
    "mirror_matrix": mirror_matrix,
    "linear_depth_d3d": decode_d3d,
    "linear_depth_gl_ndc": decode_gl,
    "device_depth_d3d": encode_d3d,
    "octahedral_decode": octahedral_decode,
    "srgb_encode": srgb_encode,
    "srgb_decode": srgb_decode,
    "edge_fade": edge_fade,
    "cube_face": cube_face,
    "latlong_uv": latlong_uv,
    "intersect_sphere": sphere("hearn_baker"),
}


@pytest.fixture(scope="module")
def sets() -> dict[str, VectorSet]:
    return {s.title: make(s) for s in select(list(PLAIN))}


def found(vectors: VectorSet, function: Function) -> Any:
    """The finding of a float32 function; arguments are handed over as float32."""
    from dataclasses import replace

    def call(_: Any, *arrays: Any) -> Any:
        with np.errstate(all="ignore"):
            return function(*(a.astype(f32) if a.dtype == np.float64 else a for a in arrays))

    subject = replace(vectors.subject, call=call)
    return check(replace(vectors, subject=subject), function, to=FLOAT32)


@pytest.mark.parametrize("name", PLAIN)
def test_plain_float32_code_keeps_the_tolerance(sets: dict[str, VectorSet], name: str) -> None:
    finding = found(sets[name], PLAIN[name])
    assert [case for case in finding.failed if "NaN" not in case] == [], finding
    # Its errors are real: the tolerance is no formality.
    assert finding.worst_ulp > 0.0 or name == "two_sum"


WRONG: dict[str, tuple[str, Function]] = {
    "half the sphere's radius": (
        "intersect_sphere",
        lambda o, d, c, r: sphere("distance")(o, d, c, r / 2),
    ),
    "textbook roots far away": ("intersect_sphere", sphere("textbook")),
    "no cancellation seen": ("mirror_matrix", lambda n, d: mirror_matrix(n, d)[:, :, ::-1]),
    "1/2.2": ("srgb_encode", lambda x: np.power(np.maximum(x, f32(0)), f32(1 / 2.2))),
    "near and far swapped": ("linear_depth_d3d", lambda d, n, f: decode_d3d(f32(1) - d, n, f)),
    "v upwards": ("latlong_uv", lambda d: latlong_uv(d * f32([1, -1, 1]))),
    "ties to x": ("cube_face", lambda d: cube_face(d * f32([1.0000002, 1.0000001, 1]))),
    "no clamp": ("edge_fade", lambda uv, p: 1 - np.abs(2 * uv[:, 0] - 1) ** p),
    "error lost": ("two_sum", lambda a, b: (a + b, f32(0) * a)),
}


@pytest.mark.parametrize("mistake", WRONG)
def test_wrong_float32_code_does_not(sets: dict[str, VectorSet], mistake: str) -> None:
    name, function = WRONG[mistake]
    failed = [case for case in found(sets[name], function).failed if "NaN" not in case]
    assert failed != []

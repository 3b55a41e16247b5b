"""Octahedral normals, sRGB, fades and hashes to 60 digits, written from their definitions.

Independent of the kernels: other formulas where there are any, mpmath or integers throughout.
Arguments are Python floats or mpf; results are tuples of mpf, or of int for the hash. They are
computed with 160 digits, since 60 must be left where float32 numbers of any exponents cancel.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import mpmath
from mpmath import mpf

DIGITS = 160
F = TypeVar("F", bound=Callable[..., Any])


def _precise(function: F) -> F:
    @wraps(function)
    def call(*args: Any) -> Any:
        with mpmath.workdps(DIGITS):
            return function(*args)

    return call  # type: ignore[return-value]


@_precise
def octahedral_encode(x: Any, y: Any, z: Any) -> tuple[mpf, mpf]:
    """The point where the ray meets |x| + |y| + |z| = 1; a lower face turned over its side.

    Turning the face over the line |u| + |v| = 1 is a reflection of (u, v) about that line.
    """
    x, y, z = mpf(x), mpf(y), mpf(z)
    size = abs(x) + abs(y) + abs(z)
    u, v = x / size, y / size
    if z < 0:
        away = 1 - abs(u) - abs(v)  # to the line, times √2
        u, v = (u + away if x >= 0 else u - away), (v + away if y >= 0 else v - away)
    return u, v


@_precise
def octahedral_decode(u: Any, v: Any) -> tuple[mpf, mpf, mpf]:
    """The inverse: reflect what lies beyond |u| + |v| = 1 back, then divide by the length."""
    u, v = mpf(u), mpf(v)
    height = 1 - abs(u) - abs(v)
    beyond = max(-height, mpf(0))
    x = u - beyond if u >= 0 else u + beyond
    y = v - beyond if v >= 0 else v + beyond
    size = mpmath.sqrt(x * x + y * y + height * height)
    return x / size, y / size, height / size


@_precise
def srgb_encode(linear: Any) -> tuple[mpf]:
    """IEC 61966-2-1 with its decimal constants; the power as exp(log)."""
    x = mpf(linear)
    if x <= mpf("0.0031308"):
        return (mpf("12.92") * x,)
    return (mpf("1.055") * mpmath.exp(mpmath.log(x) / mpf("2.4")) - mpf("0.055"),)


@_precise
def srgb_decode(code: Any) -> tuple[mpf]:
    """IEC 61966-2-1 with its decimal constants; the power as exp(log)."""
    c = mpf(code)
    if c <= mpf("0.04045"):
        return (c / mpf("12.92"),)
    base = (c + mpf("0.055")) / mpf("1.055")
    return (mpmath.exp(mpf("2.4") * mpmath.log(base)),)


@_precise
def edge_fade(u: Any, v: Any, power: Any) -> tuple[mpf]:
    """Product over both axes of 1 − (distance to the middle / half the image)^power, never < 0."""
    product = mpf(1)
    for c in (mpf(u), mpf(v)):
        share = abs(c - mpf(1) / 2) / (mpf(1) / 2)
        fall = mpmath.exp(mpf(power) * mpmath.log(share)) if share else mpf(0)
        product *= max(1 - fall, mpf(0))
    return (product,)


NONE, PUBLISHED, LINEAR = 0, 1, 2
"""Kinds of `distance_fade`."""


@_precise
def distance_fade(length: Any, max_distance: Any, kind: int) -> tuple[mpf]:
    """1; (3/4)^share; 1 − share, never < 0."""
    share = mpf(length) / mpf(max_distance)
    if kind == NONE:
        return (mpf(1),)
    if kind == LINEAR:
        return (max(1 - share, mpf(0)),)
    return (min(mpmath.exp(share * mpmath.log(mpf(3) / 4)), mpf(1)),)


def pcg3d(x: int, y: int, z: int) -> tuple[int, int, int]:
    """Listing 16 of Jarzynski and Olano with unbounded integers, reduced modulo 2³² each time."""
    m = 2**32
    v = [(w * 1664525 + 1013904223) % m for w in (x, y, z)]
    for shift in (True, False):
        for i in range(3):
            v[i] = (v[i] + v[(i + 1) % 3] * v[(i + 2) % 3]) % m
        if shift:
            v = [w ^ (w // 65536) for w in v]
    return v[0], v[1], v[2]


@_precise
def jitter(x: int, y: int, seed: int) -> tuple[mpf]:
    """(first word without its last 8 bits + 2⁸) / 2³²."""
    word = pcg3d(x, y, seed)[0]
    return (mpf(word - word % 256 + 256) / 2**32,)


def _moved(key: str) -> Callable[..., mpf]:
    """Condition number of a case in its first argument, by a difference at 160 digits."""

    @_precise
    def condition(x: Any) -> mpf:
        (value,), (moved,) = ORACLES[key](x), ORACLES[key](mpf(x) * (1 + _STEP))
        return abs(moved - value) / (abs(value) * _STEP) if value else mpf(0)

    return condition


_STEP = mpf(2) ** -100

ORACLES: dict[str, Callable[..., tuple[Any, ...]]] = {
    "octahedral_encode": lambda d: octahedral_encode(*d),
    "octahedral_decode": lambda c: octahedral_decode(*c),
    "srgb_encode": srgb_encode,
    "srgb_decode": srgb_decode,
    "edge_fade": lambda uv, power: edge_fade(uv[0], uv[1], power),
    "distance_fade": lambda length, limit: distance_fade(length, limit, PUBLISHED),
    "pcg3d": pcg3d,
    "jitter": jitter,
}
CONDITIONS: dict[str, Callable[..., mpf]] = {
    "srgb_encode": _moved("srgb_encode"),
    "srgb_decode": _moved("srgb_decode"),
}
"""A key that is not here has 0: its bound holds as it is."""

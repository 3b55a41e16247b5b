"""Rays against triangles in exact rationals: slow, obvious, no rounding anywhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import NamedTuple

Point = tuple[Fraction, Fraction, Fraction]


class Crossing(NamedTuple):
    """Where a line crosses a triangle: t in units of the direction, weights of the corners.

    front: the line comes from the side that sees the corners counter-clockwise.
    """

    t: Fraction
    weights: tuple[Fraction, Fraction, Fraction]
    front: bool


def exact(p: Sequence[float]) -> Point:
    """A float64 point as rationals."""
    x, y, z = (Fraction(float(v)) for v in p)
    return x, y, z


def sub(a: Point, b: Point) -> Point:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def cross(a: Point, b: Point) -> Point:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def dot(a: Point, b: Point) -> Fraction:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def crossing(o: Point, d: Point, a: Point, b: Point, c: Point) -> Crossing | None:
    """The line o + t·d against the closed triangle; None beside it, in its plane, or without area.

    n·d ≠ 0 puts one point of the line on the plane; its weights are areas over the whole area.
    """
    n = cross(sub(b, a), sub(c, a))
    slope = dot(n, d)
    if slope == 0:
        return None
    t = dot(n, sub(a, o)) / slope
    p = (o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2])
    nn = dot(n, n)
    weights = (
        dot(cross(sub(c, b), sub(p, b)), n) / nn,
        dot(cross(sub(a, c), sub(p, c)), n) / nn,
        dot(cross(sub(b, a), sub(p, a)), n) / nn,
    )
    if min(weights) < 0:
        return None
    return Crossing(t, weights, slope < 0)


def nearest(
    o: Sequence[float],
    d: Sequence[float],
    triangles: Sequence[Sequence[Sequence[float]]],
    accepts: Callable[[int, Crossing], bool] = lambda t, c: True,
) -> tuple[int, Crossing | None]:
    """(number, crossing) of the first triangle ahead; the lower number at equal t; −1 for none."""
    start, direction = exact(o), exact(d)
    best: tuple[int, Crossing | None] = (-1, None)
    for i, corners in enumerate(triangles):
        a, b, c = (exact(p) for p in corners)
        found = crossing(start, direction, a, b, c)
        if found is None or not found.t > 0 or not accepts(i, found):
            continue
        if best[1] is None or found.t < best[1].t:
            best = (i, found)
    return best


def margin(o: Sequence[float], d: Sequence[float], corners: Sequence[Sequence[float]]) -> float:
    """How far inside (≥ 0) or outside the line passes, as the least of the corners' weights.

    −inf for a line in the triangle's plane.
    """
    start, direction = exact(o), exact(d)
    a, b, c = (exact(p) for p in corners)
    n = cross(sub(b, a), sub(c, a))
    slope = dot(n, direction)
    if slope == 0:
        return float("-inf")
    t = dot(n, sub(a, start)) / slope
    p = (start[0] + t * direction[0], start[1] + t * direction[1], start[2] + t * direction[2])
    edges = ((b, c), (c, a), (a, b))
    return float(min(dot(cross(sub(v, u), sub(p, u)), n) / dot(n, n) for u, v in edges))

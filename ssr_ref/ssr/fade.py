"""Fades: how much a hit is to be trusted, 1 fully, 0 not at all. Each is a factor of its own.

The published edge and distance fades, and the forms that engines use (docs/fades.md), each made of
a ramp from 0 to 1 and a shape. What is not a number is fully past its ramp: not trusted.
"""

from __future__ import annotations

import numpy as np

from .._jit import kernel
from ..vecmath.elementary import pow as power

NO_FADE, PUBLISHED, LINEAR, SQUARED = 0, 1, 2, 3
SMOOTHSTEP = 3
"""Kinds: PUBLISHED and SQUARED of the distance alone, SMOOTHSTEP of facing and residual."""
PRODUCT, SUM, MAX, AREA = 0, 1, 2, 3
"""How an edge fade puts both axes together."""
PUBLISHED_BASE = 0.75


@kernel
def clamp01(value: float) -> float:
    """value limited to [0, 1]."""
    if value < 0.0:
        return 0.0
    return 1.0 if value > 1.0 else value


@kernel
def edge_fade_axis(coordinate: float, exponent: float) -> float:
    """1 − (2·|c − ½|)^p of one uv coordinate, in [0, 1]: 1 in the middle, 0 at the border."""
    q = 2.0 * abs(coordinate - 0.5)
    if exponent == 2.0:
        return clamp01(1.0 - q * q)
    if exponent == 3.0:
        return clamp01(1.0 - q * q * q)
    return clamp01(1.0 - power(q, exponent))


@kernel
def edge_fade(u: float, v: float, exponent: float) -> float:
    """Product of the two axes' fades at uv; the published form has no clamp and goes negative."""
    return edge_fade_axis(u, exponent) * edge_fade_axis(v, exponent)


@kernel
def distance_fade(length: float, max_distance: float, kind: int) -> float:
    """0.75^(length/max) (published: still 0.75 at the maximum) or 1 − length/max."""
    if kind == NO_FADE or np.isinf(max_distance):
        return 1.0
    share = length / max_distance
    if kind == LINEAR:
        return clamp01(1.0 - share)
    return clamp01(power(PUBLISHED_BASE, share))


@kernel
def listed_edge_fade(u: float, v: float, exponent: float) -> float:
    """1 − (2·|uv − ½|)^p as published: |·| is the length of the vector, and nothing is clamped.

    It is below 0 beyond the ellipse that the image's sides touch, −1 in the corners for p = 2.
    """
    du, dv = 2.0 * (u - 0.5), 2.0 * (v - 0.5)
    squared = du * du + dv * dv
    if exponent == 2.0:
        return 1.0 - squared
    return 1.0 - power(np.sqrt(squared), exponent)


@kernel
def past(value: float, start: float, end: float) -> float:
    """How far value is on its way from start to end, 0 to 1; 1 if it is not a number."""
    if value <= start:
        return 0.0
    return (value - start) / (end - start) if value < end else 1.0


@kernel
def smoothstep(t: float) -> float:
    """3t² − 2t³ of t in [0, 1]."""
    return t * t * (3.0 - 2.0 * t)


@kernel
def raised(value: float, exponent: float) -> float:
    """value^exponent, with products instead of pow for the exponents 0 to 3."""
    if exponent == 0.0:
        return 1.0
    if exponent == 1.0:
        return value
    if exponent == 2.0:
        return value * value
    if exponent == 3.0:
        return value * value * value
    return power(value, exponent)


@kernel
def border_place(coordinate: float, side: float) -> float:
    """Where a uv coordinate is, 1 at the border: 1 less the distance to it, in units of which the
    half axis has `side`. With side 1 it is |2c − 1|, 0 in the middle.
    """
    place = 2.0 * abs(coordinate - 0.5)
    return place if side == 1.0 else 1.0 - (1.0 - place) * side


@kernel
def room(place: float, start: float, end: float) -> float:
    """Distance left to the end of a range in widths of it, 0 beyond; 0 if it is not a number."""
    return (end - place) / (end - start) if place < end else 0.0


@kernel
def shaped_edge_fade(
    u: float,
    v: float,
    smooth: bool,
    exponent: float,
    combine: int,
    start: float,
    end: float,
    side_x: float,
    side_y: float,
) -> float:
    """Edge fade of an engine's shape and combination; sides as in `border_place`, both 1 or more
    than 0.
    """
    x, y = border_place(u, side_x), border_place(v, side_y)
    if combine == AREA:
        area = room(x, start, end) * room(y, start, end)
        taken = 1.0 - area if area < 1.0 else 0.0
        return 1.0 - (smoothstep(taken) if smooth else raised(taken, exponent))
    x, y = past(x, start, end), past(y, start, end)
    if combine == MAX:
        taken = x if x > y else y
        return 1.0 - (smoothstep(taken) if smooth else raised(taken, exponent))
    x = smoothstep(x) if smooth else raised(x, exponent)
    y = smoothstep(y) if smooth else raised(y, exponent)
    return clamp01(1.0 - (x + y)) if combine == SUM else (1.0 - x) * (1.0 - y)


@kernel
def started_distance_fade(length: float, max_distance: float, kind: int, start: float) -> float:
    """`distance_fade`, or where it is LINEAR or SQUARED one that is 1 up to start·max_distance."""
    if kind != LINEAR and kind != SQUARED:
        return distance_fade(length, max_distance, kind)
    left = 1.0 - past(length / max_distance, start, 1.0)
    return left * left if kind == SQUARED else left


@kernel
def steps_fade(steps: int, max_steps: float, fade_out: float, fade_in: float) -> float:
    """(1 − g)^fade_out · g^fade_in of the share g = steps/max_steps, an exponent 0 gives 1."""
    share = past(steps / max_steps, 0.0, 1.0)
    return raised(1.0 - share, fade_out) * raised(share, fade_in)


@kernel
def facing_fade(facing: float, kind: int, start: float, end: float) -> float:
    """1 up to start, 0 from end; facing: how far a ray comes towards the eye, −1 to 1."""
    t = past(facing, start, end)
    return 1.0 - (smoothstep(t) if kind == SMOOTHSTEP else t)


@kernel
def residual_fade(residual: float, kind: int, end: float, exponent: float) -> float:
    """(1 − t)^exponent of the share t of end that a hit lies behind the surface; end may be inf."""
    t = past(residual, 0.0, end)
    return raised(1.0 - (smoothstep(t) if kind == SMOOTHSTEP else t), exponent)

"""Fades: how much a hit is to be trusted, 1 fully, 0 not at all. Each is a factor of its own."""

from __future__ import annotations

import numpy as np

from .._jit import kernel
from ..vecmath.elementary import pow as power

NO_FADE, PUBLISHED, LINEAR = 0, 1, 2
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

"""Bilinear filtering by exact rationals, written from the definition: no wrapped coordinates, only
wrapped indices, and weights of a convex sum instead of lerps."""

from __future__ import annotations

from fractions import Fraction
from math import floor
from typing import Any

import numpy as np

from ssr_ref.texture import Texture


def index(i: int, size: int, wrap: str) -> int:
    """The texel that position i of an endless row shows."""
    if wrap == "repeat":
        return i % size
    if wrap == "clamp":
        return min(max(i, 0), size - 1)
    i %= 2 * size
    return i if i < size else 2 * size - 1 - i


def decoded(code: int, greatest: int, srgb: bool) -> float:
    """IEC 61966-2-1, by libm: good to 2⁻⁵⁰."""
    value = code / greatest
    if not srgb:
        return value
    return float(value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4)


def sample(pixels: Any, texture: Texture, u: float, v: float, srgb: bool = True) -> np.ndarray:
    """(4,) RGBA at (u, v); the rotation must be 0."""
    assert texture.rotation == 0.0
    height, width = pixels.shape[:2]
    greatest = int(np.iinfo(pixels.dtype).max)
    x = (Fraction(u) * Fraction(texture.scale[0]) + Fraction(texture.offset[0])) * width
    y = (Fraction(v) * Fraction(texture.scale[1]) + Fraction(texture.offset[1])) * height
    x, y = x - Fraction(1, 2), y - Fraction(1, 2)
    total = [Fraction(0)] * 4
    for dy in (0, 1):
        for dx in (0, 1):
            i, j = floor(x) + dx, floor(y) + dy
            weight = (x - floor(x) if dx else 1 - (x - floor(x))) * (
                y - floor(y) if dy else 1 - (y - floor(y))
            )
            texel = pixels[index(j, height, texture.wrap[1]), index(i, width, texture.wrap[0])]
            for c in range(4):
                total[c] += weight * Fraction(decoded(int(texel[c]), greatest, srgb and c < 3))
    return np.array([float(t) for t in total])

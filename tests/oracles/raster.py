"""Rasterizing in exact arithmetic: whole numbers and fractions only, nothing of the project.

Coverage is decided by moving every pixel centre by (+ε, +ε²), ε → 0: a centre strictly inside is
covered and no moved centre lies on an edge, so an edge's two sides share no centre and lose none.
That is the top-left rule for y down: the move to the right enters through left edges, and on a
horizontal edge the move down enters through top edges. `covered_in_words` says the same in
Direct3D's words; a test compares both.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

Point = tuple[int, int]
"""A snapped window position in whole 1/256 px."""

SUBPIXELS = 256


def window(ndc: float | Fraction, side: int, *, down: bool = False) -> Fraction:
    """side/2 ± ndc·side/2 in pixels, exactly."""
    half = Fraction(side, 2)
    return half - Fraction(ndc) * half if down else half + Fraction(ndc) * half


def snap(position: Fraction | float) -> int:
    """The float64 value of a window coordinate in whole 1/256 px, ties to even."""
    return round(Fraction(float(position)) * SUBPIXELS)


def centres(size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """x (1, W) and y (H, 1) of the pixel centres in 1/256 px, int64."""
    width, height = size
    x = np.arange(width, dtype=np.int64)[None, :] * SUBPIXELS + SUBPIXELS // 2
    y = np.arange(height, dtype=np.int64)[:, None] * SUBPIXELS + SUBPIXELS // 2
    return x, y


def side_of(p: Point, q: Point, size: tuple[int, int]) -> np.ndarray:
    """(H, W) int8: 1 or −1 for the side of the line p → q on which each moved centre lies.

    0 only if p = q. The cross product is exact: coordinates below 2²⁹ keep it within int64.
    """
    dx, dy = q[0] - p[0], q[1] - p[1]
    assert max(abs(v) for v in (*p, *q)) < 2**29
    x, y = centres(size)
    cross = dx * (y - p[1]) - dy * (x - p[0])
    # On the line: the derivative along +x decides, and for a horizontal line that along +y.
    tie = np.sign(-dy) if dy != 0 else np.sign(dx)
    return np.where(cross != 0, np.sign(cross), tie).astype(np.int8)


def covered(triangle: Sequence[Point], size: tuple[int, int]) -> np.ndarray:
    """(H, W) bool: the centres that a triangle of either winding covers."""
    a, b, c = triangle
    sides = [side_of(a, b, size), side_of(b, c, size), side_of(c, a, size)]
    return (sides[0] != 0) & (sides[0] == sides[1]) & (sides[1] == sides[2])


def covered_in_words(triangle: Sequence[Point], size: tuple[int, int]) -> np.ndarray:
    """The same in the words of Direct3D's rasterization rules, pixel by pixel.

    A pixel is drawn if its centre is inside, or on a top edge (exactly horizontal and above the
    other edges) or on a left edge (not horizontal, on the left side of the triangle).
    """
    width, height = size
    out = np.zeros((height, width), bool)
    edges = [(triangle[i], triangle[(i + 1) % 3], triangle[(i + 2) % 3]) for i in range(3)]

    def cross(p: Point, q: Point, r: Point) -> int:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    if cross(*triangle) == 0:
        return out
    for j in range(height):
        for i in range(width):
            centre = (SUBPIXELS * i + SUBPIXELS // 2, SUBPIXELS * j + SUBPIXELS // 2)
            drawn = True
            for p, q, opposite in edges:
                towards = cross(p, q, centre) * cross(p, q, opposite)
                if towards > 0:
                    continue
                horizontal = p[1] == q[1]
                # Where the edge's line meets the opposite vertex's row, left of that vertex?
                left = not horizontal and (
                    Fraction(p[0]) + Fraction((q[0] - p[0]) * (opposite[1] - p[1]), q[1] - p[1])
                    < opposite[0]
                )
                top = horizontal and p[1] < opposite[1]
                if towards < 0 or not (left or top):
                    drawn = False
                    break
            out[j, i] = drawn
    return out


def inside_outline(outline: Sequence[Point], size: tuple[int, int]) -> np.ndarray:
    """(H, W) bool: even-odd rule for a closed polygon, by a ray to the right of moved centres."""
    _, y = centres(size)
    inside = np.zeros((size[1], size[0]), bool)
    for p, q in zip(outline, [*outline[1:], outline[0]]):
        if p[1] == q[1]:
            continue  # parallel to the ray; the move down takes the centre off its line
        low, high = (p, q) if p[1] < q[1] else (q, p)
        # Moved down by ε², a centre on a vertex's row lies below that vertex.
        spans = (y >= low[1]) & (y < high[1])
        # Downwards on the screen, the points left of low → high have a positive cross product.
        inside ^= spans & (side_of(low, high, size) > 0)
    return inside


def nearest_ids(layers: Iterable[np.ndarray], size: tuple[int, int]) -> np.ndarray:
    """(H, W) int32: the number of the first layer that covers each pixel, −1 for none."""
    ids = np.full((size[1], size[0]), -1, np.int32)
    for number, layer in enumerate(layers):
        ids[layer & (ids < 0)] = number
    return ids


@dataclass(frozen=True)
class Affine:
    """a·x + b·y + c at the centre of pixel (x, y)."""

    a: Fraction
    b: Fraction
    c: Fraction

    def at(self, x: int, y: int) -> Fraction:
        """The exact value at the centre of pixel (x, y)."""
        return self.a * x + self.b * y + self.c

    def reach(self, size: tuple[int, int]) -> Fraction:
        """|c| + |b|·H + |a|·W, the scale of the rounding error."""
        return abs(self.c) + abs(self.b) * size[1] + abs(self.a) * size[0]


def pixel_direction(
    clip_from_view: np.ndarray, size: tuple[int, int], x: Fraction, y: Fraction
) -> tuple[Fraction, Fraction]:
    """View X and Y at window position (x, y): at depth 1 (perspective), anywhere (orthographic).

    From the definition ndc_x = (P00·X + P02·z)/w + P03/w, px = W/2 + ndc_x·W/2, y down.
    """
    m = [[Fraction(float(v)) for v in row] for row in clip_from_view]
    ndc_x = x / Fraction(size[0], 2) - 1
    ndc_y = 1 - y / Fraction(size[1], 2)
    if m[3][2] != 0:  # w = −z = 1
        return (ndc_x + m[0][2]) / m[0][0], (ndc_y + m[1][2]) / m[1][1]
    return (ndc_x - m[0][3]) / m[0][0], (ndc_y - m[1][3]) / m[1][1]


def plane_of(
    clip_from_view: np.ndarray, size: tuple[int, int], triangle_vs: np.ndarray
) -> Affine | None:
    """1/depth (perspective) or depth (orthographic) of the triangle's plane over the pixels.

    triangle_vs: (3, 3) float64 view-space corners. None for a plane seen exactly edge-on.
    """
    v = [[Fraction(float(c)) for c in row] for row in triangle_vs]
    e = [v[1][i] - v[0][i] for i in range(3)]
    f = [v[2][i] - v[0][i] for i in range(3)]
    n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]]
    perspective = clip_from_view[3][2] != 0
    offset = sum(n[i] * v[0][i] for i in range(3))
    if (offset if perspective else n[2]) == 0:
        return None

    def value(x: int, y: int) -> Fraction:
        half = Fraction(1, 2)
        dx, dy = pixel_direction(clip_from_view, size, x + half, y + half)
        if perspective:  # the point d/k lies on the plane n·p = offset
            return (n[0] * dx + n[1] * dy - n[2]) / offset
        return -(offset - n[0] * dx - n[1] * dy) / n[2]

    origin = value(0, 0)
    return Affine(value(1, 0) - origin, value(0, 1) - origin, origin)


def project(clip_from_view: np.ndarray, size: tuple[int, int], p_vs: np.ndarray) -> list[Fraction]:
    """Exact window position (px, py) and view depth of a view-space point before the eye."""
    m = [[Fraction(float(v)) for v in row] for row in clip_from_view]
    p = [*(Fraction(float(v)) for v in p_vs), Fraction(1)]
    x, y, w = (sum(m[r][c] * p[c] for c in range(4)) for r in (0, 1, 3))
    return [window(x / w, size[0]), window(y / w, size[1], down=True), -p[2]]

"""Exact cells (spec 4.9): the walked pixels are those that exact rationals say, in their order.

`record` finds what `walk_cells` walks without changing it: every pixel can be hit and the walk
stops at its first; that pixel is emptied, and the walk asked again.
"""

from __future__ import annotations

from fractions import Fraction
from math import floor

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.cells import cells_crossed
from tracing import front_view, one_ray, point_of, resolved

from ssr_ref.buffers import Flag, Status
from ssr_ref.camera import ViewParams
from ssr_ref.ssr.hit import SlabRules
from ssr_ref.ssr.march_cells import march_cells
from ssr_ref.ssr.ray import Ray
from ssr_ref.ssr.trace import trace
from ssr_ref.vecmath.vec import Vec3

SIZE = (47, 33)
VIEW = front_view(False, SIZE)


@numba.njit(error_model="numpy")
def record(view: ViewParams, rules: SlabRules, ray: Ray, out: np.ndarray) -> int:
    """Rows of out: x, y, s at entry, of each walked cell; returns how many there are."""
    depth = np.full((view.height, view.width), np.float32(1.0))
    slabs = np.empty((view.height, view.width, 2))
    slabs[..., 0] = 1.0
    slabs[..., 1] = 1.0 + rules.thickness
    back = np.empty((0, 0), np.float32)
    normal = np.zeros((view.height, view.width, 3), np.float32)
    n = 0
    while True:
        walk = march_cells(view, rules, slabs, depth, back, normal, ray, 2**62, None)
        if not walk.hit.found:
            # Now all are empty: the count of tested cells must be the number recorded.
            return n if walk.cells == n else -1
        x, y = int(walk.hit.px), int(walk.hit.py)
        out[n, 0], out[n, 1], out[n, 2] = x, y, walk.hit.s
        slabs[y, x] = np.inf
        n += 1


def ray_of(p0: tuple[float, float], dp: tuple[float, float], end: float) -> Ray:
    """A ray whose depth is 1 everywhere, from P0 = p0; its own pixel is floor(p0)."""
    zero = Vec3(0.0, 0.0, 0.0)
    x, y = int(np.floor(p0[0])), int(np.floor(p0[1]))
    return Ray(
        False, x, y, *p0, *dp, 1.0, 0.0, end, 0, 1.0, zero, zero, 1.0, Vec3(0.0, 0.0, 1.0), -1.0
    )


def walked(p0: tuple[float, float], dp: tuple[float, float], end: float) -> np.ndarray:
    """(n, 3): x, y and entry of the cells that the package walks, its own pixel left out."""
    out = np.full((SIZE[0] + SIZE[1], 3), np.nan)
    n = record(VIEW, SlabRules(1.0, 0.0, 2.0**-24, False, False), ray_of(p0, dp, end), out)
    assert n >= 0
    return out[:n]


def check(p0: tuple[float, float], dp: tuple[float, float], end: float) -> int:
    """Compare one segment with the oracle; the number of cells."""
    cells = cells_crossed(p0, dp, end)
    i0 = tuple(int(np.floor(v)) for v in p0)
    last = [int(np.floor(Fraction(a) + Fraction(b) * Fraction(end))) for a, b in zip(p0, dp)]
    assert len(cells) == abs(last[0] - i0[0]) + abs(last[1] - i0[1]) + 1  # spec 4.9
    # The walk ends at the first cell outside the image.
    inside = []
    for cell in cells[1:]:
        if not (0 <= cell.x < SIZE[0] and 0 <= cell.y < SIZE[1]):
            break
        inside.append(cell)
    got = walked(p0, dp, end)
    assert got[:, :2].tolist() == [[c.x, c.y] for c in inside]
    entries = np.array([float(c.enter) for c in inside])
    # Each crossing is one division of a difference of two floats: three roundings, 2⁻⁵³ each.
    assert np.all(np.abs(got[:, 2] - entries) <= 3 * 2.0**-53 * np.maximum(entries, 1.0))
    return len(inside)


def test_random_segments() -> None:
    """Fifteen hundred random segments, some beyond the image, from any point of a pixel."""
    rng = np.random.default_rng(3)
    total = 0
    for _ in range(1500):
        p0 = (float(rng.uniform(0, SIZE[0])), float(rng.uniform(0, SIZE[1])))
        if rng.random() < 0.5:  # as every traced ray does: from a centre
            p0 = (np.floor(p0[0]) + 0.5, np.floor(p0[1]) + 0.5)
        minor = float(rng.uniform(-1, 1)) * float(rng.choice([1.0, 1.0, 1e-3, 1e-9]))
        dp = [float(rng.choice([-1.0, 1.0])), minor]
        if rng.random() < 0.5:
            dp.reverse()
        total += check(p0, (dp[0], dp[1]), float(rng.uniform(0.5, 60)))
    assert total > 15_000


@pytest.mark.parametrize("sign_x", [-1.0, 1.0])
@pytest.mark.parametrize("sign_y", [-1.0, 1.0])
@pytest.mark.parametrize("slope", [0.0, 2.0**-5, 0.125, 0.25, 0.5, 0.75, 1.0])
@pytest.mark.parametrize("start", [0.5, 0.0, 0.25])
def test_rows_columns_diagonals_and_corners(
    sign_x: float, sign_y: float, slope: float, start: float
) -> None:
    """Slopes that are exact in binary: rays meet corners and run along grid lines exactly."""
    for x, y in ((23, 16), (0, 0), (46, 32), (5, 30)):
        for end in (0.5, 0.75, 1.0, 7.5, 8.0, 30.0, 60.0):
            p0 = (x + start, y + start)
            check(p0, (sign_x, sign_y * slope), end)
            check(p0, (sign_x * slope, sign_y), end)
            check(p0, (sign_x, -0.0), end)
            check(p0, (-0.0, sign_y), end)


def test_the_rules_of_4_9_by_hand() -> None:
    """Written out: corners step x first; a ray along a grid line lies in the higher pixel."""
    # From (2.5, 2.5) along the diagonal to (5, 5): at each corner x steps first.
    assert walked((2.5, 2.5), (1.0, 1.0), 2.0)[:, :2].tolist() == [[3, 2], [3, 3], [4, 3], [4, 4]]
    # Upwards and to the left as well.
    assert walked((5.5, 5.5), (-1.0, -1.0), 1.0)[:, :2].tolist() == [[4, 5], [4, 4]]
    # Along y = 3 exactly, both ways: pixels of row 3, not 2.
    assert walked((2.5, 3.0), (1.0, 0.0), 2.0)[:, :2].tolist() == [[3, 3], [4, 3]]
    assert walked((4.5, 3.0), (-1.0, 0.0), 2.0)[:, :2].tolist() == [[3, 3], [2, 3]]
    # A segment that ends on a grid line lies in the higher pixel there: n = |Δix| + |Δiy| + 1.
    assert walked((2.5, 2.5), (1.0, 0.0), 1.5)[:, :2].tolist() == [[3, 2], [4, 2]]
    assert walked((4.5, 2.5), (-1.0, 0.0), 1.5)[:, :2].tolist() == [[3, 2]]


@settings(max_examples=300, deadline=None, derandomize=True)
@given(
    st.floats(0.0, 46.9999),
    st.floats(0.0, 32.9999),
    st.floats(-1.0, 1.0).filter(lambda v: v == 0.0 or abs(v) > 1e-200),
    st.booleans(),
    st.booleans(),
    st.floats(0.5, 100.0),
)
def test_any_segment_that_is_no_near_tie(
    x: float, y: float, minor: float, flip: bool, swap: bool, end: float
) -> None:
    major = -1.0 if flip else 1.0
    p0, dp = (x, y), (minor, major) if swap else (major, minor)
    cells = cells_crossed(p0, dp, end)
    # Near ties: crossings closer than two roundings, and an end that rounds across a border.
    ends = [(Fraction(a) + Fraction(b) * Fraction(end), a + end * b) for a, b in zip(p0, dp)]
    if any(floor(exact) != floor(rounded) for exact, rounded in ends):
        return
    gaps = [(c.leave - c.enter, c.leave) for c in cells[1:]]
    if any(0 < gap < 4 * Fraction(2) ** -52 * max(s, 1) for gap, s in gaps):
        return
    check(p0, dp, end)


def test_corners_of_slopes_that_are_not_exact_in_binary() -> None:
    """Slopes p/q are rounded, so floats might pass a corner on its other side; they do not here."""
    rng = np.random.default_rng(9)
    corners = other = 0
    for _ in range(1500):
        q = int(rng.integers(3, 12))
        p = int(rng.integers(1, q))
        p0 = (float(rng.integers(SIZE[0])) + 0.5, float(rng.integers(SIZE[1])) + 0.5)
        sign_x, sign_y = (float(s) for s in rng.choice([-1, 1], 2))
        exact = cells_crossed(p0, (sign_x, Fraction(p, q) * int(sign_y)), 40.25)
        got = {tuple(row[:2]) for row in walked(p0, (sign_x, sign_y * (p / q)), 40.25)}
        for cell in exact[1:]:
            if not (0 <= cell.x < SIZE[0] and 0 <= cell.y < SIZE[1]):
                break
            if cell.enter == cell.leave:
                corners += 1
                other += (cell.x, cell.y) not in got
            else:
                assert (cell.x, cell.y) in got
    # Measured: 1,739 corners, x first at each: the quotient rounds back to the tie.
    assert corners > 1000
    assert other == 0


@pytest.mark.parametrize("perspective", [True, False])
def test_through_the_tracer_only_crossed_pixels_can_be_hit(perspective: bool) -> None:
    """One hittable pixel at a time in a whole image: HIT exactly where the projected ray goes.

    The ray's pixels follow from its two ends in closed form: origin and the point where it
    leaves. A ray at constant depth is perpendicular to the view axis.
    """
    size = (13, 9)
    view = front_view(perspective, size)
    origin, depth, direction = (4, 5), 2.0, (1.0, 0.61, 0.0)
    end = point_of(view, 4.5, 5.5, depth) + 50.0 * np.array(direction)
    # Both projections are linear at constant depth, with the same scale in x and y.
    slope = (end[1] - point_of(view, 4.5, 5.5, depth)[1]) / 50.0
    cells = cells_crossed((4.5, 5.5), (1.0, -slope), 20.0)
    expected = {(c.x, c.y) for c in cells[1:] if 0 <= c.x < 13 and 0 <= c.y < 9}
    hits = set()
    for y in range(size[1]):
        for x in range(size[0]):
            g = one_ray(view, *origin, depth, direction)
            if (x, y) != origin:
                g.depth[y, x] = depth
            kw = {"tracer": "cells", "self_rejection": "none", "thickness_from": "constant"}
            out = trace(view, g, resolved(size, **kw))
            if out.status[origin[1], origin[0]] == Status.HIT:
                hits.add((x, y))
            else:
                assert out.flags[origin[1], origin[0]] in (0, Flag.OVER_EMPTY)
    assert hits == expected
    assert len(expected) >= 10

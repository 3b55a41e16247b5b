"""Barycentrics on screen: bounds, degenerate triangles, and beside the rasterizer's plane."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from maths_b_checks import (
    U,
    accuracy,
    barycentric_classes,
    barycentric_degenerate,
    barycentric_shares,
    barycentric_sliver,
    infos,
    worst_error,
)

import ssr_ref
from ssr_ref._jit import driver
from ssr_ref.maths import barycentric as m
from ssr_ref.raster import surface
from ssr_ref.study.oracle_maps import mp
from ssr_ref.study.sampling_maps import SAMPLES

STEADY = settings(derandomize=True, deadline=None, max_examples=80)
INFO = infos(m)["barycentrics"]


def test_errors_stay_within_the_stated_bound() -> None:
    accuracy(m, "barycentrics", n=600)


def test_bound_holds_for_numbers_of_53_bits() -> None:
    p, a, b, c, w = SAMPLES["barycentrics"](200, 31)
    rng = np.random.default_rng(2)
    # A sliver that is moved by its last bits is another triangle, and just as exact a question.
    b, c = (v * (1.0 + rng.integers(0, 2**20, v.shape) / 2.0**46) for v in (b, c))
    error, args = worst_error(INFO, (p, a, b, c, w))
    assert error <= INFO.bound, args


def test_degenerate_triangles_give_vertex_a() -> None:
    barycentric_degenerate(m)


def test_shares_are_not_negative_and_sum_to_1() -> None:
    barycentric_shares(m)


def test_a_sliver_across_the_whole_image() -> None:
    barycentric_sliver(m)


def test_what_gives_nan() -> None:
    barycentric_classes(m)


def test_a_triangle_by_hand() -> None:
    """On screen (0.6, 0.2, 0.2); over w = (1, 2, 4): 0.6, 0.1, 0.05 of 0.75."""
    got = ssr_ref.barycentrics((2, 2), (0, 0), (10, 0), (0, 10), (1, 2, 4))
    assert np.abs(got - [0.8, 2 / 15, 1 / 15]).max() <= U
    got = ssr_ref.barycentrics((2, 2), (0, 0), (10, 0), (0, 10), (1, 1, 1))
    assert np.abs(got - [0.6, 0.2, 0.2]).max() <= U


def test_a_point_outside_keeps_the_shares_of_the_nearer_vertices() -> None:
    got = ssr_ref.barycentrics((12, -2), (0, 0), (10, 0), (0, 10), (1, 1, 1))
    # On screen (0, 1.2, −0.2): the negative one becomes 0, the others are divided by 1.2.
    assert got.tolist() == [0.0, 1.0, 0.0]


grid = st.integers(-(2**17), 2**17).map(lambda k: k / 256.0)
point = st.tuples(grid, grid)


@given(p=point, a=point, b=point, c=point, power=st.integers(-60, 60))
@STEADY
def test_powers_of_two_and_a_common_w_change_nothing(p, a, b, c, power: int) -> None:
    w = np.array([1.0, 3.0, 5.0])
    got = ssr_ref.barycentrics(p, a, b, c, w)
    scale = 2.0**power
    scaled = [np.array(v) * scale for v in (p, a, b, c)]
    assert np.array_equal(ssr_ref.barycentrics(*scaled, w), got)
    assert np.array_equal(ssr_ref.barycentrics(p, a, b, c, w * scale), got)
    assert np.isfinite(got).all() and (got >= 0).all() and abs(got.sum() - 1.0) <= 4 * U


# --- Beside the rasterizer ------------------------------------------------------------------------


@driver(parallel=False)
def _raster_weights(view, triangles, x, y, out):
    for i in range(triangles.shape[0]):
        v0, v1, v2 = (
            surface.load(triangles[i], 0),
            surface.load(triangles[i], 1),
            surface.load(triangles[i], 2),
        )
        n = surface.plane_normal(v0, v1, v2)
        plane = surface.nearness_plane(view, n, v0, v1, v2)
        frame = surface.barycentric_frame(n, v0, v1, v2)
        b = surface.barycentric_at(frame, surface.surface_point(view, plane, x[i], y[i]))
        out[i, 0], out[i, 1], out[i, 2] = b.b0, b.b1, b.b2


def _exact_weights(view, triangle: np.ndarray, x: int, y: int) -> list:
    """Where the ray through the centre of (x, y) meets the triangle's plane, 60 digits."""
    f = mp.mpf
    ray = [
        (f(x) + f(0.5) - f(view.cx)) / f(view.fx),
        (f(view.cy) - f(y) - f(0.5)) / f(view.fy),
        f(-1),
    ]
    # Σ β_i·v_i = t·ray, Σ β_i = 1: by Cramer's rule β_i is det(ray, v_j, v_k) over their sum.
    v = [[f(float(c)) for c in corner] for corner in triangle]

    def det(a: list, b: list, c: list):
        return (a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
                + a[2] * (b[0] * c[1] - b[1] * c[0]))  # fmt: skip

    parts = [det(ray, v[1], v[2]), det(v[0], ray, v[2]), det(v[0], v[1], ray)]
    return [p / sum(parts) for p in parts]


def _cases(view, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """View-space triangles with a pixel centre inside: plain ones, thin ones, steep ones."""
    rng = np.random.default_rng(17)
    x, y = rng.integers(0, view.width, n), rng.integers(0, view.height, n)
    ray = np.stack([(x + 0.5 - view.cx) / view.fx, (view.cy - y - 0.5) / view.fy, -np.ones(n)], 1)
    centre = ray * (0.5 + 20.0 * rng.random((n, 1)))
    sides = rng.normal(size=(n, 2, 3)) * centre[:, None, 2:] * 0.3
    thin = 10.0 ** -rng.integers(0, 7, (n, 1))
    share = rng.dirichlet((1, 1, 1), n)
    e1, e2 = sides[:, 0], sides[:, 0] * rng.random((n, 1)) + sides[:, 1] * thin
    v0 = centre - share[:, 1:2] * e1 - share[:, 2:] * e2
    triangles = np.stack([v0, v0 + e1, v0 + e2], 1)
    keep = (triangles[:, :, 2] < -0.05).all(1)
    return triangles[keep], x[keep], y[keep]


RASTER_BOUND = 8.0
"""Of raster/surface.py: |b − exact| ≤ 8 · 2⁻⁵³ · κ (measured 2.7). The point on the plane moves
along its ray by a few roundings of |v|, the duals turn that into weights by L/|n|, and 1/cos of the
angle between ray and normal: κ = |v|·L/(|n|·cos)."""
SCREEN_BOUND = 4.0
"""Of `barycentrics` with projected vertices: the same κ, for rounding px and py moves the edges
(measured 0.9); for the pixels as they are given the bound is 7 · 2⁻⁵³ of each weight."""


@pytest.mark.parametrize("kind", ["pinhole", "off-axis"])
def test_beside_the_plane_of_the_rasterizer(kind: str) -> None:
    if kind == "pinhole":
        camera = ssr_ref.Camera.perspective(np.eye(4), 50.0, 37 / 23, near=0.1)
    else:
        camera = ssr_ref.Camera.frustum(np.eye(4), -0.3, 0.9, -0.6, 0.25, near=0.1)
    view = camera.params((37, 23))
    triangles, x, y = _cases(view, 700)
    assert len(triangles) > 400

    raster = np.empty((len(triangles), 3))
    _raster_weights(view, triangles, x, y, raster)
    depth = -triangles[:, :, 2]
    px = view.cx + view.fx * triangles[:, :, 0] / depth
    py = view.cy - view.fy * triangles[:, :, 1] / depth
    corners = [np.stack([px[:, i], py[:, i]], 1) for i in range(3)]
    screen = ssr_ref.barycentrics(np.stack([x + 0.5, y + 0.5], 1), *corners, depth)

    worst = {"raster": 0.0, "screen": 0.0}
    for i, t in enumerate(triangles):
        exact = _exact_weights(view, t, int(x[i]), int(y[i]))
        n = np.cross(t[1] - t[0], t[2] - t[0])
        ray = np.array([(x[i] + 0.5 - view.cx) / view.fx, (view.cy - y[i] - 0.5) / view.fy, -1.0])
        twice_area = np.sqrt((n * n).sum())
        cosine = abs((n * ray).sum()) / twice_area / np.sqrt((ray * ray).sum())
        longest = max(np.sqrt(((t[j] - t[j - 1]) ** 2).sum()) for j in range(3))
        size = np.sqrt((t * t).sum(axis=1).max())
        kappa = size * longest / (twice_area * cosine)
        for name, got in (("raster", raster[i]), ("screen", screen[i])):
            off = max(abs(mp.mpf(float(g)) - max(e, 0)) for g, e in zip(got, exact))
            worst[name] = max(worst[name], float(off) / (U * kappa))
    assert worst["raster"] <= RASTER_BOUND, worst
    assert worst["screen"] <= SCREEN_BOUND, worst


def test_shapes_and_errors() -> None:
    p = np.zeros((4, 1, 2))
    got = ssr_ref.barycentrics(p, (0, 0), np.ones((3, 2)), (0, 5), (1, 1, 1))
    assert got.shape == (4, 3, 3)
    assert ssr_ref.barycentrics(np.zeros((0, 2)), (0, 0), (1, 0), (0, 1), (1, 1, 1)).shape == (0, 3)
    for call, what in (
        (lambda: ssr_ref.barycentrics((1, 2, 3), (0, 0), (1, 0), (0, 1), (1, 1, 1)), "point_px h"),
        (lambda: ssr_ref.barycentrics((1, 2), (0, 0), (1, 0), (0, 1), (1, 1)), "w has shape"),
        (lambda: ssr_ref.barycentrics(p, (0, 0), (1, 0), (0, 1), np.ones((3, 2, 3))),
         "do not broadcast"),
    ):  # fmt: skip
        with pytest.raises(ssr_ref.SsrRefError, match=what):
            call()

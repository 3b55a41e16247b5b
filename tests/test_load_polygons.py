"""Polygons to triangles: areas, winding and the right triangles of concave ones."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_files import corners, only, write

from ssr_ref.meshfiles.meshes import load_mesh
from ssr_ref.meshfiles.polygons import triangulate

U = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]  # 3 × 3 less 1 × 2: area 7
ARROW = [(0, 0), (2, 1), (0, 2), (0.5, 1)]  # 2 less a triangle of ½: area 1.5
KEYHOLE = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]  # 16 − 4
COMB = [(0, 0), (4, 0), (4, 2), (3, 1), (2, 1), (1, 1), (0, 2)]  # collinear: 4 · 1 + 2 · ½
PLANES = {"xy": (0, 1, 2), "yz": (1, 2, 0), "zx": (2, 0, 1)}


def signed_areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(m, 3) twice the area times the normal of each triangle, divided by 2."""
    a, b, c = (points[triangles[:, k]].astype(np.float64) for k in range(3))
    return np.cross(b - a, c - a) / 2


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize(
    ("outline", "area"), [(U, 7.0), (ARROW, 1.5), (KEYHOLE, 12.0), (COMB, 5.0)]
)
def test_concave_polygons_from_every_corner(plane, back, outline, area):
    axes = PLANES[plane]
    for start in range(len(outline)):
        turned = outline[start:] + outline[:start]
        points = np.zeros((len(outline), 3), np.float32)
        points[:, axes[:2]] = turned[::-1] if back else turned
        n = np.array([len(outline)])
        found = triangulate(points, n, np.arange(len(outline)))
        assert found.fans == 0
        assert len(found.corners) == len(outline) - 2
        areas = signed_areas(points, found.corners)
        sign = -1.0 if back else 1.0
        # All wound as the outline, so a sum equal to the area leaves no overlap and no gap.
        assert (sign * areas[:, axes[2]] >= 0.0).all()
        assert abs(sign * areas[:, axes[2]].sum() - area) < 1e-12


def test_no_edge_runs_through_a_corner():
    """(2, 2) lies on the diagonal that would cut off the first corner: no triangle is empty."""
    outline = np.float32([(0, 0, 0), (4, 0, 0), (4, 4, 0), (2, 2, 0), (0, 4, 0)])
    found = triangulate(outline, np.array([5]), np.arange(5))
    assert sorted(signed_areas(outline, found.corners)[:, 2]) == [4.0, 4.0, 4.0]


def test_convex_and_bent_polygons_are_fans():
    hexagon = [(2, 0, 0), (1, 2, 0), (-1, 2, 0), (-2, 0, 0), (-1, -2, 0), (1, -2, 0)]
    saddle = [(0, 0, 0), (1, 0, 1), (1, 1, 0), (0, 1, 1)]  # not planar, convex from above
    points = np.array(hexagon + saddle, np.float32)
    found = triangulate(points, np.array([6, 4]), np.arange(10))
    fan = [[0, i, i + 1] for i in range(1, 5)] + [[6, 7, 8], [6, 8, 9]]
    assert found.corners.tolist() == fan
    assert found.polygon.tolist() == [0] * 4 + [1] * 2
    assert found.fans == 0


def test_what_has_no_ears_is_a_counted_fan():
    bow = [(0, 0, 0), (1, 1, 0), (1, 0, 0), (0, 1, 0)]
    nan = [(0, 0, 0), (np.nan, 1, 0), (1, 0, 0), (0, 1, 0)]
    point = [(1, 1, 1)] * 5
    star = [(0, 0, 0), (4, 3, 0), (-1, 3, 0), (3, 0, 0), (1.5, 5, 0), (1.5, -4, 0)]
    for shape in (bow, nan, point, star):
        n = len(shape)
        found = triangulate(np.array(shape, np.float32), np.array([n]), np.arange(n))
        assert found.fans == 1
        assert found.corners.tolist() == [[0, i, i + 1] for i in range(1, n - 1)]


def test_random_star_shapes_have_the_shoelace_area():
    rng = np.random.default_rng(8)
    for n in (5, 11, 60):
        angle = np.sort(rng.uniform(0, 2 * np.pi, n))
        r = rng.uniform(0.05, 1, n)
        points = np.stack([r * np.cos(angle), r * np.sin(angle), 0 * r], 1).astype(np.float32)
        found = triangulate(points, np.array([n]), np.arange(n))
        x, y = points[:, 0].astype(np.float64), points[:, 1].astype(np.float64)
        shoelace = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
        areas = signed_areas(points, found.corners)[:, 2]
        assert found.fans == 0
        assert (areas >= 0).all()
        assert abs(areas.sum() - shoelace) < 1e-13


def test_large_polygons_end():
    """A comb of 3000 teeth is clipped; 20,000 corners at random cross themselves and are a fan."""
    n = 3000
    x = np.arange(n)
    tops = np.stack([x, 1.0 + 9.0 * (x % 2), 0 * x], 1)
    comb = np.concatenate([[(0, 0, 0), (n - 1, 0, 0)], tops[::-1]]).astype(np.float32)
    found = triangulate(comb, np.array([n + 2]), np.arange(n + 2))
    assert found.fans == 0
    # Under n points at heights 1 and 10 in turn: n − 1 trapezoids of mean height 5.5.
    assert signed_areas(comb, found.corners)[:, 2].sum() == 5.5 * (n - 1)
    mess = np.random.default_rng(2).normal(size=(20_000, 3)).astype(np.float32)
    assert triangulate(mess, np.array([20_000]), np.arange(20_000)).fans == 1


def test_a_concave_polygon_of_a_file_keeps_its_uv(tmp_path):
    """ARROW from its second corner: the fan would cover the notch at (0.5, 1)."""
    outline = ARROW[1:] + ARROW[:1]
    text = "".join(f"v {x} {y} 0\nvt {x / 4} {y / 4}\n" for x, y in outline)
    primitive = only(load_mesh(write(tmp_path / "a.obj", text + "f 1/1 2/2 3/3 4/4\n")))
    for triangle, uv in zip(corners(primitive), corners(primitive, "uv0")):
        assert [[x / 4, y / 4] for x, y, _ in triangle] == uv
    areas = signed_areas(primitive.positions, primitive.faces)
    assert areas[:, 2].sum() == 1.5
    assert (areas[:, 2] > 0).all()

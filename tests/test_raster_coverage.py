"""Coverage against exact arithmetic, closed fans and grids, and images drawn by an NVIDIA H100."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import raster as oracle
from raster_drawing import ONE_SIDED, TWO_SIDED, draw, objects, pixel_camera, soup

from ssr_ref.camera import Camera
from ssr_ref.errors import SceneError
from ssr_ref.raster.clip_space import draw_clip_space
from ssr_ref.scene import Primitive

SIZE = (37, 23)
GPU = Path(__file__).parent / "data" / "gpu"


# --- Triangles of many kinds, in window pixels ----------------------------------------------------


def anywhere(rng: np.random.Generator, n: int) -> np.ndarray:
    """Vertices in and around the image."""
    return rng.uniform((-9, -7), (SIZE[0] + 9, SIZE[1] + 7), (n, 3, 2))


def slivers(rng: np.random.Generator, n: int) -> np.ndarray:
    """The third vertex within 1/64 px of the line through the other two."""
    t = anywhere(rng, n)
    t[:, 2] = t[:, 0] + (t[:, 1] - t[:, 0]) * rng.uniform(-0.5, 1.5, (n, 1))
    return t + rng.uniform(-1, 1, (n, 3, 2)) / 64 * (np.arange(3) == 2)[:, None]


def on_centres(rng: np.random.Generator, n: int) -> np.ndarray:
    """Every vertex on a pixel centre: vertices and many edge points are ties."""
    return rng.integers(-3, 12, (n, 3, 2)) + 0.5


def on_corners(rng: np.random.Generator, n: int) -> np.ndarray:
    """Every vertex on a pixel's corner; edges of slope 1/odd run through centres."""
    return rng.integers(-3, 12, (n, 3, 2)).astype(float)


def on_pixel_edges(rng: np.random.Generator, n: int) -> np.ndarray:
    """One coordinate whole or half, the other on the 1/256 grid."""
    t = rng.integers(-512, 8000, (n, 3, 2)) / 256
    return np.where(rng.random((n, 3, 2)) < 0.5, np.rint(2 * t) / 2, t)


def axis_aligned(rng: np.random.Generator, n: int) -> np.ndarray:
    """Right triangles with one horizontal and one vertical edge through centres, all turns."""
    low = rng.integers(-2, 12, (n, 2)) / 2 + 0.5
    high = low + rng.integers(1, 9, (n, 2)) / 2
    corners = np.stack([low, [low, high][0], high], axis=1)
    corners[:, 1, 0] = high[:, 0]
    flip = rng.random((n, 1, 2)) < 0.5
    corners = np.where(flip, low[:, None] + high[:, None] - corners, corners)
    return np.take_along_axis(corners, rng.random((n, 3)).argsort(axis=1)[:, :, None], axis=1)


def tiny(rng: np.random.Generator, n: int) -> np.ndarray:
    """A few 1/256 px wide, about a pixel centre."""
    centre = rng.integers(0, SIZE[1], (n, 1, 2)) + 0.5
    return centre + rng.integers(-3, 4, (n, 3, 2)) / 256


def big(rng: np.random.Generator, n: int) -> np.ndarray:
    """Many times the image."""
    return rng.uniform((-120, -70), (150, 90), (n, 3, 2))


def on_a_line(rng: np.random.Generator, n: int) -> np.ndarray:
    """Three points of a line, or two equal ones: nothing is covered."""
    t = rng.integers(-2, 12, (n, 3, 2)) / 2
    t[:, 2] = t[:, 0] + (t[:, 1] - t[:, 0]) * rng.integers(-2, 3, (n, 1))
    return t


KINDS = [
    anywhere, slivers, on_centres, on_corners, on_pixel_edges, axis_aligned, tiny, big, on_a_line
]  # fmt: skip


def clip_vertices(window_px: np.ndarray, w: float = 1.0) -> np.ndarray:
    """(n, 3, 4) float32 clip coordinates whose window position is near window_px."""
    ndc = window_px / (np.array(SIZE) / 2) - 1.0
    full = np.concatenate([ndc, np.zeros_like(ndc[..., :1]), np.ones_like(ndc[..., :1])], axis=-1)
    return (full * w).astype(np.float32)


def snapped_float64(v: np.ndarray) -> list[oracle.Point]:
    """Exact window coordinates of one float32 triangle with w = 1, snapped."""
    return [tuple(oracle.snap(oracle.window(float(p[c]), SIZE[c])) for c in (0, 1)) for p in v]


def snapped_gpu(v: np.ndarray) -> list[oracle.Point]:
    """float32 divide, scale and offset, each rounded (measured on an H100)."""
    half = np.float32(SIZE) / np.float32(2)
    ndc = v[:, :2] / v[:, 3:]
    assert ndc.dtype == np.float32
    position = ndc * half + half
    return [tuple(oracle.snap(float(c)) for c in p) for p in position]


# --- One triangle at a time -----------------------------------------------------------------------


def test_the_oracle_says_what_direct3d_says() -> None:
    """Moving centres by (+ε, +ε²) is the top-left rule in Direct3D's own words."""
    rng = np.random.default_rng(3)
    ties = 0
    for kind in (on_centres, on_corners, axis_aligned, on_a_line):
        for t in kind(rng, 25):
            points = [(round(256 * x), round(256 * y)) for x, y in t]
            by_words = oracle.covered_in_words(points, (13, 12))
            np.testing.assert_array_equal(oracle.covered(points, (13, 12)), by_words)
            if by_words.any():
                outline = oracle.inside_outline(points, (13, 12))
                np.testing.assert_array_equal(outline, by_words)
            ties += int(by_words.sum())
    assert ties > 500


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_coverage_is_exact(kind: object) -> None:
    """Every pixel of every triangle, both ways to snap, w = 1 and w = 3."""
    rng = np.random.default_rng(11)
    total = 0
    for window_px in kind(rng, 300):  # type: ignore[operator]
        v = clip_vertices(window_px[None])
        want = oracle.covered(snapped_float64(v[0]), SIZE)
        _, hits = draw_clip_space(v, SIZE, gpu_vertices=False)
        np.testing.assert_array_equal(hits, want, err_msg=repr(window_px))

        v = clip_vertices(window_px[None], 3.0)
        _, hits = draw_clip_space(v, SIZE, gpu_vertices=True)
        np.testing.assert_array_equal(hits, oracle.covered(snapped_gpu(v[0]), SIZE))
        total += int(want.sum())
    assert (total == 0) == (kind is on_a_line)


@settings(derandomize=True, deadline=None, max_examples=150)
@given(
    st.lists(st.tuples(st.integers(-700, 4000), st.integers(-700, 4000)), min_size=3, max_size=3)
)
def test_coverage_of_any_triangle_on_the_grid(points: list[tuple[int, int]]) -> None:
    """Vertices anywhere on the 1/256 px grid of a 16x8 image, where float32 ndc are exact.

    The same centres whatever the order of the vertices, so the winding cannot matter either.
    """
    size = (16, 8)
    want = oracle.covered(points, size)
    ndc = np.array(points) / 256 / np.array([8.0, 4.0]) - 1.0
    for order in ([0, 1, 2], [2, 1, 0], [1, 2, 0]):
        v = np.ones((1, 3, 4), np.float32)
        v[0, :, :2] = ndc[order]
        if (np.abs(v[..., :2]) > 8).any():
            return
        np.testing.assert_array_equal(draw_clip_space(v, size, gpu_vertices=False)[1], want)


def test_snapping_rounds_ties_to_even() -> None:
    """Window coordinates exactly between two 1/256 px: 2m + 1 halves go to the even neighbour.

    A right triangle's vertical edge at (j + ½)/256 px next to a centre at 128/256: rounded to 128
    (even; 127.5 and 128.5 both) the centre column is on the left edge and covered.
    """
    size = (2, 2)
    for halves, columns in ((255, 2), (257, 2), (259, 1)):  # 127.5, 128.5 → 128; 129.5 → 130
        x = halves / 512 - 1.0
        v = np.array([[[x, -8, 0, 1], [x, 8, 0, 1], [8, 0, 0, 1]]], np.float32)
        _, hits = draw_clip_space(v, size, gpu_vertices=False)
        assert hits.sum() == 2 * columns, halves


# --- Many triangles through the scene rasterizer --------------------------------------------------


@pytest.mark.parametrize("material", [TWO_SIDED, ONE_SIDED], ids=lambda m: m.name)
@pytest.mark.parametrize("perspective", [False, True])
def test_a_soup_of_layers_is_exact(perspective: bool, material: object) -> None:
    """Triangle i lies at depth 1 + i/8, so the first that covers a pixel is seen there.

    One-sided faces are seen where they turn counter-clockwise on the screen (y up).
    """
    rng = np.random.default_rng(17)
    camera = pixel_camera(SIZE)
    if perspective:
        camera = Camera.frustum(np.eye(4), 0.0, SIZE[0], -SIZE[1], 0.0, near=0.5)
    for kind in KINDS:
        for triangles in np.split(kind(rng, 120), 4):
            depth = np.ones((len(triangles), 3, 1)) + np.arange(len(triangles))[:, None, None] / 8
            xy = triangles * (1, -1) * (depth if perspective else 1.0)
            scene = soup(np.concatenate([xy, -depth], axis=2), material)  # type: ignore[arg-type]
            drawn = draw(scene, camera, SIZE)
            layers = []
            for t in range(len(triangles)):
                points = []
                for p in drawn.corners(t):
                    x, y, _ = oracle.project(camera.clip_from_view, SIZE, p)
                    points.append((oracle.snap(x), oracle.snap(y)))
                layer = oracle.covered(points, SIZE)
                (ax, ay), (bx, by), (cx, cy) = points
                clockwise = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay) > 0  # y down
                layers.append(layer & (material is TWO_SIDED or not clockwise))
            np.testing.assert_array_equal(
                drawn.g.triangle_id, oracle.nearest_ids(layers, SIZE), err_msg=kind.__name__
            )


# --- Closed shapes: each centre once --------------------------------------------------------------


def fan(centre: tuple[float, float], rng: np.random.Generator, spokes: int) -> np.ndarray:
    """(spokes, 3, 2) window positions of a closed fan with a jagged rim; slopes all round."""
    angle = np.arange(spokes) * (2 * np.pi / spokes)
    radius = rng.uniform(6.0, 16.0, spokes)[:, None]
    rim = centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rim = np.rint(rim * 4) / 4 if spokes < 40 else rim
    hub = np.broadcast_to(centre, rim.shape)
    return np.stack([hub, rim, np.roll(rim, -1, axis=0)], axis=1)


FANS = [
    (centre, spokes, seed)
    for seed, centre in enumerate(
        [(18.5, 11.5), (18.0, 11.0), (18.5, 11.0), (18.0, 11.5), (17.13, 10.77), (1.5, 22.5)]
    )
    for spokes in (7, 24, 360)
]


@pytest.mark.parametrize(("centre", "spokes", "seed"), FANS)
def test_a_fan_covers_each_centre_once(centre: tuple[float, float], spokes: int, seed: int) -> None:
    """Inside the snapped rim (even-odd rule, exact) every centre counts 1, outside 0."""
    window_px = fan(centre, np.random.default_rng(seed), spokes)
    v = clip_vertices(window_px)
    _, hits = draw_clip_space(v, SIZE, gpu_vertices=False)
    rim = [snapped_float64(t)[1] for t in v]
    want = oracle.inside_outline(rim, SIZE)
    np.testing.assert_array_equal(hits, want)
    _, hits = draw_clip_space(v, SIZE, gpu_vertices=True)
    rim = [snapped_gpu(t)[1] for t in v]
    np.testing.assert_array_equal(hits, oracle.inside_outline(rim, SIZE))
    assert hits.sum() > 40


@pytest.mark.parametrize(("centre", "spokes", "seed"), FANS)
def test_a_fan_in_a_scene_hides_a_second_one(
    centre: tuple[float, float], spokes: int, seed: int
) -> None:
    """Two equal layers, the nearer drawn last: the far one shows through at no pixel."""
    window_px = fan(centre, np.random.default_rng(seed), spokes)
    layers = [np.insert(window_px * (1, -1), 2, -depth, axis=2) for depth in (2.0, 1.0)]
    camera = pixel_camera(SIZE)
    drawn = draw(soup(np.concatenate(layers)), camera, SIZE)
    ids = drawn.g.triangle_id
    rim = []
    for t in range(spokes):
        x, y, _ = oracle.project(camera.clip_from_view, SIZE, drawn.corners(t)[1])
        rim.append((oracle.snap(x), oracle.snap(y)))
    inside = oracle.inside_outline(rim, SIZE)
    np.testing.assert_array_equal(ids >= spokes, inside)
    np.testing.assert_array_equal(ids >= 0, inside)


def mesh_grid(rng: np.random.Generator, *, pitch: float, offset: float, step: float) -> np.ndarray:
    """(n, 3, 2) triangles of a bent grid that covers the image; displacements on `step` px."""
    nx, ny = int(SIZE[0] / pitch) + 6, int(SIZE[1] / pitch) + 6
    grid = np.stack(np.meshgrid(np.arange(nx), np.arange(ny)), axis=-1) * pitch - 2 * pitch + offset
    most = int(0.24 * pitch / step)  # below a quarter of a cell no triangle turns over
    grid = grid + rng.integers(-most, most + 1, grid.shape) * step
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    other = rng.random(a.shape[:2]) < 0.5
    one = np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)
    two = np.stack([a, b, d], axis=2), np.stack([b, c, d], axis=2)
    halves = [np.where(other[..., None, None], q, p) for p, q in zip(one, two)]
    return np.concatenate([h.reshape(-1, 3, 2) for h in halves])


@pytest.mark.parametrize(
    ("pitch", "offset", "step"),
    [(3.0, 0.5, 0.5), (3.0, 0.0, 0.5), (5.0, 0.5, 1.0), (2.0, 0.25, 1 / 256), (0.8, 0.0, 1 / 256)],
)
def test_a_grid_covers_each_centre_once(pitch: float, offset: float, step: float) -> None:
    """A bent grid beyond all four borders: the hit counter is 1 in every pixel."""
    for seed in range(8):
        triangles = mesh_grid(np.random.default_rng(seed), pitch=pitch, offset=offset, step=step)
        order = np.random.default_rng(seed).permutation(len(triangles))
        for gpu in (False, True):
            ids, hits = draw_clip_space(clip_vertices(triangles[order]), SIZE, gpu_vertices=gpu)
            np.testing.assert_array_equal(hits, 1)
            assert (ids >= 0).all()


DRTK = [
    (0.5, 0.49993896484375),
    (0.5, 6.5),
    (6.50006103515625, 0.49993896484375),
    (6.5, 6.5),
]
"""DRTK issue 9, centres at whole numbers; the upper pair within 1/512 px of a row."""


@pytest.mark.parametrize("flipped", [False, True])
def test_drtk_issue_9(flipped: bool) -> None:
    """36 centres, 15 + 21, none twice: 6×6 centres of which the diagonal's 6 go to one side.

    The diagonal from top right to bottom left has triangle (3, 2, 1) to its right: its left edge.
    """
    faces = np.array([[0, 1, 2], [3, 2, 1]])
    faces = faces[:, ::-1] if flipped else faces
    points = np.array(DRTK) + 0.5  # our centres are at +½
    v = np.ones((2, 3, 4), np.float32)
    v[..., :2] = (points / 4.0 - 1.0)[faces]
    for gpu in (False, True):
        ids, hits = draw_clip_space(v, (8, 8), gpu_vertices=gpu)
        assert hits.max() == 1
        assert [int((ids == t).sum()) for t in (0, 1)] == [15, 21]

    positions = np.concatenate([points * (1, -1), np.full((4, 1), -1.0)], axis=1)
    scene = objects([(Primitive(positions.astype(np.float32), faces), None)], (TWO_SIDED,))
    ids = draw(scene, pixel_camera((8, 8)), (8, 8)).g.triangle_id
    assert [int((ids == t).sum()) for t in (0, 1)] == [15, 21]


# --- Images of a real GPU -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "gpu_differs", "float64_differs"),
    # Measured on the stored images (tests/data/gpu: NVIDIA H100, driver 580.159): float32
    # vertices as this GPU rounds them, and float64 window coordinates.
    [("small", 0, 1), ("big", 0, 0), ("sliver", 0, 4), ("persp", 19, 46)],
)
def test_equals_the_pixels_of_an_h100(name: str, gpu_differs: int, float64_differs: int) -> None:
    """Triangle ids differ in no pixel (perspective, w 0.5 to 20: in 19, 4 of them in coverage)."""
    stored = np.load(GPU / f"ids_{name}.npz")
    size = tuple(int(v) for v in stored["size"])
    ids, _ = draw_clip_space(stored["V"], size, gpu_vertices=True)
    assert int((ids != stored["ids"]).sum()) <= gpu_differs
    assert int(((ids < 0) != (stored["ids"] < 0)).sum()) <= (4 if name == "persp" else 0)
    ids, _ = draw_clip_space(stored["V"], size, gpu_vertices=False)
    assert int((ids != stored["ids"]).sum()) == float64_differs


def test_refuses_what_it_cannot_draw() -> None:
    good = np.ones((1, 3, 4), np.float32)
    for bad, words in (
        (good[0], "shape"),
        (good * [1, 1, 1, 0], "w <= 0"),
        (good * [np.nan, 1, 1, 1], "not finite"),
        (good * [8.001, 1, 1, 1], "8 times"),
    ):
        with pytest.raises(SceneError, match=words):
            draw_clip_space(bad, (4, 4))

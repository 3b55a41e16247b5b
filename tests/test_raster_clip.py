"""Clipping: vertices behind the eye and far off screen, ground planes, and what cannot be drawn."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from oracles import raster as oracle
from raster_drawing import ONE_SIDED, TWO_SIDED, Drawn, draw, objects, pixel_camera, quad, soup

from ssr_ref import transforms
from ssr_ref.camera import Camera, View, look_at
from ssr_ref.scene import Scene

SIZE = (37, 23)
MARGIN = 1 / 256 + 1e-6
"""Snapping moves an edge by up to 1/512 px in x and in y, so along its normal by less than this."""


def no_nan(drawn: Drawn) -> None:
    """No NaN in any image; finite depths exactly where something was drawn."""
    g = drawn.g
    for name, image in g.arrays().items():
        assert not np.isnan(image).any(), name
    np.testing.assert_array_equal(np.isfinite(g.depth), g.triangle_id >= 0)
    assert (g.depth > 0).all()


def settled(mask_at: object, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """(inside, certain): mask_at(px, py) at the centres, and where it holds MARGIN around them."""
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    inside = mask_at(x, y)  # type: ignore[operator]
    certain = np.ones_like(inside)
    for angle in np.arange(8) * (np.pi / 4):
        moved = mask_at(x + MARGIN * np.cos(angle), y + MARGIN * np.sin(angle))  # type: ignore[operator]
        certain &= moved == inside
    return inside, certain


# --- Vertices far outside the image ---------------------------------------------------------------


def half_planes(triangle_px: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """(inside, certain) of an unsnapped triangle, exact: distances to its lines in fractions."""
    p = [[Fraction(float(c)) for c in row] for row in triangle_px]
    area = (p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) - (p[2][0] - p[0][0]) * (p[1][1] - p[0][1])
    inside = np.ones(size[::-1], bool)
    certain = np.ones(size[::-1], bool)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        dx, dy = p[b][0] - p[a][0], p[b][1] - p[a][1]
        length = float(np.hypot(float(dx), float(dy)))
        for y in range(size[1]):
            for x in range(size[0]):
                half = Fraction(1, 2)
                e = dx * (y + half - p[a][1]) - dy * (x + half - p[a][0])
                e = e if area > 0 else -e
                inside[y, x] &= e > 0
                certain[y, x] &= abs(float(e)) > MARGIN * length
    return inside, certain


@pytest.mark.parametrize("reach", [3e4, 7e4, 1e5, 1e9])
def test_a_huge_triangle_covers_what_its_exact_shape_covers(reach: float) -> None:
    """Vertices at ±reach px (guard band 65,536 px), edges across the image in every direction."""
    size = (17, 11)
    rng = np.random.default_rng(int(reach))
    clipped = covered = 0
    for _ in range(12):
        towards = rng.uniform((0, 0), size, (3, 2))
        angle = rng.uniform(0, 2 * np.pi) + np.array([0, 2.1, 4.2])
        p = (towards + reach * np.stack([np.cos(angle), np.sin(angle)], 1)).astype(np.float32)
        p[2] = rng.uniform((0, 0), size)  # one vertex on screen, two edges through it
        inside, certain = half_planes(p, size)
        drawn = draw(soup([np.insert(p * (1, -1), 2, -2.0, axis=1)]), pixel_camera(size), size)
        ids = drawn.g.triangle_id
        np.testing.assert_array_equal((ids == 0)[certain], inside[certain])
        assert certain.mean() > 0.97
        np.testing.assert_array_equal(drawn.g.depth[ids == 0], 2.0)
        clipped += drawn.g.counts.clipped
        covered += int(inside.sum())
    assert clipped == {3e4: 0, 7e4: clipped}.get(reach, 12)
    assert clipped > 0 or reach == 3e4
    assert 100 < covered < 12 * 17 * 11 - 100


@pytest.mark.parametrize("reach", [70.0, 65500.0, 66000.0, 1e9])
@pytest.mark.parametrize("hub", [(18.5, 11.5), (18.0, 11.0), (3.3, 20.7)])
def test_clipped_fans_leave_no_crack(hub: tuple[float, float], reach: float) -> None:
    """Triangles of a fan with its rim at ±reach px, each drawn alone: every pixel sums to 1."""
    rim = reach * np.array([[1, 0.1], [0.7, 1], [-0.2, 1], [-1, 0.3], [-0.9, -1], [0.3, -1]])
    alone = np.zeros(SIZE[::-1], int)
    for a, b in pairwise([*rim, rim[0]]):
        p = np.array([hub, hub + a, hub + b]) * (1, -1)
        scene = soup([np.insert(p, 2, -1.0, axis=1)])
        alone += draw(scene, pixel_camera(SIZE), SIZE).g.triangle_id == 0
    np.testing.assert_array_equal(alone, 1)


def test_a_fan_through_the_near_plane_leaves_no_crack() -> None:
    """A floor of triangles around a point before the eye, the rim behind it and to its sides.

    Eye at height 1, horizontal: a centre below the image's middle line meets the floor. Edges run
    through w = 0 and through the near plane; each pixel of the floor sums to 1.
    """
    camera = Camera.perspective(np.eye(4), 70.0, SIZE[0] / SIZE[1], near=0.25)
    rim = np.array([[1, 0.2], [0.6, 1], [-0.5, 1], [-1, -0.1], [-0.4, -1], [0.8, -1]]) * 1e5
    total = np.zeros(SIZE[::-1], int)
    near_cut = 0
    for a, b in pairwise([*rim, rim[0]]):
        corners = [[x, -1.0, z] for x, z in (np.zeros(2), a, b) - np.array([0, 3.0])]
        drawn = draw(soup([corners]), camera, SIZE)
        no_nan(drawn)
        total += drawn.g.triangle_id == 0
        near_cut += int((drawn.corners(0)[:, 2] > 0).any())
    assert near_cut >= 3
    horizon = SIZE[1] / 2
    rows = np.arange(SIZE[1]) + 0.5
    np.testing.assert_array_equal(total[rows > horizon + MARGIN], 1)
    np.testing.assert_array_equal(total[rows < horizon - MARGIN], 0)


# --- The near and far planes ----------------------------------------------------------------------


def facing_quad(depth: float, half: float = 100.0) -> Scene:
    """A square across the view axis."""
    h = half
    return objects(
        [(quad((-h, -h, -depth), (h, -h, -depth), (h, h, -depth), (-h, h, -depth)), None)]
    )


@pytest.mark.parametrize("orthographic", [False, True])
def test_a_face_on_the_near_plane_is_drawn_and_one_before_it_is_not(orthographic: bool) -> None:
    make = Camera.orthographic if orthographic else Camera.perspective
    camera = make(np.eye(4), 60.0, SIZE[0] / SIZE[1], near=0.5)
    on = draw(facing_quad(0.5), camera, SIZE)
    np.testing.assert_array_equal(on.g.depth, 0.5)
    for depth in (0.5 - 2.0**-25, 0.25, 0.0, -0.5, -100.0):
        drawn = draw(facing_quad(depth), camera, SIZE)
        assert (drawn.g.triangle_id == -1).all(), depth
        assert (drawn.g.depth == np.inf).all()
        assert drawn.g.counts.outside == 2


@pytest.mark.parametrize("orthographic", [False, True])
def test_a_quad_across_the_near_plane_shows_its_far_part(orthographic: bool) -> None:
    """A wall at x = 0.3 from depth −10 to 10: seen where its depth at the centre is ≥ near."""
    near = 0.75
    make = Camera.orthographic if orthographic else Camera.perspective
    camera = make(
        look_at((0, 0, 0), (0.2, 0, -1)), 2.0 if orthographic else 60.0, 37 / 23, near=near
    )
    wall = quad((0.3, -50, 10), (0.3, 50, 10), (0.3, 50, -10), (0.3, -50, -10))
    drawn = draw(objects([(wall, None)], (TWO_SIDED,)), camera, SIZE)
    no_nan(drawn)
    v = camera.params(SIZE)
    corners = drawn.corners(0)
    n = np.cross(corners[1] - corners[0], corners[2] - corners[0])

    def seen(px: np.ndarray, py: np.ndarray) -> np.ndarray:
        """Closed form in world space: x = 0.3 on the ray, depth ≥ near, −10 ≤ z ≤ 10."""
        x, y = (px - v.cx) / v.fx, (v.cy - py) / v.fy
        offset = n @ corners[0]
        if orthographic:
            depth = -(offset - n[0] * x - n[1] * y) / n[2]
            z_ws = v.right_z * x + v.up_z * y - v.back_z * depth
        else:
            depth = offset / (n[0] * x + n[1] * y - n[2])
            z_ws = (v.right_z * x + v.up_z * y - v.back_z) * depth
        return (depth >= near) & (np.abs(z_ws) <= 10)

    inside, certain = settled(seen, SIZE)
    np.testing.assert_array_equal((drawn.g.triangle_id >= 0)[certain], inside[certain])
    assert 20 < inside.sum() < inside.size - 20
    assert drawn.g.counts.clipped == 2
    assert drawn.g.depth.min() >= near


@pytest.mark.parametrize("orthographic", [False, True])
def test_far_is_a_test_of_each_pixel(orthographic: bool) -> None:
    """A tilted plane: the pixels with depth ≤ far of an infinite camera, the others empty."""
    make = Camera.orthographic if orthographic else Camera.perspective
    plane = objects([(quad((-9, -9, -2), (9, -9, -4), (9, 9, -9), (-9, 9, -7)), None)])
    endless = draw(plane, make(np.eye(4), 4.0 if orthographic else 60.0, 37 / 23, near=0.5), SIZE)
    values = np.unique(endless.g.depth)
    assert np.isfinite(values).all()
    for far in (values[len(values) // 2], values[0], 5.0, values[0] / 1.5):
        camera = make(np.eye(4), 4.0 if orthographic else 60.0, 37 / 23, near=0.5, far=float(far))
        drawn = draw(plane, camera, SIZE)
        want = np.where(endless.g.depth <= far, endless.g.depth, np.inf)
        np.testing.assert_array_equal(drawn.g.depth, want)
        no_nan(drawn)


def ground(pitch: float, yaw: float, *, near: float, cells: int) -> tuple[np.ndarray, ...]:
    """Ids of a 1000×1000 ground seen from 0.1 above its middle, and the analytic mask."""
    turn, tilt = np.radians(yaw), np.radians(pitch)
    eye = np.array([0.3, 0.1, -0.2])
    forward = np.array([np.sin(turn) * np.cos(tilt), np.sin(tilt), -np.cos(turn) * np.cos(tilt)])
    camera = Camera.perspective(look_at(eye, eye + forward), 60.0, SIZE[0] / SIZE[1], near=near)
    line = np.linspace(-500, 500, cells + 1)
    quads = [
        quad((x0, 0, z1), (x1, 0, z1), (x1, 0, z0), (x0, 0, z0))
        for x0, x1 in pairwise(line)
        for z0, z1 in pairwise(line)
    ]
    drawn = draw(objects([(quads, None)]), camera, SIZE)
    no_nan(drawn)
    v = camera.params(SIZE)
    pose = camera.world_from_view

    def meets(px: np.ndarray, py: np.ndarray) -> np.ndarray:
        d_vs = np.stack([(px - v.cx) / v.fx, (v.cy - py) / v.fy, -np.ones_like(px)], axis=-1)
        d = d_vs @ pose[:3, :3].T
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = np.where(d[..., 1] < 0, -eye[1] / d[..., 1], np.nan)
            p = eye + depth[..., None] * d
            return (depth >= near) & (np.abs(p[..., [0, 2]]) <= 500).all(axis=-1)

    inside, certain = settled(meets, SIZE)
    return drawn.g.triangle_id, inside, certain


@pytest.mark.parametrize("cells", [1, 3])
@pytest.mark.parametrize("near", [0.001, 0.15])
def test_the_ground_from_close_above(near: float, cells: int) -> None:
    """tgx issue 47: each pixel whose ray meets the ground shows it, and no other."""
    some_sky = some_cut = 0
    for pitch in (0.0, -1.0, -10.0, -25.0, -45.0, -60.0):
        for yaw in np.arange(0, 360, 24.7):
            ids, inside, certain = ground(pitch, yaw, near=near, cells=cells)
            np.testing.assert_array_equal((ids >= 0)[certain], inside[certain], f"{pitch} {yaw}")
            assert certain.mean() > 0.94
            some_sky += int(pitch == 0.0 and not inside[0].any() and inside[-2].any())
            some_cut += int(pitch == -45.0 and inside[0].any() and not inside[-1].any())
    assert some_sky == 15
    assert some_cut == (15 if near == 0.15 else 0)


# --- What cannot be drawn -------------------------------------------------------------------------

GOOD = [[-1.0, -1.0, -3.0], [1.0, -1.0, -3.0], [0.0, 1.0, -3.0]]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_non_finite_vertex_draws_nothing(axis: int, value: float) -> None:
    """Only the triangles that use it are dropped, and counted; the image is that without them."""
    bad = np.array([GOOD, GOOD, GOOD])
    bad[[0, 1, 2], [0, 1, 2], axis] = value
    camera = Camera.perspective(np.eye(4), 60.0, SIZE[0] / SIZE[1], near=0.1)
    drawn = draw(soup([*bad, GOOD]), camera, SIZE)
    no_nan(drawn)
    assert drawn.g.counts.non_finite == 3
    assert drawn.g.counts.drawn == 1
    alone = draw(soup([GOOD]), camera, SIZE)
    np.testing.assert_array_equal(drawn.g.triangle_id, np.where(alone.g.triangle_id == 0, 3, -1))
    np.testing.assert_array_equal(drawn.g.depth, alone.g.depth)


def test_a_position_that_overflows_counts_as_non_finite() -> None:
    """float32 1e38 times a scale of 1e99 and a focal length of 1e200 leaves float64's range."""
    m = np.diag([1e99, 1e99, 1.0, 1.0])
    lens = Camera.frustum(np.eye(4), -1e-200, 1e-200, -1e-200, 1e-200, near=0.1)
    corners = np.array(GOOD) * (1e38, 1e38, 1.0)
    drawn = draw(soup([corners], transform=m), lens, SIZE)
    assert drawn.g.counts.non_finite == 1
    assert (drawn.g.triangle_id == -1).all()


def test_extreme_finite_positions_are_clipped() -> None:
    """Vertices at 1e137: the triangle covers every pixel, or the half of it before the eye."""
    m = np.diag([1e99, 1e99, 1.0, 1.0])
    camera = Camera.perspective(np.eye(4), 60.0, SIZE[0] / SIZE[1], near=0.1)
    for depths in ((-5, -5, -5), (-5, 5, -5), (4, -5, -5)):
        corners = np.array(GOOD) * (1e38, 1e38, 1.0)
        corners[:, 2] = depths
        drawn = draw(soup([corners], transform=m), camera, SIZE)
        no_nan(drawn)
        assert drawn.g.counts.clipped == 1
        assert (drawn.g.triangle_id == 0).any()


def test_triangles_without_area_are_dropped_and_counted() -> None:
    """Duplicate vertices, three equal ones, collinear ones; also inside a good mesh."""
    a, b, c = np.array(GOOD)
    nothing = [
        [a, a, b],
        [a, b, a],
        [b, a, a],
        [c, c, c],
        [a, b, (a + b) / 2],
        [a, b, 3 * b - 2 * a],
    ]
    for camera in (
        Camera.perspective(np.eye(4), 60.0, SIZE[0] / SIZE[1], near=0.1),
        Camera.orthographic(np.eye(4), 4.0, SIZE[0] / SIZE[1], near=0.1),
    ):
        drawn = draw(soup([*nothing, GOOD]), camera, SIZE)
        no_nan(drawn)
        assert drawn.g.counts.zero_area == len(nothing)
        assert set(np.unique(drawn.g.triangle_id)) == {-1, len(nothing)}


@pytest.mark.parametrize("orthographic", [False, True])
def test_edge_on_triangles_give_no_nan(orthographic: bool) -> None:
    """Planes through the eye (parallel to the view axis) up to rounding; pytorch3d 508.

    Where rounding or snapping lets one cover a centre, its depth stays within its own range.
    """
    pose = look_at((0.3, 0.2, 0.1), (0.1, -0.4, -2.0), (0.3, 1.0, 0.1))
    make = Camera.orthographic if orthographic else Camera.perspective
    camera = make(pose, 4.0 if orthographic else 60.0, SIZE[0] / SIZE[1], near=0.1)
    rng = np.random.default_rng(7)
    p = np.stack([rng.uniform(-3, 3, (4000, 3)), rng.uniform(-2, 2, (4000, 3))], axis=-1)
    depth = rng.uniform(1, 6, (4000, 3))
    if orthographic:
        p[:, 2] = p[:, 0] + (p[:, 1] - p[:, 0]) * rng.uniform(-1, 2, (4000, 1))
        view = np.concatenate([p, -depth[..., None]], axis=-1)
    else:
        view = np.concatenate([p * depth[..., None] / 3, -depth[..., None]], axis=-1)
        s, t = rng.uniform(0.1, 1, (2, 4000, 1))
        view[:, 2] = s * view[:, 0] + t * view[:, 1]
    world = view @ pose[:3, :3].T + pose[:3, 3]
    drawn = draw(soup(world), camera, SIZE)
    no_nan(drawn)
    seen = drawn.g.triangle_id >= 0
    assert seen.sum() > 10
    depths = -drawn.positions_vs[drawn.faces[drawn.g.triangle_id[seen]]][..., 2]
    assert (drawn.g.depth[seen] >= depths.min(axis=1) * (1 - 2.0**-52)).all()
    assert (drawn.g.depth[seen] <= depths.max(axis=1) * (1 + 2.0**-52)).all()
    np.testing.assert_allclose(np.linalg.norm(drawn.g.geo_normal_vs[seen], axis=-1), 1, atol=1e-15)


def stairs() -> Scene:
    """Risers and treads without gaps, closed above and below the image."""
    w, run, rise, n, low, front = 3.0, 0.7, 0.5, 12, -3.0, -2.0
    quads = [quad((-w, -99, front), (w, -99, front), (w, low, front), (-w, low, front))]
    for i in range(n):
        y, z, top, back = (
            low + i * rise,
            front - i * run,
            low + (i + 1) * rise,
            front - (i + 1) * run,
        )
        quads.append(quad((-w, y, z), (w, y, z), (w, top, z), (-w, top, z)))
        quads.append(quad((-w, top, z), (w, top, z), (w, top, back), (-w, top, back)))
    y, z = low + n * rise, front - n * run
    quads.append(quad((-w, y, z), (w, y, z), (w, 99, z), (-w, 99, z)))
    return objects([(quads, None)])


@pytest.mark.parametrize("far", [np.inf, 100.0])
def test_a_step_seen_edge_on_is_no_hole(far: float) -> None:
    """The eye within 1e-4 of a tread's plane: the tread is a sliver that may cover a centre alone.

    Snapping lets that centre lie just outside the true tread, where its plane has passed behind the
    eye (k ≤ 0). It must be drawn all the same: a shared edge covers each pixel exactly once, so an
    empty pixel between drawn ones is a hole in a closed surface.
    """
    scene = stairs()
    rng = np.random.default_rng(1)
    size = (19, 53)
    holes = clamped = 0
    for _ in range(1200):
        level = rng.choice([-0.5, 0.0, 0.5, 1.0]) + rng.choice([-1, 1]) * 10.0 ** -rng.uniform(4, 9)
        eye = (rng.uniform(-0.3, 0.3), level, 0.0)
        target = (eye[0] + rng.uniform(-0.1, 0.1), level + rng.uniform(-0.3, 0.3), -5.0)
        pose = look_at(eye, target, (rng.uniform(-0.2, 0.2), 1.0, 0.0))
        camera = Camera.perspective(pose, 20.0, 19 / 53, near=0.1, far=far)
        drawn = draw(scene, camera, size)
        holes += int((drawn.g.triangle_id < 0).sum())
        clamped += drawn.g.counts.clamped_depths
    assert clamped > 3
    assert holes == 0


# --- Sizes ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (37, 53), (300, 2), (2, 33)])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_every_size(size: tuple[int, int], dtype: type) -> None:
    """A full quad behind one triangle over the middle; coverage exact, images of one shape."""
    w, h = size
    p = np.array([[0.1 * w, 0.2 * h], [0.9 * w, 0.4 * h], [0.4 * w, 0.9 * h]]).astype(np.float32)
    front = np.insert(p * (1, -1), 2, -1.0, axis=1)
    back = np.array([[-1, 1, -2], [3 * w, 1, -2], [-1, -3 * h, -2]])
    camera = pixel_camera(size)
    drawn = draw(soup([back, front]), camera, size, dtype=dtype)
    points = [
        tuple(oracle.snap(c) for c in oracle.project(camera.clip_from_view, size, v)[:2])
        for v in drawn.corners(1)
    ]
    layer = oracle.covered(points, size)
    np.testing.assert_array_equal(drawn.g.triangle_id, layer.astype(int))
    np.testing.assert_array_equal(drawn.g.depth, np.where(layer, 1.0, 2.0))
    for name, image in drawn.g.arrays().items():
        assert image.shape[:2] == (h, w), name
        assert image.flags.c_contiguous, name
        assert image.dtype == (np.int32 if name.endswith("_id") else dtype), name


def test_an_empty_view() -> None:
    """Everything behind the eye or beside the view: depth inf, ids −1, the rest 0."""
    behind = [[-1.0, -1.0, 3.0], [1.0, -1.0, 3.0], [0.0, 1.0, 3.0]]
    beside = np.add(GOOD, (50.0, 0.0, 0.0))
    camera = View((0, 0, 0), (0, 0, -1)).camera(SIZE, 0.1)
    drawn = draw(soup([behind, beside], ONE_SIDED), camera, SIZE)
    images = drawn.g.arrays()
    for name in ("depth", "back_depth"):
        assert (images.pop(name) == np.inf).all(), name
    for name in ("triangle_id", "object_id", "material_id"):
        assert (images.pop(name) == -1).all(), name
    assert set(images) == {
        "geo_normal_vs", "normal_vs", "albedo", "reflectivity", "roughness", "radiance"
    }  # fmt: skip
    for name, image in images.items():
        assert (image == 0).all(), name
    assert drawn.g.counts.outside == drawn.g.counts.triangles == 2


def test_counts_add_up() -> None:
    """Each triangle is drawn, outside, culled, without area or non-finite: exactly one of them."""
    rng = np.random.default_rng(5)
    t = rng.uniform(-4, 4, (600, 3, 3))
    t[:20, 0] = np.nan
    t[20:50, 1] = t[20:50, 0]
    camera = Camera.perspective(look_at((0, 0, 3), (0, 0, 0)), 50.0, SIZE[0] / SIZE[1], near=0.5)
    for material in (ONE_SIDED, TWO_SIDED):
        scene = soup(t, material, transforms.scaling(1.0, 1.0, 1.0))
        for back in (True, False):
            c = draw(scene, camera, SIZE, back_depth=back).g.counts
            assert c.triangles == 600
            assert c.drawn + c.outside + c.culled + c.zero_area + c.non_finite == 600
            assert c.non_finite == 20
            assert c.zero_area >= 20
            assert (c.culled > 100) == (material is ONE_SIDED)
            assert c.clipped > 50

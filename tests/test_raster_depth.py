"""Depth against exact rational evaluation of the triangle's plane; float32; clamping; ties."""

from __future__ import annotations

from dataclasses import asdict
from fractions import Fraction

import numpy as np
import pytest
from oracles import raster as oracle
from raster_drawing import ONE_SIDED, Drawn, draw, objects, quad, soup

from ssr_ref.camera import Camera, look_at

SIZE = (17, 11)
ASPECT = SIZE[0] / SIZE[1]
TURNED = look_at((0.1, 0.2, 0.3), (0.7, 0.4, -1.1), (0.1, 1.0, 0.2))
CAMERAS = {
    "perspective": Camera.perspective(TURNED, 50.0, ASPECT, near=0.1),
    "straight": Camera.perspective(np.eye(4), 90.0, ASPECT, near=0.1),
    "off-axis": Camera.frustum(TURNED, -0.2, 0.7, -0.1, 0.9, near=0.1),
    "jittered": Camera.perspective(TURNED, 50.0, ASPECT, near=0.1).jittered(0.3, -0.4, SIZE),
    "narrow": Camera.perspective(TURNED, 0.5, ASPECT, near=0.1),
    "orthographic": Camera.orthographic(TURNED, 4.0, ASPECT, near=0.1),
    "orthographic, jittered": Camera.orthographic(TURNED, 4.0, ASPECT, near=0.1).jittered(
        -0.3, 0.25, SIZE
    ),
}


def in_view(rng: np.random.Generator, n: int, name: str) -> np.ndarray:
    """(n, 3, 3) view-space triangles about the image, depths 1 to 6."""
    across = 0.02 if name == "narrow" else 1.0
    x, y = rng.uniform(-3, 3, (n, 3)) * across, rng.uniform(-2, 2, (n, 3)) * across
    return np.stack([x, y, rng.uniform(-6, -1, (n, 3))], axis=-1)


def random(rng: np.random.Generator, name: str) -> np.ndarray:
    """Nothing special."""
    return in_view(rng, 20, name)


def slivers(rng: np.random.Generator, name: str) -> np.ndarray:
    """One vertex 1e-1 to 1e-6 from the opposite edge."""
    t = in_view(rng, 60, name)
    off = rng.normal(size=(60, 3)) * 10.0 ** -rng.uniform(1, 6, (60, 1))
    t[:, 2] = t[:, 0] + (t[:, 1] - t[:, 0]) * rng.uniform(0.2, 0.8, (60, 1)) + off
    return t


def large(rng: np.random.Generator, name: str) -> np.ndarray:
    """Up to a thousand times larger and farther."""
    return in_view(rng, 20, name) * rng.uniform(0.5, 1000, (20, 3, 1))


def through_near(rng: np.random.Generator, name: str) -> np.ndarray:
    """Vertices on both sides of the eye."""
    t = in_view(rng, 20, name) * 10
    t[..., 2] *= rng.choice([-1, 1], (20, 3))
    return t


def one_far_vertex(rng: np.random.Generator, name: str) -> np.ndarray:
    """The first vertex 1e5 times as far: its edges round by an ulp of 1e5."""
    t = in_view(rng, 20, name)
    t[:, 0] *= 1e5
    return t


def edge_on(rng: np.random.Generator, name: str) -> np.ndarray:
    """Planes that pass the eye within 1e-1 to 1e-5."""
    t = in_view(rng, 200, name)
    off = rng.normal(size=(200, 3)) * 10.0 ** -rng.uniform(1, 5, (200, 1))
    t[:, 2] = t[:, 0] * 0.5 + t[:, 1] * 0.7 + off
    return t


KINDS = [random, slivers, large, through_near, one_far_vertex, edge_on]


def range_of(drawn: Drawn, t: int, near: float) -> tuple[Fraction, Fraction]:
    """Least and greatest depth of triangle t's part beyond the near plane."""
    depths = [Fraction(float(-z)) for z in drawn.corners(t)[:, 2]]
    return max(min(depths), Fraction(near)), max(depths)


def check_depths(drawn: Drawn, camera: Camera, size: tuple[int, int]) -> tuple[int, float]:
    """Every visible depth: within the promised error of the exact plane, within its range.

    The plane's value outside the triangle's own range (snapping lets a centre lie outside) must be
    clamped to the range: the range's end is then what the depth is compared with. Returns the
    number of pixels and the worst error in units of 2⁻⁵³ · reach/k.
    """
    planes: dict[int, oracle.Affine | None] = {}
    worst = 0.0
    count = 0
    for y, x in np.argwhere(drawn.g.triangle_id >= 0):
        t = int(drawn.g.triangle_id[y, x])
        if t not in planes:
            planes[t] = oracle.plane_of(camera.clip_from_view, size, drawn.corners(t))
        plane = planes[t]
        depth = Fraction(float(drawn.g.depth[y, x]))
        low, high = range_of(drawn, t, camera.near)
        slack = Fraction(1, 2**52)  # 1/(1/z) is within an ulp of z
        assert low * (1 - slack) <= depth <= high * (1 + slack)
        if plane is None:
            continue
        value = plane.at(int(x), int(y))
        if camera.is_perspective:
            want = 1 / value if value > 0 else high
            bound = plane.reach(size) / value if value > 0 else Fraction(1)
        else:
            want = value
            bound = plane.reach(size) / abs(value) if value != 0 else Fraction(1)
        want = min(max(want, low), high)
        # Spec 3.3, in Fractions, so the check itself rounds nothing.
        units = float(abs(depth - want) / want / bound * 2**53)
        worst = max(worst, units)
        assert units <= 32, (t, x, y, units)
        count += 1
    return count, worst


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("name", CAMERAS)
def test_depth_is_the_exact_planes(name: str, kind: object) -> None:
    """Relative error ≤ 32·2⁻⁵³ (|kC| + |kB|·H + |kA|·W)/k before rounding to float32 (spec 3.3)."""
    camera = CAMERAS[name]
    view_space = kind(np.random.default_rng(2), name)  # type: ignore[operator]
    world = view_space @ camera.world_from_view[:3, :3].T + camera.world_from_view[:3, 3]
    drawn = draw(soup(world), camera, SIZE)
    count, _ = check_depths(drawn, camera, SIZE)
    assert count >= (1 if kind in (slivers, edge_on) else 30)


@pytest.mark.parametrize("half", [5.0, 500.0, 5000.0])
@pytest.mark.parametrize(
    "towards", [(1.0, -0.3, -1.0), (0.3, -0.05, -1.0), (0.2, -1.7, 0.3)], ids=str
)
def test_depth_of_a_floor_from_close_above(half: float, towards: tuple[float, ...]) -> None:
    """The same bound where |n·v| is thousands of times below |n|·|v|: a floor seen from 0.1."""
    eye = np.array([0.013, 0.1, 0.02])
    camera = Camera.perspective(look_at(eye, eye + towards), 60.0, ASPECT, near=0.05)
    floor = quad((-half, 0, half), (half, 0, half), (half, 0, -half), (-half, 0, -half))
    drawn = draw(objects([(floor, None)]), camera, SIZE)
    count, _ = check_depths(drawn, camera, SIZE)
    assert count > 90


def test_a_face_across_the_axis_has_its_own_depth() -> None:
    """Parallel to the image: every pixel has the vertices' depth, to the last bit of 1/(1/z)."""
    for depth in (1.0, 2.0, 3.0, 0.7, 12345.678, 1e-3):
        z = float(np.float32(depth))
        h = 99 * (1 + z)
        face = quad((-h, -h, -z), (h, -h, -z), (h, h, -z), (-h, h, -z))
        for orthographic in (False, True):
            make = Camera.orthographic if orthographic else Camera.perspective
            camera = make(np.eye(4), 40.0, ASPECT, near=2.0**-11)
            got = draw(objects([(face, None)]), camera, SIZE).g.depth
            assert np.unique(got).size == 1
            np.testing.assert_array_max_ulp(got, np.full_like(got, z), 0 if orthographic else 1)


def splinters(camera: Camera, rng: np.random.Generator, n: int) -> np.ndarray:
    """(n, 3, 3) view-space triangles 1/300 px thin on screen and 5 units deep, about centres."""
    view = camera.params(SIZE)
    centre = np.stack([rng.integers(0, side, n) + 0.5 for side in SIZE], axis=1)
    angle = rng.uniform(0, 2 * np.pi, n)
    along, off = rng.uniform(-3, 3, (n, 3)), rng.normal(size=(n, 3)) / 300
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    px = centre[:, None, 0] + along * cosine - off * sine
    py = centre[:, None, 1] + along * sine + off * cosine
    depth = rng.uniform(1, 6, (n, 3))
    x, y = (px - view.cx) / view.fx, (view.cy - py) / view.fy
    if camera.is_perspective:
        x, y = x * depth, y * depth
    return np.stack([x, y, -depth], axis=-1)


@pytest.mark.parametrize("name", ["perspective", "off-axis", "orthographic"])
def test_clamped_depths_are_counted(name: str) -> None:
    """Steep planes: the count is that of the pixels whose exact plane leaves the triangle's range.

    Within the error bound of an end either answer is right, so the count lies between two counts.
    """
    camera = CAMERAS[name]
    view_space = splinters(camera, np.random.default_rng(8), 1600)
    world = view_space @ camera.world_from_view[:3, :3].T + camera.world_from_view[:3, 3]
    drawn = draw(soup(world), camera, SIZE)
    surely = perhaps = 0
    for y, x in np.argwhere(drawn.g.triangle_id >= 0):
        t = int(drawn.g.triangle_id[y, x])
        plane = oracle.plane_of(camera.clip_from_view, SIZE, drawn.corners(t))
        assert plane is not None
        value = plane.at(int(x), int(y))
        low, high = range_of(drawn, t, camera.near)
        if camera.is_perspective:
            low, high = 1 / high, 1 / low
        slack = 32 * plane.reach(SIZE) / 2**53 + high / 2**52
        surely += value < low - slack or value > high + slack
        perhaps += value < low + slack or value > high - slack
    assert surely <= drawn.g.counts.clamped_depths <= perhaps
    assert surely >= 10
    check_depths(drawn, camera, SIZE)

    # All the same the normal faces the eye: n·d < 0 for the centre's ray (spec 3.5).
    view = camera.params(SIZE)
    y, x = np.nonzero(drawn.g.triangle_id >= 0)
    d = np.stack(
        [(x + 0.5 - view.cx) / view.fx, (view.cy - y - 0.5) / view.fy, -np.ones(len(x))], 1
    )
    if not camera.is_perspective:
        d[:, :2] = 0.0
    assert ((drawn.g.geo_normal_vs[y, x] * d).sum(axis=1) < 0).all()


def test_float32_is_float64_rounded_once() -> None:
    """Spec 1.4: every float image of the float32 G-buffer, clamped pixels and back depth too."""
    rng = np.random.default_rng(4)
    world = in_view(rng, 60, "") @ TURNED[:3, :3].T + TURNED[:3, 3]
    normals = rng.normal(size=(180, 3)).astype(np.float32)
    colors = rng.random((180, 3)).astype(np.float32)
    for name, camera in CAMERAS.items():
        if name == "narrow":
            continue
        scene = soup(world, ONE_SIDED, normals=normals, colors=colors)
        double = draw(scene, camera, SIZE).g
        single = draw(scene, camera, SIZE, dtype=np.float32).g
        assert np.isfinite(double.back_depth).any()
        for image, wide in double.arrays().items():
            narrow = single.arrays()[image]
            assert narrow.dtype == (np.int32 if wide.dtype == np.int32 else np.float32)
            np.testing.assert_array_equal(narrow, wide.astype(narrow.dtype), err_msg=image)
        assert asdict(single.counts) == asdict(double.counts)


@pytest.mark.parametrize("orthographic", [False, True])
def test_equal_depth_goes_to_the_lower_id(orthographic: bool) -> None:
    """Coplanar duplicates, in one object and in the next: the first of them is seen everywhere."""
    make = Camera.orthographic if orthographic else Camera.perspective
    camera = make(np.eye(4), 3.0 if orthographic else 60.0, ASPECT, near=0.1)
    face = quad((-9, -9, -2.3), (9, -9, -3.1), (9, 9, -4.7), (-9, 9, -3.9))
    nearer = quad((-0.5, -9, -1.0), (0.5, -9, -1.0), (0.5, 9, -1.0), (-0.5, 9, -1.0))
    alone = draw(objects([(face, None), (nearer, None)]), camera, SIZE).g
    assert set(np.unique(alone.triangle_id)) == {0, 1, 2, 3}
    many = draw(objects([((face, face), None), (nearer, None), (face, None)]), camera, SIZE).g
    want = np.where(alone.triangle_id >= 2, alone.triangle_id + 2, alone.triangle_id)
    np.testing.assert_array_equal(many.triangle_id, want)
    np.testing.assert_array_equal(many.depth, alone.depth)
    assert many.object_id.max() == 1

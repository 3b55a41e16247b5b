"""Closed-form reflections: the marker by exact rationals, plane mirrors by mirroring the scene,
curved ones by the law of reflection, and every class by a scene made for it.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from closed_form import NEAR, front, scene_of
from tracing import pixel_rays, window_of

from ssr_ref import SsrRefError, transforms
from ssr_ref.analytic import (
    AnalyticReflections,
    AnalyticScene,
    Box,
    Disc,
    Plane,
    Sphere,
    TruthClass,
    analytic_gbuffer,
    analytic_reflections,
)
from ssr_ref.analytic.arrays import shape_arrays
from ssr_ref.analytic.cast import Rays, cast, eye_rays, pixel_centers
from ssr_ref.analytic.ray import ABOVE_ZERO
from ssr_ref.analytic.scenes import (
    SCENES,
    along_the_axis,
    clutter,
    inside_a_sphere,
    marker,
    rows_columns_diagonals,
    sphere_reflecting_sphere,
)
from ssr_ref.camera import Camera

SIZE = (37, 23)
MIDDLE = (11, 18)


def camera_of(scene: AnalyticScene, size: tuple[int, int]) -> Camera:
    assert scene.view is not None
    return scene.view.camera(size, NEAR)


def reflections(scene: AnalyticScene, size: tuple[int, int]) -> AnalyticReflections:
    return analytic_reflections(scene, camera_of(scene, size), size)


def test_the_marker_to_a_billionth_of_a_pixel() -> None:
    """Every pixel in rationals.

    The pixel's ray (a, b, −1)·t turns over at y = −1 and is at z = −4 when t = 4: there x = 4a and
    y = −2 − 4b. It is on the marker if (x − 1/2)² + (y + 1/4)² ≤ 1/64. The marker stands at depth 4
    and is seen at pixel (W/2 + H/2·x/4, H/2 − H/2·y/4), with nothing before it.
    """
    size = (321, 241)
    width, height = size
    half = Fraction(height, 2)
    slopes_x = [(Fraction(2 * x + 1 - width, 2)) / half for x in range(width)]
    slopes_y = [(Fraction(height - 2 * y - 1, 2)) / half for y in range(height)]
    truth = reflections(marker(), size)
    on_marker = np.zeros((height, width), bool)
    for x, a in enumerate(slopes_x):
        if abs(4 * a - Fraction(1, 2)) > Fraction(1, 8):
            continue
        for y, b in enumerate(slopes_y):
            if not (b < 0 and -1 / b < 4):  # above the horizon, or the floor beyond the marker
                continue
            mx, my = 4 * a, -2 - 4 * b
            if (mx - Fraction(1, 2)) ** 2 + (my + Fraction(1, 4)) ** 2 > Fraction(1, 64):
                continue
            on_marker[y, x] = True
            where = [float(Fraction(width, 2) + half * mx / 4), float(half - half * my / 4)]
            assert np.abs(truth.hit_px[y, x] - where).max() < 1e-9
            assert abs(truth.hit_depth[y, x] - 4.0) < 1e-14
            length = float((4 + 1 / b) ** 2 * (a * a + b * b + 1)) ** 0.5  # t from −1/b to 4
            assert truth.distance[y, x] == pytest.approx(length, rel=1e-14)
            assert truth.point_ws[y, x] == pytest.approx([float(mx), float(my), -4.0], abs=1e-14)
    assert on_marker.sum() > 40
    assert np.array_equal(truth.truth == TruthClass.VISIBLE, on_marker)
    assert np.array_equal(truth.shape_id == 1, on_marker)
    assert truth.front[on_marker].all() and truth.leaves_front[on_marker].all()
    assert np.isnan(truth.hit_px[~on_marker]).all()


def test_one_pixel_of_the_marker_by_hand() -> None:
    """32 × 32 pixels, 16 a unit of slope. Pixel (17, 23): a = 3/32, b = −15/32, so x = 3/8 and
    y = −1/8, which is (−1/8, 1/8) from the marker's centre: 1/32 > 1/64, beside it. A disc of twice
    the radius has it, at (16 + 16·x/4, 16 − 16·y/4) = (17.5, 16.5).
    """
    scene = marker()
    larger = replace(scene, shapes=(scene.shapes[0], Disc((0.5, -0.25, -4.0), (0, 0, 1), 0.25, 2)))
    assert reflections(scene, (32, 32)).truth[23, 17] == TruthClass.NOTHING
    truth = reflections(larger, (32, 32))
    assert truth.truth[23, 17] == TruthClass.VISIBLE
    assert np.abs(truth.hit_px[23, 17] - (17.5, 16.5)).max() < 1e-12
    assert truth.shape_id[23, 17] == 1 and truth.surface_id[23, 17] == 1


def below_the_floor(scene: AnalyticScene) -> AnalyticScene:
    """Everything but shape 0 mirrored in y = 0: reflections in the floor as they are seen."""
    flip = transforms.scaling(1.0, -1.0, 1.0)
    turned: list[Sphere | Plane | Disc | Box] = []
    for s in scene.shapes[1:]:
        if isinstance(s, Sphere):
            x, y, z = s.center
            turned.append(replace(s, center=(x, -y, z)))
        elif isinstance(s, Plane):
            turned.append(
                replace(
                    s,
                    point=(s.point[0], -s.point[1], s.point[2]),
                    normal=(s.normal[0], -s.normal[1], s.normal[2]),
                )
            )
        elif isinstance(s, Box):
            m = transforms.multiply(transforms.multiply(flip, s.world_from_box), flip)
            turned.append(replace(s, world_from_box=m))
    return replace(scene, shapes=tuple(turned))


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("name", ["clutter", "corner", "box_on_plane", "sphere_on_plane"])
def test_a_floor_shows_the_mirrored_scene(name: str, orthographic: bool) -> None:
    """Through the floor as a window the eye's straight ray meets the mirrored scene at the mirrored
    point: other arithmetic, and no reflection at all.
    """
    size = (61, 43)
    scene = SCENES[name](orthographic=orthographic)
    camera = camera_of(scene, size)
    view = camera.params(size)
    truth = analytic_reflections(scene, camera, size)
    floor = (analytic_gbuffer(scene, camera, size).object_id == 0).ravel()

    through = eye_rays(camera, view, pixel_centers(view)[floor])
    shapes = shape_arrays(below_the_floor(scene).shapes, scene.materials)
    seen = cast(shapes, through, view.near)
    shape = np.where(seen.shape_id >= 0, seen.shape_id + 1, -1)
    mirrored = seen.point_ws * [1.0, -1.0, 1.0]
    met = shape >= 0
    assert np.array_equal(truth.shape_id.ravel()[floor], shape)
    assert met.sum() > 80
    off = np.abs(truth.point_ws.reshape(-1, 3)[floor] - mirrored)[met]
    off /= 1.0 + np.abs(mirrored[met])
    # At a silhouette the root of the discriminant turns 1e-16 into 1e-8; all others are exact.
    assert np.quantile(off, 0.99) < 1e-13
    assert off.max() < 1e-9


def test_a_curved_mirror_keeps_the_law_of_reflection() -> None:
    """Origin on the mirror ball, hit on the other; the normal halves the angle, in one plane."""
    size = (161, 91)
    scene = sphere_reflecting_sphere()
    camera = camera_of(scene, size)
    g = analytic_gbuffer(scene, camera, size)
    truth = analytic_reflections(scene, camera, size, g)
    world = camera.world_from_view
    rays = pixel_rays(camera.params(size)) @ world[:3, :3].T
    met = (truth.shape_id == 1) & (g.object_id == 0)
    assert met.sum() > 30
    o = world[:3, 3] + g.depth[met][:, None] * rays[met]
    n = (o - scene.shapes[0].center) / scene.shapes[0].radius  # type: ignore[union-attr]
    d = rays[met] / np.linalg.norm(rays[met], axis=1, keepdims=True)
    x = truth.point_ws[met]
    r = (x - o) / truth.distance[met][:, None]
    assert np.abs(np.linalg.norm(r, axis=1) - 1.0).max() < 1e-13
    assert np.abs((r * n).sum(axis=1) + (d * n).sum(axis=1)).max() < 1e-13
    assert np.abs((np.cross(d, n) * r).sum(axis=1)).max() < 1e-13
    from_center = np.linalg.norm(x - scene.shapes[1].center, axis=1)  # type: ignore[union-attr]
    assert np.abs(from_center - scene.shapes[1].radius).max() < 1e-14  # type: ignore[union-attr]
    facing = ((x - scene.shapes[1].center) * r).sum(axis=1)  # type: ignore[union-attr]
    assert (facing < 0).all()  # the near side of it


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("name", SCENES)
def test_positions_project_to_their_pixels(name: str, orthographic: bool) -> None:
    """World and view point, pixel and depth agree with an own projection; classes with both."""
    size = (61, 43)
    scene = SCENES[name](orthographic=orthographic)
    camera = camera_of(scene, size)
    view = camera.params(size)
    t = analytic_reflections(scene, camera, size)
    met = t.shape_id >= 0
    p = (t.point_ws[met] - camera.world_from_view[:3, 3]) @ camera.world_from_view[:3, :3]
    size_p = 1.0 + np.abs(t.point_ws[met]).max(axis=1, keepdims=True)
    assert (np.abs(p - t.point_vs[met]) / size_p).max(initial=0.0) < 1e-14
    assert np.array_equal(t.hit_depth[met], -t.point_vs[met][:, 2])
    ahead = (t.hit_depth[met] > 0.0) | (not view.perspective)
    assert np.abs(
        window_of(view, t.point_vs[met][ahead]) - t.hit_px[met][ahead]
    ).max(initial=0.0) < 1e-9  # fmt: skip
    assert np.isnan(t.hit_px[met][~ahead]).all()
    px, depth = t.hit_px, t.hit_depth
    inside = ((px >= 0.0) & (px < size)).all(axis=2) & (depth >= camera.near)
    on_screen = t.truth >= TruthClass.BACK_FACING
    assert np.array_equal(on_screen, inside & met)
    assert np.array_equal(t.truth == TruthClass.OFF_SCREEN, met & ~inside)
    nothing = t.truth <= TruthClass.NOTHING
    for image in (t.distance, t.hit_depth, t.point_ws, t.point_vs, t.hit_px):
        assert np.isnan(image[nothing]).all()
    assert (t.surface_id[nothing] == -1).all() and not t.front[nothing].any()


def test_what_is_visible_is_what_the_g_buffer_holds_nearby() -> None:
    """The pixel at floor(hit_px) shows the same shape, but for silhouettes within the pixel.

    Independent of the sub-pixel look-up: object ids and depths of the G-buffer.
    """
    size = (321, 181)
    scene = clutter()
    camera = camera_of(scene, size)
    g = analytic_gbuffer(scene, camera, size)
    t = analytic_reflections(scene, camera, size, g)
    assert g.object_id is not None
    for kind, least in ((TruthClass.VISIBLE, 0.97), (TruthClass.OCCLUDED, 0.0)):
        at = t.truth == kind
        px = np.floor(t.hit_px[at]).astype(int)
        same = g.object_id[px[:, 1], px[:, 0]] == t.shape_id[at]
        nearer = g.depth[px[:, 1], px[:, 0]] < t.hit_depth[at]
        assert at.sum() > 300
        if kind == TruthClass.VISIBLE:
            assert same.mean() > least
        else:
            assert (nearer & ~same).mean() > 0.9


FLOOR = Plane((0.0, -1.0, 0.0), (0.0, 1.0, 0.0))
WALL = Plane((0.0, 0.0, -4.0), (0.0, 0.0, 1.0))
PIXEL = (17, 18)
"""Row 17 of the middle column: slope −12/23 for each unit of depth. It meets `FLOOR` at depth 23/12
and its ray goes up by 12/23 for each unit of depth: at depth 4 it is at y = 25/23 − 1 = 2/23."""


@pytest.mark.parametrize(
    ("expected", "pixel", "shapes"),
    [
        # Nothing at all; a wall that shows its back, single-sided and double-sided.
        (TruthClass.NOTHING, PIXEL, (FLOOR,)),
        (TruthClass.NOTHING, PIXEL, (FLOOR, Plane((0, 0, -4), (0, 0, -1), 1))),
        (TruthClass.VISIBLE, PIXEL, (FLOOR, Plane((0, 0, -4), (0, 0, -1), 2))),
        (TruthClass.VISIBLE, PIXEL, (FLOOR, replace(WALL, material=1))),
        # A small disc at depth 1 before the place (0, 2/23, −4), which is on a line to y = 0.0217.
        (TruthClass.OCCLUDED, PIXEL,
         (FLOOR, replace(WALL, material=1), Disc((0, 0.05, -1), (0, 0, 1), 0.15, 1))),
        (TruthClass.VISIBLE, PIXEL,
         (FLOOR, replace(WALL, material=1), Disc((0, 0.05, -1), (0, 0, 1), 0.025, 1))),
        # The lower side of a sheet just below the eye: not drawn from above, met from below.
        (TruthClass.BACK_FACING, PIXEL, (FLOOR, Plane((0, -0.2, 0), (0, -1, 0), 1))),
        # A mirror that sends the ray back: to a sheet before the eye that looks at the mirror,
        # on screen in the middle, off screen on the right; and to one behind the eye.
        (TruthClass.BACK_FACING, MIDDLE, (WALL, Plane((0, 0, -1), (0, 0, -1), 1))),
        (TruthClass.OFF_SCREEN, (11, 30), (WALL, Plane((0, 0, -1), (0, 0, -1), 1))),
        (TruthClass.OFF_SCREEN, MIDDLE, (WALL, Plane((0, 0, 3), (0, 0, -1), 1))),
        (TruthClass.NO_RAY, MIDDLE, (replace(WALL, material=1),)),
        (TruthClass.NO_RAY, MIDDLE, (replace(WALL, normal=(0, 0, -1)),)),
    ],
)  # fmt: skip
def test_every_class(
    expected: TruthClass, pixel: tuple[int, int], shapes: tuple[Plane | Disc, ...]
) -> None:
    truth = analytic_reflections(scene_of(*shapes), front(SIZE), SIZE)
    assert truth.truth[pixel] == expected
    if pixel == PIXEL and expected in (TruthClass.VISIBLE, TruthClass.OCCLUDED):
        assert truth.point_ws[pixel] == pytest.approx([0.0, 2 / 23, -4.0], abs=1e-15)
        assert truth.front[pixel] == (shapes[1].normal[2] > 0)
        # Row of y = 2/23 at depth 4 of an image 23 high, 90°: 11.5 − 11.5 · (2/23) / 4.
        assert truth.hit_px[pixel] == pytest.approx([18.5, 11.25], abs=1e-13)


def test_near_far_and_the_image_s_border_bound_what_is_on_screen() -> None:
    """The hit at depth 4 of the test above, at row 11.25 to the bit or not at all."""
    scene = scene_of(FLOOR, replace(WALL, material=1))
    for planes, expected in (
        ({"far": 4.5}, TruthClass.VISIBLE),
        ({"far": 3.5}, TruthClass.OFF_SCREEN),
        ({"near": 1.5}, TruthClass.VISIBLE),
    ):
        truth = analytic_reflections(scene, front(SIZE, **planes), SIZE)
        assert truth.truth[PIXEL] == expected
    # An image whose lower half alone is left: the same rays, 11.5 rows of the upper half cut off.
    aspect = SIZE[0] / SIZE[1]
    lower = Camera.frustum(np.eye(4), -aspect, aspect, -1.0, 0.0, near=NEAR)
    truth = analytic_reflections(scene, lower, (37, 23))
    seen = truth.truth[(truth.shape_id == 1) & (truth.point_ws[..., 1] > 1e-9)]
    assert len(seen) > 100 and (seen == TruthClass.OFF_SCREEN).all()


def test_max_distance_ends_a_ray_at_the_hit_itself() -> None:
    """The longest ray that is refused is an ulp shorter than the hit's distance."""
    scene = scene_of(FLOOR, replace(WALL, material=1))
    distance = float(analytic_reflections(scene, front(SIZE), SIZE).distance[PIXEL])
    # Depth 4 − 23/12 = 25/12 along, 25/23 up.
    assert distance == pytest.approx(((25 / 12) ** 2 + (25 / 23) ** 2) ** 0.5, rel=1e-15)
    for limit, expected in (
        (distance, TruthClass.VISIBLE),
        (np.nextafter(distance, 0.0), TruthClass.NOTHING),
    ):
        found = analytic_reflections(scene, front(SIZE), SIZE, max_distance=limit)
        assert found.truth[PIXEL] == expected
        assert np.isnan(found.distance[PIXEL]) == (expected == TruthClass.NOTHING)


def test_straight_back_into_the_eye() -> None:
    """The middle pixel's ray comes back along itself and has nothing to meet; with a wall behind
    the eye it meets that exactly 4 + 3 away, on the axis.
    """
    size = (61, 41)
    scene = along_the_axis()
    camera = camera_of(scene, size)
    truth = analytic_reflections(scene, camera, size)
    assert truth.truth[20, 30] == TruthClass.NOTHING
    behind = replace(scene, shapes=(*scene.shapes, Plane((0, 0, 3), (0, 0, -1), 1)))
    truth = analytic_reflections(behind, camera, size)
    assert truth.truth[20, 30] == TruthClass.OFF_SCREEN
    assert truth.point_ws[20, 30].tolist() == [0.0, 0.0, 3.0]
    assert truth.distance[20, 30] == 7.0 and truth.hit_depth[20, 30] == -3.0
    assert np.isnan(truth.hit_px[20, 30]).all()


def test_rays_along_rows_columns_and_diagonals() -> None:
    """In the parallel view a disc's rays all go one way on screen: to the bit along the row and
    the column; within 1e-13 px along the diagonal, whose two components round apart.
    """
    size = (96, 96)
    scene = rows_columns_diagonals(orthographic=True)
    camera = camera_of(scene, size)
    g = analytic_gbuffer(scene, camera, size)
    t = analytic_reflections(scene, camera, size, g)
    y, x = np.mgrid[0:96, 0:96] + 0.5
    for disc, across in ((1, t.hit_px[..., 1] - y), (2, t.hit_px[..., 0] - x),
                         (3, (t.hit_px[..., 0] - x) + (t.hit_px[..., 1] - y))):  # fmt: skip
        rays = (g.object_id == disc) & (t.truth == TruthClass.VISIBLE)
        assert rays.sum() > 40
        assert np.abs(across[rays]).max() < 1e-13
        along = np.abs(t.hit_px - np.stack([x, y], axis=2))[rays].max(axis=1)
        assert along.min() > 5.0


def test_inside_a_mirror_ball_rays_are_chords() -> None:
    """A ray that meets the shell again is a chord of 2r·cosθ, θ to the normal at its start."""
    size = (61, 43)
    scene = inside_a_sphere()
    camera = camera_of(scene, size)
    g = analytic_gbuffer(scene, camera, size)
    t = analytic_reflections(scene, camera, size, g)
    chord = (g.object_id == 0) & (t.shape_id == 0)
    assert chord.sum() > 1500
    assert not t.front[chord].any() and not t.leaves_front[chord].any()
    assert g.normal_vs is not None
    rays = pixel_rays(camera.params(size))
    rays = rays / np.linalg.norm(rays, axis=2, keepdims=True)
    cosine = -(rays * g.normal_vs).sum(axis=2)
    assert np.allclose(t.distance[chord], 2.0 * 2.0 * cosine[chord], rtol=1e-13)
    assert (t.shape_id[g.object_id == 0] >= 0).all()  # nothing gets out
    reach = np.linalg.norm(t.point_ws[chord], axis=1)
    assert np.allclose(reach, 2.0, rtol=1e-15)


@pytest.mark.parametrize("gap", [2.0**-60, 2.0**-500, 0.0])
def test_rays_leave_a_contact_without_a_least_distance(gap: float) -> None:
    """From a floor, `gap` before a wall at z = 0, at 45°: t = √2 · gap, not a bias later. From the
    wall itself the same ray meets nothing.
    """
    shapes = (Plane((0, 0, 0), (0, 1, 0)), Plane((0, 0, 0), (0, 0, 1)))
    scene = scene_of(*shapes)
    ray = Rays(
        np.array([[0.0, 0.0, gap]]),
        np.array([[0.0, 0.5**0.5, -(0.5**0.5)]]),
        np.array([0], np.int32),
        np.array([True]),
    )
    hit = cast(shape_arrays(scene.shapes, scene.materials), ray, ABOVE_ZERO)
    if gap > 0.0:
        assert hit.shape_id[0] == 1
        assert hit.t[0] == pytest.approx(2.0**0.5 * gap, rel=1e-15)
    else:
        assert hit.shape_id[0] == -1


def test_a_convex_shape_never_meets_itself() -> None:
    """Balls of 1e-3 to 1e6, a box, sheets; rays that graze too: own surfaces are out by number."""
    rng = np.random.default_rng(3)
    n = 2000
    for shape in (Sphere((1.0, 2.0, 3.0), 1e-3), Sphere((0.1, 0, 0), 1e6), Box((1.0, 2.0, 0.1)),
                  Plane((0, 0, 0), (1, 2, 3), 2), Disc((0, 0, 0), (1, 2, 3), 4.0, 2)):  # fmt: skip
        scene = scene_of(shape)
        arrays = shape_arrays(scene.shapes, scene.materials)
        way = rng.normal(size=(n, 3))
        target = np.array(shape.bounds()).mean(axis=0) + rng.normal(size=(n, 3)) * 1e-4
        start = target - way * 1e7
        eye = Rays(start, way, np.full(n, -1, np.int32), np.ones(n, bool))
        first = cast(arrays, eye, 0.0)
        met = first.shape_id == 0
        assert met.sum() > n / 4
        normal = first.normal_ws[met]
        tangent = np.cross(normal, rng.normal(size=normal.shape))
        lift = 10.0 ** rng.uniform(-17, 0, len(normal))[:, None]
        ray = Rays(first.point_ws[met], tangent + lift * normal, first.shape_id[met],
                   np.ones(met.sum(), bool))  # fmt: skip
        assert (cast(arrays, ray, ABOVE_ZERO).shape_id == -1).all()


def test_a_mask_from_a_g_buffer() -> None:
    """Only pixels whose reflectivity is not 0 have a ray; a buffer of another size is refused."""
    scene = scene_of(FLOOR, replace(WALL, material=1))
    camera = front(SIZE)
    g = analytic_gbuffer(scene, camera, SIZE)
    assert g.reflectivity is not None
    mask = np.zeros_like(g.reflectivity)
    mask[PIXEL][2] = 1e-30
    truth = analytic_reflections(scene, camera, SIZE, replace(g, reflectivity=mask))
    assert np.argwhere(truth.truth > 0).tolist() == [list(PIXEL)]
    assert truth.truth[PIXEL] == TruthClass.VISIBLE
    for other, word in (
        (analytic_gbuffer(scene, front((9, 7)), (9, 7)), "is 9x7; expected 37x23"),
        (replace(g, reflectivity=None), "is none; expected 37x23"),
    ):
        with pytest.raises(SsrRefError, match=word):
            analytic_reflections(scene, camera, SIZE, other)
    with pytest.raises(SsrRefError, match="max_distance is 0; expected above 0"):
        analytic_reflections(scene, camera, SIZE, max_distance=0.0)


def test_a_view_that_holds_nothing() -> None:
    scene = scene_of(Sphere((0.0, 0.0, 5.0), 1.0))  # behind the eye
    truth = analytic_reflections(scene, front((5, 3)), (5, 3))
    assert (truth.truth == TruthClass.NO_RAY).all() and (truth.shape_id == -1).all()

"""Closed-form G-buffers: single numbers by hand, whole images by exact rationals or 50 digits."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from closed_form import NEAR, SIDES, exact_dot, exact_ray, fractions, front, scaled, scene_of

from ssr_ref import SsrRefError, transforms
from ssr_ref.analytic import (
    AnalyticScene,
    Box,
    Disc,
    Plane,
    Sphere,
    analytic_gbuffer,
    analytic_reflections,
)
from ssr_ref.analytic.gbuffer import OUTPUTS
from ssr_ref.analytic.scenes import SCENES, clutter, grazing_floor, planet
from ssr_ref.buffers import GBuffer
from ssr_ref.camera import Camera, look_at

SIZE = (37, 23)
MIDDLE = (11, 18)
"""Row and column of the middle pixel of `SIZE`."""


def camera_of(kind: str, size: tuple[int, int] = SIZE) -> Camera:
    """Off axis, jittered and turned, so that no coordinate is simple."""
    pose = look_at((1.0, 2.0, 5.0), (0.1, 0.3, -0.2), (0.1, 1.0, 0.05))
    if kind == "orthographic":
        made = Camera.orthographic(pose, 3.5, size[0] / size[1], near=NEAR)
    else:
        made = Camera.frustum(pose, -0.5, 0.75, -0.375, 0.3125, near=NEAR)
    return made.jittered(0.3, -0.2, size)


def test_the_middle_pixel_of_a_sphere() -> None:
    """Centre 5 away, radius 1.5: front at 3.5, back at 6.5, normal towards the eye."""
    for orthographic in (False, True):
        scene = scene_of(Sphere((0.0, 0.0, -5.0), 1.5, 1))
        g = analytic_gbuffer(scene, front(SIZE, orthographic=orthographic), SIZE)
        assert g.depth[MIDDLE] == 3.5
        assert g.back_depth is not None and g.back_depth[MIDDLE] == 6.5
        assert g.geo_normal_vs is not None and g.geo_normal_vs[MIDDLE].tolist() == [0, 0, 1]
        assert g.triangle_id[MIDDLE] == 0
        assert g.material_id is not None and g.material_id[MIDDLE] == 1
        assert g.albedo is not None and g.albedo[MIDDLE].tolist() == list(SIDES[1].base_color)


@pytest.mark.parametrize("kind", ["frustum", "orthographic"])
def test_every_pixel_of_a_sphere_to_50_digits(kind: str) -> None:
    """Silhouette by the sign of the exact discriminant; depths from its root, to 4e-15.

    Exact: t = (b ± √(b² − aC)) / a with b = d·(c − o), a = d·d, C = |o − c|² − r², in rationals.
    At the silhouette the root turns an ulp of position into its root, so the tolerance is divided
    by the root's share.
    """
    center, radius = (0.1, 0.2, -0.3), 1.1
    camera = camera_of(kind)
    g = analytic_gbuffer(scene_of(Sphere(center, radius)), camera, SIZE)
    assert g.back_depth is not None
    c, r = fractions(center), Fraction(radius)
    mpmath.mp.dps = 50
    drawn = 0
    for y in range(SIZE[1]):
        for x in range(SIZE[0]):
            o, d = exact_ray(camera, SIZE, x + 0.5, y + 0.5)
            f = [a - b for a, b in zip(o, c)]
            a, b = exact_dot(d, d), -exact_dot(d, f)
            discriminant = b * b - a * (exact_dot(f, f) - r * r)
            assert (g.triangle_id[y, x] == 0) == (discriminant > 0)
            if discriminant <= 0:
                assert g.depth[y, x] == np.inf and g.back_depth[y, x] == np.inf
                continue
            drawn += 1
            root = mpmath.sqrt(mpmath.mpf(discriminant.numerator) / discriminant.denominator)
            half, mid = float(root / a), float(b / a)
            allowed = 4e-15 * (1.0 + mid / half)
            for sign, image in ((-1, g.depth), (1, g.back_depth)):
                t = (mpmath.mpf(b.numerator) / b.denominator + sign * root) / a
                assert abs(float(image[y, x] / t - 1)) < allowed, (x, y)
    assert drawn > 100


def test_a_planet_seen_from_ten_units_above() -> None:
    """r = 6.4e6: depth within 2e-13 where the eye looks down, and the horizon in its own row.

    The textbook formula is off by 1e-10 here: −b + √(b² − aC) cancels 6 digits.
    """
    size = (61, 61)
    scene = planet()
    assert scene.view is not None
    camera = scene.view.camera(size, 1.0)
    g = analytic_gbuffer(scene, camera, size)
    mpmath.mp.dps = 60
    r = Fraction(6400000)
    textbook = 0.0
    seen = 0
    for y in range(size[1]):
        o, d = exact_ray(camera, size, 0.5, y + 0.5)  # the left column is clear of the box
        f = (o[0], o[1] + r, o[2])
        a, b = exact_dot(d, d), -exact_dot(d, f)
        c = exact_dot(f, f) - r * r
        discriminant = b * b - a * c
        met = discriminant > 0 and b > 0
        assert (g.triangle_id[y, 0] == 0) == met, y
        if not met:
            continue
        seen += 1
        exact = (mpmath.mpf(b.numerator) / b.denominator
                 - mpmath.sqrt(mpmath.mpf(discriminant.numerator) / discriminant.denominator)
                 ) / (mpmath.mpf(a.numerator) / a.denominator)  # fmt: skip
        slope = float(-d[1]) / float(a) ** 0.5  # sine of the angle below the horizontal
        assert abs(float(g.depth[y, 0] / exact - 1)) < 4e-15 / slope, y
        fa, fb, fc = float(a), float(b), float(c)
        naive = (fb - np.sqrt(fb * fb - fa * fc)) / fa
        textbook = max(textbook, abs(float(naive / exact - 1)))
    assert 20 < seen < size[1]
    assert textbook > 1e-11


def test_a_box_between_pixel_borders() -> None:
    """Face 2 × 1 at depth 2 of a 90° image 16 high: 8 pixels a unit of slope 1/2 each way.

    Wide 2 → slopes ±1/2 → columns 12 to 19 of 32; high 1 → ±1/4 → rows 6 to 9. The front face is
    at depth 2 to the bit; behind it a ray leaves at the far face, depth 3, or through a side where
    |x| = 1 or |y| = 1/2, that is at 1/|dx| or 1/(2|dy|).
    """
    size = (32, 16)
    box = Box.between((-1.0, -0.5, -3.0), (1.0, 0.5, -2.0), 1)
    g = analytic_gbuffer(scene_of(box), front(size), size)
    assert g.back_depth is not None and g.geo_normal_vs is not None
    covered = np.zeros((16, 32), bool)
    covered[6:10, 12:20] = True
    assert np.array_equal(g.triangle_id == 5, covered)  # the +z side, and no other
    assert (g.depth[covered] == 2.0).all() and np.isinf(g.depth[~covered]).all()
    assert (g.geo_normal_vs[covered] == (0.0, 0.0, 1.0)).all()
    for y, x in np.argwhere(covered):
        dx, dy = Fraction(2 * x + 1, 16) - 2, 1 - Fraction(2 * y + 1, 16)
        exact = min(Fraction(3), 1 / abs(dx), 1 / (2 * abs(dy)))
        assert g.back_depth[y, x] == pytest.approx(float(exact), rel=2.3e-16)
    assert len(np.unique(g.back_depth[covered])) > 2


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_rays_in_the_plane_of_a_box_s_face(side: float) -> None:
    """The eye lies in a side's plane: the middle column runs along it and sees the front's edge.

    0/0 of the slabs must not drop the column or give NaN; the face belongs to the box.
    """
    low, high = min(0.0, side), max(0.0, side)
    box = Box.between((low, -1.0, -3.0), (high, 1.0, -2.0), 1)
    for orthographic in (False, True):
        g = analytic_gbuffer(scene_of(box), front(SIZE, orthographic=orthographic), SIZE)
        row, column = MIDDLE
        assert g.depth[row, column] == 2.0
        assert g.back_depth is not None and g.back_depth[row, column] == 3.0
        off = -1 if side > 0 else 1
        assert g.depth[row, column - off] == 2.0 and np.isinf(g.depth[row, column + off])
        assert not np.isnan(g.depth).any()


def test_a_floor_at_grazing_angles() -> None:
    """89.99° from the normal: t = −o_y/d_y exactly, from the camera's floats as rationals.

    d_y ≈ 1.7e-4 |d| is a difference that cancels 4 digits when the pixel's ray is turned, so the
    relative error is 2⁻⁵³/1.7e-4 and not 2⁻⁵³; rows further down have less.
    """
    size = (11, 15)
    for degrees in (60.0, 89.0, 89.99):
        scene = grazing_floor(degrees)
        assert scene.view is not None
        camera = scene.view.camera(size, 0.01)
        g = analytic_gbuffer(scene, camera, size)
        checked = 0
        for y in range(size[1]):
            for x in range(size[0]):
                o, d = exact_ray(camera, size, x + 0.5, y + 0.5)
                if g.triangle_id[y, x] > 0:
                    continue
                exact = -o[1] / d[1] if d[1] < 0 else Fraction(0)
                assert (g.triangle_id[y, x] == 0) == (exact >= Fraction(camera.near))
                if exact >= Fraction(camera.near):
                    sine = float(-d[1]) / float(exact_dot(d, d)) ** 0.5
                    assert abs(float(Fraction(float(g.depth[y, x])) / exact - 1)) < 4e-16 / sine
                    checked += 1
        assert checked > 60
        assert g.normal_vs is not None
        normals = g.normal_vs[g.triangle_id == 0]
        assert (normals == normals[0]).all()  # one plane, one normal


def test_the_rim_of_a_disc() -> None:
    """A disc of radius 1 at depth 2 is a circle of 4 px about the middle: d² ≤ 16 in pixels."""
    size = (17, 17)
    camera = Camera.frustum(np.eye(4), -17 / 16, 17 / 16, -17 / 16, 17 / 16, near=NEAR)
    g = analytic_gbuffer(scene_of(Disc((0, 0, -2), (0, 0, 1), 1.0)), camera, size)
    x, y = np.meshgrid(np.arange(17) - 8, np.arange(17) - 8)
    assert np.array_equal(g.triangle_id == 0, x * x + y * y <= 16)
    assert (g.depth[g.triangle_id == 0] == 2.0).all()


SHEETS = (Plane((0, 0, -2), (0, 0, 1)), Disc((0, 0, -2), (0, 0, 1), 3.0))


@pytest.mark.parametrize("sheet", SHEETS, ids=["plane", "disc"])
def test_backs_are_drawn_of_double_sided_materials_alone(sheet: Plane | Disc) -> None:
    camera = front(SIZE)
    away = replace(sheet, normal=(0, 0, -1))
    for shape, seen in ((sheet, True), (away, False), (replace(away, material=2), True)):
        g = analytic_gbuffer(scene_of(shape), camera, SIZE)
        assert bool(g.depth[MIDDLE] == 2.0) == seen
        assert g.geo_normal_vs is not None
        assert g.geo_normal_vs[MIDDLE].tolist() == [0.0, 0.0, 1.0 if seen else 0.0]
        assert g.back_depth is not None and np.isinf(g.back_depth).all()


@pytest.mark.parametrize(
    "solid", [Sphere((0, 0, -4), 2.0), Box.between((-2, -2, -6), (2, 2, -2))], ids=["ball", "box"]
)
def test_near_cuts_a_solid_open_and_far_ends_the_view(solid: Sphere | Box) -> None:
    """From 2 to 6 along the axis, a wall at 8."""
    wall = Plane((0, 0, -8), (0, 0, 1), 1)

    def middle(material: int, **planes: float) -> tuple[float, int, float]:
        scene = scene_of(replace(solid, material=material), wall)
        g = analytic_gbuffer(scene, front(SIZE, **planes), SIZE)
        assert g.back_depth is not None and g.object_id is not None
        return g.depth[MIDDLE], int(g.object_id[MIDDLE]), g.back_depth[MIDDLE]

    assert middle(1) == (2.0, 0, 6.0)
    assert middle(1, near=2.0) == (2.0, 0, 6.0)
    assert middle(1, near=np.nextafter(2.0, 3.0)) == (8.0, 1, np.inf)  # its inside is not drawn
    assert middle(2, near=3.0) == (6.0, 0, np.inf)  # it is, where both sides are
    assert middle(2) == (2.0, 0, np.inf)
    assert middle(1, far=2.0) == (2.0, 0, 6.0)
    assert middle(1, far=np.nextafter(2.0, 0.0)) == (np.inf, -1, np.inf)
    assert middle(1, near=7.0, far=8.0) == (8.0, 1, np.inf)


def test_the_eye_inside_a_solid() -> None:
    """A ball of radius 2 about the eye: nothing of it, or its far wall 2 away along every ray."""
    ball = Sphere((0.0, 0.0, 0.0), 2.0, 1)
    assert np.isinf(analytic_gbuffer(scene_of(ball), front(SIZE), SIZE).depth).all()
    g = analytic_gbuffer(scene_of(replace(ball, material=2)), front(SIZE), SIZE)
    assert g.normal_vs is not None and g.back_depth is not None
    x, y = np.meshgrid(np.arange(37) + 0.5, np.arange(23) + 0.5)
    ray = np.stack([(x - 18.5) / 11.5, (11.5 - y) / 11.5, np.full_like(x, -1.0)], axis=2)
    ray /= np.sqrt((ray * ray).sum(axis=2, keepdims=True))
    assert np.allclose(g.depth, -2.0 * ray[..., 2], rtol=1e-15)
    assert np.allclose(g.normal_vs, -ray, atol=1e-15)  # faces the eye
    assert np.isinf(g.back_depth).all()


def test_equal_depths_go_to_the_lower_shape() -> None:
    a, b = Plane((0, 0, -2), (0, 0, 1), 0), Disc((0, 0, -2), (0, 0, 1), 9.0, 1)
    for shapes in ((a, b), (b, a)):
        g = analytic_gbuffer(scene_of(*shapes), front(SIZE), SIZE)
        assert (g.triangle_id == 0).all()


def test_the_back_of_any_object() -> None:
    """A ball from 2 to 4 behind a board at 1: its back counts only if asked for, and that of a ball
    about the eye never: it is before the board.
    """
    about = Sphere((0, 0, 0), 0.75)
    scene = scene_of(Disc((0, 0, -1), (0, 0, 1), 0.5), Sphere((0, 0, -3), 1.0), about)
    camera = front(SIZE)
    own = analytic_gbuffer(scene, camera, SIZE).back_depth
    any_of = analytic_gbuffer(scene, camera, SIZE, back_any_object=True).back_depth
    assert own is not None and any_of is not None
    assert own[MIDDLE] == np.inf and any_of[MIDDLE] == 4.0


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("power", [-600, -40, 23, 600])
def test_a_change_of_unit_by_a_power_of_two_keeps_every_bit(power: int, orthographic: bool) -> None:
    """Also where squared lengths would under- or overflow."""
    k = 2.0**power
    scene = clutter(orthographic=orthographic)
    images = []
    for s in (scaled(scene, 1.0), scaled(scene, k)):
        assert s.view is not None
        camera = s.view.camera(SIZE, 1.0)
        g = analytic_gbuffer(s, camera, SIZE)
        images.append((g, analytic_reflections(s, camera, SIZE, g)))
    (g, r), (g2, r2) = images
    lengths = {"depth", "back_depth", "distance", "point_ws", "point_vs", "hit_depth"}
    for one, two in ((g, g2), (r, r2)):
        second = two.arrays()
        for name, array in one.arrays().items():
            scale = k if name in lengths else 1
            assert np.array_equal(array * scale, second[name], equal_nan=True), name
    assert (g.depth < np.inf).any() and (r.truth == 5).any()


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (7, 5)])
@pytest.mark.parametrize("name", SCENES)
def test_every_scene_at_small_and_odd_sizes(name: str, size: tuple[int, int]) -> None:
    for orthographic in (False, True):
        scene = SCENES[name](orthographic=orthographic)
        assert scene.view is not None
        g = analytic_gbuffer(scene, scene.view.camera(size, 1.0), size)
        check(g, scene)


def check(g: GBuffer, scene: AnalyticScene) -> None:
    """What holds for every image."""
    seen = g.triangle_id >= 0
    assert np.array_equal(seen, np.isfinite(g.depth)) and (g.depth > 0).all()
    assert g.object_id is not None and g.back_depth is not None and g.geo_normal_vs is not None
    first = np.cumsum([0, *(s.surfaces for s in scene.shapes)])
    shape = np.searchsorted(first, g.triangle_id[seen], side="right") - 1
    assert np.array_equal(shape, g.object_id[seen])
    assert (g.back_depth >= g.depth).all()
    squared = (g.geo_normal_vs**2).sum(axis=2)
    assert np.abs(squared[seen] - 1.0).max(initial=0.0) < 1e-15
    for name in ("geo_normal_vs", "normal_vs", "albedo", "reflectivity", "roughness", "radiance"):
        image = g.arrays()[name]
        assert np.isfinite(image).all() and (image[~seen] == 0).all(), name
    assert g.counts.triangles == scene.triangle_count
    assert g.counts.drawn == len(np.unique(g.triangle_id[seen]))


def test_float32_is_rounded_once_and_outputs_can_be_left_out() -> None:
    scene = clutter()
    assert scene.view is not None
    camera = scene.view.camera(SIZE, 1.0)
    full = analytic_gbuffer(scene, camera, SIZE).arrays()
    single = analytic_gbuffer(scene, camera, SIZE, dtype=np.float32).arrays()
    assert set(full) == {"depth", "triangle_id", *OUTPUTS}
    for name, array in full.items():
        expected = array.astype(np.float32) if array.dtype == np.float64 else array
        assert single[name].tobytes() == expected.tobytes(), name
    for name in OUTPUTS:
        part = analytic_gbuffer(scene, camera, SIZE, outputs=[name]).arrays()
        assert set(part) == {"depth", "triangle_id", name}
        for each, array in part.items():
            assert array.tobytes() == full[each].tobytes(), each
    with pytest.raises(SsrRefError, match="no output 'normal'; expected some of"):
        analytic_gbuffer(scene, camera, SIZE, outputs=["normal"])


def test_reflectivity_follows_the_settings() -> None:
    """metallic · base colour + (1 − metallic)·0.04 with Fresnel; 0 above max_roughness."""
    matt = replace(SIDES[1], metallic=0.25, roughness=0.5, base_color=(0.5, 0.25, 1.0))
    own = replace(matt, reflectivity=(0.1, 0.2, 0.3))
    for material, options, expected in (
        (matt, {}, (0.125, 0.0625, 0.25)),
        (matt, {"fresnel": True}, (0.125 + 0.03, 0.0625 + 0.03, 0.25 + 0.03)),
        (matt, {"max_roughness": 0.4}, (0, 0, 0)),
        (own, {"fresnel": True}, (0.1, 0.2, 0.3)),
    ):
        scene = AnalyticScene((Plane((0, 0, -2), (0, 0, 1)),), (material,))
        g = analytic_gbuffer(scene, front(SIZE), SIZE, **options)
        assert g.reflectivity is not None
        assert g.reflectivity[MIDDLE].tolist() == list(expected)


def test_radiance_by_hand() -> None:
    """Ambient 0.25 and two lights on a plane that faces +z: only the second, (0.6, −0.4, −0.7),
    comes from the front, with cosine 0.7/√1.01; the first's is 0.35/√1.3725.
    """
    scene = AnalyticScene((Plane((0, 0, -2), (0, 0, 1)),), (SIDES[1],))
    g = analytic_gbuffer(scene, front(SIZE), SIZE)
    assert g.radiance is not None
    total = 0.25 + 0.7 * 0.35 / 1.3725**0.5 + np.array([0.2, 0.2, 0.25]) * 0.7 / 1.01**0.5
    assert np.allclose(g.radiance[MIDDLE], np.array(SIDES[1].base_color) * total, rtol=1e-15)
    unlit = replace(scene, materials=(replace(SIDES[1], unlit=True),))
    g = analytic_gbuffer(unlit, front(SIZE), SIZE)
    assert g.radiance is not None
    assert g.radiance[MIDDLE].tolist() == list(SIDES[1].base_color)


def test_a_pose_that_a_float32_file_rounded() -> None:
    """View space is Rᵀ·(p − eye) whatever R is: a pixel's point must project to the pixel.

    R is rounded to float32 and off a rotation by 1e-7; taken for one, points would be 1e-7 off.
    """
    pose = look_at((1.0, 2.0, 5.0), (0.1, 0.3, -0.2)).astype(np.float32).astype(np.float64)
    camera = Camera.perspective(pose, 40.0, SIZE[0] / SIZE[1], near=NEAR)
    scene = scene_of(Plane((0, 0, 0), (0, 1, 0)))
    g = analytic_gbuffer(scene, camera, SIZE)
    n = transforms.cofactors(pose).T[:, 1]  # R⁻¹ of the plane's normal, not unit
    assert g.normal_vs is not None
    half = np.tan(np.pi / 9)
    for y, x in ((20, 3), (12, 30), (22, 36)):
        d = np.array([(x + 0.5 - 18.5) / 11.5 * half, (11.5 - y - 0.5) / 11.5 * half, -1.0])
        p = d * g.depth[y, x]
        eye_height = pose[1, 3]
        world_y = eye_height + (np.linalg.inv(pose[:3, :3].T) @ p)[1]
        assert abs(world_y) < 1e-13
        assert np.allclose(g.normal_vs[y, x], n / np.linalg.norm(n), atol=1e-14)

"""Diffuse radiance: closed forms, no dependence on the eye, repaired normals, interpolation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from raster_drawing import Drawn, draw, objects, quad, soup

from ssr_ref import transforms
from ssr_ref.camera import Camera, look_at
from ssr_ref.scene import DirectionalLight, Lights, Material, Scene
from ssr_ref.scenes import shapes

SIZE = (37, 23)
ASPECT = SIZE[0] / SIZE[1]
AHEAD = Camera.perspective(np.eye(4), 60.0, ASPECT, near=0.1)
DARK = Lights(ambient=(0.0, 0.0, 0.0), directional=())
FACING = quad((-9, -9, -2), (9, -9, -2), (9, 9, -2), (-9, 9, -2))
"""Normal (0, 0, 1), fills the image of AHEAD."""


def one_value(image: np.ndarray) -> np.ndarray:
    """The one RGB value of an image."""
    values = np.unique(image.reshape(-1, 3), axis=0)
    assert len(values) == 1
    return values[0]


def radiance_of(material: Material, lights: Lights, face: object = FACING) -> np.ndarray:
    scene = objects([(face, None)], (material,)).with_lights(lights)  # type: ignore[list-item]
    return one_value(draw(scene, AHEAD, SIZE).g.radiance)


# --- Closed forms ---------------------------------------------------------------------------------


def test_ambient_alone() -> None:
    """L = albedo · ambient, to the bit."""
    lights = Lights(ambient=(0.25, 0.5, 0.7), directional=())
    got = radiance_of(Material(base_color=(0.8, 0.3, 0.1)), lights)
    np.testing.assert_array_equal(got, [0.8 * 0.25, 0.3 * 0.5, 0.1 * 0.7])


def test_emission_alone() -> None:
    """L = emissive in the dark, whatever the albedo; above 1 too."""
    got = radiance_of(Material(emissive=(0.1, 3.0, 0.0)), DARK)
    np.testing.assert_array_equal(got, [0.1, 3.0, 0.0])


@pytest.mark.parametrize("degrees", [0, 30, 45, 60, 89, 90, 91, 135, 180])
def test_one_light_at_an_angle(degrees: float) -> None:
    """L = albedo · color · max(0, cos θ), θ from normal to light; directions of any length."""
    angle = np.radians(degrees)
    for length in (1.0, 1e-200, 1e200, 7.0):
        travels = (-np.sin(angle) * length, 0.0, -np.cos(angle) * length)
        lights = replace(DARK, directional=(DirectionalLight(travels, (2.0, 1.0, 0.5)),))
        got = radiance_of(Material(base_color=(0.8, 0.6, 0.4)), lights)
        want = np.array([0.8, 0.6, 0.4]) * [2.0, 1.0, 0.5] * max(0.0, np.cos(angle))
        np.testing.assert_allclose(got, want, rtol=1e-14, atol=1e-16)
        assert (got >= 0).all()


def test_a_light_from_behind_adds_nothing() -> None:
    """Exactly the ambient bytes."""
    lights = Lights(ambient=(0.3, 0.3, 0.3), directional=())
    lit = replace(lights, directional=(DirectionalLight((0.1, 0.2, 1.0)),))
    np.testing.assert_array_equal(radiance_of(Material(), lit), radiance_of(Material(), lights))


def test_terms_add() -> None:
    """Ambient, two lights and emission: the sum of each alone, the metallic factor unused."""
    first = DirectionalLight((0.0, 0.0, -1.0), (0.5, 0.25, 1.0))  # cos = 1
    second = DirectionalLight((0.0, -4.0, -3.0), (1.0, 0.5, 0.25))  # cos = 3/5
    lights = Lights((0.125, 0.25, 0.5), (first, second))
    for metallic in (0.0, 1.0):
        material = Material(
            base_color=(0.5, 1.0, 0.25), emissive=(1.0, 0.0, 2.0), metallic=metallic
        )
        got = radiance_of(material, lights)
        want = [
            0.5 * (0.125 + 0.5 + 0.6 * 1.0) + 1.0,
            1.0 * (0.25 + 0.25 + 0.6 * 0.5),
            0.25 * (0.5 + 1.0 + 0.6 * 0.25) + 2.0,
        ]
        np.testing.assert_allclose(got, want, rtol=4 * 2.0**-53)


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    st.tuples(*[st.floats(-1, 1, width=32)] * 3).filter(lambda v: max(map(abs, v)) > 0.1),
    st.tuples(*[st.floats(0, 4, width=32)] * 3),
)
def test_any_light_on_a_cube(direction: tuple[float, ...], color: tuple[float, ...]) -> None:
    """The three sides seen show color · max(0, ∓d_i/|d|), and two opposite views see all six."""
    lights = replace(DARK, directional=(DirectionalLight(direction, color),))
    box = objects([(shapes.box((-1, -1, -1), (1, 1, 1)), None)], (Material(base_color=(1, 1, 1)),))
    d = np.array(direction) / np.linalg.norm(direction)
    for eye in ((3, 2, 4), (-3, -2, -4)):
        camera = Camera.perspective(look_at(eye, (0, 0, 0)), 40.0, ASPECT, near=0.1)
        drawn = draw(box.with_lights(lights), camera, SIZE)
        seen = drawn.g.triangle_id >= 0
        n = drawn.g.geo_normal_vs[seen] @ camera.world_from_view[:3, :3].T
        want = np.maximum(0, -(n @ d))[:, None] * np.array(color)
        np.testing.assert_allclose(drawn.g.radiance[seen], want, atol=1e-14)
        assert len(np.unique(drawn.g.triangle_id[seen])) == 6


# --- Independent of the eye -----------------------------------------------------------------------


def test_a_flat_face_has_the_same_bytes_from_every_camera() -> None:
    """40 cameras of three kinds round a tilted, unevenly scaled box: one RGB for each triangle."""
    m = transforms.multiply(
        transforms.from_quaternion(*(np.array([0.1, 0.3, -0.2, 0.9]) / np.sqrt(0.95))),
        transforms.scaling(1.0, 0.7, -1.3),
    )
    material = Material(base_color=(0.7, 0.6, 0.5), emissive=(0.01, 0.02, 0.03))
    scene = objects([(shapes.box((-1, -1, -1), (1, 1, 1)), m)], (material,))
    rng = np.random.default_rng(6)
    values: dict[int, set[bytes]] = {}
    for i in range(40):
        eye = rng.normal(size=3)
        eye *= rng.uniform(3, 9) / np.linalg.norm(eye)
        pose = look_at(eye, rng.uniform(-0.3, 0.3, 3), rng.normal(size=3))
        camera = (
            Camera.orthographic(pose, 5.0, ASPECT, near=0.1)
            if i % 3 == 0
            else Camera.perspective(pose, rng.uniform(20, 100), ASPECT, near=0.1)
        )
        g = draw(scene, camera, SIZE).g
        for t in np.unique(g.triangle_id[g.triangle_id >= 0]):
            for rgb in g.radiance[g.triangle_id == t]:
                values.setdefault(int(t), set()).add(rgb.tobytes())
    assert sorted(values) == list(range(12))
    assert all(len(seen) == 1 for seen in values.values())
    # Two triangles of a side agree to rounding; at least the lit sides differ.
    rgb = np.array([np.frombuffer(next(iter(values[t]))) for t in range(12)])
    np.testing.assert_allclose(rgb[::2], rgb[1::2], rtol=1e-15)
    assert len(np.unique(rgb[::2].round(9), axis=0)) >= 4


# --- Two sides ------------------------------------------------------------------------------------


@pytest.mark.parametrize("authored", [False, True])
def test_a_double_sided_face_is_lit_on_each_side(authored: bool) -> None:
    """One light in front of a sheet: cos 0 = 1 there, 0 behind, the normal turned to the eye."""
    sheet = FACING
    if authored:
        sheet = replace(FACING, normals=np.tile(np.float32((0, 0, 1)), (4, 1)))
    lights = replace(DARK, directional=(DirectionalLight((0, 0, -1), (0.5, 0.6, 0.7)),))
    material = Material(base_color=(1.0, 0.5, 0.25), double_sided=True)
    scene = objects([(sheet, None)], (material,)).with_lights(lights)
    front = draw(scene, AHEAD, SIZE).g
    np.testing.assert_array_equal(one_value(front.radiance), [0.5, 0.5 * 0.6, 0.25 * 0.7])
    np.testing.assert_array_equal(one_value(front.normal_vs), [0, 0, 1])

    behind = Camera.perspective(look_at((0, 0, -4), (0, 0, -2)), 60.0, ASPECT, near=0.1)
    back = draw(scene, behind, SIZE).g
    np.testing.assert_array_equal(one_value(back.radiance), [0, 0, 0])
    np.testing.assert_array_equal(one_value(back.normal_vs), [0, 0, 1])  # towards this eye
    one_sided = replace(scene, materials=(replace(material, double_sided=False),))
    assert (draw(one_sided, behind, SIZE).g.triangle_id == -1).all()


# --- Normals that cannot be used ------------------------------------------------------------------

UNUSABLE = {
    "zero": (0.0, 0.0, 0.0),
    "nan": (np.nan, 0.0, 1.0),
    "inf": (0.0, np.inf, 0.0),
}


@pytest.mark.parametrize("name", UNUSABLE)
def test_unusable_normals_become_the_geometric_one(name: str) -> None:
    """At all vertices: the image is that without normals, and every covered pixel is counted."""
    bad = replace(FACING, normals=np.tile(np.float32(UNUSABLE[name]), (4, 1)))
    plain = draw(objects([(FACING, None)]), AHEAD, SIZE).g
    got = draw(objects([(bad, None)]), AHEAD, SIZE).g
    for image in ("normal_vs", "radiance", "geo_normal_vs"):
        assert got.arrays()[image].tobytes() == plain.arrays()[image].tobytes()
    assert got.counts.repaired_normals == SIZE[0] * SIZE[1]
    assert plain.counts.repaired_normals == 0


@pytest.mark.parametrize("name", UNUSABLE)
def test_one_unusable_normal_leaves_no_nan(name: str) -> None:
    """It has no weight (it counts as zero), so the other two decide; nothing needs repair."""
    normals = np.tile(np.float32((0, 0, 1)), (4, 1))
    normals[1] = UNUSABLE[name]
    g = draw(objects([(replace(FACING, normals=normals), None)]), AHEAD, SIZE).g
    assert np.isfinite(g.normal_vs).all()
    np.testing.assert_allclose(
        g.normal_vs, np.broadcast_to((0, 0, 1), g.normal_vs.shape), atol=1e-15
    )
    assert g.counts.repaired_normals == 0
    assert np.isfinite(g.radiance).all()


def test_normals_that_cancel_are_repaired_where_they_do() -> None:
    """Opposite normals at both ends of a strip: zero along its middle column, counted there."""
    strip = quad((-2, -9, -2), (2, -9, -2), (2, 9, -2), (-2, 9, -2))
    normals = np.float32([(1, 0, 0), (-1, 0, 0), (-1, 0, 0), (1, 0, 0)])
    camera = Camera.frustum(np.eye(4), -1.0, 1.0, -1.0, 1.0, near=0.1)
    g = draw(objects([(replace(strip, normals=normals), None)]), camera, (5, 3)).g
    assert (g.triangle_id >= 0).all()
    assert g.counts.repaired_normals == 3
    np.testing.assert_array_equal(g.normal_vs[:, 2], np.tile((0.0, 0.0, 1.0), (3, 1)))
    np.testing.assert_array_equal(g.normal_vs[:, 0], np.tile((1.0, 0.0, 0.0), (3, 1)))
    np.testing.assert_array_equal(g.normal_vs[:, 4], np.tile((-1.0, 0.0, 0.0), (3, 1)))


# --- Interpolation --------------------------------------------------------------------------------


def by_hand(drawn: Drawn, camera: Camera, scene: Scene, x: int, y: int) -> dict[str, np.ndarray]:
    """Normal, albedo and radiance at a centre: ray against triangle by Cramer's rule, in world
    space, with NumPy; nothing of the project but the scene's numbers.
    """
    t = int(drawn.g.triangle_id[y, x])
    primitive = scene.meshes[0].primitives[0]
    face = primitive.faces[t]
    p = primitive.positions[face].astype(np.float64)
    m = camera.clip_from_view
    ndc = np.array([(x + 0.5) / SIZE[0] * 2 - 1, 1 - (y + 0.5) / SIZE[1] * 2])
    if camera.is_perspective:
        d = np.array([(ndc[0] + m[0, 2]) / m[0, 0], (ndc[1] + m[1, 2]) / m[1, 1], -1.0])
        origin = np.zeros(3)
    else:
        origin = np.array([(ndc[0] - m[0, 3]) / m[0, 0], (ndc[1] - m[1, 3]) / m[1, 1], 0.0])
        d = np.array([0.0, 0.0, -1.0])
    pose = camera.world_from_view
    d, origin = pose[:3, :3] @ d, pose[:3, :3] @ origin + pose[:3, 3]
    # origin + s·d = p0 + b1·(p1 − p0) + b2·(p2 − p0)
    b1, b2, s = np.linalg.solve(np.stack([p[1] - p[0], p[2] - p[0], -d], axis=1), origin - p[0])
    b = np.clip([1 - b1 - b2, b1, b2], 0, None)
    b /= b.sum()
    material = scene.materials[0]
    n = primitive.normals[face].astype(np.float64)
    n = b @ (n / np.linalg.norm(n, axis=1)[:, None])
    n /= np.linalg.norm(n)
    flat = np.cross(p[1] - p[0], p[2] - p[0])
    if material.double_sided and flat @ d > 0:
        n = -n
    albedo = np.array(material.base_color) * (b @ primitive.colors[face].astype(np.float64))
    light = np.array(scene.lights.ambient)
    for one in scene.lights.directional:
        to_light = -np.array(one.direction_ws) / np.linalg.norm(one.direction_ws)
        light = light + np.array(one.color) * max(0.0, n @ to_light)
    return {
        "normal_vs": pose[:3, :3].T @ n,
        "albedo": albedo,
        "radiance": albedo * light + np.array(material.emissive),
        "depth": s,
    }


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("double_sided", [False, True])
def test_interpolation_against_a_hand_computation(orthographic: bool, double_sided: bool) -> None:
    """Perspective-correct normals, colours and radiance within 1e-12 at every visible pixel."""
    rng = np.random.default_rng(21)
    triangles = rng.uniform((-3, -2, -2), (3, 2, 2), (24, 3, 3))
    scene = soup(
        triangles,
        Material(base_color=(0.9, 0.7, 0.5), emissive=(0.0, 0.1, 0.2), double_sided=double_sided),
        normals=rng.normal(size=(72, 3)),
        colors=rng.random((72, 3)),
    )
    pose = look_at((1.0, 2.0, 6.0), (0.0, 0.0, 0.0), (0.2, 1.0, 0.0))
    make = Camera.orthographic if orthographic else Camera.perspective
    camera = make(pose, 6.0 if orthographic else 45.0, ASPECT, near=0.1).jittered(0.2, -0.4, SIZE)
    drawn = draw(scene, camera, SIZE)
    pixels = np.argwhere(drawn.g.triangle_id >= 0)
    assert len(pixels) > 150
    for y, x in pixels:
        want = by_hand(drawn, camera, scene, int(x), int(y))
        n = want["normal_vs"]
        for name, value in want.items():
            got = drawn.g.arrays()[name][y, x]
            np.testing.assert_allclose(
                got, value, rtol=1e-10, atol=1e-11, err_msg=f"{name} {x} {y}"
            )
        assert abs(n @ n - 1) < 1e-12
    albedo = drawn.g.albedo[drawn.g.triangle_id >= 0]
    assert (albedo >= 0).all()
    assert (albedo <= 0.9).all()

"""Cameras: lenses, jitter, poses, foreign matrices, JSON, and every refusal by name."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import raster as oracle
from raster_drawing import TWO_SIDED, draw, image_bytes, objects, quad, soup

from ssr_ref.camera import (
    MAX_SIDE,
    Camera,
    View,
    check_size,
    clip_xyw,
    look_at,
    point_at,
    ray_through,
    to_view,
)
from ssr_ref.errors import CameraError, SettingsError
from ssr_ref.scenes import shapes
from ssr_ref.vecmath.vec import Vec3

SIZE = (37, 23)
ASPECT = SIZE[0] / SIZE[1]
POSE = look_at((1.0, 2.5, 5.0), (0.0, 0.75, 0.0), (0.1, 1.0, 0.0))
EYE = np.eye(4)


def lens_of(camera: Camera) -> np.ndarray:
    """What decides the window position: rows 0, 1 and 3."""
    return camera.clip_from_view[[0, 1, 3]]


# --- Lenses ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("fov", [1e-3, 1.0, 40.0, 60.0, 90.0, 120.0, 179.0])
@pytest.mark.parametrize("aspect", [1.0, ASPECT, 9.0, 1 / 9])
def test_three_ways_to_give_a_lens(fov: float, aspect: float) -> None:
    """fov_y = 2·atan(sensor/(2·focal)); the edges at depth 1 are ±tan(fov/2) and that · aspect."""
    top = np.tan(np.radians(fov) / 2)
    by_fov = Camera.perspective(POSE, fov, aspect, near=0.5)
    by_edges = Camera.frustum(POSE, -top * aspect, top * aspect, -top, top, near=0.5)
    by_sensor = Camera.physical(POSE, 24.0 / (2 * top), 24.0, aspect, near=0.5)
    for other in (by_edges, by_sensor):
        np.testing.assert_allclose(lens_of(other), lens_of(by_fov), rtol=1e-14, atol=0)
    assert by_fov.is_perspective
    np.testing.assert_allclose(by_fov.clip_from_view[1, 1], 1 / top, rtol=1e-14)
    np.testing.assert_allclose(by_fov.clip_from_view[0, 0], 1 / (top * aspect), rtol=1e-14)
    np.testing.assert_array_equal(by_fov.clip_from_view[3], [0, 0, -1, 0])


def test_a_physical_lens_is_a_frustum_to_the_bit() -> None:
    """A 36 mm lens before a sensor 24 mm high, 3:2: edges ±1/3 and ±1/2 at depth 1."""
    sensor = Camera.physical(EYE, 36.0, 24.0, 1.5, near=0.5, far=9.0)
    edges = Camera.frustum(EYE, -0.5, 0.5, -1 / 3, 1 / 3, near=0.5, far=9.0)
    np.testing.assert_array_equal(sensor.clip_from_view, edges.clip_from_view)


@pytest.mark.parametrize("far", [np.inf, 100.0])
def test_clip_depth_is_opengls(far: float) -> None:
    """z/w is −1 at near and 1 at far (1 in the limit for an infinite far)."""
    for camera in (
        Camera.perspective(EYE, 60.0, ASPECT, near=0.25, far=far),
        Camera.orthographic(EYE, 6.0, ASPECT, near=0.25, far=100.0),
    ):
        for depth, want in ((0.25, -1.0), (100.0 if np.isfinite(camera.far) else 1e15, 1.0)):
            clip = camera.clip_from_view @ [0, 0, -depth, 1]
            np.testing.assert_allclose(clip[2] / clip[3], want, atol=1e-13)


def test_an_off_axis_frustum_maps_its_edges_to_the_images() -> None:
    """Left, right, bottom, top at depth 1 land on x = 0, W and y = H, 0."""
    left, right, bottom, top = -0.2, 0.7, -0.1, 0.9
    camera = Camera.frustum(EYE, left, right, bottom, top, near=0.1)
    for depth in (1.0, 3.7):
        for x, y, px, py in ((left, bottom, 0, 23), (right, top, 37, 0), (left, top, 0, 0)):
            got = oracle.project(camera.clip_from_view, SIZE, np.array([x, y, -1]) * depth)
            np.testing.assert_allclose([float(v) for v in got], [px, py, depth], atol=1e-13)


def test_an_orthographic_image_has_the_height_given() -> None:
    """6 units high: view y = ±3 land on rows 0 and H at any depth; width 6·W/H."""
    camera = Camera.orthographic(EYE, 6.0, ASPECT, near=0.1)
    assert not camera.is_perspective
    for z in (-0.5, -80.0):
        for x, y, px, py in ((0, 3, 18.5, 0), (0, -3, 18.5, 23), (3 * ASPECT, 0, 37, 11.5)):
            got = oracle.project(camera.clip_from_view, SIZE, np.array([x, y, z]))
            np.testing.assert_allclose([float(v) for v in got], [px, py, -z], atol=1e-13)


# --- What kernels compute, against the matrices ---------------------------------------------------

CAMERAS = {
    "perspective": Camera.perspective(POSE, 50.0, ASPECT, near=0.25),
    "off-axis": Camera.frustum(POSE, -0.7, 0.5, -0.3, 0.5, near=0.25),
    "jittered": Camera.perspective(POSE, 50.0, ASPECT, near=0.25).jittered(0.3, -0.4, SIZE),
    "orthographic": Camera.orthographic(POSE, 6.0, ASPECT, near=0.25),
    "orthographic, jittered": Camera.orthographic(POSE, 6.0, ASPECT, near=0.25).jittered(
        -0.3, 0.4, SIZE
    ),
}


@pytest.mark.parametrize("name", CAMERAS)
def test_kernels_agree_with_the_matrices(name: str) -> None:
    """to_view and clip_xyw are the 4×4 products; ray_through and point_at undo the projection."""
    camera = CAMERAS[name]
    view = camera.params(SIZE)
    rng = np.random.default_rng(3)
    inverse = np.linalg.inv(camera.world_from_view)
    for p_ws in rng.uniform(-2, 2, (50, 3)):
        p_vs = to_view(view, Vec3(*p_ws))
        np.testing.assert_allclose(p_vs, (inverse @ [*p_ws, 1])[:3], rtol=0, atol=1e-14)
        clip = camera.clip_from_view @ [*p_vs, 1]
        np.testing.assert_allclose(clip_xyw(view, p_vs), clip[[0, 1, 3]], rtol=0, atol=1e-14)

        px, py, depth = (float(v) for v in oracle.project(camera.clip_from_view, SIZE, p_vs))
        np.testing.assert_allclose(point_at(view, px, py, depth), p_vs, rtol=0, atol=1e-13)
        d = np.array(ray_through(view, px, py))
        assert d[2] == -1
        if camera.is_perspective:
            np.testing.assert_allclose(d * depth, p_vs, rtol=0, atol=1e-13)
        else:
            np.testing.assert_array_equal(d, (0, 0, -1))


def test_the_eye_is_subtracted_before_rotating() -> None:
    """Spec 2.1: with the eye at 2³⁰ on a 2⁻¹² grid, the view position is that of the origin's."""
    far = np.array(POSE)
    shift = np.array([2.0**30, -(2.0**30), 2.0**29])
    far[:3, 3] += shift
    here = CAMERAS["perspective"].params(SIZE)
    there = Camera.perspective(far, 50.0, ASPECT, near=0.25).params(SIZE)
    p = np.array([1.5, -2.25, 3 / 4096])
    assert to_view(here, Vec3(*p)) == to_view(there, Vec3(*(p + shift)))


# --- Jitter ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["perspective", "off-axis", "orthographic"])
@pytest.mark.parametrize("shift", [(0.5, 0.0), (0.0, 0.5), (-0.25, 0.375), (3.0, -2.0)])
def test_jitter_moves_the_samples(name: str, shift: tuple[float, float]) -> None:
    """Samples move by (dx, dy), x right and y down; so a known point's image moves by −(dx, dy)."""
    camera = CAMERAS[name]
    moved = camera.jittered(*shift, SIZE)
    rng = np.random.default_rng(4)
    for p in rng.uniform((-2, -2, -9), (2, 2, -1), (20, 3)):
        before = oracle.project(camera.clip_from_view, SIZE, p)
        after = oracle.project(moved.clip_from_view, SIZE, p)
        got = [float(b - a) for a, b in zip(after, before)]
        np.testing.assert_allclose(got, (*shift, 0), rtol=0, atol=1e-13)
    # The ray of a pixel's centre is the old ray (dx, dy) pixels away.
    a, b = camera.params(SIZE), moved.params(SIZE)
    np.testing.assert_allclose(
        point_at(b, 10.5, 7.5, 2.0), point_at(a, 10.5 + shift[0], 7.5 + shift[1], 2.0), atol=1e-14
    )


def test_whole_pixels_of_jitter_move_the_picture() -> None:
    """By (2, −3): pixel (x, y) then shows what (x + 2, y − 3) showed."""
    scene = objects([(shapes.sphere(1.0, 3), None), (shapes.grid(4, 4, 2, 2), None)])
    for name in ("perspective", "orthographic"):
        camera = CAMERAS[name]
        before = draw(scene, camera, SIZE).g.triangle_id
        after = draw(scene, camera.jittered(2.0, -3.0, SIZE), SIZE).g.triangle_id
        assert len(np.unique(before)) > 20
        np.testing.assert_array_equal(after[3:, :-2], before[:-3, 2:])


# --- Poses ----------------------------------------------------------------------------------------

numbers = st.floats(-1e6, 1e6)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(st.tuples(numbers, numbers, numbers), st.tuples(numbers, numbers, numbers))
def test_look_at_is_orthonormal(eye: tuple[float, ...], target: tuple[float, ...]) -> None:
    """RᵀR = 1 to 4 ulp, det +1, −Z towards the target, up's image straight up, eye kept exactly."""
    away = np.subtract(eye, target)
    distance = np.linalg.norm(away)
    if not (distance > 1e-3 and np.hypot(away[0], away[2]) > 1e-6 * distance):
        return
    m = look_at(eye, target)
    r = m[:3, :3]
    np.testing.assert_allclose(r.T @ r, np.eye(3), rtol=0, atol=8 * 2.0**-53)
    assert np.linalg.det(r) > 0.999
    np.testing.assert_array_equal(m[:3, 3], eye)
    np.testing.assert_array_equal(m[3], [0, 0, 0, 1])
    np.testing.assert_allclose(r[:, 2], away / distance, rtol=0, atol=1e-15)
    assert r[1, 0] == 0  # +Y has no part to the right …
    assert r[1, 1] >= 0  # … and is not upside down


def test_look_at_by_hand() -> None:
    """From (0, 0, 5) to the origin: the identity's rotation. From (5, 0, 0): right is −Z."""
    np.testing.assert_array_equal(look_at((0, 0, 5), (0, 0, 0))[:3, :3], np.eye(3))
    want = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    np.testing.assert_array_equal(look_at((5, 0, 0), (0, 0, 0))[:3, :3], want)


@pytest.mark.parametrize(
    ("eye", "target", "up", "words"),
    [
        ((0, 0, 0), (0, 0, 0), (0, 1, 0), "eye .* and target"),
        ((0, 0, np.nan), (0, 0, 0), (0, 1, 0), "eye .* and target"),
        ((0, np.inf, 0), (0, 0, 0), (0, 1, 0), "eye .* and target"),
        ((0, 5, 0), (0, 0, 0), (0, 1, 0), "up .* along the view"),
        ((0, 5, 0), (0, 0, 0), (0, -2, 0), "up .* along the view"),
        ((0, 0, 5), (0, 0, 0), (0, 0, 0), "up .* is zero"),
    ],
)
def test_look_at_refuses(eye: Any, target: Any, up: Any, words: str) -> None:
    with pytest.raises(CameraError, match=words):
        look_at(eye, target, up)


# --- Foreign matrices -----------------------------------------------------------------------------


def foreign(name: str, camera: Camera) -> tuple[np.ndarray, str]:
    """The same lens as some API would give it, near 0.25 and far 100; and where its y points."""
    m = np.array(camera.clip_from_view)
    n, f = 0.25, 100.0
    persp = camera.is_perspective
    if name == "D3D":
        m[2, 2:] = (-f / (f - n), -f * n / (f - n)) if persp else (-1 / (f - n), -n / (f - n))
    elif name == "reversed":
        m[2, 2:] = (n / (f - n), f * n / (f - n)) if persp else (1 / (f - n), f / (f - n))
    elif name == "reversed, infinite":
        m[2, 2:] = (0.0, n)
    elif name == "Vulkan":  # y down, depth 0 to 1
        m[2, 2:] = (-f / (f - n), -f * n / (f - n)) if persp else (-1 / (f - n), -n / (f - n))
        m[1] = -m[1]
        return m, "down"
    elif name == "scaled by 8":
        m = m * 8.0
    elif name == "scaled by −1/4":
        m = m * -0.25
    elif name == "scaled by 3.7":
        m = m * 3.7
    return m, "up"


@pytest.mark.parametrize("lens", ["perspective", "off-axis", "orthographic"])
@pytest.mark.parametrize(
    "name",
    ["GL", "D3D", "reversed", "reversed, infinite", "Vulkan", "scaled by 8", "scaled by −1/4"],
)
def test_foreign_matrices_give_the_same_pixels(name: str, lens: str) -> None:
    """Depth range, direction of y and a power-of-two scale change no byte of the G-buffer."""
    camera = CAMERAS[lens]
    m, y = foreign(name, camera)
    got = Camera.from_matrices(POSE, m, near=0.25, y=y)
    np.testing.assert_array_equal(lens_of(got), lens_of(camera))
    scene = objects([(shapes.sphere(1.0, 3), None), (shapes.grid(4, 4, 2, 2), None)])
    assert image_bytes(draw(scene, got, SIZE).g) == image_bytes(draw(scene, camera, SIZE).g)


def test_any_scale_of_a_matrix_is_the_same_lens() -> None:
    """By 3.7: a product and a quotient of rounding."""
    for lens in ("perspective", "off-axis", "orthographic"):
        m, _ = foreign("scaled by 3.7", CAMERAS[lens])
        got = Camera.from_matrices(POSE, m, near=0.25, far=100.0)
        np.testing.assert_allclose(lens_of(got), lens_of(CAMERAS[lens]), rtol=2.0**-52, atol=0)
        np.testing.assert_array_equal(got.clip_from_view[3], CAMERAS[lens].clip_from_view[3])


def edited(base: np.ndarray, **elements: float) -> np.ndarray:
    """A copy with elements like m01=0.5 set."""
    m = np.array(base)
    for name, value in elements.items():
        m[int(name[1]), int(name[2])] = value
    return m


P = CAMERAS["perspective"].clip_from_view
O = CAMERAS["orthographic"].clip_from_view  # noqa: E741
REFUSED_LENSES = [
    (edited(P, m20=0.1), r"clip_from_view\[2\]\[0\] is 0.1 \(an oblique near plane\)"),
    (edited(P, m21=-0.1), r"clip_from_view\[2\]\[1\] is -0.1 \(an oblique near plane\)"),
    (edited(O, m20=0.1), r"clip_from_view\[2\]\[0\] is 0.1 \(an oblique near plane\)"),
    (edited(P, m01=0.5), r"clip_from_view\[0\]\[1\] is 0.5 \(a shear\)"),
    (edited(P, m10=0.5), r"clip_from_view\[1\]\[0\] is 0.5 \(a shear\)"),
    (edited(O, m01=0.5), r"clip_from_view\[0\]\[1\] is 0.5 \(a shear\)"),
    (edited(P, m03=0.5), r"clip_from_view\[0\]\[3\] is 0.5"),
    (edited(P, m13=0.5), r"clip_from_view\[1\]\[3\] is 0.5"),
    (edited(O, m02=0.5), r"clip_from_view\[0\]\[2\] is 0.5"),
    (edited(O, m12=0.5), r"clip_from_view\[1\]\[2\] is 0.5"),
    (edited(P, m00=0.0), r"clip_from_view\[0\]\[0\] is 0;.*singular"),
    (edited(P, m11=0.0), r"clip_from_view\[1\]\[1\] is 0;.*singular"),
    (edited(P, m00=-1.5), r"clip_from_view\[0\]\[0\] is -1.5;.*mirrors"),
    (edited(P, m11=-1.5), r"clip_from_view\[1\]\[1\] is -1.5;.*y='down'"),
    (edited(O, m00=-1.5), r"clip_from_view\[0\]\[0\] is -1.5;.*mirrors"),
    (edited(P, m30=0.1), r"clip_from_view\[3\] is \[0.1, 0.0, -1.0, 0.0\]"),
    (edited(P, m33=0.1), r"clip_from_view\[3\] is \[0.0, 0.0, -1.0, 0.1\]"),
    (edited(P, m32=0.0), r"clip_from_view\[3\] is all zero"),
    (edited(P, m32=np.nan), r"clip_from_view\[3\]"),
    (edited(P, m00=np.nan), r"clip_from_view\[0\]\[0\] is nan; expected finite"),
    (edited(P, m12=np.inf), r"clip_from_view\[1\]\[2\] is inf; expected finite"),
    (P[:3], r"clip_from_view has shape \(3, 4\); expected \(4, 4\)"),
]


@pytest.mark.parametrize(("m", "words"), REFUSED_LENSES, ids=range(len(REFUSED_LENSES)))
def test_a_foreign_lens_is_refused_by_its_element(m: np.ndarray, words: str) -> None:
    with pytest.raises(CameraError, match=words) as caught:
        Camera.from_matrices(EYE, m, near=0.25)
    assert "\n" not in str(caught.value)


REFUSED_POSES = [
    (edited(POSE, m00=np.nan), r"world_from_view\[0\]\[0\] is nan"),
    (edited(POSE, m13=np.inf), r"world_from_view\[1\]\[3\] is inf"),
    (edited(POSE, m30=0.5), r"world_from_view\[3\] is \[0.5, 0.0, 0.0, 1.0\]"),
    (np.diag([1.001, 1, 1, 1]), r"columns 0 and 0 have the dot product 1.002"),
    (edited(EYE, m01=0.01), r"columns 0 and 1 have the dot product 0.01"),
    (np.diag([1, 1, -1, 1]), "mirrors"),
    (np.diag([-1, -1, -1, 1]), "mirrors"),
    (np.eye(3), r"world_from_view has shape \(3, 3\)"),
    (np.zeros((4, 4)), r"world_from_view\[3\]"),
]


@pytest.mark.parametrize(("pose", "words"), REFUSED_POSES, ids=range(len(REFUSED_POSES)))
def test_a_pose_that_is_not_rigid_is_refused(pose: np.ndarray, words: str) -> None:
    for make in (
        lambda: Camera.from_matrices(pose, P, near=0.25),
        lambda: Camera.perspective(pose, 40.0, 1.0, near=0.25),
        lambda: Camera(pose, P, 0.25),
    ):
        with pytest.raises(CameraError, match=words):
            make()


def test_a_rotation_from_float32_is_accepted() -> None:
    """Files hold poses to 2⁻²⁴; the rotation is used as it is given."""
    camera = Camera.perspective(POSE.astype(np.float32), 40.0, 1.0, near=0.25)
    np.testing.assert_array_equal(camera.world_from_view, POSE.astype(np.float32))


@pytest.mark.parametrize(
    ("near", "far", "words"),
    [
        (0.0, 9.0, "near is 0;"),
        (-1.0, 9.0, "near is -1;"),
        (np.nan, 9.0, "near is nan;"),
        (np.inf, np.inf, "near is inf;"),
        (2.0, 2.0, "near 2 and far 2; expected near < far"),
        (2.0, 1.0, "near 2 and far 1; expected near < far"),
        (2.0, np.nan, "near 2 and far nan; expected near < far"),
    ],
)
def test_near_and_far_are_checked(near: float, far: float, words: str) -> None:
    for make in (
        lambda: Camera.perspective(EYE, 40.0, 1.0, near=near, far=far),
        lambda: Camera.orthographic(EYE, 40.0, 1.0, near=near, far=far),
        lambda: Camera.from_matrices(EYE, P, near=near, far=far),
        lambda: Camera(EYE, P, near, far),
    ):
        with pytest.raises(CameraError, match=words):
            make()


@pytest.mark.parametrize("fov", [0.0, 180.0, -10.0, 270.0, np.nan, np.inf])
def test_a_field_of_view_is_checked(fov: float) -> None:
    with pytest.raises(CameraError, match=f"field of view {re.escape(f'{fov:g}')} degrees"):
        Camera.perspective(EYE, fov, 1.0, near=0.1)


def test_other_lens_numbers_are_checked() -> None:
    for make, words in (
        (lambda: Camera.physical(EYE, 0.0, 24.0, 1.0, near=0.1), "focal length 0;"),
        (lambda: Camera.physical(EYE, 50.0, -1.0, 1.0, near=0.1), "sensor height -1;"),
        (lambda: Camera.physical(EYE, np.nan, 24.0, 1.0, near=0.1), "focal length nan;"),
        (lambda: Camera.orthographic(EYE, 0.0, 1.0, near=0.1), "orthographic height 0;"),
        (lambda: Camera.orthographic(EYE, np.inf, 1.0, near=0.1), "orthographic height inf;"),
        (lambda: Camera.perspective(EYE, 40.0, 0.0, near=0.1), "image edges"),
        (lambda: Camera.perspective(EYE, 40.0, np.nan, near=0.1), "image edges"),
        (lambda: Camera.orthographic(EYE, 4.0, -1.0, near=0.1), "image edges"),
        (lambda: Camera.frustum(EYE, 1.0, -1.0, -1.0, 1.0, near=0.1), "image edges"),
        (lambda: Camera.frustum(EYE, -1.0, 1.0, 1.0, 1.0, near=0.1), "image edges"),
        (lambda: Camera.frustum(EYE, -1.0, np.nan, -1.0, 1.0, near=0.1), "image edges"),
        (lambda: Camera.from_matrices(EYE, P, near=0.1, y="left"), "y is 'left'"),
        (lambda: CAMERAS["perspective"].jittered(np.nan, 0.0, SIZE), "jitter"),
    ):
        with pytest.raises(CameraError, match=words):
            make()


@pytest.mark.parametrize("size", [(0, 9), (9, 0), (-1, 9), (MAX_SIDE + 1, 9), (9, 16385)])
def test_image_sides_are_1_to_16384(size: tuple[int, int]) -> None:
    with pytest.raises(SettingsError, match=f"size {size[0]}x{size[1]}; expected 1 to 16384"):
        CAMERAS["perspective"].params(size)


def test_other_sizes() -> None:
    assert check_size((16384, 1)) == (16384, 1)
    assert check_size(np.array([3, 4])) == (3, 4)  # type: ignore[arg-type]
    for bad in ((3.5, 4), "ab", (1, 2, 3), (None, 1), 7):
        with pytest.raises(SettingsError, match=r"size .*; expected (two whole|1 to)"):
            check_size(bad)  # type: ignore[arg-type]


# --- JSON -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize("far", [np.inf, 1e4 / 3])
def test_json_is_exact(name: str, far: float) -> None:
    """Through text and back: every bit of both matrices, near and far."""
    given_camera = CAMERAS[name]
    camera = Camera.from_matrices(POSE, given_camera.clip_from_view, near=0.1, far=far)
    back = Camera.from_json(json.loads(json.dumps(camera.to_json(), allow_nan=False)))
    np.testing.assert_array_equal(back.clip_from_view, camera.clip_from_view)
    np.testing.assert_array_equal(back.world_from_view, camera.world_from_view)
    assert (back.near, back.far) == (camera.near, camera.far)
    assert back.to_json() == camera.to_json()
    assert back.params(SIZE) == camera.params(SIZE)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.floats(1e-3, 179.999), st.floats(0.01, 100.0), st.floats(1e-9, 1e9), st.booleans())
def test_json_of_any_lens(fov: float, aspect: float, near: float, ortho: bool) -> None:
    make = Camera.orthographic if ortho else Camera.perspective
    camera = make(POSE, fov, aspect, near=near)
    back = Camera.from_json(json.loads(json.dumps(camera.to_json(), allow_nan=False)))
    assert back.params(SIZE) == camera.params(SIZE)


def test_json_decimals_alone_are_enough() -> None:
    """A camera written by hand has no hexadecimal twin."""
    data = CAMERAS["perspective"].to_json()
    plain = {k: v for k, v in data.items() if not k.endswith("_hex")}
    assert Camera.from_json(plain).params(SIZE) == CAMERAS["perspective"].params(SIZE)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"world_from_view": None}, r"world_from_view has shape \(\)"),
        ({"world_from_view": [[1, 2], [3]]}, "'world_from_view'"),
        ({"clip_from_view": "none"}, "'clip_from_view'"),
        ({"clip_from_view": [[0.0] * 4] * 3}, r"clip_from_view has shape \(3, 4\)"),
        ({"clip_from_view_hex": [["0x1p+0"] * 4] * 4}, "'clip_from_view_hex' differ"),
        ({"clip_from_view_hex": [["pi"] * 4] * 4}, "clip_from_view_hex"),
        ({"clip_from_view_hex": 3}, "clip_from_view_hex"),
        ({"near": None}, "'near' is None"),
        ({"near": "1"}, "'near' is 1"),
        ({"near": True}, "'near' is True"),
        ({"near": 0}, "near is 0"),
        ({"far": "much"}, "'far' is much"),
        ({"far": 0.1}, "expected near < far"),
    ],
    ids=str,
)
def test_json_refuses_by_name(change: dict[str, Any], words: str) -> None:
    data = {**CAMERAS["perspective"].to_json(), **change}
    with pytest.raises(CameraError, match=words):
        Camera.from_json(data)


@pytest.mark.parametrize("data", [None, [], 3, "camera"])
def test_json_that_is_no_object_is_refused(data: Any) -> None:
    with pytest.raises(CameraError, match="camera"):
        Camera.from_json(data)


# --- Views ----------------------------------------------------------------------------------------


def test_a_view_makes_the_camera_it_says() -> None:
    for view, want in (
        (
            View((1.0, 2.5, 5.0), (0.0, 0.75, 0.0), (0.1, 1.0, 0.0), fov_y_degrees=50.0),
            CAMERAS["perspective"],
        ),
        (
            View((1.0, 2.5, 5.0), (0.0, 0.75, 0.0), (0.1, 1.0, 0.0), orthographic_height=6.0),
            CAMERAS["orthographic"],
        ),
    ):
        camera = view.camera(SIZE, 0.25)
        assert camera.params(SIZE) == want.params(SIZE)
        jittered = View.from_json(
            {
                "eye": view.eye,
                "target": view.target,
                "up": view.up,
                "fov_y_degrees": view.fov_y_degrees,
                "orthographic_height": view.orthographic_height,
                "jitter": [0.25, -0.5],
                "near": 0.5,
                "far": None,
            }
        ).camera(SIZE, 99.0)
        assert jittered.near == 0.5
        assert jittered.far == np.inf
        want_lens = want.jittered(0.25, -0.5, SIZE)
        np.testing.assert_array_equal(lens_of(jittered), lens_of(want_lens))
    by_sensor = View((0, 0, 5), (0, 0, 0), focal_length=12.0).camera(SIZE, 0.25)
    by_fov = View((0, 0, 5), (0, 0, 0), fov_y_degrees=90.0).camera(SIZE, 0.25)
    np.testing.assert_allclose(lens_of(by_sensor), lens_of(by_fov), rtol=1e-15)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"eye": [0, 0, 5], "target": [0, 0, 0], "fov": 40}, "unknown key 'fov'"),
        ({"eye": [0, 0, 5]}, "target"),
        ({"eye": [0, 0], "target": [0, 0, 0]}, "eye"),
        ({"eye": [0, 0, 5], "target": "abc"}, "target"),
        ({"eye": [0, 0, 5], "target": [0, 0, 0], "near": "x"}, "could not convert"),
    ],
    ids=str,
)
def test_a_view_refuses_by_name(data: Any, words: str) -> None:
    with pytest.raises(CameraError, match=words):
        View.from_json(data)


@pytest.mark.parametrize("data", [None, [], 3, "view"])
def test_a_view_that_is_no_object_is_refused(data: Any) -> None:
    with pytest.raises(CameraError, match="expected a JSON object"):
        View.from_json(data)


def test_a_view_has_one_lens() -> None:
    view = View((0, 0, 5), (0, 0, 0), fov_y_degrees=40.0, focal_length=50.0)
    with pytest.raises(CameraError, match="more than one"):
        view.camera(SIZE, 0.1)


# --- Into the picture -----------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(64, 64), (64, 36), (36, 64), (37, 23), (1, 1), (9, 1)])
@pytest.mark.parametrize("orthographic", [False, True])
def test_a_point_lands_in_the_pixel_computed_by_hand(
    size: tuple[int, int], orthographic: bool
) -> None:
    """pytorch3d 761, not square: a marker about the point covers that centre alone.

    By hand: f = (H/2)/tan(25°) pixels per unit at depth 1 in *both* directions, x to the right
    from W/2, y down from H/2 (orthographic: H/6 pixels per unit). Markers are ½ px about the
    centre of the pixel, so only that pixel's centre is inside, at its depth.
    """
    w, h = size
    rng = np.random.default_rng(w * 100 + h)
    camera = Camera.perspective(POSE, 50.0, w / h, near=0.25)
    f = (h / 2) / np.tan(np.radians(25.0))
    if orthographic:
        camera = Camera.orthographic(POSE, 6.0, w / h, near=0.25)
        f = h / 6.0
    for _ in range(12):
        x, y = int(rng.integers(w)), int(rng.integers(h))
        depth = float(rng.uniform(1, 9))
        scale = (1.0 if orthographic else depth) / f
        corners = [
            ((x + 0.5 + dx - w / 2) * scale, (h / 2 - (y + 0.5 + dy)) * scale, -depth)
            for dx, dy in ((-0.25, -0.25), (-0.25, 0.25), (0.25, 0.25), (0.25, -0.25))
        ]
        world = np.array(corners) @ POSE[:3, :3].T + POSE[:3, 3]
        g = draw(objects([(quad(*world), None)], (TWO_SIDED,)), camera, size).g
        assert np.argwhere(g.triangle_id >= 0).tolist() == [[y, x]]
        np.testing.assert_allclose(g.depth[y, x], depth, rtol=1e-6)  # positions are float32


def test_up_is_up_and_right_is_right() -> None:
    """Row 0 is the top: a mark above and to the right of the axis is in the upper right."""
    mark = [[0.9, 0.4, -2], [1.0, 0.4, -2], [0.95, 0.6, -2]]
    for make in (Camera.perspective, Camera.orthographic):
        camera = make(EYE, 60.0 if make is Camera.perspective else 2.2, ASPECT, near=0.1)
        rows, columns = np.nonzero(draw(soup([mark]), camera, SIZE).g.triangle_id == 0)
        assert len(rows) > 0
        assert rows.max() < SIZE[1] / 2
        assert columns.min() > SIZE[0] / 2

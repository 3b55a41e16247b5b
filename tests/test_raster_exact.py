"""Exactness: equal attributes unchanged, powers of two, moves on a grid, threads."""

from __future__ import annotations

from dataclasses import asdict, replace

import numba
import numpy as np
import pytest
from raster_drawing import Drawn, draw, image_bytes, objects, quad, soup

from ssr_ref import transforms
from ssr_ref.camera import Camera, look_at
from ssr_ref.scene import Lights, Material, Node, Primitive, Scene
from ssr_ref.scenes import shapes

SIZE = (37, 23)
ASPECT = SIZE[0] / SIZE[1]


def grid12(values: np.ndarray) -> np.ndarray:
    """Rounded to multiples of 2⁻¹²."""
    return np.rint(np.asarray(values) * 4096) / 4096


def small_scene() -> Scene:
    """A smooth ball with vertex colours, a box, a floor and loose triangles, on a 2⁻¹² grid.

    Some of it behind the eye and beyond the image, so that clipping takes part.
    """
    rng = np.random.default_rng(12)
    ball = shapes.sphere(1.0, 4)
    colors = rng.random(ball.positions.shape)
    ball = replace(ball, positions=grid12(ball.positions), colors=colors)
    loose = grid12(rng.uniform(-4, 4, (60, 3)))
    parts = [
        (ball, transforms.translation(-0.75, 1.0, 0.5)),
        (shapes.box((0.5, 0, -1), (1.75, 2.25, 0.5)), np.eye(4)),
        (shapes.grid(40.0, 40.0, 3, 5), np.eye(4)),
        (Primitive(loose, np.arange(60).reshape(20, 3), 1), transforms.scaling(2.0, 0.5, 1.0)),
    ]
    materials = (Material(metallic=1.0, roughness=0.0), Material(double_sided=True))
    return objects(parts, materials)


POSE = look_at((1.0, 2.5, 5.0), (0.0, 0.75, 0.0), (0.1, 1.0, 0.0))
CAMERAS = {
    "perspective": Camera.perspective(POSE, 50.0, ASPECT, near=0.25),
    "off-axis": Camera.frustum(POSE, -0.7, 0.5, -0.3, 0.5, near=0.25).jittered(0.3, -0.2, SIZE),
    "orthographic": Camera.orthographic(POSE, 6.0, ASPECT, near=0.25),
}


def moved_camera(camera: Camera, shift: np.ndarray, scale: float = 1.0) -> Camera:
    """The eye scaled, then moved; near, far and an orthographic image's height scaled."""
    pose = np.array(camera.world_from_view)
    pose[:3, 3] = pose[:3, 3] * scale + shift
    clip = np.array(camera.clip_from_view)
    if not camera.is_perspective:
        clip[:2, :2] /= scale
    return Camera(pose, clip, camera.near * scale, camera.far * scale)


def same(a: Drawn, b: Drawn, *, but: tuple[str, ...] = ()) -> None:
    """Every image has the same bytes, and the counters agree."""
    left, right = image_bytes(a.g), image_bytes(b.g)
    assert left.keys() == right.keys()
    for name in left.keys() - set(but):
        assert left[name] == right[name], name
    assert asdict(a.g.counts) == asdict(b.g.counts)


# --- Attributes -----------------------------------------------------------------------------------


def test_equal_attributes_are_used_as_they_are() -> None:
    """Spec 3.4: an albedo of base·colour to the bit, in every pixel of a tilted triangle.

    0.1, 0.3 and 0.7 are not sums of weights: mixing 0.1f three times would show in the last bit of
    many pixels. The unit normal (0.6, 0, 0.8) of an unturned camera comes out as it went in.
    """
    color = np.array((0.1, 0.3, 0.7), np.float32)
    base = (0.9, 0.5, 1 / 3)
    normal = np.array((3.0, 0.0, 4.0), np.float32)  # a length of exactly 5
    scene = soup(
        [[[-9, -9, -2], [9, -7, -9], [1, 9, -4]]],
        Material(base_color=base),
        colors=np.tile(color, (3, 1)),
        normals=np.tile(normal, (3, 1)),
    )
    g = draw(scene, Camera.perspective(np.eye(4), 60.0, ASPECT, near=0.1), SIZE).g
    seen = g.triangle_id == 0
    assert seen.sum() > 400
    want = np.array(base) * color.astype(np.float64)
    assert (g.albedo[seen] == want).all()
    # Divided by the largest component, then by the length: (3/4, 0, 1)/1.25.
    assert (g.normal_vs[seen] == (0.75 / 1.25, 0.0, 1.0 / 1.25)).all()


def test_equal_attributes_stay_equal_when_others_vary() -> None:
    """Colours equal and normals not: ambient light gives albedo · ambient to the bit. Normals equal
    and colours not: radiance is albedo times one irradiance, the one that a white face shows.
    """
    corners = [[[-9, -9, -2], [9, -7, -9], [1, 9, -4]]]
    camera = Camera.perspective(np.eye(4), 60.0, ASPECT, near=0.1)
    white = Material(base_color=(1.0, 1.0, 1.0))
    normal, color = np.float32((0.1, 0.3, 0.7)), np.float32((0.1, 0.3, 0.7))
    one_normal, one_color = np.tile(normal, (3, 1)), np.tile(color, (3, 1))
    many = np.float32([(0.9, 0.2, 0.4), (0.1, 0.8, 0.3), (0.3, 0.3, 0.6)])

    ambient = Lights(ambient=(0.3, 0.3, 0.3), directional=())
    scene = soup(corners, white, normals=many, colors=one_color).with_lights(ambient)
    g = draw(scene, camera, SIZE).g
    seen = g.triangle_id == 0
    assert len(np.unique(g.normal_vs[seen], axis=0)) > 100
    assert (g.albedo[seen] == color.astype(np.float64)).all()
    assert (g.radiance[seen] == color.astype(np.float64) * 0.3).all()

    irradiance = draw(soup(corners, white, normals=one_normal), camera, SIZE).g.radiance[seen]
    assert len(np.unique(irradiance, axis=0)) == 1
    g = draw(soup(corners, white, normals=one_normal, colors=many), camera, SIZE).g
    assert len(np.unique(g.normal_vs[seen], axis=0)) == 1
    assert len(np.unique(g.albedo[seen], axis=0)) > 100
    assert (g.radiance[seen] == g.albedo[seen] * irradiance).all()


def test_interpolated_attributes_differ_inside() -> None:
    """The test above can fail: with one colour changed, the albedo varies from pixel to pixel."""
    colors = np.tile(np.array((0.1, 0.3, 0.7), np.float32), (3, 1))
    colors[2, 0] = np.nextafter(colors[2, 0], np.float32(1))
    scene = soup([[[-9, -9, -2], [9, -7, -9], [1, 9, -4]]], colors=colors)
    g = draw(scene, Camera.perspective(np.eye(4), 60.0, ASPECT, near=0.1), SIZE).g
    assert len(np.unique(g.albedo[g.triangle_id == 0], axis=0)) > 100


# --- Powers of two --------------------------------------------------------------------------------


@pytest.mark.parametrize("k", [-40, -17, -1, 1, 20, 40])
@pytest.mark.parametrize("name", CAMERAS)
def test_a_scene_scaled_by_a_power_of_two(name: str, k: int) -> None:
    """Spec 2.5: positions, eye, near × 2ᵏ: depths × 2ᵏ exactly, every other byte the same."""
    scene, camera, s = small_scene(), CAMERAS[name], 2.0**k
    plain = draw(scene, camera, SIZE)
    nodes = []
    for node in scene.nodes:
        m = np.array(node.world_from_mesh)
        m[:3] *= s
        nodes.append(Node(node.name, node.mesh, m))
    by_node = draw(replace(scene, nodes=tuple(nodes)), moved_camera(camera, np.zeros(3), s), SIZE)
    meshes = tuple(
        replace(
            mesh,
            primitives=tuple(
                replace(p, positions=p.positions * np.float32(s)) for p in mesh.primitives
            ),
        )
        for mesh in scene.meshes
    )
    nodes = []
    for node in scene.nodes:
        m = np.array(node.world_from_mesh)
        m[:3, 3] *= s
        nodes.append(Node(node.name, node.mesh, m))
    by_mesh = draw(
        replace(scene, meshes=meshes, nodes=tuple(nodes)),
        moved_camera(camera, np.zeros(3), s),
        SIZE,
    )
    assert plain.g.counts.clipped > 0
    assert np.isfinite(plain.g.back_depth).sum() > 50
    for scaled in (by_node, by_mesh):
        same(plain, scaled, but=("depth", "back_depth"))
        np.testing.assert_array_equal(scaled.g.depth, plain.g.depth * s)
        np.testing.assert_array_equal(scaled.g.back_depth, plain.g.back_depth * s)


# --- Moves on a grid ------------------------------------------------------------------------------


@pytest.mark.parametrize("shift", [2.0**20, -(2.0**20), 2.0**30, -(2.0**30)])
@pytest.mark.parametrize("name", CAMERAS)
def test_a_scene_moved_on_its_grid(name: str, shift: float) -> None:
    """Spec 2.1: scene and eye moved along all axes by ±2²⁰ or ±2³⁰: every byte the same.

    Coordinates on a 2⁻¹² grid stay exact (42 bits); the view-space subtraction restores them.
    """
    scene, camera = small_scene(), CAMERAS[name]
    plain = draw(scene, camera, SIZE)
    by = np.array([shift, -shift, shift / 2])
    move = transforms.translation(*by)
    nodes = tuple(
        Node(n.name, n.mesh, transforms.multiply(move, n.world_from_mesh)) for n in scene.nodes
    )
    moved = draw(replace(scene, nodes=nodes), moved_camera(camera, by), SIZE)
    same(plain, moved)
    assert len(np.unique(plain.g.triangle_id)) > 40
    off_grid = draw(replace(scene, nodes=nodes), moved_camera(camera, by + 2.0**-10 / 3), SIZE)
    assert image_bytes(off_grid.g)["depth"] != image_bytes(plain.g)["depth"]


# --- Threads, and what is asked for ---------------------------------------------------------------


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread only")
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_threads_change_no_byte(dtype: type) -> None:
    """One thread and two: the same images and counters, and the same again."""
    scene = small_scene()
    size = (61, 83)  # six bands of rows, the last one short
    before = numba.get_num_threads()
    try:
        for camera in CAMERAS.values():
            results = []
            for threads in (1, 2, 2, 1):
                numba.set_num_threads(threads)
                results.append(draw(scene, camera, size, dtype=dtype))
            for other in results[1:]:
                same(results[0], other)
    finally:
        numba.set_num_threads(before)


def test_a_wider_image_shows_the_same_pixels() -> None:
    """Rows and columns added on the right and below, with the camera's edges moved to match.

    Tiles, bands and image size decide nothing: ids are the same in the common part.
    """
    scene = small_scene()
    step = 1 / 32
    small = Camera.frustum(POSE, -0.5, -0.5 + 32 * step, 0.4 - 16 * step, 0.4, near=0.25)
    large = Camera.frustum(POSE, -0.5, -0.5 + 64 * step, 0.4 - 64 * step, 0.4, near=0.25)
    a = draw(scene, small, (32, 16))
    b = draw(scene, large, (64, 64))
    assert len(np.unique(a.g.triangle_id)) > 10
    np.testing.assert_array_equal(b.g.triangle_id[:16, :32], a.g.triangle_id)
    np.testing.assert_allclose(b.g.depth[:16, :32], a.g.depth, rtol=1e-12)


def test_what_is_not_asked_for_changes_nothing() -> None:
    """Each buffer left out: the others keep their bytes."""
    scene, camera = small_scene(), CAMERAS["perspective"]
    everything = image_bytes(draw(scene, camera, SIZE).g)
    for option, gone in (
        ("back_depth", {"back_depth"}),
        ("normal", {"normal_vs"}),
        ("material", {"object_id", "material_id", "albedo", "reflectivity", "roughness"}),
    ):
        less = image_bytes(draw(scene, camera, SIZE, **{option: False}).g)
        assert everything.keys() - less.keys() == gone
        for name, data in less.items():
            assert data == everything[name], (option, name)


def test_the_order_of_objects_changes_only_ids() -> None:
    """No two faces share a depth here, so the reversed list of objects gives the same surfaces."""
    scene, camera = small_scene(), CAMERAS["perspective"]
    quad_behind = quad((-9, -9, -9), (9, -9, -9), (9, 9, -9), (-9, 9, -9))
    parts = [(scene.meshes[n.mesh].primitives, n.world_from_mesh) for n in scene.nodes]
    parts.append((quad_behind, None))
    forward = draw(objects(parts, scene.materials), camera, SIZE).g
    backward = draw(objects(parts[::-1], scene.materials), camera, SIZE).g
    for name in ("depth", "back_depth", "normal_vs", "radiance", "material_id"):
        assert forward.arrays()[name].tobytes() == backward.arrays()[name].tobytes(), name
    np.testing.assert_array_equal(
        backward.object_id, np.where(forward.object_id < 0, -1, 4 - forward.object_id)
    )

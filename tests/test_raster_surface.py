"""Geometric normals, back depth by hand, mirrored and scaled objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from raster_drawing import ONE_SIDED, TWO_SIDED, Drawn, draw, objects, quad, soup

from ssr_ref import transforms
from ssr_ref.camera import Camera, look_at
from ssr_ref.scene import Primitive
from ssr_ref.scenes import shapes

SIZE = (37, 23)
ASPECT = SIZE[0] / SIZE[1]
ULPS = 4 * 2.0**-53
"""1/z and back: two roundings, doubled."""


def lens(orthographic: bool, pose: np.ndarray | None = None) -> Camera:
    """60° or 6 units high, near 0.1."""
    pose = np.eye(4) if pose is None else pose
    if orthographic:
        return Camera.orthographic(pose, 6.0, ASPECT, near=0.1)
    return Camera.perspective(pose, 60.0, ASPECT, near=0.1)


def rays(camera: Camera, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """World-space origins and directions (H, W, 3) of unit view depth, through the centres."""
    view = camera.params(size)
    px, py = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    x, y = (px - view.cx) / view.fx, (view.cy - py) / view.fy
    zero, one = np.zeros_like(x), np.ones_like(x)
    pose = camera.world_from_view
    if camera.is_perspective:
        return np.broadcast_to(pose[:3, 3], (*x.shape, 3)), np.stack([x, y, -one], -1) @ pose[
            :3, :3
        ].T
    origins = np.stack([x, y, zero], -1) @ pose[:3, :3].T + pose[:3, 3]
    return origins, np.stack([zero, zero, -one], -1) @ pose[:3, :3].T


# --- Normals --------------------------------------------------------------------------------------


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("material", [ONE_SIDED, TWO_SIDED], ids=lambda m: m.name)
def test_geometric_normals_are_unit_and_face_the_eye(orthographic: bool, material: object) -> None:
    """|n|² = 1 to 2⁻⁵⁰ (4u, dotted) and n·d < 0 at every covered pixel; n is ⊥ to its triangle."""
    rng = np.random.default_rng(9)
    camera = lens(orthographic, look_at((0.1, 0.2, 5.0), (0.3, -0.2, 0.0), (0.1, 1.0, 0.0)))
    for seed in range(6):
        triangles = rng.normal(size=(60, 3, 3)) * (1.0 if seed % 2 else (1.0, 0.02, 3.0))
        drawn = draw(soup(triangles, material), camera, SIZE)  # type: ignore[arg-type]
        seen = drawn.g.triangle_id >= 0
        n = drawn.g.geo_normal_vs[seen]
        assert len(n) > 20
        np.testing.assert_allclose((n * n).sum(axis=1), 1.0, rtol=0, atol=2**-50)
        view = camera.params(SIZE)
        y, x = np.nonzero(seen)
        d = np.stack(
            [(x + 0.5 - view.cx) / view.fx, (view.cy - y - 0.5) / view.fy, -np.ones(len(x))], 1
        )
        d = np.broadcast_to((0.0, 0.0, -1.0), d.shape) if orthographic else d
        assert ((n * d).sum(axis=1) < 0).all()
        corners = drawn.positions_vs[drawn.faces[drawn.g.triangle_id[seen]]]
        for a, b in ((0, 1), (1, 2), (2, 0)):
            edge = corners[:, b] - corners[:, a]
            off = np.abs((edge * n).sum(axis=1)) / np.linalg.norm(edge, axis=1)
            assert off.max() < 1e-12


def test_the_flat_shading_normal_is_the_geometric_one() -> None:
    """Without vertex normals both images have the same bytes."""
    rng = np.random.default_rng(10)
    camera = lens(False, look_at((0.1, 0.2, 5.0), (0.3, -0.2, 0.0)))
    g = draw(soup(rng.normal(size=(60, 3, 3))), camera, SIZE).g
    assert g.normal_vs.tobytes() == g.geo_normal_vs.tobytes()


# --- Back depth, by hand --------------------------------------------------------------------------


def wall(z: float, *, back: bool = False, half: float = 50.0) -> Primitive:
    """A square at depth z that faces the eye, or faces away."""
    corners = [(-half, -half, -z), (half, -half, -z), (half, half, -z), (-half, half, -z)]
    return quad(*(corners[::-1] if back else corners))


def slab(front: float, back: float) -> tuple[Primitive, Primitive]:
    """A front face and a back face, as one closed object shows along a ray."""
    return wall(front), wall(back, back=True)


def depths(drawn: Drawn) -> tuple[float, float]:
    """The one front depth and the one back depth of the whole image."""
    front, back = np.unique(drawn.g.depth), np.unique(drawn.g.back_depth)
    assert front.size == back.size == 1
    return float(front[0]), float(back[0])


CASES = [
    # (objects in order, front, back of the same object, back of any object)
    ("one slab", [slab(1, 2)], 1, 2, 2),
    ("nested, one object", [(*slab(1, 4), *slab(2, 3))], 1, 3, 3),
    ("a hollow shell", [(*slab(1, 2), *slab(3, 4))], 1, 2, 2),
    ("nested, two objects", [slab(1, 4), slab(2, 3)], 1, 4, 3),
    ("interpenetrating", [slab(1, 3), slab(2, 4)], 1, 3, 3),
    ("interpenetrating, far one first", [slab(2, 3), slab(1, 4)], 1, 4, 3),
    ("a back face before the front", [(wall(1, back=True), *slab(2, 3))], 2, 3, 3),
    ("other objects' back faces before the front", [slab(2, 3), (wall(1, back=True),)], 2, 3, 3),
    ("open, another closed one behind", [(wall(1),), slab(2, 3)], 1, np.inf, 3),
    ("open", [(wall(1),)], 1, np.inf, np.inf),
    ("a back face in the front face's plane is not behind", [slab(1, 1)], 1, np.inf, np.inf),
    ("the same, and a true one", [(*slab(1, 1), wall(5, back=True))], 1, 5, 5),
    ("only back faces", [(wall(1, back=True), wall(2, back=True))], np.inf, np.inf, np.inf),
]


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize(
    ("name", "parts", "front", "own", "anyone"), CASES, ids=lambda v: str(v)[:30]
)
def test_back_depth_by_hand(
    name: str, parts: list, front: float, own: float, anyone: float, orthographic: bool
) -> None:
    """Faces across the view axis, so depths are those written above (spec 3.5)."""
    camera = lens(orthographic)
    scene = objects([(part, None) for part in parts])
    for any_object, want in ((False, own), (True, anyone)):
        got = depths(draw(scene, camera, SIZE, back_any_object=any_object))
        np.testing.assert_allclose(got, (front, want), rtol=ULPS)


@pytest.mark.parametrize("orthographic", [False, True])
def test_two_nodes_of_one_mesh_are_two_objects(orthographic: bool) -> None:
    """An instance is not closed by the other one's back face."""
    scene = objects([(slab(1, 3), None), (slab(1, 3), transforms.translation(0, 0, -1))])
    scene = replace(scene, nodes=(scene.nodes[0], replace(scene.nodes[1], mesh=0)))
    drawn = draw(scene, lens(orthographic), SIZE)
    np.testing.assert_allclose(depths(drawn), (1, 3), rtol=ULPS)
    moved = replace(scene, nodes=scene.nodes[::-1])
    np.testing.assert_allclose(depths(draw(moved, lens(orthographic), SIZE)), (1, 3), rtol=ULPS)


@pytest.mark.parametrize("orthographic", [False, True])
def test_double_sided_faces_are_never_back_faces(orthographic: bool) -> None:
    """A double-sided wall turned away is a front: seen, and no end of anything's slab."""
    camera = lens(orthographic)
    turned = Primitive(wall(2, back=True).positions, wall(2).faces, 1)
    materials = (ONE_SIDED, TWO_SIDED)
    alone = draw(objects([((turned,), None)], materials), camera, SIZE)
    np.testing.assert_allclose(depths(alone), (2, np.inf), rtol=ULPS)
    closed = draw(objects([((*slab(1, 3), turned), None)], materials), camera, SIZE)
    np.testing.assert_allclose(depths(closed), (1, 3), rtol=ULPS)
    for any_object in (False, True):
        behind = draw(
            objects([((wall(1), turned), None)], materials),
            camera,
            SIZE,
            back_any_object=any_object,
        )
        np.testing.assert_allclose(depths(behind), (1, np.inf), rtol=ULPS)


def test_back_depth_is_off_when_nobody_asks() -> None:
    drawn = draw(objects([(slab(1, 3), None)]), lens(False), SIZE, back_depth=False)
    assert drawn.g.back_depth is None
    assert drawn.g.counts.culled == 2


def test_back_depth_reaches_through_the_near_plane() -> None:
    """A box around the eye: no front face, so the image is empty, as a GPU with culling shows."""
    around = objects([(shapes.box((-1, -1, -1), (1, 1, 1)), None)])
    drawn = draw(around, lens(False), SIZE)
    assert (drawn.g.depth == np.inf).all()
    assert (drawn.g.back_depth == np.inf).all()
    # With a plate inside the box, of the same object: the box's far side is its back.
    plate = wall(0.5, half=0.9)
    one = objects([((shapes.box((-1, -1, -1), (1, 1, 1)), plate), None)])
    drawn = draw(one, lens(False), SIZE)
    seen = drawn.g.triangle_id >= 0
    assert seen.all()
    np.testing.assert_allclose(drawn.g.depth, 0.5, rtol=ULPS)
    near_middle = np.abs(np.arange(SIZE[0]) + 0.5 - SIZE[0] / 2) < 10
    np.testing.assert_allclose(drawn.g.back_depth[:, near_middle], 1.0, rtol=1e-14)


# --- Mirrored and scaled objects ------------------------------------------------------------------

SCALES = [
    (1.0, 1.0, 1.0),
    (-1.0, 1.0, 1.0),
    (-1.0, -1.0, 1.0),
    (-1.0, -1.0, -1.0),
    (1.0, 1.0, -1.0),
    (1.7, 0.6, 1.1),
    (-0.5, 1.25, 1.5),
    (0.4, -0.7, -1.3),
    (1.5, 0.8, -1.2),
]


def box_interval(camera: Camera, half: np.ndarray) -> tuple[np.ndarray, ...]:
    """Entry and exit depth (H, W) of the box [−half, half] (inf if missed), and which pixels are
    certain: rays around the centre, 1/128 px away, agree about hit or miss and entry axis.

    Kay and Kajiya's slabs in world space: independent of triangles, projection and winding.
    """
    entries, exits, axes = [], [], []
    for dx, dy in [(0, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]:
        moved = camera.jittered(dx / 128, dy / 128, SIZE)
        origin, d = rays(moved, SIZE)
        with np.errstate(divide="ignore"):
            a, b = (-half - origin) / d, (half - origin) / d
        low, high = np.minimum(a, b), np.maximum(a, b)
        entry, exit_ = low.max(axis=-1), high.min(axis=-1)
        hit = entry < exit_
        entries.append(np.where(hit, entry, np.inf))
        exits.append(np.where(hit, exit_, np.inf))
        axes.append(np.where(hit, low.argmax(axis=-1) + 4 * high.argmin(axis=-1), -1))
    certain = np.all([axis == axes[0] for axis in axes], axis=0)
    return entries[0], exits[0], axes[0] & 3, certain


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("scale", SCALES, ids=str)
def test_a_scaled_cube_shows_its_outside(scale: tuple[float, ...], orthographic: bool) -> None:
    """glTF 1697: under mirroring the outside is seen, normals point out, and front
    and back depth are the entry and exit of the box, for authored normals as for flat ones.

    Authored: the corners' directions, which the inverse transpose takes to ±(1/sx, 1/sy, 1/sz).
    """
    half = np.abs(scale) * 1.0
    for eye in ((2.0, 1.5, 3.0), (-3.0, 0.4, -1.5)):
        camera = lens(orthographic, look_at(eye, (0.1, 0.0, 0.0)))
        entry, exit_, axis, certain = box_interval(camera, half)
        assert certain.mean() > 0.9
        box = shapes.box((-1, -1, -1), (1, 1, 1))
        smooth = replace(box, normals=box.positions)
        for primitive in (box, smooth):
            drawn = draw(objects([(primitive, transforms.scaling(*scale))]), camera, SIZE)
            g = drawn.g
            hit = np.isfinite(entry)
            np.testing.assert_array_equal((g.triangle_id >= 0)[certain], hit[certain])
            sure = certain & hit
            assert sure.sum() > 40
            np.testing.assert_allclose(g.depth[sure], entry[sure], rtol=1e-13)
            np.testing.assert_allclose(g.back_depth[sure], exit_[sure], rtol=1e-13)
            # The geometric normal is the entry side's outward axis.
            n_ws = g.geo_normal_vs[sure] @ camera.world_from_view[:3, :3].T
            origin, d = rays(camera, SIZE)
            p = (origin + entry[..., None].clip(max=1e9) * d)[sure]
            want = np.zeros_like(n_ws)
            index = np.arange(len(want))
            want[index, axis[sure]] = np.sign(p[index, axis[sure]])
            np.testing.assert_allclose(n_ws, want, atol=1e-13)
            if primitive is smooth:
                # Bilinear over a face up to its diagonal: the sign of every component is p's.
                s_ws = g.normal_vs[sure] @ camera.world_from_view[:3, :3].T
                assert (s_ws[index, axis[sure]] * want[index, axis[sure]] > 0).all()
                clear = np.abs(p) > 0.9 * half
                assert (np.sign(s_ws[clear]) == np.sign(p[clear])).mean() > 0.97
                np.testing.assert_allclose((s_ws**2).sum(axis=1), 1, atol=2**-50)


@pytest.mark.parametrize("scale", SCALES[1:5], ids=str)
def test_mirroring_a_cube_keeps_its_radiance(scale: tuple[float, ...]) -> None:
    """A cube that is its own mirror image: same radiance, reflectivity and albedo bytes."""
    camera = lens(False, look_at((2.0, 1.5, 3.0), (0.1, 0.0, 0.0)))
    box = shapes.box((-1, -1, -1), (1, 1, 1))
    plain = draw(objects([(box, None)]), camera, SIZE).g
    mirrored = draw(objects([(box, transforms.scaling(*scale))]), camera, SIZE).g
    assert len(np.unique(plain.radiance)) > 3
    for name in ("radiance", "albedo", "reflectivity", "object_id", "material_id"):
        assert plain.arrays()[name].tobytes() == mirrored.arrays()[name].tobytes(), name
    np.testing.assert_allclose(mirrored.depth, plain.depth, rtol=1e-14)
    np.testing.assert_allclose(mirrored.back_depth, plain.back_depth, rtol=1e-13)


def test_normals_under_a_non_uniform_scale() -> None:
    """Inverse transpose by hand: normal (1, 1, 0)/√2 under scale (4, 1, 1) points to (¼, 1, 0).

    Mirrored in x: to (−¼, 1, 0). A plain matrix product would give (4, 1, 0).
    """
    face = quad((-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9))
    slanted = replace(face, normals=np.full((4, 3), (1.0, 1.0, 0.0)))
    camera = lens(False, look_at((0.0, 3.0, 4.0), (0.0, 0.0, 0.0)))
    for sx in (4.0, -4.0):
        g = draw(objects([(slanted, transforms.scaling(sx, 1, 1))]), camera, SIZE).g
        seen = g.triangle_id >= 0
        assert seen.sum() > 300
        n_ws = g.normal_vs[seen] @ camera.world_from_view[:3, :3].T
        want = np.array([1 / sx, 1.0, 0.0]) / np.hypot(0.25, 1.0)
        np.testing.assert_allclose(n_ws, np.broadcast_to(want, n_ws.shape), atol=1e-15)

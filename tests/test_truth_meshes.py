"""Truth of meshes: against a mirrored camera, against closed forms, and what may not change it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mutants import mutant
from tracing import turned

from ssr_ref import Material, Mesh, Node, Scene, transforms
from ssr_ref.analytic import AnalyticScene, Box, analytic_gbuffer
from ssr_ref.buffers import GBuffer, Side, Truth, TruthClass
from ssr_ref.camera import Camera, look_at
from ssr_ref.errors import SettingsError
from ssr_ref.pipeline import with_radiance
from ssr_ref.raster.geometry import flatten
from ssr_ref.raster.rasterize import RasterOptions, rasterize
from ssr_ref.raster.textures import texture_store
from ssr_ref.scene import Primitive
from ssr_ref.scenes import shapes
from ssr_ref.settings import Settings
from ssr_ref.texture import Image, Texture
from ssr_ref.truth import trace_truth
from ssr_ref.truth.closed_form import analytic_truth
from ssr_ref.truth.reflections import mesh_reflections

pytestmark = pytest.mark.slow  # compiles much

SIZE = (47, 31)
MIRROR = Material("mirror", (0.9, 0.9, 0.9), metallic=1.0, roughness=0.0)
RED = Material("red", (0.8, 0.2, 0.1), emissive=(0.1, 0.0, 0.2))
GREY = Material("grey", (0.3, 0.7, 0.4))


def gbuffer_of(scene: Scene, camera: Camera, size: tuple[int, int] = SIZE) -> GBuffer:
    """The rasterizer's buffers in float64."""
    view, geometry, store = camera.params(size), flatten(scene), texture_store(scene)
    drawn, positions = rasterize(view, geometry, RasterOptions(dtype=np.float64), store=store)
    return with_radiance(view, geometry, positions, drawn, scene, store)


def truth_of(scene: Scene, camera: Camera, size: tuple[int, int] = SIZE, **kw: Any) -> Truth:
    return mesh_reflections(scene, camera, size, gbuffer_of(scene, camera, size), **kw)


def quad(corners: Sequence[Sequence[float]], material: int, **parts: Any) -> Primitive:
    """Counter-clockwise corners; uv 0 to 1."""
    uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Primitive(np.array(corners, np.float32), faces, material, uv0=uv, **parts)


def gallery() -> Scene:
    """Everything that decides what is met, above a mirror floor (the last object)."""
    rng = np.random.default_rng(3)
    pixels = rng.integers(0, 256, (5, 7, 4), dtype=np.uint8)
    leaves = Material("leaves", (1, 1, 1), alpha_cutoff=0.5, base_color_texture=Texture(0))
    sheet = Material("sheet", (0.2, 0.5, 0.9), double_sided=True)
    tinted = shapes.sphere(0.45, 3, material=2)
    colors = rng.uniform(0, 1, tinted.positions.shape).astype(np.float32)
    back = [(-0.6, 0.1, -0.5), (0.4, 0.1, -0.5), (0.4, 1.2, -0.5), (-0.6, 1.2, -0.5)]
    parts: list[tuple[Primitive, np.ndarray | None]] = [
        (shapes.box((-2.0, 0.0, -2.0), (2.0, 2.0, -1.6), material=1), None),
        # From the mirror its back is seen: passed through.
        (quad(back[::-1], 1), None),
        (quad([(x - 1.2, y, z + 0.3) for x, y, z in back][::-1], 3), None),
        (quad([(x + 1.1, y, z + 0.5) for x, y, z in back], 4), None),
        (replace(tinted, colors=colors), transforms.translation(0.2, 0.6, 0.4)),
        # A mirroring transform: winding flips.
        (shapes.box((0, 0, 0), (0.5, 0.5, 0.5), material=5),
         np.array([[-1.0, 0, 0, -0.9], [0, 1, 0, 0.25], [0, 0, 1, 0.9], [0, 0, 0, 1]])),
        (shapes.quad([(-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)]), None),
    ]  # fmt: skip
    return Scene(
        tuple(Mesh(str(i), (p,)) for i, (p, _) in enumerate(parts)),
        tuple(
            Node(str(i), i, transforms.identity() if m is None else m)
            for i, (_, m) in enumerate(parts)
        ),
        (MIRROR, RED, GREY, sheet, leaves, Material("last", (0.6, 0.6, 0.1))),
        images=(Image("leaves", pixels),),
    )


def camera_of(kind: str, *, mirrored: bool = False) -> Camera:
    """A camera, or the one under the floor that sees its picture flipped left to right."""
    pose = look_at((1.0, 1.7, 4.2), (0.0, 0.35, 0.0))
    if mirrored:
        flip_y, flip_x = np.diag([1.0, -1, 1, 1]), np.diag([-1.0, 1, 1, 1])
        pose = transforms.multiply(transforms.multiply(flip_y, pose), flip_x)
    if kind == "perspective":
        return Camera.perspective(pose, 42.0, SIZE[0] / SIZE[1], near=0.01)
    return Camera.orthographic(pose, 3.0, SIZE[0] / SIZE[1], near=0.01)


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_a_flat_mirror_shows_what_the_mirrored_camera_sees(kind: str) -> None:
    """Culling, masks, textures, vertex colours and normals, decided twice by other code."""
    scene = gallery()
    camera = camera_of(kind)
    g = gbuffer_of(scene, camera)
    truth = mesh_reflections(scene, camera, SIZE, g)
    without_floor = replace(scene, nodes=scene.nodes[:-1])
    seen = gbuffer_of(without_floor, camera_of(kind, mirrored=True))
    there = {name: a[:, ::-1] for name, a in seen.arrays().items()}
    mirror = g.object_id == len(scene.nodes) - 1
    assert np.array_equal(truth.truth != TruthClass.NO_RAY, mirror)
    agree = mirror & (truth.triangle_id == there["triangle_id"])
    # The rasterizer snaps to 1/256 px, so centres this close to an edge may differ.
    assert (mirror & ~agree).sum() <= 0.02 * mirror.sum()
    met = agree & (truth.triangle_id >= 0)
    objects, counts = np.unique(truth.object_id[met], return_counts=True)
    assert objects.tolist() == [0, 2, 3, 4, 5]  # never the quad that turns its back
    assert counts.min() > 5
    assert np.abs(truth.radiance - there["radiance"])[met].max() < 1e-11
    assert np.isnan(truth.radiance[~(truth.triangle_id >= 0)]).all()
    masked = truth.object_id == 3
    assert 20 < masked.sum() < 0.8 * (masked | (there["object_id"] == 3) | agree).sum()


def closed_forms(poses: Sequence[np.ndarray]) -> tuple[AnalyticScene, Scene]:
    """Boxes on a slab, closed and as triangles. Sizes are halves and eighths: float32 numbers."""
    sizes = [(8.0, 0.5, 8.0), *((0.5, 0.75, 0.375) for _ in poses)]
    places = [transforms.translation(0.0, -0.5, 0.0), *poses]
    materials = (MIRROR, replace(RED, metallic=0.5, roughness=0.25), GREY)
    analytic = AnalyticScene(
        tuple(Box(s, m, i) for i, (s, m) in enumerate(zip(sizes, places, strict=True))), materials
    )
    boxes = [shapes.box([-v for v in s], s, material=i) for i, s in enumerate(sizes)]
    meshes = Scene(
        tuple(Mesh("box", (box,)) for box in boxes),
        tuple(Node("box", i, m) for i, m in enumerate(places)),
        materials,
    )
    return analytic, meshes


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_boxes_as_triangles_and_as_closed_forms(kind: str) -> None:
    rng = np.random.default_rng(17)
    poses = [turned(rng, move=(-0.6, 1.0, 0.0)), turned(rng, move=(0.9, 1.1, -0.4))]
    analytic, meshes = closed_forms(poses)
    camera = camera_of(kind)
    g, exact_g = gbuffer_of(meshes, camera), analytic_gbuffer(analytic, camera, SIZE)
    assert g.reflectivity is not None and exact_g.reflectivity is not None
    settings = Settings(size=SIZE, max_distance=np.inf)
    found = trace_truth(meshes, camera, settings, g)
    exact = trace_truth(analytic, camera, settings, exact_g)

    both = (found.truth != 0) & (exact.truth != 0) & (g.object_id == exact_g.object_id)
    assert both.sum() > 0.9 * (exact.truth != 0).sum()
    same = both & (found.object_id == exact.object_id)
    same[same] &= np.abs(g.depth[same] - exact_g.depth[same]) < 1e-9
    assert (both & ~same).sum() <= 0.01 * both.sum()
    met = same & (found.object_id >= 0)
    assert set(np.unique(found.object_id[met])) == {0, 1, 2}
    # An error δ of the start moves a hit by δ/cos of the angle to the surface that is met: what is
    # left of 1e-12 after 95 % of the rays are grazing ones.
    error = np.abs(found.distance - exact.distance)[met] / exact.distance[met]
    assert np.median(error) < 2e-15 and np.quantile(error, 0.95) < 1e-13 and error.max() < 1e-11
    moved = np.abs(found.hit_px - exact.hit_px)[met].max(axis=1)
    seen = exact.hit_depth[met] > 0.1  # nearer the eye, and behind it, pixels are endless
    assert moved[seen].max() < 1e-9
    assert np.abs(found.radiance - exact.radiance)[met].max() < 1e-14
    # The class is looked up differently, in pixels and by a ray: they part at outlines only.
    classes = (found.truth == exact.truth) & (found.side == exact.side)
    assert (same & ~classes).sum() <= 0.03 * same.sum()
    kinds = set(np.unique(exact.truth[same & classes]))
    assert {TruthClass.NOTHING, TruthClass.BACK_FACING, TruthClass.VISIBLE} <= kinds
    assert (TruthClass.OFF_SCREEN in kinds) == (kind == "perspective")


def test_every_side_of_the_screen() -> None:
    """A mirror ball in a room: the sides of its hits follow from where the walls are."""
    rooms = [
        ((-5.0, -4.0, -3.0), (-4.5, 4.0, 9.0), Side.LEFT),
        ((4.5, -4.0, -3.0), (5.0, 4.0, 9.0), Side.RIGHT),
        ((-5.0, 3.5, -3.0), (5.0, 4.0, 9.0), Side.TOP),
        ((-5.0, -4.0, -3.0), (5.0, -3.5, 9.0), Side.BOTTOM),
        ((-5.0, -4.0, 8.5), (5.0, 4.0, 9.0), Side.BEHIND),
        ((-5.0, -4.0, -99.0), (5.0, 4.0, -98.0), Side.BEYOND),
    ]
    ball = shapes.sphere(1.0, 6)
    parts = [ball, *(shapes.box(low, high, material=1) for low, high, _ in rooms)]
    scene = Scene(
        tuple(Mesh(str(i), (p,)) for i, p in enumerate(parts)),
        tuple(Node(str(i), i) for i in range(len(parts))),
        (MIRROR, RED),
    )
    pose = look_at((0.0, 0.0, 3.0), (0.0, 0.0, 0.0))
    camera = Camera.perspective(pose, 45.0, SIZE[0] / SIZE[1], near=0.5, far=50.0)
    truth = truth_of(scene, camera)
    off = truth.truth == TruthClass.OFF_SCREEN
    assert np.array_equal(truth.side != Side.NONE, off)
    for i, (_, _, side) in enumerate(rooms, start=1):
        here = truth.side[off & (truth.object_id == i)]
        if side == Side.BEYOND:
            assert (here == side).all()
        else:
            assert (here == side).sum() > 0, side
    x, y = truth.hit_px[..., 0], truth.hit_px[..., 1]
    assert (truth.hit_depth[truth.side == Side.BEHIND] < 0.5).all()
    assert (x[truth.side == Side.LEFT] < 0).all() and (x[truth.side == Side.RIGHT] >= 47).all()
    assert (y[truth.side == Side.TOP] < 0).all() and (y[truth.side == Side.BOTTOM] >= 31).all()
    assert np.isnan(x[off & (truth.hit_depth <= 0)]).all()


def facing_scene(double_sided: bool) -> Scene:
    """A mirror wall, and before it a card that turns its back to the wall (if single-sided)."""
    card = Material("card", (0.5, 0.5, 0.5), double_sided=double_sided)
    return Scene(
        (
            Mesh("wall", (quad([(-4, -4, -3), (4, -4, -3), (4, 4, -3), (-4, 4, -3)], 0),)),
            Mesh("card", (quad([(-1, -1, -2), (1, -1, -2), (1, 1, -2), (-1, 1, -2)], 1),)),
        ),
        (Node("wall", 0), Node("card", 1)),
        (MIRROR, card),
    )


def test_a_back_is_met_only_if_it_is_drawn() -> None:
    pose = look_at((3.0, 0.4, 2.0), (0.0, 0.0, -3.0))
    camera = Camera.perspective(pose, 50.0, SIZE[0] / SIZE[1], near=0.1)
    through = truth_of(facing_scene(False), camera)
    assert not (through.object_id == 1).any()
    met = truth_of(facing_scene(True), camera)
    back = met.object_id == 1
    assert back.sum() > 20
    # The wall shows the side that the eye does not see, and it is lit as that side:
    # normal (0, 0, −1), default lights at (−0.5, −1, −0.35) and (0.6, −0.4, −0.7).
    assert np.isin(met.truth[back], [TruthClass.BACK_FACING, TruthClass.OFF_SCREEN]).all()
    assert (met.truth[back] == TruthClass.BACK_FACING).any()
    lit = 0.25  # ambient alone: both lights travel towards −z
    assert np.abs(met.radiance[back] - 0.5 * lit).max() < 1e-15


def test_contact_is_met_and_the_own_surface_is_not() -> None:
    """A box stands on a mirror: next to its foot the first hit is the box, at hardly any distance;
    the faceted ball never meets itself from outside."""
    ball = shapes.sphere(0.5, 4)
    floor = shapes.quad([(-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)])
    scene = Scene(
        (
            Mesh("floor", (floor,)),
            Mesh("box", (shapes.box((-0.5, 0, -0.5), (0.5, 1, 0.5), material=1),)),
            Mesh("ball", (ball,)),
        ),
        (Node("floor", 0), Node("box", 1), Node("ball", 2, transforms.translation(1.4, 0.6, 0.4))),
        (MIRROR, RED),
    )
    camera = Camera.perspective(look_at((0.0, 1.0, 4.0), (0.3, 0.2, 0)), 30.0, 47 / 31, near=0.1)
    g = gbuffer_of(scene, camera)
    truth = mesh_reflections(scene, camera, SIZE, g)
    own = (g.object_id == 2) & (truth.object_id == 2)
    assert (g.object_id == 2).sum() > 50 and not own.any()
    assert g.object_id is not None
    foot = 0
    for x in range(SIZE[0]):
        box = np.flatnonzero(g.object_id[:, x] == 1)
        if len(box) and box[-1] + 1 < SIZE[1] and g.object_id[box[-1] + 1, x] == 0:
            foot += 1
            assert truth.object_id[box[-1] + 1, x] == 1
            assert truth.distance[box[-1] + 1, x] < 0.3
    assert foot > 5


def test_rays_below_the_surface_are_none() -> None:
    """Normals that lean 7° away from the eye turn rays 14° down: into the floor where the eye looks
    down on it by less, which is in the upper half."""
    floor = shapes.quad([(-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)])
    lean = np.tile(np.float32([0.0, 0.9925, -0.1219]), (4, 1))
    pose = look_at((0.0, 1.0, 4.0), (0.0, 0.0, 0.0))
    camera = Camera.perspective(pose, 40.0, SIZE[0] / SIZE[1], near=0.1)
    below = Scene((Mesh("f", (replace(floor, normals=lean),)),), (Node("f", 0),), (MIRROR,))
    truth = truth_of(below, camera)
    g = gbuffer_of(below, camera)
    assert (g.triangle_id >= 0).sum() > 700
    assert g.geo_normal_vs is not None and g.normal_vs is not None
    view = camera.params(SIZE)
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    d = np.stack([(x - view.cx) / view.fx, (view.cy - y) / view.fy, -np.ones_like(x)], axis=-1)
    r = d - 2.0 * (d * g.normal_vs).sum(axis=-1, keepdims=True) * g.normal_vs
    up = (r * g.geo_normal_vs).sum(axis=-1) > 0.0
    drawn = g.triangle_id >= 0
    assert np.array_equal(truth.truth[drawn] == TruthClass.NO_RAY, ~up[drawn])
    assert 0 < up[drawn].sum() < drawn.sum()


def tiny_picture() -> tuple[bytes, bytes]:
    """Bytes of hits and of truth of a card above a mirror, by whatever `ssr_ref` is imported."""
    from ssr_ref import Material, Mesh, Node, Scene, Settings
    from ssr_ref.camera import Camera, look_at
    from ssr_ref.pipeline import render
    from ssr_ref.scenes import shapes
    from ssr_ref.truth import trace_truth

    floor = shapes.quad([(-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)])
    card = shapes.quad([(-1, 0, -1), (1, 0, -1), (1, 1, -1), (-1, 1, -1)], material=1)
    scene = Scene(
        (Mesh("floor", (floor,)), Mesh("card", (card,))),
        (Node("floor", 0), Node("card", 1)),
        (Material("mirror", (0.9, 0.9, 0.9), metallic=1.0, roughness=0.0), Material("red")),
    )
    camera = Camera.perspective(look_at((0.3, 0.8, 2), (0, 0.2, 0)), 50.0, 9 / 7, near=0.1)
    frame = render(scene, camera, Settings(size=(9, 7), tracer="cells"))
    truth = trace_truth(scene, camera, frame.settings, frame.gbuffer)
    hits = frame.hits.status.tobytes() + frame.hits.hit_px.tobytes()
    return hits, b"".join(a.tobytes() for a in truth.arrays().values())


def test_a_wrong_sign_in_the_tracers_reflection_cannot_change_truth() -> None:
    """Planted in the source; the interpreted copy gives the compiled bytes, mistake or not."""
    hits, truth = tiny_picture()
    with mutant("vecmath.vec", "incident.y - k * normal.y", "incident.y + k * normal.y"):
        wrong_hits, same = tiny_picture()
    assert wrong_hits != hits
    assert same == truth


def test_normals_of_the_g_buffer_are_not_read() -> None:
    scene, camera = gallery(), camera_of("perspective")
    g = gbuffer_of(scene, camera)
    assert g.normal_vs is not None and g.geo_normal_vs is not None
    wrong = replace(g, normal_vs=-g.normal_vs, geo_normal_vs=-g.geo_normal_vs)
    before, after = (mesh_reflections(scene, camera, SIZE, b) for b in (g, wrong))
    assert same_truth(before, after)


def same_truth(a: Truth, b: Truth) -> bool:
    """Every byte agrees."""
    first, second = a.arrays(), b.arrays()
    return all(first[name].tobytes() == second[name].tobytes() for name in first)


def test_moved_on_its_grid_every_byte_is_kept() -> None:
    scene, camera = gallery(), camera_of("perspective")
    eye = np.round(camera.world_from_view[:3, 3] * 4096) / 4096

    def snapped(shift: float) -> tuple[Scene, Camera]:
        """Vertices and eye on a grid of 2⁻¹², all of it moved."""
        meshes = tuple(
            Mesh(m.name, tuple(
                replace(p, positions=np.round(p.positions * 4096) / 4096) for p in m.primitives
            ))
            for m in scene.meshes
        )  # fmt: skip
        nodes = tuple(
            replace(n, world_from_mesh=transforms.multiply(
                transforms.translation(shift, 0.0, -shift), np.round(n.world_from_mesh * 4) / 4
            ))
            for n in scene.nodes
        )  # fmt: skip
        pose = camera.world_from_view.copy()
        pose[:3, 3] = eye + np.array([shift, 0.0, -shift])
        return replace(scene, meshes=meshes, nodes=nodes), replace(camera, world_from_view=pose)

    here, there = truth_of(*snapped(0.0)), truth_of(*snapped(2.0**20))
    assert same_truth(here, there)
    assert (here.truth == TruthClass.VISIBLE).sum() > 50


@pytest.mark.parametrize("power", [-30, 12])
def test_scaled_by_a_power_of_two(power: int) -> None:
    scene, camera = gallery(), camera_of("perspective")
    s = 2.0**power
    grown = replace(
        scene,
        nodes=tuple(
            replace(n, world_from_mesh=transforms.multiply(transforms.scaling(s, s, s),
                                                           n.world_from_mesh))
            for n in scene.nodes
        ),
    )  # fmt: skip
    pose = camera.world_from_view.copy()
    pose[:3, 3] *= s
    bigger = replace(camera, world_from_view=pose, near=camera.near * s)
    before = truth_of(scene, camera, max_distance=3.0)
    after = truth_of(grown, bigger, max_distance=3.0 * s)
    lengths = {"distance": before.distance * s, "hit_depth": before.hit_depth * s}
    assert same_truth(replace(before, **lengths), after)
    assert (before.truth == TruthClass.NOTHING).any() and (before.distance > 2.0).any()


def test_max_distance_is_inclusive_and_ends_rays() -> None:
    scene, camera = gallery(), camera_of("perspective")
    g = gbuffer_of(scene, camera)
    free = mesh_reflections(scene, camera, SIZE, g)
    limit = float(np.sort(free.distance[free.triangle_id >= 0])[100])
    short = mesh_reflections(scene, camera, SIZE, g, limit)
    kept = free.distance <= limit
    assert (free.distance == limit).any()
    assert np.array_equal(short.triangle_id >= 0, kept)
    assert np.array_equal(short.distance[kept], free.distance[kept])
    assert (short.truth[(free.triangle_id >= 0) & ~kept] == TruthClass.NOTHING).all()


def test_what_is_refused() -> None:
    scene, camera = gallery(), camera_of("perspective")
    g = gbuffer_of(scene, camera)
    for bad, size, word in (
        (g, (31, 47), "47x31; expected 31x47"),
        (replace(g, reflectivity=None), SIZE, "reflectivity is none"),
        (
            replace(g, triangle_id=np.full_like(g.triangle_id, 10**6)),
            SIZE,
            "shows triangle 1000000",
        ),
    ):
        with pytest.raises(SettingsError, match=word):
            mesh_reflections(scene, camera, size, bad)
    with pytest.raises(SettingsError, match="max_distance is 0; expected above 0"):
        mesh_reflections(scene, camera, SIZE, g, 0.0)
    before = {name: a.tobytes() for name, a in g.arrays().items()}
    mesh_reflections(scene, camera, SIZE, g)
    assert before == {name: a.tobytes() for name, a in g.arrays().items()}


def test_analytic_truth_has_sides_and_radiance() -> None:
    """Sides by the definition from hit_px and depth; radiance of what is VISIBLE is the G-buffer's
    where the pixel shows the same flat face."""
    analytic, _ = closed_forms([transforms.translation(-0.6, 0.75, 0.0)])
    camera = camera_of("perspective")
    g = analytic_gbuffer(analytic, camera, SIZE)
    truth = analytic_truth(analytic, camera, SIZE, g)
    off = truth.truth == TruthClass.OFF_SCREEN
    assert off.any() and np.array_equal(truth.side != 0, off)
    assert (truth.hit_px[truth.side == Side.TOP][:, 1] < 0).all()
    seen = np.argwhere(truth.truth == TruthClass.VISIBLE)
    assert len(seen) > 30
    assert g.radiance is not None
    for y, x in seen:
        px, py = np.floor(truth.hit_px[y, x]).astype(int)
        if g.triangle_id[py, px] == truth.triangle_id[y, x]:
            assert np.array_equal(truth.radiance[y, x], g.radiance[py, px])
    assert np.isnan(truth.radiance[truth.object_id < 0]).all()

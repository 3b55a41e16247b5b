"""Planar mirrors against closed-form rays: the same surface, point and colour at every pixel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from tracing import turned

from ssr_ref import Material, Mesh, Node, Scene, transforms
from ssr_ref.analytic import (
    AnalyticReflections,
    AnalyticScene,
    Box,
    Plane,
    analytic_gbuffer,
    analytic_reflections,
)
from ssr_ref.camera import Camera, look_at
from ssr_ref.pipeline import with_radiance
from ssr_ref.planar import PlanarReflection, find_mirrors, planar_reflections
from ssr_ref.raster.geometry import flatten
from ssr_ref.raster.rasterize import RasterOptions, rasterize
from ssr_ref.scene import Lights
from ssr_ref.scenes import shapes

pytestmark = pytest.mark.slow  # compiles much

SIZE = (97, 61)
REACH = 16.0
"""Half the side of the squares that stand for endless planes; hits beyond are not compared."""

MATERIALS = (
    Material("mirror", (0.9, 0.8, 0.9), metallic=1.0, roughness=0.0),
    Material("red", (0.8, 0.2, 0.1), emissive=(0.1, 0.0, 0.2)),
    Material("glossy", (0.3, 0.7, 0.4), metallic=0.5, roughness=0.25),
    Material("both sides", (0.2, 0.3, 0.8), double_sided=True),
    Material("one side", (0.9, 0.9, 0.1)),
)
HALF = (0.5, 0.75, 0.375)
CAMERAS = ("perspective", "off-axis", "orthographic")


def camera_of(kind: str) -> Camera:
    pose = look_at((1.5, 1.4, 4.0), (0.2, 0.1, 0.0), (0.05, 1.0, 0.1))
    if kind == "perspective":
        return Camera.perspective(pose, 40.0, SIZE[0] / SIZE[1], near=0.01)
    if kind == "off-axis":
        return Camera.frustum(pose, -0.3, 0.6, -0.5, 0.2, near=0.01)
    return Camera.orthographic(pose, 4.0, SIZE[0] / SIZE[1], near=0.01).jittered(0.2, 0.4, SIZE)


class Both(NamedTuple):
    """The planar image, the closed form, and the pixels where they must agree."""

    planar: PlanarReflection
    truth: AnalyticReflections
    agree: np.ndarray
    edge: np.ndarray
    radius: float
    colors: np.ndarray
    direct: np.ndarray
    surface: np.ndarray  # (H, W) number of the closed form's surface that the mirror shows


def both(
    camera: Camera, sheets: list[tuple[np.ndarray, int]], boxes: list[tuple[np.ndarray, int]]
) -> Both:
    """Sheets and boxes as shapes and as meshes; every reflective face is a mirror."""
    analytic_shapes, meshes, nodes, numbers = [], [], [], []
    square = [(-REACH, -REACH, 0), (REACH, -REACH, 0), (REACH, REACH, 0), (-REACH, REACH, 0)]
    for pose, material in sheets:
        analytic_shapes.append(Plane(tuple(pose[:3, 3]), tuple(pose[:3, 2]), material))
        meshes.append(Mesh("sheet", (shapes.quad(square, material=material),)))
        nodes.append(Node("sheet", len(nodes), pose))
        numbers += 2 * [len(set(numbers))]
    for pose, material in boxes:
        analytic_shapes.append(Box(HALF, pose, material))
        low = [-h for h in HALF]
        meshes.append(Mesh("box", (shapes.box(low, HALF, material=material),)))
        nodes.append(Node("box", len(nodes), pose))
        first = len(set(numbers))
        numbers += [first + i // 2 for i in range(12)]
    lights = Lights()
    closed = AnalyticScene(tuple(analytic_shapes), MATERIALS, lights=lights)
    scene = Scene(tuple(meshes), tuple(nodes), MATERIALS, lights=lights)
    view, geometry = camera.params(SIZE), flatten(scene)
    drawn, positions = rasterize(view, geometry, RasterOptions(dtype=np.float64, back_depth=False))
    drawn = with_radiance(view, geometry, positions, drawn, scene)
    found = find_mirrors(scene, geometry)
    assert not found.refused
    planar = planar_reflections(view, geometry, drawn, lights, found.mirrors)

    # Where snapping may show another surface: any that is seen, directly or in the mirror, within
    # 1/256 px. A vertex moves by at most 1/512 px along each axis.
    exact = analytic_gbuffer(closed, camera, SIZE)
    truth = analytic_reflections(closed, camera, SIZE, exact)
    edge = np.zeros((SIZE[1], SIZE[0]), bool)
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            moved = camera.jittered(dx / 256, dy / 256, SIZE)
            there = analytic_gbuffer(closed, moved, SIZE)
            edge |= there.triangle_id != exact.triangle_id
            edge |= analytic_reflections(closed, moved, SIZE, there).surface_id != truth.surface_id
    # Squares end where planes go on.
    with np.errstate(invalid="ignore"):
        inside = ~(np.abs(truth.point_ws).max(axis=2) > 0.6 * REACH)
    inside &= ~((truth.shape_id < 0) & (planar.triangle_id >= 0))
    start = exact.depth < 0.6 * REACH
    assert exact.reflectivity is not None and drawn.radiance is not None
    surface = np.append(np.array(numbers, np.int32), np.int32(-1))[planar.triangle_id]
    agree = (exact.reflectivity > 0).any(axis=2) & start & inside & ~edge
    colors = closed_colors(closed, truth, lights)
    return Both(planar, truth, agree, edge, scene.radius(), colors, drawn.radiance, surface)


def closed_colors(scene: AnalyticScene, truth: AnalyticReflections, lights: Lights) -> np.ndarray:
    """(H, W, 3): albedo · (ambient + Σ color · max(0, n·l)) + emissive of the side that is met."""
    out = np.zeros((*truth.shape_id.shape, 3))
    first = np.cumsum([0, *(s.surfaces for s in scene.shapes)])
    for i, shape in enumerate(scene.shapes):
        for face in range(shape.surfaces):
            if isinstance(shape, Box):
                n = shape.world_from_box[:3, face // 2] * (1.0 if face % 2 else -1.0)
            else:
                assert isinstance(shape, Plane)
                n = np.array(shape.normal)
            material = scene.materials[shape.material]
            for front in (True, False):
                light = np.array(lights.ambient)
                for one in lights.directional:
                    d = np.array(one.direction_ws) / np.linalg.norm(one.direction_ws)
                    light = light + np.array(one.color) * max(0.0, -(d @ n) * (1 if front else -1))
                chosen = (truth.surface_id == first[i] + face) & (truth.front == front)
                out[chosen] = np.array(material.base_color) * light + material.emissive
    return out


def check(b: Both) -> None:
    """Same surface, point within 1e-9 of the radius, colour within 2⁻²² relative."""
    a = b.agree
    assert b.edge.mean() < 0.05
    np.testing.assert_array_equal(b.planar.mask[a], True)
    np.testing.assert_array_equal(b.surface[a], b.truth.surface_id[a])
    np.testing.assert_array_equal(b.planar.object_id[a], b.truth.shape_id[a])
    hit = a & (b.truth.shape_id >= 0)
    off = np.abs(b.planar.point_ws - b.truth.point_ws)[hit].max()
    assert off < 1e-9 * b.radius
    assert np.abs(b.planar.distance - b.truth.distance)[hit].max() < 1e-9 * b.radius
    np.testing.assert_allclose(b.planar.reflection[hit], b.colors[hit], rtol=2.0**-22)
    sky = a & (b.truth.shape_id < 0)
    assert (b.planar.reflection[sky] == 0.0).all()
    assert np.isnan(b.planar.distance[sky]).all()


FLOOR = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""z to y: a sheet's front looks up."""


@pytest.mark.parametrize("kind", CAMERAS)
def test_a_floor_and_mirror_boxes(kind: str) -> None:
    """One box stands on the floor, one is cut by it, one is under it; two have mirror faces."""
    rng = np.random.default_rng(4)
    boxes = [
        (turned(rng, move=(-0.6, 1.0, 0.2)), 1),
        (transforms.translation(0.8, 0.75, -0.5), 2),
        (turned(rng, move=(0.3, 0.1, 1.1)), 1),
        (transforms.translation(1.6, -1.0, 0.8), 1),
        (turned(rng, move=(-1.2, 0.9, -1.6)), 2),
    ]
    b = both(camera_of(kind), [(FLOOR, 0)], boxes)
    check(b)
    shown = b.truth.shape_id[b.agree]
    assert (shown == 3).sum() > 60  # the box that the mirror cuts
    assert (shown == 4).sum() == 0  # the one behind it
    assert (shown == 0).sum() > 100  # the floor, in the boxes
    assert (shown == 2).sum() > 60
    assert (b.agree & (b.truth.shape_id < 0)).sum() > 100


def test_a_tilted_mirror_and_walls_seen_from_behind() -> None:
    """A double-sided wall shows its back, lit as such; a one-sided one, nearer, is not there."""
    rng = np.random.default_rng(8)
    tilted = look_at((0.3, 0.5, 1.0), (0.0, 0.0, 0.0), (0.1, 1.0, 0.0)).copy()
    tilted[:3, 3] = (-0.2, -0.3, -0.4)  # its front looks back past the eye
    facing_away = transforms.identity()
    facing_away[:3, 3] = (0.0, 0.0, 6.0)  # the eye, at z = 4, is behind its front as well
    nearer = facing_away.copy()
    nearer[2, 3] = 5.0
    boxes = [(turned(rng, move=(1.4, -0.2, 1.0)), 2), (turned(rng, move=(-0.4, 1.2, 0.3)), 1)]
    sheets = [(tilted, 0), (facing_away, 3), (nearer, 4)]
    b = both(camera_of("perspective"), sheets, boxes)
    check(b)
    shown = b.truth.shape_id[b.agree]
    assert (shown == 1).sum() > 100 and not b.truth.front[b.agree & (b.truth.shape_id == 1)].any()
    assert (shown == 2).sum() == 0
    assert (shown == 3).sum() > 50
    assert (shown == 4).sum() > 50
    assert np.unique(b.planar.mirror[b.planar.mask]).size >= 3


def test_a_reflected_flat_face_has_the_bits_it_has_directly() -> None:
    """Normals and lights are not mirrored, so the colour is the same number."""
    b = both(camera_of("perspective"), [(FLOOR, 0)], [(turned(np.random.default_rng(4)), 1)])
    seen = {tuple(c) for c in b.direct[(b.planar.object_id < 0) & ~b.planar.mask]}
    shown = {tuple(c) for c in b.planar.reflection[b.planar.object_id == 1]}
    assert len(seen & shown) >= 1  # a face that is seen both ways

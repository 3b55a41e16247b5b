"""The closed form against the rasterizer, where triangles are exact: boxes and a floor."""

from __future__ import annotations

import numpy as np
import pytest
from tracing import turned

from ssr_ref import Material, Mesh, Node, Scene, transforms
from ssr_ref.analytic import AnalyticScene, Box, Plane, analytic_gbuffer
from ssr_ref.buffers import GBuffer
from ssr_ref.camera import Camera, look_at
from ssr_ref.pipeline import with_radiance
from ssr_ref.raster.geometry import flatten
from ssr_ref.raster.rasterize import RasterOptions, rasterize
from ssr_ref.scenes import shapes

pytestmark = pytest.mark.slow

SIZE = (101, 67)
MATERIALS = (
    Material("mirror", (0.9, 0.9, 0.9), metallic=1.0, roughness=0.0),
    Material("red", (0.8, 0.2, 0.1), emissive=(0.1, 0.0, 0.2)),
    Material("glossy", (0.3, 0.7, 0.4), metallic=0.5, roughness=0.25),
)
HALF = (0.5, 0.75, 0.375)
"""Halves and eighths: float32 vertices hold them exactly."""

CAMERAS = ("perspective", "off-axis", "orthographic")


def camera_of(kind: str) -> Camera:
    pose = look_at((1.5, 1.2, 4.0), (0.2, 0.3, 0.0), (0.05, 1.0, 0.1))
    if kind == "perspective":
        return Camera.perspective(pose, 35.0, SIZE[0] / SIZE[1], near=0.01)
    if kind == "off-axis":
        return Camera.frustum(pose, -0.2, 0.5, -0.4, 0.2, near=0.01)
    return Camera.orthographic(pose, 3.0, SIZE[0] / SIZE[1], near=0.01).jittered(0.2, 0.4, SIZE)


def both(camera: Camera, poses: list[np.ndarray]) -> tuple[GBuffer, GBuffer, AnalyticScene]:
    """The closed form and the rasterizer's buffers, float64, of a floor and two boxes."""
    analytic = AnalyticScene(
        (Plane((0, 0, 0), (0, 1, 0)), *(Box(HALF, m, i + 1) for i, m in enumerate(poses))),
        MATERIALS,
    )
    low = [-h for h in HALF]
    quad = shapes.quad([(-16, 0, 16), (16, 0, 16), (16, 0, -16), (-16, 0, -16)])
    boxes = [shapes.box(low, HALF, material=i + 1) for i in range(len(poses))]
    meshes = Scene(
        (Mesh("floor", (quad,)), *(Mesh("box", (box,)) for box in boxes)),
        (Node("floor", 0), *(Node("box", i + 1, m) for i, m in enumerate(poses))),
        MATERIALS,
    )
    view, geometry = camera.params(SIZE), flatten(meshes)
    drawn, positions = rasterize(view, geometry, RasterOptions(dtype=np.float64))
    drawn = with_radiance(view, geometry, positions, drawn, meshes)
    return analytic_gbuffer(analytic, camera, SIZE), drawn, analytic


def near_an_edge(camera: Camera, scene: AnalyticScene, reach: float) -> np.ndarray:
    """(H, W): another surface, in front or behind, is seen up to `reach` pixels away."""
    here = analytic_gbuffer(scene, camera, SIZE)
    found = np.zeros((SIZE[1], SIZE[0]), bool)
    for dx in (-reach, 0.0, reach):
        for dy in (-reach, 0.0, reach):
            there = analytic_gbuffer(scene, camera.jittered(dx, dy, SIZE), SIZE)
            found |= there.triangle_id != here.triangle_id
            # The back face changes where the exit's slope does: compare it as a plane of nearness.
            assert there.back_depth is not None and here.back_depth is not None
            found |= np.isfinite(there.back_depth) != np.isfinite(here.back_depth)
    return found


@pytest.mark.parametrize("kind", CAMERAS)
def test_boxes_on_a_floor_are_what_exact_triangles_give(kind: str) -> None:
    """Depth within 1e-12, normals 1e-14, colours to rounding; coverage differs only by snapping.

    Vertices are snapped to 1/256 px, so a covered centre may lie 1/256 px outside: such pixels must
    have an edge within 1/128 px.
    """
    rng = np.random.default_rng(4)
    camera = camera_of(kind)
    poses = [turned(rng, move=(-0.6, 1.0, 0.2)), transforms.translation(0.8, 0.75, -0.5)]
    a, r, scene = both(camera, poses)
    assert a.object_id is not None and r.object_id is not None
    assert a.geo_normal_vs is not None and r.geo_normal_vs is not None
    same = a.object_id == r.object_id
    with np.errstate(invalid="ignore"):
        same &= np.abs(a.geo_normal_vs - r.geo_normal_vs).max(axis=2) < 0.1  # the same side of it
    same |= a.depth > 12.0  # beyond the square, where the floor goes on and the mesh does not
    assert near_an_edge(camera, scene, 1 / 128)[~same].all()
    assert (~same).mean() < 0.01
    same &= a.depth < 12.0
    seen = same & (a.object_id >= 0)
    assert (seen & (a.object_id > 0)).sum() > 500 and (a.object_id == 0).sum() > 500
    # Where the centre is outside the true triangle by snapping, depth is clamped to the polygon's.
    off = np.abs(a.depth[seen] / r.depth[seen] - 1.0)
    assert off.max() < 1e-12
    for name in ("geo_normal_vs", "normal_vs"):
        assert np.abs(a.arrays()[name] - r.arrays()[name])[seen].max() < 1e-14, name
    for name in ("material_id", "albedo", "reflectivity", "roughness"):
        assert np.array_equal(a.arrays()[name][seen], r.arrays()[name][seen]), name
    assert a.radiance is not None and r.radiance is not None
    assert np.allclose(a.radiance[seen], r.radiance[seen], rtol=1e-14)


@pytest.mark.parametrize("kind", CAMERAS)
def test_exit_depths_are_the_nearest_back_faces(kind: str) -> None:
    """Within 1e-12 wherever both find one; missing only at the silhouette, by snapping."""
    rng = np.random.default_rng(9)
    camera = camera_of(kind)
    a, r, scene = both(camera, [turned(rng, move=(-0.5, 0.9, 0.1)), turned(rng, move=(0.9, 1, 0))])
    assert a.back_depth is not None and r.back_depth is not None and a.object_id is not None
    same = (a.object_id == r.object_id) & (a.object_id > 0)
    found = same & np.isfinite(a.back_depth) & np.isfinite(r.back_depth)
    assert found.sum() > 800
    edge = near_an_edge(camera, scene, 1 / 128)
    assert edge[same & (np.isfinite(a.back_depth) != np.isfinite(r.back_depth))].all()
    off = np.abs(a.back_depth[found] / r.back_depth[found] - 1.0)
    # Across an inner edge of the back the rasterizer may draw the neighbour's plane a little on:
    # a slope of at most 8 depths a pixel width over 1/128 px.
    assert (off < 1e-12).mean() > 0.98
    assert off.max() < 1e-2
    assert np.isinf(a.back_depth[a.object_id == 0]).all()

"""What hit rules are tried on: lone convex bodies, closed-form scenes, and the same as meshes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ssr_ref import Material, Mesh, Node, Primitive, Scene, Settings, View, transforms
from ssr_ref.analytic import (
    AnalyticReflections,
    AnalyticScene,
    Box,
    Plane,
    Sphere,
    analytic_gbuffer,
    analytic_reflections,
)
from ssr_ref.buffers import GBuffer
from ssr_ref.camera import ViewParams
from ssr_ref.errors import SceneError
from ssr_ref.pipeline import make_camera
from ssr_ref.raster.geometry import flatten
from ssr_ref.raster.rasterize import RasterOptions, rasterize
from ssr_ref.scenes import shapes
from ssr_ref.vecmath.elementary import sincos_host

STANDING = {"box_on_plane": 1, "sphere_on_plane": 1}
"""Object that touches the floor (object 0), by scene."""
BUFFERS = ("exact", "float32", "snapped")
"""Closed form in float64; rounded to float32; rasterized meshes, float32 and 8 sub-pixel bits."""
_MIRROR = (Material("mirror", (0.9, 0.9, 0.9), metallic=1.0, roughness=0.0),)
_SHEET = 64.0
"""Half the side of a plane's mesh, scene units."""
_FINE, _COARSE = 32, 4
"""A ball's mesh has 20·n² faces: fine with smooth normals, coarse with flat ones."""


class Case(NamedTuple):
    """One image: what the camera sees, and what its rays meet in truth."""

    view: ViewParams
    gbuffer: GBuffer
    truth: AnalyticReflections


def lone_bodies() -> dict[str, list[AnalyticScene]]:
    """Convex mirrors alone, by kind, in both projections: every hit is a self-hit.

    Planes are tilted up to 89.99° from the view axis and rolled by 0, 20 and 45°; boxes are turned
    at random (a fixed seed).
    """
    found: dict[str, list[AnalyticScene]] = {"sphere": [], "plane": [], "box": []}
    rng = np.random.default_rng(1)
    front = (0.0, 0.0, -4.0)
    for height in (None, 3.0):
        view = View((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), fov_y_degrees=40.0, near=0.01)
        if height is not None:
            view = View((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), orthographic_height=height, near=0.01)

        def add(kind: str, shape: Any, view: View = view) -> None:
            found[kind].append(AnalyticScene((shape,), _MIRROR, view=view, name=f"lone {kind}"))

        for radius, x in ((1.0, 0.1), (0.4, 0.9), (0.05, -0.3)):
            add("sphere", Sphere((x, 0.07, -4.0), radius))
        for tilt in (0.0, 30.0, 60.0, 80.0, 85.0, 89.0, 89.9, 89.99):
            for roll in (0.0, 20.0, 45.0):
                sin_t, cos_t = sincos_host(tilt * (3.141592653589793 / 180.0))
                sin_r, cos_r = sincos_host(roll * (3.141592653589793 / 180.0))
                add("plane", Plane(front, (sin_t * sin_r, sin_t * cos_r, cos_t)))
        for half in ((0.6, 0.4, 0.5), (0.9, 0.05, 0.3), (0.1, 1.0, 0.1)):
            for _ in range(3):
                q = rng.normal(size=4)
                q /= np.sqrt((q * q).sum())
                turn = transforms.from_quaternion(*(float(c) for c in q))
                add("box", Box(half, transforms.multiply(transforms.translation(*front), turn)))
    return found


def make_case(
    scene: AnalyticScene, size: tuple[int, int], buffers: str, coarse: bool = False
) -> Case:
    """The image of a closed-form scene by one of `BUFFERS`, with the closed form's reflections.

    coarse: a snapped ball has facets that show; else it stands for the closed form's ball.
    Raises SceneError for a shape that has no mesh here.
    """
    settings = Settings(size=size).resolved(1.0)
    camera = make_camera(scene, None, settings, 1.0)
    view = camera.params(size)
    dtype = np.float32 if buffers == "float32" else np.float64
    gbuffer = analytic_gbuffer(scene, camera, size, dtype=dtype)
    truth = analytic_reflections(scene, camera, size, gbuffer)
    if buffers == "snapped":
        gbuffer = rasterize(view, flatten(as_meshes(scene, coarse)), RasterOptions())[0]
    return Case(view, gbuffer, truth)


def grazing(case: Case, seed: int) -> Case:
    """The same image with shading normals that send each ray off along its surface, in a random
    direction and 2⁻⁴ to 2⁻¹⁶ above the tangent plane: the hardest rays to keep off it.
    """
    rng = np.random.default_rng(seed)
    g, v = case.gbuffer, case.view
    assert g.geo_normal_vs is not None
    n = g.geo_normal_vs.astype(np.float64)
    y, x = np.mgrid[: v.height, : v.width] + 0.5
    d = np.stack([(x - v.cx) / v.fx, (v.cy - y) / v.fy, np.full_like(x, -1.0)], axis=2)
    if not v.perspective:
        d[..., :2] = 0.0
    r = rng.normal(size=n.shape)
    r = _unit(r - (r * n).sum(axis=2, keepdims=True) * n)
    r = _unit(r + n * 2.0 ** rng.uniform(-16.0, -4.0, (*x.shape, 1)))
    normal = np.where(n.any(axis=2, keepdims=True), _unit(r - _unit(d)), 0.0)
    return case._replace(gbuffer=replace(g, normal_vs=normal.astype(g.depth.dtype)))


def _unit(v: Any) -> Any:
    return v / np.sqrt(np.maximum((v * v).sum(axis=-1, keepdims=True), 1e-300))


def as_meshes(scene: AnalyticScene, coarse: bool) -> Scene:
    """The same objects, in the same order, as triangles; planes end at 64."""
    meshes, nodes = [], []
    for i, shape in enumerate(scene.shapes):
        pose = transforms.identity()
        if isinstance(shape, Plane):
            mesh = _sheet(shape)
        elif isinstance(shape, Sphere):
            mesh = shapes.sphere(
                shape.radius, _COARSE if coarse else _FINE, material=shape.material
            )
            mesh = replace(mesh, normals=None) if coarse else mesh
            pose = transforms.translation(*shape.center)
        elif isinstance(shape, Box):
            low = tuple(-h for h in shape.half_size)
            mesh = shapes.box(low, shape.half_size, material=shape.material)
            pose = shape.world_from_box
        else:
            raise SceneError(f"a {type(shape).__name__} has no mesh; expected Plane, Sphere or Box")
        meshes.append(Mesh(f"m{i}", (mesh,)))
        nodes.append(Node(f"n{i}", i, pose))
    return Scene(tuple(meshes), tuple(nodes), scene.materials, view=scene.view)


def _sheet(plane: Plane) -> Primitive:
    """A square of a plane, counter-clockwise seen from its front."""
    n = _unit(np.array(plane.normal))
    u = np.eye(3)[np.abs(n).argmin()]
    u = _SHEET * _unit(u - (u * n).sum() * n)
    v = np.array([n[1] * u[2] - n[2] * u[1], n[2] * u[0] - n[0] * u[2], n[0] * u[1] - n[1] * u[0]])
    p = np.array(plane.point)
    return shapes.quad([p - u - v, p + u - v, p + u + v, p - u + v], material=plane.material)

"""Cameras, made-up G-buffers and small scenes that the tracers' tests share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ssr_ref import transforms
from ssr_ref.buffers import GBuffer, HitBuffer
from ssr_ref.camera import Camera, ViewParams, look_at
from ssr_ref.raster.geometry import flatten
from ssr_ref.raster.rasterize import RasterOptions, rasterize
from ssr_ref.scene import Material, Mesh, Node, Primitive, Scene
from ssr_ref.scenes import shapes
from ssr_ref.settings import Settings

PROJECTIONS = ("perspective", "off-axis", "orthographic")
MIRROR = Material("mirror", (0.9, 0.9, 0.9), metallic=1.0, roughness=0.0)
MATT = Material("matt", (0.8, 0.3, 0.1), metallic=0.0)


def view_of(
    projection: str,
    size: tuple[int, int] = (37, 23),
    eye: Sequence[float] = (1.0, 2.0, 5.0),
    target: Sequence[float] = (0.0, 0.3, 0.0),
    near: float = 0.1,
) -> ViewParams:
    """A camera of one of `PROJECTIONS`; the orthographic image is 4 units high."""
    pose = look_at(eye, target)
    aspect = size[0] / size[1]
    if projection == "perspective":
        camera = Camera.perspective(pose, 50.0, aspect, near=near)
    elif projection == "off-axis":
        camera = Camera.frustum(pose, -0.3, 0.9, -0.6, 0.25, near=near)
    else:
        camera = Camera.orthographic(pose, 4.0, aspect, near=near)
    return camera.params(size)


def front_view(
    perspective: bool = True, size: tuple[int, int] = (41, 31), near: float = 0.1
) -> ViewParams:
    """The identity pose; perspective 90° high, or orthographic, so that one unit is simple."""
    aspect = size[0] / size[1]
    if perspective:
        camera = Camera.frustum(np.eye(4), -aspect, aspect, -1.0, 1.0, near=near)
    else:
        camera = Camera.orthographic(np.eye(4), 2.0, aspect, near=near)
    return camera.params(size)


def resolved(size: tuple[int, int], **kw: Any) -> Settings:
    """Settings without a length left open: thickness 0.2, no limit on distance."""
    return Settings(size=size, **({"thickness": 0.2, "max_distance": np.inf} | kw))


def pixel_rays(view: ViewParams) -> np.ndarray:
    """(H, W, 3) directions through the pixel centres, z = −1."""
    x, y = np.meshgrid(np.arange(view.width) + 0.5, np.arange(view.height) + 0.5)
    if not view.perspective:
        return np.stack([0 * x, 0 * x, 0 * x - 1], axis=2)
    ndc_x, ndc_y = 2 * x / view.width - 1, 1 - 2 * y / view.height
    return np.stack(
        [(ndc_x + view.offset_x) / view.p00, (ndc_y + view.offset_y) / view.p11, 0 * x - 1], axis=2
    )


def point_of(view: ViewParams, x: float, y: float, depth: float) -> np.ndarray:
    """View-space point of a depth at a pixel position."""
    ndc = np.array([2 * x / view.width - 1, 1 - 2 * y / view.height])
    offset, scale = np.array([view.offset_x, view.offset_y]), np.array([view.p00, view.p11])
    xy = (ndc + offset) / scale * depth if view.perspective else (ndc - offset) / scale
    return np.array([*xy, -depth])


def window_of(view: ViewParams, points_vs: np.ndarray) -> np.ndarray:
    """(..., 2) pixel positions of view-space points."""
    p = np.asarray(points_vs)
    offset, scale = np.array([view.offset_x, view.offset_y]), np.array([view.p00, view.p11])
    if view.perspective:
        ndc = (scale * p[..., :2] + offset * p[..., 2:]) / -p[..., 2:]
    else:
        ndc = scale * p[..., :2] + offset
    half = np.array([view.width / 2, view.height / 2])
    return half + ndc * half * [1, -1]


def to_view(view: ViewParams, points_ws: np.ndarray) -> np.ndarray:
    """World positions in view space."""
    rows = [
        (view.right_x, view.right_y, view.right_z),
        (view.up_x, view.up_y, view.up_z),
        (view.back_x, view.back_y, view.back_z),
    ]
    eye = np.array([view.eye_x, view.eye_y, view.eye_z])
    return np.einsum("ij,...j->...i", np.array(rows), np.asarray(points_ws, float) - eye)


def buffers(
    depth: np.ndarray,
    geo_normal: np.ndarray,
    *,
    normal: np.ndarray | None = None,
    back: np.ndarray | None = None,
    reflectivity: np.ndarray | None = None,
    dtype: Any = np.float32,
) -> GBuffer:
    """A G-buffer from arrays; no back faces and R = 1 unless given."""
    shape = depth.shape
    return GBuffer(
        depth=depth.astype(dtype),
        triangle_id=np.zeros(shape, np.int32),
        back_depth=(np.full(shape, np.inf) if back is None else back).astype(dtype),
        geo_normal_vs=geo_normal.astype(dtype),
        normal_vs=(geo_normal if normal is None else normal).astype(dtype),
        reflectivity=(np.ones((*shape, 3)) if reflectivity is None else reflectivity).astype(dtype),
        radiance=np.zeros((*shape, 3), dtype),
    )


def one_ray(
    view: ViewParams,
    x: int,
    y: int,
    depth: float,
    direction: Sequence[float],
    *,
    rest: float = np.inf,
) -> GBuffer:
    """Only pixel (x, y) reflects, into the view-space `direction`; all others have depth `rest`.

    Normals of the others face the eye along their rays.
    """
    rays = pixel_rays(view)
    unit = rays / np.linalg.norm(rays, axis=2, keepdims=True)
    normals = -unit.copy()
    half = np.asarray(direction, float) / np.linalg.norm(direction) - unit[y, x]
    normals[y, x] = half / np.linalg.norm(half)
    depths = np.full((view.height, view.width), rest)
    depths[y, x] = depth
    reflectivity = np.zeros((*depths.shape, 3))
    reflectivity[y, x] = 1.0
    return buffers(depths, normals, reflectivity=reflectivity)


def noise_buffers(view: ViewParams, seed: int, dtype: Any = np.float32) -> GBuffer:
    """Random depths about a slope, holes, random normals (some facing away), random backs."""
    rng = np.random.default_rng(seed)
    shape = (view.height, view.width)
    slope = np.linspace(2.0, 0.0, view.height)[:, None]
    depth = 3.0 + rng.random(shape) * rng.choice([0.05, 1.0, 4.0]) + slope
    depth[rng.random(shape) < 0.15] = np.inf
    normal = rng.normal(size=(*shape, 3))
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    away = (normal * pixel_rays(view)).sum(axis=2) >= 0.0
    normal[away & (rng.random(shape) < 0.97)] *= -1.0
    back = np.where(rng.random(shape) < 0.7, depth + 0.5 * rng.random(shape), np.inf)
    return buffers(
        depth,
        normal,
        normal=normal + 0.2 * rng.normal(size=normal.shape),
        back=back,
        reflectivity=np.where(rng.random(shape) < 0.05, 0.0, 1.0)[..., None] * np.ones(3),
        dtype=dtype,
    )


def draw(view: ViewParams, scene: Scene) -> GBuffer:
    """The G-buffer of the real rasterizer, without radiance."""
    return rasterize(view, flatten(scene), RasterOptions())[0]


def flat(primitive: Primitive, material: int = 0) -> Primitive:
    """The same triangles with flat normals."""
    return replace(primitive, normals=None, material=material)


def lone(primitive: Primitive, pose: np.ndarray, material: Material = MIRROR) -> Scene:
    """One object and nothing else."""
    return Scene((Mesh("m", (primitive,)),), (Node("n", 0, pose),), (material,))


def on_floor(primitive: Primitive, pose: np.ndarray, half: float = 8.0) -> Scene:
    """A matt object (node 1) and a mirror floor (node 0) at y = 0."""
    floor = shapes.grid(half, half, 1, 1, material=0)
    return Scene(
        (Mesh("floor", (floor,)), Mesh("object", (flat(primitive, 1),))),
        (Node("floor", 0), Node("object", 1, pose)),
        (MIRROR, MATT),
    )


def turned(rng: np.random.Generator, *, move: Sequence[float] = (0, 0, 0)) -> np.ndarray:
    """A random rotation followed by a move."""
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    return transforms.multiply(
        transforms.translation(*(float(v) for v in move)),
        transforms.from_quaternion(*(float(v) for v in q)),
    )


def same_hits(a: HitBuffer, b: HitBuffer, names: Sequence[str] = ()) -> None:
    """Every byte of two hit buffers, or of the named ones, agrees."""
    second = b.arrays()
    for name, array in a.arrays().items():
        if not names or name in names:
            assert array.tobytes() == second[name].tobytes(), name

"""Truth of closed-form scenes as a `Truth`, and frames made up pixel by pixel."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

import ssr_ref
from ssr_ref import Settings, transforms
from ssr_ref.analytic import AnalyticScene, Box, Sphere, analytic_reflections
from ssr_ref.analytic.arrays import material_arrays
from ssr_ref.analytic.gbuffer import light_shapes
from ssr_ref.buffers import GBuffer, HitBuffer, Resolved, Side, Status, Truth, TruthClass
from ssr_ref.camera import Camera
from ssr_ref.pipeline import Frame
from ssr_ref.shading.diffuse import light_arrays
from ssr_ref.ssr.resolve import resolve

SIZE = (37, 23)


def render(scene: AnalyticScene, size: tuple[int, int] = SIZE, **kw: Any) -> Frame:
    """A frame of endless rays; the thickness is that of the settings, or the scene's default."""
    return ssr_ref.render(scene, settings=Settings(size=size, **({"max_distance": np.inf} | kw)))


def closed_form_truth(frame: Frame) -> Truth:
    """The closed-form reflections of a frame, with the radiance of what they meet."""
    scene = frame.scene
    assert isinstance(scene, AnalyticScene)
    found = analytic_reflections(
        scene, frame.camera, frame.settings.size, frame.gbuffer, frame.settings.max_distance
    )
    met = found.shape_id >= 0
    normals = np.full((*met.shape, 3), np.nan)
    for i, shape in enumerate(scene.shapes):
        here = found.shape_id == i
        normals[here] = _outward(shape, found.point_ws[here], found.surface_id[here])
    normals *= np.where(found.front, 1.0, -1.0)[..., None]
    materials = material_arrays(scene.materials)
    of_shape = np.array([shape.material for shape in scene.shapes], np.int32)
    radiance = np.full((*met.shape, 3), np.nan)
    lit = np.empty((int(met.sum()), 3))
    light_shapes(
        materials.base_color,
        materials.emissive,
        materials.unlit,
        light_arrays(scene.lights),
        of_shape[found.shape_id[met]],
        np.ascontiguousarray(normals[met]),
        lit,
    )
    radiance[met] = lit
    return Truth(
        truth=found.truth,
        side=_sides(found, frame),
        triangle_id=found.surface_id,
        object_id=found.shape_id,
        distance=found.distance,
        hit_px=found.hit_px,
        hit_depth=found.hit_depth,
        radiance=radiance,
    )


def _outward(shape: Any, points: np.ndarray, surfaces: np.ndarray) -> np.ndarray:
    """(n, 3) unit outward normals at surface points, in world space."""
    if isinstance(shape, Sphere):
        return (points - np.array(shape.center)) / shape.radius
    if isinstance(shape, Box):
        m = shape.world_from_box
        own = (points - m[:3, 3]) @ m[:3, :3] / np.array(shape.half_size)
        axis = np.abs(own).argmax(axis=1)
        return m[:3, axis].T * np.sign(np.take_along_axis(own, axis[:, None], 1))
    return np.broadcast_to(np.array(transforms.normalized3(shape.normal)), points.shape)


def _sides(found: Any, frame: Frame) -> np.ndarray:
    view = frame.camera.params(frame.settings.size)
    x, y = found.hit_px[..., 0], found.hit_px[..., 1]
    side = np.select(
        [
            ~(found.hit_depth >= view.near),
            found.hit_depth > view.far,
            x < 0,
            x >= view.width,
            y < 0,
            y >= view.height,
        ],
        [Side.BEHIND, Side.BEYOND, Side.LEFT, Side.RIGHT, Side.TOP, Side.BOTTOM],
        Side.NONE,
    )
    return np.where(found.truth == TruthClass.OFF_SCREEN, side, 0).astype(np.uint8)


def with_hits(frame: Frame, hits: HitBuffer) -> Frame:
    """The frame as if its trace had found these hits."""
    view = frame.camera.params(frame.settings.size)
    resolved = resolve(view, frame.gbuffer, hits, frame.settings)
    return replace(frame, hits=hits, resolved=resolved)


def hits_of(status: Any, hit_px: Any = None, hit_depth: Any = None) -> HitBuffer:
    """A hit buffer of made-up statuses (H, W), positions and depths."""
    status = np.array(status, np.uint8)
    nothing, zero = np.full(status.shape, np.nan), np.zeros(status.shape, np.uint32)
    return HitBuffer(
        status=status,
        end=np.zeros(status.shape, np.uint8),
        flags=np.zeros(status.shape, np.uint8),
        hit_px=np.full((*status.shape, 2), np.nan) if hit_px is None else np.array(hit_px, float),
        hit_depth=nothing if hit_depth is None else np.array(hit_depth, float),
        residual=nothing,
        length=nothing,
        steps=zero,
        fetches=zero,
    )


def truth_of(
    classes: Any,
    hit_px: Any = None,
    objects: Any = None,
    radiance: Any = None,
    hit_depth: Any = None,
    side: Any = None,
) -> Truth:
    """A made-up truth; what is left out is NaN, −1 or 0."""
    classes = np.array(classes, np.uint8)
    shape = classes.shape
    ids = np.full(shape, -1, np.int32) if objects is None else np.array(objects, np.int32)

    def image(values: Any, *more: int) -> np.ndarray:
        return np.full((*shape, *more), np.nan) if values is None else np.array(values, float)

    return Truth(
        truth=classes,
        side=np.zeros(shape, np.uint8) if side is None else np.array(side, np.uint8),
        triangle_id=ids,
        object_id=ids,
        distance=image(None),
        hit_px=image(hit_px, 2),
        hit_depth=image(hit_depth),
        radiance=image(radiance, 3),
    )


def made_up(gbuffer: GBuffer, hits: HitBuffer, reflection: Any, settings: Settings) -> Frame:
    """A frame of made-up buffers; `reflection` (H, W, 3) is what the method shows."""
    shown = np.array(reflection, float)
    flat = np.zeros(shown.shape[:2])
    return Frame(
        scene=AnalyticScene((Sphere((0.0, 0.0, 0.0), 1.0),)),
        camera=Camera.frustum(np.eye(4), -1.0, 1.0, -1.0, 1.0, near=0.1),
        settings=settings,
        gbuffer=gbuffer,
        hits=hits,
        resolved=Resolved(flat, flat, flat, shown, shown),
    )


def parts_add_up(blamed: Any) -> None:
    """A − T is the sum of the parts, to 8·2⁻⁵³ of their sum of absolute values."""
    parts = (blamed.information, blamed.depth_model, blamed.traversal, blamed.shading)
    size = sum(np.abs(part) for part in parts)
    total = ((parts[0] + parts[1]) + parts[2]) + parts[3]
    assert (np.abs(total - blamed.error) <= 8 * 2.0**-53 * size).all()


def same_bytes(a: np.ndarray, b: np.ndarray) -> bool:
    """Two images agree in every bit."""
    return a.tobytes() == b.tobytes()


def missed(status: np.ndarray) -> np.ndarray:
    """Where a ray was walked and met nothing."""
    return (status >= Status.PASSED_BEHIND) & (status <= Status.OUT_OF_STEPS)

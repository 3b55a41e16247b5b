"""`Truth` of closed-form scenes: `analytic.analytic_reflections` with sides and radiance."""

from __future__ import annotations

import numpy as np

from .._jit import driver
from ..analytic.arrays import ShapeArrays, material_arrays, shape_arrays
from ..analytic.gbuffer import light_shapes
from ..analytic.ray import Hit, side_normal
from ..analytic.reflections import AnalyticReflections, analytic_reflections
from ..analytic.scene import AnalyticScene
from ..buffers import GBuffer, Truth, TruthClass
from ..camera import Camera, ViewParams
from ..raster.surface import load
from ..shading.diffuse import light_arrays
from ..typed import BoolArray, F64Array, I32Array, Size, U8Array
from .outcome import side_of


def analytic_truth(
    scene: AnalyticScene,
    camera: Camera,
    size: Size,
    gbuffer: GBuffer | None = None,
    max_distance: float = np.inf,
) -> Truth:
    """The truth of an image of (W, H) pixels, surfaces numbered as in `analytic_gbuffer`.

    gbuffer, max_distance, errors: as in `analytic.analytic_reflections`.
    """
    view = camera.params(size)
    found = analytic_reflections(scene, camera, size, gbuffer, max_distance)
    side = np.zeros(found.truth.shape, np.uint8)
    off = np.flatnonzero(found.truth.ravel() == TruthClass.OFF_SCREEN)
    place_points(view, off, found.hit_px.reshape(-1, 2), found.hit_depth.ravel(), side.ravel())
    return Truth(
        truth=found.truth,
        side=side,
        triangle_id=found.surface_id,
        object_id=found.shape_id,
        distance=found.distance,
        hit_px=found.hit_px,
        hit_depth=found.hit_depth,
        radiance=radiance_of(scene, found),
    )


def radiance_of(scene: AnalyticScene, found: AnalyticReflections) -> F64Array:
    """(H, W, 3) radiance of each hit on the side that was met; NaN where there is none."""
    shapes = shape_arrays(scene.shapes, scene.materials)
    materials = material_arrays(scene.materials)
    met = np.flatnonzero(found.shape_id.ravel() >= 0)
    shape = found.shape_id.ravel()[met]
    normals, light = np.empty((len(met), 3)), np.empty((len(met), 3))
    normals_met(
        shapes,
        shape,
        found.surface_id.ravel()[met] - shapes.surface[shape],
        found.front.ravel()[met],
        found.point_ws.reshape(-1, 3)[met],
        normals,
    )
    light_shapes(
        materials.base_color,
        materials.emissive,
        materials.unlit,
        light_arrays(scene.lights),
        shapes.material[shape],
        normals,
        light,
    )
    out = np.full((found.shape_id.size, 3), np.nan)
    out[met] = light
    return out.reshape(*found.shape_id.shape, 3)


@driver(parallel=False)
def place_points(
    view: ViewParams, chosen: F64Array, px: F64Array, depth: F64Array, side: U8Array
) -> None:
    """`Side` of the chosen points."""
    for k in range(chosen.shape[0]):
        i = chosen[k]
        side[i] = side_of(view, px[i, 0], px[i, 1], depth[i])


@driver(parallel=False)
def normals_met(
    shapes: ShapeArrays,
    shape: I32Array,
    face: I32Array,
    front: BoolArray,
    point_ws: F64Array,
    out: F64Array,
) -> None:
    """Unit world normal of each hit on the side that was met."""
    for k in range(shape.shape[0]):
        hit = Hit(shape[k], face[k], 0.0, front[k], np.inf, load(point_ws, k))
        n = side_normal(shapes, hit)
        out[k, 0] = n.x
        out[k, 1] = n.y
        out[k, 2] = n.z

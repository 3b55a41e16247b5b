"""The G-buffer of closed-form shapes: the ray of every pixel centre against every shape.

What is drawn follows the rasterizer: back faces only of double-sided materials; near ≤ depth ≤ far,
a nearer surface is cut away and opens the view to what is behind it; back_depth is the nearest back
face of the same object behind the front, and only single-sided shapes have back faces. Coverage is
that of the pixel's centre alone, without snapping.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from .._jit import driver
from ..buffers import GBuffer, RasterCounts
from ..camera import Camera
from ..errors import SettingsError
from ..raster.surface import load
from ..shading.diffuse import LightArrays, diffuse, light_arrays
from ..typed import BoolArray, F64Array, FloatArray, I32Array, Size
from ..vecmath.vec import Vec3, normalize
from .arrays import material_arrays, normal_reflectivity, shape_arrays, world_axes
from .cast import cast, eye_rays, pixel_centers
from .ray import BACK_OF_ANY, BACK_OF_SAME, NO_BACK
from .scene import AnalyticScene

OUTPUTS = (
    "object_id", "material_id", "back_depth", "geo_normal_vs", "normal_vs", "albedo",
    "reflectivity", "roughness", "radiance",
)  # fmt: skip
"""What may be left out; depth and triangle_id are always there."""


@driver(parallel=False)
def normals_to_view(axes: F64Array, shape: I32Array, normal_ws: F64Array, out: F64Array) -> None:
    """Unit view-space normals, 0 where no shape is; axes: of `arrays.world_axes`."""
    for k in range(shape.shape[0]):
        v = Vec3(0.0, 0.0, 0.0)
        if shape[k] >= 0:
            n = load(normal_ws, k)
            v = normalize(
                Vec3(
                    axes[0, 0] * n.x + axes[1, 0] * n.y + axes[2, 0] * n.z,
                    axes[0, 1] * n.x + axes[1, 1] * n.y + axes[2, 1] * n.z,
                    axes[0, 2] * n.x + axes[1, 2] * n.y + axes[2, 2] * n.z,
                )
            )
        out[k, 0] = v.x
        out[k, 1] = v.y
        out[k, 2] = v.z


@driver(parallel=False)
def light_shapes(
    albedo: F64Array,
    emissive: F64Array,
    unlit: BoolArray,
    lights: LightArrays,
    material: I32Array,
    normal_ws: F64Array,
    out: F64Array,
) -> None:
    """Diffuse radiance by `shading.diffuse`; materials by row, −1 gives 0."""
    for k in range(material.shape[0]):
        m = material[k]
        color = Vec3(0.0, 0.0, 0.0)
        if m >= 0:
            color = load(albedo, m)
            if not unlit[m]:
                color = diffuse(color, load(normal_ws, k), load(emissive, m), lights)
        out[k, 0] = color.x
        out[k, 1] = color.y
        out[k, 2] = color.z


def analytic_gbuffer(
    scene: AnalyticScene,
    camera: Camera,
    size: Size,
    *,
    dtype: Any = np.float64,
    outputs: Collection[str] = OUTPUTS,
    back_any_object: bool = False,
    fresnel: bool = False,
    max_roughness: float = 0.5,
) -> GBuffer:
    """The exact G-buffer of an image of (W, H) pixels, computed in float64, rounded once.

    triangle_id holds the surface's number (`shapes`), object_id the shape's. Both normals are the
    closed form's. counts: `triangles` surfaces in the scene, of which `drawn` can be seen.
    outputs: some of `OUTPUTS`; back_any_object, fresnel, max_roughness as in `Settings`.
    Raises SettingsError for another output, or a size out of range.
    """
    unknown = sorted(set(outputs) - set(OUTPUTS))
    if unknown:
        raise SettingsError(
            f"there is no output '{unknown[0]}'; expected some of {', '.join(OUTPUTS)}"
        )
    view = camera.params(size)
    shapes = shape_arrays(scene.shapes, scene.materials)
    materials = material_arrays(scene.materials)

    # What the pixel's ray meets; beyond far is nothing.
    back_of = BACK_OF_ANY if back_any_object else BACK_OF_SAME
    hits = cast(
        shapes,
        eye_rays(camera, view, pixel_centers(view)),
        view.near,
        back_of if "back_depth" in outputs else NO_BACK,
    )
    seen = (hits.shape_id >= 0) & (hits.t <= view.far)
    object_id = np.where(seen, hits.shape_id, np.int32(-1))
    material_id = np.where(seen, shapes.material[object_id], np.int32(-1))
    surface = np.where(seen, shapes.surface[object_id] + hits.face, np.int32(-1))

    def image(values: F64Array) -> FloatArray:
        return values.reshape(view.height, view.width, *values.shape[1:]).astype(dtype)

    def ids(values: I32Array) -> I32Array:
        return values.reshape(view.height, view.width)

    def by_material(values: F64Array) -> FloatArray:
        return image(np.concatenate([values, np.zeros_like(values[:1])])[material_id])

    images: dict[str, Any] = {}
    if "object_id" in outputs:
        images["object_id"] = ids(object_id)
    if "material_id" in outputs:
        images["material_id"] = ids(material_id)
    if "back_depth" in outputs:
        images["back_depth"] = image(np.where(seen, hits.back, np.inf))
    normals = {"geo_normal_vs", "normal_vs"} & set(outputs)
    if normals:
        normal_vs = np.empty_like(hits.normal_ws)
        normals_to_view(world_axes(camera), object_id, hits.normal_ws, normal_vs)
        images |= {name: image(normal_vs) for name in normals}

    # What its material shows; the last row of a table is that of empty pixels.
    if "albedo" in outputs:
        images["albedo"] = by_material(materials.base_color)
    if "reflectivity" in outputs:
        images["reflectivity"] = by_material(
            normal_reflectivity(materials, fresnel=fresnel, max_roughness=max_roughness)
        )
    if "roughness" in outputs:
        images["roughness"] = by_material(materials.roughness)
    if "radiance" in outputs:
        radiance = np.empty_like(hits.normal_ws)
        light_shapes(
            materials.base_color,
            materials.emissive,
            materials.unlit,
            light_arrays(scene.lights),
            material_id,
            hits.normal_ws,
            radiance,
        )
        images["radiance"] = image(radiance)
    drawn = len(np.unique(surface[seen]))
    return GBuffer(
        depth=image(np.where(seen, hits.t, np.inf)),
        triangle_id=ids(surface),
        counts=RasterCounts(triangles=scene.triangle_count, drawn=drawn),
        **images,
    )

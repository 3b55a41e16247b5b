"""Diffuse radiance: ambient, directional lights, emission. It does not depend on the eye.

    L = albedo · (ambient + Σ color · max(0, n·l)) + emissive;  unlit materials: L = albedo

Lit in world space from float64 normals: a flat face has the same bits from every camera, and a
correct reflection shows exactly the colour that the camera sees directly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from .. import transforms
from .._jit import driver, inlined, kernel
from ..camera import ViewParams
from ..raster.attributes import (
    SurfaceRun,
    base_color,
    begin_run,
    shading_normal_ws,
    store3,
    weights_at,
)
from ..raster.geometry import UNLIT, Geometry
from ..raster.surface import Barycentric, load, plane_normal, run_end
from ..raster.textures import EMISSIVE, Textures, sample_material
from ..scene import Lights
from ..typed import F64Array, FloatArray, I32Array
from ..vecmath.vec import Vec3, dot, normalize


class LightArrays(NamedTuple):
    """Lights as kernels read them."""

    ambient: F64Array  # (3,)
    to_light_ws: F64Array  # (n, 3) unit, from the surface to the light
    color: F64Array  # (n, 3)


def light_arrays(lights: Lights) -> LightArrays:
    """Unit directions towards each light, and colours."""
    towards = [transforms.normalized3(light.direction_ws) for light in lights.directional]
    return LightArrays(
        np.array(lights.ambient, np.float64),
        -np.array(towards, np.float64).reshape(-1, 3),
        np.array([light.color for light in lights.directional], np.float64).reshape(-1, 3),
    )


@kernel
def diffuse(albedo: Vec3, normal_ws: Vec3, emissive: Vec3, lights: LightArrays) -> Vec3:
    """Radiance that leaves a diffuse surface with unit normal, equal in every direction."""
    r, g, b = lights.ambient[0], lights.ambient[1], lights.ambient[2]
    for i in range(lights.to_light_ws.shape[0]):
        cosine = dot(normal_ws, load(lights.to_light_ws, i))
        if cosine > 0.0:
            r += lights.color[i, 0] * cosine
            g += lights.color[i, 1] * cosine
            b += lights.color[i, 2] * cosine
    return Vec3(albedo.x * r + emissive.x, albedo.y * g + emissive.y, albedo.z * b + emissive.z)


@kernel
def flat_normal_ws(geometry: Geometry, t: int, away: bool) -> Vec3:
    """Unit geometric normal in world space, reversed if `away`."""
    n = plane_normal(
        load(geometry.positions_ws, geometry.faces[t, 0]),
        load(geometry.positions_ws, geometry.faces[t, 1]),
        load(geometry.positions_ws, geometry.faces[t, 2]),
    )
    largest = max(abs(n.x), abs(n.y), abs(n.z))
    if not (np.isfinite(largest) and largest > 0.0):
        return Vec3(0.0, 0.0, 0.0)
    if away:
        largest = -largest
    return normalize(Vec3(n.x / largest, n.y / largest, n.z / largest))


@inlined
def emission(geometry: Geometry, textures: Textures | None, t: int, b: Barycentric) -> Vec3:
    """Emissive factor times its texture."""
    m = geometry.triangle_material[t]
    color = load(geometry.emissive, m)
    if textures is not None:
        texel = sample_material(textures, geometry.faces, t, m, EMISSIVE, b)
        color = Vec3(color.x * texel.r, color.y * texel.g, color.z * texel.b)
    return color


@inlined
def leaving_radiance(
    geometry: Geometry,
    textures: Textures | None,
    lights: LightArrays,
    run: SurfaceRun,
    t: int,
    b: Barycentric,
    flat: Vec3,
) -> Vec3:
    """Radiance of triangle t at b; `flat` is its geometric normal on the side seen."""
    albedo = base_color(geometry, textures, t, b)
    if (geometry.triangle_flags[t] & UNLIT) != 0:
        return albedo
    usable, n = False, flat
    if run.smooth:
        usable, n = shading_normal_ws(geometry, run, t, b)
    return diffuse(albedo, n if usable else flat, emission(geometry, textures, t, b), lights)


@driver()
def shade_radiance(
    view: ViewParams,
    geometry: Geometry,
    textures: Textures | None,
    positions_vs: F64Array,
    triangle_id: I32Array,
    lights: LightArrays,
    radiance: FloatArray,
) -> None:
    """Radiance of every visible surface; 0 where nothing was drawn.

    textures: of the visible materials; None, and not paid for, where none has any.
    """
    for y in prange(view.height):
        x = 0
        while x < view.width:
            t = np.int64(triangle_id[y, x])
            end = run_end(triangle_id, y, x)
            if t < 0:
                for j in range(np.uint64(x), np.uint64(end)):
                    store3(radiance, y, j, Vec3(0.0, 0.0, 0.0))
                x = end
                continue
            run = begin_run(view, geometry, positions_vs, t)
            flat = flat_normal_ws(geometry, t, run.back_side)
            if run.varies:
                for j in range(np.uint64(x), np.uint64(end)):
                    b = weights_at(view, run, j, y)
                    color = leaving_radiance(geometry, textures, lights, run, t, b, flat)
                    store3(radiance, y, j, color)
            else:
                b = Barycentric(1.0, 0.0, 0.0)
                color = leaving_radiance(geometry, None, lights, run, t, b, flat)
                for j in range(np.uint64(x), np.uint64(end)):
                    store3(radiance, y, j, color)
            x = end

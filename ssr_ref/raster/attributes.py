"""Surface attributes, once per visible pixel: normals and material values.

Attributes that are bitwise equal at the three vertices are used as they are. Everything is computed
in float64 and rounded once, on the store.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from .._jit import driver, inlined, kernel
from ..camera import ViewParams, rotate_to_view
from ..typed import F32Array, F64Array, FloatArray, I32Array, I64Array
from ..vecmath.vec import Vec3, dot, normalize, scale
from .geometry import DOUBLE_SIDED, HAS_COLORS, HAS_NORMALS, TEXTURED, Geometry
from .surface import (
    Barycentric,
    BarycentricFrame,
    NearnessPlane,
    barycentric_at,
    barycentric_frame,
    load,
    nearness_plane,
    plane_normal,
    run_end,
    surface_point,
)
from .textures import BASE, METALLIC_ROUGHNESS, Textures, sample_material

SMALLEST_SQUARE, LARGEST_SQUARE = 2.0**-900, 2.0**900
"""A squared length in between has lost nothing to overflow or underflow."""

DIELECTRIC_F0 = 0.04
"""Reflectance at normal incidence of a dielectric of index 1.5: ((1.5 − 1)/(1.5 + 1))²."""


class SurfaceRun(NamedTuple):
    """What is constant along a run of pixels of one triangle."""

    plane: NearnessPlane
    frame: BarycentricFrame
    geo_normal_vs: Vec3  # unit, faces the eye
    back_side: bool  # a double-sided face seen from behind
    smooth: bool  # the vertices have normals
    normal_varies: bool  # and they differ
    varies: bool  # the normals, the colours or the texture's values differ


@inlined
def rows_equal(array: F64Array | F32Array, i: int, j: int, k: int) -> bool:
    """Whether three rows of an (n, 3) array hold the same values."""
    for c in range(3):
        if array[i, c] != array[j, c] or array[i, c] != array[k, c]:
            return False
    return True


@inlined
def begin_run(view: ViewParams, geometry: Geometry, positions_vs: F64Array, t: int) -> SurfaceRun:
    """Set up triangle t."""
    i0, i1, i2 = geometry.faces[t, 0], geometry.faces[t, 1], geometry.faces[t, 2]
    v0, v1, v2 = load(positions_vs, i0), load(positions_vs, i1), load(positions_vs, i2)
    normal = plane_normal(v0, v1, v2)
    plane = nearness_plane(view, normal, v0, v1, v2)
    frame = barycentric_frame(normal, v0, v1, v2)
    n = unit_or_facing(view, normal, v0)
    # The side seen is that of the plane: n·v is the same at every point of it.
    side = dot(n, v0) if view.perspective else -n.z
    is_back = (side > 0.0) != view.mirrored
    back_side = is_back and (geometry.triangle_flags[t] & DOUBLE_SIDED) != 0
    if side > 0.0:
        n = Vec3(-n.x, -n.y, -n.z)
    smooth = (geometry.triangle_flags[t] & HAS_NORMALS) != 0
    normal_varies = smooth and not rows_equal(geometry.normals_ws, i0, i1, i2)
    varies = normal_varies
    if (geometry.triangle_flags[t] & HAS_COLORS) != 0:
        varies = varies or not rows_equal(geometry.colors, i0, i1, i2)
    varies = varies or (geometry.triangle_flags[t] & TEXTURED) != 0
    return SurfaceRun(plane, frame, n, back_side, smooth, normal_varies, varies)


@inlined
def unit_or_facing(view: ViewParams, n: Vec3, v0: Vec3) -> Vec3:
    """Unit n; the direction from v0 to the eye if n has none (a triangle without area)."""
    squared = dot(n, n)
    if SMALLEST_SQUARE < squared < LARGEST_SQUARE:
        return scale(n, 1.0 / np.sqrt(squared))
    largest = max(abs(n.x), abs(n.y), abs(n.z))
    if np.isfinite(largest) and largest > 0.0:
        return normalize(Vec3(n.x / largest, n.y / largest, n.z / largest))
    return normalize(Vec3(-v0.x, -v0.y, -v0.z)) if view.perspective else Vec3(0.0, 0.0, 1.0)


@inlined
def weights_at(view: ViewParams, run: SurfaceRun, x: int, y: int) -> Barycentric:
    """Barycentrics of the surface point at the pixel's centre."""
    return barycentric_at(run.frame, surface_point(view, run.plane, x, y))


@inlined
def mix(array: F64Array | F32Array, i0: int, i1: int, i2: int, b: Barycentric) -> Vec3:
    """Weighted sum of three rows; equal rows are returned unchanged."""
    if rows_equal(array, i0, i1, i2):
        return Vec3(np.float64(array[i0, 0]), np.float64(array[i0, 1]), np.float64(array[i0, 2]))
    return Vec3(
        b.b0 * array[i0, 0] + b.b1 * array[i1, 0] + b.b2 * array[i2, 0],
        b.b0 * array[i0, 1] + b.b1 * array[i1, 1] + b.b2 * array[i2, 1],
        b.b0 * array[i0, 2] + b.b1 * array[i1, 2] + b.b2 * array[i2, 2],
    )


@inlined
def shading_normal_ws(
    geometry: Geometry, run: SurfaceRun, t: int, b: Barycentric
) -> tuple[bool, Vec3]:
    """The interpolated unit normal in world space, turned to the side seen; False if unusable."""
    n = mix(
        geometry.normals_ws, geometry.faces[t, 0], geometry.faces[t, 1], geometry.faces[t, 2], b
    )
    squared = dot(n, n)
    if not (np.isfinite(squared) and squared > 0.0):
        return False, Vec3(0.0, 0.0, 0.0)
    if run.normal_varies:
        n = scale(n, 1.0 / np.sqrt(squared))
    if run.back_side:
        n = Vec3(-n.x, -n.y, -n.z)
    return True, n


@inlined
def base_color(geometry: Geometry, textures: Textures | None, t: int, b: Barycentric) -> Vec3:
    """Material base colour times the texture, times the vertex colour."""
    m = geometry.triangle_material[t]
    color = Vec3(geometry.base_color[m, 0], geometry.base_color[m, 1], geometry.base_color[m, 2])
    if textures is not None:
        texel = sample_material(textures, geometry.faces, t, m, BASE, b)
        color = Vec3(color.x * texel.r, color.y * texel.g, color.z * texel.b)
    if (geometry.triangle_flags[t] & HAS_COLORS) == 0:
        return color
    v = mix(geometry.colors, geometry.faces[t, 0], geometry.faces[t, 1], geometry.faces[t, 2], b)
    return Vec3(color.x * v.x, color.y * v.y, color.z * v.z)


@inlined
def metallic_roughness(
    geometry: Geometry, textures: Textures | None, t: int, b: Barycentric
) -> tuple[float, float]:
    """Metallic (times blue) and roughness (times green of the texture)."""
    m = geometry.triangle_material[t]
    metallic, roughness = geometry.metallic[m], geometry.roughness[m]
    if textures is not None:
        texel = sample_material(textures, geometry.faces, t, m, METALLIC_ROUGHNESS, b)
        metallic *= texel.b
        roughness *= texel.g
    return metallic, roughness


@inlined
def normal_reflectivity(
    geometry: Geometry,
    t: int,
    albedo: Vec3,
    metallic: float,
    roughness: float,
    fresnel: bool,
    max_roughness: float,
) -> Vec3:
    """R at normal incidence: own reflectivity, or metallic · base colour (+ 0.04 with Fresnel)."""
    if roughness > max_roughness:
        return Vec3(0.0, 0.0, 0.0)
    m = geometry.triangle_material[t]
    own = geometry.own_reflectivity
    if not np.isnan(own[m, 0]):
        return Vec3(own[m, 0], own[m, 1], own[m, 2])
    f0 = (1.0 - metallic) * DIELECTRIC_F0 if fresnel else 0.0
    return Vec3(metallic * albedo.x + f0, metallic * albedo.y + f0, metallic * albedo.z + f0)


@driver()
def shade_normals(
    view: ViewParams,
    geometry: Geometry,
    positions_vs: F64Array,
    triangle_id: I32Array,
    want_shading: bool,
    geo_normal_vs: FloatArray,
    normal_vs: FloatArray,
    repaired: I64Array,
) -> None:
    """Geometric and (if wanted) shading normals in view space; repaired (H,) counts pixels whose
    shading normal was unusable and became the geometric one.
    """
    for y in prange(view.height):
        x = 0
        bad = 0
        while x < view.width:
            t = np.int64(triangle_id[y, x])
            end = run_end(triangle_id, y, x)
            if t < 0:
                for j in range(np.uint64(x), np.uint64(end)):
                    for c in range(3):
                        geo_normal_vs[y, j, c] = 0.0
                if want_shading:
                    for j in range(np.uint64(x), np.uint64(end)):
                        for c in range(3):
                            normal_vs[y, j, c] = 0.0
                x = end
                continue
            run = begin_run(view, geometry, positions_vs, t)
            g = run.geo_normal_vs
            for j in range(np.uint64(x), np.uint64(end)):
                geo_normal_vs[y, j, 0] = g.x
                geo_normal_vs[y, j, 1] = g.y
                geo_normal_vs[y, j, 2] = g.z
            if want_shading:
                n = g
                if run.smooth and not run.normal_varies:
                    usable, n_ws = shading_normal_ws(geometry, run, t, Barycentric(1.0, 0.0, 0.0))
                    if usable:
                        n = rotate_to_view(view, n_ws)
                    else:
                        bad += end - x
                for j in range(np.uint64(x), np.uint64(end)):
                    if run.normal_varies:
                        b = weights_at(view, run, j, y)
                        usable, n_ws = shading_normal_ws(geometry, run, t, b)
                        n = g
                        if usable:
                            n = rotate_to_view(view, n_ws)
                        else:
                            bad += 1
                    normal_vs[y, j, 0] = n.x
                    normal_vs[y, j, 1] = n.y
                    normal_vs[y, j, 2] = n.z
            x = end
        repaired[y] = bad


@driver()
def shade_materials(
    view: ViewParams,
    geometry: Geometry,
    textures: Textures | None,
    positions_vs: F64Array,
    triangle_id: I32Array,
    fresnel: bool,
    max_roughness: float,
    object_id: I32Array,
    material_id: I32Array,
    albedo: FloatArray,
    reflectivity: FloatArray,
    roughness: FloatArray,
) -> None:
    """Ids, base colour, reflectivity at normal incidence and roughness of visible surfaces.

    textures: of the visible materials; None, and not paid for, where none has any.
    """
    for y in prange(view.height):
        x = 0
        while x < view.width:
            t = np.int64(triangle_id[y, x])
            end = run_end(triangle_id, y, x)
            if t < 0:
                for j in range(np.uint64(x), np.uint64(end)):
                    object_id[y, j] = -1
                    material_id[y, j] = -1
                    roughness[y, j] = 0.0
                    for c in range(3):
                        albedo[y, j, c] = 0.0
                        reflectivity[y, j, c] = 0.0
                x = end
                continue
            varies = False
            if (geometry.triangle_flags[t] & HAS_COLORS) != 0:
                varies = not rows_equal(
                    geometry.colors,
                    geometry.faces[t, 0],
                    geometry.faces[t, 1],
                    geometry.faces[t, 2],
                )
            m = geometry.triangle_material[t]
            if textures is not None:
                varies = varies or (geometry.triangle_flags[t] & TEXTURED) != 0
            if varies:
                run = begin_run(view, geometry, positions_vs, t)
                for j in range(np.uint64(x), np.uint64(end)):
                    b = weights_at(view, run, j, y)
                    a = base_color(geometry, textures, t, b)
                    metallic, rough = metallic_roughness(geometry, textures, t, b)
                    store3(albedo, y, j, a)
                    store3(
                        reflectivity,
                        y,
                        j,
                        normal_reflectivity(
                            geometry, t, a, metallic, rough, fresnel, max_roughness
                        ),
                    )
                    roughness[y, j] = rough
            else:
                metallic, rough = geometry.metallic[m], geometry.roughness[m]
                a = base_color(geometry, None, t, Barycentric(1.0, 0.0, 0.0))
                r = normal_reflectivity(geometry, t, a, metallic, rough, fresnel, max_roughness)
                for j in range(np.uint64(x), np.uint64(end)):
                    store3(albedo, y, j, a)
                    store3(reflectivity, y, j, r)
                    roughness[y, j] = rough
            for j in range(np.uint64(x), np.uint64(end)):
                object_id[y, j] = geometry.triangle_object[t]
                material_id[y, j] = m
            x = end


@kernel
def store3(image: FloatArray, y: int, x: int, v: Vec3) -> None:
    """image[y, x] = v."""
    image[y, x, 0] = v.x
    image[y, x, 1] = v.y
    image[y, x, 2] = v.z

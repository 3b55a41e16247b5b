"""Shapes, materials and the camera's axes as kernels read them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .. import transforms
from ..camera import Camera
from ..raster.attributes import DIELECTRIC_F0
from ..scene import Material
from ..typed import BoolArray, F64Array, I32Array
from .shapes import Box, Disc, Plane, Shape, Sphere

SPHERE, PLANE, DISC, BOX = 0, 1, 2, 3


class ShapeArrays(NamedTuple):
    """n shapes. Unit vectors are in world space; what a kind has no use for is 0."""

    kind: I32Array  # (n,) the numbers above
    center: F64Array  # (n, 3); of a plane, its point
    axes: F64Array  # (3n, 3): rows 3i … 3i + 2 of shape i; the last is a sheet's normal
    size: F64Array  # (n, 3): half sizes; a radius stands in column 0
    surface: I32Array  # (n,) number of the first surface
    material: I32Array  # (n,)
    double_sided: BoolArray  # (n,)


class MaterialArrays(NamedTuple):
    """nm materials; own_reflectivity is NaN where a material has none."""

    base_color: F64Array  # (nm, 3)
    emissive: F64Array  # (nm, 3)
    own_reflectivity: F64Array  # (nm, 3)
    metallic: F64Array  # (nm,)
    roughness: F64Array  # (nm,)
    unlit: BoolArray  # (nm,)


def shape_arrays(shapes: Sequence[Shape], materials: Sequence[Material]) -> ShapeArrays:
    """The arrays of a scene's shapes."""
    n = len(shapes)
    counts = [shape.surfaces for shape in shapes]
    found = ShapeArrays(
        np.empty(n, np.int32),
        np.zeros((n, 3)),
        np.zeros((3 * n, 3)),
        np.zeros((n, 3)),
        np.cumsum([0, *counts[:-1]]).astype(np.int32),
        np.array([shape.material for shape in shapes], np.int32),
        np.array([materials[shape.material].double_sided for shape in shapes], bool),
    )
    for i, shape in enumerate(shapes):
        if isinstance(shape, Sphere):
            found.kind[i] = SPHERE
            found.center[i] = shape.center
            found.size[i, 0] = shape.radius
        elif isinstance(shape, Plane):
            found.kind[i] = PLANE
            found.center[i] = shape.point
            found.axes[3 * i + 2] = transforms.normalized3(shape.normal)
        elif isinstance(shape, Disc):
            found.kind[i] = DISC
            found.center[i] = shape.center
            found.axes[3 * i + 2] = transforms.normalized3(shape.normal)
            found.size[i, 0] = shape.radius
        elif isinstance(shape, Box):
            found.kind[i] = BOX
            found.center[i] = shape.world_from_box[:3, 3]
            for axis in range(3):
                found.axes[3 * i + axis] = transforms.normalized3(shape.world_from_box[:3, axis])
            found.size[i] = shape.half_size
    return found


def material_arrays(materials: Sequence[Material]) -> MaterialArrays:
    """The arrays of a scene's materials."""
    nan = (np.nan, np.nan, np.nan)
    return MaterialArrays(
        np.array([m.base_color for m in materials], np.float64),
        np.array([m.emissive for m in materials], np.float64),
        np.array([m.reflectivity or nan for m in materials], np.float64),
        np.array([m.metallic for m in materials], np.float64),
        np.array([m.roughness for m in materials], np.float64),
        np.array([m.unlit for m in materials], bool),
    )


def normal_reflectivity(
    materials: MaterialArrays, *, fresnel: bool, max_roughness: float
) -> F64Array:
    """(nm, 3) R at normal incidence, by the rule of `raster.attributes.normal_reflectivity`."""
    f0 = (1.0 - materials.metallic) * DIELECTRIC_F0 if fresnel else 0.0 * materials.metallic
    by_metal = materials.metallic[:, None] * materials.base_color + f0[:, None]
    own = materials.own_reflectivity
    found = np.where(np.isnan(own), by_metal, own)
    found[materials.roughness > max_roughness] = 0.0
    return found


def world_axes(camera: Camera) -> F64Array:
    """(3, 3), A: world directions from view directions, and (transposed) view from world normals.

    View space is Rᵀ·(p − eye) with the camera's own R, which may be off a rotation by what a
    float32 file rounds. A = R⁻ᵀ = cofactors / determinant makes the pixel's world ray project to
    the pixel all the same.
    """
    m = camera.world_from_view
    return transforms.cofactors(m) / transforms.determinant3(m)

"""A scene as flat arrays: world positions, triangles, and what each triangle refers to.

Done once a scene. Winding is flipped here for mirroring transforms, so that everywhere later a
front face is counter-clockwise seen from outside. Triangle ids number the triangles node by node,
primitive by primitive, in file order.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .. import transforms
from ..scene import Material, Scene
from ..typed import F32Array, F64Array, I32Array, U8Array

DOUBLE_SIDED = 1
HAS_NORMALS = 2
HAS_COLORS = 4
TEXTURED = 8
MASKED = 16
UNLIT = 32


class Geometry(NamedTuple):
    """Arrays that kernels read; nv vertices, nt triangles, nm materials.

    normals_ws and colors have 0 rows if no primitive has any. own_reflectivity is NaN where a
    material has none.
    """

    positions_ws: F64Array  # (nv, 3)
    normals_ws: F64Array  # (nv, 3) unit, or 0 where a normal is unusable
    colors: F32Array  # (nv, 3) linear RGB
    faces: I32Array  # (nt, 3)
    triangle_object: I32Array  # (nt,)
    triangle_material: I32Array  # (nt,)
    triangle_flags: U8Array  # (nt,) the bits above
    base_color: F64Array  # (nm, 3)
    emissive: F64Array  # (nm, 3)
    own_reflectivity: F64Array  # (nm, 3)
    metallic: F64Array  # (nm,)
    roughness: F64Array  # (nm,)


def flatten(scene: Scene) -> Geometry:
    """The scene's triangles in world space, by strict arithmetic."""
    placed = [
        (index, node, primitive)
        for index, node in enumerate(scene.nodes)
        for primitive in scene.meshes[node.mesh].primitives
    ]
    nv = sum(len(p.positions) for _, _, p in placed)
    nt = sum(len(p.faces) for _, _, p in placed)
    any_normals = any(p.normals is not None for _, _, p in placed)
    any_colors = any(p.colors is not None for _, _, p in placed)

    positions = np.empty((nv, 3))
    normals = np.zeros((nv if any_normals else 0, 3))
    colors = np.ones((nv if any_colors else 0, 3), np.float32)
    faces = np.empty((nt, 3), np.int32)
    objects = np.empty(nt, np.int32)
    materials = np.empty(nt, np.int32)
    flags = np.zeros(nt, np.uint8)

    material_flags = [_flags(material) for material in scene.materials]

    v = t = 0
    for index, node, primitive in placed:
        m = node.world_from_mesh
        v_end, t_end = v + len(primitive.positions), t + len(primitive.faces)
        transforms.transform_points(m, primitive.positions, positions[v:v_end])
        mirrored = transforms.determinant3(m) < 0.0
        if primitive.normals is not None:
            # The cofactor matrix is det·(inverse transpose): its sign must not turn normals in.
            c = transforms.cofactors(m) * (-1.0 if mirrored else 1.0)
            transforms.transform_normals(c, primitive.normals, normals[v:v_end])
            flags[t:t_end] |= HAS_NORMALS
        if primitive.colors is not None:
            colors[v:v_end] = primitive.colors
            flags[t:t_end] |= HAS_COLORS
        faces[t:t_end] = primitive.faces[:, ::-1] if mirrored else primitive.faces
        faces[t:t_end] += v
        objects[t:t_end] = index
        materials[t:t_end] = primitive.material
        flags[t:t_end] |= material_flags[primitive.material]
        v, t = v_end, t_end

    nan = (np.nan, np.nan, np.nan)
    return Geometry(
        positions_ws=positions,
        normals_ws=normals,
        colors=colors,
        faces=faces,
        triangle_object=objects,
        triangle_material=materials,
        triangle_flags=flags,
        base_color=np.array([m.base_color for m in scene.materials], np.float64),
        emissive=np.array([m.emissive for m in scene.materials], np.float64),
        own_reflectivity=np.array([m.reflectivity or nan for m in scene.materials], np.float64),
        metallic=np.array([m.metallic for m in scene.materials], np.float64),
        roughness=np.array([m.roughness for m in scene.materials], np.float64),
    )


def _flags(material: Material) -> np.uint8:
    bits = DOUBLE_SIDED if material.double_sided else 0
    bits |= TEXTURED if any(t is not None for t in material.textures) else 0
    bits |= MASKED if material.alpha_cutoff is not None else 0
    bits |= UNLIT if material.unlit else 0
    return np.uint8(bits)

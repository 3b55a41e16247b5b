"""Normals for meshes whose file has none: smooth up to a crease angle, all smooth, or flat.

A corner's normal is the unit sum of n̂ · area · angle over the faces that it is smooth with: n̂ a
face's unit normal, angle the face's own at that position. Two faces are smooth with each other if
they share an edge and their normals differ by 30° at most; that is passed on from face to face
round a position, so a cylinder's side is smooth and its caps are sharp. Where a vertex has corners
that are not smooth with each other, it is split.

Everything is in mesh space, in face order, in strict float64; time grows with the faces (two
sorts apart), also where many meet in one position.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .._jit import driver, kernel
from ..scene import Mesh, Primitive, Scene
from ..typed import BoolArray, F32Array, F64Array, I32Array, I64Array
from ..vecmath.elementary import atan2
from ..vecmath.vec import Vec3, cross, dot, length, sub

CREASE_COSINE = 0.8659
"""Least cosine between the normals of smooth faces: 30.015°, so that float32 vertices do not decide
about facets of 30° (a cylinder of 12 segments is smooth)."""

MAX_FACES_OF_EDGE = 8
"""An edge of more faces is sharp: which of them belong together cannot be said."""


def without_normals(scene: Scene) -> Scene:
    """The scene with flat shading everywhere."""
    meshes = tuple(
        replace(mesh, primitives=tuple(replace(p, normals=None) for p in mesh.primitives))
        for mesh in scene.meshes
    )
    return replace(scene, meshes=meshes)


def with_smooth_normals(scene: Scene) -> Scene:
    """The scene with one normal for all corners at a float32 position of a mesh; none are split.

    Faces with a non-finite vertex add nothing; a sum of zero stays zero.
    """
    return replace(scene, meshes=tuple(_smooth(mesh) for mesh in scene.meshes))


def with_crease_normals(scene: Scene, *, only_missing: bool = False) -> Scene:
    """The scene with normals up to the crease angle, vertices split where it is exceeded.

    only_missing : leave primitives that have normals as they are, and out of the sums.
    """
    return replace(scene, meshes=tuple(_creased(mesh, only_missing) for mesh in scene.meshes))


def _smooth(mesh: Mesh) -> Mesh:
    if not mesh.primitives:
        return mesh
    positions, faces, starts = _joined(mesh.primitives)
    group = _position_groups(positions)
    normals = np.zeros((int(group.max(initial=-1)) + 1, 3), np.float32)
    _sum_normals(positions, faces, group[faces], np.zeros(normals.shape), normals)
    primitives = tuple(
        replace(p, normals=normals[group[start : start + len(p.positions)]])
        for p, start in zip(mesh.primitives, starts)
    )
    return replace(mesh, primitives=primitives)


def _creased(mesh: Mesh, only_missing: bool) -> Mesh:
    changed = [i for i, p in enumerate(mesh.primitives) if p.normals is None or not only_missing]
    if not changed:
        return mesh
    chosen = [mesh.primitives[i] for i in changed]
    positions, faces, _ = _joined(chosen)
    label = _smooth_labels(positions, faces)
    normals = np.zeros((int(label.max(initial=-1)) + 1, 3), np.float32)
    _sum_normals(positions, faces, label, np.zeros(normals.shape), normals)
    primitives = list(mesh.primitives)
    first = 0
    for i, primitive in zip(changed, chosen):
        last = first + len(primitive.faces)
        primitives[i] = _split(primitive, label[first:last], normals)
        first = last
    return replace(mesh, primitives=tuple(primitives))


def _joined(primitives: Sequence[Primitive]) -> tuple[F32Array, I32Array, I64Array]:
    """All positions, all faces in their numbering, and where each primitive's vertices start."""
    starts = np.cumsum([0, *(len(p.positions) for p in primitives)])
    positions = np.concatenate([p.positions for p in primitives])
    faces = np.concatenate([p.faces + np.int32(start) for p, start in zip(primitives, starts)])
    return positions, faces, starts


def _position_groups(positions: F32Array) -> I64Array:
    """(n,) group number of each vertex; vertices of equal float32 position share one."""
    bits = (positions + np.float32(0.0)).view(np.uint32)  # −0 becomes +0
    order = np.lexsort(bits.T)
    sorted_bits = bits[order]
    new = np.zeros(len(bits), np.int64)
    new[1:] = (sorted_bits[1:] != sorted_bits[:-1]).any(axis=1)
    group = np.empty(len(bits), np.int64)
    group[order] = np.cumsum(new)
    return group


def _smooth_labels(positions: F32Array, faces: I32Array) -> I64Array:
    """(m, 3) number of the normal that each corner takes, from 0 without gaps."""
    corner_group = _position_groups(positions)[faces]
    unit = np.zeros((len(faces), 3))
    _face_normals(positions, faces, unit)
    following = np.roll(corner_group, -1, axis=1)
    low, high = np.minimum(corner_group, following), np.maximum(corner_group, following)
    key = (low * (int(high.max(initial=0)) + 1) + high).ravel()
    order = np.argsort(key, kind="stable")
    parent = np.arange(3 * len(faces))
    _join_smooth(key[order], order, corner_group, unit, parent)
    is_root = parent == np.arange(len(parent))
    label = (np.cumsum(is_root) - 1)[parent].reshape(-1, 3)
    return _without_splits_for_nothing(faces, label, (unit != 0.0).any(axis=1))


def _without_splits_for_nothing(
    faces: I32Array, label: I64Array, has_normal: BoolArray
) -> I64Array:
    """The labels, but a face without a normal takes those that its vertices have elsewhere."""
    at_vertex = np.full(int(faces.max(initial=-1)) + 1, -1)
    at_vertex[faces[has_normal].ravel()[::-1]] = label[has_normal].ravel()[::-1]  # the first stays
    found = at_vertex[faces]
    return np.where(has_normal[:, None] | (found < 0), label, found)


def _split(primitive: Primitive, label: I64Array, normals: F32Array) -> Primitive:
    """The primitive with one vertex for each pair of vertex and label that its faces use.

    The first label of a vertex, in face order, keeps its number; the others follow at the end.
    """
    count = len(primitive.positions)
    pair = primitive.faces.astype(np.int64) * len(normals) + label
    pairs, first, inverse = np.unique(pair, return_index=True, return_inverse=True)
    vertex = pairs // max(len(normals), 1)
    order = np.lexsort((first, vertex))
    keeps = np.zeros(len(pairs), bool)
    keeps[order] = np.diff(vertex[order], prepend=-1) != 0
    number = vertex.copy()
    extra = np.flatnonzero(~keeps)
    extra = extra[np.argsort(first[extra], kind="stable")]
    number[extra] = count + np.arange(len(extra))
    source = np.concatenate([np.arange(count), vertex[extra]])
    out = np.zeros((len(source), 3), np.float32)
    out[number] = normals[pairs % max(len(normals), 1)]

    def taken(array: F32Array | None) -> F32Array | None:
        return None if array is None else array[source]

    return Primitive(
        primitive.positions[source],
        number[inverse.reshape(-1, 3)].astype(np.int32),
        primitive.material,
        out,
        taken(primitive.colors),
        taken(primitive.uv0),
        taken(primitive.uv1),
        taken(primitive.alphas),
    )


@kernel
def _corner(positions: F32Array, faces: I32Array, f: int, k: int) -> Vec3:
    v = faces[f, k]
    return Vec3(
        np.float64(positions[v, 0]), np.float64(positions[v, 1]), np.float64(positions[v, 2])
    )


@driver(parallel=False)
def _face_normals(positions: F32Array, faces: I32Array, unit: F64Array) -> None:
    """unit[f] = the face's unit normal; left as it is where there is none."""
    for f in range(faces.shape[0]):
        a = _corner(positions, faces, f, 0)
        n = cross(sub(_corner(positions, faces, f, 1), a), sub(_corner(positions, faces, f, 2), a))
        size = length(n)
        if np.isfinite(size) and size > 0.0:
            unit[f, 0] = n.x / size
            unit[f, 1] = n.y / size
            unit[f, 2] = n.z / size


@kernel
def _root(parent: I64Array, i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@kernel
def _union(parent: I64Array, i: int, j: int) -> None:
    i, j = _root(parent, i), _root(parent, j)
    parent[max(i, j)] = min(i, j)


@driver(parallel=False)
def _join_smooth(
    key: I64Array, order: I64Array, group: I64Array, unit: F64Array, parent: I64Array
) -> None:
    """Join the corners (numbered 3·face + corner) at both ends of every smooth edge.

    key: of each half-edge, sorted; order: its number 3·face + corner it leaves from; parent: (3m,)
    each corner's own number, on return the least number of the corners it is smooth with.
    """
    first = 0
    while first < len(key):
        last = first + 1
        while last < len(key) and key[last] == key[first]:
            last += 1
        if last - first <= MAX_FACES_OF_EDGE:
            for i in range(first, last):
                f, k = order[i] // 3, order[i] % 3
                for j in range(i + 1, last):
                    g, m = order[j] // 3, order[j] % 3
                    cosine = unit[f, 0] * unit[g, 0] + unit[f, 1] * unit[g, 1]
                    cosine += unit[f, 2] * unit[g, 2]
                    if cosine >= CREASE_COSINE:
                        same = group[f, k] == group[g, m]
                        _union(parent, order[i], order[j] if same else 3 * g + (m + 1) % 3)
                        _union(
                            parent,
                            3 * f + (k + 1) % 3,
                            3 * g + (m + 1) % 3 if same else order[j],
                        )
        first = last
    for i in range(len(parent)):
        parent[i] = _root(parent, i)


@driver(parallel=False)
def _sum_normals(
    positions: F32Array, faces: I32Array, label: I64Array, total: F64Array, out: F32Array
) -> None:
    """total[label] += n̂ · area · angle of each corner, in face order; out = the unit sums."""
    for f in range(faces.shape[0]):
        for k in range(3):
            p = _corner(positions, faces, f, k)
            u = sub(_corner(positions, faces, f, (k + 1) % 3), p)
            v = sub(_corner(positions, faces, f, (k + 2) % 3), p)
            n = cross(u, v)
            size = length(n)
            if np.isfinite(size) and size > 0.0:
                angle = atan2(size, dot(u, v))
                total[label[f, k], 0] += n.x * angle
                total[label[f, k], 1] += n.y * angle
                total[label[f, k], 2] += n.z * angle
    for i in range(out.shape[0]):
        x, y, z = total[i, 0], total[i, 1], total[i, 2]
        largest = max(abs(x), abs(y), abs(z))
        if largest > 0.0:
            x /= largest
            y /= largest
            z /= largest
            size = np.sqrt(x * x + y * y + z * z)
            out[i, 0] = x / size
            out[i, 1] = y / size
            out[i, 2] = z / size

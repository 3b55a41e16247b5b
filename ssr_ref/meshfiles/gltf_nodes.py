"""The node tree of a glTF scene as a flat list of placed meshes.

World transforms are strict float64 products of the local matrices, parent by child. Source: glTF
2.0, section 3.5. The tree is walked without recursion, so its depth is not limited.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .. import transforms
from ..typed import F64Array
from .gltf_json import Gltf


class MeshNode(NamedTuple):
    """A node with a mesh: its name, the mesh's index, world_from_mesh (4, 4) float64."""

    name: str
    mesh: int
    world_from_mesh: F64Array
    skinned: bool
    instanced: bool


class Walk(NamedTuple):
    """What a scene reaches, parents first. cameras, lights: nodes that hold one."""

    nodes: list[MeshNode]
    cameras: int
    lights: int


def walk_scene(gltf: Gltf) -> Walk:
    """The nodes of the scene that `gltf.options.scene` asks for, else the default or first one."""
    nodes: list[MeshNode] = []
    cameras = lights = 0
    seen: set[int] = set()
    todo: list[tuple[Any, F64Array | None]] = [(i, None) for i in reversed(_roots(gltf))]
    while todo:
        index, world_from_parent = todo.pop()
        node = gltf.item("nodes", index)
        where = f"nodes[{index}]"
        if index in seen:
            raise gltf.error(
                f"{where} is reached twice; expected a tree in which each node has one parent: "
                "export the file again"
            )
        seen.add(index)
        world = _local(gltf, node, where)
        if world_from_parent is not None:
            world = transforms.multiply(world_from_parent, world)
        cameras += "camera" in node
        lights += gltf.extension(node, "KHR_lights_punctual", where) is not None
        if "mesh" in node:
            mesh = gltf.item("meshes", node["mesh"])
            name = node.get("name") or mesh.get("name") or f"node {index}"
            instanced = gltf.extension(node, "EXT_mesh_gpu_instancing", where) is not None
            nodes.append(MeshNode(str(name), node["mesh"], world, "skin" in node, instanced))
        todo.extend((child, world) for child in reversed(gltf.listed(node, "children", where)))
    return Walk(nodes, cameras, lights)


def scene_names(gltf: Gltf) -> list[str]:
    """The name of each scene, "scene 2" for one without."""
    return [
        str(gltf.item("scenes", i).get("name") or f"scene {i}")
        for i in range(len(gltf.items("scenes")))
    ]


def scene_index(gltf: Gltf) -> int | None:
    """Index of the scene that is drawn; None for a file without scenes."""
    wanted, names = gltf.options.scene, scene_names(gltf)
    if isinstance(wanted, str):
        found = [i for i, name in enumerate(names) if name == wanted]
        if len(found) != 1:
            listed = ", ".join(repr(name[:40]) for name in names[:8]) or "none"
            raise gltf.error(
                f"has {len(found)} scenes named {wanted!r}; expected one (its scenes: {listed}): "
                "give another name, or an index"
            )
        return found[0]
    if wanted is not None and wanted >= len(names):
        raise gltf.error(
            f"has {len(names)} scenes and scene {wanted} is asked for; expected an index below "
            f"{len(names)}"
        )
    if not names:
        return None
    default = gltf.root.get("scene", 0) if wanted is None else wanted
    gltf.item("scenes", default)
    assert isinstance(default, int)
    return default


def _roots(gltf: Gltf) -> list[Any]:
    index = scene_index(gltf)
    if index is not None:
        return gltf.listed(gltf.item("scenes", index), "nodes", f"scenes[{index}]")
    # A file without scenes: every node that is nobody's child.
    count = len(gltf.items("nodes"))
    children = {
        child
        for i in range(count)
        for child in gltf.listed(gltf.item("nodes", i), "children", f"nodes[{i}]")
        if isinstance(child, int)
    }
    return [i for i in range(count) if i not in children]


def _local(gltf: Gltf, node: dict[str, Any], where: str) -> F64Array:
    """parent_from_node (4, 4): the node's matrix, or T·R·S from left to right."""
    if "matrix" in node:
        columns = gltf.numbers(node["matrix"], 16, f"{where}.matrix")
        return np.array(columns, np.float64).reshape(4, 4).T.copy()
    factors: list[F64Array] = []
    if "translation" in node:
        x, y, z = gltf.numbers(node["translation"], 3, f"{where}.translation")
        factors.append(transforms.translation(x, y, z))
    if "rotation" in node:
        x, y, z, w = gltf.numbers(node["rotation"], 4, f"{where}.rotation")
        factors.append(transforms.from_quaternion(x, y, z, w))
    if "scale" in node:
        x, y, z = gltf.numbers(node["scale"], 3, f"{where}.scale")
        factors.append(transforms.scaling(x, y, z))
    local = factors[0] if factors else transforms.identity()
    for factor in factors[1:]:
        local = transforms.multiply(local, factor)
    return local

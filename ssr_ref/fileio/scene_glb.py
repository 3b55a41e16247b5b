"""scene.glb of a bundle: exactly what was rendered, so that it can be rebuilt elsewhere.

Vertices keep their float32 bits, node matrices are written as float64 decimals that parse back to
the same bits, so `load_mesh` gives a scene of the same `content_sha256` (lights apart, they travel
in lights.json). The bytes depend on the scene alone: no time, host, path or version.
"""

from __future__ import annotations

import contextlib
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError
from ..scene import Material, Mesh, Scene
from ..typed import AnyArray, F32Array
from .gltf import REFLECTIVITY_KEY, TRIANGLES

_ARRAY_BUFFER = 34962
_ELEMENT_ARRAY_BUFFER = 34963
_FLOAT = 5126
_UNSIGNED_INT = 5125


def scene_glb_bytes(scene: Scene) -> bytes:
    """The GLB of a scene: a node for each `Node`, a mesh for each `Mesh`, materials, no lights.

    Raises FileError if a material's factor is NaN or infinite, which JSON cannot hold.
    """
    blob = _Blob()
    root: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "ssr_ref"},
        "scene": 0,
        "scenes": [{"name": scene.name, "nodes": list(range(len(scene.nodes)))}],
        "nodes": [
            {
                "name": node.name,
                "mesh": node.mesh,
                # glTF stores columns; Python's repr has the 17 digits that float64 needs.
                "matrix": [float(v) for v in node.world_from_mesh.T.ravel()],
            }
            for node in scene.nodes
        ],
        "meshes": [_mesh(mesh, blob) for mesh in scene.meshes],
        "materials": [_material(material) for material in scene.materials],
    }
    if any("extensions" in material for material in root["materials"]):
        root["extensionsUsed"] = ["KHR_materials_emissive_strength"]
    root["accessors"] = blob.accessors
    root["bufferViews"] = blob.views
    root["buffers"] = [{"byteLength": len(blob.data)}]
    try:
        text = json.dumps(root, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()
    except ValueError:
        raise FileError(
            f"scene '{scene.name}' has a material with a NaN or infinite factor; expected finite "
            "numbers: repair the material"
        ) from None
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(blob.data), b"BIN\0") + blob.data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def write_scene_glb(scene: Scene, path: str | Path) -> None:
    """Write `scene_glb_bytes` to `path`; nothing is left behind if that fails (FileError)."""
    path = Path(path)
    data = scene_glb_bytes(scene)
    part = path.with_name(path.name + ".part")
    try:
        part.write_bytes(data)
        part.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        raise FileError(
            f"{path}: cannot be written ({error.strerror or error}); expected a path in a folder "
            "that exists and may be written to"
        ) from None


class _Blob:
    """The binary chunk as it grows, with the accessor and buffer view of each array."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.accessors: list[dict[str, Any]] = []
        self.views: list[dict[str, Any]] = []

    def add(self, array: AnyArray, target: int, accessor: dict[str, Any]) -> int:
        """Append an array of 4-byte elements; the index of its accessor."""
        raw = array.tobytes()
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw), "target": target}
        self.data += raw
        self.views.append(view)
        self.accessors.append({"bufferView": len(self.views) - 1, **accessor})
        return len(self.accessors) - 1

    def vectors(self, array: F32Array, *, bounds: bool = False) -> int:
        """An (n, 3) float32 attribute; positions need bounds, taken over finite values."""
        accessor: dict[str, Any] = {"componentType": _FLOAT, "count": len(array), "type": "VEC3"}
        if bounds:
            columns = [array[:, j][np.isfinite(array[:, j])] for j in range(3)]
            accessor["min"] = [float(c.min()) if len(c) else 0.0 for c in columns]
            accessor["max"] = [float(c.max()) if len(c) else 0.0 for c in columns]
        return self.add(array.astype("<f4"), _ARRAY_BUFFER, accessor)


def _mesh(mesh: Mesh, blob: _Blob) -> dict[str, Any]:
    primitives = []
    for primitive in mesh.primitives:
        attributes = {"POSITION": blob.vectors(primitive.positions, bounds=True)}
        if primitive.normals is not None:
            attributes["NORMAL"] = blob.vectors(primitive.normals)
        if primitive.colors is not None:
            attributes["COLOR_0"] = blob.vectors(primitive.colors)
        corners = primitive.faces.astype("<u4").ravel()
        accessor = {"componentType": _UNSIGNED_INT, "count": len(corners), "type": "SCALAR"}
        primitives.append(
            {
                "attributes": attributes,
                "indices": blob.add(corners, _ELEMENT_ARRAY_BUFFER, accessor),
                "material": primitive.material,
                "mode": TRIANGLES,
            }
        )
    return {"name": mesh.name, "primitives": primitives}


def _material(material: Material) -> dict[str, Any]:
    """Factors as they are; emission above 1 as a power of two times a factor, which is exact."""
    entry: dict[str, Any] = {
        "name": material.name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*(float(v) for v in material.base_color), 1.0],
            "metallicFactor": float(material.metallic),
            "roughnessFactor": float(material.roughness),
        },
        "emissiveFactor": [float(v) for v in material.emissive],
        "doubleSided": bool(material.double_sided),
    }
    brightest = max(entry["emissiveFactor"])
    if brightest > 1.0:
        strength = float(np.ldexp(1.0, int(np.frexp(brightest)[1])))
        entry["emissiveFactor"] = [float(v) / strength for v in material.emissive]
        entry["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
    if material.reflectivity is not None:
        entry["extras"] = {REFLECTIVITY_KEY: [float(v) for v in material.reflectivity]}
    return entry

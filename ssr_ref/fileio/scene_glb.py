"""scene.glb of a bundle: exactly what was rendered, so that it can be rebuilt elsewhere.

Vertices keep their float32 bits, node matrices are written as float64 decimals that parse back to
the same bits, images are stored as PNG, so `load_mesh` gives a scene of the same `content_sha256`
(lights apart, they travel in lights.json). What glTF has no place for is kept in `extras`. The
bytes depend on the scene alone: no time, host, path, compressor or version.
"""

from __future__ import annotations

import contextlib
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError
from ..meshfiles.gltf_materials import (
    ALPHA_KEY,
    EMISSIVE_KEY,
    REFLECTIVITY_KEY,
    THICKNESS_KEY,
    UNLIT_KEY,
)
from ..meshfiles.gltf_primitives import COLOR_KEY, TRIANGLES
from ..meshfiles.images import png_bytes
from ..scene import Material, Mesh, Primitive, Scene
from ..texture import Texture, WrapName
from ..typed import AnyArray, F32Array

_ARRAY_BUFFER = 34962
_ELEMENT_ARRAY_BUFFER = 34963
_FLOAT = 5126
_UNSIGNED_INT = 5125
_WRAP_CODES: dict[WrapName, int] = {"repeat": 10497, "mirror": 33648, "clamp": 33071}
_MOST_BYTES = 2**32 - 1
"""A GLB's lengths are 32-bit."""


def scene_glb_bytes(scene: Scene) -> bytes:
    """The GLB of a scene: a node for each `Node`, a mesh for each `Mesh`, materials, no lights.

    Images that a material uses are stored without compression. Raises FileError if a material's
    factor is NaN or infinite, which JSON cannot hold, or for a scene of 4 GiB or more.
    """
    blob = _Blob()
    textures = _Textures()
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
        "materials": [_material(material, textures) for material in scene.materials],
    }
    textures.write(scene, root, blob)
    used = {name for material in root["materials"] for name in material.get("extensions", {})}
    if textures.transformed:
        used.add("KHR_texture_transform")
        root["extensionsRequired"] = ["KHR_texture_transform"]
    if used:
        root["extensionsUsed"] = sorted(used)
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
    size = 28 + len(text) + len(blob.data)
    if size > _MOST_BYTES:
        raise FileError(
            f"scene '{scene.name}' needs {size} bytes as GLB; expected at most {_MOST_BYTES}: "
            "scale its images down"
        )
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

    def view(self, raw: bytes, **more: Any) -> int:
        """Append bytes, padded to a multiple of 4; the index of their buffer view."""
        self.views.append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw), **more}
        )
        self.data += raw + bytes(-len(raw) % 4)
        return len(self.views) - 1

    def add(self, array: AnyArray, target: int, accessor: dict[str, Any]) -> int:
        """Append an array of 4-byte elements; the index of its accessor."""
        view = self.view(array.tobytes(), target=target)
        self.accessors.append({"bufferView": view, **accessor})
        return len(self.accessors) - 1

    def vectors(self, array: F32Array, *, bounds: bool = False) -> int:
        """An (n, 2 to 4) float32 attribute; positions need bounds, taken over finite values."""
        shape = f"VEC{array.shape[1]}"
        accessor: dict[str, Any] = {"componentType": _FLOAT, "count": len(array), "type": shape}
        if bounds:
            columns = [array[:, j][np.isfinite(array[:, j])] for j in range(3)]
            accessor["min"] = [float(c.min()) if len(c) else 0.0 for c in columns]
            accessor["max"] = [float(c.max()) if len(c) else 0.0 for c in columns]
        return self.add(array.astype("<f4"), _ARRAY_BUFFER, accessor)


class _Textures:
    """The textures, samplers and images that materials refer to, each once."""

    def __init__(self) -> None:
        self.transformed = False
        self._images: dict[int, int] = {}
        self._samplers: dict[tuple[WrapName, WrapName], int] = {}
        self._textures: dict[tuple[int, int], int] = {}

    def info(self, texture: Texture) -> dict[str, Any]:
        """The textureInfo object of a texture."""
        image = self._images.setdefault(texture.image, len(self._images))
        sampler = self._samplers.setdefault(texture.wrap, len(self._samplers))
        index = self._textures.setdefault((image, sampler), len(self._textures))
        entry: dict[str, Any] = {"index": index, "texCoord": int(texture.uv_set)}
        plain = Texture(0)
        # By their digits: −0 is not 0.
        values = (texture.offset, texture.rotation, texture.scale)
        if repr(values) != repr((plain.offset, plain.rotation, plain.scale)):
            self.transformed = True
            entry["extensions"] = {
                "KHR_texture_transform": {
                    "offset": list(texture.offset),
                    "rotation": texture.rotation,
                    "scale": list(texture.scale),
                }
            }
        return entry

    def write(self, scene: Scene, root: dict[str, Any], blob: _Blob) -> None:
        """Put what was asked for into the file; nothing for a scene without textures."""
        if not self._textures:
            return
        root["images"] = [
            {
                "name": scene.images[index].name,
                "mimeType": "image/png",
                "bufferView": blob.view(png_bytes(scene.images[index])),
            }
            for index in self._images
        ]
        root["samplers"] = [
            {"wrapS": _WRAP_CODES[s], "wrapT": _WRAP_CODES[t]} for s, t in self._samplers
        ]
        root["textures"] = [{"source": i, "sampler": s} for i, s in self._textures]


def _mesh(mesh: Mesh, blob: _Blob) -> dict[str, Any]:
    return {"name": mesh.name, "primitives": [_primitive(p, blob) for p in mesh.primitives]}


def _primitive(primitive: Primitive, blob: _Blob) -> dict[str, Any]:
    attributes = {"POSITION": blob.vectors(primitive.positions, bounds=True)}
    entry: dict[str, Any] = {
        "attributes": attributes,
        "material": primitive.material,
        "mode": TRIANGLES,
    }
    if primitive.normals is not None:
        attributes["NORMAL"] = blob.vectors(primitive.normals)
    colors, alphas = primitive.colors, primitive.alphas
    if alphas is not None:
        rgb = np.ones((len(alphas), 3), np.float32) if colors is None else colors
        entry["extras"] = {COLOR_KEY: "a" if colors is None else "rgba"}
        colors = np.concatenate([rgb, alphas[:, None]], axis=1)
    if colors is not None:
        attributes["COLOR_0"] = blob.vectors(colors)
    for name, uvs in (("TEXCOORD_0", primitive.uv0), ("TEXCOORD_1", primitive.uv1)):
        if uvs is not None:
            attributes[name] = blob.vectors(uvs)
    corners = primitive.faces.astype("<u4").ravel()
    accessor = {"componentType": _UNSIGNED_INT, "count": len(corners), "type": "SCALAR"}
    entry["indices"] = blob.add(corners, _ELEMENT_ARRAY_BUFFER, accessor)
    return entry


def _material(material: Material, textures: _Textures) -> dict[str, Any]:
    """Factors as they are; emission above 1 as a power of two times a factor."""
    pbr: dict[str, Any] = {
        "baseColorFactor": [*(float(v) for v in material.base_color), 1.0],
        "metallicFactor": float(material.metallic),
        "roughnessFactor": float(material.roughness),
    }
    entry: dict[str, Any] = {
        "name": material.name,
        "pbrMetallicRoughness": pbr,
        "emissiveFactor": [float(v) for v in material.emissive],
        "doubleSided": bool(material.double_sided),
    }
    extensions: dict[str, Any] = {}
    extras: dict[str, Any] = {}
    brightest = max(entry["emissiveFactor"])
    if brightest > 1.0:
        strength = float(np.ldexp(1.0, min(int(np.frexp(brightest)[1]), 1023)))
        entry["emissiveFactor"] = [float(v) / strength for v in material.emissive]
        if any(f * strength != v for f, v in zip(entry["emissiveFactor"], material.emissive)):
            extras[EMISSIVE_KEY] = list(material.emissive)  # one is too small to be divided
        extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": strength}
    if material.unlit:
        extensions["KHR_materials_unlit"] = {}
        extras[UNLIT_KEY] = True
    if material.alpha_cutoff is not None:
        entry["alphaMode"] = "MASK"
        entry["alphaCutoff"] = material.alpha_cutoff
        pbr["baseColorFactor"][3] = material.alpha
    elif material.alpha != 1.0:
        extras[ALPHA_KEY] = material.alpha
    if material.reflectivity is not None:
        extras[REFLECTIVITY_KEY] = [float(v) for v in material.reflectivity]
    if material.thickness is not None:
        endless = np.isinf(material.thickness)
        extras[THICKNESS_KEY] = "inf" if endless else material.thickness
    for owner, key, texture in (
        (pbr, "baseColorTexture", material.base_color_texture),
        (pbr, "metallicRoughnessTexture", material.metallic_roughness_texture),
        (entry, "emissiveTexture", material.emissive_texture),
    ):
        if texture is not None:
            owner[key] = textures.info(texture)
    if extensions:
        entry["extensions"] = extensions
    if extras:
        entry["extras"] = extras
    return entry

"""A small reader of GLB and glTF 2.0 files: node hierarchy, material factors, accessors.

The file's own JSON and binary data are read, because what it says must arrive bit for bit: trimesh
composes transforms through BLAS, turns float vertex colours into bytes and cannot say whether
normals were authored. World transforms are strict float64 products of the local matrices.

Source: Khronos glTF 2.0 specification, sections 3.5 (nodes), 3.6 (buffers, accessors), 3.7 (meshes)
and 3.9 (materials). Left out: sparse accessors, compressed or quantised geometry (refused), skins,
morph targets and textures (drawn without, with a note).
"""

from __future__ import annotations

import base64
import binascii
import contextlib
import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np

from .. import transforms
from ..errors import FileError
from ..scene import Material
from ..typed import AnyArray, F32Array, F64Array, I32Array

TRIANGLES = 4
"""The primitive mode of a triangle list; strips and fans come later."""

REFLECTIVITY_KEY = "ssr_ref_reflectivity"
"""Key in a material's `extras` that holds the reflectivity [r, g, b] of `Material`."""

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_UNSIGNED = ("<u1", "<u2", "<u4")
_JSON_CHUNK = 0x4E4F534A
_BIN_CHUNK = 0x004E4942

# Required extensions that do not change the geometry; any other one is refused.
_HARMLESS = (
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "KHR_xmp",
    "EXT_texture_",
    "MSFT_texture_",
)


def file_error(path: Path, message: str) -> FileError:
    """A FileError of one line that starts with the file's path."""
    return FileError(" ".join(f"{path}: {message}".split()))


class MeshNode(NamedTuple):
    """A node with a mesh: its name, the mesh's index, world_from_mesh (4, 4) float64."""

    name: str
    mesh: int
    world_from_mesh: F64Array
    skinned: bool


class GltfPrimitive(NamedTuple):
    """A triangle list as the file has it; see `ssr_ref.scene.Primitive`.

    colors: (n, 3) float32, or None. material: index into the file's materials, or None.
    """

    positions: F32Array
    faces: I32Array
    normals: F32Array | None
    colors: F32Array | None
    material: int | None


@dataclass(frozen=True, slots=True, eq=False)
class Gltf:
    """A parsed file. Every method raises FileError (one line) for what the file has wrong."""

    path: Path
    root: dict[str, Any]
    binary: bytes | None
    _buffers: dict[int, bytes] = field(default_factory=dict)

    def error(self, message: str) -> FileError:
        """A FileError about this file."""
        return file_error(self.path, message)

    def items(self, key: str) -> list[Any]:
        """The top-level array `key`; empty where the file has none."""
        value = self.root.get(key, [])
        if not isinstance(value, list):
            raise self.error(f"'{key}' is not a list; expected glTF 2.0: export the file again")
        return value

    def item(self, key: str, index: Any) -> dict[str, Any]:
        """Object `index` of the top-level array `key`."""
        items = self.items(key)
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(items):
            raise self.error(
                f"a reference to {key}[{index}] of {len(items)}; expected an index from 0 to "
                f"{len(items) - 1}: the file is damaged, export it again"
            )
        value = items[index]
        if not isinstance(value, dict):
            raise self.error(f"{key}[{index}] is not an object; expected glTF 2.0: export again")
        return value

    # ------------------------------------------------------------------ nodes

    def mesh_nodes(self) -> list[MeshNode]:
        """Nodes with a mesh that the default scene (or the first) reaches, parents first."""
        found: list[MeshNode] = []
        seen: set[int] = set()
        todo: list[tuple[Any, F64Array | None]] = [(i, None) for i in reversed(self._roots())]
        while todo:
            index, world_from_parent = todo.pop()
            node = self.item("nodes", index)
            if index in seen:
                raise self.error(
                    f"nodes[{index}] is reached twice; expected a tree in which each node has one "
                    "parent: export the file again"
                )
            seen.add(index)
            world = self._local(node, index)
            if world_from_parent is not None:
                world = transforms.multiply(world_from_parent, world)
            if "mesh" in node:
                mesh = self.item("meshes", node["mesh"])
                name = node.get("name") or mesh.get("name") or f"node {index}"
                found.append(MeshNode(str(name), node["mesh"], world, "skin" in node))
            children = node.get("children", [])
            if not isinstance(children, list):
                raise self.error(f"nodes[{index}].children is not a list; expected node indices")
            todo.extend((child, world) for child in reversed(children))
        return found

    def _roots(self) -> list[Any]:
        if self.items("scenes"):
            roots = self.item("scenes", self.root.get("scene", 0)).get("nodes", [])
            if not isinstance(roots, list):
                raise self.error("a scene's 'nodes' is not a list; expected node indices")
            return roots
        # A file without scenes: every node that is nobody's child.
        count = len(self.items("nodes"))
        children = {c for i in range(count) for c in self.item("nodes", i).get("children", [])}
        return [i for i in range(count) if i not in children]

    def _local(self, node: dict[str, Any], index: int) -> F64Array:
        """parent_from_node (4, 4): the node's matrix, or T·R·S from left to right."""
        where = f"nodes[{index}]"
        if "matrix" in node:
            columns = self._numbers(node["matrix"], 16, f"{where}.matrix")
            return np.array(columns, np.float64).reshape(4, 4).T.copy()
        factors: list[F64Array] = []
        if "translation" in node:
            x, y, z = self._numbers(node["translation"], 3, f"{where}.translation")
            factors.append(transforms.translation(x, y, z))
        if "rotation" in node:
            x, y, z, w = self._numbers(node["rotation"], 4, f"{where}.rotation")
            factors.append(transforms.from_quaternion(x, y, z, w))
        if "scale" in node:
            x, y, z = self._numbers(node["scale"], 3, f"{where}.scale")
            factors.append(transforms.scaling(x, y, z))
        local = factors[0] if factors else transforms.identity()
        for factor in factors[1:]:
            local = transforms.multiply(local, factor)
        return local

    def _numbers(self, value: Any, count: int, where: str) -> list[float]:
        if isinstance(value, list) and len(value) == count:
            if all(isinstance(v, int | float) and not isinstance(v, bool) for v in value):
                with contextlib.suppress(OverflowError):
                    numbers = [float(v) for v in value]
                    if np.isfinite(numbers).all():
                        return numbers
        raise self.error(
            f"{where} is {str(value)[:80]}; expected {count} finite numbers: export again"
        )

    def _whole(self, entry: dict[str, Any], key: str, where: str, default: int | None) -> int:
        value = entry.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise self.error(f"{where}.{key} is {value}; expected a whole number: export again")
        return value

    # -------------------------------------------------------------- materials

    def material(self, index: int) -> Material:
        """Material `index` from its factors (linear); glTF's defaults are white, metal, rough.

        The emission of a material with an emissive texture is left out: its factor alone, mostly
        white, would make the whole surface glow.
        """
        entry = self.item("materials", index)
        where = f"materials[{index}]"
        pbr = self._object(entry, "pbrMetallicRoughness", where)
        base = self._numbers(pbr.get("baseColorFactor", [1.0] * 4), 4, f"{where}.baseColorFactor")
        emissive = self._numbers(
            entry.get("emissiveFactor", [0.0] * 3), 3, f"{where}.emissiveFactor"
        )
        extension = self._object(
            self._object(entry, "extensions", where), "KHR_materials_emissive_strength", where
        )
        strength = self._number(extension.get("emissiveStrength", 1.0), f"{where}.emissiveStrength")
        if "emissiveTexture" in entry:
            strength = 0.0
        extras = entry.get("extras")
        own = extras.get(REFLECTIVITY_KEY) if isinstance(extras, dict) else None
        reflectivity = None
        if own is not None:
            r, g, b = self._numbers(own, 3, f"{where}.extras.{REFLECTIVITY_KEY}")
            reflectivity = (r, g, b)
        return Material(
            name=str(entry.get("name") or f"material {index}"),
            base_color=(base[0], base[1], base[2]),
            metallic=self._number(pbr.get("metallicFactor", 1.0), f"{where}.metallicFactor"),
            roughness=self._number(pbr.get("roughnessFactor", 1.0), f"{where}.roughnessFactor"),
            emissive=(emissive[0] * strength, emissive[1] * strength, emissive[2] * strength),
            reflectivity=reflectivity,
            double_sided=entry.get("doubleSided", False) is True,
        )

    def _number(self, value: Any, where: str) -> float:
        return self._numbers([value], 1, where)[0]

    def _object(self, entry: dict[str, Any], key: str, where: str) -> dict[str, Any]:
        value = entry.get(key, {})
        if not isinstance(value, dict):
            raise self.error(f"{where}.{key} is not an object; expected glTF 2.0: export again")
        return value

    def textures(self, index: int) -> set[int]:
        """Indices of the textures that material `index` refers to, in extensions too."""
        found: set[int] = set()
        todo: list[Any] = [self.item("materials", index)]
        while todo:
            entry = todo.pop()
            for key, value in entry.items():
                if not isinstance(value, dict):
                    continue
                if key.endswith("Texture") and isinstance(value.get("index"), int):
                    found.add(value["index"])
                todo.append(value)
        return found

    def has_alpha(self, index: int) -> bool:
        """Whether material `index` asks for alpha MASK or BLEND."""
        return self.item("materials", index).get("alphaMode") in ("MASK", "BLEND")

    # --------------------------------------------------------------- geometry

    def primitives(self, mesh: int) -> Iterator[GltfPrimitive | None]:
        """The mesh's primitives in file order; None for one that is not a triangle list."""
        entries = self.item("meshes", mesh).get("primitives", [])
        if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
            raise self.error(f"meshes[{mesh}].primitives is not a list of objects; export again")
        for number, entry in enumerate(entries):
            where = f"meshes[{mesh}].primitives[{number}]"
            if entry.get("mode", TRIANGLES) != TRIANGLES:
                yield None
                continue
            yield self._primitive(entry, where)

    def _primitive(self, entry: dict[str, Any], where: str) -> GltfPrimitive:
        attributes = self._object(entry, "attributes", where)
        if "POSITION" not in attributes:
            raise self.error(f"{where} has no POSITION; expected one for each vertex: export again")
        positions = self._vectors(attributes["POSITION"], f"{where} POSITION")
        normals = colors = None
        if "NORMAL" in attributes:
            normals = self._vectors(attributes["NORMAL"], f"{where} NORMAL")
        if "COLOR_0" in attributes:
            colors = self._colors(attributes["COLOR_0"], f"{where} COLOR_0")
        material = entry.get("material")
        if material is not None:
            self.item("materials", material)
        faces = self._faces(entry.get("indices"), len(positions), where)
        return GltfPrimitive(positions, faces, normals, colors, material)

    def _vectors(self, index: Any, where: str) -> F32Array:
        array = self.accessor(index, where)
        if array.dtype != np.float32 or array.shape[1] != 3:
            raise self.error(
                f"{where} is {array.shape[1]} × {array.dtype}; expected VEC3 of float32: export "
                "without quantisation"
            )
        return array

    def _colors(self, index: Any, where: str) -> F32Array:
        """(n, 3) float32: floats as they are, integers over their greatest value; no alpha."""
        array = self.accessor(index, where)
        if array.shape[1] not in (3, 4) or array.dtype.str not in ("|u1", "<u2", "<f4"):
            raise self.error(
                f"{where} is {array.shape[1]} × {array.dtype}; expected VEC3 or VEC4 of float32, "
                "uint8 or uint16: export again"
            )
        return linear_colors(array)

    def _faces(self, index: Any, vertices: int, where: str) -> I32Array:
        if index is None:
            corners: AnyArray = np.arange(vertices, dtype=np.int64)
        else:
            array = self.accessor(index, f"{where} indices", _UNSIGNED)
            if array.shape[1] != 1:
                raise self.error(f"{where} indices are vectors; expected SCALAR: export again")
            corners = array[:, 0].astype(np.int64)
        if len(corners) % 3:
            raise self.error(
                f"{where} has {len(corners)} corners; expected a multiple of 3: export again"
            )
        if len(corners) and corners.max() >= vertices:
            raise self.error(
                f"{where} refers to vertex {corners.max()} of {vertices}; expected 0 to "
                f"{vertices - 1}: the file is damaged, export it again"
            )
        return corners.astype(np.int32).reshape(-1, 3)

    def accessor(self, index: Any, where: str, allowed: tuple[str, ...] = ()) -> AnyArray:
        """Accessor `index` as (count, components), the file's type; `where` names it in errors."""
        entry = self.item("accessors", index)
        if "sparse" in entry:
            raise self.error(f"{where} is a sparse accessor; expected a plain one: export again")
        if "bufferView" not in entry:
            raise self.error(
                f"{where} has no data (compressed?); expected a bufferView: export without Draco "
                "or meshopt compression"
            )
        dtype = _COMPONENTS.get(entry.get("componentType", 0))
        width = _WIDTHS.get(entry.get("type", ""))
        if dtype is None or width is None or (allowed and dtype not in allowed):
            raise self.error(
                f"{where} has component type {entry.get('componentType')} and type "
                f"{entry.get('type')}; expected one that glTF 2.0 allows here: export again"
            )
        view = self.item("bufferViews", entry["bufferView"])
        data = self._buffer(view.get("buffer"))
        start = self._whole(view, "byteOffset", f"{where} bufferView", 0)
        length = self._whole(view, "byteLength", f"{where} bufferView", None)
        offset = self._whole(entry, "byteOffset", where, 0)
        count = self._whole(entry, "count", where, None)
        item = width * np.dtype(dtype).itemsize
        stride = self._whole(view, "byteStride", f"{where} bufferView", 0) or item
        end = offset + (count - 1) * stride + item if count else offset
        if stride < item or end > length or start + length > len(data):
            raise self.error(
                f"{where} needs bytes {start + offset} to {start + end} of a view of {length} and "
                f"a buffer of {len(data)}; expected them inside both: the file is truncated or "
                "damaged, export it again"
            )
        if count == 0:
            return np.empty((0, width), dtype)
        strides = (stride, np.dtype(dtype).itemsize)
        return np.ndarray((count, width), dtype, data, start + offset, strides).copy()

    def _buffer(self, index: Any) -> bytes:
        entry = self.item("buffers", index)
        if index not in self._buffers:
            uri = entry.get("uri")
            if uri is None and index == 0 and self.binary is not None:
                data = self.binary
            elif isinstance(uri, str):
                data = self._resolve(uri)
            else:
                raise self.error(f"buffers[{index}] has no data; expected a uri: export again")
            length = self._whole(entry, "byteLength", f"buffers[{index}]", None)
            if len(data) < length:
                raise self.error(
                    f"buffers[{index}] has {len(data)} bytes; expected {length}: the file is "
                    "truncated, copy or export it again"
                )
            self._buffers[index] = data[:length]
        return self._buffers[index]

    def _resolve(self, uri: str) -> bytes:
        if uri.startswith("data:"):
            head, comma, body = uri.partition(",")
            if not comma or not head.endswith(";base64"):
                raise self.error("a data URI is not base64; expected ';base64,': export again")
            try:
                return base64.b64decode(body, validate=True)
            except (binascii.Error, ValueError):
                raise self.error("a data URI is broken; expected base64: export again") from None
        if "://" in uri or uri.startswith("/"):
            raise self.error(f"buffer '{uri}' is not beside the file; expected a relative path")
        beside = self.path.parent / unquote(uri)
        try:
            if not beside.is_file():
                raise self.error(
                    f"buffer '{uri}' is missing; expected it beside the file: copy it there, or "
                    "export as .glb"
                )
            return beside.read_bytes()
        except (OSError, ValueError) as error:
            raise self.error(f"buffer '{uri}' cannot be read ({error}); check it") from None


def read_gltf(path: Path, data: bytes) -> Gltf:
    """Parse the bytes of a .glb or .gltf file; which of the two is decided by its first bytes.

    Raises FileError for broken JSON, a version other than 2, a truncated GLB, or a required
    extension that changes the geometry.
    """
    text, binary = _chunks(path, data) if data[:4] == b"glTF" else (data, None)
    try:
        root = json.loads(text.strip(b"\x00").decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise file_error(
            path,
            f"is not a glTF file (JSON: {error}); expected glTF 2.0: check the file, or export it "
            "again",
        ) from None
    asset = root.get("asset") if isinstance(root, dict) else None
    version = asset.get("version") if isinstance(asset, dict) else None
    if not str(version).startswith("2."):
        raise file_error(path, f"has glTF version {version}; expected 2.0: export it again")
    gltf = Gltf(path, root, binary)
    for extension in gltf.items("extensionsRequired"):
        if not str(extension).startswith(_HARMLESS):
            raise gltf.error(
                f"requires the extension {extension}; expected plain glTF 2.0 geometry: export "
                "without compression, quantisation or other required extensions"
            )
    return gltf


def _chunks(path: Path, data: bytes) -> tuple[bytes, bytes | None]:
    """JSON and binary chunk of a GLB."""
    version, length = (int(v) for v in np.frombuffer(data[4:12].ljust(8, b"\0"), "<u4"))
    if len(data) < 20 or length > len(data):
        raise file_error(
            path,
            f"is a GLB of {len(data)} bytes; expected {length} by its header: the file is "
            "truncated, copy or export it again",
        )
    if version != 2:
        raise file_error(path, f"is a GLB of version {version}; expected 2: export it again")
    chunks: dict[int, bytes] = {}
    at = 12
    while at + 8 <= length:
        size, kind = (int(v) for v in np.frombuffer(data[at : at + 8], "<u4"))
        if at + 8 + size > length:
            raise file_error(
                path,
                f"has a GLB chunk of {size} bytes where {length - at - 8} are left; expected it "
                "inside the file: the file is truncated, copy or export it again",
            )
        chunks.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if _JSON_CHUNK not in chunks:
        raise file_error(path, "is a GLB without a JSON chunk; expected glTF 2.0: export it again")
    return chunks[_JSON_CHUNK], chunks.get(_BIN_CHUNK)


def linear_colors(raw: AnyArray) -> F32Array:
    """(n, 3) float32 of (n, 3 or more) colours, taken as linear RGB.

    Floats keep their value; integers are divided by the greatest value of their type.
    """
    rgb = raw[:, :3]
    if rgb.dtype.kind in "iu":
        return rgb.astype(np.float32) / np.float32(np.iinfo(rgb.dtype).max)
    with np.errstate(over="ignore"):
        return rgb.astype(np.float32)

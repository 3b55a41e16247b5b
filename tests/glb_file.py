"""A GLB under construction, for tests that need a file with one thing in it."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from ssr_ref.meshfiles.images import png_bytes
from ssr_ref.texture import Image

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
COMPONENT = {"|i1": 5120, "|u1": 5121, "<i2": 5122, "<u2": 5123, "<u4": 5125, "<f4": 5126}
WIDTH = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class Glb:
    """A GLB under construction: `root` is its JSON, `add` appends an array as an accessor."""

    def __init__(self, **root: Any) -> None:
        self.root: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, **root}
        self.root.update(accessors=[], bufferViews=[], meshes=[])
        self.data = b""

    def add(self, array: Any, *, stride: int = 0, offset: int = 0, **more: Any) -> int:
        """Append an array; with a stride, its rows lie apart, the gaps full of 0xAB."""
        array = np.asarray(array)
        array = array.reshape(len(array), -1) if array.ndim < 2 else array
        rows = [row.tobytes() for row in array]
        raw = b"\xab" * offset + b"".join(row.ljust(stride, b"\xab") for row in rows)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw)}
        if stride:
            view["byteStride"] = stride
        self.data += raw.ljust(len(raw) + -len(raw) % 4, b"\0")
        self.root["bufferViews"].append(view)
        accessor = {
            "bufferView": len(self.root["bufferViews"]) - 1,
            "componentType": COMPONENT[array.dtype.str],
            "count": len(array),
            "type": WIDTH[array.shape[1]],
            **more,
        }
        if offset:
            accessor["byteOffset"] = offset
        self.root["accessors"].append(accessor)
        return len(self.root["accessors"]) - 1

    def embed(self, raw: bytes) -> int:
        """Append plain bytes; the index of their buffer view."""
        self.root["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw)}
        )
        self.data += raw.ljust(len(raw) + -len(raw) % 4, b"\0")
        return len(self.root["bufferViews"]) - 1

    def mesh(self, *primitives: dict[str, Any], name: str | None = None) -> int:
        self.root["meshes"].append({"primitives": list(primitives)})
        if name:
            self.root["meshes"][-1]["name"] = name
        return len(self.root["meshes"]) - 1

    def triangle(self, **more: Any) -> dict[str, Any]:
        return {"attributes": {"POSITION": self.add(TRIANGLE)}, **more}

    def bytes(self) -> bytes:
        root = self.root | {"buffers": [{"byteLength": len(self.data)}]}
        text = json.dumps(root).encode()
        text += b" " * (-len(text) % 4)
        body = struct.pack("<I4s", len(text), b"JSON") + text
        body += struct.pack("<I4s", len(self.data), b"BIN\0") + self.data
        return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body

    def write(self, path: Path) -> Path:
        path.write_bytes(self.bytes())
        return path


def one_triangle(**root: Any) -> Glb:
    glb = Glb(nodes=[{"mesh": 0}], scenes=[{"nodes": [0]}], **root)
    glb.mesh(glb.triangle())
    return glb


def with_png(glb: Glb, pixels: Any = None, **image: Any) -> int:
    """Embed an RGBA image (by default 1 x 1) as PNG; the index of its entry in `images`."""
    pixels = np.full((1, 1, 4), 200, np.uint8) if pixels is None else np.asarray(pixels)
    view = glb.embed(png_bytes(Image("embedded", pixels)))
    glb.root.setdefault("images", []).append({"bufferView": view, "mimeType": "image/png", **image})
    return len(glb.root["images"]) - 1

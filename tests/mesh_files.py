"""Small mesh files for tests, and what their tests share."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ssr_ref.errors import FileError
from ssr_ref.meshfiles.images import png_bytes
from ssr_ref.meshfiles.meshes import load_mesh
from ssr_ref.meshfiles.options import LoadOptions
from ssr_ref.scene import Primitive, Scene
from ssr_ref.texture import Image


def same_bits(a: Any, b: Any) -> bool:
    a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


def fails(path: Path, *words: str, call: Callable[..., Any] = load_mesh, **options: Any) -> str:
    """The one line of the FileError that `call(path)` must raise, with all of `words` in it."""
    with pytest.raises(FileError) as caught:
        call(path, **options)
    message = str(caught.value)
    assert "\n" not in message
    assert "expected" in message
    assert len(message) < 700
    for word in words:
        assert word in message, message
    return message


def strict(path: Path) -> Scene:
    """Load strictly."""
    return load_mesh(path, LoadOptions(strict=True))


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8", newline="")
    return path


def write_image(path: Path, pixels: Any) -> Path:
    """A PNG of (H, W, 3 or 4) codes."""
    pixels = np.asarray(pixels)
    if pixels.shape[2] == 3:
        full = np.full((*pixels.shape[:2], 1), np.iinfo(pixels.dtype).max, pixels.dtype)
        pixels = np.concatenate([pixels, full], axis=2)
    path.write_bytes(png_bytes(Image(path.name, pixels)))
    return path


def corners(primitive: Primitive, name: str = "positions") -> list[Any]:
    """What each triangle's corners have, as nested lists."""
    array = getattr(primitive, name)
    assert array is not None
    return array[primitive.faces].tolist()


def only(scene: Scene) -> Primitive:
    """The one primitive of a scene."""
    (mesh,) = scene.meshes
    (primitive,) = mesh.primitives
    return primitive


def binary_stl(triangles: Any, *, header: bytes = b"", attribute: int = 0) -> bytes:
    """A binary STL of (n, 3, 3) corners, with facet normals that are wrong."""
    rows = b"".join(
        np.array([0.6, 0.0, 0.8], "<f4").tobytes()
        + np.asarray(t, "<f4").tobytes()
        + struct.pack("<H", attribute)
        for t in triangles
    )
    return header.ljust(80, b" ") + struct.pack("<I", len(triangles)) + rows


def ply_header(kind: str, elements: Sequence[tuple[str, int, Sequence[str]]], *more: str) -> bytes:
    """A header; each element is its name, its count and its properties."""
    lines = ["ply", f"format {kind} 1.0", *more]
    for name, count, properties in elements:
        lines += [f"element {name} {count}", *(f"property {p}" for p in properties)]
    return "\n".join([*lines, "end_header\n"]).encode()

"""OFF: polygons with normals, texture coordinates and colours of vertices or faces.

Read here, line by line: trimesh's reader leaves colours and normals out, puts triangles before
larger polygons, and reads a vertex that is broken over two lines as two vertices.

Colours written as whole numbers (one of them above 1) are sRGB codes and decoded; others are linear
from 0 to 1 as they are. 4-dimensional, n-dimensional and binary OFF are refused.

Source: Geomview manual, "OFF Files".
"""

from __future__ import annotations

import io
import re
from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import FileError
from ..scene import Material, Scene
from ..typed import F32Array, F64Array, I64Array
from .building import (
    WHITE,
    Attributes,
    Findings,
    Part,
    assemble,
    build_primitive,
    check_indices,
    checked_colors,
    file_error,
    float32,
)
from .colors import linear_from_codes
from .options import LoadOptions

_MAGIC = re.compile(rb"(ST)?(C)?(N)?(4)?(n)?OFF")


class _Lines:
    """Lines with something on them, without comments; `number` is the last one's."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path = path
        self.number = 0
        self._lines = self._read(data)

    def _read(self, data: bytes) -> Iterator[list[bytes]]:
        if b"\n" not in data:
            data = data.replace(b"\r", b"\n")
        for self.number, line in enumerate(io.BytesIO(data.removeprefix(b"\xef\xbb\xbf")), 1):
            words = line.partition(b"#")[0].split()
            if words:
                yield words

    def next(self, what: str) -> list[bytes]:
        """The next line's words; raises FileError, which says what is missing, at the end."""
        words = next(self._lines, None)
        if words is None:
            raise file_error(
                self.path,
                f"ends before {what}; expected what its counts say: the file is truncated, copy or "
                "export it again",
            )
        return words

    def error(self, words: list[bytes], expected: str) -> FileError:
        """An error about the last line."""
        text = b" ".join(words)[:60].decode("utf-8", "replace")
        return file_error(
            self.path,
            f"line {self.number} has '{text}'; expected {expected}: repair it or export it again",
        )


def load_off(path: Path, data: bytes, options: LoadOptions) -> Scene:
    """An OFF file as one object. Raises FileError (one line)."""
    lines = _Lines(path, data)
    words = lines.next("its header")
    magic = _MAGIC.fullmatch(words[0])
    if magic is None or magic[4] or magic[5] or words[1:2] == [b"BINARY"]:
        raise lines.error(words[:3], "OFF, COFF, NOFF or STOFF as text: convert it")
    counts = words[1:] or lines.next("its counts")
    try:
        vertex_count, face_count = (int(word) for word in counts[:2])
        if vertex_count < 0 or face_count < 0 or vertex_count + face_count > len(data):
            raise ValueError
    except ValueError:
        raise lines.error(counts, "numbers of vertices and faces that the file can hold") from None
    has_normals, has_uv = magic[3] is not None, magic[1] is not None
    findings = Findings()
    rows, extra = _vertices(lines, vertex_count, 3 + 3 * has_normals + 2 * has_uv)
    sizes, corners, face_colors = _faces(lines, face_count)
    check_indices(corners, vertex_count)
    colors = None
    columns = [corners]
    if extra is not None and magic[2]:
        colors = (_linear(extra, findings), 0)
    elif extra is not None:
        findings.unsupported.append(f"{extra.shape[1]} more numbers of each vertex")
    if face_colors is not None:
        if colors is None and len(face_colors) == len(sizes):
            colors = (_linear(face_colors, findings), 1)
            columns.append(np.repeat(np.arange(len(sizes)), sizes))
        else:
            findings.unsupported.append(f"colours of {len(face_colors)} faces")
    primitive = build_primitive(
        float32(rows[:, :3]),
        sizes,
        np.stack(columns, axis=1),
        Attributes(
            normals=(float32(rows[:, 3:6]), 0) if has_normals else None,
            colors=colors,
            uv0=(float32(rows[:, -2:]), 0) if has_uv else None,
        ),
        0,
        findings,
    )
    material = Material() if colors is None else Material(base_color=WHITE)
    found = f"{vertex_count} vertices, {face_count} faces"
    parts = [Part(path.stem, primitive)]
    return assemble(path, "OFF", parts, [material], [], findings, found)


def _vertices(lines: _Lines, count: int, width: int) -> tuple[F64Array, F64Array | None]:
    """(count, width) numbers of each vertex, and (count, 3) what may be colours, if all have it.

    Colours stand between the coordinates (and normals) and the texture coordinates; alpha is left.
    """
    values, colors = array("d"), array("d")
    for i in range(count):
        words = lines.next(f"vertex {i} of {count}")
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            numbers = []
        if len(numbers) < width:
            raise lines.error(words, f"a vertex of {width} numbers")
        last = 2 if width in (5, 8) else 0
        spare = numbers[width - last : len(numbers) - last]
        values.extend(numbers[: width - last])
        values.extend(numbers[len(numbers) - last :] if last else ())
        if len(spare) >= 3:
            colors.extend(spare[:3])
    complete = count > 0 and len(colors) == 3 * count
    return (
        np.frombuffer(values).reshape(-1, width),
        np.frombuffer(colors).reshape(-1, 3) if complete else None,
    )


def _faces(lines: _Lines, count: int) -> tuple[I64Array, I64Array, F64Array | None]:
    """Sizes, all corners, and (faces with a colour, 3) colours."""
    sizes, corners, colors = array("q"), array("q"), array("d")
    for i in range(count):
        words = lines.next(f"face {i} of {count}")
        try:
            size = int(words[0])
            indices = [int(word) for word in words[1 : 1 + max(size, 0)]]
            color = [float(word) for word in words[1 + max(size, 0) :]]
            corners.extend(indices)
        except (ValueError, OverflowError):
            size, indices, color = -1, [], []
        if size < 0 or len(indices) != size:
            raise lines.error(words, "a number of corners and as many indices")
        sizes.append(size)
        if len(color) >= 3:
            colors.extend(color[:3])
    return (
        np.frombuffer(sizes, np.int64),
        np.frombuffer(corners, np.int64),
        np.frombuffer(colors).reshape(-1, 3) if colors else None,
    )


def _linear(colors: F64Array, findings: Findings) -> F32Array:
    codes = (colors == np.floor(colors)).all() and 1.0 < colors.max(initial=0.0) <= 255.0
    if codes and colors.min() >= 0.0:
        return linear_from_codes(colors.astype(np.uint8))
    return checked_colors(float32(colors), findings)

"""Wavefront OBJ: polygons, groups of materials, authored normals, texture coordinates, colours.

The text is read here, line by line: trimesh's reader counts negative indices from the end of the
file, needs single spaces, reads only the first `mtllib`, misreads groups that mix kinds of corners,
rounds material and vertex colours to bytes and orders split vertices by an unstable sort.

An `o` statement is an object (a node); `g` only names, since exporters use it for materials and
smoothing as well. Colours are linear RGB as they stand, `v x y z r g b` like MTL's Kd: OBJ defines
no encoding, both are floats, and one rule for the whole file keeps equal numbers equal.

Source: Alias/Wavefront, "Object Files (.obj)", version 3.0.
"""

from __future__ import annotations

import io
import re
from array import array
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import FileError
from ..scene import Material, Primitive, Scene
from ..typed import AnyArray, F32Array, I64Array
from .building import (
    WHITE,
    Attributes,
    Findings,
    Part,
    assemble,
    build_primitive,
    check_parts,
    checked_colors,
    file_error,
    float32,
)
from .mtl import MtlLibrary
from .options import LoadOptions

_ROWS = (b"v", b"vt", b"vn")
_WIDTHS = {b"v": 3, b"vt": 2, b"vn": 3}
_IGNORED = {b"g", b"s", b"lod", b"bevel", b"c_interp", b"d_interp", b"shadow_obj", b"trace_obj"}
_CURVES = {b"curv", b"curv2", b"surf", b"vp", b"cstype", b"deg", b"bmat", b"step", b"parm", b"trim"}
_CURVES |= {b"hole", b"scrv", b"sp", b"end", b"con", b"mg", b"ctech", b"stech", b"bzp", b"bsp"}
_CURVES |= {b"res", b"cdc", b"cdp", b"call", b"csh", b"maplib", b"usemap"}


def _kind(corner: str, *keys: bytes) -> tuple[tuple[bytes, ...], re.Pattern[bytes]]:
    """What a kind of corner indexes, and the text of a face of three or more of them.

    18 digits fit into 64 bits; an index of so many is refused later.
    """
    corner = corner.replace("i", r"[-+]?\d{1,18}")
    return keys, re.compile(rf"{corner}(?:\s+{corner}){{2,}}\s*".encode())


_KINDS = (
    _kind("i", b"v"),
    _kind("i/i", b"v", b"vt"),
    _kind("i//i", b"v", b"vn"),
    _kind("i/i/i", b"v", b"vt", b"vn"),
)


class _Section(NamedTuple):
    """Faces of one object, material and kind of corner: what the corners index."""

    owner: str
    material: str | None
    keys: tuple[bytes, ...]


class _Obj:
    """The numbers and faces of an OBJ file; every error names the line."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path = path
        self.rows: dict[bytes, array[float]] = {key: array("d") for key in _ROWS}
        self.colors: array[float] = array("d")
        self.sections: dict[_Section, tuple[array[int], array[int]]] = {}
        self.libraries: list[str] = []
        self.small = Counter[int]()  # line → faces of fewer than three corners
        self.lines = 0  # l and p statements
        self.curves: set[str] = set()
        self.unknown = Counter[bytes]()
        self.smoothing = False
        self._counts = dict.fromkeys(_ROWS, 0)
        self._furthest = dict.fromkeys(_ROWS, (0, 0))  # greatest index and its line
        self._kind = _KINDS[0]  # of the face before
        self._number = 0
        owner, material = path.stem, None
        for line in self._statements(data):
            keyword, *others = line.split(None, 1)
            rest = others[0] if others else b""
            if keyword in self.rows:
                self._row(keyword, rest)
            elif keyword == b"f":
                self._face(rest, owner, material)
            elif keyword in (b"o", b"usemtl", b"mtllib"):
                name = rest.strip().decode("utf-8", "replace")
                if keyword == b"o":
                    owner = name or path.stem
                elif keyword == b"usemtl":
                    material = name or None
                else:
                    self.libraries.append(name)
            elif keyword in (b"l", b"p"):
                self.lines += 1
            elif keyword in _IGNORED:
                self.smoothing |= keyword == b"s" and rest.split() not in ([b"off"], [b"0"], [])
            elif keyword in _CURVES:
                self.curves.add(keyword.decode())
            elif len(self.unknown) < 1000:
                self.unknown[keyword[:20]] += 1
        for key, (index, number) in self._furthest.items():
            if index > self._counts[key]:
                self._number = number
                raise self._error(
                    f"refers to {key.decode()} {index}", f"1 to {self._counts[key]}, what there is"
                )

    def _statements(self, data: bytes) -> Iterator[bytes]:
        """Lines that are not blank, without comments, continued ones joined.

        A comment ends with its line, so that a Windows path in one swallows nothing.
        """
        if b"\n" not in data:
            data = data.replace(b"\r", b"\n")
        pending: list[bytes] = []
        start = 0
        for number, raw in enumerate(io.BytesIO(data.removeprefix(b"\xef\xbb\xbf")), 1):
            line = raw.strip()
            if line.startswith(b"#") or not (line or pending):
                continue
            start = start if pending else number
            if line.endswith(b"\\"):
                pending.append(line[:-1])
                continue
            if pending:
                line = b" ".join([*pending, line])
                pending = []
            if line.strip():
                self._number = start
                yield line
        if pending and b" ".join(pending).strip():
            self._number = start
            yield b" ".join(pending)

    def _row(self, keyword: bytes, rest: bytes) -> None:
        if b"#" in rest:
            rest = rest.partition(b"#")[0]
        width = _WIDTHS[keyword]
        try:
            numbers = list(map(float, rest.split()))
        except ValueError:
            raise self._error(f"has '{_shown(rest)}'", "numbers") from None
        if keyword == b"vt" and len(numbers) == 1:
            numbers.append(0.0)
        if len(numbers) < width:
            raise self._error(f"has a {keyword.decode()} of {len(numbers)} numbers", f"{width}")
        self._counts[keyword] += 1
        self.rows[keyword].extend(numbers[:width])
        if keyword == b"v" and len(numbers) >= 6:
            self.colors.extend(numbers[3:6])

    def _face(self, rest: bytes, owner: str, material: str | None) -> None:
        if not self._kind[1].fullmatch(rest):
            rest = b" ".join(word.rstrip(b"/") for word in rest.partition(b"#")[0].split())
            self._kind = next((kind for kind in _KINDS if kind[1].fullmatch(rest)), self._kind)
            if not self._kind[1].fullmatch(rest):
                if len(rest.split()) < 3:
                    self.small[self._number] += 1
                    return
                raise self._error(
                    f"has the face '{_shown(rest)}'", "corners of one kind: 1, 1/2, 1//3 or 1/2/3"
                )
        keys = self._kind[0]
        indices = list(map(int, rest.replace(b"/", b" ").split()))
        for k, key in enumerate(keys):
            column = indices[k :: len(keys)]
            if min(column) < 1:
                indices[k :: len(keys)] = column = self._absolute(key, column)
            if max(column) > self._furthest[key][0]:
                self._furthest[key] = (max(column), self._number)
        section = _Section(owner, material, keys)
        if section not in self.sections:
            self.sections[section] = (array("i"), array("q"))
            check_parts(self.path, len(self.sections))
        sizes, corners = self.sections[section]
        sizes.append(len(indices) // len(keys))
        corners.extend(indices)

    def _absolute(self, key: bytes, column: list[int]) -> list[int]:
        """Indices from 1, negative ones counted back from the rows read so far."""
        count = self._counts[key]
        if 0 in column or min(column) < -count:
            raise self._error(
                f"refers to {key.decode()} {0 if 0 in column else min(column)}",
                f"1 to {count}, or -1 to {-count}",
            )
        return [count + 1 + i if i < 0 else i for i in column]

    def _error(self, found: str, expected: str) -> FileError:
        return file_error(
            self.path,
            f"line {self._number} {found}; expected {expected}: repair it or export it again",
        )

    def table(self, key: bytes) -> F32Array:
        """All rows of `v`, `vt` or `vn` as float32."""
        return float32(np.frombuffer(self.rows[key]).reshape(-1, _WIDTHS[key]))


def _shown(text: bytes) -> str:
    return b" ".join(text[:60].split()).decode("utf-8", "replace")


def load_obj(path: Path, data: bytes, options: LoadOptions) -> Scene:
    """An OBJ file with its MTL libraries and textures. Raises FileError (one line)."""
    obj = _Obj(path, data)
    findings = Findings()
    library = MtlLibrary(path, obj.libraries, options, findings)
    tables = {key: obj.table(key) for key in _ROWS}
    colors = _colors(obj, len(tables[b"v"]), findings)
    materials: dict[Material, int] = {}
    parts = []
    for section, (sizes, corners) in obj.sections.items():
        material = library.material(section.material, has_uv=b"vt" in section.keys)
        if material is None:
            material = Material() if colors is None else Material(base_color=WHITE)
        primitive = _primitive(section, sizes, corners, tables, colors, findings)
        number = materials.setdefault(material, len(materials))
        parts.append(Part(section.owner, replace(primitive, material=number)))
    _report(obj, findings)
    return assemble(
        path,
        "OBJ",
        parts,
        list(materials),
        library.images,
        findings,
        f"{len(tables[b'v'])} vertices, no faces",
    )


def _primitive(
    section: _Section,
    sizes: array[int],
    corners: array[int],
    tables: dict[bytes, F32Array],
    colors: F32Array | None,
    findings: Findings,
) -> Primitive:
    keys = section.keys
    columns: I64Array = np.frombuffer(corners, np.int64).reshape(-1, len(keys)) - 1
    attributes = Attributes(
        normals=(tables[b"vn"], len(keys) - 1) if b"vn" in keys else None,
        colors=None if colors is None else (colors, 0),
        uv0=(tables[b"vt"], 1) if b"vt" in keys else None,
    )
    lengths: AnyArray = np.frombuffer(sizes, np.int32)
    return build_primitive(tables[b"v"], lengths.astype(np.int64), columns, attributes, 0, findings)


def _colors(obj: _Obj, count: int, findings: Findings) -> F32Array | None:
    found = len(obj.colors) // 3
    if found == 0:
        return None
    if found < count:
        findings.unsupported.append(f"vertex colours: {count - found} vertices have none")
        return None
    return checked_colors(float32(np.frombuffer(obj.colors).reshape(-1, 3)), findings)


def _report(obj: _Obj, findings: Findings) -> None:
    small = sum(obj.small.values())
    if small:
        where = f" (the first in line {next(iter(obj.small))})"
        findings.skip(
            small, "face of fewer than 3 corners" + where, "faces of fewer than 3 corners" + where
        )
    findings.skip(obj.lines, "line or point (l, p)", "lines or points (l, p)")
    if obj.unknown:
        keyword = next(iter(obj.unknown)).decode("ascii", "backslashreplace")
        findings.skip(
            sum(obj.unknown.values()),
            f"line with an unknown keyword ('{keyword}')",
            f"lines with an unknown keyword (the first: '{keyword}')",
        )
    if obj.curves:
        findings.unsupported.append("free-form or obsolete: " + ", ".join(sorted(obj.curves)))
    if obj.smoothing and not all(b"vn" in section.keys for section in obj.sections):
        findings.unsupported.append("smoothing groups (s): the crease angle decides")

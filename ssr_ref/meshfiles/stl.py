"""STL, binary and ASCII: a soup of triangles. Facet normals are ignored: corners get their own.

Binary files go through trimesh's reader, whose vertices arrive bit for bit. ASCII text is read
here: trimesh drops a solid without `endsolid`, and fails on one whose name holds "vertex".

Source: 3D Systems, "StereoLithography Interface Specification", 1989.
"""

from __future__ import annotations

import io
from array import array
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError
from ..scene import Material, Primitive, Scene
from .building import Findings, Part, assemble, check_parts, file_error, float32
from .options import LoadOptions

_HEADER = 84
_FACET = 50


def load_stl(path: Path, data: bytes, options: LoadOptions) -> Scene:
    """An STL file; each solid of an ASCII one is an object. Raises FileError (one line)."""
    size = None  # in bytes, if the file is a binary one
    if len(data) >= _HEADER:
        size = _HEADER + _FACET * int.from_bytes(data[_HEADER - 4 : _HEADER], "little")
    findings = Findings()
    if size == len(data):
        parts = [Part(path.stem, _binary(data, findings))]
    else:
        parts = _ascii(path, data, findings)
    what = f"{len(data)} bytes: no complete ASCII facet"
    if size is not None:
        what += f", and a binary file with this header has {size}"
    return assemble(path, "STL", parts, [Material()], [], findings, what)


def _soup(vertices: Any) -> Primitive:
    positions = float32(vertices).reshape(-1, 3)
    return Primitive(positions, np.arange(len(positions), dtype=np.int32).reshape(-1, 3))


def _binary(data: bytes, findings: Findings) -> Primitive:
    from trimesh.exchange.stl import load_stl_binary

    found = load_stl_binary(io.BytesIO(data))
    if "vertices" not in found:
        return _soup(np.zeros((0, 3)))
    if found["face_attributes"]["stl"].any():
        findings.unsupported.append("attribute bytes of facets (colours of some programs)")
    return _soup(found["vertices"])


def _ascii(path: Path, data: bytes, findings: Findings) -> list[Part]:
    solids: dict[str, array[float]] = {}
    name, loop, unknown, repeated = path.stem, array("d"), 0, 0
    for number, line in enumerate(io.BytesIO(data), 1):
        words = line.split()
        keyword = words[0].lower() if words else b""
        if keyword == b"vertex":
            try:
                x, y, z = (float(word) for word in words[1:])
            except ValueError:
                text = line.strip()[:60].decode("ascii", "replace")
                raise _bad_line(
                    path, number, f"has '{text}'", "a vertex of three numbers"
                ) from None
            loop.extend((x, y, z))
        elif keyword == b"endloop":
            if len(loop) != 9:
                found = f"ends a loop of {len(loop) // 3} vertices"
                raise _bad_line(path, number, found, "3: STL holds triangles only")
            solids.setdefault(name, array("d")).extend(loop)
            check_parts(path, len(solids))
            loop = array("d")
        elif keyword == b"solid":
            name = line.strip()[5:].strip().decode("utf-8", "replace") or path.stem
            if name in solids:  # a solid of its own all the same
                repeated += 1
                name = f"{name} {len(solids)}.{repeated}"
        elif keyword not in (b"", b"facet", b"outer", b"endfacet", b"endsolid"):
            unknown += 1
    if loop and solids:
        raise file_error(
            path,
            "ends within a facet; expected complete ones: the file is truncated, copy or export it "
            "again",
        )
    findings.skip(unknown, "line with an unknown keyword", "lines with an unknown keyword")
    return [Part(name, _soup(np.frombuffer(v))) for name, v in solids.items()]


def _bad_line(path: Path, number: int, found: str, expected: str) -> FileError:
    return file_error(
        path, f"line {number} {found}; expected {expected}: repair it or export it again"
    )

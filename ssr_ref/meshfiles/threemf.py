"""3MF: meshes, components and build items of the core specification, in the file's own unit.

The archive is untrusted: what it says it unpacks to is checked before anything is unpacked, and
what it does unpack to is cut off there; a document type (entities) is refused. The XML is read as a
stream. It is read by ourselves: trimesh's reader needs two more packages, multiplies transforms
through BLAS and leaves colours out without a word.

Colours, textures, slices and beams are not drawn, and reported.

Source: 3MF Core Specification 1.3, chapters 2 (package) to 4 (objects).
"""

from __future__ import annotations

import io
import zipfile
import zlib
from array import array
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np

from .. import transforms
from ..errors import FileError
from ..scene import Material, Mesh, Node, Primitive, Scene
from ..typed import F64Array
from .building import Findings, file_error, no_triangles, with_report
from .options import LoadOptions

MAX_UNPACKED = 2**30
"""Bytes that all files of the archive may unpack to, together."""

MAX_MODEL = 2**28
"""Bytes of the model's XML."""

MAX_RATIO = 200
"""Most bytes that one of the archive may unpack to; 3MF text reaches about 20."""

MAX_PLACES = 10_000
MAX_DEPTH = 64
"""Placed objects, and components within one another; more are refused."""

UNITS = {
    "micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048,
    "meter": 1.0,
}  # fmt: skip
"""Metres in one unit (core specification, 3.4)."""

_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
_MODEL = "3d/3dmodel.model"
_CHUNK = 2**20


@dataclass(slots=True)
class _Object:
    """A resource: a mesh, or components (object's id, its transform)."""

    name: str
    kind: str
    vertices: array[float] = field(default_factory=lambda: array("f"))
    triangles: array[int] = field(default_factory=lambda: array("i"))
    components: list[tuple[str, F64Array]] = field(default_factory=list)


@dataclass(slots=True)
class _Model:
    """What the model part holds."""

    unit: str = "millimeter"
    objects: dict[str, _Object] = field(default_factory=dict)
    items: list[tuple[str, F64Array]] = field(default_factory=list)
    others: Counter[str] = field(default_factory=Counter)
    current: _Object | None = None


def load_3mf(path: Path, data: bytes, options: LoadOptions) -> Scene:
    """A 3MF file; each mesh of a build item is an object. Raises FileError (one line)."""
    model = _parse(path, data)
    unit = 1.0 if options.unit else UNITS.get(model.unit, 0.0)
    if not unit:
        raise file_error(
            path, f"has the unit '{model.unit[:40]}'; expected one of {', '.join(UNITS)}: repair it"
        )
    findings = Findings()
    for name, count in sorted(model.others.items()):
        findings.unsupported.append(f"{count} elements '{name}'")
    nodes: list[Node] = []
    meshes: list[Mesh] = []
    place: dict[str, int | None] = {}
    root = transforms.scaling(unit, unit, unit)
    skipped = 0
    _check_tree(path, model)
    for item, matrix in model.items:
        todo = [(item, transforms.multiply(root, matrix))]
        while todo:
            identifier, world = todo.pop()
            found = model.objects[identifier]
            if found.kind in ("support", "other"):
                skipped += 1
                continue
            if identifier not in place:
                place[identifier] = None
                if found.triangles:
                    place[identifier] = len(meshes)
                    meshes.append(Mesh(found.name, (_primitive(found),)))
            number = place[identifier]
            if number is not None:
                nodes.append(Node(found.name, number, world))
            for child, transform in reversed(found.components):
                todo.append((child, transforms.multiply(world, transform)))
    findings.skip(skipped, "support object", "support objects")
    if not nodes:
        raise no_triangles(path, f"{len(model.objects)} objects, {len(model.items)} build items")
    return with_report(path, "3MF", tuple(meshes), tuple(nodes), [Material()], [], findings)


def _check_tree(path: Path, model: _Model) -> None:
    """Raise FileError unless the build items place at most MAX_PLACES objects, none in itself."""
    places: dict[str, int] = {}

    def count(identifier: str, depth: int) -> int:
        found = model.objects.get(identifier)
        if found is None:
            raise file_error(
                path,
                f"refers to the object '{identifier[:40]}', which is missing; expected one of "
                f"{len(model.objects)}: export it again",
            )
        if depth > MAX_DEPTH:
            raise file_error(
                path,
                f"has components deeper than {MAX_DEPTH}, or in themselves; expected a tree: "
                "repair it",
            )
        if identifier not in places:
            below = sum(count(c, depth + 1) for c, _ in found.components)
            places[identifier] = min(1 + below, MAX_PLACES + 1)  # a chain can double it each time
        return places[identifier]

    total = sum(count(identifier, 0) for identifier, _ in model.items)
    if total > MAX_PLACES:
        raise file_error(
            path,
            f"places {total} objects or more; expected at most {MAX_PLACES}: merge or remove some",
        )


def _primitive(found: _Object) -> Primitive:
    positions = np.frombuffer(found.vertices, np.float32).reshape(-1, 3)
    return Primitive(positions, np.frombuffer(found.triangles, np.int32).reshape(-1, 3))


# --------------------------------------------------------------------- archive


def _parse(path: Path, data: bytes) -> _Model:
    model = _Model()
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            infos = archive.infolist()
            _check_size(path, infos)
            info = next((i for i in infos if i.filename.lower().lstrip("/") == _MODEL), None)
            if info is None:
                raise file_error(path, "has no 3D/3dmodel.model; expected a 3MF: export it again")
            if info.file_size > MAX_MODEL:
                raise file_error(
                    path,
                    f"has a model of {info.file_size} bytes; expected up to {MAX_MODEL}: split it",
                )
            with archive.open(info) as file:
                _parse_xml(path, file, info.file_size, model)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise file_error(
            path, f"is no readable zip archive ({error}); expected a 3MF: export it again"
        ) from None
    return model


def _check_size(path: Path, infos: list[zipfile.ZipInfo]) -> None:
    total = sum(info.file_size for info in infos)
    worst = max((i.file_size / max(i.compress_size, 1) for i in infos), default=0.0)
    if total > MAX_UNPACKED or worst > MAX_RATIO:
        raise file_error(
            path,
            f"unpacks to {total} bytes, up to {worst:.0f} for each packed; expected at most "
            f"{MAX_UNPACKED} and {MAX_RATIO}: it may be a zip bomb, export it again",
        )


def _parse_xml(path: Path, file: Any, size: int, model: _Model) -> None:
    parser = expat.ParserCreate(namespace_separator=" ")

    def refuse(*_: Any) -> None:
        raise file_error(path, "has a document type in its XML; expected none, as 3MF demands")

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = lambda name, found: _start(path, model, name, found)
    parser.EndElementHandler = lambda name: _end(model, name)
    try:
        read = 0
        while chunk := file.read(_CHUNK):
            read += len(chunk)
            if read > size:
                raise file_error(path, "unpacks to more than it says; expected a sound archive")
            parser.Parse(chunk, False)
        parser.Parse(b"", True)
    except (expat.ExpatError, KeyError, ValueError, OverflowError) as error:
        raise file_error(
            path,
            f"has broken XML near line {parser.CurrentLineNumber} ({str(error)[:80]}); expected a "
            "3MF model: export it again",
        ) from None


def _start(path: Path, model: _Model, name: str, found: dict[str, str]) -> None:
    space, _, tag = name.rpartition(" ")
    current = model.current
    if space not in (_CORE, ""):
        model.others[tag] += 1
    elif tag == "vertex" and current is not None:
        current.vertices.extend([float(found["x"]), float(found["y"]), float(found["z"])])
    elif tag == "triangle" and current is not None:
        indices = [int(found["v1"]), int(found["v2"]), int(found["v3"])]
        count = len(current.vertices) // 3
        if min(indices) < 0 or max(indices) >= count:
            raise _bad_index(path, current, indices, count)
        current.triangles.extend(indices)
        if "pid" in found:
            model.others["triangle pid (colour)"] += 1
    elif tag == "object":
        model.current = _Object(found.get("name") or found["id"], found.get("type", "model"))
        model.objects[found["id"]] = model.current
        if "pid" in found:
            model.others["object pid (colour)"] += 1
    elif tag == "component" and current is not None:
        if any(key.endswith(" path") for key in found):
            raise file_error(path, "keeps objects in other parts; expected one model: export again")
        current.components.append((found["objectid"], _matrix(found.get("transform"))))
    elif tag == "item":
        model.items.append((found["objectid"], _matrix(found.get("transform"))))
    elif tag == "model":
        model.unit = found.get("unit", "millimeter")
    elif tag in ("basematerials", "texture2d"):
        model.others[tag] += 1


def _bad_index(path: Path, current: _Object, indices: list[int], count: int) -> FileError:
    wrong = min(indices) if min(indices) < 0 else max(indices)
    return file_error(
        path,
        f"has an object '{current.name[:40]}' with a triangle at vertex {wrong} of {count}; "
        "expected an index in range: export it again",
    )


def _end(model: _Model, name: str) -> None:
    if name.rpartition(" ")[2] == "object":
        model.current = None


def _matrix(text: str | None) -> F64Array:
    """Column form of "m00 m01 m02 m10 ... m32", which acts on row vectors (3MF, 3.3)."""
    out = transforms.identity()
    if text is not None:
        numbers = [float(word) for word in text.split()]
        if len(numbers) != 12:
            raise ValueError(f"a transform of {len(numbers)} numbers")
        out[:3, :] = np.array(numbers).reshape(4, 3).T
    return out

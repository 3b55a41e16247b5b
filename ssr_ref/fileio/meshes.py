"""Mesh files to a `Scene`: GLB and glTF by `gltf.py`, OBJ, PLY and STL through trimesh's readers.

trimesh's readers are called for their arrays, before a `Trimesh` object is made of them: that
object would merge or drop vertices, turn colours into bytes and compute normals nobody wrote.
Numbers are rounded to float32 once, and no transform is applied to a vertex.

Every failure is one FileError line, and no file gives half a scene.
"""

from __future__ import annotations

import contextlib
import io
import logging
import re
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from .._jit import driver
from ..errors import FileError, SceneError, SettingsError
from ..scene import Material, Mesh, Node, Primitive, Scene
from ..typed import F32Array, F64Array, I32Array, I64Array, Rgb
from .gltf import Gltf, GltfPrimitive, file_error, linear_colors, read_gltf
from .gltf_scene import load_gltf
from .options import LoadOptions

NormalsName = Literal["authored", "flat", "smooth"]

_STL_HEADER = 84
_STL_TRIANGLE = 50
_WHITE: Rgb = (1.0, 1.0, 1.0)


def load_mesh(path: str | Path, *, normals: NormalsName = "authored") -> Scene:
    """Load a .glb, .gltf, .obj, .ply or .stl file (any case) as a scene without a view.

    normals : "authored", what the file has (none: flat shading); "flat", none; "smooth",
        area-weighted vertex normals computed in mesh space, see `with_normals`.

    Positions, normals and colours are float32 in mesh space; a GLB's arrive bit for bit, OBJ's,
    PLY's and ASCII STL's decimals or doubles are rounded once. An object is one node: a glTF node,
    an OBJ `o` statement, an STL solid, a PLY file. What is not drawn as the file says is counted in
    `Scene.notes`. Nothing is fetched, and no file is changed.

    Raises FileError (one line: what was found, what was expected, the way out) for a file that is
    missing, unreadable, empty, damaged, of another format, or without a triangle that can be drawn;
    SettingsError for an unknown `normals`.
    """
    _check_normals(normals)
    path = Path(path)
    data = _read(path)
    try:
        scene = with_normals(_LOADERS[path.suffix.lower()](path, data), normals)
        scene.world_bounds()  # raises where no vertex is finite
    except SceneError as error:
        raise file_error(path, str(error)) from None
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise _unreadable(path, error) from None
    return scene


def with_normals(scene: Scene, normals: NormalsName) -> Scene:
    """The scene with the normals asked for; "authored" gives it back as it is.

    "smooth": each vertex gets the unit float32 sum of the cross products (twice the area times the
    normal) of the mesh's faces at its float32 position, in face order, over all its primitives.
    Faces with a non-finite vertex add nothing; a sum of zero stays zero. Raises SettingsError for
    an unknown name.
    """
    _check_normals(normals)
    if normals == "authored":
        return scene
    change = _without_normals if normals == "flat" else _with_smooth_normals
    return replace(scene, meshes=tuple(change(mesh) for mesh in scene.meshes))


def _check_normals(normals: str) -> None:
    if normals not in get_args(NormalsName):
        listed = ", ".join(get_args(NormalsName))
        raise SettingsError(f"normals is {normals!r}; expected one of {listed}")


def _read(path: Path) -> bytes:
    """The file's bytes, checked for all that can be said before they are parsed."""
    known = ", ".join(FORMATS)
    try:
        if path.is_dir():
            raise file_error(path, f"is a directory; expected a mesh file ({known})")
        if not path.exists():
            raise file_error(path, f"no such file; expected a mesh file ({known})")
        if not path.is_file():
            raise file_error(path, "is a device or a pipe; expected a mesh file on disk")
        if path.suffix.lower() not in FORMATS:
            raise file_error(
                path,
                f"has the unknown extension '{path.suffix}'; expected one of {known}: convert it, "
                "or rename it if it is one of these",
            )
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise file_error(
            path, f"cannot be read ({reason}); expected a readable file: check its permissions"
        ) from None
    if not data:
        raise file_error(path, "is empty (0 bytes); expected a mesh: copy or export it again")
    return data


def _unreadable(path: Path, error: Exception) -> FileError:
    kind = path.suffix[1:].upper()
    return file_error(
        path,
        f"cannot be read as {kind} ({type(error).__name__}: {str(error)[:120]}); expected a valid "
        f"{kind} file: it is damaged or of another format, export it again",
    )


def _no_triangles(path: Path, found: str) -> FileError:
    return file_error(
        path,
        f"has no triangles ({found}); expected at least one: point clouds and curves cannot be "
        "drawn",
    )


# ------------------------------------------------------------------------ glTF


def _load_gltf(path: Path, data: bytes) -> Scene:
    gltf = read_gltf(path, data)
    nodes: list[Node] = []
    meshes: list[Mesh] = []
    materials = [gltf.material(i) for i in range(len(gltf.items("materials")))]
    default: int | None = None
    used: set[int] = set()
    counts: Counter[str] = Counter()
    place: dict[int, int | None] = {}  # mesh in the file → mesh in the scene, or nothing to draw
    for found in gltf.mesh_nodes():
        counts["skinned"] += found.skinned
        if found.mesh not in place:
            read = list(gltf.primitives(found.mesh))
            triangles = [p for p in read if p is not None]
            counts["skipped"] += len(read) - len(triangles)
            place[found.mesh] = len(meshes) if triangles or not read else None
            primitives = []
            for primitive in triangles:
                if primitive.material is None and default is None:
                    # The specification's default: every factor is 1.
                    default = len(materials)
                    materials.append(
                        Material("default", base_color=_WHITE, metallic=1.0, roughness=1.0)
                    )
                primitives.append(_from_gltf(gltf, primitive, default, counts))
                used.add(primitives[-1].material)
            if place[found.mesh] is not None:
                name = gltf.item("meshes", found.mesh).get("name") or f"mesh {found.mesh}"
                meshes.append(Mesh(str(name), tuple(primitives)))
        index = place[found.mesh]
        if index is not None:
            nodes.append(Node(found.name, index, found.world_from_mesh))
    used.discard(-1 if default is None else default)
    textures = {texture for i in used for texture in gltf.textures(i)}
    alpha = sum(gltf.has_alpha(i) for i in used)
    notes = [
        *_texture_notes(len(textures)),
        *_note(counts["skipped"], "primitive is", "primitives are", "no triangle list: not drawn"),
        *_note(counts["skinned"], "skinned mesh is", "skinned meshes are", "drawn in bind pose"),
        *_note(alpha, "material with alpha is", "materials with alpha are", "drawn opaque"),
        *_color_notes(counts),
    ]
    if not any(len(p.faces) for node in nodes for p in meshes[node.mesh].primitives):
        raise _no_triangles(
            path,
            f"{len(nodes)} meshes in its default scene, {counts['skipped']} primitives of points, "
            "lines or strips",
        )
    return Scene(tuple(meshes), tuple(nodes), tuple(materials), name=path.stem, notes=tuple(notes))


def _from_gltf(
    gltf: Gltf, primitive: GltfPrimitive, default: int | None, counts: Counter[str]
) -> Primitive:
    material = primitive.material
    index = default if material is None else material
    assert index is not None
    return Primitive(
        primitive.positions,
        primitive.faces,
        index,
        primitive.normals,
        None if primitive.colors is None else _checked_colors(primitive.colors, counts),
    )


# ------------------------------------------------------------ OBJ, PLY and STL


class _Part(NamedTuple):
    """A primitive with the object and the material it belongs to."""

    owner: str
    material: Material
    primitive: Primitive


def _scene(path: Path, parts: list[_Part], notes: list[str], found: str) -> Scene:
    """A scene with one node for each object, in the order of their first parts."""
    parts = [part for part in parts if len(part.primitive.faces)]
    if not parts:
        raise _no_triangles(path, found)
    materials = list(dict.fromkeys(part.material for part in parts))
    objects: dict[str, list[Primitive]] = {}
    for part in parts:
        index = materials.index(part.material)
        objects.setdefault(part.owner, []).append(replace(part.primitive, material=index))
    meshes = tuple(Mesh(name, tuple(primitives)) for name, primitives in objects.items())
    nodes = tuple(Node(mesh.name, i) for i, mesh in enumerate(meshes))
    return Scene(meshes, nodes, tuple(materials), name=path.stem, notes=tuple(notes))


def _primitive(part: Mapping[str, Any], counts: Counter[str]) -> Primitive:
    """A primitive of the arrays that a trimesh reader returns; polygons become fans."""
    with np.errstate(over="ignore"):  # beyond float32: infinite, and then not drawn
        positions = np.asarray(part["vertices"], np.float64).astype(np.float32)
        normals = part.get("vertex_normals")
        if normals is not None:
            normals = np.asarray(normals, np.float64).astype(np.float32)
    polygons = np.asarray(part["faces"])
    if polygons.size == 0:
        polygons = np.empty((0, 3), np.int64)
    if polygons.ndim != 2 or positions.ndim != 2 or positions.shape[1] != 3:
        raise ValueError(f"faces of shape {polygons.shape}, vertices of shape {positions.shape}")
    low, high = (polygons.min(), polygons.max()) if polygons.size else (0, -1)
    if low < 0 or high >= len(positions):
        raise ValueError(
            f"a face refers to vertex {low if low < 0 else high} of {len(positions)} (from 0)"
        )
    corners = polygons.shape[1]
    fans = [polygons[:, [0, i, i + 1]] for i in range(1, corners - 1)]
    faces = np.stack(fans, axis=1).reshape(-1, 3) if fans else np.empty((0, 3))
    raw = part.get("vertex_colors")
    colors = None if raw is None else _checked_colors(linear_colors(np.asarray(raw)), counts)
    return Primitive(positions, faces.astype(np.int32), 0, normals, colors)


def _checked_colors(colors: F32Array, counts: Counter[str]) -> F32Array:
    """The colours with white for each that is NaN or infinite; both kinds of oddity counted."""
    broken = np.flatnonzero(~np.isfinite(colors).all(axis=1))
    counts["nan colors"] += len(broken)
    if len(broken):
        colors = colors.copy()
        colors[broken] = 1.0
    counts["bright colors"] += int((colors > 1.0).any(axis=1).sum())
    return colors


def _note(count: int, one: str, many: str, what: str) -> Iterator[str]:
    """One note, such as "3 textures are ...", or none where the count is 0."""
    if count:
        yield f"{count} {one if count == 1 else many} {what}"


def _color_notes(counts: Counter[str]) -> Iterator[str]:
    one, many = "vertex colour is", "vertex colours are"
    yield from _note(counts["nan colors"], one, many, "NaN or infinite: white is used")
    yield from _note(counts["bright colors"], one, many, "above 1: used as linear RGB")


def _texture_notes(count: int) -> Iterator[str]:
    what = "not drawn yet: base colour factor used"
    yield from _note(count, "texture is", "textures are", what)


def _default_material(colors: F32Array | None) -> Material:
    """The usual grey; white under vertex colours, so that they show as they are."""
    return Material() if colors is None else Material(base_color=_WHITE)


@contextlib.contextmanager
def _strict_and_silent() -> Iterator[None]:
    """trimesh logs and warns nothing; text that is not a number is an error, not an end of file."""
    logger = logging.getLogger("trimesh")
    before = logger.disabled
    logger.disabled = True
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", "string or file could not be read", DeprecationWarning)
            yield
    finally:
        logger.disabled = before


def _through_trimesh(path: Path, reader: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """What a trimesh reader returns; whatever it raises becomes one FileError line."""
    try:
        with _strict_and_silent():
            return reader()
    except Exception as error:
        raise _unreadable(path, error) from None


def _load_ply(path: Path, data: bytes) -> Scene:
    """PLY: authored normals, vertex colours (uint8 over 255, taken as linear), one object."""
    from trimesh.exchange.ply import load_ply

    end = max(data.find(b"end_header"), 0)
    header = bytes(b if b < 128 else ord("?") for b in data[:end])  # comments in any encoding
    source = header + data[end:]
    found = _through_trimesh(
        path, lambda: load_ply(io.BytesIO(source), fix_texture=False, skip_materials=True)
    )
    counts: Counter[str] = Counter()
    elements = found["metadata"]["_ply_raw"]
    for name in ("vertex", "face"):
        _check_length(path, name, elements.get(name, {}))
    parts = []
    if "faces" in found and found["faces"] is not None:
        primitive = _primitive(found, counts)
        parts.append(_Part(path.stem, _default_material(primitive.colors), primitive))
    notes = [
        *_texture_notes(len(set(re.findall(rb"(?i)texturefile\s+(\S+)", header)))),
        *_color_notes(counts),
    ]
    if found.get("face_colors") is not None:
        notes.append("colours of faces are not drawn")
    vertices = elements.get("vertex", {}).get("length", 0)
    return _scene(path, parts, notes, f"{vertices} vertices, no faces of three corners or more")


def _check_length(path: Path, name: str, element: Mapping[str, Any]) -> None:
    """Refuse a PLY with fewer rows than its header says: trimesh takes what there is."""
    rows = element.get("data")
    expected = element.get("length", 0)
    if isinstance(rows, dict):
        lengths = {len(np.atleast_1d(column)) for column in rows.values()}
        if lengths != {expected}:
            raise file_error(
                path,
                f"has {min(lengths, default=0)} {name} rows; expected {expected} by its header: "
                "the file is truncated, copy or export it again",
            )


def _load_stl(path: Path, data: bytes) -> Scene:
    """STL, binary or ASCII: each solid is an object. It has no vertex normals: shading is flat."""
    from trimesh.exchange.stl import load_stl

    size = None  # in bytes, if the file is a binary one
    if len(data) >= _STL_HEADER:
        count = int(np.frombuffer(data[_STL_HEADER - 4 : _STL_HEADER], "<u4")[0])
        size = _STL_HEADER + _STL_TRIANGLE * count
    # For text that is not UTF-8 trimesh would need a package that guesses encodings.
    source = data if len(data) == size else data.decode("utf-8", "replace").encode()
    found = _through_trimesh(path, lambda: load_stl(io.BytesIO(source)))
    counts: Counter[str] = Counter()
    solids = found.get("geometry", {path.stem: found})
    parts = [_Part(str(k), Material(), _primitive(v, counts)) for k, v in solids.items()]
    what = f"{len(data)} bytes: no complete ASCII solid"
    if size is not None:
        what += f", and a binary file with this header has {size}"
    return _scene(path, parts, [], what)


# ------------------------------------------------------------------------- OBJ


def _face_pattern(corner: str) -> re.Pattern[str]:
    """A face's corners, three or more of one kind, with one space between."""
    corner = corner.replace("i", "-?[1-9][0-9]*")
    return re.compile(rf"{corner}(?: {corner}){{2,}}")


# (has texture coordinates, has normals) → what the face's text then looks like.
_FACES = {
    (False, False): _face_pattern("i"),
    (True, False): _face_pattern("i/i"),
    (False, True): _face_pattern("i//i"),
    (True, True): _face_pattern("i/i/i"),
}


class _ObjSection(NamedTuple):
    """Faces that follow one another in a group: same object, material and kind of corner."""

    owner: str
    material: str | None
    kind: tuple[bool, bool]  # whether corners have a texture coordinate and a normal


class _TidyObj:
    """An OBJ text rewritten so that trimesh reads it in full.

    trimesh counts negative indices from the end of the file, needs single spaces, reads only the
    first `mtllib`, and misreads groups that mix corners with and without normals. So: numbers
    first, then faces as triangles with positive indices, in groups of one object, material and kind
    of corner, each an `o` statement that carries the group's number.
    """

    def __init__(self, path: Path, text: str) -> None:
        self.path = path
        self.sections: dict[_ObjSection, list[str]] = {}
        self.libraries: list[str] = []
        self.mixed_colors = False
        self._rows: dict[str, list[str]] = {"v": [], "vt": [], "vn": []}  # as corners name them
        self._kind, self._pattern = next(iter(_FACES.items()))  # of the face before
        self._widths: Counter[int] = Counter()
        owner, material = path.stem, None
        lines = text.replace("\\\r\n", " ").replace("\\\n", " ").splitlines()
        for number, line in enumerate(lines, 1):
            words = line.split(None, 1)
            if len(words) < 2:
                continue
            keyword, rest = words[0], words[1].strip()
            if keyword == "f":
                self._face(number, rest.partition("#")[0].split(), owner, material)
            elif keyword in self._rows:
                self._row(keyword, rest.partition("#")[0].split())
            elif keyword == "o":
                owner = rest
            elif keyword == "usemtl":
                material = rest
            elif keyword == "mtllib":
                self.libraries.append(rest)

    def _row(self, keyword: str, words: list[str]) -> None:
        if keyword == "v":
            self._widths[len(words)] += 1
        self._rows[keyword].append(" ".join(words))

    def _face(self, number: int, words: list[str], owner: str, material: str | None) -> None:
        text = " ".join(words)
        if not self._pattern.fullmatch(text):
            words = [word.rstrip("/") for word in words]  # 1/ and 1// are 1
            text = " ".join(words)
            kinds = [kind for kind, pattern in _FACES.items() if pattern.fullmatch(text)]
            if not kinds:
                raise self._bad_face(
                    number, text, "three corners or more of one kind: 1, 1/2, 1//3 or 1/2/3"
                )
            self._kind, self._pattern = kinds[0], _FACES[kinds[0]]
        if "-" in text:
            words = [self._absolute(number, word) for word in words]
        rows = self.sections.setdefault(_ObjSection(owner, material, self._kind), [])
        for i in range(1, len(words) - 1):
            rows.append(f"f {words[0]} {words[i]} {words[i + 1]}")

    def _absolute(self, number: int, corner: str) -> str:
        """A corner with each negative index counted back from the rows read so far."""
        out = []
        for rows, text in zip(self._rows.values(), corner.split("/")):
            index = int(text or 1)
            if index < -len(rows):
                raise self._bad_face(number, corner, f"indices from {-len(rows)} on")
            out.append(str(index + len(rows) + 1) if index < 0 else text)
        return "/".join(out)

    def _bad_face(self, number: int, found: str, expected: str) -> FileError:
        return file_error(
            self.path,
            f"line {number} has the face '{found[:60]}'; expected {expected}: repair or export "
            "again",
        )

    def text(self) -> str:
        """The text for trimesh. Raises FileError for a vertex without three coordinates."""
        vertices = self._rows["v"]
        if self._widths and min(self._widths) < 3:
            raise file_error(
                self.path,
                f"has a vertex of {min(self._widths)} coordinates; expected 3: the file is damaged "
                "or truncated, export it again",
            )
        if len(self._widths) > 1:
            self.mixed_colors = max(self._widths) >= 6
            vertices = [" ".join(row.split()[:3]) for row in vertices]
        rows = [f"v {row}" for row in vertices]
        rows += [f"{key} {row}" for key in ("vt", "vn") for row in self._rows[key]]
        for number, faces in enumerate(self.sections.values()):
            rows += [f"o {number}", *faces]
        return "\n".join(rows)

    def vertex_count(self) -> int:
        """Number of `v` rows."""
        return len(self._rows["v"])


def _load_obj(path: Path, data: bytes) -> Scene:
    """OBJ: objects, materials (MTL), authored normals, vertex colours `v x y z r g b` (linear)."""
    from trimesh.exchange.obj import load_obj

    tidy = _TidyObj(path, data.decode("utf-8", "replace"))
    text = tidy.text()
    found = _through_trimesh(
        path,
        lambda: load_obj(
            io.StringIO(text), group_material=False, split_objects=True, skip_materials=True
        ),
    )
    library, notes = _load_mtl(path, tidy.libraries)
    counts: Counter[str] = Counter()
    parts = []
    for number, section in enumerate(tidy.sections):
        part = found.get("geometry", {}).get(str(number))
        if part is None:
            raise _unreadable(path, ValueError(f"no geometry for object '{section.owner}'"))
        if section.kind[1] and part.get("vertex_normals") is None:
            raise _unreadable(path, ValueError(f"object '{section.owner}' uses missing normals"))
        primitive = _by_first_use(_primitive(part, counts))
        material = library.get(section.material or "")
        parts.append(
            _Part(section.owner, material or _default_material(primitive.colors), primitive)
        )
    missing = {s.material for s in tidy.sections if s.material} - set(library)
    notes += _note(len(missing), "material is", "materials are", "in no .mtl file: grey is used")
    notes += _color_notes(counts)
    if tidy.mixed_colors:
        notes.append("vertex colours are not used: some vertices have none")
    return _scene(path, parts, notes, f"{tidy.vertex_count()} vertices, no faces")


def _by_first_use(primitive: Primitive) -> Primitive:
    """Vertices in the order in which faces first use them.

    trimesh splits vertices with several normals by an unstable sort, whose order of ties changes
    with the processor; this order does not.
    """
    used, first, inverse = np.unique(primitive.faces, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty(len(used), np.int32)
    rank[order] = np.arange(len(used), dtype=np.int32)
    pick = used[order]
    return Primitive(
        primitive.positions[pick],
        rank[inverse.reshape(-1, 3)],
        primitive.material,
        None if primitive.normals is None else primitive.normals[pick],
        None if primitive.colors is None else primitive.colors[pick],
    )


class _Images:
    """Counts the images that a material file names instead of opening them."""

    def __init__(self) -> None:
        self.names: set[str] = set()

    def get(self, name: str) -> bytes:
        """Remember the name and refuse, which trimesh takes as a missing image."""
        self.names.add(name)
        raise KeyError(name)


def _load_mtl(path: Path, libraries: list[str]) -> tuple[dict[str, Material], list[str]]:
    """Materials by name from the .mtl files beside an OBJ, and notes on what is missing.

    Kd (times map_Kd, not drawn yet) is the base colour and Ke the emission, both taken as linear
    RGB: MTL says nothing of an encoding. Pm and Pr, where present, are metallic and roughness.
    """
    from trimesh.exchange.obj import parse_mtl

    texts, absent = [], 0
    for rest in dict.fromkeys(libraries):
        whole = path.parent / rest
        for name in [whole] if _is_file(whole) else [path.parent / word for word in rest.split()]:
            if _is_file(name):
                with contextlib.suppress(OSError):
                    texts.append(name.read_bytes().decode("utf-8", "replace"))
                    continue
            absent += 1
    images = _Images()
    with _strict_and_silent():
        entries = parse_mtl("\n".join(texts), resolver=images) if texts else {}
    maps = ("map_", "bump", "norm", "disp")
    for entry in entries.values():
        images.names.update(v[-1] for k, v in entry.items() if k.startswith(maps) and v)
    notes = [
        *_texture_notes(len(images.names)),
        *_note(absent, ".mtl file is", ".mtl files are", "missing or unreadable"),
    ]
    return {name: _mtl_material(name, entry) for name, entry in entries.items()}, notes


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _mtl_material(name: str, entry: Mapping[str, Any]) -> Material:
    default = Material()
    return Material(
        name=name,
        base_color=_mtl_rgb(entry.get("kd"), default.base_color),
        metallic=_mtl_rgb(entry.get("pm"), (default.metallic,) * 3)[0],
        roughness=_mtl_rgb(entry.get("pr"), (default.roughness,) * 3)[0],
        emissive=_mtl_rgb(entry.get("ke"), default.emissive),
    )


def _mtl_rgb(value: Any, default: Rgb) -> Rgb:
    """Three numbers, or one for all channels; the default for anything else."""
    try:
        numbers = [float(v) for v in np.atleast_1d(value)]
    except (TypeError, ValueError):
        return default
    if not all(np.isfinite(v) and v >= 0.0 for v in numbers):
        return default
    if len(numbers) == 1:
        numbers *= 3
    return (numbers[0], numbers[1], numbers[2]) if len(numbers) >= 3 else default


# --------------------------------------------------------------------- normals


def _without_normals(mesh: Mesh) -> Mesh:
    return replace(mesh, primitives=tuple(replace(p, normals=None) for p in mesh.primitives))


def _with_smooth_normals(mesh: Mesh) -> Mesh:
    if not mesh.primitives:
        return mesh
    starts = np.cumsum([0, *(len(p.positions) for p in mesh.primitives)])
    positions = np.concatenate([p.positions for p in mesh.primitives])
    faces = np.concatenate([p.faces + np.int32(start) for p, start in zip(mesh.primitives, starts)])
    group = _position_groups(positions)
    normals = np.empty((len(positions), 3), np.float32)
    _smooth_normals(positions, faces, group, np.zeros((len(positions), 3)), normals)
    return replace(
        mesh,
        primitives=tuple(
            replace(p, normals=normals[start : start + len(p.positions)])
            for p, start in zip(mesh.primitives, starts)
        ),
    )


def _position_groups(positions: F32Array) -> I64Array:
    """(n,) group number of each vertex; vertices of equal float32 position share one."""
    bits = (positions + np.float32(0.0)).view(np.uint32)  # −0 becomes +0
    order = np.lexsort(bits.T)
    sorted_bits = bits[order]
    new = np.zeros(len(bits), np.int64)
    new[1:] = (sorted_bits[1:] != sorted_bits[:-1]).any(axis=1)
    group = np.empty(len(bits), np.int64)
    group[order] = np.cumsum(new)
    return group


@driver(parallel=False)
def _smooth_normals(
    positions: F32Array, faces: I32Array, group: I64Array, total: F64Array, out: F32Array
) -> None:
    """Sum (b − a) × (c − a) into each corner's group in face order; out = the unit sums."""
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ux = np.float64(positions[b, 0]) - np.float64(positions[a, 0])
        uy = np.float64(positions[b, 1]) - np.float64(positions[a, 1])
        uz = np.float64(positions[b, 2]) - np.float64(positions[a, 2])
        vx = np.float64(positions[c, 0]) - np.float64(positions[a, 0])
        vy = np.float64(positions[c, 1]) - np.float64(positions[a, 1])
        vz = np.float64(positions[c, 2]) - np.float64(positions[a, 2])
        x = uy * vz - uz * vy
        y = uz * vx - ux * vz
        z = ux * vy - uy * vx
        if np.isfinite(x) and np.isfinite(y) and np.isfinite(z):
            for corner in range(3):
                g = group[faces[f, corner]]
                total[g, 0] += x
                total[g, 1] += y
                total[g, 2] += z
    for i in range(out.shape[0]):
        x = total[group[i], 0]
        y = total[group[i], 1]
        z = total[group[i], 2]
        largest = max(abs(x), abs(y), abs(z))
        n = 1.0
        if largest > 0.0:
            x /= largest
            y /= largest
            z /= largest
            n = np.sqrt(x * x + y * y + z * z)
        out[i, 0] = x / n
        out[i, 1] = y / n
        out[i, 2] = z / n


_LOADERS: dict[str, Callable[[Path, bytes], Scene]] = {
    ".glb": lambda path, data: load_gltf(path, data, LoadOptions()),
    ".gltf": lambda path, data: load_gltf(path, data, LoadOptions()),
    ".obj": _load_obj,
    ".ply": _load_ply,
    ".stl": _load_stl,
}

FORMATS: tuple[str, ...] = tuple(_LOADERS)
"""Extensions that `load_mesh` reads, in lower case."""

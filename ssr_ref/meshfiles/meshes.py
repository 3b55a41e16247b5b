"""Mesh files to a `Scene`: the reader by the file's extension, then normals, up axis and unit.

A reader gives float32 vertices as the file has them. Nothing is applied to a vertex: what turns or
scales a scene is in its nodes' transforms. Every failure is one FileError line, no file gives half
a scene, and what is not drawn as the file says is in `Scene.report` and `Scene.notes`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import get_args

from .. import transforms
from ..errors import FileError, SceneError, SettingsError
from ..scene import Scene
from .building import file_error, one_line
from .gltf_scene import load_gltf
from .normals import with_crease_normals, with_smooth_normals, without_normals
from .obj import load_obj
from .off import load_off
from .options import UNITS, LoadOptions, NormalsName, check_strict
from .ply import load_ply
from .stl import load_stl
from .threemf import load_3mf

MAX_FILE_BYTES = 2**28
"""Largest mesh file, 256 MiB: what is made of it must fit into memory as well."""

MAX_DRAWN = 2**26
"""Triangles drawn, and vertices placed, instances counted each time: rendering takes 100 bytes for
each, and a small file can place one mesh as often as it has bytes."""

_DEFAULTS = LoadOptions()


def load_mesh(path: str | Path, options: LoadOptions = _DEFAULTS) -> Scene:
    """Load a .glb, .gltf, .obj, .ply, .stl, .off or .3mf file (any case) as a scene without a view.

    Positions, normals, texture coordinates and colours are float32 in mesh space; floats arrive bit
    for bit, decimals and doubles are rounded. An object is one node: a glTF node, an OBJ `o`
    statement, an STL solid, a 3MF build item's mesh, a PLY or OFF file. Nothing is fetched, and no
    file is changed.

    Raises FileError (one line: what was found, what was expected, the way out) for a file that is
    missing, unreadable, empty, damaged, too large, of another format, without a triangle that can
    be drawn, or (strict) not drawn as it stands; SettingsError for `scene` with a format that has
    one scene only.
    """
    path = Path(path)
    data = _read(path)
    suffix = path.suffix.lower()
    if options.scene is not None and suffix not in _GLTF:
        raise SettingsError(
            f"scene is {options.scene!r} for {path}; expected none: only glTF files have several"
        )
    try:
        scene = _LOADERS[suffix](path, data, options)
        scene = _with_normals_of_file(scene, options.normals, flat_if_missing=suffix in _GLTF)
        scene = _placed(scene, options)
        _check_drawn(path, scene)
        scene.world_bounds()  # raises where no vertex is finite
        if scene.report is not None:
            check_strict(path, scene.report, options)
    except FileError as error:
        raise FileError(one_line(str(error))) from None
    except SceneError as error:
        raise file_error(path, str(error)) from None
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise _unreadable(path, error) from None
    return _with_clean_words(scene)


def _with_clean_words(scene: Scene) -> Scene:
    """The scene with notes and a report that are safe to print, whatever names the file holds."""
    report = scene.report
    if report is not None:
        report = replace(
            report,
            skipped=tuple(map(one_line, report.skipped)),
            fallbacks=tuple(map(one_line, report.fallbacks)),
            unsupported=tuple(map(one_line, report.unsupported)),
            textures=tuple((one_line(name), w, h) for name, w, h in report.textures),
        )
    return replace(scene, notes=tuple(map(one_line, scene.notes)), report=report)


def _check_drawn(path: Path, scene: Scene) -> None:
    """Raise FileError where instances make more of a scene than can be drawn."""
    vertices = [sum(len(p.positions) for p in mesh.primitives) for mesh in scene.meshes]
    placed = max(scene.triangle_count, sum(vertices[node.mesh] for node in scene.nodes))
    if placed > MAX_DRAWN:
        raise file_error(
            path,
            f"places {placed} triangles or vertices with its instances; expected at most "
            f"{MAX_DRAWN}: simplify it, or place fewer instances",
        )


def with_normals(scene: Scene, normals: NormalsName) -> Scene:
    """The scene with the normals asked for; "authored" gives it back as it is.

    "flat": none; "smooth", "crease": made anew, see `normals.py`. Raises SettingsError for an
    unknown name.
    """
    if normals not in get_args(NormalsName):
        listed = ", ".join(get_args(NormalsName))
        raise SettingsError(f"normals is {normals!r}; expected one of {listed}")
    if normals == "authored":
        return scene
    change = {"flat": without_normals, "smooth": with_smooth_normals, "crease": with_crease_normals}
    return change[normals](scene)


def _with_normals_of_file(scene: Scene, normals: NormalsName, *, flat_if_missing: bool) -> Scene:
    """As `with_normals`, and "authored" makes those that are missing, unless they mean flat."""
    primitives = [p for mesh in scene.meshes for p in mesh.primitives]
    made = 0 if normals == "flat" else len(primitives)
    if normals != "authored":
        scene = with_normals(scene, normals)
    elif flat_if_missing:
        made = 0
    else:
        made = sum(p.normals is None for p in primitives)
        scene = with_crease_normals(scene, only_missing=True)
    if scene.report is None:
        return scene
    return replace(scene, report=replace(scene.report, generated_normals=made))


def _placed(scene: Scene, options: LoadOptions) -> Scene:
    """The scene turned y up and scaled to metres, in its nodes' transforms.

    z up: (x, y, z) becomes (x, z, −y), a turn that only moves and negates numbers.
    """
    unit = UNITS[options.unit or "m"]
    change = transforms.scaling(unit, unit, unit)
    if options.up == "z":
        change[1:3] = ((0.0, 0.0, unit, 0.0), (0.0, -unit, 0.0, 0.0))
    if options.up == "y" and unit == 1.0:
        return scene
    nodes = (
        replace(node, world_from_mesh=transforms.multiply(change, node.world_from_mesh))
        for node in scene.nodes
    )
    return replace(scene, nodes=tuple(nodes))


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
        size = path.stat().st_size
        if size > MAX_FILE_BYTES:
            raise file_error(
                path, f"has {size} bytes; expected at most {MAX_FILE_BYTES}: simplify or split it"
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


_GLTF = (".glb", ".gltf")
_LOADERS: dict[str, Callable[[Path, bytes, LoadOptions], Scene]] = {
    ".glb": load_gltf,
    ".gltf": load_gltf,
    ".obj": load_obj,
    ".ply": load_ply,
    ".stl": load_stl,
    ".off": load_off,
    ".3mf": load_3mf,
}

FORMATS: tuple[str, ...] = tuple(_LOADERS)
"""Extensions that `load_mesh` reads, in lower case."""

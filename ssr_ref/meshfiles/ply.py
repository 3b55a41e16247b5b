"""PLY: ASCII, binary little and big endian; normals, colours, texture coordinates, any polygons.

The header is checked against the file's size before any memory is taken. `ply_data.py` reads the
elements; here their properties become a scene. It is read by ourselves because trimesh's reader
refuses mixed polygons in binary files, takes the rows there are where some are missing, turns
polygons' order round, and reads texture coordinates of vertices only without splitting.

Colours: uchar and ushort are sRGB codes and decoded, floats are linear as they are. Texture
coordinates have v up, as MeshLab and Blender write them; v is turned round in the texture's
transform, so the file's float32 values stay.

Source: Greg Turk, "The PLY Polygon File Format", 1994.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import FileError
from ..scene import Material, Scene
from ..texture import Image, Texture
from ..typed import AnyArray, F32Array, I64Array
from .beside import read_beside
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
    without_path,
)
from .colors import linear_from_codes
from .images import read_image
from .options import LoadOptions
from .ply_data import Element, read_ply

_NORMALS = ("nx", "ny", "nz")
_COLORS = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), tuple("rgb"))
_UV = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
_INDICES = ("vertex_indices", "vertex_index")
_USED = {"x", "y", "z", *_NORMALS, *(n for names in (*_COLORS, *_UV) for n in names), "alpha"}


def load_ply(path: Path, data: bytes, options: LoadOptions) -> Scene:
    """A PLY file as one object. Raises FileError (one line)."""
    header, elements = read_ply(path, data)
    findings = Findings()
    for name, element in elements.items():
        if name not in ("vertex", "face"):
            findings.skip(element.rows, f"row of element '{name}'", f"rows of element '{name}'")
    vertex = elements.get("vertex", Element(0, {}, {}))
    face = elements.get("face", Element(0, {}, {}))
    indices = next((face.lists[name] for name in _INDICES if name in face.lists), None)
    if indices is None or vertex.rows == 0:
        indices = (np.zeros(0, np.int64), np.zeros(0, np.int64))
    sizes, vertices = indices[0], indices[1].astype(np.int64)
    check_indices(vertices, vertex.rows)
    columns = [vertices]
    uv = _columns(vertex, _UV)
    wedge = _wedge_uv(face, sizes, findings)
    uv0 = None if uv is None else (float32(uv), 0)
    if wedge is not None:
        uv0 = (wedge, len(columns))
        columns.append(np.arange(len(vertices)))
    colors = _colors(vertex, face, sizes, columns, findings)
    normals = _columns(vertex, (_NORMALS,))
    positions = _columns(vertex, (("x", "y", "z"),))
    if positions is None:
        if vertex.rows:
            raise file_error(path, "has vertices without x, y and z; expected all: export it again")
        positions = np.zeros((0, 3))
    primitive = build_primitive(
        float32(positions),
        sizes,
        np.stack(columns, axis=1),
        Attributes(None if normals is None else (float32(normals), 0), colors, uv0),
        0,
        findings,
    )
    images, texture = _texture(path, header, uv0 is not None, options, findings)
    material = Material(base_color_texture=texture)
    if colors is not None or texture is not None:
        material = Material(base_color=WHITE, base_color_texture=texture)
    others = [n for n in vertex.scalars if n not in _USED]
    if others:
        findings.remarks.append(f"properties of vertices without a meaning here: {_list(others)}")
    return assemble(
        path,
        "PLY",
        [Part(path.stem, primitive)],
        [material],
        images,
        findings,
        f"{vertex.rows} vertices, {face.rows} faces",
    )


def _list(names: list[str]) -> str:
    return ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")


def _columns(element: Element, names: tuple[tuple[str, ...], ...]) -> AnyArray | None:
    """(rows, k) of the first set of properties that the element has in full."""
    for wanted in names:
        if all(name in element.scalars for name in wanted):
            with np.errstate(invalid="ignore"):  # of mixed types, a signalling NaN becomes quiet
                return np.stack([element.scalars[name] for name in wanted], axis=1)
    return None


def _wedge_uv(face: Element, sizes: I64Array, findings: Findings) -> F32Array | None:
    """(corners, 2) of MeshLab's `property list uchar float texcoord`, a list of each face."""
    if "texcoord" not in face.lists:
        return None
    counts, values = face.lists["texcoord"]
    if not np.array_equal(counts, 2 * sizes):
        findings.fallbacks.append("texcoord: some faces have not two numbers for each corner")
        return None
    return float32(values).reshape(-1, 2)


def _colors(
    vertex: Element, face: Element, sizes: I64Array, columns: list[I64Array], findings: Findings
) -> tuple[F32Array, int] | None:
    """Colours of vertices, or else of faces, which then index a column of their own."""
    alpha = vertex.scalars.get("alpha")
    if alpha is not None and alpha.size:
        full = np.iinfo(alpha.dtype).max if alpha.dtype.kind in "iu" else 1.0
        if (alpha < full).any():
            findings.unsupported.append("alpha of vertices: drawn opaque")
    of_vertices, of_faces = _columns(vertex, _COLORS), _columns(face, _COLORS)
    if of_vertices is not None and of_faces is not None:
        findings.unsupported.append("colours of faces: those of vertices are used")
    raw = of_faces if of_vertices is None else of_vertices
    if raw is None:
        return None
    if raw.dtype in (np.uint8, np.uint16):
        linear = linear_from_codes(raw)
    elif raw.dtype.kind == "f":
        linear = float32(raw)
    else:
        findings.fallbacks.append(f"colours of type {raw.dtype}: not used, expected uchar or float")
        return None
    colors = checked_colors(linear, findings)
    if of_vertices is not None:
        return colors, 0
    columns.append(np.repeat(np.arange(len(sizes)), sizes))
    return colors, len(columns) - 1


def _texture(
    path: Path, header: list[str], has_uv: bool, options: LoadOptions, findings: Findings
) -> tuple[list[Image], Texture | None]:
    """The image that MeshLab's `comment TextureFile NAME` names, for the base colour."""
    names = []
    for line in header:
        words = line.split(None, 2)
        if len(words) == 3 and words[0] == "comment" and words[1].lower() == "texturefile":
            names.append(words[2].strip())
    if len(names) > 1:
        findings.unsupported.append(f"{len(names)} texture files: the first is used for all faces")
    if not names:
        return [], None
    if not has_uv:
        findings.fallbacks.append(f"texture {names[0]!r} without texture coordinates")
        return [], None
    try:
        image = read_image(names[0], read_beside(path, names[0], options))
    except FileError as error:
        findings.fallbacks.append(f"texture {without_path(path, error)}")
        return [], None
    return [image], Texture(0, offset=(0.0, 1.0), scale=(1.0, -1.0))

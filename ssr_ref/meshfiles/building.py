"""From what a text or binary mesh file holds to a `Scene` with its report.

Readers gather polygons whose corners are rows of indices (position, then what else the format
indexes), and what they leave out or replace in `Findings`. Here corners become vertices, polygons
triangles, parts the objects of a scene, and findings the `LoadReport` and the scene's notes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import FileError, SceneError
from ..scene import LoadReport, Material, Mesh, Node, Primitive, Scene
from ..texture import Image
from ..typed import AnyArray, F32Array, I64Array, Rgb
from .census import count_triangles
from .polygons import triangulate

WHITE: Rgb = (1.0, 1.0, 1.0)
MAX_PARTS = 50_000
"""Pairs of object and material in one file; each costs a third of a millisecond."""

MAX_NOTES = 8
"""Notes on one kind of finding; the report has them all."""


MAX_LINE = 800
"""Characters of one message or note; the middle of a longer one is left out."""


def one_line(text: str) -> str:
    """Text that may hold a file's own words as one line that is safe to print in a terminal.

    Line breaks become spaces; control characters, text direction marks and halves of surrogate
    pairs become escapes such as \\x1b.
    """
    text = " ".join(text.split())
    if not text.isprintable():
        text = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
    if len(text) <= MAX_LINE:
        return text
    half = (MAX_LINE - 5) // 2
    return f"{text[:half]} ... {text[-half:]}"


def file_error(path: Path, message: str) -> FileError:
    """A FileError of one line that starts with the file's path."""
    return FileError(one_line(f"{path}: {message}"))


def without_path(path: Path, error: Exception) -> str:
    """What an error found, without the file's own path: for reports, which hold no paths."""
    return str(error).removeprefix(f"{path}: ").partition("; expected")[0]


@dataclass(slots=True)
class Findings:
    """What a reader left out, replaced or does not draw, in words; see `LoadReport`.

    remarks : said in the scene's notes only, since everything is drawn as the file says.
    small_faces, fans : faces of fewer than 3 corners, polygons that could only be drawn as fans;
    `close` puts them into words.
    """

    skipped: list[str] = field(default_factory=list)
    fallbacks: list[str] = field(default_factory=list)
    unsupported: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    small_faces: int = 0
    fans: int = 0

    def skip(self, count: int, one: str, many: str) -> None:
        """Count things that were left out, if there are any."""
        if count:
            self.skipped.append(f"{count} {one if count == 1 else many}")

    def close(self) -> None:
        """Put the counts that many primitives add to into words, once."""
        self.skip(self.small_faces, "face of fewer than 3 corners", "faces of fewer than 3 corners")
        if self.fans:
            what = "polygon without area or that crosses itself: a fan"
            many = "polygons without area or that cross themselves: fans"
            self.unsupported.append(f"{self.fans} {what if self.fans == 1 else many}")
        self.small_faces = self.fans = 0

    def notes(self) -> tuple[str, ...]:
        """Everything, at most MAX_NOTES lines of a kind."""
        out: list[str] = []
        for kind, lines in (
            ("not drawn", self.skipped),
            ("replaced", self.fallbacks),
            ("not drawn as the file says", self.unsupported),
        ):
            out += first_notes([f"{kind}: {line}" for line in lines], kind)
        return (*out, *self.remarks)


def first_notes(lines: Sequence[str], kind: str) -> list[str]:
    """The first MAX_NOTES of notes of a kind, and how many more there are."""
    more = len(lines) - MAX_NOTES
    rest = [f"{kind}: {more} more, see the load report"] if more > 0 else []
    return [*lines[:MAX_NOTES], *rest]


class Attributes(NamedTuple):
    """Tables that corners index: (rows, columns) float32 and the column of `columns` to use."""

    normals: tuple[F32Array, int] | None = None
    colors: tuple[F32Array, int] | None = None
    uv0: tuple[F32Array, int] | None = None


class Part(NamedTuple):
    """A primitive with the object that it belongs to; its material is an index already."""

    owner: str
    primitive: Primitive


def float32(values: AnyArray) -> F32Array:
    """Rounded once; what is beyond float32 becomes infinite, and then is not drawn."""
    with np.errstate(over="ignore", invalid="ignore"):  # invalid: a signalling NaN becomes quiet
        return np.asarray(values).astype(np.float32)


def check_indices(indices: I64Array, count: int) -> None:
    """Raise ValueError, which names the vertex, unless all indices are from 0 to count − 1."""
    low, high = (int(indices.min()), int(indices.max())) if indices.size else (0, -1)
    if low < 0 or high >= count:
        raise ValueError(f"a face refers to vertex {low if low < 0 else high} of {count} (from 0)")


def build_primitive(
    positions: F32Array,
    sizes: I64Array,
    columns: I64Array,
    attributes: Attributes,
    material: int,
    findings: Findings,
) -> Primitive:
    """A primitive with one vertex for each different row of `columns`, in order of first use.

    positions (n, 3); sizes (p,) corners of each polygon; columns (corners, k) index rows, column 0
    into positions, all in range. Polygons of fewer than 3 corners are left out and counted.
    """
    small = sizes < 3
    if small.any():
        findings.small_faces += int(small.sum())
        columns, sizes = columns[~np.repeat(small, sizes)], sizes[~small]
    found = triangulate(positions, sizes, columns[:, 0])
    findings.fans += found.fans
    first, number = first_uses(columns)
    rows = columns[first]

    def taken(attribute: tuple[F32Array, int] | None) -> F32Array | None:
        return None if attribute is None else attribute[0][rows[:, attribute[1]]]

    return Primitive(
        positions[rows[:, 0]],
        number[found.corners].astype(np.int32),
        material,
        taken(attributes.normals),
        taken(attributes.colors),
        taken(attributes.uv0),
    )


def first_uses(columns: I64Array) -> tuple[I64Array, I64Array]:
    """(u,) the first of each set of equal rows, ascending, and (n,) the set's number of each row.

    columns: (n, k) of numbers from 0.
    """
    number = columns[:, 0]
    first = number[:0]
    for k in range(max(1, columns.shape[1] - 1)):
        column = columns[:, k + 1] if columns.shape[1] > 1 else np.zeros(len(columns), np.int64)
        key = number * (int(column.max(initial=0)) + 1) + column
        _, first, number = np.unique(key, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty(len(first), np.int64)
    rank[order] = np.arange(len(first))
    return first[order], rank[number.reshape(-1)]


def checked_colors(colors: F32Array, findings: Findings) -> F32Array:
    """The colours with white for each that is NaN or infinite; those outside 0 to 1 are counted."""
    broken = np.flatnonzero(~np.isfinite(colors).all(axis=1))
    if len(broken):
        colors = colors.copy()
        colors[broken] = 1.0
        many = "vertex colour is" if len(broken) == 1 else "vertex colours are"
        findings.fallbacks.append(f"{len(broken)} {many} NaN or infinite: white is used")
    odd = int(((colors > 1.0) | (colors < 0.0)).any(axis=1).sum())
    if odd:
        many = "vertex colour is" if odd == 1 else "vertex colours are"
        findings.remarks.append(f"{odd} {many} outside 0 to 1: used as linear RGB")
    return colors


def no_triangles(path: Path, found: str) -> FileError:
    """The error about a file in which nothing can be drawn."""
    return file_error(
        path,
        f"has no triangles ({found}); expected at least one: point clouds and curves cannot be "
        "drawn",
    )


def check_parts(path: Path, count: int) -> None:
    """Raise FileError for more parts than MAX_PARTS."""
    if count > MAX_PARTS:
        raise file_error(
            path,
            f"has over {MAX_PARTS} parts (object and material); expected fewer: join some of them",
        )


def assemble(
    path: Path,
    kind: str,
    parts: Sequence[Part],
    materials: Sequence[Material],
    images: Sequence[Image],
    findings: Findings,
    found: str,
) -> Scene:
    """A scene with one node for each object, in the order of their first parts.

    kind : the format's name; found : what there is, said where nothing can be drawn.
    """
    findings.close()
    objects: dict[str, list[Primitive]] = {}
    for part in parts:
        if len(part.primitive.faces):
            objects.setdefault(part.owner, []).append(part.primitive)
    if not objects:
        raise no_triangles(path, "; ".join([found, *findings.skipped[:3]]))
    meshes = tuple(Mesh(name, tuple(primitives)) for name, primitives in objects.items())
    nodes = tuple(Node(mesh.name, i) for i, mesh in enumerate(meshes))
    return with_report(path, kind, meshes, nodes, materials, images, findings)


def with_report(
    path: Path,
    kind: str,
    meshes: tuple[Mesh, ...],
    nodes: tuple[Node, ...],
    materials: Sequence[Material],
    images: Sequence[Image],
    findings: Findings,
) -> Scene:
    """The scene with its report, once everything else is known."""
    triangles, degenerate, non_finite = count_triangles(meshes)
    report = LoadReport(
        format=kind,
        triangles=triangles,
        degenerate=degenerate,
        non_finite=non_finite,
        skipped=tuple(findings.skipped),
        fallbacks=tuple(findings.fallbacks),
        unsupported=tuple(findings.unsupported),
        textures=tuple((image.name, *image.size) for image in images),
    )
    try:
        return Scene(
            meshes,
            nodes,
            tuple(materials),
            name=path.stem,
            notes=findings.notes(),
            images=tuple(images),
            report=report,
        )
    except SceneError as error:
        raise file_error(path, str(error)) from None

"""A loader's report as lines of text, for `--verbose`."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..scene import Scene


def load_rows(scene: Scene) -> list[tuple[str, str]]:
    """What the loader made of the file; nothing for a scene made by code."""
    report = scene.report
    if report is None:
        return []
    rows = [
        (
            "loaded",
            f"{report.format}, {report.triangles} triangles in {len(scene.meshes)} meshes, "
            f"{report.degenerate} degenerate, {report.non_finite} not finite",
        ),
        ("normals", f"{report.generated_normals} primitives with generated ones"),
        *(("texture", f"{name} {width}x{height}") for name, width, height in report.textures),
    ]
    for title, lines in (
        ("left out", report.skipped),
        ("replaced", report.fallbacks),
        ("not drawn", report.unsupported),
    ):
        rows += [(title, line) for line in lines]
    return rows

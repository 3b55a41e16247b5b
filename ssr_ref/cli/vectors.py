"""`ssr-ref vectors`: test vectors of the kernels as files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .output import Output

if TYPE_CHECKING:
    from ..study.vectors import VectorSet


def vectors(
    ctx: typer.Context,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder that is created.")
    ],
    kernel: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="Only this kernel, or NAME_FORM of it; may be repeated. [all]"
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace a folder of test vectors that is there.")
    ] = False,
) -> None:
    """Write test vectors of the kernels: JSON, CSV and NPZ, with correctly rounded answers."""
    from ..fileio.folder import MANIFEST_FILE
    from ..fileio.npz import file_sha256
    from ..fileio.vectors import check_target, write_vectors
    from ..study.subjects import select
    from ..study.vectors import make

    chosen = select(kernel or ())
    check_target(output, force=force)
    out: Output = ctx.obj
    rows: list[dict[str, Any]] = []
    with out.progress() as progress:

        def made() -> Iterator[VectorSet]:
            for done, subject in enumerate(chosen):
                progress(subject.title, done / len(chosen))
                found = make(subject)
                rows.append(_row(found))
                yield found

        write_vectors(made(), output, force=force)
    content = file_sha256(output / MANIFEST_FILE)
    if out.json:
        out.data({"output": str(output), "kernels": rows, "manifest_sha256": content})
    elif not out.quiet:
        _print(out, output, rows, content)


def _row(found: VectorSet) -> dict[str, Any]:
    import numpy as np

    asked = {to: int((~np.isnan(t)).sum()) for to, t in found.tolerance.items()}
    return {
        "name": found.subject.title,
        "cases": len(found.names),
        "asked": asked,
        "measures": sorted({found.measure(field) for field in found.subject.outputs}),
        "median_tolerance_ulp": float(np.nanmedian(found.tolerance["float32"])),
    }


def _print(out: Output, output: Path, rows: list[dict[str, Any]], content: str) -> None:
    size = sum(path.stat().st_size for path in output.iterdir())
    out.facts(
        [
            ("test vectors", str(output)),
            ("kernels", str(len(rows))),
            ("cases", str(sum(row["cases"] for row in rows))),
            ("bytes", str(size)),
            ("manifest sha256", content),
        ]
    )
    out.table(
        "kernels",
        ("kernel", "cases", "asked of float32", "measure", "median tolerance, ulp"),
        [
            (
                row["name"],
                str(row["cases"]),
                str(row["asked"]["float32"]),
                ", ".join(row["measures"]),
                f"{row['median_tolerance_ulp']:g}",
            )
            for row in rows
        ],
    )

"""`ssr-ref scenes`: the built-in scenes, as lines, as JSON, or as a page with pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import SettingsError
from .output import Output


def scenes(
    ctx: typer.Context,
    html: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.html", help="Render every scene small and write one page about them."
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a page that is there.")] = False,
) -> None:
    """List the built-in scenes: meshes, and shapes in closed form."""
    from ..analytic.scenes import SCENES
    from ..fileio.load import CLOSED_FORM
    from ..scenes import BUILTIN

    out: Output = ctx.obj
    found = {name: builtin.description for name, builtin in BUILTIN.items()}
    for name, make in SCENES.items():
        first = (make.__doc__ or "").strip().splitlines()[0]
        found[CLOSED_FORM + name] = first[:1].lower() + first[1:].removesuffix(".")
    if html is None:
        if force:
            raise SettingsError("--force is given without --html; expected both, or neither")
        if out.json:
            out.data(found)
        else:
            out.facts(list(found.items()))
        return

    from ..report.scene_list import write_scene_page

    with out.progress() as progress:
        entries = write_scene_page(html, force=force, progress=progress)
    if out.json:
        out.data({"page": str(html), "scenes": {entry.name: entry.facts for entry in entries}})
    elif not out.quiet:
        out.facts([("page", str(html)), ("scenes", str(len(entries)))])

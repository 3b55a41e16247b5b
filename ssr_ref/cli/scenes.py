"""`ssr-ref scenes`: the built-in scenes."""

from __future__ import annotations

import typer

from .output import Output


def scenes(ctx: typer.Context) -> None:
    """List the built-in scenes."""
    from ..scenes import BUILTIN

    out: Output = ctx.obj
    if out.json:
        out.data({name: builtin.description for name, builtin in BUILTIN.items()})
    else:
        out.facts([(name, builtin.description) for name, builtin in BUILTIN.items()])

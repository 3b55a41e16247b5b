"""`ssr-ref presets`: the settings of public engines by name."""

from __future__ import annotations

from typing import Annotated

import typer

from .options import as_options
from .output import Output


def presets(
    ctx: typer.Context,
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="Tell all about this one.")
    ] = None,
) -> None:
    """List the presets of public engines, or tell what one sets and leaves out."""
    from ..errors import SettingsError
    from ..presets import PRESETS
    from ..settings import Settings

    out: Output = ctx.obj
    if name is not None and name not in PRESETS:
        raise SettingsError(f"preset is '{name}'; expected one of {', '.join(PRESETS)}")
    if out.json:
        chosen = PRESETS if name is None else {name: PRESETS[name]}
        plain = Settings().to_json()
        data = {}
        for key, preset in chosen.items():
            values = Settings(**preset.changes).to_json()
            changes = {k: v for k, v in values.items() if v != plain[k]}
            data[key] = {
                "description": preset.description,
                "settings": changes,
                "covers": list(preset.covers),
                "not_covered": list(preset.not_covered),
                "source": preset.source,
            }
        out.data(data)
    elif name is None:
        out.facts([(key, preset.description) for key, preset in PRESETS.items()])
    else:
        preset = PRESETS[name]
        out.facts(
            [
                (name, preset.description),
                ("source", preset.source),
                ("settings", " ".join(as_options(preset.changes))),
                *(("covers" if i == 0 else "", text) for i, text in enumerate(preset.covers)),
                *(("leaves out" if i == 0 else "", t) for i, t in enumerate(preset.not_covered)),
            ]
        )

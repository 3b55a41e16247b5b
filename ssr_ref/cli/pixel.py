"""`ssr-ref pixel`: the whole walk of one pixel's ray, as a table, as JSON and as a picture."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from ..errors import SettingsError
from .options import CameraOptions, SceneOptions, TraceOptions, grouped
from .output import Output

if TYPE_CHECKING:
    from ..buffers import GBuffer
    from ..camera import ViewParams
    from ..settings import Settings
    from ..ssr.explain import PixelWalk

FORMAT = "ssr_ref pixel walk"
HEADERS = (
    "#",
    "read",
    "s",
    "pixel",
    "from",
    "to",
    "ray from",
    "ray to",
    "front",
    "back",
    "verdict",
)


class Subject(NamedTuple):
    """What is walked: a G-buffer, its view, and the methods' resolved settings by name."""

    scene: str
    view: ViewParams
    gbuffer: GBuffer
    methods: dict[str, Settings]


@grouped
def pixel(
    ctx: typer.Context,
    scene: Annotated[
        str,
        typer.Argument(metavar="SCENE", help="As for `render`, or the folder of a golden bundle."),
    ],
    x: Annotated[int, typer.Argument(metavar="X", help="Column, 0 at the left.")],
    y: Annotated[int, typer.Argument(metavar="Y", help="Row, 0 at the top.")],
    scene_options: SceneOptions,
    camera_options: CameraOptions,
    trace_options: TraceOptions,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Folder for pixel.json and pictures."),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace such a folder that is there.")
    ] = False,
    rows: Annotated[
        int, typer.Option(metavar="N", help="Rows of a table at most; the middle is left out.")
    ] = 40,
    heat: Annotated[
        bool, typer.Option("--heat", help="With -o: how often all rays of the image read a pixel.")
    ] = False,
) -> None:
    """Show every test that one pixel's ray makes."""
    from ..fileio.folder import FolderKind, check_target
    from ..ssr.explain import trace_pixel

    out: Output = ctx.obj
    methods = named_methods(trace_options)
    scene_options.check()
    camera_options.given()
    if rows < 2:
        raise SettingsError(f"rows is {rows}; expected 2 at least")
    if heat and output is None:
        raise SettingsError("--heat is given without --output; expected both, or neither")
    kind = FolderKind("pixel walk", "walk", FORMAT)
    if output is not None:
        check_target(output, kind, force=force)

    if (Path(scene) / "manifest.json").is_file():
        if any(o.given_values() for o in (scene_options, camera_options)):
            raise SettingsError(
                "options of scene or camera are given for a bundle; expected none: it has its own"
            )
        subject = subject_of_bundle(Path(scene), trace_options)
    else:
        subject = subject_of_scene(scene, scene_options, camera_options, methods)
    walks = {
        name: trace_pixel(subject.view, subject.gbuffer, settings, x, y)
        for name, settings in subject.methods.items()
    }
    if output is not None:
        _write(output, subject, walks, heat=heat)
    if out.json:
        out.data(walks_json(subject, walks))
    elif not out.quiet:
        for name, walk in walks.items():
            _print(out, subject, name, walk, rows)
        if output is not None:
            print(f"\nwritten to {output}")


def named_methods(options: TraceOptions) -> dict[str, Settings]:
    """Settings by method; without `--method` the one that the settings are, by its name."""
    methods = options.methods()
    return {name or name_of(settings): settings for name, settings in methods.items()}


def name_of(settings: Settings) -> str:
    """The method that settings are."""
    if settings.tracer == "cells":
        return "planes" if settings.surface == "plane" else "exact"
    return settings.tracer


def subject_of_scene(
    name: str, scene: SceneOptions, camera: CameraOptions, methods: dict[str, Settings]
) -> Subject:
    """Load and draw a scene; nothing is traced."""
    from ..pipeline import Stages, draw_gbuffer

    loaded = scene.load(name)
    first, *rest = methods
    drawn = draw_gbuffer(
        loaded, camera.view(loaded), methods[first], {n: methods[n] for n in rest}, Stages(None)
    )
    return Subject(loaded.name, drawn.view, drawn.gbuffer, {first: drawn.settings, **drawn.more})


def subject_of_bundle(path: Path, options: TraceOptions) -> Subject:
    """A bundle's own G-buffer, camera and settings; tracing options win over the latter."""
    from ..buffers import GBuffer
    from ..fileio.bundle import load_bundle
    from ..settings import method_settings

    bundle = load_bundle(path)
    names = {field.name for field in fields(GBuffer)} & set(bundle.arrays)
    images: dict[str, Any] = {name: bundle.arrays[name] for name in names}
    gbuffer = GBuffer(**images)
    given = {k: v for k, v in options.given_values().items() if k != "method"}
    if given.keys() & {"size", "settings", "preset", "more"}:
        raise SettingsError(
            "size, settings, preset or more is given for a bundle; expected none: it has its own"
        )
    asked = options.method_names()
    if asked:
        methods = {name: method_settings(name, bundle.settings, **given) for name in asked}
    else:
        changed = replace(bundle.settings, **given)
        methods = {name_of(changed): changed, **bundle.more}
    for name, settings in methods.items():
        if settings.thickness_from == "back_faces" and gbuffer.back_depth is None:
            raise SettingsError(
                f"method '{name}' needs back faces and the bundle has none; expected thickness "
                "from what it was rendered with"
            )
    view = bundle.camera.params(bundle.settings.size)
    return Subject(str(bundle.manifest["scene"]["name"]), view, gbuffer, methods)


def walks_json(subject: Subject, walks: dict[str, PixelWalk]) -> dict[str, Any]:
    """docs/pixel.md: floats with all their digits, infinite ones "inf", NaN null."""
    return {
        "format": FORMAT,
        "scene": subject.scene,
        "size": [subject.view.width, subject.view.height],
        "methods": {
            name: {
                "settings": subject.methods[name].to_json(),
                "pixel": [walk.x, walk.y],
                "status": walk.status.name,
                "end": walk.end.name,
                "flags": [flag.name for flag in type(walk.flags) if flag in walk.flags],
                "steps": walk.steps,
                "fetches": walk.fetches,
                "hit_px": [_number(v) for v in walk.hit_px],
                "hit_depth": _number(walk.hit_depth),
                "length": _number(walk.length),
                "s_is": walk.s_is,
                "columns": [*walk.columns, "verdict"],
                "rows": [
                    [*_row(row), verdict.name]
                    for row, verdict in zip(walk.rows.tolist(), walk.verdicts)
                ],
            }
            for name, walk in walks.items()
        },
    }  # fmt: skip


def _row(row: list[float]) -> list[int | float | str | None]:
    """Level and pixel are whole numbers."""
    return [int(v) if i in (0, 2, 3) else _number(v) for i, v in enumerate(row)]


def _number(value: float) -> float | str | None:
    if math.isnan(value):
        return None
    return value if math.isfinite(value) else ("inf" if value > 0 else "-inf")


def _print(out: Output, subject: Subject, name: str, walk: PixelWalk, most: int) -> None:
    depth = float(subject.gbuffer.depth[walk.y, walk.x])
    facts = [
        ("method", name),
        ("scene", f"{subject.scene}, {subject.view.width}x{subject.view.height}"),
        ("pixel", f"({walk.x}, {walk.y})"),
        ("depth", f"{depth:.9g}"),
        ("status", walk.status.name),
        ("steps, reads", f"{walk.steps}, {walk.fetches}"),
    ]  # fmt: skip
    if walk.end:
        facts.append(("end", walk.end.name))
    if walk.flags:
        facts.append(("flags", " ".join(str(f.name) for f in type(walk.flags) if f in walk.flags)))
    if not math.isnan(walk.hit_depth):
        px, py = walk.hit_px
        facts.append(("hit", f"({px:.6f}, {py:.6f}), depth {walk.hit_depth:.9g}"))
        facts.append(("length", f"{walk.length:.9g}"))
    print()
    out.facts(facts)
    lines = [
        (
            str(i),
            "refine" if row[0] else "sample",
            f"{row[1]:.4f}",
            f"({row[2]:.0f}, {row[3]:.0f})",
            *(f"{v:.4f}" for v in row[4:6]),
            *(f"{v:.6g}" for v in row[6:10]),
            verdict.name,
        )
        for i, (row, verdict) in enumerate(zip(walk.rows.tolist(), walk.verdicts))
    ]
    title = "s in pixels of the major axis" if walk.s_is == "px" else "s in scene units"
    if len(lines) > most:
        left = len(lines) - most
        head = (most + 1) // 2
        blank = ("...", f"{left} more") + ("",) * (len(HEADERS) - 2)
        lines = [*lines[:head], blank, *lines[len(lines) - (most - head) :]]
    if lines:
        out.table(title, HEADERS, lines)
    else:
        print("nothing was walked")


def _write(output: Path, subject: Subject, walks: dict[str, PixelWalk], *, heat: bool) -> None:
    """pixel.json, pixel.png, heat.png if asked for, and a manifest."""
    from ..fileio.folder import MANIFEST_FILE, whole_folder
    from ..fileio.manifest import json_bytes
    from ..fileio.npz import file_sha256
    from ..report.pixel_picture import heat_picture, walk_picture

    files = {
        "pixel.json": json_bytes(walks_json(subject, walks)),
        "pixel.png": walk_picture(subject.scene, subject.gbuffer, walks),
    }
    if heat:
        from ..ssr.explain import sample_counts

        counts = {
            name: sample_counts(subject.view, subject.gbuffer, settings)
            for name, settings in subject.methods.items()
        }
        files["heat.png"] = heat_picture(counts)
    with whole_folder(output) as folder:
        for name, data in files.items():
            (folder / name).write_bytes(data)
        hashes = {name: file_sha256(folder / name) for name in files}
        (folder / MANIFEST_FILE).write_bytes(json_bytes({"format": FORMAT, "files": hashes}))

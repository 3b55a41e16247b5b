"""`ssr-ref render`: a scene becomes a golden bundle."""

from __future__ import annotations

import time
import warnings
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import SsrRefWarning
from .load_report import load_rows
from .options import CameraOptions, SceneOptions, TraceOptions, grouped
from .output import Output, length, percent

if TYPE_CHECKING:
    from ..pipeline import Frame


@grouped
def render(
    ctx: typer.Context,
    scene: Annotated[
        str,
        typer.Argument(metavar="SCENE", help="A mesh file, or a name that `ssr-ref scenes` lists."),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder that is created.")
    ],
    scene_options: SceneOptions,
    camera_options: CameraOptions,
    trace_options: TraceOptions,
    force: Annotated[
        bool, typer.Option("--force", help="Replace a golden bundle that is there.")
    ] = False,
    previews: Annotated[bool, typer.Option(help="Draw PNG pictures too.")] = True,
) -> None:
    """Render a scene with its reflections and write a golden bundle."""
    from ..fileio.bundle import check_target, write_bundle
    from ..pipeline import render as render_frame

    # Whatever can be refused is refused before the work starts.
    methods = trace_options.methods()
    scene_options.check()
    camera_options.given()
    check_target(output, force=force)

    out: Output = ctx.obj
    started = time.perf_counter()
    with out.progress() as progress:
        progress("load", 0.0)
        loaded = scene_options.load(scene)
        view = camera_options.view(loaded)
        load_seconds = time.perf_counter() - started
        first, *rest = methods
        more = {name: methods[name] for name in rest}
        frame = render_frame(loaded, view, methods[first], more=more, progress=progress)
        frame = replace(frame, timings={"load": load_seconds, **frame.timings})
        for text in frame.warnings:
            warnings.warn(text, SsrRefWarning, stacklevel=1)
        write_bundle(frame, output, force=force, previews=previews, progress=progress)
    _report(out, frame, first, output, time.perf_counter() - started)


def _report(out: Output, frame: Frame, first: str, output: Path, seconds: float) -> None:
    """What was made, on stdout. first: the name of the first method, "" if it has none."""
    from ..fileio.bundle import read_identity
    from ..scene import Scene

    if out.quiet and not out.json:
        return
    content = read_identity(output)
    camera = frame.camera
    report = frame.scene.report if isinstance(frame.scene, Scene) else None
    width, height = frame.settings.size
    methods = {name: _method_facts(frame.of(name)) for name in frame.more}
    counts = _method_facts(frame)
    if out.json:
        out.data(
            {
                "output": str(output),
                "scene": frame.scene.name,
                "load": asdict(report) if report is not None else None,
                "size": [width, height],
                **counts,
                **({"methods": {first: counts, **methods}} if methods else {}),
                "near": camera.near,
                "far": "inf" if camera.far == float("inf") else camera.far,
                "warnings": list(frame.warnings),
                "seconds": round(seconds, 3),
                "content_sha256": content,
            }
        )
        return
    settings, seen = frame.settings, counts["status"]
    what = "triangles" if isinstance(frame.scene, Scene) else "surfaces"
    common = sorted(seen, key=lambda name: -seen[name])
    out.facts(
        [
            ("golden bundle", str(output)),
            ("scene", f"{frame.scene.name} ({frame.scene.triangle_count} {what})"),
            *(load_rows(frame.scene) if out.verbose and isinstance(frame.scene, Scene) else ()),
            ("size", f"{width}x{height}"),
            (
                "lengths",
                f"thickness {length(settings.thickness)}, max_distance "
                f"{length(settings.max_distance)}, bias {length(settings.bias)}, near "
                f"{length(camera.near)}, far {length(camera.far)}",
            ),
            ("rays", f"{counts['rays']} ({percent(counts['rays'], counts['pixels'])} of pixels)"),
            ("hits", f"{counts['hits']} ({percent(counts['hits'], counts['rays'])} of rays)"),
            *(
                ("statuses" if i == 0 else "", f"{name} {percent(seen[name], counts['pixels'])}")
                for i, name in enumerate(common[:5])
            ),
            ("seconds", f"{seconds:.2f}"),
            ("content sha256", content),
        ]
    )
    if methods:
        method_table(out, "methods", {first or "first": counts, **methods})


def method_table(out: Output, title: str, methods: dict[str, Any]) -> None:
    """One line a method: hits, and the work of a ray."""
    rows = [
        (
            name,
            percent(counts["hits"], counts["rays"]),
            f"{counts['steps'] / max(counts['rays'], 1):.1f}",
            f"{counts['fetches'] / max(counts['rays'], 1):.1f}",
        )
        for name, counts in methods.items()
    ]
    out.table(title, ("method", "hits", "steps a ray", "fetches a ray"), rows)


def _method_facts(frame: Frame) -> dict[str, Any]:
    """Counts and settings of one method as JSON values."""
    from ..fileio.manifest import statistics

    counts = statistics(frame)
    return {
        **{name: counts[name] for name in ("pixels", "rays", "hits", "steps", "fetches")},
        "status": {name: n for name, n in counts["status"].items() if n},
        "settings": frame.settings.to_json(),
    }

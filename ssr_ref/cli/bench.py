"""`ssr-ref bench`: error against run time of every method, as table, diagram and page."""

from __future__ import annotations

import json
import os
import platform
import re
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import CameraError, SettingsError
from .options import CameraOptions, SceneOptions, TraceOptions, as_options, grouped
from .output import Output
from .parsing import parse_camera, read_json

if TYPE_CHECKING:
    from ..pipeline import Progress
    from ..study.bench import Bench, Row


@grouped
def bench(
    ctx: typer.Context,
    scenes: Annotated[
        list[str], typer.Argument(metavar="SCENE...", help="Scenes as for `render`; or: all.")
    ],
    scene_options: SceneOptions,
    camera_options: CameraOptions,
    trace_options: TraceOptions,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Folder for table, diagrams and page."),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace the files of a bench that is there.")
    ] = False,
    cameras: Annotated[
        Path | None,
        typer.Option(metavar="FILE.json", help="A list of cameras or views: all are averaged."),
    ] = None,
    repeats: Annotated[
        int, typer.Option(metavar="N", help="Timed runs of each case, 1 to 1000.")
    ] = 5,
    within: Annotated[
        str | None,
        typer.Option(metavar="P%", help="Print the cheapest case with at most so many wrong rays."),
    ] = None,
    budget: Annotated[
        str | None,
        typer.Option(metavar="Tms", help="Print the most exact case that takes at most so long."),
    ] = None,
    page: Annotated[bool, typer.Option(help="Draw diagrams and the HTML page too.")] = True,
    flip: Annotated[bool, typer.Option(help="Also the FLIP of the reflection.")] = True,
) -> None:
    """Trace scenes by every method and print error against run time."""
    from ..fileio.folder import MANIFEST_FILE, FolderKind, check_target, whole_folder
    from ..scenes import BUILTIN
    from ..settings import METHODS
    from ..study.bench import run_bench
    from ..study.sweep import sweep

    out: Output = ctx.obj
    base = trace_options.base()
    names = tuple(trace_options.method_names() or METHODS)
    most = None if within is None else parse_share(within)
    longest = None if budget is None else parse_seconds(budget)
    if not 1 <= repeats <= 1000:
        raise SettingsError(f"repeats is {repeats}; expected 1 to 1000")
    scene_options.check()
    views = None if cameras is None else read_json(cameras, parse_cameras, CameraError)
    if views is not None and camera_options.given() is not None:
        raise CameraError("both --cameras and --camera are given; expected one of them")
    kind = FolderKind("bench", "bench", FORMAT)
    if output is not None:
        check_target(output, kind, force=force)

    wanted = [name for word in scenes for name in (BUILTIN if word == "all" else [word])]
    benches: list[Bench] = []
    with out.progress() as progress:
        for i, name in enumerate(wanted):
            scene = scene_options.load(name)
            cases = sweep(base, scene.radius(), names)
            benches.append(
                run_bench(
                    scene,
                    views or [camera_options.view(scene)],
                    cases,
                    repeats=repeats,
                    flip=flip,
                    progress=_within(progress, name, i, len(wanted)),
                )
            )
        facts = machine_facts()
        if output is not None:
            from ..fileio.manifest import json_bytes
            from ..fileio.npz import file_sha256
            from ..report.bench_page import write_bench

            with whole_folder(output) as folder:
                files = write_bench(folder, benches, facts, page=page)
                hashes = {name: file_sha256(folder / name) for name in files}
                manifest = {"format": FORMAT, "files": hashes}
                (folder / MANIFEST_FILE).write_bytes(json_bytes(manifest))
    groups = (scene_options, camera_options, trace_options)
    picks = {
        name: _picked(one, most, longest, partial(_line, name, *groups))
        for name, one in zip(wanted, benches)
    }
    if out.json:
        from ..report.bench_page import bench_json

        data = json.loads(bench_json(benches, facts))
        out.data({**data, "recommended": picks, "output": str(output) if output else None})
    elif not out.quiet:
        _print(out, benches, wanted, picks, facts)
        if output is not None:
            print(f"\nwritten to {output}")


FORMAT = "ssr_ref bench"


def _within(progress: Progress, name: str, i: int, count: int) -> Progress:
    """Progress of scene i of several, as progress of all."""
    return lambda stage, share: progress(f"{name}: {stage}", (i + share) / count)


def parse_cameras(data: Any) -> list[Any]:
    """Cameras or views of a list, or of an object's "cameras"."""
    listed = data.get("cameras") if isinstance(data, dict) else data
    if not isinstance(listed, list) or not listed:
        raise CameraError("cameras are no list; expected one camera or view at least, in a list")
    return [parse_camera(entry) for entry in listed]


def parse_share(text: str) -> float:
    """0.01 of "1%" or "0.01". Raises SettingsError."""
    match = re.fullmatch(r"([0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*(%?)", text.strip())
    share = float(match[1]) / (100.0 if match[2] else 1.0) if match else -1.0
    if not 0.0 <= share <= 1.0:
        raise SettingsError(f"within is '{text}'; expected a share such as 1% or 0.01")
    return share


def parse_seconds(text: str) -> float:
    """0.02 of "20ms" or "0.02s". Raises SettingsError."""
    match = re.fullmatch(r"([0-9]*\.?[0-9]+)\s*(ms|s)", text.strip())
    if match is None:
        raise SettingsError(f"budget is '{text}'; expected a time such as 20ms or 0.5s")
    return float(match[1]) / (1e3 if match[2] == "ms" else 1.0)


def machine_facts() -> dict[str, str]:
    """Machine, threads, versions and the exact command."""
    import numba

    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text().splitlines()
        named = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
        model = named[0] if named else model
    versions = {"Python": platform.python_version()}
    for package in ("ssr_ref", "numpy", "numba", "matplotlib", "flip-evaluator"):
        try:
            versions[package] = metadata.version(package.replace("_", "-"))
        except metadata.PackageNotFoundError:
            versions[package] = "-"
    return {
        "machine": f"{model}, {os.cpu_count()} cores, {platform.system()}",
        "threads": str(numba.get_num_threads()),
        "versions": ", ".join(f"{name} {version}" for name, version in versions.items()),
        "command": shlex.join(["ssr-ref", *sys.argv[1:]]),
    }


def _picked(
    bench: Bench, most: float | None, longest: float | None, line: Callable[[Row], str]
) -> dict[str, str | None]:
    """What is recommended, as a line for the shell; None where nothing reaches it."""
    from ..study.pareto import best_within, cheapest_within

    costs = [row.total for row in bench.rows]
    errors = [row.errors.wrong for row in bench.rows]
    best: dict[str, int | None] = {}
    if most is not None:
        best["within"] = cheapest_within(costs, errors, most)
    if longest is not None:
        best["budget"] = best_within(costs, errors, longest)
    return {asked: None if i is None else line(bench.rows[i]) for asked, i in best.items()}


def _line(scene: str, *given: Any) -> str:
    """`ssr-ref render` with the options given and the settings of a row, the last argument."""
    *options, row = given
    values = {name: value for group in options for name, value in group.given_values().items()}
    values |= {"method": row.method, **row.changes}
    return shlex.join(["ssr-ref", "render", scene, "-o", "golden", *as_options(values)])


def _print(
    out: Output,
    benches: Sequence[Bench],
    names: Sequence[str],
    picks: Mapping[str, Mapping[str, str | None]],
    facts: Mapping[str, str],
) -> None:
    from ..report.bench_page import NOTHING, about
    from ..report.bench_table import SHOWN, cells, fronts

    out.facts(list(facts.items()))
    for name, bench in zip(names, benches):
        print(f"\n{bench.scene}: {about(bench)}")
        if not bench.rays:
            print(NOTHING)
            continue
        by_time, _ = fronts(bench)
        rows = [
            (("* " if i in by_time else "  ") + row.label, *cells(row, SHOWN))
            for i, row in enumerate(bench.rows)
        ]
        out.table("error against run time; *: Pareto front", ("case", *SHOWN), rows)
        for asked, line in picks[name].items():
            print(f"\n{asked}: {line or 'no case reaches it'}")
        for method, reason in bench.not_applicable:
            print(f"not applicable: {method}: {reason}")

"""Files of a bench: table (CSV, Markdown), JSON, diagrams (SVG), one self-contained HTML page."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from ..errors import SettingsError
from ..study.bench import Bench
from .bench_plot import front_lines, work_precision
from .bench_table import COLUMNS, SHOWN, cells, csv_text, fronts, markdown

HOW = (
    "Time of a case: its trace with slabs or planes prepared (trace_ms, median of the repeats, all "
    "cases taking turns) and the passes that it alone needs (passes_ms: back faces). Left out: "
    "loading and compiling (compile_s, once a process and cached after that), the G-buffer passes "
    "that every method needs, the composite that is the same for all, truth, and judging.",
    "wrong_%: rays that miss what the camera sees, hit something else or more than 1 px away, or "
    "hit although the truth is not on screen. recall_%, precision_%: right hits, of all that the "
    "screen shows and of all hits. p50_px, p95_px: distance to the truth over hits on the same "
    "surface. rel_mse, flip: of the reflection against ray-traced truth, over pixels with a ray, "
    "what the screen cannot know included. non_finite_px: pixels left out of these.",
    "steps, fetches: samples tested and depth reads a ray. block_steps: mean over 8x4 blocks of "
    "pixels of the largest step count in each, which is what lanes that run in step pay.",
    "Bold: on the Pareto front of wrong_% against total_ms.",
)


def write_bench(
    folder: Path, benches: Sequence[Bench], facts: Mapping[str, str], *, page: bool = True
) -> list[str]:
    """Write bench.json, bench.csv, bench.md, and SVG and HTML unless `page` is False.

    facts: machine, versions, command. Returns the files' names. Raises SettingsError where
    matplotlib or jinja2 is missing.
    """
    files: dict[str, bytes] = {
        "bench.json": bench_json(benches, facts),
        "bench.csv": csv_text(benches).encode(),
        "bench.md": bench_markdown(benches, facts).encode(),
    }
    if page:
        plots = {bench.scene: work_precision(bench) for bench in benches if bench.rays}
        files |= {f"{plain(name)}.svg": svg for name, svg in plots.items()}
        files["bench.html"] = bench_html(benches, facts, plots).encode()
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return sorted(files)


def plain(name: str) -> str:
    """A scene's name as a file name."""
    return "".join(c if c.isalnum() or c in "._-" else "_" for c in name) or "scene"


def bench_json(benches: Sequence[Bench], facts: Mapping[str, str]) -> bytes:
    """Everything, with NaN as null."""
    data = {"facts": dict(facts), "scenes": [_scene_json(bench) for bench in benches]}
    return (json.dumps(data, sort_keys=True, indent=1, allow_nan=False) + "\n").encode()


def _scene_json(bench: Bench) -> dict[str, Any]:
    by_time, by_fetches = fronts(bench)
    return {
        "scene": bench.scene,
        "scene_sha256": bench.scene_sha256,
        "triangles": bench.triangles,
        "size": list(bench.size),
        "cameras": bench.cameras,
        "repeats": bench.repeats,
        "rays": bench.rays,
        "truth_seconds": bench.truth_seconds,
        "knowable": None if bench.knowable is None else bench.knowable.to_json(),
        "not_applicable": [list(pair) for pair in bench.not_applicable],
        "rows": [
            row.to_json() | {"pareto_seconds": i in by_time, "pareto_fetches": i in by_fetches}
            for i, row in enumerate(bench.rows)
        ],
    }


def bench_markdown(benches: Sequence[Bench], facts: Mapping[str, str]) -> str:
    """A table a scene."""
    parts = ["\n".join(f"- {name}: {value}" for name, value in facts.items()) + "\n"]
    for bench in benches:
        parts.append(f"## {bench.scene}\n\n{about(bench)}\n")
        parts.append(markdown(bench) if bench.rays else NOTHING + "\n")
    return "\n".join(parts)


NOTHING = "No pixel reflects: there is nothing to compare."


def about(bench: Bench) -> str:
    """What was rendered, in one sentence."""
    width, height = bench.size
    views = "" if bench.cameras == 1 else f" from {bench.cameras} cameras"
    return (
        f"{bench.triangles:,} triangles, {width}x{height}{views}, {bench.rays:,} rays, median of "
        f"{bench.repeats}; scene {bench.scene_sha256[:16]}."
    )


def bench_html(
    benches: Sequence[Bench], facts: Mapping[str, str], plots: Mapping[str, bytes]
) -> str:
    """The page as text; it loads nothing from elsewhere."""
    try:
        import jinja2
        import markupsafe
    except ImportError:
        raise SettingsError(
            "jinja2 is not installed; expected it for the page: pip install 'ssr-ref[report]'"
        ) from None

    names = [*SHOWN, *(name for name, _, _ in COLUMNS if name not in SHOWN)]
    source = resources.files(__package__).joinpath("templates/bench.html.j2").read_text("utf-8")
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    entries = []
    for bench in benches:
        by_time, _ = fronts(bench)
        lines = [] if bench.rays else [NOTHING]
        lines += [f"Not applicable: {name}: {reason}." for name, reason in bench.not_applicable]
        svg = plots.get(bench.scene, b"").decode()
        entries.append(
            {
                "name": bench.scene,
                "about": about(bench),
                "lines": lines,
                "plot": markupsafe.Markup(svg[svg.find("<svg") :]),
                "fronts": list(zip(("milliseconds", "depth reads"), front_lines(bench))),
                "rows": [
                    {"label": row.label, "front": i in by_time, "cells": cells(row, names)}
                    for i, row in enumerate(bench.rows)
                ],
            }
        )
    page: str = environment.from_string(source).render(
        scenes=", ".join(bench.scene for bench in benches),
        facts=list(facts.items()),
        entries=entries,
        columns=names,
        how=HOW,
    )
    return page

"""Every method on meshes and against closed forms: outcomes, work, error, time.

    python -m benchmarks.methods [--size 960x540] [--markdown] [SCENE ...]

On mesh scenes (teapot, poles): hit share, statuses, steps and reads a ray, ms of the trace (median
of 5, all methods taking turns, warm). On closed-form scenes (320x181, float64 buffers, sheets
endless): missed and wrong of what is visible, false of all rays, median and 95th percentile of the
distance to the closed form in pixels.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np

import ssr_ref
from ssr_ref import Settings
from ssr_ref.analytic import analytic_gbuffer, analytic_reflections, hit_errors
from ssr_ref.analytic.scenes import SCENES
from ssr_ref.buffers import Status
from ssr_ref.cli.parsing import parse_size
from ssr_ref.fileio.manifest import NOT_WALKED
from ssr_ref.pipeline import Stages, draw_gbuffer, make_camera
from ssr_ref.settings import method_settings
from ssr_ref.ssr.trace import trace

from .common import machine

METHODS: dict[str, tuple[str, dict[str, Any]]] = {
    "march": ("march", {"growth": "constant"}),
    "march, linear growth": ("march", {"growth": "linear"}),
    "dda": ("dda", {}),
    "dda, constant thickness": ("dda", {"thickness_from": "constant"}),
    "dda, stride 4": ("dda", {"stride": 4}),
    "dda, stride 4, bisect": ("dda", {"stride": 4, "refine": "bisect"}),
    "dda, stride 16, jitter": ("dda", {"stride": 16, "jitter": True}),
    "dda, planes": ("dda", {"surface": "plane"}),
    "exact": ("exact", {}),
    "planes": ("planes", {}),
}
CLOSED = ("sphere_on_plane", "box_on_plane", "corner", "clutter")


def settings_of(name: str, base: Settings) -> Settings:
    """The settings of a row of `METHODS`."""
    method, changes = METHODS[name]
    return method_settings(method, base, **changes)


def mesh_rows(scene_name: str, size: tuple[int, int]) -> tuple[list[str], list[list[str]]]:
    """Header and one row a method."""
    scene = ssr_ref.load(scene_name)
    more = {f"m{i}": settings_of(name, Settings(size=size)) for i, name in enumerate(METHODS)}
    drawn = draw_gbuffer(scene, None, Settings(size=size), more, Stages(None))
    runs = [lambda s=s: trace(drawn.view, drawn.gbuffer, s) for s in drawn.more.values()]
    times = np.zeros((6, len(runs)))
    for repeat in range(6):
        for i, run in enumerate(runs):
            start = time.perf_counter()
            run()
            times[repeat, i] = time.perf_counter() - start
    ms = 1e3 * np.median(times[1:], axis=0)
    found = [run() for run in runs]
    counts = [np.bincount(hits.status.ravel(), minlength=len(Status)) for hits in found]
    seen = [s for s in Status if s not in NOT_WALKED and any(c[s] for c in counts)]
    rows = []
    for name, hits, count, t in zip(METHODS, found, counts, ms):
        rays = int(hits.status.size - sum(count[s] for s in NOT_WALKED))
        rows.append(
            [
                name,
                f"{count[Status.HIT] / rays:.2%}",
                f"{hits.steps.sum(dtype=np.int64) / rays:.1f}",
                f"{hits.fetches.sum(dtype=np.int64) / rays:.1f}",
                f"{t:.1f}",
                *(str(count[s]) for s in seen),
            ]
        )
    return ["method", "hits", "steps", "reads", "ms", *(s.name for s in seen)], rows


def closed_rows(scene_name: str) -> tuple[list[str], list[list[str]]]:
    """Header and one row a method."""
    scene = SCENES[scene_name]()
    rows = []
    for name in METHODS:
        base = Settings(
            size=(320, 181), thickness=np.inf, buffer_dtype="float64",
            max_distance=8.0 * scene.radius(),
        )  # fmt: skip
        settings = settings_of(name, base).resolved(scene.radius())
        camera = make_camera(scene, None, settings, scene.radius())
        gbuffer = analytic_gbuffer(scene, camera, settings.size)
        truth = analytic_reflections(scene, camera, settings.size, gbuffer, settings.max_distance)
        e = hit_errors(trace(camera.params(settings.size), gbuffer, settings), truth, gbuffer)
        rows.append(
            [name, str(e.self_hits), f"{e.missed:.2%}", f"{e.wrong:.2%}", f"{e.false:.2%}",
             f"{e.p50:.4f}", f"{e.p95:.4f}"]
        )  # fmt: skip
    return ["method", "self", "missed", "wrong", "false", "p50 px", "p95 px"], rows


def show(title: str, header: list[str], rows: list[list[str]], markdown: bool) -> None:
    """Print one table."""
    print(f"\n{title}" + ("\n" if markdown else ""))
    if markdown:
        print("| " + " | ".join(header) + " |\n" + "|---" * len(header) + "|")
        for row in rows:
            print("| " + " | ".join(row) + " |")
        return
    widths = [max(len(row[i]) for row in (header, *rows)) for i in range(len(header))]
    for row in (header, *rows):
        print("  ".join(f"{v:<{w}}" if i == 0 else f"{v:>{w}}"
                        for i, (v, w) in enumerate(zip(row, widths))))  # fmt: skip


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", default=["teapot", "poles", *CLOSED])
    parser.add_argument("--size", type=parse_size, default=(960, 540))
    parser.add_argument("--markdown", action="store_true")
    given = parser.parse_args()
    print(machine())
    for name in given.scenes:
        closed = name in SCENES
        header, rows = closed_rows(name) if closed else mesh_rows(name, given.size)
        size = (320, 181) if closed else given.size
        show(f"{name}, {size[0]}x{size[1]}", header, rows, given.markdown)


if __name__ == "__main__":
    main()

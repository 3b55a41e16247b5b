"""Every tracer's hits against the closed form, on every analytic scene.

    python -m benchmarks.analytic [--size 320x181] [--orthographic] [--thickness inf] [SCENE ...]

Columns: `ssr_ref.analytic.HitErrors`, shares in %, distances in px; gap: greatest and mean over
columns, where an object stands on a floor; ms: median of the trace alone; fetches a ray. Buffers
are float64. Sheets have no back: their slab is `thickness`, endless unless said, which makes a
plane a half-space.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from ssr_ref import Settings
from ssr_ref.analytic import (
    AnalyticScene,
    Plane,
    analytic_gbuffer,
    analytic_reflections,
    contact_gaps,
    hit_errors,
)
from ssr_ref.analytic.scenes import SCENES
from ssr_ref.cli.parsing import parse_size
from ssr_ref.pipeline import make_camera
from ssr_ref.ssr.trace import trace

from .common import machine, median_ms

TRACERS: dict[str, dict[str, Any]] = {
    "cells": {"tracer": "cells"},
    "dda": {},
    "dda stride 4": {"stride": 4},
    "planes": {"tracer": "cells", "surface": "plane"},
    "planes dda": {"surface": "plane"},
    "planes 4": {"surface": "plane", "stride": 4},
    "march": {"tracer": "march", "max_steps": 1000, "growth": "constant", "max_distance": 8.0},
}
STANDING = {"sphere_on_plane": 1, "box_on_plane": 1, "corner": 2}
"""Object that stands on the floor (object 0)."""


def report(scene: AnalyticScene, size: tuple[int, int], thickness: float | None) -> None:
    """Print one row a tracer."""
    for name, method in TRACERS.items():
        settings = Settings(
            **{"size": size, "thickness": thickness, "max_distance": np.inf} | method,
            buffer_dtype="float64",
        ).resolved(scene.radius())
        camera = make_camera(scene, None, settings, scene.radius())
        view = camera.params(size)
        gbuffer = analytic_gbuffer(scene, camera, size)
        truth = analytic_reflections(scene, camera, size, gbuffer)
        hits = trace(view, gbuffer, settings)
        e = hit_errors(hits, truth, gbuffer)
        ms = median_ms(lambda v=view, g=gbuffer, s=settings: trace(v, g, s), 3, 1)
        gap = ""
        if scene.name in STANDING and isinstance(scene.shapes[0], Plane):
            shape = STANDING[scene.name]
            gaps = contact_gaps(hits, truth, gbuffer, floor=0, shape=shape, stride=settings.stride)
            gaps = gaps[gaps >= 0]
            gap = f"{gaps.max()} / {gaps.mean():.2f}" if len(gaps) else ""
        fetches = int(hits.fetches.sum(dtype=np.int64)) / max(e.rays, 1)
        print(
            f"{scene.name:24s} {name:13s} {e.rays:6d} {e.visible:6d} {e.self_hits:5d} "
            f"{e.missed:7.2%} {e.wrong:7.2%} {e.false:7.2%} {e.unseen:7.2%} "
            f"{e.p50:6.3f} {e.p95:6.3f} {gap:>9s} {ms:6.1f} {fetches:8.1f}"
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=", ".join(SCENES))
    parser.add_argument("--size", type=parse_size, default=(320, 181))
    parser.add_argument("--orthographic", action="store_true")
    parser.add_argument("--thickness", type=float, default=np.inf)
    given = parser.parse_args()
    for name in given.scenes:
        if name not in SCENES:
            parser.error(f"there is no scene '{name}'; expected some of {', '.join(SCENES)}")
    print(machine())
    print(f"{given.size[0]}x{given.size[1]}, thickness of sheets {given.thickness:g}")
    print(
        f"{'scene':24s} {'tracer':13s} {'rays':>6s} {'V':>6s} {'self':>5s} {'missed':>7s} "
        f"{'wrong':>7s} {'false':>7s} {'unseen':>7s} {'p50':>6s} {'p95':>6s} {'gap':>9s} "
        f"{'ms':>6s} {'fetches':>8s}"
    )
    for name in given.scenes or SCENES:
        report(SCENES[name](orthographic=given.orthographic), given.size, given.thickness)


if __name__ == "__main__":
    main()

"""Time of the tracers beside their error against exact cells, on one G-buffer.

    NUMBA_NUM_THREADS=1 python -m benchmarks.trace

Error: share of rays whose hit or miss differs from exact cells on the same buffers, or whose hit
lies more than 1 px away (`wrong`), and the 95th percentile of the distance over common hits.
"""

from __future__ import annotations

import numpy as np

import ssr_ref
from ssr_ref.buffers import Status
from ssr_ref.pipeline import make_camera, raster_options, with_radiance
from ssr_ref.raster.geometry import flatten
from ssr_ref.raster.rasterize import rasterize
from ssr_ref.ssr.trace import trace

from .common import machine, median_ms

SIZE = (960, 540)
METHODS: list[dict[str, object]] = [
    {"tracer": "cells"},
    {},
    {"interval": "cell"},
    {"stride": 4},
    {"stride": 4, "jitter": True},
    {"stride": 4, "refine": "none"},
    {"stride": 16},
    {"thickness_from": "constant"},
    {"tracer": "cells", "thickness_from": "constant"},
]


def main() -> None:
    """Print one row a method."""
    print(machine())
    print(f"teapot, {SIZE[0]}x{SIZE[1]}")
    print("    ms  ns/ray  ns/step  steps/ray  fetches/ray  wrong  p95 px  method")
    scene = ssr_ref.load("teapot")
    radius = scene.radius()
    for method in METHODS:
        settings = ssr_ref.Settings(size=SIZE, **method).resolved(radius)  # type: ignore[arg-type]
        view = make_camera(scene, None, settings, radius).params(SIZE)
        geometry = flatten(scene)
        gbuffer, positions = rasterize(view, geometry, raster_options(settings))
        gbuffer = with_radiance(view, geometry, positions, gbuffer, scene)
        exact = trace(view, gbuffer, ssr_ref.Settings(
            size=SIZE, tracer="cells", thickness_from=settings.thickness_from
        ).resolved(radius))  # fmt: skip
        hits = trace(view, gbuffer, settings)
        ms = median_ms(lambda v=view, g=gbuffer, s=settings: trace(v, g, s), 5, 1)

        rays = int((hits.steps > 0).sum())
        steps = int(hits.steps.sum(dtype=np.int64))
        fetches = int(hits.fetches.sum(dtype=np.int64))
        a, b = exact.status == Status.HIT, hits.status == Status.HIT
        distance = np.abs(exact.hit_px - hits.hit_px)[a & b].max(axis=-1)
        wrong = (int((a != b).sum()) + int((distance > 1.0).sum())) / rays
        words = " ".join(f"{k}={v}" for k, v in method.items()) or "dda (default)"
        print(
            f"{ms:6.1f}  {1e6 * ms / rays:6.0f}  {1e6 * ms / steps:7.2f}  {steps / rays:9.1f}  "
            f"{fetches / rays:11.1f}  {wrong:5.2%}  {np.quantile(distance, 0.95):6.3f}  {words}"
        )


if __name__ == "__main__":
    main()

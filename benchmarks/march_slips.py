"""What each slip of the published 3-D march changes on a built-in scene.

    python -m benchmarks.march_slips [SCENE] [MAX_DISTANCE]

Rays of the right march beside the same with one slip alone, and with all of them: hits won and
lost, hits moved by more than a pixel, the greatest move, and self-hits.
"""

from __future__ import annotations

import sys

import numpy as np

import ssr_ref
from benchmarks.common import machine
from benchmarks.slips import HEAD, drawn, table
from ssr_ref.camera import ViewParams
from ssr_ref.pipeline import Frame
from ssr_ref.ssr import listing_march
from ssr_ref.ssr.trace import trace

SLIPS = (
    "STRICT",
    "NO_WINDOW",
    "NOISE_ALONG",
    "OWN_PIXEL",
    "BASE_STEP",
    "NO_DISTANCE",
    "UNREFINED_FADES",
    "ALL_SLIPS",
)


def fades(frame: Frame, view: ViewParams) -> str:
    """How far the printed edge fade, p = 2, is off when it is taken before refinement."""
    edge = []
    for slips in (0, listing_march.UNREFINED_FADES):
        hits = trace(view, frame.gbuffer, frame.settings, slips=slips)
        assert hits.fade_px is not None
        uv = hits.fade_px / (view.width, view.height)
        edge.append(1.0 - ((2.0 * (uv - 0.5)) ** 2).sum(axis=-1))
    off = np.abs(edge[1] - edge[0])[np.isfinite(edge[0])]
    return (
        f"UNREFINED_FADES: the edge fade of a hit is off by {off.mean():.3f} in the mean, by "
        f"{off.max():.2f} at most."
    )


def main() -> None:
    name = sys.argv[1] if len(sys.argv) > 1 else "teapot"
    far = float(sys.argv[2]) if len(sys.argv) > 2 else None
    settings = ssr_ref.Settings(
        size=(480, 270), tracer="march", jitter=True, max_steps=64, listing=True, max_distance=far
    )
    frame, view = drawn(name, settings)
    rays, rows = table(frame, view, {slip: getattr(listing_march, slip) for slip in SLIPS})
    print(f"{name} 480x270, {rays} rays, 64 steps, jitter; {machine()}")
    print("\n".join([HEAD, *rows]))
    print(fades(frame, view))


if __name__ == "__main__":
    main()

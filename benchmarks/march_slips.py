"""What each slip of the published 3-D march changes on a built-in scene.

    python -m benchmarks.march_slips [SCENE]

Rays of the right march beside the same with one slip alone, and with all of them: hits won and
lost, hits moved by more than a pixel, and the greatest move.
"""

from __future__ import annotations

import sys

import numpy as np

import ssr_ref
from benchmarks.common import machine
from ssr_ref.buffers import HitBuffer, Status
from ssr_ref.ssr import listing_march
from ssr_ref.ssr import trace as tracing

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


def compare(right: HitBuffer, other: HitBuffer, rays: int) -> tuple[float, float, float, float]:
    """Shares of rays in percent: hits won, lost, moved by more than 1 px; greatest move in px."""
    a, b = right.status == Status.HIT, other.status == Status.HIT
    move = np.hypot(*(right.hit_px - other.hit_px)[a & b].T)
    shares = ((b & ~a).sum(), (a & ~b).sum(), (move > 1.0).sum())
    return (*(100.0 * float(n) / rays for n in shares), float(move.max(initial=0.0)))


def main() -> None:
    name = sys.argv[1] if len(sys.argv) > 1 else "teapot"
    settings = ssr_ref.Settings(
        size=(480, 270), tracer="march", jitter=True, max_steps=64, listing=True
    )
    scene = ssr_ref.load(name)
    frame = ssr_ref.render(scene, settings=settings)
    view = frame.camera.params(settings.size)
    all_slips = tracing.ALL_SLIPS
    try:
        tracing.ALL_SLIPS = 0
        right = tracing.trace(view, frame.gbuffer, frame.settings)
        rays = int((right.steps > 0).sum())
        print(f"{name} 480x270, {rays} rays, 64 steps, jitter; {machine()}")
        print("| slip | hits won % | hits lost % | moved > 1 px % | greatest move px |")
        print("|---|---|---|---|---|")
        for slip in SLIPS:
            tracing.ALL_SLIPS = getattr(listing_march, slip)
            other = tracing.trace(view, frame.gbuffer, frame.settings)
            won, lost, moved, greatest = compare(right, other, rays)
            print(f"| {slip} | {won:.2f} | {lost:.2f} | {moved:.2f} | {greatest:.0f} |")
    finally:
        tracing.ALL_SLIPS = all_slips


if __name__ == "__main__":
    main()

"""How often pixels are read by all rays: the 3-D march against walks in screen space.

    python -m benchmarks.sample_counts [SCENE]

Reads a pixel and ray that pass over it cannot be told apart here, so the table has the share of
pixels that no ray tests, quantiles of the counts, and what share of all reads repeats a pixel that
the same ray has read already.
"""

from __future__ import annotations

import sys

import numpy as np

import ssr_ref
from ssr_ref.pipeline import Stages, draw_gbuffer
from ssr_ref.settings import method_settings
from ssr_ref.ssr.explain import sample_counts, trace_pixel

SIZE = (480, 270)
METHODS = {
    "march, equal steps": ("march", {"growth": "constant"}),
    "march, growing steps": ("march", {}),
    "dda": ("dda", {}),
    "exact": ("exact", {}),
}
RAYS = 400


def main() -> None:
    """Print one row a method."""
    name = sys.argv[1] if len(sys.argv) > 1 else "poles"
    base = ssr_ref.Settings(size=SIZE)
    more = {
        f"m{i}": method_settings(method, base, **changes)
        for i, (method, changes) in enumerate(METHODS.values())
    }
    drawn = draw_gbuffer(ssr_ref.load(name), None, base, more, Stages(None))
    assert drawn.gbuffer.reflectivity is not None
    mirror = (drawn.gbuffer.reflectivity > 0).any(axis=2)
    rng = np.random.default_rng(0)
    ys, xs = np.nonzero(mirror)
    picked = rng.choice(len(ys), RAYS, replace=False)
    print("| method | reads | never read | median | 99 % | most | read again by the same ray | "
          "pixels skipped between two reads |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|")
    for label, settings in zip(METHODS, drawn.more.values()):
        counts = sample_counts(drawn.view, drawn.gbuffer, settings)
        again = total = skipped = 0
        for k in picked:
            walk = trace_pixel(drawn.view, drawn.gbuffer, settings, int(xs[k]), int(ys[k]))
            samples = walk.rows[walk.rows[:, 0] == 0][:, 2:4]
            total += len(samples)
            again += len(samples) - len({tuple(p) for p in samples})
            steps = np.abs(np.diff(samples, axis=0)).max(axis=1, initial=0)
            skipped += int(np.maximum(steps - 1, 0).sum())
        print(
            f"| {label} | {int(counts.sum()):,} | {np.mean(counts == 0):.1%} | "
            f"{np.median(counts):.0f} | {np.quantile(counts, 0.99):.0f} | {counts.max()} | "
            f"{again / max(total, 1):.1%} | {skipped / max(total, 1):.2f} |"
        )


if __name__ == "__main__":
    main()

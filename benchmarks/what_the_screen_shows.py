"""Two curves behind screen-space reflection.

    python -m benchmarks.what_the_screen_shows [--docs]

1. Share of reflected rays whose truth is on screen and VISIBLE, against the camera's height over
   the mirror: the insight that the method lives on.
2. Time and holes of the 3-D march against its step: rays whose truth is VISIBLE and that are
   missed or hit something else.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

import ssr_ref
from ssr_ref import Settings
from ssr_ref.buffers import TruthClass
from ssr_ref.pipeline import Stages, draw_gbuffer
from ssr_ref.settings import method_settings
from ssr_ref.study.bench import run_bench
from ssr_ref.study.sweep import Case
from ssr_ref.truth import trace_truth

from .common import machine

SIZE = (480, 270)
HEIGHTS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2)
SCENES = ("teapot", "poles", "steps", "water")
STEPS = tuple(range(3, 12))
DOCS = Path(__file__).parents[1] / "docs"


def classes_at(name: str, height: float) -> np.ndarray:
    """Rays by `TruthClass` with the scene's own view lifted to a height over its mirror.

    The mirror's height is that of the scene's lowest point; the eye keeps its distance sideways and
    looks at the same point.
    """
    scene = ssr_ref.load(name)
    assert scene.view is not None
    floor = float(scene.world_bounds()[0][1])
    eye = np.array(scene.view.eye, float)
    reach = float(np.hypot(*(eye - np.array(scene.view.target, float))[[0, 2]]))
    lifted = replace(scene.view, eye=(eye[0], floor + height * reach, eye[2]))
    drawn = draw_gbuffer(scene, lifted, Settings(size=SIZE), {}, Stages(None))
    truth = trace_truth(scene, drawn.camera, drawn.settings, drawn.gbuffer)
    return np.bincount(truth.truth.ravel(), minlength=len(TruthClass))


def heights() -> dict[str, list[list[float]]]:
    """Shares of rays by class (all but NO_RAY), for each scene and height."""
    found: dict[str, list[list[float]]] = {}
    print("\nshare of rays by class, %, against the eye's height over the mirror / its distance")
    print(f"{'scene':10s} {'height':>7s} " + " ".join(f"{c.name:>12s}" for c in TruthClass if c))
    for name in SCENES:
        found[name] = []
        for height in HEIGHTS:
            counts = classes_at(name, height)
            rays = counts[1:].sum()
            shares = (counts[1:] / rays).tolist() if rays else [float("nan")] * 5
            found[name].append(shares)
            print(f"{name:10s} {height:7.2f} " + " ".join(f"{100 * s:12.1f}" for s in shares))
    return found


def steps(name: str) -> list[tuple[float, float, float, float]]:
    """(step / radius, ms, missed share of visible, wrong share) without and with refinement."""
    scene = ssr_ref.load(name)
    radius = scene.radius()
    base = Settings(size=SIZE)
    cases = [
        Case("march", method_settings("march", base, growth="constant", step=radius * 2.0**-n))
        for n in STEPS
    ]
    bench = run_bench(scene, [None], cases, repeats=3, flip=False)
    rows = []
    print(f"\n{name}: step / radius, ms, holes % of visible, wrong % of rays")
    for n, row in zip(STEPS, bench.rows):
        holes = 1.0 - row.errors.recall
        rows.append((2.0**-n, 1e3 * row.total, holes, row.errors.wrong))
        print(f"2^-{n:<3d} {1e3 * row.total:9.1f} {100 * holes:8.2f} {100 * row.errors.wrong:8.2f}")
    return rows


def plot(by_height: dict[str, list[list[float]]], by_step: dict[str, list]) -> bytes:
    """Both curves as one SVG."""
    import io

    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    with mpl.rc_context({"svg.hashsalt": "ssr_ref", "font.size": 10}):
        figure = Figure(figsize=(12.5, 4.2), layout="constrained")
        axes = figure.add_subplot(1, 3, 1)
        for name, shares in by_height.items():
            axes.plot(HEIGHTS, [100 * s[-1] for s in shares], "o-", label=name)
        axes.set(xscale="log", xlabel="height of the eye over the mirror / distance",
                 ylabel="rays whose truth is VISIBLE, %", ylim=(0, 100))  # fmt: skip
        axes.legend()
        axes.grid(alpha=0.3)
        for i, (what, index) in enumerate((("milliseconds", 1), ("holes, % of visible", 2))):
            axes = figure.add_subplot(1, 3, i + 2)
            for name, rows in by_step.items():
                values = [row[index] * (100 if index == 2 else 1) for row in rows]
                axes.plot([row[0] for row in rows], values, "o-", label=name)
            axes.set(xscale="log", yscale="log", ylabel=what, xlabel="step of the march / radius")
            axes.legend()
            axes.grid(alpha=0.3)
        out = io.BytesIO()
        FigureCanvasSVG(figure).print_svg(out, metadata={"Date": None, "Creator": None})
    return out.getvalue()


def main() -> None:
    """Print both tables; with --docs also draw docs/figures/what_the_screen_shows.svg."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--docs", action="store_true")
    given = parser.parse_args()
    print(machine())
    by_height = heights()
    by_step = {name: steps(name) for name in ("teapot", "poles")}
    if given.docs:
        (DOCS / "figures").mkdir(exist_ok=True)
        (DOCS / "figures" / "what_the_screen_shows.svg").write_bytes(plot(by_height, by_step))


if __name__ == "__main__":
    main()

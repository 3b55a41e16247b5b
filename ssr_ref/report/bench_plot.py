"""Work-precision diagrams: error against seconds, reads and block steps, with the Pareto front."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import Any

from ..errors import SettingsError
from ..study.bench import Bench, Row
from ..study.pareto import pareto_front

COLORS = {
    "march": "#c44e52",
    "dda": "#4c72b0",
    "dda, planes": "#55a0d8",
    "exact": "#55a868",
    "planes": "#8172b2",
    "planar": "#ccb974",
    "environment": "#8c6d5a",
}
MARKERS = {"none": "o", "rewalk": "s", "bisect": "^", "secant": "D"}
FLOOR = 1e-6
"""An error of 0 has no logarithm: it is drawn here, on a line of its own."""


def work_precision(bench: Bench) -> bytes:
    """An SVG of three diagrams. Colour: method; shape: refinement; hollow: constant thickness.

    The Pareto front is a line, its rows ringed and numbered by rising cost (`front_lines`).

    Raises SettingsError where matplotlib is missing.
    """
    mpl, Figure, Line2D, to_svg = _matplotlib()
    axes_of: tuple[tuple[str, Callable[[Row], float]], ...] = (
        ("milliseconds a frame", lambda r: 1e3 * r.total),
        ("depth reads a ray", lambda r: r.fetches),
        ("largest steps of 8x4 pixels", lambda r: r.block_steps),
    )
    with mpl.rc_context({"svg.hashsalt": "ssr_ref", "font.size": 10}):
        figure = Figure(figsize=(15.0, 5.4), layout="constrained")
        for i, (what, cost) in enumerate(axes_of):
            axes = figure.add_subplot(1, len(axes_of), i + 1)
            costs = [cost(row) for row in bench.rows]
            errors = [row.errors.wrong for row in bench.rows]
            front = pareto_front(costs, errors)
            shown = [max(error, FLOOR) for error in errors]
            for row, x, y in zip(bench.rows, costs, shown):
                color = COLORS[family(row)]
                hollow = row.settings.thickness_from == "constant"
                axes.plot(
                    x, y, MARKERS[row.settings.refinement], markersize=6, alpha=0.85, mec=color,
                    mfc="none" if hollow else color, markeredgewidth=1.0 if hollow else 0.0,
                )  # fmt: skip
            xs, ys = [costs[k] for k in front], [shown[k] for k in front]
            axes.plot(xs, ys, "-", color="black", linewidth=0.8, drawstyle="steps-post", zorder=1)
            axes.plot(xs, ys, "o", markersize=11, mfc="none", mec="black", linewidth=0.8)
            for number, k in enumerate(front, 1):
                axes.annotate(
                    str(number), (costs[k], shown[k]), xytext=(7, 7), textcoords="offset points",
                    fontsize=9,
                )  # fmt: skip
            axes.set(xscale="log", yscale="log", xlabel=what)
            axes.xaxis.set_minor_formatter("")
            if i == 0:
                axes.set_ylabel("rays missed or wrong, share")
            axes.grid(True, which="major", alpha=0.3)
            if min(shown, default=1.0) == FLOOR:
                axes.axhline(FLOOR, color="grey", linewidth=0.8, linestyle=":")
                axes.annotate("0", (0.01, FLOOR), xycoords=("axes fraction", "data"), va="bottom")
        used = {family(row): None for row in bench.rows}
        shapes = {row.settings.refinement: None for row in bench.rows}
        keys = [
            Line2D([], [], marker="o", linestyle="", color=COLORS[name], label=name)
            for name in used
        ]
        keys += [
            Line2D([], [], marker=MARKERS[name], linestyle="", color="grey", label=f"refine {name}")
            for name in shapes
        ]
        keys.append(Line2D([], [], marker="o", mfc="none", mec="grey", linestyle="",
                           label="constant thickness"))  # fmt: skip
        figure.legend(handles=keys, loc="outside upper center", ncols=len(keys), fontsize=9)
        return to_svg(figure)


def overview(benches: Sequence[Bench]) -> bytes:
    """An SVG of the Pareto fronts of several scenes: wrong share against milliseconds."""
    mpl, Figure, Line2D, to_svg = _matplotlib()
    shown = [bench for bench in benches if bench.rays]
    columns = min(4, max(1, len(shown)))
    rows = -(-len(shown) // columns)
    with mpl.rc_context({"svg.hashsalt": "ssr_ref", "font.size": 9}):
        figure = Figure(figsize=(3.4 * columns, 0.5 + 3.0 * rows), layout="constrained")
        used: dict[str, None] = {}
        for i, bench in enumerate(shown):
            axes = figure.add_subplot(rows, columns, i + 1)
            costs = [1e3 * row.total for row in bench.rows]
            errors = [max(row.errors.wrong, FLOOR) for row in bench.rows]
            for row, x, y in zip(bench.rows, costs, errors):
                used[family(row)] = None
                axes.plot(x, y, "o", color=COLORS[family(row)], markersize=3, markeredgewidth=0)
            front = pareto_front(costs, errors)
            axes.plot(
                [costs[k] for k in front], [errors[k] for k in front], "-", color="black",
                linewidth=0.8, drawstyle="steps-post", zorder=1,
            )  # fmt: skip
            axes.set(xscale="log", yscale="log", title=bench.scene)
            axes.xaxis.set_minor_formatter("")
            axes.grid(True, which="major", alpha=0.3)
            if i % columns == 0:
                axes.set_ylabel("wrong rays, share")
            if i >= len(shown) - columns:
                axes.set_xlabel("ms a frame")
        keys = [
            Line2D([], [], marker="o", linestyle="", color=COLORS[name], label=name)
            for name in used
        ]
        figure.legend(handles=keys, loc="outside upper center", ncols=max(1, len(keys)))
        return to_svg(figure)


def _matplotlib() -> tuple[Any, Any, Any, Callable[[Any], bytes]]:
    """matplotlib, Figure, Line2D, and a function from a figure to SVG without a date."""
    try:
        import matplotlib as mpl
        from matplotlib.backends.backend_svg import FigureCanvasSVG
        from matplotlib.figure import Figure
        from matplotlib.lines import Line2D
    except ImportError:
        raise SettingsError(
            "matplotlib is not installed; expected it for diagrams: pip install 'ssr-ref[report]'"
        ) from None

    def to_svg(figure: Any) -> bytes:
        out = io.BytesIO()
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(out, metadata={"Date": None, "Creator": None})
        return out.getvalue()

    return mpl, Figure, Line2D, to_svg


def front_lines(bench: Bench) -> tuple[list[str], list[str]]:
    """Labels of the rows on the first two fronts, numbered as in the diagrams."""
    wrong = [row.errors.wrong for row in bench.rows]
    costs = [row.total for row in bench.rows], [row.fetches for row in bench.rows]
    by_time, by_fetches = (
        [f"{n}  {bench.rows[k].label}" for n, k in enumerate(pareto_front(cost, wrong), 1)]
        for cost in costs
    )
    return by_time, by_fetches


def family(row: Row) -> str:
    """The method, with the DDA's one-fetch planes apart."""
    return "dda, planes" if row.method == "dda" and row.settings.surface == "plane" else row.method

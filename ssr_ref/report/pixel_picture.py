"""Pictures of walks: one ray on the image and against depth; how often pixels are read."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..buffers import GBuffer
from ..errors import SettingsError
from ..ssr.explain import PixelWalk
from ..ssr.record import Verdict
from ..typed import U32Array
from . import colors

VERDICT_COLORS = {
    Verdict.EMPTY: "#b0b0b0",
    Verdict.IN_FRONT: "#2f7ed8",
    Verdict.BEHIND: "#8b5fbf",
    Verdict.SELF_REJECTED: "#e08214",
    Verdict.BACK_FACE_REJECTED: "#8c510a",
    Verdict.PROPOSED: "#17a2a2",
    Verdict.HIT: "#d62728",
    Verdict.BLOCKED: "#000000",
}
MARGIN = 4
"""Pixels around a ray that are shown too."""
MOST_ROWS = 4000
"""Rows drawn of one walk."""


def walk_picture(scene: str, gbuffer: GBuffer, walks: Mapping[str, PixelWalk]) -> bytes:
    """A PNG with a row a method: the image with the reads on it, and depth against s.

    Raises SettingsError where matplotlib is missing.
    """
    mpl, figure_class, to_png = _matplotlib()
    image = gbuffer.radiance if gbuffer.radiance is not None else gbuffer.albedo
    shape = gbuffer.depth.shape
    picture = np.full((*shape, 3), 128, np.uint8) if image is None else colors.srgb_bytes(image)
    with mpl.rc_context({"font.size": 9}):
        figure = figure_class(figsize=(14.0, 0.6 + 4.6 * len(walks)), layout="constrained", dpi=100)
        grid = figure.add_gridspec(len(walks), 2, width_ratios=(1.0, 1.35))
        for i, (name, walk) in enumerate(walks.items()):
            _on_the_image(figure.add_subplot(grid[i, 0]), picture, walk, f"{scene}: {name}")
            _against_depth(figure.add_subplot(grid[i, 1]), walk)
        used = {v: None for walk in walks.values() for v in walk.verdicts}
        from matplotlib.lines import Line2D

        keys = [
            Line2D([], [], marker="o", linestyle="", color=VERDICT_COLORS[v],
                   label=v.name.lower().replace("_", " "))
            for v in Verdict if v in used
        ]  # fmt: skip
        keys += [
            Line2D([], [], marker="s", linestyle="", color="grey", mfc="none", label="refinement"),
            Line2D([], [], marker="D", linestyle="", color="white", mec="black", label="origin"),
            Line2D([], [], marker="*", linestyle="", color="#ffd700", mec="black", label="hit",
                   markersize=11),
        ]  # fmt: skip
        figure.legend(handles=keys, loc="outside upper center", ncols=len(keys))
        png: bytes = to_png(figure)
    return png


def _on_the_image(axes: Any, picture: Any, walk: PixelWalk, title: str) -> None:
    height, width = picture.shape[:2]
    rows = walk.rows[:MOST_ROWS]
    x = np.append(rows[:, 2], walk.x)
    y = np.append(rows[:, 3], walk.y)
    x0, x1 = int(max(x.min() - MARGIN, 0)), int(min(x.max() + MARGIN + 1, width))
    y0, y1 = int(max(y.min() - MARGIN, 0)), int(min(y.max() + MARGIN + 1, height))
    # At least as wide as a third of its height, and the other way round.
    grow = max(0, (y1 - y0) // 2 - (x1 - x0))
    x0, x1 = max(0, x0 - grow // 2), min(width, x1 + grow - grow // 2)
    grow = max(0, (x1 - x0) // 3 - (y1 - y0))
    y0, y1 = max(0, y0 - grow // 2), min(height, y1 + grow - grow // 2)
    axes.imshow(picture[y0:y1, x0:x1], extent=(x0, x1, y1, y0), interpolation="nearest")
    size = float(np.clip(220.0 / max(x1 - x0, y1 - y0), 1.5, 7.0))
    for level, verdict, row in zip(rows[:, 0], walk.verdicts, rows):
        color = VERDICT_COLORS[verdict]
        axes.plot(
            row[2] + 0.5, row[3] + 0.5, "s" if level else "o", color=color,
            mfc="none" if level else color, markersize=size * (1.5 if level else 1.0),
            markeredgewidth=0.8,
        )  # fmt: skip
    axes.plot(walk.x + 0.5, walk.y + 0.5, "D", color="white", mec="black", markersize=6)
    if not np.isnan(walk.hit_depth):
        axes.plot(*walk.hit_px, "*", color="#ffd700", mec="black", markersize=13)
    axes.set(xlim=(x0, x1), ylim=(y1, y0), xlabel="x, px", ylabel="y, px")
    axes.set_title(
        f"{title}, pixel ({walk.x}, {walk.y}): {walk.status.name}, {walk.steps} steps, "
        f"{walk.fetches} reads",
        fontsize=9,
    )


def _against_depth(axes: Any, walk: PixelWalk) -> None:
    """The ray's depth over s, each test's solid as a bar over its interval; near is below."""
    rows = walk.rows[:MOST_ROWS]
    if len(rows) == 0:
        axes.set_axis_off()
        axes.text(0.5, 0.5, "nothing was walked", ha="center")
        return
    ray = rows[:, 6:8]
    seen = np.concatenate([ray[np.isfinite(ray)], rows[:, 8][np.isfinite(rows[:, 8])]])
    low, high = float(seen.min()), float(seen.max())
    log = low > 0.0 and high > 20.0 * low
    pad = 0.08 * (high - low) or 0.1 * max(high, 1e-9)
    top, bottom = (high * 1.3, low / 1.3) if log else (high + pad, low - pad)
    for row, verdict in zip(rows, walk.verdicts):
        start, end, front, back = row[4], row[5], row[8], row[9]
        if not np.isfinite(front):
            continue
        open_end = not back < top
        axes.fill_between(
            [start, end if end > start else start + 0.02],
            [front] * 2, [min(back, top)] * 2, color=VERDICT_COLORS[verdict],
            alpha=0.3, linewidth=0, hatch="//" if open_end else None,
        )  # fmt: skip
        axes.plot([start, end], [front, front], color=VERDICT_COLORS[verdict], linewidth=1.6)
    order = np.argsort(rows[:, 4], kind="stable")
    along = np.column_stack([rows[order, 4], rows[order, 5]]).ravel()
    axes.plot(along, rows[order][:, 6:8].ravel(), "-", color="black", linewidth=1.2)
    if not np.isnan(walk.hit_depth):
        last = rows[-1]
        at = walk.length if walk.s_is == "length" else _s_of_hit(walk, last)
        axes.plot(at, walk.hit_depth, "*", color="#ffd700", mec="black", markersize=14, zorder=5)
    axes.set(
        ylim=(bottom, top), ylabel="view depth (ray: black; solids: bars, hatched where open)",
        xlabel="s, pixels of the major axis" if walk.s_is == "px" else "length along the ray",
    )  # fmt: skip
    if log:
        axes.set_yscale("log")
    axes.grid(alpha=0.25)


def _s_of_hit(walk: PixelWalk, last: Any) -> float:
    """s of the hit: how far it is from the origin along the major axis."""
    off = np.abs(np.array(walk.hit_px) - (walk.x + 0.5, walk.y + 0.5))
    return float(off.max()) if np.isfinite(off).all() else float(last[1])


def heat_picture(counts: Mapping[str, U32Array]) -> bytes:
    """A PNG of how often each pixel was tested, a panel a method on one logarithmic scale.

    Raises SettingsError where matplotlib is missing.
    """
    mpl, figure_class, to_png = _matplotlib()
    from matplotlib.colors import ListedColormap, LogNorm

    most = max(2, *(int(image.max()) for image in counts.values()))
    r, g, b = (c / 255.0 for c in colors.BLANK)
    heat = ListedColormap(colors.HEAT.astype(float) / 255.0).with_extremes(bad=(r, g, b))
    height, width = next(iter(counts.values())).shape
    with mpl.rc_context({"font.size": 9}):
        columns = min(len(counts), 2)
        rows = -(-len(counts) // columns)
        across = 12.4 / columns
        figure = figure_class(
            figsize=(14.0, rows * (across * height / width + 0.7) + 0.5),
            layout="constrained",
            dpi=100,
        )
        panels = []
        for i, (name, image) in enumerate(counts.items()):
            axes = figure.add_subplot(rows, columns, i + 1)
            panels.append(axes)
            shown = axes.imshow(
                np.ma.masked_equal(image, 0), cmap=heat, norm=LogNorm(1, most),
                interpolation="nearest",
            )  # fmt: skip
            axes.set_title(f"{name}: {', '.join(count_facts(image))}", fontsize=9)
            axes.set_axis_off()
        figure.colorbar(
            shown, ax=panels, label="tests of a pixel by all rays (teal: none)", shrink=0.8
        )
        png: bytes = to_png(figure)
    return png


def count_facts(image: U32Array) -> list[str]:
    """Shares of pixels by how often they are tested, in words."""
    total = image.size
    facts = [f"never {np.count_nonzero(image == 0) / total:.1%}"]
    facts += [
        f"> {bound:,} {np.count_nonzero(image > bound) / total:.1%}"
        for bound in (10, 100, 1000)
        if (image > bound).any()
    ]
    return [*facts, f"most {int(image.max()):,}"]


def _matplotlib() -> tuple[Any, Any, Any]:
    """matplotlib, Figure, and a function from a figure to PNG bytes without date or version."""
    try:
        import matplotlib as mpl
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise SettingsError(
            "matplotlib is not installed; expected it for pictures: pip install 'ssr-ref[report]'"
        ) from None

    def to_png(figure: Any) -> bytes:
        out = io.BytesIO()
        canvas: Any = FigureCanvasAgg(figure)
        canvas.print_png(out, metadata={"Software": None})
        return out.getvalue()

    return mpl, Figure, to_png

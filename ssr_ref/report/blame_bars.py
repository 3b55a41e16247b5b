"""Shares of the mean square error as stacked bars, drawn with Pillow; shares below 0 hang down."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from ..blame.parts import PARTS, BlameTotals
from ..typed import U8Array
from .colors import Rgb8
from .legend import FRAME, INK, PAPER, Entry, Legend, draw_legend

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw
    from PIL.ImageFont import FreeTypeFont

PART_COLORS: Mapping[str, Rgb8] = MappingProxyType(
    {
        "information": (104, 194, 255),
        "depth_model": (255, 159, 38),
        "traversal": (254, 98, 84),
        "shading": (250, 230, 65),
    }
)
"""Of `colors.STATUS_COLORS`, whose entries are far apart for every kind of sight."""

TEXT, LEFT, TOP = 15, 64, 24
"""Text height; what the axis needs on the left; room above the plot, in pixels."""
BAR, GAP, HEIGHT = 120, 24, 300
"""Width of a bar and the room between two; height of the plot."""
GRID = 0.25
"""Share between two lines of the grid; doubled until there are at most twelve."""


def share_bars(rows: Sequence[tuple[str, BlameTotals]]) -> U8Array:
    """(H, W, 3) sRGB bytes: one bar a method, its name and mean square error below it.

    rows: at least one (name, totals). A share that is not a number is left out and named.
    """
    from PIL import Image, ImageDraw

    stacks = [[(part, t.shares[part]) for part in PARTS] for _, t in rows]
    highest = max(1.0, *(sum(s for _, s in stack if s > 0.0) for stack in stacks))
    lowest = min(0.0, *(sum(s for _, s in stack if s < 0.0) for stack in stacks))
    grid = GRID
    while (highest - lowest) / grid > 12.0:
        grid *= 2.0
    width = max(LEFT + GAP + len(rows) * (BAR + GAP), 30 * TEXT)
    line = TEXT + TEXT // 2
    image = Image.new("RGB", (width, TOP + HEIGHT + 3 * line), PAPER)
    draw, font = ImageDraw.Draw(image), _font()

    def y_of(share: float) -> int:
        return TOP + round((highest - share) / (highest - lowest) * (HEIGHT - 1))

    # The grid, its labels, and the line of 0 brighter than the others.
    for i in range(int(np.ceil(lowest / grid)), int(np.floor(highest / grid)) + 1):
        y = y_of(i * grid)
        draw.line((LEFT, y, width - GAP, y), fill=INK if i == 0 else (70, 70, 74))
        label = f"{100.0 * i * grid:.0f} %"
        draw.text((LEFT - 8 - font.getlength(label), y - TEXT // 2 - 1), label, INK, font)

    for i, ((name, totals), stack) in enumerate(zip(rows, stacks)):
        x = LEFT + GAP + i * (BAR + GAP)
        _draw_stack(draw, stack, x, y_of)
        for row, text in enumerate((name, f"mse {totals.mean_square:.3g}")):
            shown = _fit(text, BAR + GAP - 4, font)
            left = x + (BAR - font.getlength(shown)) / 2
            draw.text((left, TOP + HEIGHT + row * line + TEXT // 2), shown, INK, font)
    entries = tuple(
        Entry(PART_COLORS[part], part.replace("_", " "), _values(stacks, part)) for part in PARTS
    )
    lines = (
        "share of each part in the mean square error; all of a bar add up to 100 %",
        "below 0: the part cancels some of another",
    )
    legend = draw_legend(Legend(lines, None, entries), width, TEXT)
    return np.concatenate([np.asarray(image), legend])


def _draw_stack(
    draw: ImageDraw, stack: list[tuple[str, float]], x: int, y_of: Callable[[float], int]
) -> None:
    """Shares above 0 upwards from the line, those below downwards, in the order of the parts."""
    up = down = 0.0
    for part, share in stack:
        if share > 0.0:
            box = (x, y_of(up + share), x + BAR, y_of(up))
            up += share
        elif share < 0.0:
            box = (x, y_of(down), x + BAR, y_of(down + share))
            down += share
        else:  # nothing, or not a number
            continue
        draw.rectangle(box, fill=PART_COLORS[part], outline=FRAME)


def _values(stacks: list[list[tuple[str, float]]], part: str) -> str:
    """The share itself beside its colour, if there is one bar to which it can belong."""
    return f"{100.0 * dict(stacks[0])[part]:.1f} %" if len(stacks) == 1 else ""


def _font() -> FreeTypeFont:
    from PIL import ImageFont

    font = ImageFont.load_default(size=TEXT)
    assert isinstance(font, ImageFont.FreeTypeFont)
    return font


def _fit(text: str, width: float, font: FreeTypeFont) -> str:
    text = text.encode("ascii", "replace").decode()
    while len(text) > 1 and font.getlength(text) > width:
        text = text[:-1]
    return text

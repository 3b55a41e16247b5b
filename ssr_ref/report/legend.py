"""Legends and contact sheets with Pillow; its built-in font, so no font files.

A legend is a strip below the picture, never on it: pixel (x, y) of the picture is pixel (x, y) of
the PNG. Where the strip needs more width than the picture has, the canvas grows to the right.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ..typed import U8Array
from .colors import Rgb8

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw
    from PIL.ImageFont import FreeTypeFont

PAPER: Rgb8 = (30, 30, 34)
INK: Rgb8 = (232, 232, 232)
FRAME: Rgb8 = (128, 128, 128)

MIN_TEXT, MAX_TEXT = 13, 26
"""Text height in pixels: a picture's width / 80, so that it can be read at any zoom."""
MIN_WIDTH_IN_TEXTS, MAX_ENTRY_IN_TEXTS = 25, 60
"""A legend's least width, and how far a long name may widen it, in text heights."""

SHEET_WIDTH, SHEET_COLUMNS, SHEET_TEXT = 1600, 4, 15
MAX_ENLARGEMENT = 16
"""Small panels of a contact sheet are enlarged by a whole factor up to this."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One colour of a legend: its name, and a value set to the right."""

    color: Rgb8
    name: str
    value: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Bar:
    """A colour ramp, (n, 3) sRGB bytes from left to right; ticks: place 0 to 1, and text."""

    ramp: U8Array
    ticks: tuple[tuple[float, str], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Legend:
    """What a strip shows from top to bottom: sentences, a ramp, named colours."""

    lines: tuple[str, ...] = ()
    bar: Bar | None = None
    entries: tuple[Entry, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One picture of a contact sheet. blend: whether its pixels may be averaged."""

    name: str
    rgb: U8Array
    note: str = ""
    blend: bool = True


def with_legend(rgb: U8Array, legend: Legend | None) -> U8Array:
    """The picture, (H, W, 3) sRGB bytes, with the legend's strip below it."""
    if legend is None:
        return rgb
    height, width = rgb.shape[:2]
    text = min(max(round(width / 80), MIN_TEXT), MAX_TEXT)
    widest = min(_entry_width(legend.entries, text) + 2 * text, MAX_ENTRY_IN_TEXTS * text)
    strip = draw_legend(legend, max(width, MIN_WIDTH_IN_TEXTS * text, widest), text)
    out = np.empty((height + strip.shape[0], strip.shape[1], 3), np.uint8)
    out[:] = PAPER
    out[:height, :width] = rgb
    out[height:] = strip
    return out


def draw_legend(legend: Legend, width: int, text: int) -> U8Array:
    """The legend alone, (h, width, 3) sRGB bytes; text is the font's height in pixels."""
    from PIL import Image, ImageDraw

    height = _layout(None, legend, width, text)
    image = Image.new("RGB", (width, height), PAPER)
    _layout(ImageDraw.Draw(image), legend, width, text)
    return np.asarray(image)


def contact_sheet(panels: Sequence[Panel], title: Legend, footer: Legend) -> U8Array:
    """All panels in rows of four under one title, at most 1600 pixels wide."""
    from PIL import Image, ImageDraw

    gap = SHEET_TEXT // 2
    side = (SHEET_WIDTH - gap) // SHEET_COLUMNS - gap
    shown = [_scaled(panel, side) for panel in panels]
    cell_w = max([12 * SHEET_TEXT, *(picture.shape[1] for picture in shown)])
    cell_h = max(picture.shape[0] for picture in shown)
    caption = _line_height(SHEET_TEXT) + gap
    columns = min(SHEET_COLUMNS, len(shown))
    rows = -(-len(shown) // columns)
    width = max(gap + columns * (cell_w + gap), MIN_WIDTH_IN_TEXTS * SHEET_TEXT)

    image = Image.new("RGB", (width, rows * (caption + cell_h + gap)), PAPER)
    draw = ImageDraw.Draw(image)
    font = _font(SHEET_TEXT)
    for i, (panel, picture) in enumerate(zip(panels, shown)):
        x = gap + (i % columns) * (cell_w + gap)
        y = (i // columns) * (caption + cell_h + gap)
        label = f"{panel.name}   {panel.note}" if panel.note else panel.name
        draw.text((x, y + gap // 2), _fit(label, cell_w, font), fill=INK, font=font)
        image.paste(Image.fromarray(picture), (x, y + caption))
    head, foot = (draw_legend(part, width, SHEET_TEXT) for part in (title, footer))
    return np.concatenate([head, np.asarray(image), foot])


def _scaled(panel: Panel, side: int) -> U8Array:
    """The picture made to fit a square: box-averaged or nearest when smaller, whole when larger."""
    from PIL import Image

    height, width = panel.rgb.shape[:2]
    factor = min(side // width, side // height, MAX_ENLARGEMENT)
    if factor >= 1:
        return panel.rgb.repeat(factor, axis=0).repeat(factor, axis=1)
    scale = side / max(width, height)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    how = Image.Resampling.BOX if panel.blend else Image.Resampling.NEAREST
    return np.asarray(Image.fromarray(panel.rgb).resize(size, how))


def _layout(draw: ImageDraw | None, legend: Legend, width: int, text: int) -> int:
    """Draw the legend, or only measure it (draw None). Returns its height."""
    font, line, pad = _font(text), _line_height(text), text // 2
    y = pad
    for sentence in legend.lines:
        for part in _wrap(sentence, width - 2 * pad, font):
            if draw:
                draw.text((pad, y), part, fill=INK, font=font)
            y += line
    if legend.bar:
        if draw:
            _draw_bar(draw, legend.bar, pad, y, min(width - 2 * pad, 48 * text), text)
        y += 2 * line + pad
    if legend.entries:
        # As many equal columns as fit, filled row by row.
        inner = width - 2 * pad
        wanted = _entry_width(legend.entries, text)
        columns = max(1, min(len(legend.entries), inner // wanted))
        cell = min(inner // columns, wanted + 2 * text)
        for i, entry in enumerate(legend.entries):
            if draw:
                x = pad + (i % columns) * cell
                _draw_entry(draw, entry, x, y + (i // columns) * line, cell - 2 * pad, text)
        y += -(-len(legend.entries) // columns) * line
    return y + pad


def _entry_width(entries: Sequence[Entry], text: int) -> int:
    """What the longest entry needs, its swatch and gaps included; 0 for none."""
    font = _font(text)
    lengths = [font.getlength(_plain(e.name)) + font.getlength(e.value) for e in entries]
    return 4 * text + int(max(lengths)) if lengths else 0


def _draw_entry(draw: ImageDraw, entry: Entry, x: int, y: int, width: int, text: int) -> None:
    font = _font(text)
    box = (x, y + 1, x + text, y + text + 1)
    draw.rectangle(box, fill=entry.color, outline=FRAME)
    value_w = int(font.getlength(entry.value)) + 1
    left = x + text + text // 2
    name = _fit(entry.name, x + width - left - value_w - text // 2, font)
    draw.text((left, y), name, fill=INK, font=font)
    draw.text((x + width - value_w, y), entry.value, fill=INK, font=font)


def _draw_bar(draw: ImageDraw, bar: Bar, x: int, y: int, width: int, text: int) -> None:
    font = _font(text)
    for column in range(width):
        color = bar.ramp[column * len(bar.ramp) // width]
        draw.line((x + column, y, x + column, y + text), fill=tuple(int(c) for c in color))
    draw.rectangle((x, y, x + width - 1, y + text), outline=FRAME)
    # The two end labels always fit; one between them only where it touches no other.
    order = sorted(bar.ticks, key=lambda tick: (0.0 < tick[0] < 1.0, tick[0]))
    taken: list[tuple[float, float]] = []
    for place, label in order:
        centre = x + round(place * (width - 1))
        length = font.getlength(label)
        left = min(max(centre - length / 2, x), x + width - length)
        if any(left < b + text / 2 and left + length > a - text / 2 for a, b in taken):
            continue
        taken.append((left, left + length))
        draw.line((centre, y + text, centre, y + text + text // 4), fill=INK)
        draw.text((left, y + text + text // 4), label, fill=INK, font=font)


@lru_cache(maxsize=16)
def _font(text: int) -> FreeTypeFont:
    from PIL import ImageFont

    font = ImageFont.load_default(size=text)
    assert isinstance(font, ImageFont.FreeTypeFont)
    return font


def _line_height(text: int) -> int:
    return text + text // 2


def _plain(text: str) -> str:
    """ASCII on one line, which is what the built-in font can draw; accents are dropped."""
    bare = (c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    return "".join(c if " " <= c <= "~" else "?" for c in bare)


def _fit(text: str, width: float, font: FreeTypeFont) -> str:
    """The text, its end cut off with three dots where it is longer than the width."""
    text = _plain(text)
    if font.getlength(text) <= width:
        return text
    while text and font.getlength(text + "...") > width:
        text = text[:-1]
    return text + "..."


def _wrap(sentence: str, width: float, font: FreeTypeFont) -> list[str]:
    """The sentence in lines no longer than the width, broken at spaces."""
    lines: list[str] = []
    for word in _plain(sentence).split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and font.getlength(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(_fit(word, width, font))
    return lines

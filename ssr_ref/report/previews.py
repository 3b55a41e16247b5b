"""Previews: one 8-bit sRGB PNG for each buffer of a frame, and a contact sheet of the main ones.

For looking at, never for comparing. Three rules hold in every picture:

* Pixel (x, y) of a buffer is pixel (x, y) of its PNG; a legend is a strip below.
* A value that must not be there (NaN, infinite, out of range) is LOUD magenta, and counted.
* BLANK teal means that the pixel has no such value; scales say what they leave out.

Light is sRGB-encoded (clipped to [0, 1], no tone mapping); everything else is linear in the bytes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..buffers import End, Flag, Status
from ..errors import FileError
from ..pipeline import Frame
from ..typed import AnyArray, BoolArray, F64Array, I64Array, U8Array
from . import colors
from .colors import BLANK, LOUD, OPEN, Rgb8
from .legend import Bar, Entry, Legend, Panel, contact_sheet, with_legend

COMPRESSION = 3
"""zlib level of the PNGs: higher ones take longer and save little."""
OVERVIEW = (
    "composite", "radiance", "reflection", "normal", "depth", "status", "steps", "confidence",
)  # fmt: skip
MOST_IDS = 24
"""Ids that a legend names, the largest first; the rest are counted together."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """One preview. rgb: (H, W, 3) sRGB bytes; note: its legend in a few words."""

    rgb: U8Array
    legend: Legend | None = None
    note: str = ""
    blend: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class _Inputs:
    """The frame's buffers by name, and what several pictures derive from them."""

    frame: Frame
    arrays: dict[str, AnyArray]
    background: BoolArray  # nothing was drawn
    nearest: float  # the depths that are white and black in every depth picture
    farthest: float

    def __getitem__(self, name: str) -> AnyArray:
        return self.arrays[name]

    @property
    def hit(self) -> BoolArray:
        out: BoolArray = self["status"] == np.uint8(Status.HIT)
        return out

    @property
    def walked(self) -> BoolArray:
        """Where a ray was walked: a hit, or a miss for a reason met on the way."""
        status = self["status"]
        out: BoolArray = self.hit | ((status >= Status.BLOCKED) & (status <= max(Status)))
        return out


def write_previews(frame: Frame, folder: Path, *, shared: bool = True) -> list[str]:
    """Write a PNG for each buffer that exists, and `overview.png`; returns their sorted names.

    shared : pictures of the G-buffer too, which all methods of a frame have in common.
    The folder is made if it is missing; files of the same names are replaced. Raises FileError
    where the folder cannot be written.
    """
    common = frozenset(frame.gbuffer.arrays())
    folder = Path(folder)
    names: list[str] = []
    panels: dict[str, Panel] = {}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, picture in pictures(frame):
            if shared or not common.issuperset(_NEEDED[name]):
                names.append(_save(with_legend(picture.rgb, picture.legend), folder, name))
            if name in OVERVIEW:
                panels[name] = Panel(name, picture.rgb, picture.note, picture.blend)
        sheet = contact_sheet([panels[n] for n in OVERVIEW if n in panels], *_captions(frame))
        names.append(_save(sheet, folder, "overview"))
    except OSError as error:
        raise FileError(
            f"previews cannot be written to '{folder}' ({error.strerror or error}); expected a "
            "folder with space that may be written: give another"
        ) from error
    return sorted(names)


def pictures(frame: Frame) -> Iterator[tuple[str, Picture]]:
    """Every picture whose buffers exist, by name, made when it is asked for."""
    arrays = {
        **frame.gbuffer.arrays(),
        **frame.hits.arrays(),
        **frame.resolved.arrays(),
    }
    depth = arrays["depth"]
    nearest, farthest = robust_range(depth[np.isfinite(depth) & (depth > 0.0)])
    inputs = _Inputs(frame, arrays, depth == np.inf, nearest, farthest)
    for name, needed, draw in _PICTURES:
        if all(buffer in arrays for buffer in needed):
            yield name, draw(inputs)


def robust_range(values: AnyArray) -> tuple[float, float]:
    """Least and greatest of non-negative values, without outliers; (0, 0) for none.

    An end more than twice as far out as the value a thousandth (at least one) of all values
    further in is an outlier: the scale then ends at that value. Fewer than 16 values are all kept.
    """
    n = values.size
    if n == 0:
        return 0.0, 0.0
    cut = max(1, n // 1000) if n >= 16 else 0
    ordered = np.partition(values, (cut, n - 1 - cut))
    inner_low, inner_high = float(ordered[cut]), float(ordered[n - 1 - cut])
    low, high = float(values.min()), float(values.max())
    return (
        low if 2.0 * low >= inner_low else inner_low,
        high if high <= 2.0 * inner_high else inner_high,
    )


# Light: sRGB-encoded.


def _composite(inputs: _Inputs) -> Picture:
    return _light(inputs["composite"])


def _radiance(inputs: _Inputs) -> Picture:
    return _light(inputs["radiance"])


def _albedo(inputs: _Inputs) -> Picture:
    return _light(inputs["albedo"])


def _reflectivity(inputs: _Inputs) -> Picture:
    return _light(inputs["reflectivity"])


def _reflection(inputs: _Inputs) -> Picture:
    """What the mirror shows, before the surface's R tints and dims it; black where none is asked.

    A weak or coloured mirror would hide the tracer's mistakes: the picture is c·L_hit + (1 − c)·F
    itself. `composite` holds R times this. status.png tells a black hit from a miss.
    """
    status = inputs["status"]
    asked = ~np.isin(status, [Status.NOT_COMPUTED, Status.BACKGROUND, Status.NOT_REFLECTIVE])
    reflection = inputs["reflection"]
    return _light(np.where(asked[..., None] | ~np.isfinite(reflection), reflection, 0.0))


def _light(linear: AnyArray) -> Picture:
    """Linear RGB; a strip is added only if something cannot be shown: NaN, infinite, below 0."""
    wrong = int(np.count_nonzero(~colors.finite_pixels(linear)))
    with np.errstate(invalid="ignore"):
        below = linear < 0.0
    negative = int(np.count_nonzero(below[..., 0] | below[..., 1] | below[..., 2]))
    lines, note = [], []
    if negative:
        lines.append(f"{negative:,} px below 0 in a channel, shown as 0")
        note.append(f"{negative:,} px below 0")
    if wrong:
        note.append(f"{wrong:,} px not finite")
    entries = _loud(wrong, linear.shape[0] * linear.shape[1], "NaN or infinite")
    legend = Legend(tuple(lines), None, entries) if lines or entries else None
    return Picture(colors.srgb_bytes(linear), legend, ", ".join(note))


# Directions and positions: bytes linear in the value.


def _normal(inputs: _Inputs) -> Picture:
    return _direction(inputs["normal_vs"], inputs.background)


def _geo_normal(inputs: _Inputs) -> Picture:
    return _direction(inputs["geo_normal_vs"], inputs.background)


def _direction(normal: AnyArray, background: BoolArray) -> Picture:
    """0.5 + 0.5 n; background black, a zero normal mid-grey, a non-finite one LOUD."""
    rgb = colors.to_bytes(0.5 + 0.5 * normal)
    rgb[background] = 0
    wrong = ~colors.finite_pixels(normal)
    rgb[wrong] = LOUD
    count = int(np.count_nonzero(wrong))
    line = "view-space normal, 0.5 + 0.5 n: red right, green up, blue towards the eye"
    legend = Legend((line,), None, _loud(count, wrong.size, "NaN or infinite"))
    return Picture(rgb, legend, f"{count:,} px not finite" if count else "")


def _hit_uv(inputs: _Inputs) -> Picture:
    """Where the hit is on screen: u in red, v in green; black where there is no hit."""
    height, width = inputs["status"].shape
    hit = inputs.hit
    uv = inputs["hit_px"] / np.array([width, height], np.float64)
    with np.errstate(invalid="ignore"):
        wrong = hit & ~((uv >= 0.0) & (uv <= 1.0)).all(axis=-1)
    rgb = np.zeros((height, width, 3), np.uint8)
    rgb[..., :2] = colors.to_bytes(uv)
    rgb[~hit] = 0
    rgb[wrong] = LOUD
    line = "hit position: u in red (0 left, 1 right), v in green (0 top, 1 bottom); black: no hit"
    count = int(np.count_nonzero(wrong))
    return Picture(rgb, Legend((line,), None, _loud(count, hit.size, "off the image")))


# Depths: grey, linear in 1/z, near is white.


def _depth(inputs: _Inputs) -> Picture:
    return _inverse_depth(inputs, inputs["depth"], inputs.background, "view depth", "background")


def _hit_depth(inputs: _Inputs) -> Picture:
    return _inverse_depth(inputs, inputs["hit_depth"], ~inputs.hit, "hit's view depth", "no hit")


def _back_depth(inputs: _Inputs) -> Picture:
    back, background = inputs["back_depth"], inputs.background
    no_back = ~background & (back == np.inf)
    what = "view depth of the back face"
    return _inverse_depth(inputs, back, background, what, "background", no_back)


def _inverse_depth(
    inputs: _Inputs,
    depth: AnyArray,
    blank: BoolArray,
    what: str,
    blank_name: str,
    no_back: BoolArray | None = None,
) -> Picture:
    """All depth pictures have the scale of `depth`, so the same grey is the same depth."""
    near, far = inputs.nearest, inputs.farthest
    ratio = near / far if far > 0.0 else 1.0
    hidden = blank if no_back is None else blank | no_back
    good = ~hidden & np.isfinite(depth) & (depth > 0.0)
    with np.errstate(all="ignore"):
        inverse = near / depth.astype(np.float64)
        share = (inverse - ratio) / (1.0 - ratio) if ratio < 1.0 else (inverse >= 1.0) * 1.0
    wrong = ~(hidden | good)
    rgb = _paint(share, colors.GREY, blank, wrong, no_back)
    entries = _keys(blank, blank_name, wrong, "not a depth", no_back)
    values = depth[good]
    if not values.size or far == 0.0:
        return Picture(rgb, Legend((f"{what}: no pixel has one",), None, entries))

    low, high = float(values.min()), float(values.max())
    beyond = int(np.count_nonzero((values < near) | (values > far)))
    lines = (
        f"{what}, scene units: min {_number(low)}, max {_number(high)}",
        f"grey is linear in 1/z, near is white{_beyond(beyond)}",
    )
    places = (0.0, 0.25, 0.5, 0.75, 1.0) if ratio < 1.0 else (1.0,)
    ticks = tuple((at, _number(near / (ratio + (1.0 - ratio) * at))) for at in places)
    legend = Legend(lines, Bar(colors.GREY, ticks), entries)
    return Picture(rgb, legend, f"{_number(low)} to {_number(high)}")


# Amounts: a heat ramp from 0.


def _thickness(inputs: _Inputs) -> Picture:
    """Back depth minus front depth, where there is a back face."""
    back, front, background = inputs["back_depth"], inputs["depth"], inputs.background
    no_back = ~background & (back == np.inf)
    with np.errstate(invalid="ignore"):
        thickness = back - front
    what = "back depth - depth, scene units"
    return _amount(thickness, background, what, "background", no_back)


def _residual(inputs: _Inputs) -> Picture:
    what = "hit depth - front depth, scene units"
    return _amount(inputs["residual"], ~inputs.hit, what, "no hit")


def _length(inputs: _Inputs) -> Picture:
    what = "length of the ray to its hit, scene units"
    return _amount(inputs["length"], ~inputs.hit, what, "no hit")


def _steps(inputs: _Inputs) -> Picture:
    return _amount(inputs["steps"], ~inputs.walked, "samples tested", "no ray walked")


def _fetches(inputs: _Inputs) -> Picture:
    return _amount(inputs["fetches"], ~inputs.walked, "depth and back-depth reads", "no ray walked")


def _sample_count(inputs: _Inputs) -> Picture:
    counts = inputs["sample_count"]
    return _amount(counts, counts == 0, "tests of each pixel by all rays", "never tested")


def _amount(
    amount: AnyArray,
    blank: BoolArray,
    what: str,
    blank_name: str,
    no_back: BoolArray | None = None,
) -> Picture:
    """Dark blue is 0, the lightest colour is the greatest value that is no outlier."""
    hidden = blank if no_back is None else blank | no_back
    with np.errstate(invalid="ignore"):
        good = ~hidden & np.isfinite(amount) & (amount >= 0)
    values = amount[good].astype(np.float64)
    top = robust_range(values)[1] or 1.0
    with np.errstate(all="ignore"):
        share = amount / np.float64(top)
    wrong = ~(hidden | good)
    rgb = _paint(share, colors.HEAT, blank, wrong, no_back)
    entries = _keys(blank, blank_name, wrong, "below 0 or not finite", no_back)
    if not values.size:
        return Picture(rgb, Legend((f"{what}: no pixel has any",), None, entries))

    mean, most = _number(float(values.mean())), _number(float(values.max()))
    beyond = int(np.count_nonzero(values > top))
    lines = (
        f"{what}: min {_number(float(values.min()))}, mean {mean}, max {most}",
        f"scale linear from 0 to {_number(top)}{_beyond(beyond)}",
    )
    whole = np.issubdtype(amount.dtype, np.integer)
    legend = Legend(lines, Bar(colors.HEAT, _linear_ticks(top, whole)), entries)
    return Picture(rgb, legend, f"mean {mean}, max {most}")


# Shares: grey, byte = 255 times the value.


def _confidence(inputs: _Inputs) -> Picture:
    return _share(inputs["confidence"], inputs.hit, "confidence", "hits")


def _edge_fade(inputs: _Inputs) -> Picture:
    return _share(inputs["edge_fade"], inputs.hit, "edge fade", "hits")


def _distance_fade(inputs: _Inputs) -> Picture:
    return _share(inputs["distance_fade"], inputs.hit, "distance fade", "hits")


def _steps_fade(inputs: _Inputs) -> Picture:
    return _share(inputs["steps_fade"], inputs.hit, "steps fade", "hits")


def _facing_fade(inputs: _Inputs) -> Picture:
    return _share(inputs["facing_fade"], inputs.hit, "facing fade", "hits")


def _residual_fade(inputs: _Inputs) -> Picture:
    return _share(inputs["residual_fade"], inputs.hit, "residual fade", "hits")


def _roughness(inputs: _Inputs) -> Picture:
    return _share(inputs["roughness"], ~inputs.background, "roughness", "drawn pixels")


def _share(share: AnyArray, counted: BoolArray, what: str, of: str) -> Picture:
    with np.errstate(invalid="ignore"):
        good = (share >= 0.0) & (share <= 1.0)
    rgb = _paint(share, colors.GREY, None, ~good, None)
    values = share[good & counted].astype(np.float64)
    mean = f"mean {_number(float(values.mean()))} over" if values.size else "no value:"
    ticks = tuple((at, _number(at)) for at in (0.0, 0.25, 0.5, 0.75, 1.0))
    wrong = int(np.count_nonzero(~good))
    entries = _loud(wrong, share.size, "outside 0 to 1")
    line = f"{what}: {mean} {values.size:,} {of}"
    note = f"{mean} {of}" if values.size else f"no {of}"
    return Picture(rgb, Legend((line,), Bar(colors.GREY, ticks), entries), note)


# Numbers with names: one flat colour each, so neither blended nor encoded.


def _status(inputs: _Inputs) -> Picture:
    picture = _named(inputs["status"], Status, colors.STATUS_COLORS, "status")
    hits = int(np.count_nonzero(inputs.hit))
    rays = int(np.count_nonzero(inputs.walked))
    note = f"{hits:,} of {rays:,} rays hit" if rays else "no ray walked"
    return Picture(picture.rgb, picture.legend, note, blend=False)


def _end(inputs: _Inputs) -> Picture:
    return _named(inputs["end"], End, colors.END_COLORS, "end")


def _named(
    numbers: AnyArray, enum: Callable[[int], Any], palette: Mapping[Any, Rgb8], what: str
) -> Picture:
    """A legend of the numbers that occur, in their order; one without a name is LOUD."""
    table = {int(number): color for number, color in palette.items()}
    counts = np.bincount(numbers.ravel(), minlength=256)
    entries = tuple(
        Entry(
            table.get(number, LOUD),
            enum(number).name if number in table else f"unknown {what} {number}",
            _count(counts[number], numbers.size),
        )
        for number in np.flatnonzero(counts).tolist()
    )
    rgb = np.take(colors.number_table(table), numbers, axis=0)
    return Picture(rgb, Legend((), None, entries), blend=False)


def _flags(inputs: _Inputs) -> Picture:
    """One colour for each combination of flags that occurs; black: none."""
    flags = inputs["flags"]
    counts = np.bincount(flags.ravel(), minlength=256)
    table = colors.id_colors(np.arange(256) - 1)
    entries = tuple(
        Entry(_rgb8(table[bits]), _flag_names(bits), _count(counts[bits], flags.size))
        for bits in sorted(np.flatnonzero(counts).tolist(), key=lambda b: (-counts[b], b))
    )
    return Picture(np.take(table, flags, axis=0), Legend((), None, entries), blend=False)


def _flag_names(bits: int) -> str:
    names = [str(flag.name) for flag in Flag if bits & flag]
    unknown = bits & ~sum(Flag)
    if unknown:
        names.append(f"unknown {unknown:#x}")
    return " + ".join(names) if names else "no flag"


def _object_id(inputs: _Inputs) -> Picture:
    return _ids(inputs["object_id"], [node.name for node in inputs.frame.scene.nodes])


def _material_id(inputs: _Inputs) -> Picture:
    return _ids(inputs["material_id"], [m.name for m in inputs.frame.scene.materials])


def _ids(ids: AnyArray, names: Sequence[str]) -> Picture:
    """A hashed colour for each id, black for none; the legend names the largest."""
    found, counts = _tally(ids)
    order = np.argsort(-counts, kind="stable")
    entries = []
    for i in order[:MOST_IDS].tolist():
        number = int(found[i])
        name = names[number] if number < len(names) else "(no such id in the scene)"
        color = _rgb8(colors.id_colors(np.array(number)))
        entries.append(Entry(color, f"{number} {name}", _count(counts[i], ids.size)))
    nothing = ids.size - int(counts.sum())
    if nothing:
        entries.append(Entry((0, 0, 0), "none", _count(nothing, ids.size)))
    rest = order[MOST_IDS:]
    lines = (f"{len(found):,} ids; the {MOST_IDS} largest are named",) if len(rest) else ()
    return Picture(colors.id_colors(ids), Legend(lines, None, tuple(entries)), blend=False)


def _triangle_id(inputs: _Inputs) -> Picture:
    ids = inputs["triangle_id"]
    found, counts = _tally(ids)
    lines = [f"{len(found):,} of {inputs.frame.scene.triangle_count:,} triangles visible"]
    if len(found):
        lines.append(f"median {_number(float(np.median(counts)))} px each, most {counts.max():,}")
    return Picture(colors.id_colors(ids), Legend(tuple(lines)), blend=False)


def _tally(ids: AnyArray) -> tuple[I64Array, I64Array]:
    """The ids from 0 up that occur, ascending, and how many pixels have each."""
    drawn = ids[ids >= 0]
    if drawn.size and int(drawn.max()) >= 1 << 24:
        found, counts = np.unique(drawn, return_counts=True)
        return found.astype(np.int64), counts.astype(np.int64)
    every = np.bincount(drawn.ravel()).astype(np.int64)
    present = np.flatnonzero(every).astype(np.int64)
    return present, every[present]


# Parts of pictures and legends.


def _paint(
    share: AnyArray,
    ramp: U8Array,
    blank: BoolArray | None,
    wrong: BoolArray,
    no_back: BoolArray | None,
) -> U8Array:
    """(H, W, 3) sRGB bytes: the ramp at each share, and the colours that mean something else."""
    index = colors.to_bytes(share).astype(np.int16)
    if blank is not None:
        index[blank] = 256
    if no_back is not None:
        index[no_back] = 257
    index[wrong] = 258
    table = np.concatenate([ramp, np.array([BLANK, OPEN, LOUD], np.uint8)])
    out: U8Array = np.take(table, index, axis=0)
    return out


def _keys(
    blank: BoolArray, blank_name: str, wrong: BoolArray, wrong_name: str, no_back: BoolArray | None
) -> tuple[Entry, ...]:
    """Legend entries of the colours outside the ramp that occur."""
    named = [(BLANK, blank_name, blank), (OPEN, "no back face", no_back)]
    found = [(c, name, int(np.count_nonzero(mask))) for c, name, mask in named if mask is not None]
    entries = [Entry(color, name, _count(n, blank.size)) for color, name, n in found if n]
    return (*entries, *_loud(int(np.count_nonzero(wrong)), blank.size, wrong_name))


def _loud(count: int, total: int, name: str) -> tuple[Entry, ...]:
    return (Entry(LOUD, name, _count(count, total)),) if count else ()


def _count(count: int, total: int) -> str:
    """How many pixels and what share; a share is never rounded to 0 or to all."""
    percent = 100.0 * count / total
    if 0.0 < percent < 0.05:
        shown = "<0.1"
    elif 99.95 <= percent < 100.0:
        shown = ">99.9"
    else:
        shown = f"{percent:.1f}"
    return f"{count:,} px  {shown} %"


def _beyond(count: int) -> str:
    return f"; {count:,} px beyond the scale" if count else ""


def _number(value: float) -> str:
    """Four digits; whole numbers up to a billion in full."""
    whole = abs(value) < 1e9 and value == math.floor(value)
    return f"{value:,.0f}" if whole else f"{value:.4g}"


def _setting(length: float | None) -> str:
    return "automatic" if length is None else _number(length)


def _linear_ticks(top: float, whole: bool) -> tuple[tuple[float, str], ...]:
    """0, round numbers between (about five), and the scale's end."""
    step = 10.0 ** math.floor(math.log10(top / 5.0))
    step *= next(m for m in (1.0, 2.0, 5.0, 10.0) if m * step >= top / 5.0 * 0.999)
    step = max(step, 1.0) if whole else step
    inner = [i * step for i in range(1, math.ceil(top / step)) if i * step < 0.97 * top]
    return tuple((value / top, _number(value)) for value in (0.0, *inner, top))


def _rgb8(color: F64Array | U8Array) -> Rgb8:
    return int(color[0]), int(color[1]), int(color[2])


def _captions(frame: Frame) -> tuple[Legend, Legend]:
    """The contact sheet's title and its footer, the key of the status panel."""
    s = frame.settings
    height, width = frame.gbuffer.depth.shape
    how = [s.tracer, "planes" if s.surface == "plane" else f"bias {s.bias:g}"]
    if s.tracer == "march":
        how += [f"step {_setting(s.step)}, {s.growth} growth", f"refine {s.refinement}"]
    elif s.tracer == "dda":
        how += [f"stride {s.stride}", f"refine {s.refinement}"]
        how += [f"interval {s.interval}"] if s.surface == "constant" else []
    how += ["jitter"] if s.jitter and s.tracer != "cells" else []
    how += ["as published"] if s.listing else []
    title = [
        f"{frame.scene.name}, {width} x {height} px",
        f"{', '.join(how)}, thickness from {s.thickness_from.replace('_', ' ')} (constant: "
        f"{_setting(s.thickness)}), max distance {_setting(s.max_distance)}",
    ]
    if frame.warnings:
        more = len(frame.warnings) - 1
        title.append(f"warning: {frame.warnings[0]}{f' (and {more} more)' if more else ''}")
    status = _named(frame.hits.status, Status, colors.STATUS_COLORS, "status").legend
    return Legend(tuple(title)), Legend((), None, status.entries if status else ())


def _save(rgb: U8Array, folder: Path, name: str) -> str:
    from PIL import Image

    Image.fromarray(rgb).save(folder / f"{name}.png", compress_level=COMPRESSION)
    return f"{name}.png"


_PICTURES: tuple[tuple[str, tuple[str, ...], Callable[[_Inputs], Picture]], ...] = (
    ("composite", ("composite",), _composite),
    ("radiance", ("radiance",), _radiance),
    ("reflection", ("reflection", "status"), _reflection),
    ("albedo", ("albedo",), _albedo),
    ("reflectivity", ("reflectivity",), _reflectivity),
    ("roughness", ("roughness",), _roughness),
    ("normal", ("normal_vs",), _normal),
    ("geo_normal", ("geo_normal_vs",), _geo_normal),
    ("depth", ("depth",), _depth),
    ("back_depth", ("back_depth",), _back_depth),
    ("thickness", ("back_depth",), _thickness),
    ("triangle_id", ("triangle_id",), _triangle_id),
    ("object_id", ("object_id",), _object_id),
    ("material_id", ("material_id",), _material_id),
    ("status", ("status",), _status),
    ("end", ("end",), _end),
    ("flags", ("flags",), _flags),
    ("hit_uv", ("hit_px", "status"), _hit_uv),
    ("hit_depth", ("hit_depth", "status"), _hit_depth),
    ("residual", ("residual", "status"), _residual),
    ("length", ("length", "status"), _length),
    ("steps", ("steps", "status"), _steps),
    ("fetches", ("fetches", "status"), _fetches),
    ("sample_count", ("sample_count",), _sample_count),
    ("confidence", ("confidence", "status"), _confidence),
    ("edge_fade", ("edge_fade", "status"), _edge_fade),
    ("distance_fade", ("distance_fade", "status"), _distance_fade),
    ("steps_fade", ("steps_fade", "status"), _steps_fade),
    ("facing_fade", ("facing_fade", "status"), _facing_fade),
    ("residual_fade", ("residual_fade", "status"), _residual_fade),
)
"""Every picture: its name, the buffers it needs, and what draws it."""
_NEEDED = {name: needed for name, needed, _ in _PICTURES}

"""Pictures of blame: the four parts in false colours, classes, charges, ambiguity, shares.

The parts and their sum have one scale: the same colour is the same error in all of them. The value
shown is that of the channel that is off most, with its sign, so that no error hides behind another.
The rules of `previews` hold: pixel for pixel, LOUD for what must not be there, BLANK for nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import IntEnum
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ..blame.ambiguity import Rerun
from ..blame.charges import Charge
from ..blame.parts import PARTS, Blame
from ..buffers import Truth, TruthClass
from ..errors import FileError
from ..typed import AnyArray, BoolArray, F64Array, U8Array
from . import colors
from .blame_bars import PART_COLORS, share_bars
from .colors import BLANK, LOUD, Rgb8
from .legend import Bar, Entry, Legend, Panel, contact_sheet, with_legend
from .previews import COMPRESSION, robust_range

GREY: Rgb8 = (108, 108, 108)
CLASS_COLORS: Mapping[TruthClass, Rgb8] = MappingProxyType(
    {
        TruthClass.NO_RAY: GREY,
        TruthClass.NOTHING: (45, 54, 76),
        TruthClass.OFF_SCREEN: (104, 194, 255),
        TruthClass.BACK_FACING: (105, 46, 147),
        TruthClass.OCCLUDED: (250, 230, 65),
        TruthClass.VISIBLE: (3, 184, 124),
    }
)
"""The colours of the statuses that a tracer gives such rays, if it is right."""
CHARGE_COLORS: Mapping[Charge, Rgb8] = MappingProxyType(
    {
        Charge.NOT_COUNTED: GREY,
        Charge.RIGHT: (3, 184, 124),
        Charge.INFORMATION: PART_COLORS["information"],
        Charge.DEPTH_MODEL: PART_COLORS["depth_model"],
        Charge.TRAVERSAL: PART_COLORS["traversal"],
        Charge.SHADING: PART_COLORS["shading"],
        Charge.COMPENSATED: (105, 46, 147),
        Charge.BY_CHANCE: (245, 180, 200),
    }
)


class _Hangs(IntEnum):
    """What a pixel's answer hangs on: a sum of the three kinds of reruns; NO_RAY is no sum."""

    CERTAIN = 0
    START = 1
    DEPTH = 2
    START_AND_DEPTH = 3
    THICKNESS = 4
    START_AND_THICKNESS = 5
    DEPTH_AND_THICKNESS = 6
    ALL_THREE = 7
    NO_RAY = 8


_HANGS_COLORS: Mapping[_Hangs, Rgb8] = MappingProxyType(
    {
        _Hangs.CERTAIN: (45, 54, 76),
        _Hangs.START: (104, 194, 255),
        _Hangs.DEPTH: (255, 159, 38),
        _Hangs.START_AND_DEPTH: (3, 184, 124),
        _Hangs.THICKNESS: (250, 230, 65),
        _Hangs.START_AND_THICKNESS: (142, 130, 210),
        _Hangs.DEPTH_AND_THICKNESS: (254, 98, 84),
        _Hangs.ALL_THREE: (245, 245, 245),
        _Hangs.NO_RAY: GREY,
    }
)
_START = Rerun.START_LEFT | Rerun.START_RIGHT | Rerun.START_UP | Rerun.START_DOWN


def write_blame_pictures(
    blamed: Blame,
    truth: Truth,
    folder: Path,
    *,
    ambiguity: U8Array | None = None,
    title: str = "",
) -> list[str]:
    """Write one PNG a picture and `blame_overview.png`; returns their sorted names.

    ambiguity (H, W): the mask of `blame.ambiguity`, if there is one. title: of the overview and the
    bar. The folder is made if it is missing; files of the same names are replaced.
    Raises FileError where the folder cannot be written.
    """
    folder = Path(folder)
    names: list[str] = []
    panels: list[Panel] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, rgb, legend, note in _pictures(blamed, truth, ambiguity):
            names.append(_save(with_legend(rgb, legend), folder, f"blame_{name}"))
            panels.append(Panel(name.replace("_", " "), rgb, note, blend=False))
        names.append(_save(share_bars([(title or "all", blamed.totals)]), folder, "blame_shares"))
        sheet = contact_sheet(panels, Legend((title,) if title else ()), _scale_legend(blamed))
        names.append(_save(sheet, folder, "blame_overview"))
    except OSError as error:
        raise FileError(
            f"pictures cannot be written to '{folder}' ({error.strerror or error}); expected a "
            "folder with space that may be written: give another"
        ) from error
    return sorted(names)


def _pictures(
    blamed: Blame, truth: Truth, ambiguity: U8Array | None
) -> Iterator[tuple[str, U8Array, Legend, str]]:
    """Name, pixels, legend and a note of every picture."""
    top = common_scale(blamed)
    broken = blamed.rays & ~blamed.counted
    for name in (*PARTS, "error"):
        value = signed_most(getattr(blamed, name))
        share = blamed.totals.shares.get(name)
        note = "A - T" if share is None else f"{100.0 * share:.1f} % of the mean square"
        legend = _value_legend(name, value, top, blamed.counted, broken, note)
        yield name, _diverging(value, top, blamed.counted, broken), legend, note
    visible = int((truth.truth == TruthClass.VISIBLE).sum())
    rgb, legend = _named(truth.truth, TruthClass, CLASS_COLORS)
    yield "truth_class", rgb, legend, f"{visible:,} px VISIBLE"
    rgb, legend = _named(blamed.charge, Charge, CHARGE_COLORS)
    yield "charge", rgb, legend, f"{blamed.totals.charged['RIGHT']:,} px right"
    if ambiguity is not None:
        yield "ambiguity", *_ambiguity(ambiguity, truth.truth == TruthClass.NO_RAY)


def signed_most(image: F64Array) -> F64Array:
    """(H, W) the channel furthest from 0, with its sign; the first of equal ones."""
    most = np.abs(image).argmax(axis=2)
    out: F64Array = np.take_along_axis(image, most[..., None], axis=2)[..., 0]
    return out


def common_scale(blamed: Blame) -> float:
    """The error that the ends of the ramp stand for, without outliers; 1 if there is none."""
    images = [np.abs(signed_most(getattr(blamed, name))) for name in (*PARTS, "error")]
    return robust_range(np.stack(images)[:, blamed.counted].ravel())[1] or 1.0


def _diverging(value: F64Array, top: float, counted: BoolArray, broken: BoolArray) -> U8Array:
    rgb: U8Array = np.take(colors.DIVERGING, colors.to_bytes(0.5 + 0.5 * value / top), axis=0)
    rgb[~counted] = BLANK
    rgb[broken] = LOUD
    return rgb


def _value_legend(
    name: str, value: F64Array, top: float, counted: BoolArray, broken: BoolArray, note: str
) -> Legend:
    off = int((value != 0.0).sum())
    lines = [
        f"{name.replace('_', ' ')}: {note}; {off:,} px not 0",
        "linear radiance of the channel that is off most; blue too dark, orange too bright",
    ]
    beyond = int((np.abs(value) > top).sum())
    if beyond:
        lines.append(f"{beyond:,} px beyond the scale")
    keys = ((BLANK, "not compared", ~counted & ~broken), (LOUD, "NaN or infinite", broken))
    entries = tuple(_entry(color, what, mask) for color, what, mask in keys if mask.any())
    return Legend(tuple(lines), _bar(top), entries)


def _scale_legend(blamed: Blame) -> Legend:
    totals = blamed.totals
    lines = [
        f"parts and error: one scale, linear radiance of the channel that is off most; mean square "
        f"{totals.mean_square:.4g} over {totals.counted:,} px",
    ]
    if totals.non_finite:
        lines.append(f"{totals.non_finite:,} px have a colour that is not finite: left out")
    entries = tuple(
        _entry(CHARGE_COLORS[charge], charge.name, blamed.charge == charge)
        for charge in Charge
        if (blamed.charge == charge).any()
    )
    return Legend(tuple(lines), _bar(common_scale(blamed)), entries)


def _bar(top: float) -> Bar:
    ticks = tuple((at, f"{(2.0 * at - 1.0) * top:.3g}") for at in (0.0, 0.25, 0.5, 0.75, 1.0))
    return Bar(colors.DIVERGING, ticks)


def _named(
    numbers: AnyArray, enum: type[IntEnum], palette: Mapping[Any, Rgb8]
) -> tuple[U8Array, Legend]:
    """One flat colour a number; the legend has those that occur."""
    table = colors.number_table({int(number): color for number, color in palette.items()})
    entries = tuple(
        _entry(palette[number], number.name.replace("_", " "), numbers == number)
        for number in enum
        if (numbers == number).any()
    )
    return np.take(table, numbers, axis=0), Legend((), None, entries)


def _ambiguity(bits: U8Array, no_ray: BoolArray) -> tuple[U8Array, Legend, str]:
    kinds = ((_START, 1), (Rerun.NEARER | Rerun.FARTHER, 2), (Rerun.THINNER | Rerun.THICKER, 4))
    hangs = np.zeros(bits.shape, np.uint8)
    for mask, number in kinds:
        hangs += np.where(bits & np.uint8(mask), np.uint8(number), np.uint8(0))
    hangs[no_ray & (hangs == 0)] = _Hangs.NO_RAY
    rgb, legend = _named(hangs, _Hangs, _HANGS_COLORS)
    count = int((bits != 0).sum())
    each = ", ".join(
        f"{str(bit.name).lower().replace('_', ' ')} {int((bits & np.uint8(bit) != 0).sum()):,}"
        for bit in Rerun
    )
    lines = (f"{count:,} px change their answer in a rerun: {each}",)
    return rgb, Legend(lines, None, legend.entries), f"{count:,} px"


def _entry(color: Rgb8, name: str, mask: BoolArray) -> Entry:
    count = int(mask.sum())
    return Entry(color, name, f"{count:,} px  {100.0 * count / mask.size:.1f} %")


def _save(rgb: U8Array, folder: Path, name: str) -> str:
    from PIL import Image

    Image.fromarray(rgb).save(folder / f"{name}.png", compress_level=COMPRESSION)
    return f"{name}.png"

"""`dda_line` over arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._jit import driver
from ..errors import MathsError
from ..typed import I64Array
from ..vecmath.line import MAX_COORDINATE, line_pixel
from .arrays import common_shape, flat, rows
from .registry import KernelInfo


@driver(parallel=False)
def line_pixels(start: I64Array, end: I64Array, index: I64Array, out: I64Array) -> None:
    """One pixel a row."""
    for i in range(index.shape[0]):
        x, y = line_pixel(start[i, 0], start[i, 1], end[i, 0], end[i, 1], index[i])
        out[i, 0], out[i, 1] = x, y


def dda_line(start: Any, end: Any, index: Any = None) -> I64Array:
    """Pixels of the straight line between two pixels, one for each step along its longer axis.

    start, end : (..., 2) whole numbers (x, y), magnitude up to 2²⁹. index : (...) whole numbers
        from 0 (start) to S = max(|Δx|, |Δy|) (end); all broadcast.

    Without index, start and end are one pair and all S + 1 pixels are returned, (S + 1, 2) int64,
    from start to end; with index the pixels at those steps, (..., 2). Pixel i is the floor of
    start + ½ + i·(end − start)/S: nearest, a tie to the higher pixel, whatever the octant.
    Raises MathsError for a bad shape or type, fractions, or numbers out of range.
    Source: Foley, van Dam, Feiner and Hughes, Computer Graphics, section 3.2.1.
    """
    a, b = _whole(start, "start"), _whole(end, "end")
    for name, value in (("start", a), ("end", b)):
        if value.ndim == 0 or value.shape[-1] != 2:
            raise MathsError(
                f"{name} has shape {value.shape}; expected (..., 2): x and y in the last axis"
            )
        if value.size and max(-int(value.min()), int(value.max())) > MAX_COORDINATE:
            raise MathsError(f"{name} holds a coordinate beyond ±2**29; clip the line first")
    if index is None:
        if a.ndim != 1 or b.ndim != 1:
            raise MathsError(
                f"start {a.shape} and end {b.shape} are several lines; expected one of each, or "
                "an index: lines differ in length"
            )
        steps = np.arange(int(np.abs(b - a).max()) + 1)
    else:
        steps = _whole(index, "index")
    shape = common_shape(start=a.shape[:-1], end=b.shape[:-1], index=steps.shape)
    first, last, i = rows(a, shape), rows(b, shape), flat(steps, shape)
    if ((i < 0) | (i > np.abs(last - first).max(axis=-1, initial=0))).any():
        raise MathsError("index is outside a line; expected 0 to max(|Δx|, |Δy|) of its own line")
    out = np.empty_like(first)
    line_pixels(first, last, i, out)
    return out.reshape(*shape, 2)


def _whole(value: Any, name: str) -> I64Array:
    try:
        array = np.asarray(value)
    except (ValueError, TypeError, OverflowError) as error:
        raise MathsError(f"{name} is no array ({error}); expected whole numbers") from None
    if array.dtype.kind not in "iu" or array.dtype == np.uint64:
        raise MathsError(f"{name} is of type {array.dtype}; expected whole numbers (int64)")
    return array.astype(np.int64)


KERNELS = (
    KernelInfo(
        name="dda_line",
        function=dda_line,
        measure="exact",
        bound=0.0,
        why="whole-number arithmetic below 2⁶³",
        source="Foley, van Dam, Feiner and Hughes, 3.2.1, without the running sum",
    ),
)

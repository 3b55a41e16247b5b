"""One ray shown: the walk of a single pixel as rows of what was read and what came of it.

The tracers' own kernels write the rows (`record`), so what is shown is what a trace does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .._jit import driver
from ..buffers import End, Flag, GBuffer, Status
from ..camera import ViewParams
from ..errors import SettingsError
from ..settings import Settings
from ..typed import F64Array
from .hit import SlabRules
from .record import COLUMNS, Log, Verdict, new_log
from .rows import Inputs, Outputs, close_pixel, open_pixel
from .trace import prepare, walk_slabs
from .trace_planes import walk_planes

ROOM = 4096
"""Rows that are kept at first; a longer walk is recorded again with room for all."""


@dataclass(frozen=True, slots=True, eq=False)
class PixelWalk:
    """The walk of pixel (x, y)'s ray.

    rows (n, 10) float64 by `columns`: level (0 a sample, 1 a cell of a re-walk), s, the pixel read,
    the interval's start and end in pixels of the major axis, the ray's depth at both, front and
    back of what was met (scene units, +inf where a pixel cannot be hit). verdicts: one a row.
    status, end, flags, hit_px, hit_depth, steps, fetches: as a trace has them.
    """

    x: int
    y: int
    rows: F64Array
    verdicts: tuple[Verdict, ...]
    status: Status
    end: End
    flags: Flag
    hit_px: tuple[float, float]
    hit_depth: float
    steps: int
    fetches: int
    columns: tuple[str, ...] = COLUMNS


@driver(parallel=False)
def record_slab_pixel(
    view: ViewParams,
    x: int,
    y: int,
    tracer: int,
    stride: int,
    jittered: bool,
    seed: int,
    refine: int,
    interval: int,
    max_steps: int,
    max_distance: float,
    thickness: float,
    bias: float,
    rounding: float,
    reject_self: bool,
    facing_test: bool,
    slabs: F64Array,
    inputs: Inputs,
    out: Outputs,
    log: Log,
) -> None:
    """As `trace_rows` does for one pixel, with a log."""
    rules = SlabRules(thickness, bias, rounding, reject_self, facing_test)
    walks, ray = open_pixel(view, inputs, out, x, y, max_distance)
    if not walks:
        return
    walk = walk_slabs(
        view,
        rules,
        slabs,
        inputs,
        ray,
        tracer,
        stride,
        jittered,
        seed,
        refine,
        interval,
        max_steps,
        log,
    )
    close_pixel(out, x, y, ray, walk)


@driver(parallel=False)
def record_plane_pixel(
    view: ViewParams,
    x: int,
    y: int,
    tracer: int,
    stride: int,
    jittered: bool,
    seed: int,
    max_steps: int,
    max_distance: float,
    thickness: float,
    rounding: float,
    reject_self: bool,
    facing_test: bool,
    planes: F64Array,
    inputs: Inputs,
    out: Outputs,
    log: Log,
) -> None:
    """As `trace_plane_rows` does for one pixel, with a log."""
    rules = SlabRules(thickness, 0.0, rounding, reject_self, facing_test)
    walks, ray = open_pixel(view, inputs, out, x, y, max_distance)
    if not walks:
        return
    walk = walk_planes(
        view, rules, planes, inputs, ray, tracer, stride, jittered, seed, max_steps, log
    )
    close_pixel(out, x, y, ray, walk)


def trace_pixel(
    view: ViewParams, gbuffer: GBuffer, settings: Settings, x: int, y: int
) -> PixelWalk:
    """The whole walk of pixel (x, y)'s ray; what `trace` needs, this does too.

    Raises SettingsError for a pixel outside the image, and for the 3-D march and the published
    listings, which have no log.
    """
    if not (0 <= x < view.width and 0 <= y < view.height):
        raise SettingsError(
            f"pixel ({x}, {y}) is outside the image; expected 0 to {view.width - 1} and 0 to "
            f"{view.height - 1}"
        )
    if settings.tracer == "march":
        raise SettingsError("tracer is 'march'; expected 'dda' or 'cells': the march has no log")
    if settings.listing:
        raise SettingsError("listing is True; expected False: the published walk has no log")
    prepared = prepare(view, gbuffer, settings)
    record: Any = record_plane_pixel if settings.surface == "plane" else record_slab_pixel
    log = new_log(ROOM)
    record(view, x, y, *prepared.fixed, prepared.inputs, prepared.out, log)
    if log.state[0] > ROOM:
        log = new_log(int(log.state[0]))
        record(view, x, y, *prepared.fixed, prepared.inputs, prepared.out, log)
    rows = log.rows[: log.state[0]]
    hits = prepared.hits
    return PixelWalk(
        x=x,
        y=y,
        rows=np.ascontiguousarray(rows[:, :-1]),
        verdicts=tuple(Verdict(int(v)) for v in rows[:, -1]),
        status=Status(int(hits.status[y, x])),
        end=End(int(hits.end[y, x])),
        flags=Flag(int(hits.flags[y, x])),
        hit_px=(float(hits.hit_px[y, x, 0]), float(hits.hit_px[y, x, 1])),
        hit_depth=float(hits.hit_depth[y, x]),
        steps=int(hits.steps[y, x]),
        fetches=int(hits.fetches[y, x]),
    )

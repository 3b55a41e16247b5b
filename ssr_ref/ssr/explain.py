"""Walks shown: every test of one ray as a row, or how often all rays test each pixel.

The tracers' own kernels write the log (`record`), so what is shown is what a trace does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .._jit import driver
from ..buffers import End, Flag, GBuffer, HitBuffer, Status
from ..camera import ViewParams
from ..errors import SettingsError
from ..settings import Settings
from ..typed import F64Array, U32Array
from ..vecmath.noise import jitter
from .hit import SlabRules
from .march_view import March, march_view
from .record import COLUMNS, Log, Verdict, new_counts, new_log
from .rows import Inputs, Outputs, close_pixel, open_pixel, store_length
from .trace import prepare, walk_slabs
from .trace_planes import walk_planes

ROOM = 4096
"""Rows that are kept at first; a longer walk is recorded again with room for all."""


@dataclass(frozen=True, slots=True, eq=False)
class PixelWalk:
    """The walk of pixel (x, y)'s ray.

    rows (n, 10) float64 by `columns`, one a test of a pixel: level (0 a sample, 1 a read of
    re-walk or refinement), s, the pixel read, the interval's start and end, the ray's depth at
    both, front and back of what was met (scene units, +inf where a pixel cannot be hit).
    s_is: what s and the interval are: "px", pixels of the major axis, or "length" along the ray.
    verdicts: one a row. status, end, flags, hit_px, hit_depth, length, steps, fetches: as a trace
    has them.
    """

    x: int
    y: int
    s_is: str
    rows: F64Array
    verdicts: tuple[Verdict, ...]
    status: Status
    end: End
    flags: Flag
    hit_px: tuple[float, float]
    hit_depth: float
    length: float
    steps: int
    fetches: int
    columns: tuple[str, ...] = COLUMNS

    def counts(self, shape: tuple[int, int]) -> U32Array:
        """(H, W) how often each pixel was tested by this ray."""
        out = np.zeros(shape, np.uint32)
        np.add.at(out, (self.rows[:, 3].astype(np.int64), self.rows[:, 2].astype(np.int64)), 1)
        return out


@driver(parallel=False)
def record_slabs(
    view: ViewParams,
    x0: int,
    y0: int,
    x1: int,
    y1: int,
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
    """As `trace_rows`, with a log, for the pixels x0 ≤ x < x1, y0 ≤ y < y1 in order."""
    rules = SlabRules(thickness, bias, rounding, reject_self, facing_test)
    for y in range(y0, y1):
        for x in range(x0, x1):
            walks, ray = open_pixel(view, inputs, out, x, y, max_distance)
            if not walks:
                continue
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
def record_planes(
    view: ViewParams,
    x0: int,
    y0: int,
    x1: int,
    y1: int,
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
    """As `trace_plane_rows`, with a log, for the pixels x0 ≤ x < x1, y0 ≤ y < y1 in order."""
    rules = SlabRules(thickness, 0.0, rounding, reject_self, facing_test)
    for y in range(y0, y1):
        for x in range(x0, x1):
            walks, ray = open_pixel(view, inputs, out, x, y, max_distance)
            if not walks:
                continue
            walk = walk_planes(
                view, rules, planes, inputs, ray, tracer, stride, jittered, seed, max_steps, log
            )
            close_pixel(out, x, y, ray, walk)


@driver(parallel=False)
def record_march(
    view: ViewParams,
    x0: int,
    y0: int,
    x1: int,
    y1: int,
    step: float,
    growth: int,
    jittered: bool,
    seed: int,
    refine: int,
    halvings: int,
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
    """As `trace_march_rows`, with a log, for the pixels x0 ≤ x < x1, y0 ≤ y < y1 in order."""
    rules = SlabRules(thickness, bias, rounding, reject_self, facing_test)
    for y in range(y0, y1):
        for x in range(x0, x1):
            walks, ray = open_pixel(view, inputs, out, x, y, max_distance)
            if not walks:
                continue
            noise = jitter(x, y, seed) if jittered else 1.0
            walk = march_view(
                view,
                rules,
                slabs,
                inputs.depth,
                inputs.back,
                inputs.geo_normal,
                ray,
                March(step, growth, noise, max_distance),
                refine,
                halvings,
                max_steps,
                log,
            )
            close_pixel(out, x, y, ray, walk)
            store_length(out, x, y, walk)


def trace_pixel(
    view: ViewParams, gbuffer: GBuffer, settings: Settings, x: int, y: int
) -> PixelWalk:
    """The whole walk of pixel (x, y)'s ray; what `trace` needs, this does too.

    Raises SettingsError for a pixel outside the image, and for the published listings, which have
    no log.
    """
    if not (0 <= x < view.width and 0 <= y < view.height):
        raise SettingsError(
            f"pixel ({x}, {y}) is outside the image; expected 0 to {view.width - 1} and 0 to "
            f"{view.height - 1}"
        )
    log = new_log(ROOM)
    hits = _record(view, gbuffer, settings, (x, y, x + 1, y + 1), log)
    if log.state[0] > ROOM:
        log = new_log(int(log.state[0]))
        hits = _record(view, gbuffer, settings, (x, y, x + 1, y + 1), log)
    rows = log.rows[: log.state[0]]
    return PixelWalk(
        x=x,
        y=y,
        s_is="length" if settings.tracer == "march" else "px",
        rows=np.ascontiguousarray(rows[:, :-1]),
        verdicts=tuple(Verdict(int(v)) for v in rows[:, -1]),
        status=Status(int(hits.status[y, x])),
        end=End(int(hits.end[y, x])),
        flags=Flag(int(hits.flags[y, x])),
        hit_px=(float(hits.hit_px[y, x, 0]), float(hits.hit_px[y, x, 1])),
        hit_depth=float(hits.hit_depth[y, x]),
        length=float(hits.length[y, x]),
        steps=int(hits.steps[y, x]),
        fetches=int(hits.fetches[y, x]),
    )


def sample_counts(view: ViewParams, gbuffer: GBuffer, settings: Settings) -> U32Array:
    """(H, W) how often each pixel's surface is tested by all rays, refinement included.

    A second pass over all rays, by one thread: the counts are exact. What `trace` needs, this does
    too. Raises SettingsError for the published listings.
    """
    log = new_counts((view.height, view.width))
    _record(view, gbuffer, settings, (0, 0, view.width, view.height), log)
    return log.counts


def _record(
    view: ViewParams,
    gbuffer: GBuffer,
    settings: Settings,
    pixels: tuple[int, int, int, int],
    log: Log,
) -> HitBuffer:
    """Walk the rays of a rectangle with a log."""
    if settings.listing:
        raise SettingsError("listing is True; expected False: a published listing has no log")
    record: Any = record_march if settings.tracer == "march" else record_slabs
    if settings.surface == "plane":
        record = record_planes
    prepared = prepare(view, gbuffer, settings)
    record(view, *pixels, *prepared.fixed, prepared.inputs, prepared.out, log)
    return prepared.hits

"""Trace every reflective pixel's ray: set-up, walk, status."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import prange

from .._jit import driver, kernel
from ..buffers import STATUS_OF_END, End, Flag, GBuffer, HitBuffer, Status
from ..camera import ViewParams, ray_through
from ..errors import SettingsError
from ..settings import Settings
from ..typed import F64Array, FloatArray, U8Array, U32Array
from ..vecmath.noise import jitter
from ..vecmath.vec import dot
from .hit import SlabRules, load3
from .march_cells import OWN_PIXEL, march_cells
from .march_dda import march_dda
from .ray import WALK, length_at, set_up_ray

HIT, BACKGROUND = int(Status.HIT), int(Status.BACKGROUND)
NOT_REFLECTIVE = int(Status.NOT_REFLECTIVE)
STATUS_PASSED_BEHIND, STATUS_SELF = int(Status.PASSED_BEHIND), int(Status.SELF)
FLAG_PASSED_BEHIND, FLAG_SELF = int(Flag.PASSED_BEHIND), int(Flag.SELF_REJECTED)
OUT_OF_STEPS = int(End.OUT_OF_STEPS)
END_TO_STATUS = int(STATUS_OF_END)

CELLS, DDA = 0, 1
NO_LIMIT = 2**62


@driver()
def prepare_slabs(
    view: ViewParams,
    depth: FloatArray,
    geo_normal: FloatArray,
    back: FloatArray,
    thickness: float,
    bias: float,
    slabs: F64Array,
) -> None:
    """slabs (H, W, 2) = front + bias and back of every pixel, view depths.

    back is the back-face depth where there is one, else front + thickness. Both are +inf where a
    pixel cannot be hit: empty, bad depth, or facing away.
    """
    has_back = back.shape[0] > 0
    for y in prange(view.height):
        for x in range(view.width):
            z = np.float64(depth[y, x])
            facing = dot(load3(geo_normal, y, x), ray_through(view, x + 0.5, y + 0.5))
            low = np.inf
            z_back = np.inf
            if z > 0.0 and facing < 0.0:
                low = z + bias
                z_back = z + thickness
                if has_back and back[y, x] < np.inf:
                    z_back = np.float64(back[y, x])
            slabs[y, x, 0] = low
            slabs[y, x, 1] = z_back


@kernel
def miss_status(flags: int, end: int) -> int:
    """The first reason that applies to a ray that met nothing."""
    if flags & FLAG_PASSED_BEHIND:
        return STATUS_PASSED_BEHIND
    if flags & FLAG_SELF:
        return STATUS_SELF
    return end + END_TO_STATUS


@driver()
def trace_rows(
    view: ViewParams,
    row0: int,
    row1: int,
    tracer: int,
    stride: int,
    jittered: bool,
    seed: int,
    refine: bool,
    cell_interval: bool,
    max_steps: int,
    max_distance: float,
    depth: FloatArray,
    geo_normal: FloatArray,
    normal: FloatArray,
    reflectivity: FloatArray,
    slabs: F64Array,
    back: FloatArray,
    thickness: float,
    bias: float,
    rounding: float,
    reject_self: bool,
    status: U8Array,
    end: U8Array,
    flags: U8Array,
    hit_px: F64Array,
    hit_depth: F64Array,
    residual: F64Array,
    length: F64Array,
    steps: U32Array,
    fetches: U32Array,
) -> None:
    """Trace rows row0 to row1 − 1; each pixel writes only its own outputs."""
    for y in prange(row0, row1):
        rules = SlabRules(thickness, bias, rounding, reject_self)
        for x in range(view.width):
            end[y, x] = 0
            flags[y, x] = 0
            hit_px[y, x, 0] = np.nan
            hit_px[y, x, 1] = np.nan
            hit_depth[y, x] = np.nan
            residual[y, x] = np.nan
            length[y, x] = np.nan
            steps[y, x] = 0
            fetches[y, x] = 0

            # Pixels that need no ray.
            z = np.float64(depth[y, x])
            if z == np.inf:
                status[y, x] = BACKGROUND
                continue
            if (
                reflectivity[y, x, 0] == 0.0
                and reflectivity[y, x, 1] == 0.0
                and reflectivity[y, x, 2] == 0.0
            ):
                status[y, x] = NOT_REFLECTIVE
                continue
            outcome, ray = set_up_ray(
                view,
                x,
                y,
                z,
                load3(normal, y, x),
                load3(geo_normal, y, x),
                max_distance,
            )
            if outcome != WALK:
                status[y, x] = outcome
                continue
            if not ray.s_end > OWN_PIXEL:
                end[y, x] = ray.end
                status[y, x] = miss_status(0, ray.end)
                continue

            # Walk.
            if tracer == DDA:
                offset = jitter(x, y, seed) if jittered else 1.0
                walk = march_dda(
                    view,
                    rules,
                    slabs,
                    depth,
                    back,
                    geo_normal,
                    ray,
                    stride,
                    offset,
                    refine,
                    cell_interval,
                    max_steps,
                )
            else:
                walk = march_cells(view, rules, slabs, depth, back, geo_normal, ray, max_steps)
            steps[y, x] = walk.cells
            fetches[y, x] = walk.fetches
            flags[y, x] = walk.flags
            if walk.hit.found:
                status[y, x] = HIT
                flags[y, x] = walk.flags | walk.hit.flags
                hit_px[y, x, 0] = walk.hit.px
                hit_px[y, x, 1] = walk.hit.py
                hit_depth[y, x] = walk.hit.depth
                residual[y, x] = walk.hit.residual
                length[y, x] = length_at(ray, walk.hit.s)
            else:
                bound = OUT_OF_STEPS if walk.out_of_cells else ray.end
                end[y, x] = bound
                status[y, x] = miss_status(walk.flags, bound)


def trace(
    view: ViewParams,
    gbuffer: GBuffer,
    settings: Settings,
    progress: Callable[[float], None] | None = None,
) -> HitBuffer:
    """Trace all rays of a G-buffer.

    Needs depth, geo_normal_vs, normal_vs and reflectivity, and back_depth if `thickness_from` is
    "back_faces". settings must be resolved (no length None). progress is called with the share
    of rows done.
    """
    if settings.thickness is None or settings.max_distance is None:
        raise SettingsError("thickness or max_distance is None; expected Settings.resolved(radius)")
    assert gbuffer.geo_normal_vs is not None
    assert gbuffer.normal_vs is not None
    assert gbuffer.reflectivity is not None
    shape = gbuffer.depth.shape
    back = np.empty((0, 0), gbuffer.depth.dtype)
    if settings.thickness_from == "back_faces":
        assert gbuffer.back_depth is not None
        back = gbuffer.back_depth
    slabs = np.empty((*shape, 2))
    prepare_slabs(
        view,
        gbuffer.depth,
        gbuffer.geo_normal_vs,
        back,
        float(settings.thickness),
        float(settings.bias),
        slabs,
    )
    hits = HitBuffer(
        status=np.empty(shape, np.uint8),
        end=np.empty(shape, np.uint8),
        flags=np.empty(shape, np.uint8),
        hit_px=np.empty((*shape, 2)),
        hit_depth=np.empty(shape),
        residual=np.empty(shape),
        length=np.empty(shape),
        steps=np.empty(shape, np.uint32),
        fetches=np.empty(shape, np.uint32),
    )
    fixed: tuple[Any, ...] = (
        DDA if settings.tracer == "dda" else CELLS,
        settings.stride,
        settings.jitter,
        settings.seed,
        settings.refines,
        settings.interval == "cell",
        NO_LIMIT if settings.max_steps is None else settings.max_steps,
        float(settings.max_distance),
        gbuffer.depth,
        gbuffer.geo_normal_vs,
        gbuffer.normal_vs,
        gbuffer.reflectivity,
        slabs,
        back,
        float(settings.thickness),
        float(settings.bias),
        2.0**-53 if gbuffer.depth.dtype == np.float64 else 2.0**-24,
        settings.self_rejection == "plane",
        hits.status,
        hits.end,
        hits.flags,
        hits.hit_px,
        hits.hit_depth,
        hits.residual,
        hits.length,
        hits.steps,
        hits.fetches,
    )
    for row0, row1 in row_chunks(view.height, 1 if progress is None else 32):
        trace_rows(view, row0, row1, *fixed)
        if progress is not None:
            progress(row1 / view.height)
    return hits


def row_chunks(height: int, chunks: int) -> list[tuple[int, int]]:
    """Rows 0 … height − 1 in at most `chunks` consecutive runs."""
    size = -(-height // chunks)
    return [(start, min(start + size, height)) for start in range(0, height, size)]

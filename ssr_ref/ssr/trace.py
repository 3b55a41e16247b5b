"""Trace every reflective pixel's ray: set-up, walk, status."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numba import prange

from .._jit import driver, inlined
from ..buffers import GBuffer, HitBuffer
from ..camera import ViewParams, ray_through
from ..errors import SettingsError
from ..settings import Settings
from ..typed import F64Array, FloatArray
from ..vecmath.noise import jitter
from ..vecmath.vec import dot
from . import listing_dda, listing_march, march_view
from .fit_planes import fit_normals
from .hit import SlabRules, load3
from .march_cells import CellWalk, march_cells
from .march_dda import (
    BISECT,
    CELL,
    COLUMN,
    NO_REFINE,
    POINT,
    PUBLISHED,
    REWALK,
    march_dda,
)
from .planes import prepare_planes
from .ray import Ray
from .record import Log
from .rows import CELLS, DDA, Inputs, Outputs, close_pixel, open_pixel
from .solid import CONSTANT, IMAGE, MODELS, depth_span, solid_end
from .trace_march import trace_march_rows
from .trace_planes import trace_plane_rows

NO_LIMIT = 2**62

SLOPE_BIAS = 0.5
"""Of the range of depth inside a pixel: the surface is that much deeper at its far corner."""
_INTERVALS = {"column": COLUMN, "cell": CELL, "point": POINT, "published": PUBLISHED}
_REFINES = {"none": NO_REFINE, "rewalk": REWALK, "bisect": BISECT}


@driver()
def prepare_slabs(
    view: ViewParams,
    depth: FloatArray,
    geo_normal: FloatArray,
    back: FloatArray,
    model: int,
    thickness: float,
    thickness_image: FloatArray,
    bias: float,
    slope_bias: float,
    slabs: F64Array,
) -> None:
    """slabs (H, W, 2) = low, where a ray enters, and back of every pixel, view depths.

    low is front + bias + slope_bias · `depth_span`, back that of `solid_end`. Both are +inf where a
    pixel cannot be hit: empty, bad depth, or facing away.
    """
    for y in prange(view.height):
        for x in range(view.width):
            z = np.float64(depth[y, x])
            n = load3(geo_normal, y, x)
            facing = dot(n, ray_through(view, x + 0.5, y + 0.5))
            low = np.inf
            z_back = np.inf
            if z > 0.0 and facing < 0.0:
                low = z + bias
                if slope_bias > 0.0:
                    low += slope_bias * depth_span(view, n, z, facing)
                z_back = solid_end(
                    view, model, thickness, thickness_image, back, x, y, n, z, facing
                )
            slabs[y, x, 0] = low
            slabs[y, x, 1] = z_back


@inlined
def walk_slabs(
    view: ViewParams,
    rules: SlabRules,
    slabs: F64Array,
    inputs: Inputs,
    ray: Ray,
    tracer: int,
    stride: int,
    jittered: bool,
    seed: int,
    refine: int,
    interval: int,
    max_steps: int,
    log: Log | None,
) -> CellWalk:
    """Walk a ray through constant-depth pixels by the tracer that is asked for."""
    depth, back, normal = inputs.depth, inputs.back, inputs.geo_normal
    if tracer == CELLS:
        return march_cells(view, rules, slabs, depth, back, normal, ray, max_steps, log)
    offset = jitter(ray.x, ray.y, seed) if jittered else 1.0
    return march_dda(
        view,
        rules,
        slabs,
        depth,
        back,
        normal,
        ray,
        stride,
        offset,
        refine,
        interval,
        max_steps,
        log,
    )


@driver()
def trace_rows(
    view: ViewParams,
    row0: int,
    row1: int,
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
) -> None:
    """Trace rows row0 to row1 − 1; each pixel writes only its own outputs."""
    for y in prange(row0, row1):
        rules = SlabRules(thickness, bias, rounding, reject_self, facing_test)
        for x in range(view.width):
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
                None,
            )
            close_pixel(out, x, y, ray, walk)


class Prepared(NamedTuple):
    """What a trace runs: the driver of rows, its settings, the images it reads and writes."""

    rows: Any
    fixed: tuple[Any, ...]
    inputs: Inputs
    out: Outputs
    hits: HitBuffer


def trace(
    view: ViewParams,
    gbuffer: GBuffer,
    settings: Settings,
    progress: Callable[[float], None] | None = None,
    slips: int | None = None,
) -> HitBuffer:
    """Trace all rays of a G-buffer.

    Needs depth, normal_vs and reflectivity, and back_depth if `thickness_from` is "back_faces".
    geo_normal_vs is fitted to the depths where it is None or `geo_normals` asks for it. settings
    must be resolved (no length None). progress is called with the share of rows done. slips: bits
    of the published listing that are on, with `Settings.listing`; None: all of them.
    """
    prepared = prepare(view, gbuffer, settings, slips)
    for row0, row1 in row_chunks(view.height, 1 if progress is None else 32):
        prepared.rows(view, row0, row1, *prepared.fixed, prepared.inputs, prepared.out)
        if progress is not None:
            progress(row1 / view.height)
    return prepared.hits


def prepare(
    view: ViewParams, gbuffer: GBuffer, settings: Settings, slips: int | None = None
) -> Prepared:
    """Slabs or planes of every pixel, empty outputs, and the driver for these settings."""
    if settings.thickness is None or settings.max_distance is None:
        raise SettingsError("thickness or max_distance is None; expected Settings.resolved(radius)")
    if settings.tracer == "march" and settings.step is None:
        raise SettingsError("step is None; expected Settings.resolved(radius)")
    assert gbuffer.normal_vs is not None
    assert gbuffer.reflectivity is not None
    shape = gbuffer.depth.shape
    back = np.empty((0, 0), gbuffer.depth.dtype)
    if settings.thickness_from == "back_faces":
        assert gbuffer.back_depth is not None
        back = gbuffer.back_depth
    geo_normal = gbuffer.geo_normal_vs
    if geo_normal is None or settings.geo_normals == "fitted":
        geo_normal = fit_normals(view, gbuffer.depth)
    inputs = Inputs(gbuffer.depth, geo_normal, gbuffer.normal_vs, gbuffer.reflectivity, back)
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
    out = Outputs(*(getattr(hits, name) for name in Outputs._fields))
    tracer = DDA if settings.tracer == "dda" else CELLS
    thickness, max_distance = float(settings.thickness), float(settings.max_distance)
    max_steps = NO_LIMIT if settings.max_steps is None else settings.max_steps
    rounding = 2.0**-53 if gbuffer.depth.dtype == np.float64 else 2.0**-24
    rejects = (settings.self_rejection == "plane", settings.facing_test)
    start = (tracer, settings.stride, settings.jitter, settings.seed)
    rows: Any
    fixed: tuple[Any, ...]
    model = MODELS[settings.thickness_from]
    image = np.empty((0, 0), gbuffer.depth.dtype)
    if model == IMAGE:
        assert gbuffer.thickness is not None
        image = gbuffer.thickness
    solids = (view, inputs.depth, inputs.geo_normal, back, model, thickness, image)
    most = thickness if model == CONSTANT else np.inf
    if settings.surface == "plane":
        planes = np.empty((*shape, 4))
        prepare_planes(*solids, planes)
        rows = trace_plane_rows
        fixed = (*start, max_steps, max_distance, most, rounding, *rejects, planes)
    else:
        slabs = np.empty((*shape, 2))
        bias = float(settings.bias)
        slope_bias = SLOPE_BIAS if settings.self_rejection == "slope_bias" else 0.0
        prepare_slabs(*solids, bias, slope_bias, slabs)
        fixed = (max_steps, max_distance, most, bias, rounding, *rejects, slabs)
        if settings.listing:
            hits = replace(hits, fade_px=np.empty((*shape, 2)), fade_length=np.empty(shape))
            fades = (slabs, hits.fade_px, hits.fade_length)
            if settings.tracer == "march":
                rows = listing_march.trace_listing_rows
                slips = listing_march.ALL_SLIPS if slips is None else slips
                fixed = (*march_arguments(settings), max_steps, max_distance, slips, *fades)
            else:
                rows = listing_dda.trace_listing_dda_rows
                slips = listing_dda.ALL_SLIPS if slips is None else slips
                constant = thickness if model == CONSTANT else 0.0
                lengths = (max_distance, constant, most, bias, rounding)
                fixed = (*start[1:], max_steps, *lengths, *rejects, slips, *fades)
        elif settings.tracer == "march":
            rows = trace_march_rows
            fixed = (*march_arguments(settings), *fixed)
        else:
            rows = trace_rows
            refine, interval = _REFINES[settings.refinement], _INTERVALS[settings.interval]
            fixed = (*start, refine, interval, *fixed)
    return Prepared(rows, fixed, inputs, out, hits)


def march_arguments(settings: Settings) -> tuple[Any, ...]:
    """What only the 3-D march needs to know, in the order of its driver."""
    assert settings.step is not None
    growth = march_view.LINEAR if settings.growth == "linear" else march_view.CONSTANT
    refine = {
        "none": march_view.NO_REFINE,
        "bisect": march_view.BISECT,
        "secant": march_view.SECANT,
    }[settings.refinement]
    start = (float(settings.step), growth, settings.jitter, settings.seed)
    return (*start, refine, settings.refine_steps)


def row_chunks(height: int, chunks: int) -> list[tuple[int, int]]:
    """Rows 0 … height − 1 in at most `chunks` consecutive runs."""
    size = -(-height // chunks)
    return [(start, min(start + size, height)) for start in range(0, height, size)]

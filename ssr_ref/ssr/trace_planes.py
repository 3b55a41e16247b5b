"""Trace with planes per pixel; apart from `trace`, so that only who asks for it compiles it."""

from __future__ import annotations

from numba import prange

from .._jit import driver, inlined
from ..camera import ViewParams
from ..typed import F64Array
from ..vecmath.noise import jitter
from .hit import SlabRules
from .march_cells import CellWalk
from .march_planes import march_plane_cells, march_plane_samples, march_plane_strides
from .ray import Ray
from .record import Log
from .rows import CELLS, Inputs, Outputs, close_pixel, open_pixel


@inlined
def walk_planes(
    view: ViewParams,
    rules: SlabRules,
    planes: F64Array,
    inputs: Inputs,
    ray: Ray,
    tracer: int,
    stride: int,
    jittered: bool,
    seed: int,
    max_steps: int,
    log: Log | None,
) -> CellWalk:
    """Walk a ray through planes by the tracer that is asked for."""
    depth, back, normal = inputs.depth, inputs.back, inputs.geo_normal
    if tracer == CELLS:
        return march_plane_cells(view, rules, planes, depth, back, normal, ray, max_steps, log)
    offset = jitter(ray.x, ray.y, seed) if jittered else 1.0
    if stride == 1:
        return march_plane_samples(
            view, rules, planes, depth, back, normal, ray, offset, max_steps, log
        )
    return march_plane_strides(
        view, rules, planes, depth, back, normal, ray, stride, offset, max_steps, log
    )


@driver()
def trace_plane_rows(
    view: ViewParams,
    row0: int,
    row1: int,
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
) -> None:
    """Trace rows row0 to row1 − 1; each pixel writes only its own outputs."""
    for y in prange(row0, row1):
        rules = SlabRules(thickness, 0.0, rounding, reject_self, facing_test)
        for x in range(view.width):
            walks, ray = open_pixel(view, inputs, out, x, y, max_distance)
            if not walks:
                continue
            walk = walk_planes(
                view, rules, planes, inputs, ray, tracer, stride, jittered, seed, max_steps, None
            )
            close_pixel(out, x, y, ray, walk)

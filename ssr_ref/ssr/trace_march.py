"""Trace by the 3-D march; apart from `trace`, so that only who asks for it compiles it."""

from __future__ import annotations

from numba import prange

from .._jit import driver
from ..camera import ViewParams
from ..typed import F64Array
from ..vecmath.noise import jitter
from .hit import SlabRules
from .march_view import March, march_view
from .rows import Inputs, Outputs, close_pixel, open_pixel, store_length


@driver()
def trace_march_rows(
    view: ViewParams,
    row0: int,
    row1: int,
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
) -> None:
    """Trace rows row0 to row1 − 1; each pixel writes only its own outputs."""
    for y in prange(row0, row1):
        rules = SlabRules(thickness, bias, rounding, reject_self, facing_test)
        depth, back, normal = inputs.depth, inputs.back, inputs.geo_normal
        for x in range(view.width):
            walks, ray = open_pixel(view, inputs, out, x, y, max_distance)
            if not walks:
                continue
            noise = jitter(x, y, seed) if jittered else 1.0
            march = March(step, growth, noise, max_distance)
            walk = march_view(
                view,
                rules,
                slabs,
                depth,
                back,
                normal,
                ray,
                march,
                refine,
                halvings,
                max_steps,
                None,
            )
            close_pixel(out, x, y, ray, walk)
            store_length(out, x, y, walk)

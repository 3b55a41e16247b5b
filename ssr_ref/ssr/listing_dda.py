"""The DDA as its listing was published, slips included: `Settings.listing` with tracer "dda".

For comparing with code that descends from it. Each slip is a bit, so that one alone can be taken
away; with none this is `march_dda` (column interval, no refinement) in every output.
docs/errata_tracers.md says what each does. Made safe: a read outside the image takes the nearest
pixel, as a sampler that clamps to the edge does; a hit's position is moved into the image.
Source: McGuire and Mara, JCGT 3(4), 2014, `traceScreenSpaceRay1`, first published version, with the
depth bias that its descendants add to the front.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from .._jit import driver, inlined, kernel
from ..camera import ViewParams
from ..typed import F64Array, FloatArray
from ..vecmath.noise import jitter
from .hit import (
    BEHIND,
    IN_SLAB,
    MISS,
    OPEN,
    OVER_EMPTY,
    PASSED_BEHIND,
    Hit,
    Slab,
    SlabRules,
    compare_with_slab,
    load3,
    locate_hit,
    no_hit,
    refusal,
)
from .listing_line import (
    added,
    first_sums,
    increments,
    nudged,
    quotient,
    raw_depth,
    raw_length,
    unclipped,
)
from .listing_march import Listed, clamped, clamped_position
from .march_cells import OWN_PIXEL as OWN_PIXEL_END
from .march_cells import CellWalk
from .ray import Ray, depth_at, length_at, position_x, position_y
from .rows import Inputs, Outputs, close_pixel, open_pixel

OWN_DEPTH = 1
"""The first interval starts at the ray's own depth, not where the ray leaves its own pixel."""
OWN_PIXEL = 2
"""Samples in the own pixel are tested; without jitter the first one is the origin itself."""
NO_PLANE = 4
"""No tangent-plane rule (and no facing test): only the bias keeps a surface from itself."""
SUMMED = 8
"""P, Q and k are carried sums, and the depth is Q.z/k."""
STRICT = 16
"""Reaching front + bias exactly stops the walk, and is a miss."""
SHIFTED = 32
"""The bias moves the back of the slab too."""
EMPTY_ZERO = 64
"""Empty pixels hold depth 0, which is to stop the walk, but is compared after the bias is added."""
NO_WINDOW = 128
"""The ray is clipped to the near plane and max_distance, not to the image."""
NUDGE = 256
"""The end of a line shorter than 0.01 px is moved by 0.01 px in x and y."""
PAST_END = 512
"""Half a step is half a stride also for the last sample: its interval reaches past the end."""
NO_TAIL = 1024
"""What is left after the last sample is not looked at; a sample exactly at the end is."""
LATE_POINT = 2048
"""hit_px is the sample's position; depth and length are those of the ray one stride later."""
AFTER_LOOP = 4096
"""Hit or miss is decided after the loop, also when it was never entered."""
ALL_SLIPS = 8191

UNTESTED_FRONT = 100.0
"""The front is set so many scene units before the ray until a pixel is read."""


@kernel
def listed_at(
    view: ViewParams, hit: Hit, flags: int, cells: int, fetches: int, length: float, slips: int
) -> Listed:
    """A walk's outcome; a slip's hit is moved into the image, its fades keep its own place."""
    px, py = hit.px, hit.py
    if slips and not (0.0 <= px < view.width and 0.0 <= py < view.height):
        px, py = clamped_position(px, view.width), clamped_position(py, view.height)
    moved = Hit(True, px, py, hit.s, hit.depth, hit.residual, hit.flags)
    return Listed(CellWalk(moved, flags, cells, fetches, False, False), hit.px, hit.py, length)


@kernel
def march_listing_dda(
    view: ViewParams,
    rules: SlabRules,
    slabs: F64Array,
    depth: FloatArray,
    back: FloatArray,
    normal: FloatArray,
    ray: Ray,
    stride: int,
    offset: float,
    max_steps: int,
    thickness: float,
    slips: int,
) -> Listed:
    """Walk a ray by samples s_i = (i + offset)·stride, i = 0, 1, …, as published.

    offset: in (0, 1]; as `march_dda`'s, but 0 is allowed with OWN_PIXEL. thickness: of an empty
    pixel and of the slab before any pixel was read; 0 where the slabs' thickness is no constant.
    `cells` of the result counts the samples tested.
    """
    reads = 2 if back.shape[0] > 0 else 1
    stride_px = np.float64(stride)
    half = 0.5 * stride_px
    flags = 0
    fetches = 0

    # Before any sample the ray is compared with a slab that nothing put there.
    if slips & AFTER_LOOP and thickness >= UNTESTED_FRONT:
        hit = Hit(True, ray.p0_x, ray.p0_y, 0.0, ray.origin_depth, np.nan, 0)
        return Listed(CellWalk(hit, 0, 0, 0, False, False), ray.p0_x, ray.p0_y, 0.0)

    first = 0
    by = increments(ray, stride_px)
    sums = first_sums(ray, by, offset)
    if slips & OWN_PIXEL == 0:
        while (first + offset) * stride_px <= OWN_PIXEL_END:
            first += 1
            sums = added(sums, by, 1.0)
    i = first
    start = 0.0 if slips & OWN_DEPTH else OWN_PIXEL_END
    z_a = ray.origin_depth if slips & OWN_DEPTH else depth_at(ray, start)
    while True:
        # The sample's interval; where there is a tail, what is left gets its middle.
        s = (i + offset) * stride_px
        a = start if i == first else (i - 1 + offset) * stride_px + half
        b = s + half
        if slips & PAST_END == 0:
            a, b = min(a, ray.s_end), min(b, ray.s_end)
        tail = False
        if slips & NO_TAIL:
            if s > ray.s_end:
                break
        elif s >= ray.s_end:
            if not a < ray.s_end:
                break
            s, b, tail = 0.5 * (a + ray.s_end), ray.s_end, True

        # Where it is and how deep.
        px, py = position_x(ray, s), position_y(ray, s)
        z_b = raw_depth(ray, b) if slips & PAST_END else depth_at(ray, b)
        if slips & SUMMED and not tail:
            px, py = sums.px, sums.py
            if b == s + half:
                z_b = quotient(sums.q + 0.5 * by.q, sums.k + 0.5 * by.k)
        if slips & NO_WINDOW == 0 and not (0.0 <= px < view.width and 0.0 <= py < view.height):
            break
        if i - first == max_steps:
            return Listed(CellWalk(no_hit(), flags, max_steps, fetches, True, False), 0.0, 0.0, 0.0)
        x, y = clamped(px, view.width), clamped(py, view.height)
        i += 1

        # The pixel's slab.
        low, z_back, front = slabs[y, x, 0], slabs[y, x, 1], np.float64(depth[y, x])
        is_open = back.shape[0] == 0 or not back[y, x] < np.inf
        fetches += 1 if low == np.inf else reads
        if low == np.inf:
            flags |= OVER_EMPTY
        empty = slips & EMPTY_ZERO != 0 and front == np.inf
        if empty:
            low, z_back, front = rules.bias, thickness, 0.0
        if slips & SHIFTED:
            z_back += rules.bias
        verdict = MISS if low == np.inf else compare_with_slab(z_a, z_b, low, z_back)
        if verdict == BEHIND and not empty:
            flags |= PASSED_BEHIND
        if verdict == IN_SLAB:
            if slips & STRICT and max(z_a, z_b) == low:
                break
            why_not = 0
            if slips & NO_PLANE == 0 and not empty:
                why_not = refusal(view, rules, ray, x, y, front, load3(normal, y, x))
            flags |= why_not
            if why_not == 0:
                slab = Slab(front, low, z_back, OPEN if is_open else 0)
                hit = locate_hit(rules, ray, slab, x, y, a, b, False)
                length = length_at(ray, hit.s)
                if slips & LATE_POINT:
                    late = s + stride_px
                    z = raw_depth(ray, late)
                    if slips & SUMMED and not tail:
                        z = quotient(sums.q + by.q, sums.k + by.k)
                    hit = Hit(True, px, py, late, z, z - front, hit.flags)
                    length = raw_length(ray, late)
                return listed_at(view, hit, flags, i - first, fetches, length, slips)
        if empty and low == 0.0:
            break
        if tail:
            break
        z_a = z_b
        sums = added(sums, by, 1.0)
    return Listed(CellWalk(no_hit(), flags, i - first, fetches, False, False), 0.0, 0.0, 0.0)


@inlined
def close_listed_dda(out: Outputs, x: int, y: int, ray: Ray, listed: Listed) -> None:
    """Store what a walk found, also of a ray that was taken to end in its own pixel."""
    out.end[y, x] = 0
    close_pixel(out, x, y, ray, listed.walk)
    if listed.walk.hit.found:
        out.length[y, x] = listed.fade_length


@driver()
def trace_listing_dda_rows(
    view: ViewParams,
    row0: int,
    row1: int,
    stride: int,
    jittered: bool,
    seed: int,
    max_steps: int,
    max_distance: float,
    constant_thickness: float,
    thickness: float,
    bias: float,
    rounding: float,
    reject_self: bool,
    facing_test: bool,
    slips: int,
    slabs: F64Array,
    fade_px: F64Array,
    fade_length: F64Array,
    inputs: Inputs,
    out: Outputs,
) -> None:
    """Trace rows row0 to row1 − 1; each pixel writes only its own outputs.

    constant_thickness: as `march_listing_dda`'s thickness; thickness: as `SlabRules` has it.
    """
    for y in prange(row0, row1):
        rules = SlabRules(thickness, bias, rounding, reject_self, facing_test)
        unmoved = 0.0 if slips & OWN_PIXEL else 1.0
        for x in range(view.width):
            fade_px[y, x, 0] = np.nan
            fade_px[y, x, 1] = np.nan
            fade_length[y, x] = np.nan
            walks, ray = open_pixel(view, inputs, out, x, y, max_distance)
            if not (walks or out.end[y, x] > 0):
                continue
            if slips & NO_WINDOW:
                ray = unclipped(view, ray, max_distance)
            if slips & NUDGE:
                ray = nudged(view, ray, max_distance)
            if not (ray.s_end > OWN_PIXEL_END or slips & OWN_PIXEL):
                continue
            listed = march_listing_dda(
                view,
                rules,
                slabs,
                inputs.depth,
                inputs.back,
                inputs.geo_normal,
                ray,
                stride,
                jitter(x, y, seed) if jittered else unmoved,
                max_steps,
                constant_thickness,
                slips,
            )
            close_listed_dda(out, x, y, ray, listed)
            if listed.walk.hit.found:
                fade_px[y, x, 0] = listed.fade_px
                fade_px[y, x, 1] = listed.fade_py
                fade_length[y, x] = listed.fade_length

"""The 3-D march as its listing was published, slips included: `Settings.listing`.

For comparing with code that descends from it. Each slip is a bit, so that one alone can be taken
away; `march_view` has none of them. docs/errata_tracers.md says what each does. Two things are made
safe: a read outside the image takes the nearest pixel, as a sampler that clamps to the edge does,
and a hit's position is moved to the nearest one inside the image.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from .._jit import driver, inlined, kernel
from ..camera import ViewParams
from ..typed import F64Array, FloatArray
from ..vecmath.noise import jitter
from .hit import OPEN, OVER_EMPTY, PASSED_BEHIND, Hit, load_slab, no_hit
from .march_cells import CellWalk
from .march_view import LINEAR, NO_REFINE, Spot, in_own_pixel, seen, spot_at
from .ray import Ray
from .rows import Inputs, Outputs, close_pixel, open_pixel, store_length

STRICT = 1
"""Equality with front + bias or back is no hit."""
NO_WINDOW = 2
"""Nothing ends the walk where the ray leaves the image or passes the near plane and the eye."""
NOISE_ALONG = 4
"""Noise is that of the pixel the ray was in before the step, not the origin's."""
OWN_PIXEL = 8
"""The origin's own pixel may be hit, and there is no tangent-plane rule: only bias helps."""
BASE_STEP = 16
"""Refinement goes back by halves of the base step, not of the last increment."""
NO_DISTANCE = 32
"""max_distance does not end the walk."""
UNREFINED_FADES = 64
"""Fades are those of the sample that hit, before refinement."""
ALL_SLIPS = 127


class Listed(NamedTuple):
    """A walk, and the place and distance that its fades are taken at."""

    walk: CellWalk
    fade_px: float
    fade_py: float
    fade_length: float


@kernel
def clamped(p: float, size: int) -> int:
    """Index of the texel at a coordinate; outside (and NaN): the nearest one inside."""
    if not p > 0.0:
        return 0
    return np.int64(p) if p < size else size - 1


@kernel
def clamped_position(p: float, size: int) -> float:
    """The coordinate moved into [0, size)."""
    if not p > 0.0:
        return 0.0
    return p if p < size else np.nextafter(np.float64(size), 0.0)


@kernel
def meets(slabs: F64Array, x: int, y: int, depth: float, strict: bool) -> bool:
    """Whether a view depth is in the slab of a pixel."""
    low, back = slabs[y, x, 0], slabs[y, x, 1]
    return low < depth < back if strict else low <= depth <= back


@kernel
def listed_hit(
    view: ViewParams, slabs: F64Array, depth: FloatArray, back: FloatArray, spot: Spot, t: float
) -> Hit:
    """The hit at distance t, where nothing was checked after refinement.

    residual has any size and sign, and is NaN over a pixel that cannot be hit.
    """
    x, y = clamped(spot.px, view.width), clamped(spot.py, view.height)
    px, py = clamped_position(spot.px, view.width), clamped_position(spot.py, view.height)
    if slabs[y, x, 0] == np.inf:
        return Hit(True, px, py, t, spot.depth, np.nan, OPEN)
    slab = load_slab(slabs, depth, back, x, y)
    return Hit(True, px, py, t, spot.depth, spot.depth - slab.front, slab.flags)


@kernel
def march_listing(
    view: ViewParams,
    slabs: F64Array,
    depth: FloatArray,
    back: FloatArray,
    ray: Ray,
    step: float,
    growth: int,
    jittered: bool,
    seed: int,
    halvings: int,
    max_steps: int,
    max_distance: float,
    slips: int,
) -> Listed:
    """Walk a ray as published: the increments are added up, and only max_steps ends it.

    `cells` of the result counts samples, those in the own pixel too.
    """
    reads = 2 if back.shape[0] > 0 else 1
    flags = 0
    fetches = 0
    t = 0.0
    x, y = ray.x, ray.y
    for i in range(max_steps):
        if slips & NOISE_ALONG == 0:
            x, y = ray.x, ray.y
        noise = jitter(x, y, seed) if jittered else 1.0
        increment = step if growth != LINEAR and i > 0 else (i + noise) * step
        t += increment
        spot = spot_at(view, ray, t)
        if slips & NO_DISTANCE == 0 and not t < max_distance:
            return Listed(CellWalk(no_hit(), flags, i, fetches, False, False), 0.0, 0.0, 0.0)
        if slips & NO_WINDOW == 0 and not seen(view, spot):
            return Listed(CellWalk(no_hit(), flags, i, fetches, False, False), 0.0, 0.0, 0.0)
        x, y = clamped(spot.px, view.width), clamped(spot.py, view.height)
        if slabs[y, x, 0] == np.inf:
            flags |= OVER_EMPTY
            fetches += 1
            continue
        fetches += reads
        if not meets(slabs, x, y, spot.depth, slips & STRICT != 0):
            flags |= PASSED_BEHIND if spot.depth > slabs[y, x, 1] else 0
            continue
        if slips & OWN_PIXEL == 0 and seen(view, spot) and in_own_pixel(ray, spot):
            continue

        # Back by halves while behind the front, forth while before it.
        refined = t
        half = step if slips & BASE_STEP else increment
        for _ in range(halvings):
            half *= 0.5
            at = spot_at(view, ray, refined)
            at_x, at_y = clamped(at.px, view.width), clamped(at.py, view.height)
            fetches += 1
            refined += half if at.depth < np.float64(depth[at_y, at_x]) else -half
        at = spot_at(view, ray, refined)
        hit = listed_hit(view, slabs, depth, back, at, refined)
        walk = CellWalk(hit, flags, i + 1, fetches, False, False)
        if slips & UNREFINED_FADES:
            return Listed(walk, spot.px, spot.py, t)
        return Listed(walk, at.px, at.py, refined)
    return Listed(CellWalk(no_hit(), flags, max_steps, fetches, True, False), 0.0, 0.0, 0.0)


@inlined
def close_listed(out: Outputs, x: int, y: int, ray: Ray, walk: CellWalk) -> None:
    """Store what a walk found, also of a ray that was taken to end in its own pixel."""
    out.end[y, x] = 0
    close_pixel(out, x, y, ray, walk)
    store_length(out, x, y, walk)


@driver()
def trace_listing_rows(
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
    slips: int,
    slabs: F64Array,
    fade_px: F64Array,
    fade_length: F64Array,
    inputs: Inputs,
    out: Outputs,
) -> None:
    """Trace rows row0 to row1 − 1; each pixel writes only its own outputs."""
    for y in prange(row0, row1):
        for x in range(view.width):
            fade_px[y, x, 0] = np.nan
            fade_px[y, x, 1] = np.nan
            fade_length[y, x] = np.nan
            limit = np.inf if slips & NO_DISTANCE else max_distance
            walks, ray = open_pixel(view, inputs, out, x, y, limit)
            # A ray that ends in its own pixel is walked too: the listing knows no end.
            if not (walks or out.end[y, x] > 0):
                continue
            listed = march_listing(
                view,
                slabs,
                inputs.depth,
                inputs.back,
                ray,
                step,
                growth,
                jittered,
                seed,
                0 if refine == NO_REFINE else halvings,
                max_steps,
                max_distance,
                slips,
            )
            close_listed(out, x, y, ray, listed.walk)
            if listed.walk.hit.found:
                fade_px[y, x, 0] = listed.fade_px
                fade_px[y, x, 1] = listed.fade_py
                fade_length[y, x] = listed.fade_length

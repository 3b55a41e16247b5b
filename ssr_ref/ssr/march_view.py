"""The 3-D march: samples at growing distances along the view-space ray, then binary refinement.

    distance(i) = Σ over m ≤ i of inc_m,  inc_m = (m + noise)·step (linear growth)
                                          inc_m = step, but inc_0 = noise·step (constant)

A sample is one point of the ray, compared with the slab of the pixel that it lands in. The sums are
in closed form, so every sample is a function of its own index. A linear growth takes quadratically
growing distances: near the origin it samples a pixel many times, far away it steps over things; a
constant one oversamples far away. That is what a walk in screen space (`march_dda`) is free of.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._jit import kernel
from ..camera import ViewParams
from ..typed import F64Array, FloatArray
from .hit import (
    OPEN,
    OVER_EMPTY,
    PASSED_BEHIND,
    Hit,
    SlabRules,
    load3,
    load_slab,
    no_hit,
    refusal,
)
from .march_cells import CellWalk
from .ray import Ray
from .record import EMPTY, HIT, PASSED, Log, refused, write
from .record import IN_FRONT as BEFORE

LINEAR, CONSTANT = 0, 1
"""How the increments grow."""

NO_REFINE, BISECT, SECANT = 0, 1, 2
"""What follows a hit: nothing, halvings of the bracket, halvings and one secant step."""

NOTHING, IN_FRONT, INSIDE = 0, 1, 2


class March(NamedTuple):
    """Where the samples of a ray are, and where they end. Lengths in scene units."""

    step: float
    growth: int  # LINEAR or CONSTANT
    noise: float  # in (0, 1]; 1 without jitter
    max_distance: float


class Spot(NamedTuple):
    """A point of the ray as the camera sees it."""

    px: float
    py: float
    depth: float


class Scan(NamedTuple):
    """Where `skip_misses` stopped, and what it went over."""

    i: int  # the sample it stopped at, not yet tested
    empty: int  # samples over empty pixels
    behind: int  # samples behind the back of their pixel


class Probe(NamedTuple):
    """A point of the ray against its pixel: NOTHING, IN_FRONT or INSIDE, and how far behind."""

    what: int
    gap: float  # depth − (front + bias) unless NOTHING
    fetches: int
    flags: int  # what was met that is no hit


@kernel
def distance_of(march: March, i: int) -> float:
    """Distance of sample i = 0, 1, … from the origin along the ray."""
    if march.growth == LINEAR:
        return (i + 1.0) * (0.5 * i + march.noise) * march.step
    return (i + march.noise) * march.step


@kernel
def spot_at(view: ViewParams, ray: Ray, t: float) -> Spot:
    """Pixel position and view depth of O + t·R; the position means nothing at depth ≤ 0."""
    o, r = ray.origin_vs, ray.direction_vs
    depth = ray.origin_depth - t * r.z
    x, y = view.fx * (o.x + t * r.x), view.fy * (o.y + t * r.y)
    if view.perspective:
        scale = 1.0 / depth
        return Spot(view.cx + x * scale, view.cy - y * scale, depth)
    return Spot(view.cx + x, view.cy - y, depth)


@kernel
def seen(view: ViewParams, spot: Spot) -> bool:
    """Whether the camera sees this place: beyond the near plane and inside the image."""
    return (
        spot.depth > view.near
        and spot.px >= 0.0
        and spot.py >= 0.0
        and spot.px < view.width
        and spot.py < view.height
    )


@kernel
def in_own_pixel(ray: Ray, spot: Spot) -> bool:
    """Whether a place that is seen lies in the origin's own pixel."""
    return np.int64(spot.px) == ray.x and np.int64(spot.py) == ray.y


@kernel
def leave_own_pixel(view: ViewParams, ray: Ray, march: March) -> int:
    """Index of the first sample that is not in the origin's own pixel, or ends the walk.

    A ray is straight on screen and never comes back.
    """
    i = 0
    while True:
        t = distance_of(march, i)
        if not t < march.max_distance:
            return i
        spot = spot_at(view, ray, t)
        if not (seen(view, spot) and in_own_pixel(ray, spot)):
            return i
        i += 1


@kernel
def skip_misses(
    view: ViewParams, slabs: F64Array, ray: Ray, march: March, i: int, i_end: int
) -> Scan:
    """Go on from sample i over plain misses: to the first inside its slab, the walk's end or i_end.

    A loop of its own, with few live values.
    """
    empty = 0
    behind = 0
    while i < i_end:
        t = distance_of(march, i)
        spot = spot_at(view, ray, t)
        if not (t < march.max_distance and seen(view, spot)):
            break
        x, y = np.uint32(spot.px), np.uint32(spot.py)
        low, z_back = slabs[y, x, 0], slabs[y, x, 1]
        if spot.depth >= low and spot.depth <= z_back:
            break
        empty += low == np.inf
        behind += spot.depth > z_back
        i += 1
    return Scan(i, empty, behind)


@kernel
def probe(
    view: ViewParams,
    rules: SlabRules,
    slabs: F64Array,
    depth: FloatArray,
    normal: FloatArray,
    ray: Ray,
    before: float,
    t: float,
    reads: int,
    log: Log | None,
) -> Probe:
    """The point at t by the hit rule. INSIDE: a hit; the own pixel and what is unseen: NOTHING.

    before: the distance that the log shows as the start of the interval.
    """
    spot = spot_at(view, ray, t)
    if not seen(view, spot) or in_own_pixel(ray, spot):
        return Probe(NOTHING, 0.0, 0, 0)
    x, y = np.int64(spot.px), np.int64(spot.py)
    low, z_back = slabs[y, x, 0], slabs[y, x, 1]
    gap = spot.depth - low
    if low == np.inf:
        found = Probe(NOTHING, 0.0, 1, OVER_EMPTY)
    elif spot.depth < low:
        found = Probe(IN_FRONT, gap, reads, 0)
    elif spot.depth > z_back:
        found = Probe(NOTHING, gap, reads, PASSED_BEHIND)
    else:
        z_front = np.float64(depth[y, x])
        why_not = refusal(view, rules, ray, x, y, z_front, load3(normal, y, x))
        found = Probe(INSIDE if why_not == 0 else NOTHING, gap, reads, why_not)
    if log is not None:
        what = HIT if found.what == INSIDE else BEFORE
        if found.flags == OVER_EMPTY:
            what = EMPTY
        elif found.flags == PASSED_BEHIND:
            what = PASSED
        elif found.flags != 0:
            what = refused(found.flags)
        z = ray.origin_depth - before * ray.direction_vs.z
        write(log, t, x, y, before, t, z, spot.depth, low, z_back, what)
    return found


@kernel
def refined(
    view: ViewParams,
    rules: SlabRules,
    slabs: F64Array,
    depth: FloatArray,
    normal: FloatArray,
    ray: Ray,
    outside: float,
    inside: float,
    refine: int,
    halvings: int,
    reads: int,
    log: Log | None,
) -> tuple[float, int]:
    """The distance of the hit between the last two samples, and the reads it took.

    The bracket is never left, and its `inside` end is a hit at every moment: that is returned. The
    secant step goes where the gaps in front of and behind the surface, taken as linear, are 0; it
    is left out unless the bracket begins in front of a surface, and undone if it is not inside.
    """
    fetches = 0
    # What the walk has read already is no row of the log.
    gap = probe(view, rules, slabs, depth, normal, ray, outside, outside, reads, None)
    for _ in range(halvings):
        middle = 0.5 * (outside + inside)
        at = probe(view, rules, slabs, depth, normal, ray, outside, middle, reads, log)
        fetches += at.fetches
        if at.what == INSIDE:
            inside = middle
        else:
            outside = middle
            gap = at
    if refine == SECANT and gap.what == IN_FRONT:
        behind = probe(view, rules, slabs, depth, normal, ray, inside, inside, reads, None).gap
        t = outside + (inside - outside) * (-gap.gap / (behind - gap.gap))
        t = min(max(t, outside), inside)
        at = probe(view, rules, slabs, depth, normal, ray, outside, t, reads, log)
        fetches += at.fetches
        if at.what == INSIDE:
            inside = t
    return inside, fetches


@kernel
def hit_at(
    view: ViewParams,
    rules: SlabRules,
    slabs: F64Array,
    depth: FloatArray,
    back: FloatArray,
    ray: Ray,
    t: float,
) -> Hit:
    """The hit at distance t, inside its pixel's slab; `s` of it is t."""
    spot = spot_at(view, ray, t)
    slab = load_slab(slabs, depth, back, np.int64(spot.px), np.int64(spot.py))
    residual = spot.depth - slab.front
    if slab.flags & OPEN and residual > rules.thickness:
        residual = rules.thickness  # back = front + thickness, rounded, may exceed it by an ulp
    return Hit(True, spot.px, spot.py, t, spot.depth, residual, slab.flags)


@kernel
def march_view(
    view: ViewParams,
    rules: SlabRules,
    slabs: F64Array,
    depth: FloatArray,
    back: FloatArray,
    normal: FloatArray,
    ray: Ray,
    march: March,
    refine: int,
    halvings: int,
    max_steps: int,
    log: Log | None,
) -> CellWalk:
    """Walk a ray by samples at `distance_of` 0, 1, …; those in the own pixel are not tested.

    It ends at a sample that is not seen or not before max_distance; which bound that is, the ray
    knows. `cells` of the result counts samples tested, the hit included; reads of the refinement
    count in `fetches`; flags are those of the samples' pixels. The hit's `s` is its distance.
    """
    reads = 2 if back.shape[0] > 0 else 1  # of a pixel that is not empty
    first = leave_own_pixel(view, ray, march)
    i = first
    flags = 0
    fetches = 0
    while True:
        if log is None:
            scan = skip_misses(view, slabs, ray, march, i, first + max_steps)
            fetches += (scan.i - i) * reads - scan.empty * (reads - 1)
            flags |= OVER_EMPTY if scan.empty > 0 else 0
            flags |= PASSED_BEHIND if scan.behind > 0 else 0
            i = scan.i

        t = distance_of(march, i)
        spot = spot_at(view, ray, t)
        if not (t < march.max_distance and seen(view, spot)):
            break
        if i - first == max_steps:
            return CellWalk(no_hit(), flags, i - first, fetches, True, False)

        # A candidate: only the tangent plane can still refuse it.
        before = distance_of(march, i - 1) if i > 0 else 0.0
        at = probe(view, rules, slabs, depth, normal, ray, before, t, reads, log)
        fetches += at.fetches
        i += 1
        if at.what == INSIDE:
            if refine != NO_REFINE:
                if log is not None:
                    log.state[1] = 1
                t, more = refined(
                    view, rules, slabs, depth, normal, ray, before, t, refine, halvings, reads, log
                )
                if log is not None:
                    log.state[1] = 0
                fetches += more
            hit = hit_at(view, rules, slabs, depth, back, ray, t)
            return CellWalk(hit, flags, i - first, fetches, False, False)
        flags |= at.flags
    return CellWalk(no_hit(), flags, i - first, fetches, False, False)

"""The DDA tracer: one sample a stride of major-axis pixels, interval against slab.

The interval of a sample reaches half a stride to both sides, and the first one starts where the ray
leaves its own pixel, so no interval holds the ray's own depth. Above stride 1 a sample only
proposes: every cell of its interval is re-walked exactly, and so is the first interval, unasked.
Source: McGuire and Mara, JCGT 3(4), 2014; what differs from the listing is in docs/dda.md.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._jit import kernel
from ..camera import ViewParams
from ..typed import F64Array, FloatArray
from .hit import (
    BEHIND,
    IN_SLAB,
    MISS,
    OVER_EMPTY,
    PASSED_BEHIND,
    Hit,
    SlabRules,
    compare_with_slab,
    load3,
    load_slab,
    locate_hit,
    no_hit,
    refusal,
)
from .march_cells import OWN_PIXEL, CellWalk, crossing, rewalk
from .ray import Ray, depth_at, position_x, position_y
from .record import EMPTY, HIT, IN_FRONT, PASSED, PROPOSED, Log, refused, write

NO_REFINE, REWALK, BISECT = 0, 1, 2
"""What a candidate leads to: a hit, an exact walk of its interval, or halving it."""

COLUMN, CELL, POINT, PUBLISHED = 0, 1, 2, 3
"""A sample's interval: half a stride either side; that inside its cell; itself; from the origin."""


@kernel
def clamp_to_cell(ray: Ray, x: int, y: int, a: float, b: float) -> tuple[float, float]:
    """The part of [a, b] in which the ray is inside pixel (x, y)."""
    into_x = crossing(x if ray.dp_x > 0.0 else x + 1, ray.p0_x, ray.dp_x)
    into_y = crossing(y if ray.dp_y > 0.0 else y + 1, ray.p0_y, ray.dp_y)
    out_x = crossing(x + 1 if ray.dp_x > 0.0 else x, ray.p0_x, ray.dp_x)
    out_y = crossing(y + 1 if ray.dp_y > 0.0 else y, ray.p0_y, ray.dp_y)
    if into_x != np.inf and into_x > a:
        a = into_x
    if into_y != np.inf and into_y > a:
        a = into_y
    return a, max(a, min(b, out_x, out_y))


class Scan(NamedTuple):
    """Where `skip_misses` stopped, and what it went over."""

    i: int  # the sample it stopped at, not yet tested
    z_a: float  # the ray's depth at the start of that sample's interval
    empty: int  # samples over empty pixels
    behind: int  # samples that passed behind their pixel


@kernel
def skip_misses(
    slabs: F64Array,
    ray: Ray,
    stride: float,
    offset: float,
    i: int,
    i_end: int,
    z_a: float,
) -> Scan:
    """Go on from sample i over plain misses, to the first that meets its pixel's slab, or i_end.

    All samples before i_end must lie inside the image, with their interval's end before s_end. A
    loop of its own, because one with few live values and no bounds to test is three times as fast.
    """
    half = 0.5 * stride
    p0_x, p0_y, dp_x, dp_y = ray.p0_x, ray.p0_y, ray.dp_x, ray.dp_y
    empty = 0
    behind = 0
    while i < i_end:
        s = (i + offset) * stride
        z_b = depth_at(ray, s + half)
        x, y = np.uint32(p0_x + s * dp_x), np.uint32(p0_y + s * dp_y)
        low = slabs[y, x, 0]
        verdict = compare_with_slab(z_a, z_b, low, slabs[y, x, 1])
        if verdict == IN_SLAB:
            break
        empty += low == np.inf
        behind += verdict == BEHIND
        z_a = z_b
        i += 1
    return Scan(i, z_a, empty, behind)


@kernel
def count_inside(view: ViewParams, ray: Ray, stride: float, offset: float, i: int) -> int:
    """The least index ≥ i whose sample is outside the image or whose interval is not all before
    s_end. Positions are monotone in the index, also as rounded, so all before it are fine.
    """
    half = 0.5 * stride
    n = np.int64(ray.s_end / stride - offset) + 1
    n = max(i, n)
    while n > i and not ((n - 1 + offset) * stride + half < ray.s_end):
        n -= 1
    while n > i and not inside_image(view, ray, (n - 1 + offset) * stride):
        n -= 1
    return n


@kernel
def inside_image(view: ViewParams, ray: Ray, s: float) -> bool:
    """Whether the sample at s reads a pixel of the image."""
    p_x, p_y = position_x(ray, s), position_y(ray, s)
    return p_x >= 0.0 and p_y >= 0.0 and p_x < view.width and p_y < view.height


@kernel
def bisect(
    view: ViewParams,
    rules: SlabRules,
    slabs: F64Array,
    depth: FloatArray,
    back: FloatArray,
    normal: FloatArray,
    ray: Ray,
    a: float,
    b: float,
    reads: int,
    log: Log | None,
) -> tuple[Hit, int]:
    """Halve [a, b] down to half a pixel, keeping the half whose end is behind its front.

    The hit at the deeper end's pixel, and the reads. It assumes one change of sign: an interval
    whose end lies in no slab, or in a pixel that is refused, gives no hit, and the sample's own is
    kept.
    """
    fetches = 0
    width = b - a
    while width > 0.5:
        middle = 0.5 * (a + b)
        width *= 0.5
        if not inside_image(view, ray, middle):
            b = middle
            continue
        x, y = np.int64(position_x(ray, middle)), np.int64(position_y(ray, middle))
        low = slabs[y, x, 0]
        fetches += 1 if low == np.inf else reads
        z = depth_at(ray, middle)
        if log is not None:
            what = EMPTY if low == np.inf else (IN_FRONT if z < low else PASSED)
            write(log, middle, x, y, middle, middle, z, z, low, slabs[y, x, 1], what)
        if z >= low:
            b = middle
        else:
            a = middle
    if not inside_image(view, ray, b):
        return no_hit(), fetches
    x, y = np.int64(position_x(ray, b)), np.int64(position_y(ray, b))
    low = slabs[y, x, 0]
    fetches += 1 if low == np.inf else reads
    z_a, z_b = depth_at(ray, a), depth_at(ray, b)
    verdict = MISS if low == np.inf else compare_with_slab(z_a, z_b, low, slabs[y, x, 1])
    why_not = 0
    if verdict == IN_SLAB:
        z_front = np.float64(depth[y, x])
        why_not = refusal(view, rules, ray, x, y, z_front, load3(normal, y, x))
    if log is not None:
        what = EMPTY if low == np.inf else (IN_FRONT if verdict == MISS else PASSED)
        if verdict == IN_SLAB:
            what = HIT if why_not == 0 else refused(why_not)
        write(log, b, x, y, a, b, z_a, z_b, low, slabs[y, x, 1], what)
    if verdict != IN_SLAB or why_not != 0:
        return no_hit(), fetches
    slab = load_slab(slabs, depth, back, x, y)
    return locate_hit(rules, ray, slab, x, y, a, b, False), fetches


@kernel
def march_dda(
    view: ViewParams,
    rules: SlabRules,
    slabs: F64Array,
    depth: FloatArray,
    back: FloatArray,
    normal: FloatArray,
    ray: Ray,
    stride: int,
    offset: float,
    refine: int,
    interval: int,
    max_steps: int,
    log: Log | None,
) -> CellWalk:
    """Walk a ray by samples s_i = (i + offset)·stride, i = 0, 1, …, offset in (0, 1].

    refine: NO_REFINE, REWALK or BISECT. interval: COLUMN, CELL, POINT or PUBLISHED. `cells` of the
    result counts samples tested, the hit included; re-walked cells and halvings count in `fetches`
    only. Flags are those of the tested samples' own pixels.
    """
    reads = 2 if back.shape[0] > 0 else 1  # of a pixel that is not empty
    stride_px = np.float64(stride)
    half = 0.5 * stride_px

    # Samples in the own pixel are skipped.
    first = 0
    while (first + offset) * stride_px <= OWN_PIXEL:
        first += 1
    i = first
    start = 0.0 if interval == PUBLISHED else OWN_PIXEL
    i_end = min(count_inside(view, ray, stride_px, offset, first), first + max_steps)
    z_a = depth_at(ray, start)
    flags = 0
    fetches = 0
    while True:
        # The first interval is always re-walked; from then on only candidates are of interest.
        if log is None and (refine != REWALK or i > first):
            scan = skip_misses(slabs, ray, stride_px, offset, i, i_end, z_a)
            fetches += (scan.i - i) * reads - scan.empty * (reads - 1)
            flags |= OVER_EMPTY if scan.empty > 0 else 0
            flags |= PASSED_BEHIND if scan.behind > 0 else 0
            i, z_a = scan.i, scan.z_a

        # The sample's place and interval; what is left after the last one gets its middle.
        s = (i + offset) * stride_px
        a = start if i == first else min((i - 1 + offset) * stride_px + half, ray.s_end)
        b = min(s + half, ray.s_end)
        last = s >= ray.s_end
        if last:
            if not a < ray.s_end:
                break
            s = 0.5 * (a + ray.s_end)
            b = ray.s_end
        if not inside_image(view, ray, s):
            break
        if i - first == max_steps:
            return CellWalk(no_hit(), flags, i - first, fetches, True, False)
        x, y = np.int64(position_x(ray, s)), np.int64(position_y(ray, s))
        z_b = depth_at(ray, b)

        # Compare the interval with the pixel's slab.
        i += 1
        steps = i - first
        low, z_back = slabs[y, x, 0], slabs[y, x, 1]
        propose = refine == REWALK and steps == 1
        near, far, z_near, z_far = a, b, z_a, z_b
        if interval == CELL:
            near, far = clamp_to_cell(ray, x, y, a, b)
            z_near, z_far = depth_at(ray, near), depth_at(ray, far)
        elif interval == POINT:
            near, far = s, s
            z_near, z_far = depth_at(ray, s), depth_at(ray, s)
        verdict = MISS if low == np.inf else compare_with_slab(z_near, z_far, low, z_back)
        why_not = 0
        if low == np.inf:
            fetches += 1
            flags |= OVER_EMPTY
        else:
            fetches += reads
            if verdict == BEHIND:
                flags |= PASSED_BEHIND
            elif verdict == IN_SLAB:
                propose = refine == REWALK
                z_front = np.float64(depth[y, x])
                why_not = refusal(view, rules, ray, x, y, z_front, load3(normal, y, x))
                flags |= why_not
        if log is not None:
            what = EMPTY if low == np.inf else (IN_FRONT if verdict == MISS else PASSED)
            if propose:
                what = PROPOSED
            elif verdict == IN_SLAB:
                what = HIT if why_not == 0 else refused(why_not)
            write(log, s, x, y, near, far, z_near, z_far, low, z_back, what)
        if verdict == IN_SLAB and why_not == 0 and refine != REWALK:
            slab = load_slab(slabs, depth, back, x, y)
            hit = locate_hit(rules, ray, slab, x, y, near, far, interval == CELL)
            if refine == BISECT:
                if log is not None:
                    log.state[1] = 1
                better, reads_more = bisect(
                    view, rules, slabs, depth, back, normal, ray, near, far, reads, log
                )
                if log is not None:
                    log.state[1] = 0
                fetches += reads_more
                if better.found:
                    hit = better
            return CellWalk(hit, flags, steps, fetches, False, False)
        if propose:
            walk = rewalk(view, rules, slabs, depth, back, normal, ray, a, b, log)
            fetches += walk.fetches
            if walk.hit.found:
                return CellWalk(walk.hit, flags, steps, fetches, False, False)
        if last:
            break
        z_a = z_b
    return CellWalk(no_hit(), flags, i - first, fetches, False, False)

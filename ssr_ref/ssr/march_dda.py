"""The DDA tracer: one sample a stride of major-axis pixels, interval against slab.

The interval of a sample reaches half a stride to both sides, and the first one starts where the ray
leaves its own pixel, so no interval holds the ray's own depth. Above stride 1 a sample only
proposes: every cell of its interval is re-walked exactly, and so is the first interval, unasked.
Source: McGuire and Mara, JCGT 3(4), 2014; what differs from the listing is in docs/dda.md.
"""

from __future__ import annotations

import numpy as np

from .._jit import kernel
from ..camera import ViewParams
from ..typed import FloatArray
from .hit import (
    BEHIND,
    IN_SLAB,
    OPEN,
    OVER_EMPTY,
    PASSED_BEHIND,
    SELF_REJECTED,
    Slab,
    SlabRules,
    above_tangent_plane,
    compare_with_slab,
    load3,
    locate_hit,
    no_hit,
)
from .march_cells import OWN_PIXEL, CellWalk, crossing, rewalk
from .ray import Ray, depth_at, position_x, position_y


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


@kernel
def march_dda(
    view: ViewParams,
    rules: SlabRules,
    front: FloatArray,
    back: FloatArray,
    normal: FloatArray,
    ray: Ray,
    stride: int,
    offset: float,
    refine: bool,
    cell_interval: bool,
    max_steps: int,
) -> CellWalk:
    """Walk a ray by samples s_i = (i − 1 + offset)·stride, offset in (0, 1].

    `cells` of the result counts samples tested, the hit included; re-walked cells count in
    `fetches` only. Flags are those of the tested samples' own pixels.
    """
    has_back = back.shape[0] > 0
    half = 0.5 * stride
    flags = 0
    steps = 0
    fetches = 0
    a = OWN_PIXEL
    z_a = depth_at(ray, a)
    i = 0
    while True:
        # Samples in the own pixel are skipped; what is left after the last gets its middle.
        s = (i + offset) * stride
        i += 1
        if s <= OWN_PIXEL:
            continue
        last = s >= ray.s_end
        if last:
            if not a < ray.s_end:
                break
            s = 0.5 * (a + ray.s_end)
        b = ray.s_end if last else min(s + half, ray.s_end)

        # Read the pixel of the sample; outside the image the walk ends.
        p_x, p_y = position_x(ray, s), position_y(ray, s)
        if not (p_x >= 0.0 and p_y >= 0.0 and p_x < view.width and p_y < view.height):
            break
        if steps == max_steps:
            return CellWalk(no_hit(), flags, steps, fetches, True)
        x, y = np.int64(p_x), np.int64(p_y)
        z_b = depth_at(ray, b)
        z_front = np.float64(front[y, x])
        steps += 1
        fetches += 1
        propose = refine and steps == 1
        if z_front == np.inf:
            flags |= OVER_EMPTY
        else:
            # Compare the interval with the pixel's slab.
            z_back = z_front + rules.thickness
            is_open = OPEN
            if has_back:
                fetches += 1
                if back[y, x] < np.inf:
                    z_back = np.float64(back[y, x])
                    is_open = 0
            near, far, z_near, z_far = a, b, z_a, z_b
            if cell_interval:
                near, far = clamp_to_cell(ray, x, y, a, b)
                z_near, z_far = depth_at(ray, near), depth_at(ray, far)
            verdict = compare_with_slab(z_near, z_far, z_front + rules.bias, z_back)
            if verdict == BEHIND:
                flags |= PASSED_BEHIND
            elif verdict == IN_SLAB:
                propose = refine
                if rules.reject_self and not above_tangent_plane(
                    view, rules.rounding, ray, x, y, z_front, load3(normal, y, x)
                ):
                    flags |= SELF_REJECTED
                elif not refine:
                    slab = Slab(z_front, z_back, is_open)
                    hit = locate_hit(rules, ray, slab, x, y, near, far, cell_interval)
                    return CellWalk(hit, flags, steps, fetches, False)
        if propose:
            walk = rewalk(view, rules, front, back, normal, ray, a, b)
            fetches += walk.fetches
            if walk.hit.found:
                return CellWalk(walk.hit, flags, steps, fetches, False)
        if last:
            break
        a, z_a = b, z_b
    return CellWalk(no_hit(), flags, steps, fetches, False)

"""Exact cells: every pixel the projected ray crosses, with its depth interval inside each.

The oracle of all screen-space tracers. The number of cells is fixed in advance by integers, and
each crossing is computed from the border's index, so nothing accumulates. A corner crossed exactly
steps x first.
Source: Amanatides and Woo, A Fast Voxel Traversal Algorithm for Ray Tracing, Eurographics 1987.
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
    OVER_EMPTY,
    PASSED_BEHIND,
    SELF_REJECTED,
    Hit,
    SlabRules,
    above_tangent_plane,
    compare_with_slab,
    load3,
    load_slab,
    locate_hit,
    no_hit,
)
from .ray import Ray, depth_at, position_x, position_y

OWN_PIXEL = 0.5
"""s at which a ray has left its own pixel along the major axis."""


class CellWalk(NamedTuple):
    """Outcome of a walk: the hit, flags met, cells tested, reads, and whether cells were left."""

    hit: Hit
    flags: int
    cells: int
    fetches: int
    out_of_cells: bool


@kernel
def crossing(border: int, p0: float, dp: float) -> float:
    """s at which a coordinate crosses a pixel border; inf if it never does."""
    return (border - p0) / dp if dp != 0.0 else np.inf


@kernel
def cell_after(p: float, dp: float) -> int:
    """Pixel index that a coordinate enters just after it is at p."""
    return np.int64(np.floor(p)) if dp >= 0.0 else np.int64(np.ceil(p)) - 1


@kernel
def cell_before(p: float, dp: float) -> int:
    """Pixel index that a coordinate is in just before it is at p."""
    return np.int64(np.ceil(p)) - 1 if dp > 0.0 else np.int64(np.floor(p))


@kernel
def walk_cells(
    view: ViewParams,
    rules: SlabRules,
    slabs: F64Array,
    depth: FloatArray,
    back: FloatArray,
    normal: FloatArray,
    ray: Ray,
    x: int,
    y: int,
    x_last: int,
    y_last: int,
    a: float,
    b: float,
    skip_first: bool,
    max_cells: int,
) -> CellWalk:
    """Walk the cells from (x, y) to (x_last, y_last) over a ≤ s ≤ b; the first hit ends it.

    skip_first: the first cell is the origin's own and is neither tested nor counted.
    """
    reads = 2 if back.shape[0] > 0 else 1  # of a pixel that is not empty
    step_x = 1 if ray.dp_x > 0.0 else -1
    step_y = 1 if ray.dp_y > 0.0 else -1
    left_x = max(0, (x_last - x) * step_x) if ray.dp_x != 0.0 else 0
    left_y = max(0, (y_last - y) * step_y) if ray.dp_y != 0.0 else 0
    ahead_x = 1 if step_x > 0 else 0
    ahead_y = 1 if step_y > 0 else 0
    outside_x = view.width if step_x > 0 else -1
    outside_y = view.height if step_y > 0 else -1
    s_x = crossing(x + ahead_x, ray.p0_x, ray.dp_x) if left_x > 0 else np.inf
    s_y = crossing(y + ahead_y, ray.p0_y, ray.dp_y) if left_y > 0 else np.inf
    entry = a
    z_entry = depth_at(ray, entry)
    flags = 0
    cells = 0
    fetches = 0
    first = skip_first
    if x < 0 or y < 0 or x >= view.width or y >= view.height:
        return CellWalk(no_hit(), 0, 0, 0, False)
    while True:
        # The cell is left where the nearer border is crossed, the last one at b.
        leave = min(s_x, s_y)
        leave = min(max(leave, entry), b)
        z_leave = depth_at(ray, leave)
        if not first:
            if cells == max_cells:
                return CellWalk(no_hit(), flags, cells, fetches, True)
            cells += 1
            low = slabs[y, x, 0]
            verdict = compare_with_slab(z_entry, z_leave, low, slabs[y, x, 1])
            if low == np.inf:
                fetches += 1
                flags |= OVER_EMPTY
            else:
                fetches += reads
                if verdict == BEHIND:
                    flags |= PASSED_BEHIND
                elif verdict == IN_SLAB:
                    z_front = np.float64(depth[y, x])
                    if not rules.reject_self or above_tangent_plane(
                        view, rules.rounding, ray, x, y, z_front, load3(normal, y, x)
                    ):
                        slab = load_slab(slabs, depth, back, x, y)
                        hit = locate_hit(rules, ray, slab, x, y, entry, leave, True)
                        return CellWalk(hit, flags, cells, fetches, False)
                    flags |= SELF_REJECTED
        first = False
        if left_x == 0 and left_y == 0:
            break
        if s_x <= s_y:
            x += step_x
            if x == outside_x:
                break
            left_x -= 1
            s_x = crossing(x + ahead_x, ray.p0_x, ray.dp_x) if left_x > 0 else np.inf
        else:
            y += step_y
            if y == outside_y:
                break
            left_y -= 1
            s_y = crossing(y + ahead_y, ray.p0_y, ray.dp_y) if left_y > 0 else np.inf
        entry = leave
        z_entry = z_leave
    return CellWalk(no_hit(), flags, cells, fetches, False)


@kernel
def march_cells(
    view: ViewParams,
    rules: SlabRules,
    slabs: F64Array,
    depth: FloatArray,
    back: FloatArray,
    normal: FloatArray,
    ray: Ray,
    max_steps: int,
) -> CellWalk:
    """Exact walk of a whole ray, the origin's own pixel left out."""
    x_last = np.int64(np.floor(position_x(ray, ray.s_end)))
    y_last = np.int64(np.floor(position_y(ray, ray.s_end)))
    return walk_cells(
        view,
        rules,
        slabs,
        depth,
        back,
        normal,
        ray,
        ray.x,
        ray.y,
        x_last,
        y_last,
        0.0,
        ray.s_end,
        True,
        max_steps,
    )


@kernel
def rewalk(
    view: ViewParams,
    rules: SlabRules,
    slabs: F64Array,
    depth: FloatArray,
    back: FloatArray,
    normal: FloatArray,
    ray: Ray,
    a: float,
    b: float,
) -> CellWalk:
    """Exact walk of one interval, as refinement of a strided sample."""
    limit = view.width + view.height + 2
    x_last = cell_before(position_x(ray, b), ray.dp_x)
    y_last = cell_before(position_y(ray, b), ray.dp_y)
    own = a == OWN_PIXEL  # leaves the origin's own pixel, by the same rule as the exact walk
    x = ray.x if own else cell_after(position_x(ray, a), ray.dp_x)
    y = ray.y if own else cell_after(position_y(ray, a), ray.dp_y)
    start = 0.0 if own else a
    return walk_cells(
        view, rules, slabs, depth, back, normal, ray, x, y, x_last, y_last, start, b, own, limit
    )

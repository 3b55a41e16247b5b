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
from .ray import Ray, depth_at, position_x, position_y
from .record import EMPTY, HIT, IN_FRONT, PASSED, Log, refused, write

OWN_PIXEL = 0.5
"""s at which a ray has left its own pixel along the major axis."""


class CellWalk(NamedTuple):
    """Outcome of a walk: the hit, flags met, cells tested, reads; whether cells were left; whether
    it entered a solid through a face that the camera cannot see.
    """

    hit: Hit
    flags: int
    cells: int
    fetches: int
    out_of_cells: bool
    blocked: bool


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


CANDIDATE, END, LIMIT = 0, 1, 2


class Walker(NamedTuple):
    """Where a walk is: the cell, borders left to cross and their s, the cell's interval."""

    why: int  # CANDIDATE, END or LIMIT: why `next_candidate` stopped here
    x: int
    y: int
    left_x: int
    left_y: int
    s_x: float
    s_y: float
    entry: float
    leave: float
    z_entry: float
    z_leave: float
    cells: int
    empty: int
    behind: int


@kernel
def start_walk(ray: Ray, x: int, y: int, x_last: int, y_last: int, a: float, b: float) -> Walker:
    """A walker in its first cell, which it has not counted."""
    left_x = max(0, (x_last - x) * (1 if ray.dp_x > 0.0 else -1)) if ray.dp_x != 0.0 else 0
    left_y = max(0, (y_last - y) * (1 if ray.dp_y > 0.0 else -1)) if ray.dp_y != 0.0 else 0
    border_x, border_y = x + (1 if ray.dp_x > 0.0 else 0), y + (1 if ray.dp_y > 0.0 else 0)
    s_x = crossing(border_x, ray.p0_x, ray.dp_x) if left_x > 0 else np.inf
    s_y = crossing(border_y, ray.p0_y, ray.dp_y) if left_y > 0 else np.inf
    leave = min(max(min(s_x, s_y), a), b)
    z_a, z_leave = depth_at(ray, a), depth_at(ray, leave)
    return Walker(END, x, y, left_x, left_y, s_x, s_y, a, leave, z_a, z_leave, 0, 0, 0)


@kernel
def next_candidate(
    width: int,
    height: int,
    slabs: F64Array,
    ray: Ray,
    b: float,
    walker: Walker,
    move: bool,
    max_cells: int,
    log: Log | None,
) -> Walker:
    """Go on over cells that are plain misses, to the first that the ray's interval meets.

    move: leave the walker's cell first; without it the cell is tested itself. Apart from
    `walk_cells`, because a loop with few live values is half as long.
    """
    step_x, step_y = 1 if ray.dp_x > 0.0 else -1, 1 if ray.dp_y > 0.0 else -1
    ahead_x, ahead_y = 1 if step_x > 0 else 0, 1 if step_y > 0 else 0
    outside_x, outside_y = width if step_x > 0 else -1, height if step_y > 0 else -1
    p0_x, p0_y, dp_x, dp_y = ray.p0_x, ray.p0_y, ray.dp_x, ray.dp_y
    _, x, y, left_x, left_y, s_x, s_y, entry, leave, z_entry, z_leave, cells, empty, behind = walker
    why = END
    while True:
        if move:
            if left_x == 0 and left_y == 0:
                break
            if s_x <= s_y:  # a corner crossed exactly steps x first
                x += step_x
                if x == outside_x:
                    break
                left_x -= 1
                s_x = (x + ahead_x - p0_x) / dp_x if left_x > 0 else np.inf
            else:
                y += step_y
                if y == outside_y:
                    break
                left_y -= 1
                s_y = (y + ahead_y - p0_y) / dp_y if left_y > 0 else np.inf
            entry, z_entry = leave, z_leave
            # The cell is left where the nearer border is crossed, the last one at b.
            leave = s_x if s_x < s_y else s_y
            if not leave > entry:
                leave = entry
            if leave > b:
                leave = b
            z_leave = depth_at(ray, leave)
        move = True
        if cells == max_cells:
            why = LIMIT
            break
        cells += 1
        low = slabs[y, x, 0]
        verdict = compare_with_slab(z_entry, z_leave, low, slabs[y, x, 1])
        if log is not None:
            what = EMPTY if low == np.inf else (IN_FRONT if verdict == MISS else PASSED)
            if low == np.inf or verdict != IN_SLAB:
                z_back = slabs[y, x, 1]
                write(log, entry, x, y, entry, leave, z_entry, z_leave, low, z_back, what)
        if low == np.inf:
            empty += 1
        elif verdict == IN_SLAB:
            why = CANDIDATE
            break
        else:
            behind += verdict == BEHIND
    return Walker(
        why,
        x,
        y,
        left_x,
        left_y,
        s_x,
        s_y,
        entry,
        leave,
        z_entry,
        z_leave,
        cells,
        empty,
        behind,
    )


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
    log: Log | None,
) -> CellWalk:
    """Walk the cells from (x, y) to (x_last, y_last) over a ≤ s ≤ b; the first hit ends it.

    skip_first: the first cell is the origin's own and is neither tested nor counted.
    """
    if x < 0 or y < 0 or x >= view.width or y >= view.height:
        return CellWalk(no_hit(), 0, 0, 0, False, False)
    reads = 2 if back.shape[0] > 0 else 1  # of a pixel that is not empty
    walker = start_walk(ray, x, y, x_last, y_last, a, b)
    move = skip_first
    refusals = 0
    hit = no_hit()
    while True:
        walker = next_candidate(
            view.width, view.height, slabs, ray, b, walker, move, max_cells, log
        )
        if walker.why != CANDIDATE:
            break
        x, y = walker.x, walker.y
        z_front = np.float64(depth[y, x])
        why_not = refusal(view, rules, ray, x, y, z_front, load3(normal, y, x))
        if log is not None:
            write(
                log,
                walker.entry,
                x,
                y,
                walker.entry,
                walker.leave,
                walker.z_entry,
                walker.z_leave,
                slabs[y, x, 0],
                slabs[y, x, 1],
                HIT if why_not == 0 else refused(why_not),
            )
        if why_not == 0:
            slab = load_slab(slabs, depth, back, x, y)
            hit = locate_hit(rules, ray, slab, x, y, walker.entry, walker.leave, True)
            break
        refusals |= why_not
        move = True
    flags = refusals
    flags |= OVER_EMPTY if walker.empty > 0 else 0
    flags |= PASSED_BEHIND if walker.behind > 0 else 0
    fetches = walker.cells * reads - walker.empty * (reads - 1)
    return CellWalk(hit, flags, walker.cells, fetches, walker.why == LIMIT, False)


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
    log: Log | None,
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
        log,
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
    log: Log | None,
) -> CellWalk:
    """Exact walk of one interval, as refinement of a strided sample."""
    limit = view.width + view.height + 2
    x_last = cell_before(position_x(ray, b), ray.dp_x)
    y_last = cell_before(position_y(ray, b), ray.dp_y)
    own = a == OWN_PIXEL  # leaves the origin's own pixel, by the same rule as the exact walk
    x = ray.x if own else cell_after(position_x(ray, a), ray.dp_x)
    y = ray.y if own else cell_after(position_y(ray, a), ray.dp_y)
    start = 0.0 if own else a
    if log is not None:
        log.state[1] = 1
    walk = walk_cells(
        view,
        rules,
        slabs,
        depth,
        back,
        normal,
        ray,
        x,
        y,
        x_last,
        y_last,
        start,
        b,
        own,
        limit,
        log,
    )
    if log is not None:
        log.state[1] = 0
    return walk

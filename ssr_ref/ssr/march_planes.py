"""Planes per pixel: exact cells, and one fetch a step at stride 1; strided samples only propose.

In each cell the segment of the ray is compared with the pixel's plane, extended back over the cell
before. A ray that goes from in front to behind has hit it, unless that is beyond the back face. A
ray that is found inside the solid without having crossed the plane came in through a face that the
camera cannot see: by no more than the pixel's own depth range it is a contact, else it is BLOCKED.
A reflected ray starts behind the planes of its own convex body and can only come to their front:
no bias is needed against self-hits. The tangent-plane rule refuses what lies beyond an edge.
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
    into_pixel,
    load3,
    no_hit,
    refusal,
)
from .march_cells import OWN_PIXEL, CellWalk, cell_after, cell_before, crossing
from .march_dda import inside_image
from .planes import Plane, behind_by, depth_of, is_open, load_plane, ray_nearness, span
from .ray import Ray, depth_at, position_x, position_y
from .record import EMPTY, HIT, IN_FRONT, PASSED, PROPOSED, STOPPED, Log, refused, write

NOTHING, MET, BLOCKED = 0, 1, 2


class Meeting(NamedTuple):
    """What a segment met: NOTHING, MET or BLOCKED; where; and the state after it."""

    what: int
    s: float
    free: bool  # the ray's end is not inside the solid behind this pixel
    behind: bool  # the whole segment was behind the solid


@kernel
def meet_plane(plane: Plane, ray: Ray, s_before: float, a: float, b: float, free: bool) -> Meeting:
    """Compare the segment a ≤ s ≤ b, extended back to s_before for the crossing test."""
    e_before, e_b = behind_by(plane, ray, s_before), behind_by(plane, ray, b)
    if e_before < 0.0 and e_b < 0.0:  # in front of the plane all along; so are most
        return Meeting(NOTHING, a, True, False)
    tau = span(plane)
    w_a, w_b = ray_nearness(ray, a), ray_nearness(ray, b)
    stays_free = not (e_b > tau and w_b >= plane.back)
    if e_before < 0.0 and e_b >= 0.0:
        s = s_before + (b - s_before) * (-e_before) / (e_b - e_before)
        if ray_nearness(ray, s) >= plane.back:
            return Meeting(MET, max(s, a), stays_free, False)
    e_a = behind_by(plane, ray, a)
    if free and max(e_a, e_b) >= 0.0 and max(w_a, w_b) >= plane.back:
        if e_a <= tau and w_a >= plane.back:
            if e_a >= 0.0 and e_b > e_a:
                return Meeting(MET, a, stays_free, False)
        else:
            return Meeting(BLOCKED, a, stays_free, False)
    return Meeting(NOTHING, a, stays_free, max(w_a, w_b) < plane.back)


@kernel
def plane_hit(ray: Ray, plane: Plane, back: FloatArray, x: int, y: int, s: float) -> Hit:
    """The hit at s on the plane of pixel (x, y), moved into that pixel.

    residual: the ray's depth minus the plane's, 0 at a crossing inside the pixel up to rounding.
    """
    z = depth_at(ray, s)
    w = ray_nearness(ray, s) + behind_by(plane, ray, s)  # of the plane
    front = depth_of(ray.perspective, w)
    flags = OPEN if is_open(back, x, y) else 0
    px = into_pixel(position_x(ray, s), x, True)
    py = into_pixel(position_y(ray, s), y, True)
    return Hit(True, px, py, s, z, max(z - front, 0.0), flags)


@kernel
def write_plane(
    log: Log, ray: Ray, plane: Plane, x: int, y: int, s: float, a: float, b: float, what: int
) -> None:
    """A row of a log: front and back are the plane's depth at P(s) and the solid's end."""
    w = ray_nearness(ray, s) + behind_by(plane, ray, s)
    front, z_back = np.inf, np.inf
    if what != EMPTY:
        front = depth_of(ray.perspective, w)
        z_back = depth_of(ray.perspective, plane.back)
    write(log, s, x, y, a, b, depth_at(ray, a), depth_at(ray, b), front, z_back, what)


class Tried(NamedTuple):
    """What the test of one pixel came to: a hit, or BLOCKED, or neither."""

    hit: Hit
    blocked: bool
    free: bool  # as in `Meeting`
    flags: int
    fetches: int


@kernel
def try_plane(
    view: ViewParams,
    rules: SlabRules,
    planes: F64Array,
    depth: FloatArray,
    back: FloatArray,
    normal: FloatArray,
    ray: Ray,
    x: int,
    y: int,
    s: float,
    before: float,
    a: float,
    b: float,
    free: bool,
    log: Log | None,
) -> Tried:
    """Test pixel (x, y), read at s, over a ≤ s ≤ b; `before`: where the segment before begins."""
    plane = load_plane(planes, x, y)
    hit = no_hit()
    blocked = False
    flags = 0
    fetches = 1
    what = EMPTY
    if plane.w == -np.inf:
        flags = OVER_EMPTY
        free = True
    else:
        fetches = 2 if back.shape[0] > 0 else 1
        meeting = meet_plane(plane, ray, before, a, b, free)
        free = meeting.free
        what = IN_FRONT
        if meeting.what == MET:
            z_front = np.float64(depth[y, x])
            flags = refusal(view, rules, ray, x, y, z_front, load3(normal, y, x))
            if flags == 0:
                hit = plane_hit(ray, plane, back, x, y, meeting.s)
            what = HIT if flags == 0 else refused(flags)
        elif meeting.what == BLOCKED and not is_open(back, x, y):
            blocked = True
            what = STOPPED
        elif meeting.behind:
            flags = PASSED_BEHIND
            what = PASSED
    if log is not None:
        write_plane(log, ray, plane, x, y, s, a, b, what)
    return Tried(hit, blocked, free, flags, fetches)


@kernel
def walk_plane_cells(
    view: ViewParams,
    rules: SlabRules,
    planes: F64Array,
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
    own: bool,
    max_cells: int,
    log: Log | None,
) -> CellWalk:
    """Walk the cells from (x, y) to (x_last, y_last) over a ≤ s ≤ b; the first hit ends it.

    The first cell is not tested: it is the origin's own (`own`), or one before the interval that
    only says whether the ray comes out of a solid.
    """
    if x < 0 or y < 0 or x >= view.width or y >= view.height:
        return CellWalk(no_hit(), 0, 0, 0, False, False)
    step_x, step_y = 1 if ray.dp_x > 0.0 else -1, 1 if ray.dp_y > 0.0 else -1
    ahead_x, ahead_y = 1 if step_x > 0 else 0, 1 if step_y > 0 else 0
    left_x = max(0, (x_last - x) * step_x) if ray.dp_x != 0.0 else 0
    left_y = max(0, (y_last - y) * step_y) if ray.dp_y != 0.0 else 0
    s_x = crossing(x + ahead_x, ray.p0_x, ray.dp_x) if left_x > 0 else np.inf
    s_y = crossing(y + ahead_y, ray.p0_y, ray.dp_y) if left_y > 0 else np.inf
    flags = 0
    cells = 0
    fetches = 0
    free = True
    entry = a
    leave = min(max(min(s_x, s_y), a), b)
    if not own and planes[y, x, 0] > -np.inf:
        free = meet_plane(load_plane(planes, x, y), ray, a, a, leave, True).free
    while left_x > 0 or left_y > 0:
        # Enter the next cell; a corner crossed exactly steps x first.
        if s_x <= s_y:
            x += step_x
            left_x -= 1
            s_x = (x + ahead_x - ray.p0_x) / ray.dp_x if left_x > 0 else np.inf
        else:
            y += step_y
            left_y -= 1
            s_y = (y + ahead_y - ray.p0_y) / ray.dp_y if left_y > 0 else np.inf
        if x < 0 or y < 0 or x >= view.width or y >= view.height:
            break
        before, entry = entry, leave
        leave = min(max(min(s_x, s_y), entry), b)
        if cells == max_cells:
            return CellWalk(no_hit(), flags, cells, fetches, True, False)
        cells += 1
        tried = try_plane(
            view,
            rules,
            planes,
            depth,
            back,
            normal,
            ray,
            x,
            y,
            entry,
            before,
            entry,
            leave,
            free,
            log,
        )
        free = tried.free
        flags |= tried.flags
        fetches += tried.fetches
        if tried.hit.found or tried.blocked:
            return CellWalk(tried.hit, flags, cells, fetches, False, tried.blocked)
    return CellWalk(no_hit(), flags, cells, fetches, False, False)


@kernel
def march_plane_cells(
    view: ViewParams,
    rules: SlabRules,
    planes: F64Array,
    depth: FloatArray,
    back: FloatArray,
    normal: FloatArray,
    ray: Ray,
    max_steps: int,
    log: Log | None,
) -> CellWalk:
    """Exact cells of a whole ray against planes."""
    x_last = np.int64(np.floor(position_x(ray, ray.s_end)))
    y_last = np.int64(np.floor(position_y(ray, ray.s_end)))
    return walk_plane_cells(
        view,
        rules,
        planes,
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
def rewalk_planes(
    view: ViewParams,
    rules: SlabRules,
    planes: F64Array,
    depth: FloatArray,
    back: FloatArray,
    normal: FloatArray,
    ray: Ray,
    a: float,
    b: float,
    log: Log | None,
) -> CellWalk:
    """Exact cells of one interval, as refinement of a strided sample.

    It begins one pixel early: that cell says where the ray comes from.
    """
    limit = view.width + view.height + 2
    x_last = cell_before(position_x(ray, b), ray.dp_x)
    y_last = cell_before(position_y(ray, b), ray.dp_y)
    start = a - 1.0
    own = start <= OWN_PIXEL
    x, y = ray.x, ray.y
    if own:
        start = 0.0
    else:
        x = cell_after(position_x(ray, start), ray.dp_x)
        y = cell_after(position_y(ray, start), ray.dp_y)
    if log is not None:
        log.state[1] = 1
    walk = walk_plane_cells(
        view,
        rules,
        planes,
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


@kernel
def march_plane_samples(
    view: ViewParams,
    rules: SlabRules,
    planes: F64Array,
    depth: FloatArray,
    back: FloatArray,
    normal: FloatArray,
    ray: Ray,
    offset: float,
    max_steps: int,
    log: Log | None,
) -> CellWalk:
    """Samples of stride 1 as in `march_dda`, one pixel read each.

    The sample's interval is tested against the pixel's plane, extended back over the interval
    before.
    """
    first = 0 if offset > OWN_PIXEL else 1
    i = first
    flags = 0
    fetches = 0
    free = True
    before = 0.0
    a = OWN_PIXEL
    while a < ray.s_end:
        s = i + offset
        b = min(s + 0.5, ray.s_end)
        if s >= ray.s_end:  # what is left after the last sample gets its middle
            s = 0.5 * (a + ray.s_end)
            b = ray.s_end
        if not inside_image(view, ray, s):
            break
        if i - first == max_steps:
            return CellWalk(no_hit(), flags, i - first, fetches, True, False)
        x, y = np.int64(position_x(ray, s)), np.int64(position_y(ray, s))
        i += 1
        tried = try_plane(
            view, rules, planes, depth, back, normal, ray, x, y, s, before, a, b, free, log
        )
        free = tried.free
        flags |= tried.flags
        fetches += tried.fetches
        if tried.hit.found or tried.blocked:
            return CellWalk(tried.hit, flags, i - first, fetches, False, tried.blocked)
        before, a = a, b
    return CellWalk(no_hit(), flags, i - first, fetches, False, False)


@kernel
def march_plane_strides(
    view: ViewParams,
    rules: SlabRules,
    planes: F64Array,
    depth: FloatArray,
    back: FloatArray,
    normal: FloatArray,
    ray: Ray,
    stride: int,
    offset: float,
    max_steps: int,
    log: Log | None,
) -> CellWalk:
    """Samples of a stride above 1: one that is behind its pixel's plane, in a solid, proposes.

    Then every cell since the sample before is walked exactly; so is the first stride, unasked. What
    is left after the last sample is one more, read at its middle. Re-walked cells count in
    `fetches` only; flags are those of the samples.
    """
    reads = 2 if back.shape[0] > 0 else 1
    stride_px = np.float64(stride)
    first = 0
    while (first + offset) * stride_px <= OWN_PIXEL:
        first += 1
    i = first
    flags = 0
    fetches = 0
    a = OWN_PIXEL
    while a < ray.s_end:
        b = (i + offset) * stride_px
        s = b
        if b >= ray.s_end:
            b = ray.s_end
            s = 0.5 * (a + b)
        if not inside_image(view, ray, s):
            break
        if i - first == max_steps:
            return CellWalk(no_hit(), flags, i - first, fetches, True, False)
        x, y = np.int64(position_x(ray, s)), np.int64(position_y(ray, s))
        plane = load_plane(planes, x, y)
        propose = i == first
        what = EMPTY
        i += 1
        if plane.w == -np.inf:
            flags |= OVER_EMPTY
            fetches += 1
        else:
            fetches += reads
            what = IN_FRONT
            if behind_by(plane, ray, b) >= 0.0:
                what = PASSED
                if max(ray_nearness(ray, a), ray_nearness(ray, b)) >= plane.back:
                    propose = True
                else:
                    flags |= PASSED_BEHIND
        if log is not None:
            write_plane(log, ray, plane, x, y, s, a, b, PROPOSED if propose else what)
        if propose:
            walk = rewalk_planes(view, rules, planes, depth, back, normal, ray, a, b, log)
            fetches += walk.fetches
            if walk.hit.found or walk.blocked:
                return CellWalk(walk.hit, flags, i - first, fetches, False, walk.blocked)
        a = b
    return CellWalk(no_hit(), flags, i - first, fetches, False, False)

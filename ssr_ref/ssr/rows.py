"""What every tracer does for a pixel before and after its walk: checks, set-up, status, outputs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._jit import inlined, kernel
from ..buffers import STATUS_OF_END, End, Flag, Status
from ..camera import ViewParams
from ..typed import F64Array, FloatArray, U8Array, U32Array
from ..vecmath.vec import Vec3
from .hit import load3
from .march_cells import OWN_PIXEL, CellWalk
from .ray import WALK, Ray, length_at, no_ray, start_ray

CELLS, DDA = 0, 1
"""Which pixels a ray reads: all that it crosses, or one a stride."""

HIT, BACKGROUND = int(Status.HIT), int(Status.BACKGROUND)
NOT_REFLECTIVE, BLOCKED = int(Status.NOT_REFLECTIVE), int(Status.BLOCKED)
STATUS_BACK_FACE = int(Status.BACK_FACE)
STATUS_PASSED_BEHIND, STATUS_SELF = int(Status.PASSED_BEHIND), int(Status.SELF)
FLAG_BACK_FACE = int(Flag.BACK_FACE_REJECTED)
FLAG_PASSED_BEHIND, FLAG_SELF = int(Flag.PASSED_BEHIND), int(Flag.SELF_REJECTED)
OUT_OF_STEPS = int(End.OUT_OF_STEPS)
END_TO_STATUS = int(STATUS_OF_END)

NO_IMAGE, NO_VECTORS = np.empty((0, 0)), np.empty((0, 0, 0))


class Inputs(NamedTuple):
    """The G-buffer as tracers read it; back has no pixels if thickness is constant."""

    depth: FloatArray  # (H, W)
    geo_normal: FloatArray  # (H, W, 3)
    normal: FloatArray  # (H, W, 3)
    reflectivity: FloatArray  # (H, W, 3)
    back: FloatArray  # (H, W) or (0, 0)
    # Where rays start, for who changes what they meet or how they leave (`blame`):
    origin: F64Array = NO_IMAGE  # (H, W) depth they start from; (0, 0): depth itself
    direction: F64Array = NO_VECTORS  # (H, W, 3) as in `start_ray`; (0, 0, 0): the mirror direction
    move_x: float = 0.0  # as in `start_ray`
    move_y: float = 0.0


class Outputs(NamedTuple):
    """The images of a HitBuffer."""

    status: U8Array
    end: U8Array
    flags: U8Array
    hit_px: F64Array
    hit_depth: F64Array
    residual: F64Array
    length: F64Array
    steps: U32Array
    fetches: U32Array


@kernel
def miss_status(flags: int, end: int) -> int:
    """The first reason that applies to a ray that met nothing."""
    if flags & FLAG_BACK_FACE:
        return STATUS_BACK_FACE
    if flags & FLAG_PASSED_BEHIND:
        return STATUS_PASSED_BEHIND
    if flags & FLAG_SELF:
        return STATUS_SELF
    return end + END_TO_STATUS


@inlined
def open_pixel(
    view: ViewParams, inputs: Inputs, out: Outputs, x: int, y: int, max_distance: float
) -> tuple[bool, Ray]:
    """Clear the outputs of a pixel and set up its ray; False if there is nothing to walk."""
    out.end[y, x] = 0
    out.flags[y, x] = 0
    out.hit_px[y, x, 0] = np.nan
    out.hit_px[y, x, 1] = np.nan
    out.hit_depth[y, x] = np.nan
    out.residual[y, x] = np.nan
    out.length[y, x] = np.nan
    out.steps[y, x] = 0
    out.fetches[y, x] = 0
    z = np.float64(inputs.depth[y, x])
    if z == np.inf:
        out.status[y, x] = BACKGROUND
        return False, no_ray(BACKGROUND)[1]
    if (
        inputs.reflectivity[y, x, 0] == 0.0
        and inputs.reflectivity[y, x, 1] == 0.0
        and inputs.reflectivity[y, x, 2] == 0.0
    ):
        out.status[y, x] = NOT_REFLECTIVE
        return False, no_ray(NOT_REFLECTIVE)[1]
    normal, geo_normal = load3(inputs.normal, y, x), load3(inputs.geo_normal, y, x)
    if inputs.origin.shape[0] > 0:
        z = inputs.origin[y, x]
    direction = Vec3(0.0, 0.0, 0.0)
    if inputs.direction.shape[0] > 0:
        direction = load3(inputs.direction, y, x)
    status, ray = start_ray(
        view,
        x,
        y,
        z,
        normal,
        geo_normal,
        max_distance,
        inputs.move_x,
        inputs.move_y,
        direction,
    )
    if status == WALK and not ray.s_end > OWN_PIXEL:
        out.end[y, x] = ray.end
        status = miss_status(0, ray.end)
    out.status[y, x] = status
    return status == WALK, ray


@inlined
def close_pixel(out: Outputs, x: int, y: int, ray: Ray, walk: CellWalk) -> None:
    """Store what a walk found."""
    out.steps[y, x] = walk.cells
    out.fetches[y, x] = walk.fetches
    out.flags[y, x] = walk.flags
    if walk.blocked:
        out.status[y, x] = BLOCKED
    elif walk.hit.found:
        out.status[y, x] = HIT
        out.flags[y, x] = walk.flags | walk.hit.flags
        out.hit_px[y, x, 0] = walk.hit.px
        out.hit_px[y, x, 1] = walk.hit.py
        out.hit_depth[y, x] = walk.hit.depth
        out.residual[y, x] = walk.hit.residual
        out.length[y, x] = length_at(ray, walk.hit.s)
    else:
        bound = OUT_OF_STEPS if walk.out_of_cells else ray.end
        out.end[y, x] = bound
        out.status[y, x] = miss_status(walk.flags, bound)


@inlined
def store_length(out: Outputs, x: int, y: int, walk: CellWalk) -> None:
    """Store the length of a walk whose hit's `s` is a distance already.

    Not in the driver itself: Numba's parallel pass drops a store there if it goes through a tuple.
    """
    if walk.hit.found:
        out.length[y, x] = walk.hit.s

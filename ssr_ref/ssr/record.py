"""A log of one walk: what was read, and what the tracer made of it.

The tracers take a `Log` or None. With None the compiler drops every line that writes, so a trace
pays nothing for them; with a log the walk is the same, without the loops that only skip misses.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from .._jit import kernel
from ..buffers import Flag
from ..typed import F64Array, I64Array, U32Array


class Verdict(IntEnum):
    """What became of a row, docs/pixel.md."""

    EMPTY = 0
    IN_FRONT = 1
    BEHIND = 2
    SELF_REJECTED = 3
    BACK_FACE_REJECTED = 4
    PROPOSED = 5
    HIT = 6
    BLOCKED = 7


SELF_FLAG = int(Flag.SELF_REJECTED)
EMPTY, IN_FRONT, PASSED, SELF, BACK_FACE, PROPOSED, HIT, STOPPED = (int(v) for v in Verdict)

COLUMNS = ("level", "s", "x", "y", "start", "end", "depth_start", "depth_end", "front", "back")
"""Of a row, then the verdict. level: 0 a sample, 1 a read of refinement; x, y: the pixel read; s
and the interval's start and end in pixels of the major axis (3-D march: distance along the ray);
depths and slab in scene units."""


class Log(NamedTuple):
    """Rows of walks, one for each test of a pixel; rows that do not fit are counted and not kept.

    counts: how often each pixel was tested; without pixels nothing is counted.
    """

    rows: F64Array  # (n, 11): COLUMNS and the verdict
    state: I64Array  # (2,): rows written, level of the next one
    counts: U32Array  # (H, W) or (0, 0)


def new_log(room: int) -> Log:
    """An empty log that keeps so many rows."""
    rows = np.zeros((room, len(COLUMNS) + 1))
    return Log(rows, np.zeros(2, np.int64), np.zeros((0, 0), np.uint32))


def new_counts(shape: tuple[int, int]) -> Log:
    """A log that only counts, for an image of (H, W) pixels."""
    return new_log(0)._replace(counts=np.zeros(shape, np.uint32))


@kernel
def write(
    log: Log,
    s: float,
    x: int,
    y: int,
    a: float,
    b: float,
    z_a: float,
    z_b: float,
    front: float,
    back: float,
    verdict: int,
) -> None:
    """Append a row, and count it."""
    n = log.state[0]
    log.state[0] = n + 1
    if log.counts.shape[0] > 0:
        log.counts[y, x] += np.uint32(1)
    if n < log.rows.shape[0]:
        log.rows[n, 0] = log.state[1]
        log.rows[n, 1] = s
        log.rows[n, 2] = x
        log.rows[n, 3] = y
        log.rows[n, 4] = a
        log.rows[n, 5] = b
        log.rows[n, 6] = z_a
        log.rows[n, 7] = z_b
        log.rows[n, 8] = front
        log.rows[n, 9] = back
        log.rows[n, 10] = verdict


@kernel
def refused(flag: int) -> int:
    """The verdict of a refusal's flag."""
    return SELF if flag == SELF_FLAG else BACK_FACE

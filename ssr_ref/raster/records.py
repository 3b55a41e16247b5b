"""What the stages of visibility hand to each other: projected vertices, clipped pieces, records."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._jit import inlined
from ..typed import F64Array, I32Array, I64Array, U8Array
from . import coverage

BAND_ROWS = 16
"""Rows of a band: whole rows keep stores sequential, 16 of them stay in the L2 cache."""

ANY_OBJECT = -2
"""Owner of every pixel where the back face of any object counts."""


class Projected(NamedTuple):
    """Vertices after projection: view position, snapped position (1/256 px), outcode."""

    positions_vs: F64Array  # (nv, 3)
    snapped: I32Array  # (nv, 2)
    outcode: U8Array  # (nv,)


class Pieces(NamedTuple):
    """Triangles that clipping made. Piece i is drawn as id nt + i."""

    parent: I32Array  # (n,) the triangle it was cut from
    snapped: I32Array  # (n, 6) x0 y0 x1 y1 x2 y2
    nearness: F64Array  # (n, 2) least and greatest k of the clipped polygon


class Bins(NamedTuple):
    """Draw records by band: rows start[band] to start[band + 1] of `order` index `records`.

    records (n, 3) int32: draw id, first | last column << 16, first | last row << 16.
    """

    records: I32Array
    start: I64Array
    order: I32Array


@inlined
def oriented_edges(
    draw_id: int, nt: int, snapped: I32Array, faces: I32Array, piece_snapped: I32Array
) -> coverage.Edges:
    """Edge functions of a draw record, positive inside whichever way it winds."""
    if draw_id >= nt:
        piece = draw_id - nt
        x0, y0 = np.int64(piece_snapped[piece, 0]), np.int64(piece_snapped[piece, 1])
        x1, y1 = np.int64(piece_snapped[piece, 2]), np.int64(piece_snapped[piece, 3])
        x2, y2 = np.int64(piece_snapped[piece, 4]), np.int64(piece_snapped[piece, 5])
    else:
        i0, i1, i2 = faces[draw_id, 0], faces[draw_id, 1], faces[draw_id, 2]
        x0, y0 = np.int64(snapped[i0, 0]), np.int64(snapped[i0, 1])
        x1, y1 = np.int64(snapped[i1, 0]), np.int64(snapped[i1, 1])
        x2, y2 = np.int64(snapped[i2, 0]), np.int64(snapped[i2, 1])
    if coverage.doubled_area(x0, y0, x1, y1, x2, y2) < 0:
        x1, x2 = x2, x1
        y1, y2 = y2, y1
    return coverage.make_edges(x0, y0, x1, y1, x2, y2)

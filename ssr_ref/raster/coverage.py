"""Which pixel centres a snapped triangle covers: exact integers, top-left rule, y down.

Vertices are whole numbers of 1/256 pixel. An edge p → q has E(P) = A·(P.x − p.x) + B·(P.y − p.y)
with A = p.y − q.y and B = q.x − p.x, positive inside. A centre on an edge belongs to the triangle
if the edge is a left edge (A > 0) or a top edge (A = 0, B > 0); elsewhere 1 is subtracted, so that
inside is E ≥ 0 in every case. A pixel step changes E by a multiple of 256, so E >> 8 loses nothing.

Sizes: coordinates stay within 2²⁵ (guard band 2¹⁶ px), so A and B fit 26 bits and E 52.
Source: the rules of Direct3D 11 and Vulkan (16.8 fixed point, top-left).
"""

from typing import NamedTuple

import numpy as np

from .._jit import inlined, kernel

SUBPIXELS = 256
HALF = 128


class Edges(NamedTuple):
    """Three edge functions e + a·x + b·y of the pixel's indices (x, y), int64; inside is ≥ 0."""

    a0: int
    b0: int
    e0: int
    a1: int
    b1: int
    e1: int
    a2: int
    b2: int
    e2: int


@inlined
def doubled_area(x0: int, y0: int, x1: int, y1: int, x2: int, y2: int) -> int:
    """Twice the signed area in (1/256 px)²; negative is counter-clockwise on screen (y down)."""
    return (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)


@inlined
def edge_at_origin(a: int, b: int, x: int, y: int) -> int:
    """E at the centre of pixel (0, 0) over 256, with the fill rule's −1."""
    top_left = (a > 0) | ((a == 0) & (b > 0))  # no branch: it could not be predicted
    return (a * (HALF - x) + b * (HALF - y) + top_left - 1) >> 8


@inlined
def make_edges(x0: int, y0: int, x1: int, y1: int, x2: int, y2: int) -> Edges:
    """Edge functions of a triangle with positive doubled area."""
    a0, b0 = y0 - y1, x1 - x0
    a1, b1 = y1 - y2, x2 - x1
    a2, b2 = y2 - y0, x0 - x2
    return Edges(
        a0,
        b0,
        edge_at_origin(a0, b0, x0, y0),
        a1,
        b1,
        edge_at_origin(a1, b1, x1, y1),
        a2,
        b2,
        edge_at_origin(a2, b2, x2, y2),
    )


@kernel
def covers(edges: Edges, x: int, y: int) -> bool:
    """Whether the centre of pixel (x, y) is covered: no edge function is negative."""
    e0 = edges.e0 + edges.a0 * x + edges.b0 * y
    e1 = edges.e1 + edges.a1 * x + edges.b1 * y
    e2 = edges.e2 + edges.a2 * x + edges.b2 * y
    return (e0 | e1 | e2) >= 0


@kernel
def narrow(a: int, e: int, low: int, high: int) -> tuple[int, int]:
    """The part of the columns [low, high] where e + a·x ≥ 0; empty as low > high."""
    if a == 0:
        if e < 0:
            return 1, 0
        return low, high
    # |e| < 2⁵³, so the float64 quotient's floor is within one of the true one; then exactly.
    g = np.int64(np.floor(-np.float64(e) / np.float64(a)))
    if a > 0:
        # Smallest x with e + a·x ≥ 0.
        if e + a * g < 0:
            g += 1
        elif e + a * (g - 1) >= 0:
            g -= 1
        return max(low, g), high
    # Largest x with e + a·x ≥ 0.
    if e + a * g < 0:
        g -= 1
    elif e + a * (g + 1) >= 0:
        g += 1
    return low, min(high, g)


@kernel
def row_span(edges: Edges, y: int, low: int, high: int) -> tuple[int, int]:
    """Covered columns of row y within [low, high]; a convex shape covers one run."""
    low, high = narrow(edges.a0, edges.e0 + edges.b0 * y, low, high)
    low, high = narrow(edges.a1, edges.e1 + edges.b1 * y, low, high)
    low, high = narrow(edges.a2, edges.e2 + edges.b2 * y, low, high)
    return low, high

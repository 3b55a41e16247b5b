"""Martin Newell's teapot (1975): 32 bicubic Bézier patches, z up, base at z = 0, height 3.15.

Source: the public table that F. Crow printed in "The Origins of the Teapot" (IEEE Computer Graphics
and Applications 7(1), 1987), plus the customary bottom. The table lists each control point several
times over; here each symmetric ring of control points is one row of numbers: a near-circle in
`RINGS_*`, an oval that is symmetric about y = 0 in `OVALS_*`. Rows 0-3, 3-6, ... are patches one
after the other; around, a circle is four patches and an oval two.
"""

from __future__ import annotations

import numpy as np

from ..typed import F64Array

RINGS_BODY = (  # radius, its tangent handle, z
    (1.4, 0.784, 2.4),  # rim, from its inner edge
    (1.3375, 0.749, 2.53125),
    (1.4375, 0.805, 2.53125),
    (1.5, 0.84, 2.4),  # body
    (1.75, 0.98, 1.875),
    (2.0, 1.12, 1.35),
    (2.0, 1.12, 0.9),
    (2.0, 1.12, 0.45),
    (1.5, 0.84, 0.225),
    (1.5, 0.84, 0.15),  # bottom, to its centre
    (1.5, 0.84, 0.075),
    (1.425, 0.798, 0.0),
    (0.0, 0.0, 0.0),
)
RINGS_LID = (  # from the tip of the knob to the edge
    (0.0, 0.0, 3.15),
    (0.8, 0.45, 3.15),
    (0.0, 0.0, 2.85),
    (0.2, 0.112, 2.7),
    (0.4, 0.224, 2.55),
    (1.3, 0.728, 2.55),
    (1.3, 0.728, 2.4),
)
OVALS_HANDLE = (  # x and z of the one end, x and z of the other, half width; from the upper root
    (-1.6, 2.025, -1.5, 2.25, 0.3),
    (-2.3, 2.025, -2.5, 2.25, 0.3),
    (-2.7, 2.025, -3.0, 2.25, 0.3),
    (-2.7, 1.8, -3.0, 1.8, 0.3),
    (-2.7, 1.575, -3.0, 1.35, 0.3),
    (-2.5, 1.125, -2.65, 0.9375, 0.3),
    (-2.0, 0.9, -1.9, 0.6, 0.3),
)
OVALS_SPOUT = (  # from the root to inside the lip
    (1.7, 1.425, 1.7, 0.6, 0.66),
    (2.6, 1.425, 3.1, 0.825, 0.66),
    (2.3, 2.1, 2.4, 2.025, 0.25),
    (2.7, 2.4, 3.3, 2.4, 0.25),
    (2.8, 2.475, 3.525, 2.49375, 0.25),
    (2.9, 2.475, 3.45, 2.5125, 0.15),
    (2.8, 2.4, 3.2, 2.4, 0.15),
)


def _circle(radius: float, tangent: float, z: float) -> list[tuple[float, float, float]]:
    """12 control points of four quarter arcs, from +x over +y."""
    r, t = radius, tangent
    quarter = ((r, 0.0), (r, t), (t, r))
    turned = [[(-y, x) for x, y in quarter], [(-x, -y) for x, y in quarter]]
    turned += [[(y, -x) for x, y in quarter]]
    return [(x, y, z) for part in (list(quarter), *turned) for x, y in part]


def _oval(
    x0: float, z0: float, x1: float, z1: float, half_width: float
) -> list[tuple[float, float, float]]:
    """6 control points of two half arcs, from (x0, z0) over +y to (x1, z1) and back over −y."""
    w = half_width
    return [(x0, 0.0, z0), (x0, w, z0), (x1, w, z1), (x1, 0.0, z1), (x1, -w, z1), (x0, -w, z0)]


PARTS: dict[str, F64Array] = {
    "body": np.array([_circle(*ring) for ring in RINGS_BODY]),
    "lid": np.array([_circle(*ring) for ring in RINGS_LID]),
    "handle": np.array([_oval(*oval) for oval in OVALS_HANDLE]),
    "spout": np.array([_oval(*oval) for oval in OVALS_SPOUT]),
}
"""Control points of each part, (3p + 1, 3q, 3) float64: p patches along, q around (closed).

∂P/∂row × ∂P/∂column points outwards everywhere."""


def patches(part: str) -> list[list[F64Array]]:
    """The part's patches as (4, 4, 3) control points, [along][around]."""
    points = PARTS[part]
    closed = np.concatenate([points, points[:, :1]], axis=1)
    return [
        [closed[i : i + 4, j : j + 4] for j in range(0, points.shape[1], 3)]
        for i in range(0, points.shape[0] - 1, 3)
    ]

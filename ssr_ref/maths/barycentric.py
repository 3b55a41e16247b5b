"""Perspective-correct barycentrics over arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .._jit import driver
from ..typed import F64Array
from ..vecmath import barycentric
from ..vecmath.vec import Vec3
from .arrays import common_shape, rows, vectors
from .registry import KernelInfo


def barycentrics(
    point_px: npt.ArrayLike,
    a_px: npt.ArrayLike,
    b_px: npt.ArrayLike,
    c_px: npt.ArrayLike,
    w: npt.ArrayLike,
) -> F64Array:
    """Perspective-correct weights of a triangle's vertices at a point on screen.

    point_px, a_px, b_px, c_px : (..., 2), pixels or any other affine screen coordinates.
    w : (..., 3), clip w of a, b, c (the view depth), > 0; (1, 1, 1) gives the weights on screen.
    Returns (..., 3), each in [0, 1], sum 1 to 4 · 2⁻⁵³; either winding. A point outside gets its
    negative weights as 0 and the others rescaled; a triangle without area gets (1, 0, 0), whatever
    the point. NaN where a w is not > 0 or a number is not finite.
    Raises MathsError for wrong last axes or shapes that do not broadcast.
    Error: 7 · 2⁻⁵³ of each weight. The rasterizer's own weights (`raster/surface.py`) come from the
    point on the plane in space: 8 · 2⁻⁵³ · κ, κ = |v|·longest side/(2·area·cos), large on slivers.
    Source: Heckbert and Moreton 1991; see `vecmath/barycentric.py`.
    """
    points = {
        "point_px": vectors(point_px, "point_px", 2),
        "a_px": vectors(a_px, "a_px", 2),
        "b_px": vectors(b_px, "b_px", 2),
        "c_px": vectors(c_px, "c_px", 2),
    }
    ws = vectors(w, "w", 3)
    shape = common_shape(**{k: v.shape[:-1] for k, v in points.items()}, w=ws.shape[:-1])
    out = np.empty((*shape, 3))
    p, a, b, c = (rows(v, shape) for v in points.values())
    _barycentrics_all(p, a, b, c, rows(ws, shape), out.reshape(-1, 3))
    return out


@driver(parallel=False)
def _barycentrics_all(p: Any, a: Any, b: Any, c: Any, w: Any, out: Any) -> None:
    for i in range(p.shape[0]):
        weights = barycentric.barycentrics(
            p[i, 0], p[i, 1], a[i, 0], a[i, 1], b[i, 0], b[i, 1], c[i, 0], c[i, 1],
            Vec3(w[i, 0], w[i, 1], w[i, 2]),
        )  # fmt: skip
        out[i, 0], out[i, 1], out[i, 2] = weights.x, weights.y, weights.z


KERNELS: tuple[KernelInfo, ...] = (
    KernelInfo(
        name="barycentrics",
        function=barycentrics,
        measure="component",
        bound=7.0,
        why="gamma_7: each area rounds once from a pair, its quotient by w once, the sum of "
        "non-negative terms twice on top, the last quotient once: 2 + 4 + 1",
        source="Heckbert and Moreton 1991; Dekker 1971 for the areas",
    ),
)

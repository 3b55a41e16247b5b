"""`reflect` and `mirror_matrix` over arrays."""

from __future__ import annotations

from functools import partial
from typing import Any, Literal

import numpy as np

from .._jit import driver
from ..errors import MathsError
from ..typed import F64Array
from ..vecmath.mirror import mirror, reflect_any
from ..vecmath.vec import Vec3
from ..vecmath.vec import reflect as reflect_unit
from .arrays import common_shape, flat, numbers, rows, vectors
from .registry import KernelInfo

ReflectForm = Literal["normalizing", "published"]


@driver(parallel=False)
def reflections(published: bool, incident: F64Array, normal: F64Array, out: F64Array) -> None:
    """One reflected vector a row."""
    for i in range(incident.shape[0]):
        d = Vec3(incident[i, 0], incident[i, 1], incident[i, 2])
        n = Vec3(normal[i, 0], normal[i, 1], normal[i, 2])
        r = reflect_unit(d, n) if published else reflect_any(d, n)
        out[i, 0], out[i, 1], out[i, 2] = r.x, r.y, r.z


@driver(parallel=False)
def mirrors(normal: F64Array, offset: F64Array, out: F64Array) -> None:
    """One matrix a row, for column vectors."""
    for i in range(offset.shape[0]):
        m = mirror(Vec3(normal[i, 0], normal[i, 1], normal[i, 2]), offset[i])
        out[i, 0, 0], out[i, 0, 1], out[i, 0, 2], out[i, 0, 3] = m.xx, m.xy, m.xz, m.x
        out[i, 1, 0], out[i, 1, 1], out[i, 1, 2], out[i, 1, 3] = m.xy, m.yy, m.yz, m.y
        out[i, 2, 0], out[i, 2, 1], out[i, 2, 2], out[i, 2, 3] = m.xz, m.yz, m.zz, m.z
        out[i, 3, 0], out[i, 3, 1], out[i, 3, 2], out[i, 3, 3] = 0.0, 0.0, 0.0, 1.0


def reflect(incident: Any, normal: Any, *, form: ReflectForm = "normalizing") -> F64Array:
    """The mirrored direction r of `incident` at a surface; |r| = |incident|, r·n = −incident·n.

    incident : (..., 3), towards the surface (from the eye), any length, any space.
    normal : (..., 3) in the same space, either side. They broadcast.
    form : "normalizing" d − 2 (d·n)/(n·n)·n, for a normal of any length. "published"
        d − 2 (d·n)·n, as in shading languages: for |n| = s the component along n comes out as
        1 − 2s² times itself instead of −1, so an interpolated normal must be renormalised first.

    A zero or non-finite normal gives NaN ("published": a zero normal gives `incident` back).
    Raises MathsError for a bad shape, type or form.
    Source: OpenGL Shading Language 4.60, section 8.5, reflect.
    """
    if form not in ("normalizing", "published"):
        raise MathsError(f"form is {form!r}; expected normalizing or published")
    d, n = vectors(incident, "incident", 3), vectors(normal, "normal", 3)
    shape = common_shape(incident=d.shape[:-1], normal=n.shape[:-1])
    d, n = rows(d, shape), rows(n, shape)
    out = np.empty_like(d)
    reflections(form == "published", d, n, out)
    return out.reshape(*shape, 3)


def mirror_matrix(normal: Any, offset: Any, *, row_vectors: bool = False) -> F64Array:
    """(..., 4, 4) matrix that mirrors points at the plane normal·x + offset = 0.

    normal : (..., 3), any length but 0; offset : (...), in the same units: a plane through the
        point p has offset −normal·p. They broadcast.
    row_vectors : False for column vectors, x' = M·x. True gives the transpose, for x' = x·M, which
        is what textbooks of the row-vector school print.

    The matrix reverses orientation: swap front and back faces when drawing with it. A zero or
    non-finite normal gives NaN. Raises MathsError for a bad shape or type.
    Source: Goldman, Matrices and Transformations, Graphics Gems, 1990.
    """
    n, d = vectors(normal, "normal", 3), numbers(offset, "offset")
    shape = common_shape(normal=n.shape[:-1], offset=d.shape)
    n, d = rows(n, shape), flat(d, shape)
    out = np.empty((d.shape[0], 4, 4))
    mirrors(n, d, out)
    matrices = out.reshape(*shape, 4, 4)
    return np.ascontiguousarray(matrices.swapaxes(-1, -2)) if row_vectors else matrices


KERNELS = (
    KernelInfo(
        name="reflect",
        form="normalizing",
        function=reflect,
        measure="norm",
        bound=17.0,
        why="2|d|(γ₃ for d·n + γ₃ for n·n + 1u for the quotient), 2u|d| for k·n, 1u for d − k·n",
        source="OpenGL Shading Language 4.60, 8.5, divided by n·n",
    ),
    KernelInfo(
        name="reflect",
        form="published",
        function=partial(reflect, form="published"),
        measure="norm",
        bound=9.0,
        why="unit n: 2|d| γ₃ for d·n, 2u|d| for k·n, 1u for d − k·n",
        source="OpenGL Shading Language 4.60, 8.5",
    ),
    KernelInfo(
        name="mirror_matrix",
        function=mirror_matrix,
        measure="component",
        bound=1.01,
        why="each element is a pair of twice the precision, rounded once",
        source="Goldman, Graphics Gems, 1990",
    ),
)

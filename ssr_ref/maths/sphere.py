"""`intersect_sphere` over arrays."""

from __future__ import annotations

from functools import partial
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
import numpy.typing as npt

from .._jit import driver
from ..errors import MathsError
from ..typed import AnyArray, FloatArray, U8Array
from ..vecmath.sphere import SphereForm, intersect
from ..vecmath.sphere_distance import SphereOutcome as SphereOutcome  # noqa: PLC0414
from ..vecmath.vec import Vec3
from .arrays import common_shape, flat, numbers, rows, vectors
from .registry import KernelInfo

SphereFormName = Literal["textbook", "textbook_unit", "stable", "kahan", "hearn_baker", "distance"]


class SphereIntersection(NamedTuple):
    """Where lines meet spheres; shapes are the broadcast leading shape and what is named.

    outcome : (...) uint8, `SphereOutcome`: MISS 0, TANGENT 1, TWO 2, INVALID 3.
    t : (..., 2), t[..., 0] ≤ t[..., 1], in units of the direction's length; negative behind the
        origin; NaN for MISS and INVALID.
    point : (..., 2, 3), the two meetings, lengths in scene units.
    t_error : (..., 2) ≥ |t − true t|; +inf where the form promises nothing.
    point_error : (..., 2) ≥ distance between given and true point.
    """

    outcome: U8Array
    t: FloatArray
    point: FloatArray
    t_error: FloatArray
    point_error: FloatArray


@driver(parallel=False)
def intersect_spheres(
    form: int,
    origin: FloatArray,
    direction: FloatArray,
    center: FloatArray,
    radius: FloatArray,
    outcome: U8Array,
    t: FloatArray,
    point: FloatArray,
    t_error: FloatArray,
    point_error: FloatArray,
) -> None:
    """One row each: `sphere.intersect` in the type of the arrays."""
    for i in range(radius.shape[0]):
        hit = intersect(
            form,
            Vec3(origin[i, 0], origin[i, 1], origin[i, 2]),
            Vec3(direction[i, 0], direction[i, 1], direction[i, 2]),
            Vec3(center[i, 0], center[i, 1], center[i, 2]),
            radius[i],
        )
        outcome[i] = hit.outcome
        t[i, 0], t[i, 1] = hit.t0, hit.t1
        point[i, 0, 0], point[i, 0, 1], point[i, 0, 2] = hit.point0.x, hit.point0.y, hit.point0.z
        point[i, 1, 0], point[i, 1, 1], point[i, 1, 2] = hit.point1.x, hit.point1.y, hit.point1.z
        t_error[i, 0], t_error[i, 1] = hit.t0_error, hit.t1_error
        point_error[i, 0], point_error[i, 1] = hit.point0_error, hit.point1_error


def intersect_sphere(
    origin: Any,
    direction: Any,
    center: Any,
    radius: Any,
    *,
    form: SphereFormName = "distance",
    dtype: npt.DTypeLike = np.float64,
) -> SphereIntersection:
    """Both meetings of the line origin + t·direction with a sphere.

    origin, direction, center : (..., 3) array-like; radius : (...), ≥ 0. All broadcast. The
        direction may have any length but 0.
    form : how the same quadratic is evaluated; the default needs no other. The rest are there to be
        compared: `vecmath.sphere` has their formulas and the contract of every special case.
    dtype : float64, or float32 to see what a shader gets: inputs are rounded to it, all arithmetic
        is done in it.

    An input that makes no sense (NaN, inf, zero direction, negative radius) gives INVALID and NaN.
    Raises MathsError for a bad shape, type, form or dtype.
    Source: Haines, Günther and Akenine-Möller, Ray Tracing Gems, chapter 7, 2019.
    """
    if form not in get_args(SphereFormName):
        raise MathsError(f"form is {form!r}; expected one of {', '.join(get_args(SphereFormName))}")
    kind = _float_type(dtype)
    o = vectors(origin, "origin", 3)
    d = vectors(direction, "direction", 3)
    c = vectors(center, "center", 3)
    r = numbers(radius, "radius")
    shape = common_shape(
        origin=o.shape[:-1], direction=d.shape[:-1], center=c.shape[:-1], radius=r.shape
    )
    with np.errstate(over="ignore"):
        lines: list[AnyArray] = [rows(a, shape).astype(kind, copy=False) for a in (o, d, c)]
        radii: AnyArray = flat(r, shape).astype(kind, copy=False)
    count = radii.shape[0]
    outcome = np.empty(count, np.uint8)
    t, point = np.empty((count, 2), kind), np.empty((count, 2, 3), kind)
    t_error, point_error = np.empty((count, 2), kind), np.empty((count, 2), kind)
    intersect_spheres(
        int(SphereForm[form.upper()]),
        lines[0],
        lines[1],
        lines[2],
        radii,
        outcome,
        t,
        point,
        t_error,
        point_error,
    )
    return SphereIntersection(
        outcome.reshape(shape),
        t.reshape(*shape, 2),
        point.reshape(*shape, 2, 3),
        t_error.reshape(*shape, 2),
        point_error.reshape(*shape, 2),
    )


def _float_type(dtype: npt.DTypeLike) -> type[np.float32] | type[np.float64]:
    try:
        kind = np.dtype(dtype)
    except TypeError:
        kind = np.dtype(object)
    if kind == np.float32:
        return np.float32
    if kind == np.float64:
        return np.float64
    raise MathsError(f"dtype is {dtype!r}; expected float64 or float32")


_GIVES_WAY = "none over the condition number: "
_BOUNDS: dict[SphereFormName, tuple[float, str, str]] = {
    "textbook": (
        np.inf,
        _GIVES_WAY + "b² − 4ac loses (|f|/r)² u, −b ± √D cancels",
        "any textbook; Haines et al. 2019, equation 2",
    ),
    "textbook_unit": (
        np.inf,
        _GIVES_WAY + "as textbook, and off by |d·d − 1| for a direction that is not unit",
        "any textbook, d·d = 1",
    ),
    "stable": (
        np.inf,
        _GIVES_WAY + "b² − ac loses (|f|/r)² u",
        "Press et al., Numerical Recipes, 5.6",
    ),
    "kahan": (
        np.inf,
        _GIVES_WAY + "b and c are rounded before their difference is taken",
        "Kahan 2004",
    ),
    "hearn_baker": (
        16.0,
        "b, r² − l·l, C and the quotient of q 4u each, l 3u, each over what κ "
        "holds already; for |f|/r up to 1e14",
        "Haines et al. 2019, equations 5 and 8",
    ),
    "distance": (
        6.0,
        "with X = r²/(|d| √Δ |t|): at most (7.3 X + 8.5) u (l 3u‖l‖, Δ 4u r², s 1u + 7u‖l‖/|d|, "
        "near root 5u), while 1 + κ ≥ max(1 + 2X, 2 + X)",
        "Haines et al. 2019, each difference as if in twice the precision",
    ),
}


def _roots(form: SphereFormName, *args: Any, dtype: npt.DTypeLike = np.float64) -> FloatArray:
    return intersect_sphere(*args, form=form, dtype=dtype).t


KERNELS = tuple(
    KernelInfo(
        name="intersect_sphere",
        form=name,
        function=partial(_roots, name),
        measure="component",
        bound=bound,
        why=why,
        source=source,
    )
    for name, (bound, why, source) in _BOUNDS.items()
)

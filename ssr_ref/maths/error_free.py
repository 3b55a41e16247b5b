"""Sums and products whose rounding errors are known exactly, over arrays."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .._jit import driver
from ..typed import F64Array
from ..vecmath import exact, vec
from .arrays import common_shape, flat, numbers
from .registry import KernelInfo


class ErrorFree(NamedTuple):
    """A result rounded to nearest and what the rounding lost: value + error is exact."""

    value: F64Array
    error: F64Array


@driver(parallel=False)
def sums(a: F64Array, b: F64Array, value: F64Array, error: F64Array) -> None:
    """One `exact.two_sum` each."""
    for i in range(a.shape[0]):
        pair = exact.two_sum(a[i], b[i])
        value[i], error[i] = pair.hi, pair.lo


@driver(parallel=False)
def products(a: F64Array, b: F64Array, value: F64Array, error: F64Array) -> None:
    """One `exact.two_prod` each."""
    for i in range(a.shape[0]):
        pair = exact.two_prod(a[i], b[i])
        value[i], error[i] = pair.hi, pair.lo


@driver(parallel=False)
def differences(a: F64Array, b: F64Array, c: F64Array, d: F64Array, out: F64Array) -> None:
    """One `vec.difference_of_products` each."""
    for i in range(a.shape[0]):
        out[i] = vec.difference_of_products(a[i], b[i], c[i], d[i])


def two_sum(a: Any, b: Any) -> ErrorFree:
    """a + b and its rounding error, exactly, for array-likes that broadcast.

    Exact unless the sum overflows (then the error is NaN). Raises MathsError for a bad type or
    shapes that do not broadcast. Source: Knuth, The Art of Computer Programming 2, section 4.2.2.
    """
    return _pairs(sums, a, b)


def two_prod(a: Any, b: Any) -> ErrorFree:
    """a·b and its rounding error, exactly, by a fused multiply-add.

    Exact unless the product overflows or |a·b| < 2⁻⁹⁶⁹, where the error is no float64. Raises
    MathsError for a bad type or shapes that do not broadcast.
    Source: Ogita, Rump and Oishi, Accurate Sum and Dot Product, 2005, algorithm 3.5.
    """
    return _pairs(products, a, b)


def difference_of_products(a: Any, b: Any, c: Any, d: Any) -> F64Array:
    """a·b − c·d to 2u of the result (1.5 ulp), however much cancels; array-likes that broadcast.

    Holds where no product over- or underflows. Raises MathsError for a bad type or shapes that do
    not broadcast. Source: Jeannerod, Louvet and Muller, Further Analysis of Kahan's Algorithm for
    the Accurate Computation of 2×2 Determinants, 2013, theorem 1.2.
    """
    arrays = [numbers(v, n) for v, n in zip((a, b, c, d), "abcd")]
    shape = common_shape(**{n: v.shape for v, n in zip(arrays, "abcd")})
    x, y, z, w = (flat(v, shape) for v in arrays)
    out = np.empty_like(x)
    differences(x, y, z, w, out)
    return out.reshape(shape)


def _pairs(fill: Any, a: Any, b: Any) -> ErrorFree:
    first, second = numbers(a, "a"), numbers(b, "b")
    shape = common_shape(a=first.shape, b=second.shape)
    x, y = flat(first, shape), flat(second, shape)
    value, error = np.empty_like(x), np.empty_like(x)
    fill(x, y, value, error)
    return ErrorFree(value.reshape(shape), error.reshape(shape))


KERNELS = (
    KernelInfo(
        name="two_sum",
        function=lambda a, b: np.stack(two_sum(a, b), axis=-1),
        measure="exact",
        bound=0.0,
        why="six operations recover what the first one rounds away",
        source="Knuth, TAOCP 2, 4.2.2, theorem B",
    ),
    KernelInfo(
        name="two_prod",
        function=lambda a, b: np.stack(two_prod(a, b), axis=-1),
        measure="exact",
        bound=0.0,
        why="a·b − fl(a·b) is a float64, so one fused multiply-add gives it",
        source="Ogita, Rump and Oishi 2005, algorithm 3.5",
    ),
    KernelInfo(
        name="difference_of_products",
        function=difference_of_products,
        measure="component",
        bound=2.0,
        why="2u of the result whatever cancels: the rounding of c·d is added back",
        source="Jeannerod, Louvet and Muller 2013, theorem 1.2",
    ),
)

"""Error-free transforms, and that the compiler leaves them alone."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from maths_checks import check_difference_of_products, check_two_prod, check_two_sum

from ssr_ref import MathsError, difference_of_products, two_prod, two_sum
from ssr_ref._jit import JIT_ENABLED, _fma_exact, driver, fma
from ssr_ref.vecmath import exact

SMALL = 2.0**-60


def test_two_sum() -> None:
    check_two_sum(two_sum, 600)


def test_two_prod() -> None:
    check_two_prod(two_prod, 600)


def test_difference_of_products() -> None:
    check_difference_of_products(difference_of_products, 600)


def square_and_subtract(a, b):  # type: ignore[no-untyped-def]
    """a·a − b: 0 for b = fl(a·a), unless the product is contracted into the difference."""
    return a * a - b


strict_square_and_subtract = driver(parallel=False)(square_and_subtract)


def test_compiled_code_is_neither_reassociated_nor_contracted() -> None:
    """The residual of 1 + 2⁻⁶⁰ is 2⁻⁶⁰. An optimiser that takes floats for reals makes it 0."""
    assert two_sum(1.0, SMALL).error == SMALL
    a = 1.0 + 2.0**-30
    assert two_prod(a, a).error == 2.0**-60
    assert strict_square_and_subtract(a, a * a) == 0.0


@pytest.mark.skipif(not JIT_ENABLED, reason="asks the compiler")
def test_fastmath_would_be_noticed() -> None:
    """The same source with fastmath loses the residual, and with contraction alone a·a − b is the
    rounding error of a·a: so the test above can fail.
    """
    source = exact.two_sum.py_func  # type: ignore[attr-defined]
    loose = numba.njit(fastmath=True)(source)
    assert loose(1.0, SMALL).lo != SMALL
    a = 1.0 + 2.0**-30
    contracted = numba.njit(fastmath={"contract"})(square_and_subtract)
    assert contracted(a, a * a) == 2.0**-60


@driver(parallel=False)
def fma_of(a, b, c):  # type: ignore[no-untyped-def]
    return fma(a, b, c)


def test_fma_of_float32_rounds_once_to_float32() -> None:
    """Also beside a tie, where rounding to float64 first goes the wrong way: 1 + 2⁻²⁴ + 2⁻⁷⁰."""
    rng = np.random.default_rng(8)
    one = np.float32(1.0)
    cases = [(np.float32(2.0**-24), one, one), (np.float32(2.0**-35), np.float32(2.0**-35), one)]
    tie = np.float32(1.0 + 2.0**-12)  # its square is 1 + 2⁻¹¹ + 2⁻²⁴, a tie
    cases += [(tie, tie, np.float32(sign * 2.0**-70)) for sign in (1.0, -1.0, 0.0)]
    for _ in range(300):
        a, b = rng.normal(size=2).astype(np.float32)
        cases.append((a, b, np.float32(-a * b * np.float32(1.0 + rng.normal() * 2.0**-20))))
    for a, b, c in cases:
        found, exact = fma_of(a, b, c), _fma_exact(a, b, c)
        assert np.float32(found) == found and exact.dtype == np.float32
        assert found == exact, (a, b, c)
    assert fma_of(tie, tie, np.float32(2.0**-70)) == np.float32(1.0 + 2.0**-11 + 2.0**-23)
    assert fma_of(tie, tie, np.float32(0.0)) == np.float32(1.0 + 2.0**-11)


def test_limits_are_as_stated() -> None:
    assert np.isnan(two_sum(1.7e308, 1.7e308).error)
    value, error = two_prod(2.0**-600 * (1 + 2.0**-52), 2.0**-500)
    assert value == 0.0 and error == 0.0
    # Kahan: 1.5 ulp where the plain difference has no digit left.
    a = 134217729.0  # 2^27 + 1: its square needs 55 bits
    assert difference_of_products(a, a, a - 1.0, a + 1.0) == 1.0
    assert a * a - (a - 1.0) * (a + 1.0) != 1.0


def test_shapes_and_errors() -> None:
    found = two_sum(np.ones((3, 1)), [1, 2])
    assert found.value.shape == found.error.shape == (3, 2)
    assert two_prod(2, 3).value == 6.0
    assert difference_of_products(np.ones((2, 1)), 2.0, np.ones(3), 1.0).shape == (2, 3)
    with pytest.raises(MathsError, match=r"do not broadcast: a .* b"):
        two_sum(np.ones(2), np.ones(3))
    with pytest.raises(MathsError, match="d is of type bool"):
        difference_of_products(1.0, 1.0, 1.0, True)

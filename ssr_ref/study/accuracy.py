"""Measured errors of the formulas of the registry against their oracles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mpmath
import numpy as np

from ..maths.registry import KernelInfo
from ..typed import AnyArray, F64Array
from .sampling import condition_number, oracle

UNIT = 2.0**-53
"""u of float64."""

mp = mpmath.mp.clone()
mp.dps = 60


def case(arguments: Sequence[AnyArray], i: int) -> tuple[Any, ...]:
    """Case i as an oracle takes it: Python numbers and lists of them."""
    return tuple(a[i].tolist() for a in arguments)


def errors(
    info: KernelInfo, arguments: Sequence[AnyArray], *, unit: float = UNIT, **options: Any
) -> F64Array:
    """(n,) worst error of each case in `unit` · (1 + condition number); the stated bound is of it.

    "exact": 0, or +inf for any difference. "component": each number over its own size. "norm": the
    vector over the length of the true one. "absolute": each number over 1. A number that should be
    NaN and is not, or the other way round, has the error +inf. options go to the function.
    """
    found = np.asarray(info.function(*arguments, **options), np.float64)
    found = found.reshape(found.shape[0], -1)
    exact_of, condition_of = oracle(info.key), condition_number(info.key)
    out = np.empty(found.shape[0])
    for i, row in enumerate(found):
        args = case(arguments, i)
        exact = exact_of(*args)
        allowed: Any = mp.mpf(0) if condition_of is None else condition_of(*args)
        out[i] = _worst(info.measure, row, exact, allowed, unit)
    return out


def _worst(measure: str, row: F64Array, exact: Sequence[Any], condition: Any, unit: float) -> float:
    if measure == "exact":
        return 0.0 if all(_same(x, y) for x, y in zip(row, exact)) else np.inf
    if any(np.isnan(x) != mp.isnan(y) for x, y in zip(row, exact)):
        return np.inf
    allowed = list(condition) if isinstance(condition, tuple) else [condition] * len(exact)
    if measure == "norm":
        difference = mp.sqrt(mp.fsum((mp.mpf(x) - y) ** 2 for x, y in zip(row, exact)))
        size = mp.sqrt(mp.fsum(y**2 for y in exact))
        return _units(difference, size, max(allowed), unit)
    sizes = [mp.mpf(1) if measure == "absolute" else abs(y) for y in exact]
    return max(
        0.0 if mp.isnan(y) or _same(x, y) else _units(abs(mp.mpf(x) - y), size, k, unit)
        for x, y, size, k in zip(row, exact, sizes, allowed)
    )


def _same(x: float, y: Any) -> bool:
    return bool(mp.mpf(x) == y or (np.isnan(x) and mp.isnan(y)))


def _units(difference: Any, size: Any, condition: Any, unit: float) -> float:
    if not mp.isfinite(difference):
        return np.inf
    if difference == 0 or mp.isinf(condition):
        return 0.0
    return float(difference / (size * unit * (1 + condition))) if size else np.inf

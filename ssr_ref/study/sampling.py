"""Sample inputs for every formula of the registry, beside oracle and condition number.

A module of this package may hold `SAMPLES`, `ORACLES` and `CONDITIONS`, dictionaries by
`KernelInfo.key`; add its name to `SAMPLE_MODULES` or `ORACLE_MODULES` and its formulas are measured
and benchmarked like the others.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

from ..errors import MathsError
from ..typed import AnyArray

SAMPLE_MODULES = ("sampling_ray", "sampling_maps", "sampling_codes")
ORACLE_MODULES = ("oracle_ray", "oracle_maps", "oracle_codes")


def _find(modules: tuple[str, ...], table: str, key: str) -> Any:
    for name in modules:
        found = getattr(importlib.import_module(f"{__package__}.{name}"), table, {})
        if key in found:
            return found[key]
    return None


def examples(key: str, n: int, seed: int = 0) -> tuple[AnyArray, ...]:
    """n cases for the formula `key`: arrays in the order of its arguments, cases on the first axis.

    Plain cases and, on purpose, those where it is hard (Herbie's average over random doubles hardly
    meets a cancellation). The same for the same n and seed. Raises MathsError for an unknown key.
    """
    sampler = _find(SAMPLE_MODULES, "SAMPLES", key)
    if sampler is None:
        raise MathsError(f"no samples for {key!r}; expected a KernelInfo.key of the registry")
    found: tuple[AnyArray, ...] = sampler(n, seed)
    return found


def oracle(key: str) -> Callable[..., tuple[Any, ...]]:
    """The exact answer of one case, a flat tuple of mpf. Raises MathsError for an unknown key."""
    found = _find(ORACLE_MODULES, "ORACLES", key)
    if found is None:
        raise MathsError(f"no oracle for {key!r}; expected a KernelInfo.key of the registry")
    return found  # type: ignore[no-any-return]


def condition_number(key: str) -> Callable[..., Any] | None:
    """Condition number of one case (one for all numbers of the answer or one each), None for 0."""
    return _find(ORACLE_MODULES, "CONDITIONS", key)  # type: ignore[no-any-return]

"""How much an exact answer moves when its arguments do: condition numbers, and nearby choices.

The relative condition number of f at x is Σᵢ |xᵢ|·|∂f/∂xᵢ| / |f|: an error of u in every argument
moves the answer by so many u. Taken by differences at the oracle's own precision, one argument at
a time and to both sides, the larger side counting, so that kinks are not averaged away.
Source: Higham, Accuracy and Stability of Numerical Algorithms, 2002, section 1.6.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import mpmath
from mpmath import mpf

STEP_BITS = 49
"""Relative step 2⁻⁴⁹: the differences are exact to 15 digits with an oracle of 60."""

Groups = Sequence[tuple[slice, str]]
"""The components of each output, and how its error is measured: a `registry.Measure`."""
Oracle = Callable[[list[Any]], list[Any]]
"""Flat arguments to flat results; integers are choices, everything else numbers."""


def condition_number(oracle: Oracle, arguments: list[Any], groups: Groups) -> float:
    """The largest condition number of an output, rounded to 3 digits; inf if there is none.

    "component": of each component, relative to it; "norm": of the vector, relative to its length;
    "absolute": of each component, relative to 1; "exact" counts as 0. A side on which a choice or
    a class of the result changes is left out: across it the answer has no derivative.
    """
    with mpmath.workdps(60):
        centre = oracle(arguments)
        totals = [[mpf(0)] * (g.stop - g.start) for g, _ in groups]
        for moved in _moves(arguments, STEP_BITS):
            sides = [oracle(side) for side in moved]
            sides = [side for side in sides if same_choice(side, centre)]
            if not sides:
                return float("inf")
            for total, (group, measure) in zip(totals, groups):
                _add(total, [side[group] for side in sides], centre[group], measure)
        worst = mpf(0)
        for total, (group, measure) in zip(totals, groups):
            worst = max([worst, *_relative(total, centre[group], measure)])
        return float(f"{float(worst * 2**STEP_BITS):.3g}")


def choice_is_near(oracle: Oracle, arguments: list[Any], bits: int) -> bool:
    """Whether a relative step of 2^−bits in one argument changes a choice or a result's class."""
    centre = oracle(arguments)
    return any(
        not same_choice(oracle(side), centre) for moved in _moves(arguments, bits) for side in moved
    )


def same_choice(a: Sequence[Any], b: Sequence[Any]) -> bool:
    """Whether integers are equal and numbers of one class: finite, NaN, or the same infinity."""
    return all(
        x == y if isinstance(x, int) else _kind(x) == _kind(y) for x, y in zip(a, b, strict=True)
    )


def _kind(x: Any) -> str:
    number = mpf(x)
    if mpmath.isnan(number):
        return "nan"
    return str(number) if mpmath.isinf(number) else "finite"


def _moves(arguments: list[Any], bits: int) -> list[list[list[Any]]]:
    """For each finite number but 0: the arguments with it made greater, and smaller."""
    found = []
    for i, x in enumerate(arguments):
        if isinstance(x, int) or not mpmath.isfinite(mpf(x)) or x == 0:
            continue
        with mpmath.workdps(60):
            step = mpf(2) ** -bits
            ends = [mpf(x) * (1 + step), mpf(x) * (1 - step)]
        found.append([[*arguments[:i], end, *arguments[i + 1 :]] for end in ends])
    return found


def _add(total: list[mpf], sides: list[Any], centre: Any, measure: str) -> None:
    if measure == "norm":
        moved = (_norm([a - b for a, b in _numbers(side, centre)]) for side in sides)
        total[0] += max(moved)
        return
    for i, middle in enumerate(centre):
        if not isinstance(middle, int) and mpmath.isfinite(middle):
            total[i] += max(abs(side[i] - middle) for side in sides)


def _relative(total: list[mpf], centre: Any, measure: str) -> list[mpf]:
    if measure == "exact":
        return [mpf(0)]
    if measure == "absolute":
        return total
    if measure == "norm":
        sizes = [_norm([b for _, b in _numbers(centre, centre)])] + [mpf(1)] * (len(total) - 1)
    else:
        sizes = [mpf(1) if isinstance(b, int) else abs(mpf(b)) for b in centre]
    moved = [(change, size) for change, size in zip(total, sizes) if change and size < mpmath.inf]
    return [change / size if size else mpmath.inf for change, size in moved]


def _numbers(a: Any, b: Any) -> list[tuple[Any, Any]]:
    """Pairs of those components that are finite numbers."""
    return [(x, y) for x, y in zip(a, b) if not isinstance(y, int) and mpmath.isfinite(mpf(y))]


def _norm(components: list[Any]) -> mpf:
    return mpmath.sqrt(sum((c * c for c in components), mpf(0)))

"""Which of several ways is worth its cost: the Pareto front, and the cheapest within a bound."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def pareto_front(cost: Sequence[float], error: Sequence[float]) -> list[int]:
    """Indices of the ways that no other way beats, by rising cost.

    A way is beaten by one that costs no more and errs no more, and is better in one of them; of
    equal ones the first stays. A cost or error that is not finite is never on the front.
    """
    c, e = np.asarray(cost, np.float64), np.asarray(error, np.float64)
    front: list[int] = []
    best = np.inf
    for i in np.lexsort((np.arange(len(c)), e, c)):
        if np.isfinite(c[i]) and np.isfinite(e[i]) and e[i] < best:
            front.append(int(i))
            best = e[i]
    return front


def cheapest_within(cost: Sequence[float], error: Sequence[float], bound: float) -> int | None:
    """The cheapest whose error is at most `bound`; None if there is none."""
    good = [i for i, e in enumerate(error) if e <= bound and np.isfinite(cost[i])]
    return min(good, key=lambda i: (cost[i], error[i], i), default=None)


def best_within(cost: Sequence[float], error: Sequence[float], budget: float) -> int | None:
    """The one of least error whose cost is at most `budget`; None if there is none."""
    good = [i for i, c in enumerate(cost) if c <= budget and np.isfinite(error[i])]
    return min(good, key=lambda i: (error[i], cost[i], i), default=None)

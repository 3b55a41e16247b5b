"""Which pixels a segment crosses, and where: exact rationals, from the sentence in spec 4.9.

Every grid line between the first and the last pixel index is crossed once, so the crossings are
listed and sorted; nothing is marched. `march_cells` walks from border to border instead.
"""

from __future__ import annotations

from fractions import Fraction
from math import floor
from typing import NamedTuple


class Cell(NamedTuple):
    """A pixel and the exact range of s in which the segment is inside it."""

    x: int
    y: int
    enter: Fraction
    leave: Fraction


def cells_crossed(
    p0: tuple[float, float], dp: tuple[float | Fraction, float | Fraction], end: float | Fraction
) -> list[Cell]:
    """Cells of P(s) = p0 + s·dp, 0 ≤ s ≤ end, in order: |Δix| + |Δiy| + 1 of them.

    Floats are taken as the rationals that they are. A position on a grid line lies in the higher
    pixel; where two lines are crossed at one s, x is stepped first.
    """
    end = Fraction(end)
    first: list[int] = []
    crossings: list[tuple[Fraction, int, int, int]] = []  # s, axis, number on the axis, step
    for axis in (0, 1):
        start, slope = Fraction(p0[axis]), Fraction(dp[axis])
        i0, i1 = floor(start), floor(start + end * slope)
        first.append(i0)
        # Moving up, pixel i is entered at line i; moving down, pixel i is left at line i.
        lines = range(i0 + 1, i1 + 1) if i1 >= i0 else range(i0, i1, -1)
        step = 1 if i1 >= i0 else -1
        crossings += [((line - start) / slope, axis, n, step) for n, line in enumerate(lines)]
    crossings.sort()

    cells = []
    index, entered = first, Fraction(0)
    for s, axis, _, step in crossings:
        cells.append(Cell(index[0], index[1], entered, s))
        index = [index[0] + step * (axis == 0), index[1] + step * (axis == 1)]
        entered = s
    cells.append(Cell(index[0], index[1], entered, end))
    return cells

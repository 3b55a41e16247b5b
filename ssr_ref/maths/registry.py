"""What each public formula states about itself: its error bound, how it is measured, its source."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

Measure = Literal["exact", "component", "norm", "absolute"]
"""How an error is taken: no difference at all; each component in units of its own last place; the
vector's error over the norm of the result; each component in units of 1, for factors in [0, 1]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KernelInfo:
    """One formulation of one formula.

    name : of the public function. form : of the formulation, "" where there is one only.
    function : vectorised, over arrays of any leading shape; returns one array of numbers.
    measure, bound : the error is at most bound · u · (1 + condition number of the case), in units
        of the measure; u = 2⁻⁵³ for float64. 0 for "exact".
    why : the derivation in a line, γ_n with what is counted. source : paper, section, equation.
    """

    name: str
    form: str = ""
    function: Callable[..., Any]
    measure: Measure
    bound: float
    why: str
    source: str

    @property
    def key(self) -> str:
        """`name`, or `name/form`: how oracles and samples are found."""
        return f"{self.name}/{self.form}" if self.form else self.name


MODULES: tuple[str, ...] = (
    "error_free",
    "sphere",
    "mirror",
    "lines",
    "rays",
    "depth",
    "barycentric",
    "directions",
    "codes",
)
"""Modules of this package with a tuple `KERNELS`; added to as they are written."""


def kernels() -> tuple[KernelInfo, ...]:
    """Every formula and formulation, in the order of the documentation."""
    found: list[KernelInfo] = []
    for name in MODULES:
        found.extend(importlib.import_module(f"{__package__}.{name}").KERNELS)
    return tuple(found)

"""An oracle's number correctly rounded to float32 or float64, and its last place.

To nearest, ties to even, subnormal results too; what rounds beyond the greatest float is infinite.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np

SURE_BITS = 180
"""Of an oracle's 60 digits (199 bits) so many are believed. A number closer to a tie than that is
taken for the tie: by chance this happens once in 2¹²⁰, exact ties happen all the time."""


@dataclass(frozen=True, slots=True)
class Format:
    """A binary float: significand bits, exponent of the smallest subnormal, of the first overflow.

    unit : u, half the spacing above 1.
    """

    name: str
    bits: int
    lowest: int
    overflow: int

    @property
    def unit(self) -> float:
        return 2.0**-self.bits

    def ulp(self, x: float) -> float:
        """The spacing of floats at |x|, x finite; at 0 and below the normal ones the smallest."""
        _, exponent = np.frexp(x)
        exponent = int(exponent) if x else self.lowest
        return 2.0 ** max(exponent - self.bits, self.lowest)


FLOAT32 = Format("float32", 24, -149, 128)
FLOAT64 = Format("float64", 53, -1074, 1024)
FORMATS = (FLOAT32, FLOAT64)


def correctly_rounded(value: Any, to: Format) -> float:
    """A mpf, float or int as the nearest float of the format, held in a Python float."""
    number = mpmath.mpf(value) if not isinstance(value, mpmath.mpf) else value
    if mpmath.isnan(number):
        return float("nan")
    negative, significand, exponent, _ = number._mpf_
    significand, exponent = int(significand), int(exponent)
    if significand == 0:
        infinite = mpmath.isinf(number)
        return float("-inf" if number < 0 else "inf") if infinite else 0.0
    significand, exponent = _shorten(significand, exponent, SURE_BITS, to.lowest - SURE_BITS)
    significand, exponent = _shorten(significand, exponent, to.bits, to.lowest)
    if significand.bit_length() + exponent > to.overflow:
        return float("-inf" if negative else "inf")
    return float.fromhex(f"{'-' if negative else ''}{significand:#x}p{exponent}")


def _shorten(significand: int, exponent: int, bits: int, lowest: int) -> tuple[int, int]:
    """significand · 2^exponent to nearest even with so many bits, none worth less than 2^lowest."""
    drop = max(significand.bit_length() - bits, lowest - exponent)
    if drop <= 0:
        return significand, exponent
    kept, rest, half = significand >> drop, significand & ((1 << drop) - 1), 1 << (drop - 1)
    if rest > half or (rest == half and kept & 1):
        kept += 1
    return kept, exponent + drop

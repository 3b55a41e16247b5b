"""Colour codes of mesh files to linear RGB.

Integer codes are sRGB, as every tool that writes bytes means them; floats are linear as they are.
"""

from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np

from ..typed import AnyArray, F32Array


def linear_from_codes(codes: AnyArray) -> F32Array:
    """Decoded sRGB of uint8 or uint16 codes, any shape; each value rounded once from 30 digits.

    Source: IEC 61966-2-1. Decimal arithmetic is the same on every machine.
    """
    used, number = np.unique(codes, return_inverse=True)
    greatest = np.iinfo(codes.dtype).max
    table = np.array([_decoded(int(code), int(greatest)) for code in used], np.float32)
    return table[number].reshape(codes.shape)


def _decoded(code: int, greatest: int) -> float:
    with localcontext() as context:
        context.prec = 30
        value = Decimal(code) / Decimal(greatest)
        if value <= Decimal("0.04045"):
            return float(value / Decimal("12.92"))
        return float(((value + Decimal("0.055")) / Decimal("1.055")) ** Decimal("2.4"))

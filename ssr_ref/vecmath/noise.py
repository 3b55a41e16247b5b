"""Per-pixel noise from an integer hash: the same on every machine and in every language."""

import numpy as np

from .._jit import kernel

MASK = np.uint64(0xFFFFFFFF)
MULTIPLIER = np.uint64(1664525)
INCREMENT = np.uint64(1013904223)
SIXTEEN = np.uint64(16)


@kernel
def pcg3d(x: int, y: int, z: int) -> tuple[int, int, int]:
    """Three hashed uint32 words of three uint32 inputs, held in uint64 and masked.

    Source: Jarzynski and Olano, Hash Functions for GPU Rendering, JCGT 9(3), 2020, listing 16.
    """
    a = (np.uint64(x) * MULTIPLIER + INCREMENT) & MASK
    b = (np.uint64(y) * MULTIPLIER + INCREMENT) & MASK
    c = (np.uint64(z) * MULTIPLIER + INCREMENT) & MASK
    # (2³² − 1)² + 2³² − 1 < 2⁶⁴: products are exact before they are masked.
    a = (a + b * c) & MASK
    b = (b + c * a) & MASK
    c = (c + a * b) & MASK
    a = a ^ (a >> SIXTEEN)
    b = b ^ (b >> SIXTEEN)
    c = c ^ (c >> SIXTEEN)
    a = (a + b * c) & MASK
    b = (b + c * a) & MASK
    c = (c + a * b) & MASK
    return a, b, c


@kernel
def jitter(x: int, y: int, seed: int) -> float:
    """Noise in (0, 1] of a pixel: the first word's top 24 bits · 2⁻²⁴, plus 2⁻²⁴."""
    a, _, _ = pcg3d(x, y, seed)
    return (np.float64(a >> np.uint64(8)) + 1.0) * 2.0**-24

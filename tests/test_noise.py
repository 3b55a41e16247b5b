"""The per-pixel hash: sixteen published-algorithm values, range, mean, and no visible pattern."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from oracles.dda import jitter_of
from oracles.dda import pcg3d as pcg3d_oracle

from ssr_ref.vecmath.noise import jitter, pcg3d

# (x, y, seed), first word, computed with Python's integers from listing 16 of Jarzynski and Olano,
# Hash Functions for GPU Rendering, JCGT 9(3), 2020 (`oracles.dda.pcg3d`). docs/dda.md lists them.
VALUES = [
    (0, 0, 0, 0x9BAFD7C6),
    (1, 0, 0, 0xA1FEC616),
    (0, 1, 0, 0x1AD3129C),
    (0, 0, 1, 0x7F5DB8D2),
    (1, 2, 3, 0xFA9F79A6),
    (3, 2, 1, 0x15C5F2BA),
    (5, 3, 7, 0xD2BF6E6F),
    (959, 539, 0, 0x11A50A16),
    (959, 539, 1, 0x87D9C1F9),
    (16383, 16383, 0, 0x1D2DC0C0),
    (16383, 0, 4294967295, 0x3F880EED),
    (0, 16383, 4294967295, 0x71CD6497),
    (4294967295, 4294967295, 4294967295, 0xA5F48F40),
    (4294967295, 0, 0, 0xB4535346),
    (255, 256, 65535, 0xDEF2AF54),
    (1234567, 7654321, 42, 0xC0E1CCC7),
]
TOP = 2**32 - 1


@pytest.mark.parametrize(("x", "y", "seed", "word"), VALUES)
def test_first_word_of_sixteen_inputs(x: int, y: int, seed: int, word: int) -> None:
    assert pcg3d(x, y, seed)[0] == word
    assert pcg3d_oracle((x, y, seed))[0] == word
    # j = top 24 bits · 2⁻²⁴ + 2⁻²⁴ (spec 4.8), exact in float64 and in float32.
    j = (word // 256 + 1) / 2**24
    assert jitter(x, y, seed) == j == float(np.float32(j))


def test_all_three_words_equal_the_plain_implementation() -> None:
    rng = np.random.default_rng(1)
    random = rng.integers(0, 2**32, (2000, 3)).tolist()
    for v in (*random, [0, 0, 0], [TOP, TOP, TOP], [TOP, 0, 1]):
        assert tuple(int(w) for w in pcg3d(*v)) == pcg3d_oracle(tuple(v))


@numba.njit
def jitter_image(width: int, height: int, seed: int) -> np.ndarray:
    """j of every pixel."""
    out = np.empty((height, width))
    for y in range(height):
        for x in range(width):
            out[y, x] = jitter(x, y, seed)
    return out


def test_jitter_is_above_0_at_most_1_and_evenly_spread() -> None:
    j = jitter_image(1024, 512, 7)
    assert j[3, 5] == jitter_of(5, 3, 7)
    assert j.min() > 0.0 and j.max() <= 1.0
    # Mean of n even numbers: ½ ± 1/√(12 n); five of those deviations.
    assert abs(j.mean() - 0.5) < 5.0 / np.sqrt(12.0 * j.size)
    counts = np.bincount((j * 16.0 - 1e-9).astype(int).ravel(), minlength=16)
    # χ² of 15 degrees of freedom; 44.3 is passed by chance once in 10⁴.
    expected = j.size / 16
    assert ((counts - expected) ** 2 / expected).sum() < 44.3
    # Neighbours and seeds are unrelated: correlation of n pairs is 0 ± 1/√n.
    for other in (np.roll(j, 1, 0), np.roll(j, 1, 1), jitter_image(1024, 512, 8)):
        assert abs(np.corrcoef(j.ravel(), other.ravel())[0, 1]) < 5.0 / np.sqrt(j.size)

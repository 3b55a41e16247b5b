"""Arguments of the kernels in `maths/codes.py`, every number exact in float32.

Uniform samples hardly meet cancellation, so a good part of each list is drawn where the formula is
hard: fold edges, thresholds, borders. The same on every machine: only `random.Random.random` and
`getrandbits`, whose sequences Python promises to keep, and exactly rounded arithmetic.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import numpy as np

from ..typed import AnyArray
from ..vecmath.srgb import CODE_THRESHOLD, LINEAR_THRESHOLD

Direction = tuple[float, float, float]
Code = tuple[float, float]


def single(x: float) -> float:
    """x rounded to float32."""
    return float(np.float32(x))


def steps(x: float, count: int) -> float:
    """The float32 that lies `count` steps from x > 0 towards infinity; negative: towards 0."""
    return float((np.array(x, np.float32).view(np.int32) + np.int32(count)).view(np.float32))


def any_size(source: random.Random, low: int, high: int) -> float:
    """A float32 > 0 with an exponent evenly from low to high − 1 and an even significand."""
    exponent = low + int(source.random() * (high - low))
    return single((1.0 + source.random()) * 2.0**exponent)


def sign(source: random.Random) -> float:
    """−1 or 1."""
    return 1.0 if source.random() < 0.5 else -1.0


def directions(count: int, seed: int = 0) -> list[Direction]:
    """Rounded unit vectors: half even on the sphere, half near the equator, the axes and folds."""
    source = random.Random(seed)
    found: list[Direction] = []
    while len(found) < count:
        x, y, z = (2.0 * source.random() - 1.0 for _ in range(3))
        square = x * x + y * y + z * z
        if not 1e-3 < square <= 1.0:
            continue
        kind = len(found) % 6
        if kind == 1:  # the equator, where the fold begins
            z = sign(source) * any_size(source, -40, -2)
        elif kind == 3:  # an axis: two coordinates are tiny
            z = -any_size(source, -30, -4)
            x = sign(source) * any_size(source, -30, -4)
        elif kind == 5:  # between two lower faces
            x = sign(source) * any_size(source, -30, -4)
            z = -abs(z)
        size = float(np.sqrt(x * x + y * y + z * z))
        found.append((single(x / size), single(y / size), single(z / size)))
    return found


def square_codes(count: int, seed: int = 0) -> list[Code]:
    """Codes in [−1, 1]²: half even, half near |u| + |v| = 1, a corner, or an axis."""
    source = random.Random(seed)
    found: list[Code] = []
    for i in range(count):
        u, v = 2.0 * source.random() - 1.0, 2.0 * source.random() - 1.0
        kind = i % 6
        if kind == 1:  # z cancels
            v = sign(source) * (1.0 - abs(u) + sign(source) * any_size(source, -24, -4))
            v = min(max(v, -1.0), 1.0)
        elif kind == 3:
            u = sign(source) * (1.0 - any_size(source, -24, -3))
            v = sign(source) * (1.0 - any_size(source, -24, -3))
        elif kind == 5:
            v = sign(source) * any_size(source, -40, -4)
        found.append((single(u), single(v)))
    return found


def intensities(count: int, threshold: float, seed: int = 0) -> list[float]:
    """Numbers for a transfer function: even in [0, 1], small and large ones, near the threshold."""
    source = random.Random(seed)
    found = []
    for i in range(count):
        kind = i % 4
        if kind == 1:
            found.append(any_size(source, -40, 5))
        elif kind == 3:
            found.append(steps(single(threshold), int(source.random() * 4001.0) - 2000))
        else:
            found.append(single(source.random()))
    return found


def faded_positions(count: int, seed: int = 0) -> list[tuple[Code, float]]:
    """uv and a power ≤ 8: inside the image, near the border, near the middle, just outside."""
    source = random.Random(seed)
    powers = (2.0, 3.0, 2.5, 1.0, 8.0)
    found = []
    for i in range(count):
        u, v = source.random(), source.random()
        kind = i % 6
        if kind == 1:
            u = any_size(source, -30, -3)
        elif kind == 3:
            v = 1.0 - any_size(source, -24, -3)
        elif kind == 4:
            u = 0.5 + sign(source) * any_size(source, -25, -5)
        elif kind == 5:
            v = sign(source) * any_size(source, -24, 0) + (1.0 if source.random() < 0.5 else 0.0)
        found.append(((single(u), single(v)), powers[i % 5]))
    return found


def lengths(count: int, seed: int = 0) -> list[tuple[float, float]]:
    """A ray's length and the maximum: a share of 0 to 1.25 of it, or of any size."""
    source = random.Random(seed)
    found = []
    for i in range(count):
        limit = any_size(source, -20, 20)
        share = source.random() * 1.25 if i % 3 else any_size(source, -30, 6)
        found.append((single(limit * share), limit))
    return found


def words(count: int, seed: int = 0) -> list[tuple[int, int, int]]:
    """Three words each: half of them pixels of an image and a small seed, half of all 32 bits."""
    source = random.Random(seed)
    found = []
    for i in range(count):
        bits = (14, 14, 8) if i % 2 else (32, 32, 32)
        found.append((source.getrandbits(bits[0]), *(source.getrandbits(b) for b in bits[1:])))
    return [(a, b, c) for a, b, c in found]


Sampler = Callable[[int, int], tuple[AnyArray, ...]]


def _arrays(draw: Callable[..., list[Any]], *first: float) -> Sampler:
    """Argument lists as one array an argument."""

    def sample(n: int, seed: int) -> tuple[AnyArray, ...]:
        drawn = draw(n, *first, seed)
        several = isinstance(drawn[0], tuple) and draw not in (directions, square_codes)
        return tuple(map(np.array, zip(*drawn))) if several else (np.array(drawn),)

    return sample


SAMPLES: dict[str, Sampler] = {
    "octahedral_encode": _arrays(directions),
    "octahedral_decode": _arrays(square_codes),
    "srgb_encode": _arrays(intensities, LINEAR_THRESHOLD),
    "srgb_decode": _arrays(intensities, CODE_THRESHOLD),
    "edge_fade": _arrays(faded_positions),
    "distance_fade": _arrays(lengths),
    "pcg3d": _arrays(words),
    "jitter": _arrays(words),
}

"""Inputs for depth formats, barycentrics and directions: many plain cases and the hard ones.

`SAMPLES[key](n, seed)` gives the positional arrays of that KernelInfo's function: n cases, float64
numbers that float32 holds exactly, so that a shader can be given the same input. Drawn with
integers and exact scaling only: the same on every machine.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..typed import AnyArray, F64Array

Sampler = Callable[[int, int], tuple[F64Array, ...]]
Rng = np.random.Generator

# Near and far as they are used, with ratios up to 10¹⁰.
RANGES = ((0.1, 100.0), (0.1, 1e3), (0.01, 1e4), (0.01, 1e5), (1e-3, 1e5), (1e-3, 1e7), (1.0, 1.25))


def _round(x: Any) -> F64Array:
    return np.asarray(x, np.float32).astype(np.float64)


def _log_uniform(rng: Rng, n: int, low: int, high: int) -> F64Array:
    """Positive numbers of 24 bits, every power of two from 2^low to 2^high as likely."""
    exponent = rng.integers(low, high, n)
    x: F64Array = np.ldexp(rng.integers(2**23, 2**24, n) / 2.0**23, exponent)
    return x


def _sign(rng: Rng, n: int) -> F64Array:
    sign: F64Array = np.where(rng.integers(0, 2, n) == 0, -1.0, 1.0)
    return sign


def _mixed(rng: Rng, *parts: F64Array) -> F64Array:
    """Element i of a part drawn at random."""
    which = rng.integers(0, len(parts), parts[0].shape[0])
    mixed: F64Array = np.stack(parts)[which, np.arange(which.size)]
    return mixed


# --- Depth ----------------------------------------------------------------------------------------


def _ranges(rng: Rng, n: int) -> tuple[F64Array, F64Array]:
    table = _round(RANGES)
    picked = table[rng.integers(0, len(RANGES), n)]
    near = _log_uniform(rng, n, -12, 4)
    far = _round(near * _log_uniform(rng, n, 1, 34))
    use = rng.integers(0, 2, n) == 0
    return np.where(use, picked[:, 0], near), np.where(use, picked[:, 1], far)


def _unit(rng: Rng, n: int) -> F64Array:
    """Device depths of [0, 1]: even, next to 0, next to 1, and the ends."""
    steps = rng.integers(1, 200, n)
    return _mixed(
        rng,
        rng.integers(0, 2**24 + 1, n) / 2.0**24,
        _log_uniform(rng, n, -60, 0),
        1.0 - steps / 2.0**24,
        _round(1.0 - _log_uniform(rng, n, -23, -1)),
        rng.integers(0, 2, n).astype(np.float64),
    )


def _symmetric(rng: Rng, n: int) -> F64Array:
    """Device depths of [−1, 1], also next to 0."""
    return _mixed(
        rng,
        _round(2.0 * _unit(rng, n) - 1.0),
        _sign(rng, n) * (1.0 - rng.integers(0, 200, n) / 2.0**24),
        _sign(rng, n) * _log_uniform(rng, n, -40, 0),
    )


def _depths(rng: Rng, near: F64Array, far: F64Array) -> F64Array:
    """View depths of [near, far]: next to either end, between them, and the ends."""
    n = near.shape[0]
    steps = np.asarray(rng.integers(0, 100, n))
    low, high = near.astype(np.float32), far.astype(np.float32)
    top = np.where(np.isfinite(far), far, near * 2.0**40)
    between = _round(near * _log_uniform(rng, n, 0, 40))
    return _mixed(
        rng,
        np.minimum(_after(low, steps), top),
        np.maximum(_after(high, -steps) if np.isfinite(far).all() else between, near),
        np.clip(between, near, top),
        np.clip(_round(near + (top - near) * (rng.integers(1, 2**20, n) / 2.0**20)), near, top),
    )


def _after(x: AnyArray, steps: AnyArray) -> F64Array:
    """The float32 so many places after x > 0."""
    bits = x.astype(np.float32).view(np.int32) + steps.astype(np.int32)
    return bits.astype(np.int32).view(np.float32).astype(np.float64)


def _decode(kind: str, infinite: bool) -> Sampler:
    def sample(n: int, seed: int) -> tuple[F64Array, ...]:
        rng = np.random.default_rng(seed)
        near, far = _ranges(rng, n)
        device = _symmetric(rng, n) if kind == "gl_ndc" else _unit(rng, n)
        if kind == "reversed":
            device = np.where(rng.integers(0, 2, n) == 0, device, _round(1.0 - device))
        if infinite:  # the far end itself is infinite: no number to compare
            end = 0.0 if kind == "reversed" else 1.0
            return np.where(device == end, 0.5, device), near
        return device, near, far

    return sample


def _encode(infinite: bool) -> Sampler:
    def sample(n: int, seed: int) -> tuple[F64Array, ...]:
        rng = np.random.default_rng(seed)
        near, far = _ranges(rng, n)
        if infinite:
            return _depths(rng, near, np.full(n, np.inf)), near
        return _depths(rng, near, far), near, far

    return sample


def _log_decode(n: int, seed: int) -> tuple[F64Array, ...]:
    rng = np.random.default_rng(seed)
    return _unit(rng, n), _log_uniform(rng, n, 0, 24), _log_uniform(rng, n, -10, 4)


def _log_encode(n: int, seed: int) -> tuple[F64Array, ...]:
    rng = np.random.default_rng(seed)
    far = _log_uniform(rng, n, 0, 24)
    return (
        np.minimum(_round(far * _log_uniform(rng, n, -40, 1)), far),
        far,
        _log_uniform(rng, n, -10, 4),
    )


def _negative_z(n: int, seed: int) -> tuple[F64Array, ...]:
    return (-_log_uniform(np.random.default_rng(seed), n, -20, 30),)


def _positive_z(n: int, seed: int) -> tuple[F64Array, ...]:
    return (_log_uniform(np.random.default_rng(seed), n, -20, 30),)


def _distance(n: int, seed: int) -> tuple[F64Array, ...]:
    rng = np.random.default_rng(seed)
    return _log_uniform(rng, n, -20, 30), _log_uniform(rng, n, 0, 3)


# --- Barycentrics ---------------------------------------------------------------------------------


def _grid(x: F64Array) -> F64Array:
    """To 1/256 pixel."""
    return np.rint(x * 256.0) / 256.0


def _triangles(n: int, seed: int) -> tuple[F64Array, ...]:
    """Plain triangles, slivers of a sub-pixel, points on vertices and edges; w over 30 octaves."""
    rng = np.random.default_rng(seed)
    a, b, c = (_grid(rng.integers(-(2**17), 2**18, (n, 2)) / 256.0) for _ in range(3))
    sliver = (rng.integers(0, 3, n) == 0)[:, None]
    along = rng.integers(0, 257, (n, 1)) / 256.0
    c = np.where(sliver, _grid(a + (b - a) * along) + rng.integers(-1, 2, (n, 2)) / 256.0, c)
    weights = rng.integers(0, 65, (n, 3)) / 64.0 + np.array([1.0, 0.0, 0.0]) / 64.0
    weights[rng.integers(0, 4, n) == 0, 1] = 0.0
    total = weights.sum(axis=1, keepdims=True)
    p = (a * weights[:, :1] + b * weights[:, 1:2] + c * weights[:, 2:]) / total
    p = np.where((rng.integers(0, 2, n) == 0)[:, None], _grid(p), np.floor(p) + 0.5)
    w = np.stack([_log_uniform(rng, n, -10, 20) for _ in range(3)], axis=1)
    return p, a, b, c, w


# --- Directions -----------------------------------------------------------------------------------


def _directions(n: int, seed: int) -> tuple[F64Array, ...]:
    """All round; on and next to axes, poles and the seam; with two or three equal components."""
    rng = np.random.default_rng(seed)
    d = np.stack([_sign(rng, n) * (rng.integers(1, 2**24, n) / 2.0**23) for _ in range(3)], axis=1)
    rows = np.arange(n)

    # Next to an axis: two components of 2⁻³⁰ and up; below that u = 1 is not told from u = 0.
    kind = rng.integers(0, 6, n)
    axis = rng.integers(0, 3, n)
    near_axis = np.stack([_sign(rng, n) * _log_uniform(rng, n, -30, -4) for _ in range(3)], axis=1)
    near_axis[rows, axis] = _sign(rng, n)
    near_axis[rows, (axis + 1) % 3] *= rng.integers(0, 4, n) > 0
    d = np.where((kind == 1)[:, None], near_axis, d)
    on_axis = np.zeros((n, 3))
    on_axis[rows, axis] = _sign(rng, n)
    d = np.where((kind == 2)[:, None], on_axis, d)

    # Next to an edge of the cube, and on it.
    tie = d.copy()
    tie[rows, (axis + 1) % 3] = _round(
        tie[rows, axis] * (1.0 + rng.integers(-2, 3, n) / 2.0**23) * _sign(rng, n)
    )
    d = np.where((kind == 3)[:, None], tie, d)

    # Any length that float32 can square without the kernels' help, and those that it cannot.
    scale = np.ldexp(1.0, np.where(rng.integers(0, 4, n) == 0, rng.integers(-60, 90, n), 0))
    return (d * scale[:, None],)


def _uv(rng: Rng, n: int) -> F64Array:
    return np.stack(
        [
            _mixed(
                rng,
                rng.integers(0, 2**24 + 1, n) / 2.0**24,
                rng.integers(0, 9, n) / 8.0,
                _log_uniform(rng, n, -40, 0),
                1.0 - rng.integers(0, 100, n) / 2.0**24,
            )
            for _ in range(2)
        ],
        axis=1,
    )


def _cube_points(n: int, seed: int) -> tuple[F64Array, ...]:
    rng = np.random.default_rng(seed)
    return rng.integers(0, 6, n).astype(np.float64), _uv(rng, n)


def _latlong_points(n: int, seed: int) -> tuple[F64Array, ...]:
    return (_uv(np.random.default_rng(seed), n),)


def _cross_points(n: int, seed: int) -> tuple[F64Array, ...]:
    rng = np.random.default_rng(seed)
    cells = np.array([(2, 1), (0, 1), (1, 0), (1, 2), (1, 1), (3, 1)], np.float64)
    inside = rng.integers(1, 2**18, (n, 2)) / 2.0**18
    at = (cells[rng.integers(0, 6, n)] + inside) / np.array([4.0, 3.0])
    return (_round(at),)


def _ball_points(n: int, seed: int) -> tuple[F64Array, ...]:
    """On the ball: even, next to the middle, next to the rim and on its four ends."""
    rng = np.random.default_rng(seed)
    x = _sign(rng, n) * (rng.integers(0, 2**20, n) / 2.0**20)
    rim = np.floor(np.sqrt(1.0 - x * x) * 2.0**22) / 2.0**22  # at or just below the rim
    part = np.where(rng.integers(0, 2, n) == 0, 1.0, rng.integers(0, 2**10, n) / 2.0**10)
    y = np.floor(rim * part * 2.0**22) / 2.0**22 * _sign(rng, n)
    middle = (rng.integers(0, 5, n) == 0)[:, None]
    xy = np.where(middle, np.stack([x, y], 1) / 2.0**12, np.stack([x, y], 1))
    ends = np.array([(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
    xy = np.where((rng.integers(0, 20, n) == 0)[:, None], ends[rng.integers(0, 4, n)], xy)
    return (np.where(middle, _round(0.5 + 0.5 * xy), 0.5 + 0.5 * xy),)


SAMPLES: dict[str, Sampler] = {
    **{
        f"linear_depth/{kind}{tail}": _decode(kind, tail == "_infinite")
        for kind in ("gl_ndc", "d3d", "reversed")
        for tail in ("", "_infinite", "_orthographic")
    },
    **{
        f"device_depth/{kind}{tail}": _encode(tail == "_infinite")
        for kind in ("gl_ndc", "d3d", "reversed")
        for tail in ("", "_infinite", "_orthographic")
    },
    "linear_depth/logarithmic": _log_decode,
    "linear_depth/logarithmic_near": _decode("d3d", False),
    "linear_depth/negative_z": _negative_z,
    "linear_depth/distance": _distance,
    "device_depth/logarithmic": _log_encode,
    "device_depth/logarithmic_near": _encode(False),
    "device_depth/negative_z": _positive_z,
    "device_depth/distance": _distance,
    "barycentrics": _triangles,
    "cube_face/face": _directions,
    "cube_face/uv": _directions,
    "cube_direction": _cube_points,
    "cross_uv": _directions,
    "cross_direction": _cross_points,
    "latlong_uv": _directions,
    "latlong_direction": _latlong_points,
    "ball_uv": _directions,
    "ball_direction": _ball_points,
}

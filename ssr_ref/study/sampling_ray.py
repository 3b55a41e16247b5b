"""Inputs for error-free transforms, mirrors, lines, spheres and rays: plain and hard ones.

Magnitudes are drawn with integers and exact scaling, so that samples are the same on every machine;
positions are float32 numbers, so that a shader can be given the same input.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..maths.rays import STUDY_CAMERA, STUDY_SIZE
from ..typed import AnyArray, F64Array

Sampler = Callable[[int, int], tuple[AnyArray, ...]]
Rng = np.random.Generator


def _single(x: Any) -> F64Array:
    return np.asarray(x, np.float32).astype(np.float64)


def _sizes(rng: Rng, n: int, low: int, high: int, bits: int = 53) -> F64Array:
    """Signed numbers of so many bits, every power of two of [low, high) as likely."""
    mantissa = rng.integers(2 ** (bits - 1), 2**bits, n) / 2.0 ** (bits - 1)
    signed = np.where(rng.integers(0, 2, n) == 0, mantissa, -mantissa)
    return np.asarray(np.ldexp(signed, rng.integers(low, high, n)), np.float64)


def _vectors(rng: Rng, n: int, low: int = -4, high: int = 4) -> F64Array:
    """Float32 vectors, some along an axis and some with components far apart."""
    v = np.stack([_sizes(rng, n, low, high, 24) for _ in range(3)], axis=-1)
    v[::7, 1] = 0.0
    v[::13, 2] *= 2.0**-30
    return v


def _ways(rng: Rng, n: int) -> F64Array:
    """Unit vectors in all directions (denser towards the corners of a cube)."""
    v = rng.uniform(-1.0, 1.0, (n, 3))
    return np.asarray(v / np.sqrt((v * v).sum(axis=-1, keepdims=True)), np.float64)


def _unit(rng: Rng, n: int) -> F64Array:
    v = _vectors(rng, n)
    return np.asarray(v / np.sqrt((v * v).sum(axis=-1, keepdims=True)), np.float64)


# --- Error-free transforms and mirrors ------------------------------------------------------------


def _sums(n: int, seed: int) -> tuple[AnyArray, ...]:
    """Terms of any size, terms that almost cancel, and ties."""
    rng = np.random.default_rng(seed)
    a, b = _sizes(rng, n, -60, 60), _sizes(rng, n, -60, 60)
    close = -a * (1.0 + rng.integers(-4, 5, n) * 2.0**-52)
    tie = a * 2.0**-53
    which = rng.integers(0, 3, n)
    return a, np.select([which == 0, which == 1], [close, tie], b)


def _products(n: int, seed: int) -> tuple[AnyArray, ...]:
    rng = np.random.default_rng(seed)
    return _sizes(rng, n, -200, 200), _sizes(rng, n, -200, 200)


def _differences(n: int, seed: int) -> tuple[AnyArray, ...]:
    """Most of them cancel to the last bits: c·d = a·b to a few ulp."""
    rng = np.random.default_rng(seed)
    a, b, c = (_sizes(rng, n, -20, 20) for _ in range(3))
    d = a * b / c * (1.0 + rng.integers(-3, 4, n) * 2.0**-52)
    return a, b, c, np.where(np.arange(n) % 4 == 0, _sizes(rng, n, -20, 20), d)


def _incident(n: int, seed: int) -> tuple[AnyArray, ...]:
    """Any directions, grazing ones, and normals of any length."""
    rng = np.random.default_rng(seed)
    d, normal = _vectors(rng, n), _vectors(rng, n, -30, 30)
    third = slice(None, None, 3)
    across = np.stack([normal[:, 1], -normal[:, 0], np.zeros(n)], axis=-1)
    d[third] = _single(across + 1e-5 * normal)[third]
    d[::11] = normal[::11]
    return d, normal


def _incident_unit(n: int, seed: int) -> tuple[AnyArray, ...]:
    rng = np.random.default_rng(seed)
    return _incident(n, seed)[0], _unit(rng, n)


def _planes(n: int, seed: int) -> tuple[AnyArray, ...]:
    """Planes of any slant and distance; normals where 1 − 2n² cancels."""
    rng = np.random.default_rng(seed)
    normal = _vectors(rng, n, -8, 8)
    normal[::5, 1] = normal[::5, 0] * (1.0 + rng.integers(-2, 3, n)[::5] * 2.0**-23)
    normal[::5, 2] *= 2.0**-12
    return normal, _sizes(rng, n, -20, 20, 24)


def _lines(n: int, seed: int) -> tuple[AnyArray, ...]:
    """Lines in all octants, lone pixels, exact ties, up to the largest coordinate."""
    rng = np.random.default_rng(seed)
    reach = 2 ** rng.integers(0, 30, (n, 1))
    start, end = rng.integers(-reach, reach + 1, (n, 2)), rng.integers(-reach, reach + 1, (n, 2))
    end[::9] = start[::9]
    end[::5, 1] = start[::5, 1] + (end[::5, 0] - start[::5, 0]) // 2
    steps = np.abs(end - start).max(axis=-1)
    return start, np.clip(end, -(2**29), 2**29), (steps * rng.random(n)).astype(np.int64)


# --- Spheres --------------------------------------------------------------------------------------


def _aimed(
    rng: Rng, origin: F64Array, center: F64Array, radius: F64Array, offset: F64Array
) -> F64Array:
    """Unit directions from the origins that pass the centres at `offset` · radius."""
    to = center - origin
    length = np.sqrt((to * to).sum(axis=-1, keepdims=True))
    other = _ways(rng, to.shape[0])
    side = other - (other * to).sum(axis=-1, keepdims=True) / (length * length) * to
    side /= np.sqrt((side * side).sum(axis=-1, keepdims=True))
    sine = np.clip(offset * radius / length[:, 0], -1.0, 1.0)[:, None]
    return np.asarray(np.sqrt(1.0 - sine * sine) * to / length + sine * side, np.float64)


def spheres(
    n: int,
    seed: int,
    distance: float,
    *,
    tangent: float | None = None,
    unit: bool = True,
    single: bool = True,
) -> tuple[F64Array, F64Array, F64Array, F64Array]:
    """Rays at spheres `distance` radii away: origin, direction, center, radius.

    Offsets from the centre are even in [0, 1.25] radii, or within `tangent` of 1. Half the
    directions are not unit unless `unit`. single : numbers that float32 holds; of them, float64
    subtracts and squares many exactly.
    """
    rng = np.random.default_rng(seed)
    kept = _single if single else np.asarray
    radius = kept(rng.uniform(0.5, 2.0, n))
    center = kept(rng.uniform(-2.0, 2.0, (n, 3)))
    origin = kept(center + _ways(rng, n) * (distance * radius)[:, None])
    offset = rng.uniform(0.0, 1.25, n)
    if tangent is not None:
        offset = 1.0 + rng.uniform(-tangent, tangent, n)
    d = kept(_aimed(rng, origin, center, radius, offset))
    if not unit:
        d[::2] = kept(d * np.abs(_sizes(rng, n, -60, 60))[:, None])[::2]
    return origin, d, center, radius


def near_spheres(
    n: int, seed: int, radius: float, height: float, *, single: bool = True
) -> tuple[F64Array, F64Array, F64Array, F64Array]:
    """Rays that look down from just above a huge sphere about the origin of the world."""
    rng = np.random.default_rng(seed)
    kept = _single if single else np.asarray
    up, d = _ways(rng, n), _ways(rng, n)
    d *= -np.sign((d * up).sum(axis=-1, keepdims=True))
    return kept(up * (radius + height)), kept(d), np.zeros((n, 3)), kept(np.full(n, radius))


def _spheres(n: int, seed: int) -> tuple[AnyArray, ...]:
    """Far, near, inside, grazing; distances from 10² to 10⁸ radii."""
    part = -(-n // 10)
    kinds = [spheres(part, seed + i, 10.0**i, unit=False) for i in (2, 3, 4, 6, 8)]
    kinds.append(spheres(part, seed + 9, 5.0, unit=False))
    kinds.append(spheres(part, seed + 10, 20.0, tangent=1e-3))
    kinds.append(spheres(part, seed + 11, 20.0, tangent=1e-6))
    kinds.append(spheres(part, seed + 12, 0.9, unit=False))
    kinds.append(near_spheres(part, seed + 13, 6.4e6, 10.0))
    return tuple(np.concatenate(columns)[:n] for columns in zip(*kinds))


# --- Rays -----------------------------------------------------------------------------------------


def _pixels(rng: Rng, n: int) -> tuple[AnyArray, F64Array]:
    pixel = np.stack([rng.integers(0, side, n) for side in STUDY_SIZE], axis=-1)
    return pixel, np.abs(_sizes(rng, n, -2, 12, 24))


def _setups(n: int, seed: int) -> tuple[AnyArray, ...]:
    """Pixels all over the image with normals that face the eye; a third are cut by distance, a
    fifth come back to the eye.
    """
    rng = np.random.default_rng(seed)
    pixel, depth = _pixels(rng, n)
    v = STUDY_CAMERA.params(STUDY_SIZE)
    sight = np.stack(
        [(pixel[:, 0] + 0.5 - v.cx) / v.fx, (v.cy - pixel[:, 1] - 0.5) / v.fy, -np.ones(n)], axis=-1
    )
    normal = _vectors(rng, n)
    normal[::5] = _single(1e-3 * normal - 16.0 * sight)[::5]
    facing = (normal * sight).sum(axis=-1)
    normal *= np.where(facing > 0.0, -1.0, 1.0)[:, None]
    limit = np.where(rng.integers(0, 3, n) == 0, np.abs(_sizes(rng, n, -2, 10, 24)), np.inf)
    return pixel, depth, normal, limit


def _clips(n: int, seed: int) -> tuple[AnyArray, ...]:
    """Rays from points inside the window, in any direction, a fifth of them through the window of
    the near plane.
    """
    rng = np.random.default_rng(seed)
    pixel, depth = _pixels(rng, n)
    v = STUDY_CAMERA.params(STUDY_SIZE)
    x = (pixel[:, 0] + 0.5 - v.cx) / v.fx * depth
    y = (v.cy - pixel[:, 1] - 0.5) / v.fy * depth
    origin = _single(np.stack([x, y, -depth], axis=-1))
    direction = _vectors(rng, n, -40, 40)
    behind = v.near * rng.uniform(0.0, 0.5, (n, 3)) * [1.25, 0.625, -1.0]
    direction[::5] = _single(behind - origin)[::5]
    limit = np.where(rng.integers(0, 3, n) == 0, np.abs(_sizes(rng, n, -2, 10, 24)), np.inf)
    return origin, direction, limit


SAMPLES: dict[str, Sampler] = {
    "two_sum": _sums,
    "two_prod": _products,
    "difference_of_products": _differences,
    "reflect/normalizing": _incident,
    "reflect/published": _incident_unit,
    "mirror_matrix": _planes,
    "dda_line": _lines,
    **{
        f"intersect_sphere/{form}": _spheres
        for form in ("textbook", "textbook_unit", "stable", "kahan", "hearn_baker", "distance")
    },
    "clip_ray": _clips,
    "ray_setup/end_position": _setups,
    "ray_setup/inverse_depth": _setups,
}

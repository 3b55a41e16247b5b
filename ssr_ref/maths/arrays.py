"""Array-likes to what a driver takes: float64 or uint32, C order, broadcast to one shape, flat."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import MathsError
from ..typed import AnyArray, F64Array, U32Array


def numbers(value: Any, name: str) -> F64Array:
    """A new or read-only view float64 array of any shape. Raises MathsError for other types."""
    array = _array(value, name, "fiu", "real numbers")
    return array.astype(np.float64, copy=False)


def vectors(value: Any, name: str, components: int) -> F64Array:
    """Float64 of shape (..., components). Raises MathsError for another type or last axis."""
    array = numbers(value, name)
    if array.ndim == 0 or array.shape[-1] != components:
        raise MathsError(
            f"{name} has shape {array.shape}; expected (..., {components}): put the components "
            "into the last axis"
        )
    return array


def words(value: Any, name: str) -> U32Array:
    """Uint32 of any shape. Raises MathsError unless all are whole numbers from 0 to 2³² − 1."""
    array = _array(value, name, "iu", "whole numbers from 0 to 4294967295")
    bad = (array < 0) | (array > 0xFFFFFFFF)
    if bad.any():
        raise MathsError(
            f"{name} holds {array[bad].flat[0]}; expected whole numbers from 0 to 4294967295: "
            "take them modulo 2**32 first"
        )
    return array.astype(np.uint32)


def common_shape(**shapes: tuple[int, ...]) -> tuple[int, ...]:
    """The shape that all broadcast to. Raises MathsError, with the names, if there is none."""
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError:
        found = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise MathsError(
            f"shapes do not broadcast: {found}; expected equal sides, or 1, from the right"
        ) from None


def flat(array: AnyArray, shape: tuple[int, ...]) -> AnyArray:
    """The array broadcast to `shape` and made one axis of C-contiguous numbers."""
    return np.ascontiguousarray(np.broadcast_to(array, shape)).reshape(-1)


def rows(array: AnyArray, shape: tuple[int, ...]) -> AnyArray:
    """The vectors broadcast to (*shape, n) and made C-contiguous (N, n)."""
    whole = np.broadcast_to(array, (*shape, array.shape[-1]))
    return np.ascontiguousarray(whole).reshape(-1, array.shape[-1])


def _array(value: Any, name: str, kinds: str, expected: str) -> AnyArray:
    try:
        array = np.asarray(value)
    except (ValueError, TypeError, OverflowError) as error:
        raise MathsError(f"{name} is no array ({error}); expected {expected}") from None
    if array.dtype.kind not in kinds:
        raise MathsError(f"{name} is of type {array.dtype}; expected {expected}")
    return array

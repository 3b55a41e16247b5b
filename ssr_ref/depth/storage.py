"""What a depth buffer's memory holds: unorm16, unorm24, float16, float32.

    unorm, b bits   c = round(d·(2^b − 1)), d = c/(2^b − 1)
    float           d rounded to the nearest, ties to even (IEEE 754)

Source: OpenGL 4.6 core specification, section 2.3.5 (fixed point), 2.3.4 (16-bit floats).
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from ..errors import MathsError
from ..typed import AnyArray, F64Array

Storage = Literal["unorm16", "unorm24", "float16", "float32"]

_LARGEST = {"unorm16": 0xFFFF, "unorm24": 0xFFFFFF}
_CODE = {"unorm16": np.uint16, "unorm24": np.uint32, "float16": np.float16, "float32": np.float32}


def _check(storage: str) -> None:
    if storage not in get_args(Storage):
        raise MathsError(f"storage is '{storage}'; expected {', '.join(get_args(Storage))}")


def to_storage(device: F64Array, storage: Storage) -> AnyArray:
    """Codes of device depths; unorm clamps to [0, 1]. Raises MathsError for NaN in unorm."""
    _check(storage)
    if storage not in _LARGEST:
        with np.errstate(over="ignore", under="ignore"):
            return device.astype(_CODE[storage])
    if np.isnan(device).any():
        raise MathsError(
            f"device depth holds NaN, which {storage} cannot store; give `empty` to device_depth"
        )
    # d·(2^b − 1) of a float32 d is exact in float64, and only d = ½ is a tie: up, as GPUs do.
    scaled = np.clip(device, 0.0, 1.0) * _LARGEST[storage]
    return np.floor(scaled + 0.5).astype(_CODE[storage])


def from_storage(codes: AnyArray, storage: Storage) -> F64Array:
    """Device depths of codes, to 0.5 ulp. Raises MathsError for codes that are too large."""
    _check(storage)
    if storage not in _LARGEST:
        return codes.astype(_CODE[storage]).astype(np.float64)
    largest = _LARGEST[storage]
    if codes.dtype.kind not in "iu" or (codes.size and (codes.min() < 0 or codes.max() > largest)):
        raise MathsError(f"codes of {storage} must be whole numbers from 0 to {largest}")
    return codes.astype(np.float64) / largest


def quantum(device: F64Array, storage: Storage) -> F64Array:
    """Distance from a device depth to the next one that the storage can hold, away from 0."""
    _check(storage)
    if storage in _LARGEST:
        return np.full(device.shape, 1.0 / _LARGEST[storage])
    with np.errstate(over="ignore", under="ignore"):
        return np.abs(np.spacing(device.astype(_CODE[storage]))).astype(np.float64)

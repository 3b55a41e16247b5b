"""Device depth to linear view depth and back, for the formats that renderers write.

n, f: near and far; f may be inf. z: view depth. t: how far a device depth is from the near end of
its range, 0 to 1; e = 1 − t: how far from the far end. Each format supplies the one that it holds
exactly.

    perspective   z = n / (r + e·(1 − r)),  r = n/f      e = (n/z)·(f − z)/(f − n)
    orthographic  z = n + t·(f − n)                      t = (z − n)/(f − n)

The usual n·f/(f − d·(f − n)) subtracts two nearly equal numbers near the far plane; here only
positive terms are added, so the relative error is a few roundings at any f/n. Every step of a
decoder is monotone in e or t, and a monotone function rounded is monotone: the decoders never turn
the order of two depths round. At both ends the result is n or f exactly.

Source: Upchurch and Desbrun, Tightening the Precision of Perspective Rendering, JGT 16(1), 2012
(what the formats lose); the arrangement is this project's.
"""

import numpy as np

from .._jit import fma, kernel
from .logarithmic import (
    log_depth,
    log_device,
    log_near_depth,
    log_near_device,
)

LINEAR = 0  # z
NEGATIVE_Z = 1  # −z, the view-space coordinate
DISTANCE = 2  # along the pixel's ray
ZERO_TO_ONE = 3  # 0 near, 1 far
SYMMETRIC = 4  # −1 near, 1 far: OpenGL's z_ndc
REVERSED = 5  # 1 near, 0 far
LOGARITHMIC = 6
LOGARITHMIC_NEAR = 7


@kernel
def part_from_near(code: int, device: float) -> float:
    """t of a device depth; at most one rounding."""
    if code == ZERO_TO_ONE:
        return device
    if code == SYMMETRIC:
        return 0.5 * (1.0 + device)
    return 1.0 - device


@kernel
def part_from_far(code: int, device: float) -> float:
    """e of a device depth; at most one rounding, none in the half next to the far plane."""
    if code == ZERO_TO_ONE:
        return 1.0 - device
    if code == SYMMETRIC:
        return 0.5 * (1.0 - device)
    return device


@kernel
def perspective_depth(e: float, near: float, far: float) -> float:
    """View depth of e; NaN outside [0, 1]."""
    if not (e >= 0.0 and e <= 1.0):
        return np.nan
    if e == 0.0:
        return far
    if far == np.inf:
        return near / e
    r = near / far
    # r + (1 − r) rounds to 1, so e = 1 gives near itself; only the far end needs the cap.
    depth = near / fma(e, 1.0 - r, r)
    return depth if depth < far else far


@kernel
def orthographic_depth(t: float, near: float, far: float) -> float:
    """View depth of t; NaN outside [0, 1]."""
    if not (t >= 0.0 and t <= 1.0):
        return np.nan
    if t == 1.0:
        return far
    depth = fma(t, far - near, near)
    return depth if depth < far else far


@kernel
def perspective_parts(depth: float, near: float, far: float) -> tuple[float, float]:
    """(t, e) of a view depth in [near, far], each to its own last digits."""
    if depth == far:
        return 1.0, 0.0
    if far == np.inf:
        return (depth - near) / depth, near / depth
    t = (far / depth) * ((depth - near) / (far - near))
    e = (near / depth) * ((far - depth) / (far - near))
    return (t if t < 1.0 else 1.0), e


@kernel
def orthographic_parts(depth: float, near: float, far: float) -> tuple[float, float]:
    """(t, e) of a view depth in [near, far]."""
    return (depth - near) / (far - near), (far - depth) / (far - near)


@kernel
def decode_depth(
    code: int,
    orthographic: bool,
    device: float,
    near: float,
    far: float,
    constant: float,
    ray_length: float,
) -> float:
    """View depth of a device depth; NaN for what the format cannot hold.

    constant: C of LOGARITHMIC. ray_length: |d| of the pixel's ray with d_z = −1, of DISTANCE.
    """
    if code == LINEAR:
        return device if device > 0.0 else np.nan
    if code == NEGATIVE_Z:
        return -device if device < 0.0 else np.nan
    if code == DISTANCE:
        return device / ray_length if device > 0.0 else np.nan
    if code == LOGARITHMIC:
        return log_depth(device, far, constant)
    if code == LOGARITHMIC_NEAR:
        return log_near_depth(device, near, far)
    if orthographic:
        return orthographic_depth(part_from_near(code, device), near, far)
    return perspective_depth(part_from_far(code, device), near, far)


@kernel
def encode_depth(
    code: int,
    orthographic: bool,
    depth: float,
    near: float,
    far: float,
    constant: float,
    ray_length: float,
) -> float:
    """Device depth of a view depth; NaN for depths ≤ 0, or outside [near, far] where used."""
    if not depth > 0.0:
        return np.nan
    if code == LINEAR:
        return depth
    if code == NEGATIVE_Z:
        return -depth
    if code == DISTANCE:
        return depth * ray_length
    if code == LOGARITHMIC:
        return log_device(depth, far, constant)
    if not (depth >= near and depth <= far):
        return np.nan
    if code == LOGARITHMIC_NEAR:
        return log_near_device(depth, near, far)
    if orthographic:
        t, e = orthographic_parts(depth, near, far)
    else:
        t, e = perspective_parts(depth, near, far)
    if code == ZERO_TO_ONE:
        return t
    if code == REVERSED:
        return e
    # From the nearer end, so that −1 and 1 are approached with absolute accuracy.
    return fma(2.0, t, -1.0) if t <= 0.5 else fma(-2.0, e, 1.0)

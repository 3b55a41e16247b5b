"""Colours of previews: sRGB encoding, two colour ramps, one colour a status, hashed ids.

Colours kept for messages: LOUD (a value that must not be there) is in no ramp and no palette;
BLANK (nothing to show here) and OPEN (no back face) are in no ramp. PNG bytes are outside the
determinism promise, so NumPy's own `power` serves.
"""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from ..buffers import STATUS_OF_END, End, Status
from ..typed import AnyArray, BoolArray, F64Array, U8Array
from ..vecmath import srgb

Rgb8 = tuple[int, int, int]
"""sRGB bytes."""

LOUD: Rgb8 = (255, 0, 255)
"""A value that must not be there: NaN, infinite, out of its range, an unknown number."""
BLANK: Rgb8 = (0, 84, 84)
"""Nothing to show at this pixel; its hue is in neither ramp."""
OPEN: Rgb8 = (84, 134, 190)
"""A surface without a back face."""

_BLOCK = 1 << 17
"""Elements encoded at a time: temporaries stay in the CPU's cache."""

# Chosen by a search from hand-picked colours: CIELAB distance of any two ≥ 27 with normal sight
# and ≥ 14 with simulated protanopia, deuteranopia and tritanopia (Machado 2009), LOUD included.
STATUS_COLORS = MappingProxyType(
    {
        Status.NOT_COMPUTED: (0, 0, 0),
        Status.HIT: (3, 184, 124),
        Status.BACKGROUND: (45, 54, 76),
        Status.NOT_REFLECTIVE: (108, 108, 108),
        Status.INVALID_INPUT: (179, 17, 51),
        Status.BELOW_SURFACE: (95, 53, 3),
        Status.BLOCKED: (255, 159, 38),
        Status.BACK_FACE: (105, 46, 147),
        Status.PASSED_BEHIND: (250, 230, 65),
        Status.SELF: (254, 98, 84),
        Status.LEFT_SCREEN_L: (15, 60, 190),
        Status.LEFT_SCREEN_R: (104, 194, 255),
        Status.LEFT_SCREEN_T: (4, 111, 151),
        Status.LEFT_SCREEN_B: (142, 130, 210),
        Status.BEHIND_CAMERA: (245, 245, 245),
        Status.MAX_DISTANCE: (245, 180, 200),
        Status.OUT_OF_STEPS: (116, 147, 0),
    }
)
END_COLORS = MappingProxyType(
    {end: STATUS_COLORS[Status(end + STATUS_OF_END) if end else Status.NOT_COMPUTED] for end in End}
)
"""An end has the colour of the status of the same name; NONE is black."""

# Equal steps of CIELAB lightness from 14 to 96 while the hue turns from blue over red to yellow.
_HEAT_POINTS: tuple[Rgb8, ...] = (
    (14, 33, 78),
    (60, 36, 102),
    (111, 26, 114),
    (156, 2, 109),
    (191, 2, 103),
    (224, 13, 93),
    (244, 59, 80),
    (255, 97, 70),
    (255, 134, 73),
    (255, 166, 84),
    (255, 194, 101),
    (254, 221, 126),
    (254, 246, 167),
)

# Three steps of lightness to either side of black.
_DIVERGING_POINTS: tuple[Rgb8, ...] = (
    (190, 228, 255),
    (92, 168, 250),
    (38, 92, 200),
    (22, 22, 26),
    (186, 74, 12),
    (250, 150, 50),
    (255, 226, 170),
)


def _ramp(points: tuple[Rgb8, ...]) -> U8Array:
    """(256, 3) sRGB bytes, linear between equally spaced control points; read-only."""
    at = np.linspace(0.0, len(points) - 1.0, 256)
    channels = [np.interp(at, np.arange(len(points)), channel) for channel in zip(*points)]
    table = to_bytes(np.stack(channels, axis=-1) / 255.0)
    table.setflags(write=False)
    return table


def to_bytes(share: AnyArray) -> U8Array:
    """Nearest byte to 255 · share, halves up, clipped to 0 and 255; NaN becomes 0."""
    with np.errstate(invalid="ignore"):
        scaled = np.clip(share, 0.0, 1.0) * 255.0 + 0.5
        out: U8Array = np.where(scaled >= 0.0, scaled, 0.0).astype(np.uint8)
    return out


HEAT = _ramp(_HEAT_POINTS)
"""Dark blue, red, yellow: lightness rises evenly, so more is always lighter."""
DIVERGING = _ramp(_DIVERGING_POINTS)
"""Blue below 0, black in the middle, orange above: lighter is further from 0."""
GREY = _ramp(((0, 0, 0), (255, 255, 255)))
"""Byte i is i: for shares (0 to 1) and depths."""


def srgb_encode(linear: AnyArray) -> F64Array:
    """sRGB-encoded values 0 to 1 of linear ones, clipped to [0, 1]; NaN stays.

    The formula of `vecmath/srgb.py` with NumPy's power, which is many times as fast on an image.
    """
    x = np.clip(np.asarray(linear, np.float64), 0.0, 1.0)
    curve = srgb.SCALE * np.power(x, 1.0 / srgb.EXPONENT) - srgb.OFFSET
    encoded: F64Array = np.where(x <= srgb.LINEAR_THRESHOLD, srgb.SLOPE * x, curve)
    return encoded


def srgb_bytes(linear: AnyArray) -> U8Array:
    """(H, W, 3) sRGB bytes of linear RGB; a pixel with a non-finite channel is LOUD."""
    image = np.asarray(linear)
    out = np.empty(image.shape, np.uint8)
    rows = max(1, _BLOCK // max(1, 3 * image.shape[1]))
    for top in range(0, image.shape[0], rows):
        block = image[top : top + rows]
        encoded = to_bytes(srgb_encode(block))
        encoded[~finite_pixels(block)] = LOUD
        out[top : top + rows] = encoded
    return out


def finite_pixels(image: AnyArray) -> BoolArray:
    """(H, W) whether every channel of an (H, W, C) image is finite."""
    finite = np.isfinite(image)
    out: BoolArray = finite[..., 0].copy()
    for channel in range(1, finite.shape[-1]):
        out &= finite[..., channel]
    return out


def number_table(colors: dict[int, Rgb8]) -> U8Array:
    """(256, 3) sRGB bytes for a uint8 image of numbers; numbers without a colour are LOUD."""
    table = np.full((256, 3), LOUD, np.uint8)
    for number, color in colors.items():
        table[number] = color
    return table


def id_colors(ids: AnyArray) -> U8Array:
    """(..., 3) a colour for each id, black below 0. Neighbouring ids differ strongly.

    Hue from Fibonacci hashing (id · 2³²/φ), which spreads any run of ids evenly around the circle;
    one of four lightnesses from other bits of the same product.
    """
    with np.errstate(over="ignore"):  # wraps on purpose; NumPy warns for a single number only
        mixed = (np.asarray(ids).astype(np.uint32) + np.uint32(1)) * np.uint32(2654435769)
    index = ((mixed >> np.uint32(24)) << np.uint32(2)) | ((mixed >> np.uint32(9)) & np.uint32(3))
    out: U8Array = np.take(_ID_TABLE, np.where(np.asarray(ids) < 0, 1024, index), axis=0)
    return out


def _id_table() -> U8Array:
    """256 hues, none near LOUD's 5/6, times 4 lightnesses; then black."""
    hue = 0.89 + 0.89 * np.arange(256)[:, None, None] / 256.0
    level = np.array([1.0, 0.8, 0.6, 0.9])[None, :, None]
    grey = np.array([0.15, 0.0, 0.1, 0.45])[None, :, None]
    # A hue's RGB as three shifted triangle waves.
    wave = np.clip(np.abs((hue + np.array([0.0, 2.0, 1.0]) / 3.0) % 1.0 * 6.0 - 3.0) - 1.0, 0, 1)
    table = to_bytes(level * (grey + (1.0 - grey) * wave)).reshape(1024, 3)
    table = np.concatenate([table, np.zeros((1, 3), np.uint8)])
    table.setflags(write=False)
    return table


_ID_TABLE = _id_table()

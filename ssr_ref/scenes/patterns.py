"""Images of the scene `textured`, made with whole numbers: the same texels everywhere.

Row 0 is the top of the picture. Colours are sRGB codes, alpha is opaque unless said otherwise.
"""

from __future__ import annotations

import numpy as np

from ..typed import AnyArray, I64Array

Rgb8 = tuple[int, int, int]


def paving() -> AnyArray:
    """(64, 64, 4) uint8: two by two flagstones, light and dark, with joints; it repeats."""
    x, y = _texels(64, 64)
    dark = (x // 32 + y // 32) % 2
    stone = np.where(dark[..., None] == 1, (92, 100, 104), (196, 188, 170))
    joint = (x % 32 == 0) | (y % 32 == 0)
    stone = stone + (_hash(x, y) % 17 - 8)[..., None]
    return _opaque(np.where(joint[..., None], (70, 66, 62), stone))


def bricks() -> AnyArray:
    """(64, 64, 4) uint16: four courses of bricks, every other one shifted by half; it repeats."""
    x, y = _texels(64, 64)
    course = y // 16
    shifted = (x + 16 * (course % 2)) % 64
    joint = (y % 16 < 2) | (shifted % 32 < 2)
    tone = (_hash(shifted // 32 + 2 * (course % 2), course) % 5 - 2) * 2200
    grain = _hash(x, y) % 3001 - 1500
    brick = np.array((38500, 18500, 13500)) + (tone + grain)[..., None]
    mortar = np.array((43000, 41000, 38000)) + grain[..., None]
    return _opaque(np.where(joint[..., None], mortar, brick), np.uint16)


def tile() -> AnyArray:
    """(32, 32, 4) uint8: a quarter of an ornament; mirrored both ways it closes to a rosette."""
    x, y = _texels(32, 32)
    blue, light, gold = (24, 62, 140), (232, 234, 226), (222, 164, 44)
    from_corner = x * x + y * y
    colors = _fill(from_corner, light)
    colors[(from_corner > 22 * 22) & (from_corner < 27 * 27)] = blue
    # A petal along the diagonal: where two circles about the other corners overlap.
    petal = (x - 22) * (x - 22) + y * y < 22 * 22
    petal &= x * x + (y - 22) * (y - 22) < 22 * 22
    colors[petal] = blue
    colors[from_corner < 7 * 7] = gold
    colors[(31 - x) * (31 - x) + (31 - y) * (31 - y) < 8 * 8] = gold
    return _opaque(colors)


def painting() -> AnyArray:
    """(96, 128, 4) uint8: sun, hills and sea with a cream border that clamping continues."""
    x, y = _texels(128, 96)
    colors = np.stack([250 - y, 190 - y, 120 + y // 2], axis=2)
    colors[(x - 88) * (x - 88) + (y - 32) * (y - 32) < 14 * 14] = (255, 240, 170)
    # Two hills, parabolas, before them the sea.
    colors[y * 120 > 120 * 68 - x * (120 - x)] = (96, 84, 150)
    colors[y * 200 > 200 * 72 - (x - 48) * (140 - x)] = (52, 104, 74)
    sea = y > 72
    colors[sea] = np.stack([40 + y // 2, 18 + y, 150 + y // 2], axis=2)[sea]
    border = (x < 6) | (x > 121) | (y < 6) | (y > 89)
    colors[border] = (238, 228, 204)
    return _opaque(colors)


def lantern() -> AnyArray:
    """(32, 32, 4) uint8: glowing paper behind a dark lattice, for emission."""
    x, y = _texels(32, 32)
    lattice = (x % 10 < 2) | (y % 15 < 2)
    rim = np.abs(2 * x - 31) + np.abs(2 * y - 31)
    glow = np.stack([255 - rim, 190 - 2 * rim, 90 - rim], axis=2)
    return _opaque(np.where(lattice[..., None], (22, 10, 4), glow))


def frond() -> AnyArray:
    """(128, 64, 4) uint8: a fern's leaf, tip up; alpha 0 outside, hue alike on both sides of it."""
    x, y = _texels(64, 128)
    across = np.abs(2 * x - 63)
    # The outline: a parabola in y, 60 half texels at its widest.
    outline = 60 * y * (255 - y) // (128 * 127)
    leaflet = (y + across // 3) % 16
    inside = (across < outline) & (leaflet < 10)
    rib = across <= 3
    green = np.stack([44 + 3 * leaflet, 118 + 4 * leaflet, 30 + 2 * leaflet], axis=2)
    green = green + (_hash(x, y) % 21 - 10)[..., None]
    colors = np.where(rib[..., None], (120, 160, 60), green)
    alpha = np.where(inside | (rib & (y > 4)), 255, 0)
    return np.concatenate([np.clip(colors, 0, 255), alpha[..., None]], axis=2).astype(np.uint8)


PADS = ((52, 84, 12), (76, 72, 7), (178, 78, 13), (204, 64, 8), (160, 96, 7), (120, 44, 6))
"""Lily pads of the pool: centre and radius in texels."""


def pool() -> tuple[AnyArray, AnyArray]:
    """Base colour and metallic-roughness, (128, 256, 4) uint8 each: water with lily pads.

    Water is smooth metal (a mirror), pads are rough and not metallic: green is roughness, blue is
    metallic, both linear.
    """
    x, y = _texels(256, 128)
    colors = _fill(x, (238, 242, 246))
    pad = np.zeros(x.shape, bool)
    for cx, cy, r in PADS:
        dx, dy = x - cx, y - cy
        notch = (dx > 0) & (3 * np.abs(dy) < dx)
        one = (dx * dx + dy * dy < r * r) & ~notch
        colors[one] = (64, 132, 52)
        colors[one & (dx * dx + dy * dy > (r - 2) * (r - 2))] = (112, 160, 70)
        pad |= one
    linear = np.stack([x * 0, np.where(pad, 230, 0), np.where(pad, 0, 255)], axis=2)
    return _opaque(colors), _opaque(linear)


def _texels(width: int, height: int) -> tuple[I64Array, I64Array]:
    """Column and row of every texel, (H, W) each."""
    y, x = np.mgrid[0:height, 0:width].astype(np.int64)
    return x, y


def _fill(like: I64Array, color: Rgb8) -> I64Array:
    """One colour everywhere, (H, W, 3)."""
    return np.tile(np.array(color, np.int64), (*like.shape, 1))


def _hash(x: I64Array, y: I64Array) -> I64Array:
    """A number from 0 to 65535 for each pair of small non-negative whole numbers.

    Two odd multipliers, one xor-shift, one more multiplication, all modulo 2³².
    """
    h = (x * 374761393 + y * 668265263) & 0xFFFFFFFF
    h = ((h ^ (h >> 13)) * 1274126177) & 0xFFFFFFFF
    return h >> 16


def _opaque(colors: AnyArray, dtype: type = np.uint8) -> AnyArray:
    """(H, W, 3) codes clipped to the type's range, with full alpha: (H, W, 4)."""
    top = np.iinfo(dtype).max
    alpha = np.full((*colors.shape[:2], 1), top)
    return np.concatenate([np.clip(colors, 0, top), alpha], axis=2).astype(dtype)

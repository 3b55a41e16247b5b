"""Wrong pixels, each charged to the first thing that went wrong with it.

A hit is *wrong* against the truth if one has a hit and the other none, if it shows another object,
or if it is more than 1 px from X. A colour is wrong if the hit is right and what is shown is not
the texel that was hit.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from ..buffers import GBuffer, HitBuffer, Status, Truth, TruthClass
from ..typed import BoolArray, F64Array, I32Array, U8Array
from .screen import finite, hit_texels

RIGHT_PX = 1.0
"""A hit further than this from X is wrong."""
COLOR_STEP = 2.0**-8
"""A colour that differs by more than this share of the larger value is wrong: a step of 8 bits."""


class Charge(IntEnum):
    """What a pixel is charged to. COMPENSATED and BY_CHANCE are right for the wrong reason."""

    NOT_COUNTED = 0
    RIGHT = 1
    INFORMATION = 2  # wrong, and the truth is not on screen
    DEPTH_MODEL = 3  # wrong, and so is the oracle
    TRAVERSAL = 4  # wrong, the oracle is right
    SHADING = 5  # the hit is right, the colour is not
    COMPENSATED = 6  # the oracle is wrong, the method is right
    BY_CHANCE = 7  # a right hit on a truth that the camera does not see


def charges(
    gbuffer: GBuffer,
    truth: Truth,
    oracle: HitBuffer,
    hits: HitBuffer,
    looked: F64Array,
    shown: F64Array,
    counted: BoolArray,
) -> U8Array:
    """(H, W) uint8 `Charge`.

    looked, shown (H, W, 3): M and A, the texel that was hit and the method's own value.
    """
    unknowable = truth.truth > TruthClass.NOTHING
    unknowable &= truth.truth != TruthClass.VISIBLE
    method_wrong = wrong_hits(gbuffer, truth, hits)
    oracle_wrong = wrong_hits(gbuffer, truth, oracle)
    with np.errstate(invalid="ignore"):
        off = np.abs(shown - looked) > COLOR_STEP * np.maximum(np.abs(shown), np.abs(looked))
    color_wrong = off.any(axis=2)

    # The first that applies.
    out = np.full(truth.truth.shape, Charge.RIGHT, np.uint8)
    out[color_wrong] = Charge.SHADING
    out[method_wrong] = Charge.TRAVERSAL
    out[oracle_wrong] = np.where(method_wrong, Charge.DEPTH_MODEL, Charge.COMPENSATED)[oracle_wrong]
    out[unknowable] = np.where(method_wrong, Charge.INFORMATION, Charge.BY_CHANCE)[unknowable]
    out[~counted] = Charge.NOT_COUNTED
    return out


def wrong_hits(gbuffer: GBuffer, truth: Truth, hits: HitBuffer) -> BoolArray:
    """(H, W): hit or miss differs from the truth, another object, or more than 1 px from X."""
    hit, exists = hits.status == Status.HIT, truth.truth > TruthClass.NOTHING
    wrong = ~(pixel_distances(hits, truth) <= RIGHT_PX)  # also without a place
    shown = hit_objects(gbuffer, hits)
    if shown is not None:
        wrong |= shown != truth.object_id
    out: BoolArray = (hit != exists) | (hit & exists & wrong)
    return out


def pixel_distances(hits: HitBuffer, truth: Truth) -> F64Array:
    """(H, W) pixels between hit and X; NaN where either has no place."""
    off = hits.hit_px - truth.hit_px
    return np.sqrt(off[..., 0] * off[..., 0] + off[..., 1] * off[..., 1])


def hit_objects(gbuffer: GBuffer, hits: HitBuffer) -> I32Array | None:
    """(H, W) object that a hit shows, −1 without a place; None for a G-buffer without objects."""
    if gbuffer.object_id is None:
        return None
    y, x = hit_texels(hits)
    placed = (hits.status == Status.HIT) & finite(hits.hit_px)
    out: I32Array = np.where(placed, gbuffer.object_id[y, x], np.int32(-1))
    return out

"""How far a tracer's hits are from the closed form: one definition for every tracer.

Every ray has a closed-form first hit X and a class (`reflections`). V are the rays whose X is on
screen and is the surface that the camera sees there (VISIBLE). A tracer could find all of V and
nothing else. Distances are Euclidean, between `hit_px` and the exact sub-pixel position of X.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..buffers import GBuffer, HitBuffer, Status, TruthClass
from ..typed import BoolArray, F64Array, I64Array
from .reflections import AnalyticReflections

FAR_PX = 2.0
"""A hit further than this from the closed form's position is on something else."""


@dataclass(frozen=True, slots=True)
class HitErrors:
    """Shares from 0 to 1, distances in pixels; NaN where there is nothing to take a share of.

    rays: reflective pixels. visible: the number of V. self_hits: hits on the own convex shape.
    missed: of V, without a hit. wrong: of V, with a hit more than 2 px away.
    false: of all rays, a hit although X is not VISIBLE or absent, and more than 2 px from X.
    unseen: of all rays, a hit within 2 px of an X that is not VISIBLE: right by chance.
    p50, p95: distance over V with a hit.
    """

    rays: int
    visible: int
    self_hits: int
    missed: float
    wrong: float
    false: float
    unseen: float
    p50: float
    p95: float


def hit_errors(hits: HitBuffer, truth: AnalyticReflections, gbuffer: GBuffer) -> HitErrors:
    """The errors of a trace of `gbuffer` against the closed form of the same image.

    gbuffer: needs object_id, for self-hits.
    """
    ray = truth.truth != TruthClass.NO_RAY
    known = truth.truth == TruthClass.VISIBLE
    hit = (hits.status == Status.HIT) & ray
    distance = distances(hits, truth)
    near = distance <= FAR_PX  # False where the closed form has no position
    with_hit = distance[known & hit]
    p50, p95 = np.quantile(with_hit, (0.5, 0.95)) if len(with_hit) else (np.nan, np.nan)
    return HitErrors(
        rays=int(ray.sum()),
        visible=int(known.sum()),
        self_hits=int((self_hits(hits, truth, gbuffer) & ray).sum()),
        missed=_share(known & ~hit, known),
        wrong=_share(known & hit & ~near, known),
        false=_share(hit & ~known & ~near, ray),
        unseen=_share(hit & ~known & near, ray),
        p50=float(p50),
        p95=float(p95),
    )


def distances(hits: HitBuffer, truth: AnalyticReflections) -> F64Array:
    """(H, W) pixels between hit and closed form; NaN where either has no position."""
    off = hits.hit_px - truth.hit_px
    return np.sqrt(off[..., 0] * off[..., 0] + off[..., 1] * off[..., 1])


def self_hits(hits: HitBuffer, truth: AnalyticReflections, gbuffer: GBuffer) -> BoolArray:
    """(H, W): a hit at a pixel that shows the shape whose outside the ray leaves.

    Shapes are convex: it never meets that shape again. The pixel is that of hit_px, whose colour is
    shown: a tracer that tests one pixel and reports a position in its neighbour is counted too.
    """
    assert gbuffer.object_id is not None
    own = gbuffer.object_id
    hit = (hits.status == Status.HIT) & truth.leaves_front
    height, width = own.shape
    px = np.where(hit[..., None], hits.hit_px, 0.0)
    x = np.clip(np.floor(px[..., 0]).astype(np.int64), 0, width - 1)
    y = np.clip(np.floor(px[..., 1]).astype(np.int64), 0, height - 1)
    found: BoolArray = hit & (own[y, x] == own)
    return found


def contact_gaps(
    hits: HitBuffer,
    truth: AnalyticReflections,
    gbuffer: GBuffer,
    *,
    floor: int,
    shape: int,
    stride: int = 1,
) -> I64Array:
    """(W,) pixels of the gap between an object and its reflection; −1 for a column without either.

    A column is walked down from the object's lowest pixel. Of the floor pixels whose X is VISIBLE
    and on the object, those are counted that come before the first with a hit within 1 + stride px
    of X. floor, shape: object ids.
    """
    assert gbuffer.object_id is not None
    good = (hits.status == Status.HIT) & (distances(hits, truth) <= 1.0 + stride)
    shows = (truth.truth == TruthClass.VISIBLE) & (truth.shape_id == shape)
    shows &= gbuffer.object_id == floor
    height, width = good.shape
    gaps = np.full(width, -1, np.int64)
    for x in range(width):
        rows = np.flatnonzero(gbuffer.object_id[:, x] == shape)
        if not len(rows):
            continue
        below = np.arange(rows[-1] + 1, height)
        column = good[below[shows[below, x]], x]
        if len(column):
            gaps[x] = column.argmax() if column.any() else len(column)
    return gaps


def _share(of: BoolArray, all_of: BoolArray) -> float:
    total = int(all_of.sum())
    return int(of.sum()) / total if total else float("nan")

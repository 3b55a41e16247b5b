"""How wrong a traced reflection is, against ray-traced truth: what `bench` puts beside a time.

A ray is *right* where the camera sees its truth X (VISIBLE) and the hit is on X's object and at
most 1 px from it, or where the camera does not see X and there is no hit. All others are wrong.
Colours are compared with the truth itself, so what the screen cannot know counts: `knowable` is the
same judgement of an image that has the truth's colour wherever it is on screen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..blame.charges import hit_objects, pixel_distances
from ..blame.screen import (
    RELATIVE_FLOOR,
    fallback_of,
    finite,
    knowable_reflection,
    true_reflection,
)
from ..buffers import GBuffer, HitBuffer, Resolved, Status, Truth, TruthClass
from ..maths.codes import srgb_encode
from ..settings import Settings
from ..typed import BoolArray, F64Array

RIGHT_PX = 1.0
"""A hit further than this from X is wrong."""


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """Sums over pixels, so that several images can be pooled; the properties are shares and means.

    rays: pixels with a truth ray. visible: of them VISIBLE. hits: of them hit. right_hits: VISIBLE
    and right. wrong_rays: see the module. distances: px between hit and X, sorted, over VISIBLE
    rays with a hit on X's object. squares: sum of the relative squared error, channels averaged;
    flips: sum of FLIP, NaN without it; non_finite: pixels left out of both.
    """

    rays: int
    visible: int
    hits: int
    right_hits: int
    wrong_rays: int
    distances: F64Array
    squares: float
    flips: float
    non_finite: int

    @property
    def wrong(self) -> float:
        """Share of rays that are missed or wrong."""
        return _ratio(self.wrong_rays, self.rays)

    @property
    def recall(self) -> float:
        """Right hits of all that the camera sees."""
        return _ratio(self.right_hits, self.visible)

    @property
    def precision(self) -> float:
        """Right hits of all hits."""
        return _ratio(self.right_hits, self.hits)

    @property
    def p50(self) -> float:
        """Median distance in pixels."""
        return float(np.quantile(self.distances, 0.5)) if len(self.distances) else np.nan

    @property
    def p95(self) -> float:
        """95th percentile of the distance in pixels."""
        return float(np.quantile(self.distances, 0.95)) if len(self.distances) else np.nan

    @property
    def rel_mse(self) -> float:
        """Mean of (A − T)²/(T² + 0.01) over pixels with a ray."""
        return _ratio(self.squares, self.rays - self.non_finite)

    @property
    def flip(self) -> float:
        """Mean FLIP (Andersson et al., HPG 2020) over pixels with a ray; NaN: not known."""
        return _ratio(self.flips, self.rays - self.non_finite)

    def to_json(self) -> dict[str, Any]:
        """Counts, shares and means; NaN as None."""
        values: dict[str, Any] = {
            name: getattr(self, name)
            for name in ("rays", "visible", "hits", "right_hits", "wrong_rays", "non_finite")
        }
        for name in ("wrong", "recall", "precision", "p50", "p95", "rel_mse", "flip"):
            value = getattr(self, name)
            values[name] = None if np.isnan(value) else value
        return values


def judge(
    traced: tuple[HitBuffer, Resolved] | None,
    truth: Truth,
    gbuffer: GBuffer,
    settings: Settings,
    *,
    flip: bool,
) -> Judged:
    """Judge what a method made of a G-buffer; None: the best that the screen allows.

    flip: also FLIP, if its package is installed.
    """
    fallback = fallback_of(settings)
    ray = truth.truth != TruthClass.NO_RAY
    visible = truth.truth == TruthClass.VISIBLE
    expected = true_reflection(truth, fallback)
    if traced is None:
        hit = right = visible
        distances = np.zeros(int(visible.sum()))
        shown = knowable_reflection(truth, fallback)
    else:
        hits, resolved = traced
        hit = ray & (hits.status == Status.HIT)
        distance = pixel_distances(hits, truth)
        shows = hit_objects(gbuffer, hits)
        assert shows is not None
        same = hit & visible & (shows == truth.object_id)
        right = same & (distance <= RIGHT_PX)
        distances = np.sort(distance[same])
        shown = resolved.reflection.astype(np.float64)
    wrong = (visible & ~right) | (ray & ~visible & hit)
    known = ray & finite(shown) & finite(expected)
    error = shown[known] - expected[known]
    squares = (error * error / (expected[known] * expected[known] + RELATIVE_FLOOR)).mean(axis=1)
    return Judged(
        rays=int(ray.sum()),
        visible=int(visible.sum()),
        hits=int(hit.sum()),
        right_hits=int(right.sum()),
        wrong_rays=int(wrong.sum()),
        distances=distances,
        squares=float(squares.sum()),
        flips=flip_sum(expected, shown, known) if flip else np.nan,
        non_finite=int((ray & ~known).sum()),
    )


def flip_sum(expected: F64Array, shown: F64Array, where: BoolArray) -> float:
    """Sum of LDR-FLIP over pixels, at its default of 67 pixels a degree; NaN without the package.

    Both images are sRGB-encoded and clipped; pixels outside `where` are black in both.
    """
    try:
        import flip_evaluator
    except ImportError:
        return np.nan
    images = [
        np.clip(srgb_encode(np.where(where[..., None], image, 0.0)), 0.0, 1.0).astype(np.float32)
        for image in (expected, shown)
    ]
    errors, _, _ = flip_evaluator.evaluate(*images, "LDR", applyMagma=False)
    return float(np.asarray(errors, np.float64).reshape(where.shape)[where].sum())


def pooled(parts: Sequence[Judged]) -> Judged:
    """One judgement over the pixels of several images."""
    sums = {name: sum(getattr(part, name) for part in parts) for name in _SUMS}
    return Judged(**sums, distances=np.sort(np.concatenate([part.distances for part in parts])))


_SUMS = (
    "rays", "visible", "hits", "right_hits", "wrong_rays", "squares", "flips", "non_finite",
)  # fmt: skip


def _ratio(part: float, whole: int) -> float:
    return part / whole if whole else np.nan

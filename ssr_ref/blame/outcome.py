"""How a trace ended against what the truth is: tables, distances, and one number for the colour.

V are the rays whose X is VISIBLE: a screen-space tracer could find all of V and nothing else. The
positive class of precision and recall is V: recall of VISIBLE. Distances, depths and objects are
compared on *common* rays: in V and hit.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from ..buffers import Side, Status, Truth, TruthClass
from ..typed import AnyArray, BoolArray, F64Array, I64Array, U8Array
from .charges import hit_objects, pixel_distances
from .parts import check_size
from .screen import TotalError, fallback_of, finite, or_none, total_error

if TYPE_CHECKING:
    from ..pipeline import Frame


@dataclass(frozen=True, slots=True)
class Spread:
    """Values of an image in short. NaN and None where there are none.

    count: finite values. non_finite: those left out of all others. worst: pixel (x, y) of most, the
    first in rows.
    """

    count: int
    non_finite: int
    median: float
    p95: float
    most: float
    worst: tuple[int, int] | None

    def to_json(self) -> dict[str, Any]:
        """A dictionary of JSON values; NaN as None."""
        return {
            "count": self.count,
            "non_finite": self.non_finite,
            "median": or_none(self.median),
            "p95": or_none(self.p95),
            "most": or_none(self.most),
            "worst": None if self.worst is None else list(self.worst),
        }


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """A trace against the truth.

    status_by_class (statuses, classes) int64: pixels by `Status` and `TruthClass`, both by number.
    status_by_side (statuses, sides): the OFF_SCREEN ones by `Side`.
    rays: pixels with a truth ray. visible: |V|. hits: rays that hit. common: in V and hit.
    precision: common/hits. recall: common/visible. f1: their harmonic mean; NaN for 0/0.
    distance: px from X on common rays. depth_error: |hit depth − X's|/X's on them. wrong_object:
    share of them that show another object (hits without a place left out); NaN for a G-buffer
    without objects.
    error: of the reflection's colour.
    """

    status_by_class: I64Array
    status_by_side: I64Array
    rays: int
    visible: int
    hits: int
    common: int
    precision: float
    recall: float
    f1: float
    distance: Spread
    depth_error: Spread
    wrong_object: float
    error: TotalError

    def to_json(self) -> dict[str, Any]:
        """A dictionary of JSON values, every status and class by name; NaN as None."""
        return {
            "status_by_class": _table(self.status_by_class, TruthClass),
            "status_by_side": _table(self.status_by_side, Side),
            "rays": self.rays,
            "visible": self.visible,
            "hits": self.hits,
            "common": self.common,
            "precision": or_none(self.precision),
            "recall": or_none(self.recall),
            "f1": or_none(self.f1),
            "distance": self.distance.to_json(),
            "depth_error": self.depth_error.to_json(),
            "wrong_object": or_none(self.wrong_object),
            "error": self.error.to_json(),
        }


def outcome(frame: Frame, truth: Truth, *, fallback: AnyArray | None = None) -> Outcome:
    """Tables and measures of a frame. No trace.

    fallback (3,) or (H, W, 3): F; None: of the settings.
    Raises SettingsError for a truth of another size.
    """
    check_size(frame, truth)
    hits = frame.hits
    rays = truth.truth != TruthClass.NO_RAY
    visible = truth.truth == TruthClass.VISIBLE
    hit = rays & (hits.status == Status.HIT)
    common = visible & hit
    found, seen, all_hits = int(common.sum()), int(visible.sum()), int(hit.sum())
    shown = hit_objects(frame.gbuffer, hits)
    other = np.nan
    if shown is not None:
        placed = common & finite(hits.hit_px)
        other = ratio(int((placed & (shown != truth.object_id)).sum()), int(placed.sum()))
    with np.errstate(invalid="ignore"):
        deeper = np.abs(hits.hit_depth - truth.hit_depth) / truth.hit_depth
    f = fallback_of(frame.settings) if fallback is None else np.asarray(fallback, np.float64)
    off_screen = truth.truth == TruthClass.OFF_SCREEN
    every = np.ones_like(rays)
    return Outcome(
        status_by_class=_count(hits.status, truth.truth, TruthClass, every),
        status_by_side=_count(hits.status, truth.side, Side, off_screen),
        rays=int(rays.sum()),
        visible=seen,
        hits=all_hits,
        common=found,
        precision=ratio(found, all_hits),
        recall=ratio(found, seen),
        f1=ratio(2 * found, seen + all_hits),
        distance=spread(pixel_distances(hits, truth), common),
        depth_error=spread(deeper, common),
        wrong_object=other,
        error=total_error(truth, frame.resolved.reflection, f),
    )


def spread(image: F64Array, where: BoolArray) -> Spread:
    """`Spread` of the pixels of an image (H, W) that `where` picks."""
    kept = where & np.isfinite(image)
    values = image[kept]
    left_out = int(where.sum()) - len(values)
    if not len(values):
        return Spread(0, left_out, np.nan, np.nan, np.nan, None)
    median, p95 = np.quantile(values, (0.5, 0.95))
    y, x = divmod(int(np.argmax(np.where(kept, image, -np.inf))), image.shape[1])
    return Spread(len(values), left_out, float(median), float(p95), float(values.max()), (x, y))


def ratio(part: int, whole: int) -> float:
    """part/whole; NaN for nothing to take a share of."""
    return part / whole if whole else np.nan


def _count(status: U8Array, number: U8Array, enum: type[IntEnum], where: BoolArray) -> I64Array:
    """Pixels by status and number; a number without a name is left out."""
    shape = len(Status), len(enum)
    known = where & (status < shape[0]) & (number < shape[1])
    flat = status[known].astype(np.int64) * shape[1] + number[known]
    return np.bincount(flat, minlength=shape[0] * shape[1]).reshape(shape).astype(np.int64)


def _table(counts: I64Array, enum: type[IntEnum]) -> dict[str, dict[str, int]]:
    return {
        status.name: {column.name: int(counts[status, column]) for column in enum}
        for status in Status
    }

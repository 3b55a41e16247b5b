"""What the screen shows where a ray ended, what the truth shows, and the error of an image.

All radiance here is what comes in along the reflected ray, before the surface's R and Fresnel:
float64, linear RGB. F is the fallback: what a pixel without a hit shows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..buffers import HitBuffer, Status, Truth, TruthClass
from ..errors import SettingsError
from ..settings import Settings
from ..typed import AnyArray, BoolArray, F64Array, I64Array

RELATIVE_FLOOR = 1e-2
"""Added to T² in relMSE, so that black pixels do not count without end."""


@dataclass(frozen=True, slots=True, eq=False)
class TotalError:
    """How far a reflection is from the truth, whatever method made it.

    error (H, W, 3) float64: A − T, 0 where not counted. counted (H, W): pixels with a truth ray and
    two finite colours. non_finite: pixels with a truth ray and a colour that is not.
    mean_square: of the error over counted pixels and channels. rel_mse: mean of
    (A − T)²/(T² + 0.01), alike. Both NaN where nothing is counted.
    """

    error: F64Array
    counted: BoolArray
    non_finite: int
    mean_square: float
    rel_mse: float

    def to_json(self) -> dict[str, Any]:
        """The numbers; NaN as None."""
        return {
            "counted": int(self.counted.sum()),
            "non_finite": self.non_finite,
            "mean_square": or_none(self.mean_square),
            "rel_mse": or_none(self.rel_mse),
        }


def total_error(
    truth: Truth, reflection: AnyArray, fallback: AnyArray, where: BoolArray | None = None
) -> TotalError:
    """The error of a reflection image, for methods that have no parts too (mirrors, cube maps).

    reflection (H, W, 3): incoming radiance, any float type. fallback (3,) or (H, W, 3): F.
    where (H, W): pixels to count; None: all with a truth ray.
    """
    expected = true_reflection(truth, fallback)
    shown = reflection.astype(np.float64)
    rays = np.asarray(truth.truth != TruthClass.NO_RAY)
    if where is not None:
        rays &= where
    counted = rays & finite(expected) & finite(shown)
    error = np.where(counted[..., None], shown - expected, 0.0)
    expected = np.where(counted[..., None], expected, 0.0)
    values = 3 * int(counted.sum())
    relative = error * error / (expected * expected + RELATIVE_FLOOR)
    return TotalError(
        error=error,
        counted=counted,
        non_finite=int((rays & ~counted).sum()),
        mean_square=total(error * error) / values if values else np.nan,
        rel_mse=total(relative) / values if values else np.nan,
    )


def true_reflection(truth: Truth, fallback: AnyArray) -> F64Array:
    """T (H, W, 3): the radiance of X, F where there is none."""
    met = (truth.truth > TruthClass.NOTHING)[..., None]
    out: F64Array = np.where(met, truth.radiance, fallback)
    return out


def knowable_reflection(truth: Truth, fallback: AnyArray) -> F64Array:
    """K (H, W, 3): T where X is VISIBLE or NOTHING, else F: the best that the screen allows."""
    known = (truth.truth == TruthClass.VISIBLE)[..., None]
    out: F64Array = np.where(known, truth.radiance, fallback)
    return out


def look(radiance: AnyArray, hits: HitBuffer, fallback: AnyArray) -> F64Array:
    """(H, W, 3) the texel at floor(hit_px), F where there is no hit; NaN at a hit without place."""
    hit = hits.status == Status.HIT
    y, x = hit_texels(hits)
    out: F64Array = np.where(hit[..., None], radiance[y, x].astype(np.float64), fallback)
    out[hit & ~finite(hits.hit_px)] = np.nan
    return out


def hit_texels(hits: HitBuffer) -> tuple[I64Array, I64Array]:
    """Row and column (H, W) of the texel that a hit shows, clamped to the image; 0 elsewhere."""
    height, width = hits.status.shape
    known = (hits.status == Status.HIT) & finite(hits.hit_px)
    px = np.floor(np.where(known[..., None], hits.hit_px, 0.0))
    x = np.clip(px[..., 0], 0, width - 1).astype(np.int64)
    y = np.clip(px[..., 1], 0, height - 1).astype(np.int64)
    return y, x


def fallback_of(settings: Settings) -> F64Array:
    """F (3,) of settings whose fallback is one colour; SettingsError for another."""
    if settings.fallback not in ("none", "constant"):
        raise SettingsError(
            f"fallback is '{settings.fallback}', which differs from pixel to pixel; expected its "
            "(H, W, 3) radiance in the argument `fallback`"
        )
    color = settings.fallback_color if settings.fallback == "constant" else (0.0, 0.0, 0.0)
    return np.array(color, np.float64)


def finite(image: AnyArray) -> BoolArray:
    """(H, W) whether every channel of an (H, W, C) image is finite."""
    return np.asarray(np.isfinite(image).all(axis=2))


def total(image: F64Array) -> float:
    """Sum of an image: each row from left to right, then the rows; the same on every machine."""
    if image.size == 0:
        return 0.0
    rows = np.cumsum(image.reshape(image.shape[0], -1), axis=1)[:, -1]
    return float(np.cumsum(rows)[-1])


def or_none(value: float) -> float | None:
    """A number for JSON, which has no NaN."""
    return None if np.isnan(value) else value

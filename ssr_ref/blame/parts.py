"""Error in four signed parts that add up: information, depth model, traversal, shading.

    A − T = (K − T) + (O − K) + (M − O) + (A − M)

Incoming radiance before R and Fresnel. T: the truth. K: the truth where the screen holds it. O: the
texel that exact cells hit on the same depth buffer (`oracle`). M: the texel that the method hit.
A: what the method shows (filter, fades, fallback). F, the fallback, stands for every miss.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..buffers import HitBuffer, Status, Truth, TruthClass
from ..errors import SettingsError
from ..typed import AnyArray, BoolArray, F64Array, U8Array
from .charges import Charge, charges
from .oracle import trace_oracle
from .screen import (
    fallback_of,
    finite,
    knowable_reflection,
    look,
    or_none,
    total,
    total_error,
    true_reflection,
)

if TYPE_CHECKING:
    from ..pipeline import Frame

PARTS = ("information", "depth_model", "traversal", "shading")
"""The parts in the order in which they add up; attributes of `Blame`."""
NO_RAY_ASKED = (Status.NOT_COMPUTED, Status.BACKGROUND, Status.NOT_REFLECTIVE)


@dataclass(frozen=True, slots=True)
class BlameTotals:
    """The parts in numbers.

    rays: pixels with a truth ray and a ray of the method. counted: of them with finite colours;
    non_finite: the others, left out everywhere. only_truth, only_method: pixels where one has a ray
    and the other none.
    mean_square: of A − T over counted pixels and channels. shares: of each part in it,
    ⟨part, A − T⟩/⟨A − T, A − T⟩: their sum is 1, all are 0 where A = T; one below 0 cancels others.
    charged: counted pixels by `Charge`.
    """

    rays: int
    counted: int
    non_finite: int
    only_truth: int
    only_method: int
    mean_square: float
    shares: dict[str, float]
    charged: dict[str, int]

    def to_json(self) -> dict[str, Any]:
        """A dictionary of JSON values; NaN as None."""
        return {
            "rays": self.rays,
            "counted": self.counted,
            "non_finite": self.non_finite,
            "only_truth": self.only_truth,
            "only_method": self.only_method,
            "mean_square": or_none(self.mean_square),
            "shares": {name: or_none(share) for name, share in self.shares.items()},
            "charged": dict(self.charged),
        }


@dataclass(frozen=True, slots=True, eq=False)
class Blame:
    """What each stage added to the error of every pixel.

    information, depth_model, traversal, shading, error (H, W, 3) float64: signed, linear RGB; error
    is A − T. All are 0 where a pixel is not counted. rays (H, W): pixels with a truth ray and a ray
    of the method. counted (H, W): of them with finite colours. charge (H, W) uint8: `Charge`.
    oracle: what exact cells found, to be handed to the next method on the same solids.
    """

    information: F64Array
    depth_model: F64Array
    traversal: F64Array
    shading: F64Array
    error: F64Array
    rays: BoolArray
    counted: BoolArray
    charge: U8Array
    oracle: HitBuffer
    totals: BlameTotals

    def arrays(self) -> dict[str, AnyArray]:
        """The images by name."""
        names = (*PARTS, "error", "rays", "counted", "charge")
        return {name: getattr(self, name) for name in names}


def blame(
    frame: Frame,
    truth: Truth,
    *,
    oracle: HitBuffer | None = None,
    fallback: AnyArray | None = None,
) -> Blame:
    """The four parts of a frame's error. Costs one trace by exact cells, or none with `oracle`.

    oracle: `Blame.oracle` of another method with the same G-buffer, surface model, thickness, bias,
    max_distance and rejections. fallback (3,) or (H, W, 3): F; None: of the settings.
    Raises SettingsError for a truth of another size.
    """
    check_size(frame, truth)
    gbuffer, hits = frame.gbuffer, frame.hits
    assert gbuffer.radiance is not None
    f = fallback_of(frame.settings) if fallback is None else np.asarray(fallback, np.float64)
    if oracle is None:
        oracle = trace_oracle(frame.camera.params(frame.settings.size), gbuffer, frame.settings)

    # The five colours of a pixel.
    true = true_reflection(truth, f)
    known = knowable_reflection(truth, f)
    of_oracle = look(gbuffer.radiance, oracle, f)
    of_method = look(gbuffer.radiance, hits, f)
    shown = frame.resolved.reflection.astype(np.float64)

    # Where they can be compared.
    asked = ~np.isin(hits.status, NO_RAY_ASKED)
    traced = truth.truth != TruthClass.NO_RAY
    rays = asked & traced
    counted = rays.copy()
    for color in (true, known, of_oracle, of_method, shown):
        counted &= finite(color)

    def step(after: F64Array, before: F64Array) -> F64Array:
        with np.errstate(invalid="ignore"):
            return np.where(counted[..., None], after - before, 0.0)

    parts = {
        "information": step(known, true),
        "depth_model": step(of_oracle, known),
        "traversal": step(of_method, of_oracle),
        "shading": step(shown, of_method),
    }
    whole = total_error(truth, shown, f, counted)
    charge = charges(gbuffer, truth, oracle, hits, of_method, shown, counted)
    return Blame(
        **parts,
        error=whole.error,
        rays=rays,
        counted=counted,
        charge=charge,
        oracle=oracle,
        totals=BlameTotals(
            rays=int(rays.sum()),
            counted=int(counted.sum()),
            non_finite=int((rays & ~counted).sum()),
            only_truth=int((traced & ~asked).sum()),
            only_method=int((asked & ~traced).sum()),
            mean_square=whole.mean_square,
            shares=shares(parts, whole.error),
            charged={c.name: int((charge == c).sum()) for c in Charge if c != Charge.NOT_COUNTED},
        ),
    )


def shares(parts: dict[str, F64Array], error: F64Array) -> dict[str, float]:
    """⟨part, error⟩/⟨error, error⟩ of every part; 0 where the error is 0 everywhere."""
    square = total(error * error)
    return {
        name: total(part * error) / square if square != 0.0 else 0.0 for name, part in parts.items()
    }


def check_size(frame: Frame, truth: Truth) -> None:
    """Raise SettingsError if the truth is not of the frame's size."""
    height, width = frame.hits.status.shape
    if truth.truth.shape != (height, width):
        raise SettingsError(
            f"the truth is {truth.truth.shape[1]}x{truth.truth.shape[0]}; expected the frame's "
            f"{width}x{height}: trace it for the same camera and size"
        )

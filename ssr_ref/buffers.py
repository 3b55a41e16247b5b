"""The images that stages hand to each other, and the numbers of statuses, ends and flags.

Images are C-contiguous, row 0 at the top. A buffer that nothing asked for is None.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from enum import IntEnum, IntFlag

from .typed import AnyArray, F64Array, FloatArray, I32Array, U8Array, U32Array


class Status(IntEnum):
    """Why a pixel's ray ended as it did. Numbers are fixed and never reused (docs/statuses.md)."""

    NOT_COMPUTED = 0
    HIT = 1
    BACKGROUND = 2
    NOT_REFLECTIVE = 3
    INVALID_INPUT = 4
    BELOW_SURFACE = 5
    BLOCKED = 6
    BACK_FACE = 7
    PASSED_BEHIND = 8
    SELF = 9
    LEFT_SCREEN_L = 10
    LEFT_SCREEN_R = 11
    LEFT_SCREEN_T = 12
    LEFT_SCREEN_B = 13
    BEHIND_CAMERA = 14
    MAX_DISTANCE = 15
    OUT_OF_STEPS = 16


class End(IntEnum):
    """The bound that ended a walk without a hit, in the order that decides ties."""

    NONE = 0
    LEFT_SCREEN_L = 1
    LEFT_SCREEN_R = 2
    LEFT_SCREEN_T = 3
    LEFT_SCREEN_B = 4
    BEHIND_CAMERA = 5
    MAX_DISTANCE = 6
    OUT_OF_STEPS = 7


class Flag(IntFlag):
    """What the tested samples met, as bits."""

    PASSED_BEHIND = 1
    SELF_REJECTED = 2
    BACK_FACE_REJECTED = 4
    OVER_EMPTY = 8
    OPEN = 16


STATUS_OF_END = Status.LEFT_SCREEN_L - End.LEFT_SCREEN_L
"""Added to an end's number, gives the status of the same name."""


@dataclass(frozen=True, slots=True, eq=False)
class RasterCounts:
    """What the rasterizer met and dropped or repaired, in triangles unless said."""

    triangles: int = 0
    drawn: int = 0
    outside: int = 0
    clipped: int = 0
    culled: int = 0
    zero_area: int = 0
    non_finite: int = 0
    clamped_depths: int = 0  # pixels whose plane depth left the clipped polygon's range
    repaired_normals: int = 0  # pixels whose shading normal was zero or not finite


@dataclass(frozen=True, slots=True, eq=False)
class GBuffer:
    """What the camera sees. Floats have one dtype, float32 unless asked for otherwise.

    depth (H, W): linear view depth in scene units, > 0, +inf where nothing was drawn.
    triangle_id, object_id, material_id (H, W) int32: −1 where nothing was drawn.
    back_depth (H, W): the nearest back face of the same object behind the front, +inf if none.
    geo_normal_vs (H, W, 3): unit, faces the eye. normal_vs (H, W, 3): unit shading normal.
    Both are 0 where nothing was drawn.
    albedo, reflectivity (H, W, 3): linear RGB. roughness (H, W). radiance (H, W, 3): linear RGB.
    thickness (H, W): of the solid behind the pixel, scene units, if each material has its own.
    """

    depth: FloatArray
    triangle_id: I32Array
    object_id: I32Array | None = None
    material_id: I32Array | None = None
    back_depth: FloatArray | None = None
    geo_normal_vs: FloatArray | None = None
    normal_vs: FloatArray | None = None
    albedo: FloatArray | None = None
    reflectivity: FloatArray | None = None
    roughness: FloatArray | None = None
    radiance: FloatArray | None = None
    thickness: FloatArray | None = None
    counts: RasterCounts = field(default_factory=RasterCounts)

    def arrays(self) -> dict[str, AnyArray]:
        """The buffers that exist, by name."""
        return _arrays(self)


@dataclass(frozen=True, slots=True, eq=False)
class HitBuffer:
    """What each pixel's reflected ray met. Lengths in scene units; NaN where there is no hit.

    status (H, W) uint8: `Status`. end (H, W) uint8: `End`. flags (H, W) uint8: bits of `Flag`.
    hit_px (H, W, 2) float64: sub-pixel position, x right and y down from the top left corner.
    hit_depth (H, W): view depth. residual (H, W): hit_depth − front, 0 to the thickness.
    length (H, W): distance along the ray from the surface.
    steps, fetches (H, W) uint32: samples tested; depth and back-depth reads.
    fade_px, fade_length: what the fades of a published listing are taken at instead of hit_px and
    length; fade_px may lie outside the image. Only with `Settings.listing`.
    sample_count (H, W) uint32: how often all rays tested each pixel; only if asked for.
    """

    status: U8Array
    end: U8Array
    flags: U8Array
    hit_px: F64Array
    hit_depth: F64Array
    residual: F64Array
    length: F64Array
    steps: U32Array
    fetches: U32Array
    fade_px: F64Array | None = None
    fade_length: F64Array | None = None
    sample_count: U32Array | None = None

    def arrays(self) -> dict[str, AnyArray]:
        """The buffers that exist, by name."""
        return _arrays(self)


@dataclass(frozen=True, slots=True, eq=False)
class Resolved:
    """The reflection's colour and how sure it is, float32, linear RGB.

    edge_fade, distance_fade, confidence (H, W): 0 to 1, 0 where there is no hit; with
    `Settings.listing` edge_fade and confidence may be below 0.
    steps_fade, facing_fade, residual_fade (H, W): so too; None where the fade is off. confidence is
    edge · distance · steps · facing · residual, multiplied in this order.
    reflection (H, W, 3): c·L_hit + (1 − c)·F, before the surface's R, 0 where no ray was asked for.
    composite (H, W, 3): L·(1 − R) + R·reflection.
    """

    edge_fade: FloatArray
    distance_fade: FloatArray
    confidence: FloatArray
    reflection: FloatArray
    composite: FloatArray
    steps_fade: FloatArray | None = None
    facing_fade: FloatArray | None = None
    residual_fade: FloatArray | None = None

    def arrays(self) -> dict[str, AnyArray]:
        """The buffers by name."""
        return _arrays(self)


class TruthClass(IntEnum):
    """What becomes of a pixel's reflected ray in truth, and whether the camera sees what it meets.

    The first that applies, in the order NOTHING, OFF_SCREEN, BACK_FACING, OCCLUDED, VISIBLE.
    """

    NO_RAY = 0
    NOTHING = 1
    OFF_SCREEN = 2
    BACK_FACING = 3
    OCCLUDED = 4
    VISIBLE = 5


class Side(IntEnum):
    """Where an OFF_SCREEN point lies; the first that applies."""

    NONE = 0
    BEHIND = 1  # before the near plane or behind the eye
    BEYOND = 2  # deeper than the far plane
    LEFT = 3
    RIGHT = 4
    TOP = 5
    BOTTOM = 6


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The first hit X of every reflective pixel's ray, by tracing the scene itself.

    truth (H, W) uint8: `TruthClass`. side (H, W) uint8: `Side`, of OFF_SCREEN alone.
    triangle_id, object_id (H, W) int32: what X lies on, numbered as in the G-buffer; −1 where there
    is none.
    distance (H, W) float64: along the ray, scene units. hit_px (H, W, 2) float64: sub-pixel
    position of X, also outside the image; NaN at and behind the eye. hit_depth (H, W) float64: its
    view depth, of either sign. All NaN where there is no X.
    radiance (H, W, 3) float64: diffuse radiance of X on the side that was met, linear RGB; NaN
    where there is no X.
    """

    truth: U8Array
    side: U8Array
    triangle_id: I32Array
    object_id: I32Array
    distance: F64Array
    hit_px: F64Array
    hit_depth: F64Array
    radiance: F64Array

    def arrays(self) -> dict[str, AnyArray]:
        """The buffers by name."""
        return _arrays(self)


def _arrays(buffers: GBuffer | HitBuffer | Resolved | Truth) -> dict[str, AnyArray]:
    named = {f.name: getattr(buffers, f.name) for f in fields(buffers) if f.name != "counts"}
    return {name: array for name, array in named.items() if array is not None}

"""The ambiguity mask: pixels whose answer hangs on less than two correct tracers need agree on.

Eight traces, each with one thing changed by an amount that says nothing about the scene: the ray's
start by 0.01 px, every depth but the ray's own by the last place, the thickness by 1 %. Where a
status changes or a hit moves by more than 1 px, another implementation may differ and be right.
"""

from __future__ import annotations

from dataclasses import replace
from enum import IntFlag
from typing import TYPE_CHECKING

import numpy as np

from ..buffers import GBuffer, HitBuffer, Status
from ..camera import ViewParams
from ..errors import SettingsError
from ..settings import Settings
from ..ssr.trace import prepare
from ..typed import AnyArray, BoolArray, FloatArray, U8Array
from .oracle import run

if TYPE_CHECKING:
    from ..pipeline import Frame

MOVE_PX = 0.01
"""How far the start of a ray is moved."""
SAME_PX = 1.0
"""A hit that moves further than this is another answer."""
THICKNESS = 0.01
"""Share by which the thickness is changed."""


class Rerun(IntFlag):
    """What a rerun changes; the bit that it sets where the answer changes with it."""

    START_LEFT = 1
    START_RIGHT = 2
    START_UP = 4
    START_DOWN = 8
    NEARER = 16
    FARTHER = 32
    THINNER = 64
    THICKER = 128


_MOVES = {
    Rerun.START_LEFT: (-MOVE_PX, 0.0),
    Rerun.START_RIGHT: (MOVE_PX, 0.0),
    Rerun.START_UP: (0.0, -MOVE_PX),
    Rerun.START_DOWN: (0.0, MOVE_PX),
}
_DEPTHS = {Rerun.NEARER: -1, Rerun.FARTHER: 1}
_THICKNESSES = {Rerun.THINNER: 1.0 - THICKNESS, Rerun.THICKER: 1.0 + THICKNESS}


def ambiguity(frame: Frame, *, quantum: AnyArray | None = None) -> U8Array:
    """(H, W) uint8: bits of `Rerun`, 0 where no rerun changes the answer. Costs eight traces.

    quantum (H, W) or a number: the step of the depth format that the depths came through, at each
    pixel, in scene units; None: one ulp of the buffer's float type, which is also the least step.
    Raises SettingsError for a quantum that is negative, not finite, or of another size.
    """
    view = frame.camera.params(frame.settings.size)
    if quantum is not None:
        quantum = _checked(quantum, frame.gbuffer.depth.shape)
    out = np.zeros(frame.gbuffer.depth.shape, np.uint8)
    for bit in Rerun:
        hits = rerun(view, frame.gbuffer, frame.settings, bit, quantum)
        out[changed(frame.hits, hits)] |= np.uint8(bit)
    return out


def rerun(
    view: ViewParams,
    gbuffer: GBuffer,
    settings: Settings,
    bit: Rerun,
    quantum: AnyArray | None = None,
) -> HitBuffer:
    """One trace with one thing changed; all rays keep their own depth and direction."""
    start = np.ascontiguousarray(gbuffer.depth, np.float64)
    move_x, move_y = _MOVES.get(bit, (0.0, 0.0))
    if bit in _DEPTHS:
        gbuffer = with_depths_moved(gbuffer, _DEPTHS[bit], quantum)
    if bit in _THICKNESSES:
        assert settings.thickness is not None
        scale = _THICKNESSES[bit]
        settings = replace(settings, thickness=settings.thickness * scale)
        if gbuffer.thickness is not None:
            own = (gbuffer.thickness * np.float64(scale)).astype(gbuffer.thickness.dtype)
            gbuffer = replace(gbuffer, thickness=own)
    prepared = prepare(view, gbuffer, settings)
    inputs = prepared.inputs._replace(origin=start, move_x=move_x, move_y=move_y)
    return run(view, prepared._replace(inputs=inputs))


def changed(before: HitBuffer, after: HitBuffer) -> BoolArray:
    """(H, W): another status, or a hit that is more than 1 px away (or has no place)."""
    off = after.hit_px - before.hit_px
    square = off[..., 0] * off[..., 0] + off[..., 1] * off[..., 1]
    hit = before.status == Status.HIT
    out: BoolArray = (after.status != before.status) | (hit & ~(square <= SAME_PX * SAME_PX))
    return out


def with_depths_moved(gbuffer: GBuffer, way: int, quantum: AnyArray | None) -> GBuffer:
    """Front and back depths one step nearer (way −1) or farther (1): the solid moves as a whole."""
    back = gbuffer.back_depth
    return replace(
        gbuffer,
        depth=_moved(gbuffer.depth, way, quantum),
        back_depth=None if back is None else _moved(back, way, quantum),
    )


def _moved(depth: FloatArray, way: int, quantum: AnyArray | None) -> FloatArray:
    """Depths one step away; what is not a finite depth above 0 stays, and no other becomes so."""
    kind = depth.dtype.type
    with np.errstate(over="ignore"):
        out = np.nextafter(depth, kind(way * np.inf))
    if quantum is not None:
        stepped = (depth.astype(np.float64) + way * quantum).astype(depth.dtype)
        out = np.minimum(out, stepped) if way < 0 else np.maximum(out, stepped)
    least, most = np.nextafter(kind(0.0), kind(1.0)), np.finfo(kind).max
    moved: FloatArray = np.where(
        np.isfinite(depth) & (depth > 0.0), np.clip(out, least, most), depth
    )
    return moved


def _checked(quantum: AnyArray, shape: tuple[int, ...]) -> AnyArray:
    image = np.asarray(quantum, np.float64)
    if image.shape not in ((), shape):
        raise SettingsError(f"quantum has the shape {image.shape}; expected one number or {shape}")
    if not (np.isfinite(image) & (image >= 0.0)).all():
        raise SettingsError("quantum has a value below 0 or not finite; expected scene units, >= 0")
    return image

"""What a slip of a published listing changes, counted ray by ray: the tables of the errata."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

import ssr_ref
from ssr_ref.buffers import GBuffer, HitBuffer, Status
from ssr_ref.camera import ViewParams
from ssr_ref.pipeline import Frame
from ssr_ref.ssr.trace import trace
from ssr_ref.typed import BoolArray, F64Array, I64Array

HEAD = (
    "| slip | hits won % | hits lost % | moved > 1 px % | greatest move px | self-hits % |\n"
    "|---|---|---|---|---|---|"
)
SAME_PLANE_PX = 2.0**-6


class Counts(NamedTuple):
    """Shares in percent of all rays, and a distance in px; hits won, lost and moved are against the
    right walk, self-hits by themselves.
    """

    won: float
    lost: float
    moved: float  # by more than 1 px
    greatest: float
    self_hits: float

    def row(self, name: str) -> str:
        """A line of the table."""
        return (
            f"| {name} | {self.won:.2f} | {self.lost:.2f} | {self.moved:.2f} | "
            f"{self.greatest:.0f} | {self.self_hits:.2f} |"
        )


def points(view: ViewParams, depth: F64Array) -> F64Array:
    """(H, W, 3) surface points in view space; NaN where nothing was drawn."""
    x, y = np.meshgrid(np.arange(view.width) + 0.5, np.arange(view.height) + 0.5)
    x, y = (x - view.cx) / view.fx, (view.cy - y) / view.fy
    z = np.where(np.isfinite(depth), depth, np.nan)
    scale = z if view.perspective else 1.0
    return np.stack([x * scale, y * scale, -z], axis=2)


def tested_pixels(gbuffer: GBuffer, hits: HitBuffer, reach: int) -> tuple[I64Array, BoolArray]:
    """(N, 2) x and y of the pixel that each hit was found in, and whether it is known.

    A hit's position may lie up to `reach` pixels beside it: it is the pixel about the position
    whose depth is that of the hit less the residual.
    """
    y, x = np.nonzero(hits.status == Status.HIT)
    front = hits.hit_depth[y, x] - hits.residual[y, x]
    at = np.floor(hits.hit_px[y, x]).astype(np.int64)
    best = np.full(len(x), np.inf)
    pixel = at.copy()
    height, width = gbuffer.depth.shape
    offsets = sorted(
        ((i, j) for i in range(-reach, reach + 1) for j in range(-reach, reach + 1)),
        key=lambda o: max(abs(o[0]), abs(o[1])),
    )
    for offset in offsets:
        near = np.clip(at + offset, 0, (width - 1, height - 1))
        z = gbuffer.depth[near[:, 1], near[:, 0]]
        off = np.abs(1.0 - front / z)
        closer = off < best - 1e-9
        pixel[closer], best[closer] = near[closer], off[closer]
    return pixel, best < 1e-6


def self_hits(view: ViewParams, gbuffer: GBuffer, hits: HitBuffer, reach: int) -> int:
    """Hits in a pixel whose surface point is under the origin's tangent plane, which no reflected
    ray can meet, or above it by less than 1/64 of a pixel's width.
    """
    assert gbuffer.geo_normal_vs is not None
    at = points(view, gbuffer.depth.astype(np.float64))
    y, x = np.nonzero(hits.status == Status.HIT)
    to, known = tested_pixels(gbuffer, hits, reach)
    q, o = at[to[:, 1], to[:, 0]], at[y, x]
    above = (gbuffer.geo_normal_vs[y, x].astype(np.float64) * (q - o)).sum(axis=1)
    width = SAME_PLANE_PX / min(view.fx, view.fy)
    if view.perspective:
        width = width * -q[:, 2]
    return int((known & (above <= width)).sum())


def count(
    view: ViewParams,
    gbuffer: GBuffer,
    right: HitBuffer,
    other: HitBuffer,
    rays: int,
    stride: int = 1,
) -> Counts:
    """One walk beside the right one."""
    a, b = right.status == Status.HIT, other.status == Status.HIT
    move = np.hypot(*(right.hit_px - other.hit_px)[a & b].T)
    selves = self_hits(view, gbuffer, other, 1 + stride // 2)
    shares = [100.0 * float(n) / rays for n in ((b & ~a).sum(), (a & ~b).sum(), (move > 1.0).sum())]
    return Counts(*shares, float(move.max(initial=0.0)), 100.0 * selves / rays)


def drawn(name: str, settings: ssr_ref.Settings) -> tuple[Frame, ViewParams]:
    """A built-in scene in its own view."""
    frame = ssr_ref.render(ssr_ref.load(name), settings=settings)
    return frame, frame.camera.params(settings.size)


def table(frame: Frame, view: ViewParams, slips: Mapping[str, int]) -> tuple[int, list[str]]:
    """Rays, and the rows of the right walk (no bit) and of each set of bits."""
    right = trace(view, frame.gbuffer, frame.settings, slips=0)
    rays = int((right.steps > 0).sum())
    stride = frame.settings.stride if frame.settings.tracer == "dda" else 1
    rows = [count(view, frame.gbuffer, right, right, rays, stride).row("none")]
    for name, bits in slips.items():
        other = trace(view, frame.gbuffer, frame.settings, slips=bits)
        rows.append(count(view, frame.gbuffer, right, other, rays, stride).row(name))
    return rays, rows

"""One pixel's reflected ray in plain Python, written from spec 4.1 to 4.10 and 5.1 to 5.3.

Slow, without NumPy arithmetic, and in another order than `ssr_ref.ssr`: unprojection goes through
ndc, cells are exact rationals, samples are a list. Decisions where the specification is silent:
fetches are one for each front depth and one for the back depth of a pixel that is not empty; only
tested samples set flags, re-walked cells none (but OPEN is the hit cell's); a re-walk covers the
cells that the interval crosses in more than a point, and corners inside it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from oracles.cells import Cell, cells_crossed
from ssr_ref.buffers import End, Flag, Status

Vector = tuple[float, float, float]
INF = math.inf


@dataclass
class Inputs:
    """Images as nested lists of floats, camera and settings as plain numbers."""

    perspective: bool
    width: int
    height: int
    p00: float
    p11: float
    p0k: float  # third (perspective) or fourth element of the projection's first row
    p1k: float
    near: float
    depth: list[list[float]]
    geo_normal: list[list[list[float]]]
    normal: list[list[list[float]]]
    reflectivity: list[list[list[float]]]
    back: list[list[float]] | None  # None: constant thickness
    unit: float  # roundoff of the buffers
    tracer: str
    stride: int
    jitter: bool
    seed: int
    max_steps: float
    max_distance: float
    bias: float
    thickness: float
    interval: str
    rewalk: bool
    reject_self: bool
    targets: list[list[float]] = field(default_factory=list)  # depth, inf where not hittable

    def __post_init__(self) -> None:
        self.targets = [
            [
                z if z > 0 and dot(n, ray_of(self, x + 0.5, y + 0.5)) < 0 else INF
                for x, (z, n) in enumerate(zip(row, normals))
            ]
            for y, (row, normals) in enumerate(zip(self.depth, self.geo_normal))
        ]


class Outcome(NamedTuple):
    """What spec 4.6, 4.7 and 5 say of a pixel."""

    status: Status
    end: int = 0
    flags: int = 0
    steps: int = 0
    fetches: int = 0
    hit: tuple[float, float] | None = None
    pixel: tuple[int, int] | None = None
    depth: float = math.nan
    residual: float = math.nan
    s: float = math.nan


def pcg3d(v: tuple[int, int, int]) -> tuple[int, int, int]:
    """Jarzynski and Olano 2020, listing 16, on Python's integers modulo 2³²."""
    x, y, z = ((c * 1664525 + 1013904223) % 2**32 for c in v)
    x = (x + y * z) % 2**32
    y = (y + z * x) % 2**32
    z = (z + x * y) % 2**32
    x, y, z = (c ^ (c // 2**16) for c in (x, y, z))
    x = (x + y * z) % 2**32
    y = (y + z * x) % 2**32
    z = (z + x * y) % 2**32
    return x, y, z


def jitter_of(x: int, y: int, seed: int) -> float:
    """4.8: the first word's top 24 bits as a fraction, plus 2⁻²⁴."""
    return (pcg3d((x, y, seed))[0] // 2**8) / 2**24 + 1 / 2**24


def dot(a: Any, b: Any) -> float:
    """a·b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def unit(a: Any) -> Vector:
    """a / |a|."""
    n = math.sqrt(dot(a, a))
    return (a[0] / n, a[1] / n, a[2] / n)


def ray_of(inp: Inputs, px: float, py: float) -> Vector:
    """Spec 2.4: the direction through a pixel position, z = −1."""
    if not inp.perspective:
        return (0.0, 0.0, -1.0)
    ndc_x, ndc_y = 2 * px / inp.width - 1, 1 - 2 * py / inp.height
    # ndc = (P00·x + P02·z) / −z
    return ((ndc_x + inp.p0k) / inp.p00, (ndc_y + inp.p1k) / inp.p11, -1.0)


def surface_point(inp: Inputs, px: float, py: float, z: float) -> Vector:
    """The view-space point of depth z at a pixel position."""
    if inp.perspective:
        d = ray_of(inp, px, py)
        return (d[0] * z, d[1] * z, -z)
    ndc_x, ndc_y = 2 * px / inp.width - 1, 1 - 2 * py / inp.height
    return ((ndc_x - inp.p0k) / inp.p00, (ndc_y - inp.p1k) / inp.p11, -z)


def clip_of(inp: Inputs, v: Vector, is_point: bool) -> Vector:
    """Clip x, y, w of a point or, by linearity, of a direction."""
    x, y, z = v
    if inp.perspective:
        return (inp.p00 * x + inp.p0k * z, inp.p11 * y + inp.p1k * z, -z)
    if is_point:
        return (inp.p00 * x + inp.p0k, inp.p11 * y + inp.p1k, 1.0)
    return (inp.p00 * x, inp.p11 * y, 0.0)


def window_of(inp: Inputs, clip: Vector) -> tuple[float, float]:
    """Spec 2.2."""
    ndc_x, ndc_y = clip[0] / clip[2], clip[1] / clip[2]
    return (inp.width / 2 + ndc_x * inp.width / 2, inp.height / 2 - ndc_y * inp.height / 2)


class Walk:
    """The set-up of 4.1 and the tests of 4.4 to 4.6 for one ray."""

    def __init__(self, inp: Inputs, x: int, y: int, r: Vector) -> None:
        self.inp, self.x, self.y = inp, x, y
        self.p0 = (x + 0.5, y + 0.5)
        self.z_o = inp.depth[y][x]
        self.n = inp.geo_normal[y][x]
        self.o = surface_point(inp, *self.p0, self.z_o)
        at, along = clip_of(inp, self.o, True), clip_of(inp, r, False)

        # The bound that is met first; ties in the order of `End`.
        bounds = [
            (End.LEFT_SCREEN_L, at[2] + at[0], along[2] + along[0]),
            (End.LEFT_SCREEN_R, at[2] - at[0], along[2] - along[0]),
            (End.LEFT_SCREEN_T, at[2] - at[1], along[2] - along[1]),
            (End.LEFT_SCREEN_B, at[2] + at[1], along[2] + along[1]),
            (End.BEHIND_CAMERA, self.z_o - inp.near, -r[2]),
        ]
        times = [(max(v, 0.0) / -dv, e) for e, v, dv in bounds if dv < 0]
        times.append((inp.max_distance, End.MAX_DISTANCE))
        t, self.end = min(times, key=lambda pair: pair[0])

        # Its window position and depth.
        if math.isinf(t):
            p1 = window_of(inp, along) if inp.perspective else self.p0
            z1 = INF
        else:
            p1 = window_of(inp, tuple(a + t * b for a, b in zip(at, along)))
            z1 = inp.near if self.end == End.BEHIND_CAMERA else self.z_o - t * r[2]
        # The bound itself is exact: a ray that leaves at the right ends at x = W.
        edge = {
            End.LEFT_SCREEN_L: (0.0, p1[1]),
            End.LEFT_SCREEN_R: (float(inp.width), p1[1]),
            End.LEFT_SCREEN_T: (p1[0], 0.0),
            End.LEFT_SCREEN_B: (p1[0], float(inp.height)),
        }
        p1 = edge.get(self.end, p1)
        delta = (p1[0] - self.p0[0], p1[1] - self.p0[1])
        self.s_end = max(abs(delta[0]), abs(delta[1]))
        self.k0 = 1 / self.z_o if inp.perspective else self.z_o
        if self.s_end > 0 and math.isfinite(self.s_end):
            self.dp = (delta[0] / self.s_end, delta[1] / self.s_end)
            k1 = 1 / z1 if inp.perspective else z1
            self.dk = (k1 - self.k0) / self.s_end
        else:
            self.s_end, self.dp, self.dk = 0.0, (0.0, 0.0), 0.0
        self._cells: list[Cell] | None = None

    def position(self, s: float) -> tuple[float, float]:
        """P(s)."""
        return (self.p0[0] + s * self.dp[0], self.p0[1] + s * self.dp[1])

    def depth(self, s: float) -> float:
        """View depth at s."""
        k = self.k0 + s * self.dk
        if not self.inp.perspective:
            return k
        return 1 / k if k > 0 else INF

    def inside(self, x: float, y: float) -> bool:
        """Whether a position or pixel index is in the image."""
        return 0 <= x < self.inp.width and 0 <= y < self.inp.height

    def cells(self) -> list[Cell]:
        """All cells of the ray but its own pixel."""
        if self._cells is None:
            self._cells = cells_crossed(self.p0, self.dp, self.s_end)[1:]
        return self._cells

    def slab(self, x: int, y: int) -> tuple[float, float, bool, int]:
        """Front, back, whether open, and fetches of a pixel (4.4, 3.5)."""
        z = self.inp.targets[y][x]
        if z == INF:
            return z, z, False, 1
        if self.inp.back is None:
            return z, z + self.inp.thickness, True, 1
        back = self.inp.back[y][x]
        is_open = not back < INF
        return z, z + self.inp.thickness if is_open else back, is_open, 2

    def above(self, x: int, y: int) -> bool:
        """4.5 as printed."""
        inp, n, m = self.inp, self.n, self.inp.geo_normal[y][x]
        z = inp.depth[y][x]
        d_q, d_o = ray_of(inp, x + 0.5, y + 0.5), ray_of(inp, *self.p0)
        q = surface_point(inp, x + 0.5, y + 0.5, z)
        qo = [a - b for a, b in zip(q, self.o)]
        rho = abs(dot(n, d_q)) / abs(dot(m, d_q))
        first = abs(dot(n, d_q)) * z + abs(dot(n, d_o)) * self.z_o + sum(map(abs, qo))
        z_q, z_o = (z, self.z_o) if inp.perspective else (1.0, 1.0)
        f = (inp.width / 2 * inp.p00, inp.height / 2 * inp.p11)
        second = sum((z_q * (abs(n[a]) + rho * abs(m[a])) + z_o * abs(n[a])) / f[a] for a in (0, 1))
        return dot(n, qo) > 8 * inp.unit * first + second / 256

    def test(self, x: int, y: int, a: float, b: float) -> str:
        """4.4 for the interval [a, b] at pixel (x, y): "empty", "behind", "front" or "in"."""
        front, back, _, _ = self.slab(x, y)
        if front == INF:
            return "empty"
        near, far = sorted((self.depth(a), self.depth(b)))
        if near > back:
            return "behind"
        return "in" if far >= front + self.inp.bias else "front"

    def hit(self, x: int, y: int, a: float, b: float, clamp: bool) -> dict[str, Any]:
        """4.6."""
        front, back, is_open, _ = self.slab(x, y)
        low = front + self.inp.bias
        z, s = self.depth(a), a
        if not low <= z <= back:
            z = low if self.depth(b) > self.depth(a) else back
            s = ((1 / z if self.inp.perspective else z) - self.k0) / self.dk
            s = min(max(s, a), b)
        px, py = self.position(s)
        if clamp:
            px, py = min(max(px, x), x + 1), min(max(py, y), y + 1)
        return {
            "hit": (px, py),
            "pixel": (x, y),
            "depth": z,
            "residual": z - front,
            "s": s,
            "is_open": is_open,
        }

    def first_cell(self, cells: list[tuple[Cell, float, float]]) -> tuple[dict[str, Any], int]:
        """4.9 over the given cells and their ranges: the hit ({} if none) and the fetches."""
        fetches = 0
        for cell, a, b in cells:
            if not self.inside(cell.x, cell.y):
                break
            fetches += self.slab(cell.x, cell.y)[3]
            if self.test(cell.x, cell.y, a, b) == "in":
                if not self.inp.reject_self or self.above(cell.x, cell.y):
                    return self.hit(cell.x, cell.y, a, b, True), fetches
        return {}, fetches


def trace_pixel(inp: Inputs, x: int, y: int) -> Outcome:
    """Status and everything else of pixel (x, y)."""
    # 5.1: pixels without a ray.
    z, n, shading = inp.depth[y][x], inp.geo_normal[y][x], inp.normal[y][x]
    if z == INF:
        return Outcome(Status.BACKGROUND)
    if all(r == 0 for r in inp.reflectivity[y][x]):
        return Outcome(Status.NOT_REFLECTIVE)
    d = ray_of(inp, x + 0.5, y + 0.5)
    usable = all(math.isfinite(v) for v in (*n, *shading)) and any(n) and any(shading)
    if not z > 0 or not usable or dot(n, d) >= 0:
        return Outcome(Status.INVALID_INPUT)
    i, m = unit(d), unit(shading)
    twice = 2 * dot(i, m)
    r = unit([a - twice * b for a, b in zip(i, m)])
    if dot(r, n) <= 0:
        return Outcome(Status.BELOW_SURFACE)

    walk = Walk(inp, x, y, r)
    if walk.s_end <= 0.5:
        return miss(walk.end, 0, 0, 0)
    return by_cells(inp, walk) if inp.tracer == "cells" else by_samples(inp, walk)


def miss(end: int, flags: int, steps: int, fetches: int) -> Outcome:
    """The status of a ray that met nothing."""
    if flags & Flag.PASSED_BEHIND:
        status = Status.PASSED_BEHIND
    elif flags & Flag.SELF_REJECTED:
        status = Status.SELF
    else:
        status = Status[End(end).name]
    return Outcome(status, end, flags, steps, fetches)


def found(hit: dict[str, Any], flags: int, steps: int, fetches: int) -> Outcome:
    """A hit's outcome; OPEN is the hit pixel's."""
    flags |= Flag.OPEN if hit.pop("is_open") else 0
    return Outcome(Status.HIT, 0, flags, steps, fetches, **hit)


def flag_of(walk: Walk, verdict: str, x: int, y: int) -> int:
    """5.3 for a tested sample."""
    if verdict == "empty":
        return Flag.OVER_EMPTY
    if verdict == "behind":
        return Flag.PASSED_BEHIND
    if verdict == "in" and walk.inp.reject_self and not walk.above(x, y):
        return Flag.SELF_REJECTED
    return 0


def by_cells(inp: Inputs, walk: Walk) -> Outcome:
    """4.9 for a whole ray."""
    flags = steps = fetches = 0
    for cell in walk.cells():
        x, y, a, b = cell.x, cell.y, float(cell.enter), float(cell.leave)
        if not walk.inside(x, y):
            break
        if steps == inp.max_steps:
            return miss(End.OUT_OF_STEPS, flags, steps, fetches)
        steps += 1
        fetches += walk.slab(x, y)[3]
        verdict = walk.test(x, y, a, b)
        flag = flag_of(walk, verdict, x, y)
        if verdict == "in" and not flag:
            return found(walk.hit(x, y, a, b, True), flags, steps, fetches)
        flags |= flag
    return miss(walk.end, flags, steps, fetches)


def samples_of(inp: Inputs, walk: Walk) -> list[tuple[float, float, float]]:
    """4.2 and 4.3: position and interval (s, e before, e) of each sample that may be tested."""
    j = jitter_of(walk.x, walk.y, inp.seed) if inp.jitter else 1.0
    positions = []
    i = 1
    while (i - 1 + j) * inp.stride < walk.s_end:
        positions.append((i - 1 + j) * inp.stride)
        i += 1
    out, start = [], 0.5
    for s in positions:
        if s > 0.5:
            end = min(s + inp.stride / 2, walk.s_end)
            out.append((s, start, end))
            start = end
    if start < walk.s_end:
        out.append(((start + walk.s_end) / 2, start, walk.s_end))
    return out


def by_samples(inp: Inputs, walk: Walk) -> Outcome:
    """4.2 to 4.7, and 4.10 above stride 1."""
    flags = steps = fetches = 0
    for s, a, b in samples_of(inp, walk):
        px, py = walk.position(s)
        if not walk.inside(px, py):
            break
        if steps == inp.max_steps:
            return miss(End.OUT_OF_STEPS, flags, steps, fetches)
        x, y = math.floor(px), math.floor(py)
        steps += 1
        fetches += walk.slab(x, y)[3]
        lo, hi = (a, b) if inp.interval == "column" else clamped(walk, x, y, a, b)
        verdict = walk.test(x, y, lo, hi)
        flag = flag_of(walk, verdict, x, y)
        flags |= flag
        if inp.rewalk and (verdict == "in" or steps == 1):
            hit, read = walk.first_cell(cells_between(walk, a, b))
            fetches += read
            if hit:
                return found(hit, flags, steps, fetches)
        elif not inp.rewalk and verdict == "in" and not flag:
            hit = walk.hit(x, y, lo, hi, inp.interval == "cell")
            return found(hit, flags, steps, fetches)
    return miss(walk.end, flags, steps, fetches)


def clamped(walk: Walk, x: int, y: int, a: float, b: float) -> tuple[float, float]:
    """The part of [a, b] in which the ray is in cell (x, y)."""
    for p, dp, i in zip(walk.p0, walk.dp, (x, y)):
        if dp != 0:
            first, last = sorted(((i - p) / dp, (i + 1 - p) / dp))
            a, b = max(a, first), min(b, last)
    return a, max(a, b)


def cells_between(walk: Walk, a: float, b: float) -> list[tuple[Cell, float, float]]:
    """Cells that the ray crosses within (a, b), with their part of it.

    The interval that leaves the origin's own pixel, a = ½, takes over everything before it.
    """
    if a == 0.5:
        a = 0.0
    return [
        (cell, max(float(cell.enter), a), min(float(cell.leave), b))
        for cell in walk.cells()
        if cell.leave > a and cell.enter < b
    ]


def inputs_of(view: Any, gbuffer: Any, settings: Any) -> Inputs:
    """The oracle's inputs from the package's view, buffers and settings."""
    return Inputs(
        perspective=view.perspective,
        width=view.width,
        height=view.height,
        p00=view.p00,
        p11=view.p11,
        p0k=view.offset_x,
        p1k=view.offset_y,
        near=view.near,
        depth=gbuffer.depth.tolist(),
        geo_normal=gbuffer.geo_normal_vs.tolist(),
        normal=gbuffer.normal_vs.tolist(),
        reflectivity=gbuffer.reflectivity.tolist(),
        back=gbuffer.back_depth.tolist() if settings.thickness_from == "back_faces" else None,
        unit=2.0**-53 if gbuffer.depth.dtype == "float64" else 2.0**-24,
        tracer=settings.tracer,
        stride=settings.stride,
        jitter=settings.jitter,
        seed=settings.seed,
        max_steps=INF if settings.max_steps is None else settings.max_steps,
        max_distance=settings.max_distance,
        bias=settings.bias,
        thickness=settings.thickness,
        interval=settings.interval,
        rewalk=settings.tracer == "dda"
        and (settings.refine == "rewalk" or (settings.refine == "auto" and settings.stride > 1)),
        reject_self=settings.self_rejection == "plane",
    )

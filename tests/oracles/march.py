"""One pixel's 3-D march in plain Python, written from spec 4.12 (and 4.4, 4.5, 4.7, 5) alone.

Distances are exact sums of rationals, rounded once. Samples are projected through clip space. What
4.12 leaves to others is the DDA oracle's: which bound a ray meets first, slab, tangent plane.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, NamedTuple

from oracles.dda import (
    Inputs,
    Outcome,
    Vector,
    Walk,
    clip_of,
    dot,
    found,
    jitter_of,
    miss,
    ray_of,
    unit,
    window_of,
)
from ssr_ref.buffers import End, Flag, Status


class March(NamedTuple):
    """The settings of the march."""

    step: float
    growth: str
    refine: str  # "none", "bisect" or "secant"
    halvings: int


class Place(NamedTuple):
    """A point of the ray on screen."""

    px: float
    py: float
    depth: float

    @property
    def pixel(self) -> tuple[int, int]:
        return math.floor(self.px), math.floor(self.py)


class Ray:
    """The points of one ray, and how they compare with the buffers."""

    def __init__(self, inp: Inputs, x: int, y: int, r: Vector) -> None:
        self.inp, self.own, self.r = inp, (x, y), r
        self.rules = Walk(inp, x, y, r)

    def place(self, t: float) -> Place | None:
        """Where O + t·R is seen; None if it is not: at most near deep, or outside the image."""
        p = tuple(o + t * d for o, d in zip(self.rules.o, self.r))
        if -p[2] <= self.inp.near:
            return None
        px, py = window_of(self.inp, clip_of(self.inp, p, True))  # type: ignore[arg-type]
        return Place(px, py, -p[2]) if self.rules.inside(px, py) else None

    def verdict(self, at: Place) -> str:
        """ "empty", "front", "behind", "self" or "in"; an own pixel is never asked for."""
        front, back, _, _ = self.rules.slab(*at.pixel)
        if front == math.inf:
            return "empty"
        if at.depth < front + self.inp.bias:
            return "front"
        if at.depth > back:
            return "behind"
        above = not self.inp.reject_self or self.rules.above(*at.pixel)
        return "in" if above else "self"

    def reads(self, at: Place) -> int:
        return self.rules.slab(*at.pixel)[3]

    def hit(self, t: float) -> dict[str, Any]:
        at = self.place(t)
        assert at is not None
        front, _, is_open, _ = self.rules.slab(*at.pixel)
        return {
            "hit": (at.px, at.py),
            "pixel": at.pixel,
            "depth": at.depth,
            "residual": at.depth - front,
            "s": t,
            "is_open": is_open,
        }


def distances(march: March, noise: float) -> Any:
    """Sums of the increments, each rounded once."""
    total, i = Fraction(0), 0
    while True:
        if march.growth == "linear":
            total += (i + Fraction(noise)) * Fraction(march.step)
        else:
            total += Fraction(march.step) * (Fraction(noise) if i == 0 else 1)
        yield float(total)
        i += 1


def trace_pixel(inp: Inputs, march: March, x: int, y: int) -> Outcome:
    """Status and everything else of pixel (x, y); `s` of the outcome is the length."""
    # 5.1: pixels without a ray.
    z, n, shading = inp.depth[y][x], inp.geo_normal[y][x], inp.normal[y][x]
    if z == math.inf:
        return Outcome(Status.BACKGROUND)
    if all(r == 0 for r in inp.reflectivity[y][x]):
        return Outcome(Status.NOT_REFLECTIVE)
    d = ray_of(inp, x + 0.5, y + 0.5)
    usable = all(math.isfinite(v) for v in (*n, *shading)) and any(n) and any(shading)
    if not z > 0 or not usable or dot(n, d) >= 0:
        return Outcome(Status.INVALID_INPUT)
    i, m = unit(d), unit(shading)
    r = unit([a - 2 * dot(i, m) * b for a, b in zip(i, m)])
    if dot(r, n) <= 0:
        return Outcome(Status.BELOW_SURFACE)
    return walk(inp, march, Ray(inp, x, y, r))


def walk(inp: Inputs, march: March, ray: Ray) -> Outcome:
    """4.12: samples until one hits, is not seen, or is not before max_distance."""
    noise = jitter_of(*ray.own, inp.seed) if inp.jitter else 1.0
    flags = steps = fetches = 0
    before = 0.0
    for t in distances(march, noise):
        at = ray.place(t)
        if at is None or t >= inp.max_distance:
            return miss(ray.rules.end, flags, steps, fetches)
        if at.pixel != ray.own:
            if steps == inp.max_steps:
                return miss(End.OUT_OF_STEPS, flags, steps, fetches)
            steps += 1
            fetches += ray.reads(at)
            verdict = ray.verdict(at)
            if verdict == "in":
                hit, more = refined(march, ray, before, t)
                return found(ray.hit(hit), flags, steps, fetches + more)
            flags |= {
                "empty": Flag.OVER_EMPTY,
                "behind": Flag.PASSED_BEHIND,
                "self": Flag.SELF_REJECTED,
                "front": 0,
            }[verdict]
        before = t
    raise AssertionError("unreachable")


def refined(march: March, ray: Ray, a: float, b: float) -> tuple[float, int]:
    """Halvings of the bracket [a, b], b inside, then the secant step; and their reads."""
    if march.refine == "none":
        return b, 0
    fetches = 0
    for _ in range(march.halvings):
        middle = (a + b) / 2
        what, reads = look(ray, middle)
        fetches += reads
        a, b = (a, middle) if what == "in" else (middle, b)
    if march.refine == "secant" and look(ray, a)[0] == "front":
        gap_a, gap_b = gap(ray, a), gap(ray, b)
        t = a + (b - a) * gap_a / (gap_a - gap_b)
        what, reads = look(ray, t)
        fetches += reads
        b = t if what == "in" else b
    return b, fetches


def look(ray: Ray, t: float) -> tuple[str, int]:
    """The verdict at t and its reads; nothing and none in the own pixel and where unseen."""
    at = ray.place(t)
    if at is None or at.pixel == ray.own:
        return "nothing", 0
    return ray.verdict(at), ray.reads(at)


def gap(ray: Ray, t: float) -> float:
    """How far the ray is behind front + bias."""
    at = ray.place(t)
    assert at is not None
    return at.depth - ray.rules.slab(*at.pixel)[0] - ray.inp.bias

"""The published DDA: only its slips differ from the tracer, and each does what the errata say.

Hand-made cases: an orthographic view of 41×31 pixels, 2 units high, so a pixel is D = 2/31 units;
pixel (10, 15) at depth 2 reflects along (1, 0, −1), so depth is 2 + s·D over pixel 10 + s.
"""

from __future__ import annotations

import itertools
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from tracing import PROJECTIONS, front_view, noise_buffers, one_ray, resolved, same_hits, view_of

from ssr_ref.buffers import End, Flag, GBuffer, HitBuffer, Status
from ssr_ref.camera import ViewParams
from ssr_ref.errors import SettingsError
from ssr_ref.settings import Settings
from ssr_ref.ssr.explain import trace_pixel
from ssr_ref.ssr.listing_dda import (
    AFTER_LOOP,
    ALL_SLIPS,
    EMPTY_ZERO,
    LATE_POINT,
    NO_PLANE,
    NO_TAIL,
    NO_WINDOW,
    NUDGE,
    OWN_DEPTH,
    OWN_PIXEL,
    PAST_END,
    SHIFTED,
    STRICT,
    SUMMED,
)
from ssr_ref.ssr.listing_line import (
    added,
    first_sums,
    increments,
    nudged,
    raw_depth,
    raw_length,
    unclipped,
)
from ssr_ref.ssr.ray import Ray, depth_at, position_x, position_y, set_up_ray
from ssr_ref.ssr.trace import trace
from ssr_ref.vecmath.noise import jitter
from ssr_ref.vecmath.vec import Vec3

pytestmark = pytest.mark.slow  # compiles much

SIZE = (37, 23)
WALKED = ("status", "end", "flags", "hit_px", "hit_depth", "residual", "length", "steps", "fetches")
FIXED = {"thickness_from": "constant"}
D = 2.0 / 31.0
X, Y, Z = 10, 15, 2.0
RAY = (1.0, 0.0, -1.0)


def listed(view: ViewParams, g: GBuffer, slips: int | None, **kw: Any) -> HitBuffer:
    """The listing with some slips, of constant thickness."""
    o = FIXED | {"listing": True, "max_steps": 200} | kw
    return trace(view, g, resolved((view.width, view.height), **o), slips=slips)


def at(hits: HitBuffer, x: int = X, y: int = Y) -> dict[str, Any]:
    """What one pixel has."""
    return {name: image[y, x].tolist() for name, image in hits.arrays().items()}


def wall(columns: dict[int, float]) -> GBuffer:
    """The hand-made ray in float64, with columns of the image at 2 + value·D."""
    dtype = np.float64
    g = one_ray(front_view(False), X, Y, Z, RAY)
    depth = g.depth.astype(dtype)
    for column, value in columns.items():
        depth[:, column] = Z + value * D
    images = (g.geo_normal_vs, g.normal_vs, g.reflectivity, g.radiance)
    assert all(image is not None for image in images)
    geo, normal, reflectivity, radiance = (image.astype(dtype) for image in images)  # type: ignore[union-attr]
    half = np.array(RAY) / np.sqrt(2.0) + (0.0, 0.0, 1.0)  # less the sight, (0, 0, −1)
    geo[Y, X] = normal[Y, X] = half / np.sqrt((half * half).sum())
    return replace(
        g, depth=depth, geo_normal_vs=geo, normal_vs=normal, reflectivity=reflectivity,
        radiance=radiance, back_depth=np.full(depth.shape, np.inf, dtype),
    )  # fmt: skip


def ray_of(view: ViewParams, g: GBuffer, x: int = X, y: int = Y, far: float = np.inf) -> Ray:
    n, m = (Vec3(*map(float, image[y, x])) for image in (g.normal_vs, g.geo_normal_vs))  # type: ignore[index]
    return set_up_ray(view, x, y, float(g.depth[y, x]), n, m, far)[1]


# ---- Without slips -----------------------------------------------------------------------------


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_without_slips_it_is_the_tracer_byte_for_byte(projection: str) -> None:
    """Strides, jitter, steps, thickness, distance and bias: every output, on random buffers."""
    view = view_of(projection, SIZE)
    cases = itertools.product((1, 3), (False, True), (4, 200), (1.0, np.inf), (0.0, 0.03))
    for seed, (stride, jittered, steps, far, bias) in enumerate(cases):
        g = noise_buffers(view, seed)
        kw = {"stride": stride, "jitter": jittered, "max_steps": steps, "max_distance": far,
              "bias": bias, "refine": "none", "seed": seed,
              "thickness_from": ("constant", "back_faces")[seed % 2],
              "facing_test": seed % 3 == 0}  # fmt: skip
        right = trace(view, g, resolved(SIZE, **kw))
        hits = listed(view, g, 0, **kw)
        same_hits(right, hits, WALKED)
        assert hits.fade_px is not None and hits.fade_length is not None
        assert hits.fade_px.tobytes() == right.hit_px.tobytes()
        assert hits.fade_length.tobytes() == right.length.tobytes()
        assert (right.status == Status.HIT).sum() > 10


def test_all_slips_are_the_setting_s_and_each_changes_something() -> None:
    view = view_of("perspective", SIZE)
    g = noise_buffers(view, 3)
    kw = {"max_distance": 8.0, "bias": 0.05, "stride": 3}
    right = listed(view, g, 0, **kw)
    same_hits(listed(view, g, None, **kw), listed(view, g, ALL_SLIPS, **kw))
    bits = [1 << i for i in range(13)]
    assert sum(bits) == ALL_SLIPS
    # An exact equality, a ray along the axis, a thickness of 100, some ulp, a bias of 0.
    rare = (STRICT, NUDGE, AFTER_LOOP, SUMMED, EMPTY_ZERO)
    for bit in bits:
        hits = listed(view, g, bit, **kw)
        same = all(a.tobytes() == hits.arrays()[n].tobytes() for n, a in right.arrays().items())
        assert same == (bit in rare), bit


# ---- Against the listing restated --------------------------------------------------------------


def restated(view: ViewParams, g: GBuffer, s: Settings, x: int, y: int) -> tuple[Any, ...] | None:
    """The published walk with z < 0 and vectors: None, or the hit's place, depth and steps.

    Perspective only. Z of an empty pixel is 0, a bias is taken from every Z that is read.
    """
    assert g.normal_vs is not None
    assert s.max_distance is not None and s.thickness is not None and s.max_steps is not None
    focal, centre = np.array([view.fx, -view.fy]), np.array([view.cx, view.cy])

    def window(p: np.ndarray) -> np.ndarray:
        return centre + focal * p[:2] / -p[2]

    sight = np.array([(x + 0.5 - view.cx) / view.fx, (view.cy - y - 0.5) / view.fy, -1.0])
    n = g.normal_vs[y, x].astype(float)
    start = sight * float(g.depth[y, x])
    unit, n = sight / np.linalg.norm(sight), n / np.linalg.norm(n)
    way = unit - 2.0 * (unit @ n) * n
    reach = s.max_distance
    if start[2] + way[2] * reach > -view.near:
        reach = (-view.near - start[2]) / way[2]
    stop = start + way * reach
    ends = np.array([window(start), window(stop)])
    if ((ends[1] - ends[0]) ** 2).sum() < 1e-4:
        ends[1] += 0.01
    line = ends[1] - ends[0]
    major = int(abs(line[0]) < abs(line[1]))
    pixels = abs(line[major])
    near_k, far_k = -1.0 / start[2], -1.0 / stop[2]
    by = np.array([*(line / pixels), (stop[2] * far_k - start[2] * near_k) / pixels,
                   (far_k - near_k) / pixels]) * s.stride  # fmt: skip
    now = np.array([*ends[0], start[2] * near_k, near_k])
    now += by * (jitter(x, y, s.seed) if s.jitter else 0.0)
    facing = np.sign(line[major])

    scene, low, high, before, count = start[2] + 100.0, start[2], start[2], start[2], 0
    place = (-1.0, -1.0)
    while (
        now[major] * facing <= ends[1][major] * facing
        and count < s.max_steps
        and (high < scene - s.thickness or low > scene)
        and scene != 0.0
    ):
        ahead = (now[2] + by[2] / 2) / (now[3] + by[3] / 2)
        low, high, before = min(before, ahead), max(before, ahead), ahead
        place = (now[0], now[1])
        column = min(max(int(np.floor(now[0])), 0), view.width - 1)
        row = min(max(int(np.floor(now[1])), 0), view.height - 1)
        z = float(g.depth[row, column])
        scene = (0.0 if np.isinf(z) else -z) - s.bias
        if not np.isinf(z) and looks_away(view, g, column, row):
            scene = -np.inf  # a pixel that cannot be hit here
        now, count = now + by, count + 1
    if high >= scene - s.thickness and low < scene:
        return (*place, -now[2] / now[3], count)
    return None


def looks_away(view: ViewParams, g: GBuffer, x: int, y: int) -> bool:
    assert g.geo_normal_vs is not None
    sight = np.array([(x + 0.5 - view.cx) / view.fx, (view.cy - y - 0.5) / view.fy, -1.0])
    return bool(g.geo_normal_vs[y, x].astype(float) @ sight >= 0.0)


@pytest.mark.parametrize(
    "kw",
    [{}, {"bias": 0.04}, {"stride": 4, "jitter": True, "bias": 0.1, "seed": 3},
     {"max_steps": 6, "jitter": True, "thickness": 0.6}, {"thickness": 4.0, "bias": 0.01},
     {"thickness": 100.0}, {"max_distance": 0.9, "bias": 0.02, "stride": 2}],
    ids=str,
)  # fmt: skip
def test_all_slips_give_what_the_listing_restated_gives(kw: dict[str, Any]) -> None:
    """Hit or miss of every ray; place and depth to 1e-8: both add up some hundred samples."""
    view = view_of("off-axis", SIZE)
    g = noise_buffers(view, 17)
    settings = resolved(
        SIZE, **({"listing": True, "max_steps": 90, "max_distance": 8.0} | FIXED | kw)
    )
    hits = trace(view, g, settings)
    none = (Status.BACKGROUND, Status.NOT_REFLECTIVE, Status.INVALID_INPUT, Status.BELOW_SURFACE)
    found = missed = 0
    for y, x in np.argwhere(~np.isin(hits.status, none))[::3]:
        want = restated(view, g, settings, x, y)
        got = at(hits, x, y)
        assert (got["status"] == Status.HIT) == (want is not None), (x, y, want, got)
        if want is None:
            missed += 1
            continue
        found += 1
        assert got["steps"] == want[3]
        if want[3] == 0:  # the listing's place is never written
            assert got["hit_px"] == [x + 0.5, y + 0.5]
            continue
        assert np.abs(np.subtract(got["fade_px"], want[:2])).max() < 1e-8
        assert abs(got["hit_depth"] / want[2] - 1.0) < 1e-8
    assert found > 20 and (missed > 5 or settings.thickness == 100.0)


# ---- Slip by slip ------------------------------------------------------------------------------


def test_own_depth_is_the_interval_from_the_origin() -> None:
    """Slab [2 + 0.1 D, 2 + 0.3 D] next door: before ½, so only an interval from 0 meets it."""
    g = wall({X + 1: 0.1})
    view, kw = front_view(False), {"thickness": 0.2 * D}
    assert at(listed(view, g, 0, **kw))["status"] == Status.PASSED_BEHIND
    hit = at(listed(view, g, OWN_DEPTH, **kw))
    assert hit["status"] == Status.HIT and hit["steps"] == 1
    assert hit["hit_px"][0] == pytest.approx(X + 0.5 + 0.1, abs=1e-9)
    # interval = "published" is the same but for 1/(1/z), which may be an ulp off z.
    for projection, names in (("orthographic", WALKED), ("off-axis", ("hit_px", "steps"))):
        view = view_of(projection, SIZE)
        noise = noise_buffers(view, 21)
        published = trace(view, noise, resolved(SIZE, **FIXED, interval="published"))
        same_hits(published, listed(view, noise, OWN_DEPTH), names)


def test_own_pixel_is_hit_unless_the_bias_is_large() -> None:
    """Sample 0 is the origin, its depths are 2 + D/2 at most: in its own slab if bias ≤ D/2."""
    view, g = front_view(False), wall({})
    assert at(listed(view, g, 0))["end"] == End.LEFT_SCREEN_R
    assert at(listed(view, g, OWN_PIXEL))["flags"] & Flag.SELF_REJECTED
    own = at(listed(view, g, OWN_PIXEL | NO_PLANE))
    assert (own["status"], own["steps"]) == (Status.HIT, 1)
    assert own["hit_px"] == [np.nextafter(X + 1.0, 0.0), Y + 0.5]
    for bias, hit in ((0.49 * D, True), (0.51 * D, False)):
        out = at(listed(view, g, OWN_PIXEL | NO_PLANE, bias=bias))
        assert (out["status"] == Status.HIT) == hit


def test_without_the_plane_rule_a_stride_meets_the_own_plane() -> None:
    """A ray at θ from the view axis falls 1/tan θ a pixel, its surface 1/tan(θ/2), about twice.

    At s = j·4 with j near ¼ the interval [½, s + 2] spans depths ½ to 3 of 1/tan θ, and the own
    plane is met in between: at 2 s.
    """
    view = front_view(False)
    seed = next(i for i in range(999) if 0.24 < jitter(X, Y, i) < 0.26)
    theta = 0.3
    ray = (np.sin(theta), 0.0, -np.cos(theta))
    g = one_ray(view, X, Y, Z, ray)
    for i in range(1, 30):
        g.depth[:, X + i] = Z + i * D / np.tan(theta / 2)
        g.geo_normal_vs[:, X + i] = g.geo_normal_vs[Y, X]  # type: ignore[index]
    kw = {"stride": 4, "jitter": True, "seed": seed, "thickness": 0.5 * D}
    right = at(listed(view, g, 0, **kw))
    assert right["status"] == Status.SELF and right["flags"] & Flag.SELF_REJECTED
    own = at(listed(view, g, NO_PLANE, **kw))
    assert (own["status"], own["steps"]) == (Status.HIT, 1)


def test_sums_drift_into_another_pixel() -> None:
    """½ + 5 · 0.1 is 1, but ½ + 0.1 + 0.1 + 0.1 + 0.1 + 0.1 is 1 − 2⁻⁵³ in float64."""
    view, g = front_view(False), wall({})
    ray = ray_of(view, g)._replace(p0_x=0.5, p0_y=0.5, dp_x=1.0, dp_y=0.1)
    by = increments(ray, 1.0)
    sums = first_sums(ray, by, 0.0)
    for _ in range(5):
        sums = added(sums, by, 1.0)
    assert position_y(ray, 5.0) == 1.0
    assert (sums.px, sums.py) == (5.5, np.nextafter(1.0, 0.0))
    assert sums.q / sums.k == pytest.approx(depth_at(ray, 5.0), rel=1e-15)
    # Q.z is z·k, here 3 · ½ at the start and 1 at the end: −½ over all of S.
    far_off = ray._replace(perspective=True, origin_depth=3.0, k0=0.5, dk=-0.001, s_end=40.0)
    assert first_sums(far_off, increments(far_off, 2.0), 0.0).q == 1.5
    assert increments(far_off, 2.0).q == pytest.approx(-0.5 / 40.0 * 2.0, rel=1e-12)
    # Whole walks: the same but for rounding, which is not nothing.
    view = view_of("perspective", SIZE)
    noise = noise_buffers(view, 5)
    right, other = listed(view, noise, LATE_POINT), listed(view, noise, LATE_POINT | SUMMED)
    both = (right.status == Status.HIT) & (other.status == Status.HIT)
    assert both.sum() > 100 and (right.status != other.status).sum() == 0
    drift = np.abs(right.hit_depth / other.hit_depth - 1.0)[both]
    assert 0.0 < drift.max() < 1e-12


def test_strict_stops_where_the_front_is_met_exactly() -> None:
    """Pixel 15 is as deep as the interval's end at s = 5.5; pixels from 20 on would be hit."""
    view, g = front_view(False), wall({x: x - X - 0.25 for x in range(20, 41)})
    g.depth[:, 15] = depth_at(ray_of(view, g), 5.5)
    right = at(listed(view, g, 0))
    assert (right["status"], right["steps"]) == (Status.HIT, 5)
    strict = at(listed(view, g, STRICT))
    assert strict["status"] != Status.HIT and strict["steps"] == 5
    g.depth[:, 15] = np.nextafter(g.depth[0, 15], 0.0)  # an ulp nearer: passed through, a hit
    assert at(listed(view, g, STRICT))["steps"] == 5
    assert at(listed(view, g, STRICT))["status"] == Status.HIT


def test_the_bias_moves_the_back_too() -> None:
    """Front 2, thickness 2, bias 1 (in D above 2): slab [3, 4] or [3, 5] against [4.5, 5.5]."""
    view, g = front_view(False), wall({15: 2.0})
    kw = {"thickness": 2.0 * D, "bias": 1.0 * D}
    assert at(listed(view, g, 0, **kw))["status"] == Status.PASSED_BEHIND
    moved = at(listed(view, g, SHIFTED, **kw))
    assert (moved["status"], moved["steps"]) == (Status.HIT, 5)


def test_the_sentinel_fires_only_without_bias() -> None:
    """Sky from pixel 11 to 19, then a wall that the ray enters at s = 9.75."""
    view, g = front_view(False), wall(dict.fromkeys(range(20, 41), 9.75))
    right = at(listed(view, g, 0))
    assert (right["status"], right["steps"]) == (Status.HIT, 10)
    assert right["flags"] & Flag.OVER_EMPTY
    stopped = at(listed(view, g, EMPTY_ZERO))
    assert (stopped["status"], stopped["steps"]) == (Status.LEFT_SCREEN_R, 1)
    passed = at(listed(view, g, EMPTY_ZERO, bias=2.0**-10))
    assert (passed["status"], passed["steps"]) == (Status.HIT, 10)
    sky = at(listed(view, g, EMPTY_ZERO, bias=2.0**-10, thickness=np.inf))
    assert (sky["status"], sky["steps"]) == (Status.HIT, 1)
    assert sky["residual"] == sky["hit_depth"]  # the front is at depth 0


def test_nothing_ends_the_walk_at_the_window() -> None:
    """The last column as deep as the ray is 9 pixels beyond it: the clamped read meets it there."""
    view = front_view(False)
    g = wall({40: 39.0 - 0.1})
    kw = {"thickness": 0.5 * D, "max_distance": 8.0}
    assert at(listed(view, g, 0, **kw))["end"] == End.LEFT_SCREEN_R
    out = at(listed(view, g, NO_WINDOW, **kw))
    assert out["status"] == Status.HIT and out["steps"] == 39
    assert out["hit_px"][0] == np.nextafter(41.0, 0.0)
    assert out["fade_px"][0] == pytest.approx(X + 0.5 + 38.9, abs=1e-6)
    # max_distance is the end then: 8 units of a ray at 45° are 8/√2/D pixels.
    miss = at(listed(view, wall({}), NO_WINDOW, **kw))
    assert (miss["end"], miss["steps"]) == (End.MAX_DISTANCE, int(8.0 / 2**0.5 / D) + 1)
    # Without one, the vanishing point of the direction, at k = 0.
    view = front_view()
    endless = unclipped(view, ray_of(view, one_ray(view, X, Y, 2.0, (2.0, -0.5, -1.0))), np.inf)
    end = [view.cx + 2.0 * view.fx, view.cy + 0.5 * view.fy]
    at_end = [position_x(endless, endless.s_end), position_y(endless, endless.s_end)]
    assert at_end == pytest.approx(end, abs=1e-4)  # the normal is float32
    assert abs(endless.k0 + endless.s_end * endless.dk) < 1e-15
    # The near plane too: a ray back to the eye leaves the image first.
    view = front_view(near=0.5)
    eye = one_ray(view, X, Y, 2.0, (1.0, 0.0, 0.5))
    assert at(listed(view, eye, 0))["end"] == End.LEFT_SCREEN_R
    assert at(listed(view, eye, NO_WINDOW))["end"] == End.BEHIND_CAMERA


def test_a_line_without_length_is_nudged_into_a_hit_of_its_own() -> None:
    """Straight back to the eye: no pixel is crossed; moved by 0.01 px it has a sample, s = 0."""
    view = front_view()
    g = one_ray(view, 20, 15, 2.0, (0.0, 0.0, 1.0))
    g.normal_vs[15, 20] = g.geo_normal_vs[15, 20] = (0.0, 0.0, 1.0)  # type: ignore[index]
    ray = ray_of(view, g, 20, 15)
    assert (ray.s_end, ray.end) == (0.0, End.BEHIND_CAMERA)
    moved = nudged(view, ray, np.inf)
    assert moved.s_end == pytest.approx(0.01, rel=1e-12) and abs(moved.dp_x) == 1.0
    assert depth_at(moved, moved.s_end) == pytest.approx(view.near, rel=1e-12)
    own = OWN_PIXEL | OWN_DEPTH | NO_PLANE
    assert at(listed(view, g, own), 20, 15)["status"] == Status.BEHIND_CAMERA
    hit = at(listed(view, g, own | NUDGE), 20, 15)
    assert (hit["status"], hit["steps"]) == (Status.HIT, 1)
    long = ray_of(front_view(False), wall({}))
    assert nudged(front_view(False), long, np.inf) == long


def test_the_last_interval_reaches_past_the_end() -> None:
    """S = 5.2: depths go to 5.2 D, or 5.5 D as published; the wall is at 5.3 D."""
    view, g = front_view(False), wall({15: 5.3})
    kw = {"max_distance": 5.2 * D * 2**0.5}
    assert at(listed(view, g, 0, **kw))["end"] == End.MAX_DISTANCE
    past = at(listed(view, g, PAST_END, **kw))
    assert (past["status"], past["steps"]) == (Status.HIT, 5)
    assert past["length"] > kw["max_distance"]


def test_past_the_vanishing_point_depths_are_negative() -> None:
    """k = ½ − s/8: 0 at s = 4; at s = 6 k is −¼, the depth −4, the place as far behind the eye."""
    ray = ray_of(front_view(), one_ray(front_view(), X, Y, 2.0, (1.0, 0.0, -1.0)))
    ray = ray._replace(k0=0.5, dk=-0.125, length_scale=0.25)
    assert (raw_depth(ray, 2.0), raw_depth(ray, 4.0), raw_depth(ray, 6.0)) == (4.0, np.inf, -4.0)
    assert (raw_length(ray, 2.0), raw_length(ray, 6.0)) == (2.0, 6.0)


def test_the_tail_is_not_looked_at() -> None:
    """Stride 4, S = 7.5: sample 4 takes [½, 6], what is left is [6, 7.5] with its middle in 17."""
    view, g = front_view(False), wall({17: 6.5})
    kw = {"stride": 4, "max_distance": 7.5 * D * 2**0.5}
    right = at(listed(view, g, 0, **kw))
    assert (right["status"], right["steps"]) == (Status.HIT, 2)
    cut = at(listed(view, g, NO_TAIL, **kw))
    assert (cut["status"], cut["end"], cut["steps"]) == (Status.MAX_DISTANCE, End.MAX_DISTANCE, 1)


def test_the_point_is_a_stride_late() -> None:
    """Stride 4, a wall at 3 D: entered at s = 3; reported at pixel 14.5 with the depth of s = 8."""
    view, g = front_view(False), wall(dict.fromkeys(range(13, 41), 3.0))
    kw = {"stride": 4, "thickness": 20.0 * D}
    right = at(listed(view, g, 0, **kw))
    assert right["hit_px"][0] == pytest.approx(X + 3.5, abs=1e-9)
    late = at(listed(view, g, LATE_POINT, **kw))
    assert late["hit_px"] == pytest.approx([X + 4.5, Y + 0.5], abs=1e-12)
    assert late["hit_depth"] == pytest.approx(Z + 8.0 * D, rel=1e-12)
    assert late["residual"] == pytest.approx(5.0 * D, rel=1e-12)
    assert late["length"] == pytest.approx(8.0 * D * 2**0.5, rel=1e-12)
    assert (late["fade_px"], late["fade_length"]) == (late["hit_px"], late["length"])


def test_deciding_after_the_loop_needs_no_sample_at_a_thickness_of_100() -> None:
    """Below 100 it changes no byte, steps that run out included; from 100 on every ray hits."""
    view = view_of("perspective", SIZE)
    g = noise_buffers(view, 9)
    for kw in ({"max_steps": 1}, {"max_steps": 5, "jitter": True}, {"thickness": 99.5}):
        same_hits(listed(view, g, 0, **kw), listed(view, g, AFTER_LOOP, **kw))
    right = listed(view, g, 0, thickness=100.0)
    hits = listed(view, g, AFTER_LOOP, thickness=100.0)
    walked = right.steps > 0
    assert walked.sum() > 300
    assert (hits.status[walked] == Status.HIT).all() and (hits.steps == 0).all()
    assert np.isnan(hits.residual[walked]).all()


def test_the_errata_name_every_slip_and_the_test_that_shows_it() -> None:
    root = Path(__file__).parent.parent
    text = (root / "docs" / "errata_tracers.md").read_text(encoding="utf-8")
    section = text.split("## The DDA")[1].split("## Buffers")[0]
    rows = dict(re.findall(r"^\| ([A-Z_]+) \|.*\| ([^|]*`test_[^|]*) \|$", section, re.MULTILINE))
    source = (root / "ssr_ref" / "ssr" / "listing_dda.py").read_text(encoding="utf-8")
    bits = dict(re.findall(r"^([A-Z_]+) = (\d+)$", source, re.MULTILINE))
    assert int(bits.pop("ALL_SLIPS")) == sum(map(int, bits.values()))
    assert set(rows) == set(bits)
    for tests in rows.values():
        for name in re.findall(r"`(\w+)`", tests):
            assert name in globals(), name


# ---- Settings, threads, interpreted ------------------------------------------------------------


@pytest.mark.parametrize(
    ("bad", "word"),
    [
        ({}, "max_steps"),
        ({"max_steps": 9, "tracer": "cells"}, "tracer"),
        ({"max_steps": 9, "refine": "rewalk"}, "refine"),
        ({"max_steps": 9, "refine": "bisect"}, "refine"),
        ({"max_steps": 9, "surface": "plane"}, "surface"),
        ({"max_steps": 9, "interval": "cell"}, "interval"),
    ],
)
def test_settings_that_contradict(bad: dict[str, Any], word: str) -> None:
    with pytest.raises(SettingsError, match=word) as caught:
        Settings(**({"tracer": "dda", "listing": True} | bad))
    assert "\n" not in str(caught.value) and "expected" in str(caught.value)


def test_the_listing_has_no_refinement_and_no_log() -> None:
    settings = resolved(SIZE, listing=True, max_steps=9, stride=4)
    assert settings.refinement == "none"
    view = view_of("perspective", SIZE)
    with pytest.raises(SettingsError, match="listing"):
        trace_pixel(view, noise_buffers(view, 1), settings, 3, 3)


def test_threads_and_chunks_keep_every_byte() -> None:
    view = view_of("off-axis", SIZE)
    g = noise_buffers(view, 31)
    settings = resolved(SIZE, listing=True, max_steps=50, jitter=True, stride=2)
    threads = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        one = trace(view, g, settings)
        numba.set_num_threads(min(2, numba.config.NUMBA_NUM_THREADS))
        two = trace(view, g, settings)
    finally:
        numba.set_num_threads(threads)
    same_hits(one, two)
    same_hits(one, trace(view, g, settings, lambda share: None))


PRINT_HASHES = """
import hashlib, numpy as np
from tracing import noise_buffers, resolved, view_of
from ssr_ref.ssr.trace import trace
for name in ("off-axis", "orthographic"):
    view = view_of(name, (9, 7))
    for slips in (0, 8191):
        digest = hashlib.sha256()
        for kw in ({}, {"stride": 3, "jitter": True, "bias": 0.05, "max_distance": 6.0}):
            kw = {"listing": True, "max_steps": 40, "thickness_from": "constant"} | kw
            hits = trace(view, noise_buffers(view, 2), resolved((9, 7), **kw), slips=slips)
            for key, image in sorted(hits.arrays().items()):
                digest.update(key.encode() + np.where(np.isnan(image), -7, image).tobytes())
        print(name, slips, digest.hexdigest())
"""


def test_interpreted_equals_compiled() -> None:
    def run(**more: str) -> str:
        tests = Path(__file__).parent
        path = os.pathsep.join([str(tests), str(tests.parent)])
        environment = os.environ | {"PYTHONPATH": path} | more
        return subprocess.run(
            [sys.executable, "-c", PRINT_HASHES],
            capture_output=True, text=True, check=True, env=environment,
        ).stdout  # fmt: skip

    compiled = run(NUMBA_DISABLE_JIT="0")
    assert len(set(compiled.split())) == 8
    assert run(NUMBA_DISABLE_JIT="1") == compiled

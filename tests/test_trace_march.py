"""The 3-D march: an independent implementation, closed forms, invariance, the published listing.

What a walk of samples along a view-space ray owes (spec 4.12): it stops at the first sample inside
a slab, refines within the last two samples, and ends with a name where the ray is no longer seen.
"""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import replace
from typing import Any

import numba
import numpy as np
import pytest
from oracles.dda import Outcome, inputs_of
from oracles.march import March, trace_pixel
from tracing import (
    PROJECTIONS,
    draw,
    front_view,
    lone,
    noise_buffers,
    on_floor,
    one_ray,
    pixel_rays,
    point_of,
    resolved,
    same_hits,
    view_of,
    window_of,
)

from ssr_ref.buffers import End, Flag, GBuffer, HitBuffer, Status
from ssr_ref.camera import ViewParams
from ssr_ref.errors import SettingsError
from ssr_ref.scenes import build, shapes
from ssr_ref.settings import Settings
from ssr_ref.ssr.listing_march import (
    ALL_SLIPS,
    BASE_STEP,
    NO_DISTANCE,
    NO_WINDOW,
    NOISE_ALONG,
    OWN_PIXEL,
    UNREFINED_FADES,
    march_listing,
    meets,
)
from ssr_ref.ssr.march_view import CONSTANT, LINEAR, distance_of
from ssr_ref.ssr.march_view import March as Samples
from ssr_ref.ssr.trace import trace
from ssr_ref.vecmath.noise import jitter

SIZE = (37, 23)
COUNTS = ("status", "end", "flags", "steps", "fetches")


def marching(size: tuple[int, int] = SIZE, **kw: Any) -> Settings:
    """Settings of a march: step 1/16, at most 8 units."""
    return resolved(size, **({"tracer": "march", "step": 2.0**-4, "max_distance": 8.0} | kw))


def traced(view: ViewParams, g: GBuffer, **kw: Any) -> HitBuffer:
    return trace(view, g, marching((view.width, view.height), **kw))


# ---- Against the oracle ------------------------------------------------------------------------


def agree(view: ViewParams, gbuffer: GBuffer, settings: Settings) -> Counter[str]:
    """Every pixel equals the oracle's; how often each status, end and flag occurred.

    Counts are equal; positions agree to 1e-9 px, depths and lengths to 1e-12: each side rounds some
    ten operations of float64, in another order.
    """
    hits = trace(view, gbuffer, settings)
    inputs = inputs_of(view, gbuffer, settings)
    refine = "bisect" if settings.refine == "auto" else settings.refine
    assert settings.step is not None
    march = March(settings.step, settings.growth, refine, settings.refine_steps)
    seen: Counter[str] = Counter()
    for y in range(view.height):
        for x in range(view.width):
            want = trace_pixel(inputs, march, x, y)
            got = tuple(int(getattr(hits, name)[y, x]) for name in COUNTS)
            assert got == tuple(int(v) for v in want[:5]), ((x, y), COUNTS, got, want)
            seen[want.status.name] += 1
            seen[f"end {End(want.end).name}"] += 1
            seen.update(flag.name for flag in Flag if want.flags & flag)
            if want.status == Status.HIT:
                check_hit(hits, want, x, y, settings)
            else:
                assert np.isnan(hits.hit_px[y, x]).all() and np.isnan(hits.hit_depth[y, x])
                assert np.isnan(hits.residual[y, x]) and np.isnan(hits.length[y, x])
    return seen


def check_hit(hits: HitBuffer, want: Outcome, x: int, y: int, settings: Settings) -> None:
    assert want.hit is not None
    assert np.abs(hits.hit_px[y, x] - want.hit).max() < 1e-9, ((x, y), hits.hit_px[y, x], want)
    assert tuple(np.floor(hits.hit_px[y, x]).astype(int)) == want.pixel != (x, y)
    assert abs(hits.hit_depth[y, x] / want.depth - 1.0) < 1e-12
    assert abs(hits.length[y, x] / want.s - 1.0) < 1e-12
    residual = hits.residual[y, x]
    assert abs(residual - want.residual) < 1e-12 * want.depth
    assert residual >= 0.0
    if want.flags & Flag.OPEN:
        assert settings.thickness is not None and residual <= settings.thickness


FIXED = {"thickness_from": "constant"}
CASES: list[dict[str, Any]] = [
    {},
    {"growth": "constant"},
    {"jitter": True, "seed": 5, "bias": 0.03, **FIXED},
    {"jitter": True, "seed": 9, "growth": "constant", "step": 0.3},
    {"refine": "none", "max_steps": 5},
    {"refine": "secant", "refine_steps": 3},
    {"refine": "secant", "refine_steps": 0, "growth": "constant", "step": 0.2, "bias": 0.01},
    {"refine_steps": 24, "step": 0.3},
    {"max_steps": 2, "step": 0.02},
    {"max_distance": 0.7, "step": 0.01, "jitter": True},
    {"self_rejection": "none", **FIXED},
    {"thickness": np.inf, "max_distance": 0.4, "step": 0.02, **FIXED},
    {"thickness": 0.0, "growth": "constant", **FIXED},
    {"max_distance": np.inf, "max_steps": 40, "thickness": 2.0},
]


@pytest.mark.slow
@pytest.mark.parametrize("projection", PROJECTIONS)
def test_noise_buffers(projection: str) -> None:
    """Each case of `CASES` on its own random buffers: holes, faces that look away, own planes."""
    view = view_of(projection, SIZE)
    seen: Counter[str] = Counter()
    for number, kw in enumerate(CASES):
        seen += agree(view, noise_buffers(view, number), marching(**kw))
    # Everything that can occur did; BEHIND_CAMERA and SELF are rare, and tested
    # on rays made for them.
    never = {"NOT_COMPUTED", "BLOCKED", "BACK_FACE", "BACK_FACE_REJECTED"}
    names = {s.name for s in Status} | {f"end {e.name}" for e in End} | {f.name for f in Flag}
    rare = {"BEHIND_CAMERA", "end BEHIND_CAMERA", "SELF"}
    assert {name for name in names if seen[name] == 0} - rare == never
    assert seen["HIT"] > 1500 and seen["SELF_REJECTED"] >= 3 and seen["OUT_OF_STEPS"] > 100


@pytest.mark.slow
@pytest.mark.parametrize("name", ["teapot", "poles"])
@pytest.mark.parametrize("orthographic", [False, True])
def test_built_in_scenes(name: str, orthographic: bool) -> None:
    scene = build(name, 3)
    assert scene.view is not None
    size = (53, 31)
    view = scene.view
    if orthographic:
        view = replace(view, fov_y_degrees=None, orthographic_height=2.4)
    params = view.camera(size, 2.0**-8).params(size)
    gbuffer = draw(params, scene)
    hits = 0
    for kw in (
        {},
        {"jitter": True, "seed": 3, "max_distance": 2.0, "refine": "secant"},
        {"growth": "constant", "step": 0.01, **FIXED},
    ):
        hits += agree(params, gbuffer, marching(size, **({"thickness": 2.0**-4} | kw)))["HIT"]
    assert hits > 150


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (2, 3)])
@pytest.mark.parametrize("projection", PROJECTIONS)
def test_tiny_images(size: tuple[int, int], projection: str) -> None:
    view = view_of(projection, size)
    for seed, growth in enumerate(("linear", "constant")):
        agree(view, noise_buffers(view, seed), marching(size, growth=growth, step=0.05))


def test_bad_inputs() -> None:
    """NaN, infinite and negative depths, zero and NaN normals, as origins and as targets."""
    view = view_of("perspective", SIZE)
    g = noise_buffers(view, 77)
    assert g.geo_normal_vs is not None and g.normal_vs is not None
    rng = np.random.default_rng(5)
    g.depth[rng.random(g.depth.shape) < 0.2] = np.nan
    g.depth[rng.random(g.depth.shape) < 0.1] = -1.0
    g.depth[rng.random(g.depth.shape) < 0.05] = -np.inf
    g.geo_normal_vs[rng.random(g.depth.shape) < 0.1] = 0.0
    g.normal_vs[rng.random(g.depth.shape) < 0.1] = np.nan
    seen = agree(view, g, marching(growth="constant"))
    assert seen["INVALID_INPUT"] > 300 and seen["HIT"] > 15


# ---- Samples -----------------------------------------------------------------------------------


@pytest.mark.parametrize("noise", [1.0, 0.25, 2.0**-24])
def test_distances_are_sums_of_increments(noise: float) -> None:
    """Steps of 2⁻⁵ and these noises add up exactly, so the closed form is the sum to the bit.

    Without noise the increments are (i + 1)·step: the first sample is not the origin.
    """
    step = 2.0**-5
    for growth, increment in (
        (LINEAR, lambda i: (i + noise) * step),
        (CONSTANT, lambda i: step if i else noise * step),
    ):
        total = 0.0
        for i in range(200):
            total += increment(i)
            assert distance_of(Samples(step, growth, noise, np.inf), i) == total
        assert distance_of(Samples(step, growth, noise, np.inf), 0) == noise * step


def test_a_wall_is_met_where_the_samples_say() -> None:
    """Orthographic, one unit is 15.5 px: a ray to the right at constant depth meets a wall.

    The wall is the pixels from x = 30 on, at the ray's own depth: the first sample beyond 30 hits.
    """
    view = front_view(False)
    g = one_ray(view, 10, 15, 2.0, (1.0, 0.0, 0.0))
    g.depth[:, 30:] = 2.0
    step = 2.0**-4
    base = {"step": step, "refine": "none", "self_rejection": "none", **FIXED}
    for growth, sums in (
        ("linear", step * np.cumsum(np.arange(1, 40))),
        ("constant", step * np.arange(1, 40)),
    ):
        out = traced(view, g, growth=growth, **base)
        x = 10.5 + 15.5 * sums
        n = int(np.argmax(x >= 30.0))
        assert out.status[15, 10] == Status.HIT
        assert out.hit_px[15, 10] == pytest.approx((x[n], 15.5), abs=1e-12)
        assert out.length[15, 10] == sums[n]
        # Samples in the own pixel, x < 11, are not tested.
        assert out.steps[15, 10] == n + 1 - (x < 11.0).sum()


def test_equality_is_a_hit() -> None:
    """A sample exactly on front + bias, or on front + thickness; an ulp less, and it is a miss."""
    view = front_view(False)
    g = one_ray(view, 10, 15, 2.0, (1.0, 0.0, 0.0))
    base = {"growth": "constant", "refine": "none", "self_rejection": "none", **FIXED}
    base |= {"thickness": 1.0}  # the back is out of the way

    def first_hit(front: float, **kw: Any) -> tuple[int, float]:
        g.depth[:, 30:31] = front  # one pixel, one sample in it
        out = traced(view, g, **(base | kw))
        return int(out.status[15, 10]), float(out.hit_depth[15, 10])

    z = first_hit(2.0)[1]  # 2 up to the rounding of R
    above = np.nextafter(z, 9.0)
    assert first_hit(1.75, bias=z - 1.75) == (Status.HIT, z)
    assert first_hit(1.75, bias=above - 1.75)[0] == Status.LEFT_SCREEN_R
    assert first_hit(1.75, thickness=z - 1.75) == (Status.HIT, z)
    below = np.nextafter(z, 0.0)
    assert first_hit(1.75, thickness=below - 1.75)[0] == Status.PASSED_BEHIND


@pytest.mark.parametrize("growth", ["linear", "constant"])
def test_noise_is_one_number_a_pixel(growth: str) -> None:
    """The first sample is at noise·step; the whole ray keeps that noise."""
    view = front_view(False)
    g = one_ray(view, 10, 15, 2.0, (1.0, 0.0, 0.0))
    g.depth[:, 30:] = 2.0
    j = jitter(10, 15, 7)
    out = traced(
        view, g, growth=growth, jitter=True, seed=7, refine="none", self_rejection="none", **FIXED
    )
    i = np.arange(40)
    sums = 2.0**-4 * (np.cumsum(i + j) if growth == "linear" else i + j)
    n = int(np.argmax(10.5 + 15.5 * sums >= 30.0))
    assert out.length[15, 10] == pytest.approx(sums[n], rel=1e-15)


# ---- Refinement --------------------------------------------------------------------------------


def floor_and_box(projection: str) -> tuple[ViewParams, GBuffer]:
    """A box on a mirror floor, seen from just above it, 61×41."""
    view = view_of(projection, (61, 41), eye=(1.0, 0.9, 3.2))
    box = shapes.box((-0.9, 0.0, -0.4), (0.8, 1.1, 0.3), material=1)
    return view, draw(view, on_floor(box, np.eye(4)))


@pytest.mark.parametrize("refine", ["bisect", "secant"])
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_the_bracket_is_never_left(refine: str, projection: str) -> None:
    """A refined hit lies between the sample that hit and the one before it, and in its slab."""
    view, g = floor_and_box(projection)
    plain = traced(view, g, refine="none")
    hit = plain.status == Status.HIT
    i = np.rint(np.sqrt(2.0 * plain.length[hit] / 2.0**-4 + 0.25) - 0.5)  # i (i + 1)/2 steps
    assert (plain.length[hit] == i * (i + 1) / 2 * 2.0**-4).all()
    before = i * (i - 1) / 2 * 2.0**-4
    last = plain.length[hit]
    for halvings in (0, 1, 2, 5, 8, 20, 64):
        out = traced(view, g, refine=refine, refine_steps=halvings)
        same_hits(plain, out, ("status", "end", "steps"))
        length = out.length[hit]
        assert (length >= before).all() and (length <= plain.length[hit]).all()
        assert (out.residual[hit] >= 0.0).all()
        # More halvings never move the inside end back; a secant step may fall short of them.
        assert refine == "secant" or (length <= last).all()
        last = length
    assert hit.sum() > 100 and (last < plain.length[hit]).mean() > 0.9
    # After n halvings the bracket is (last increment)/2ⁿ wide: at 64 the end is on the surface
    # or on a border between pixels; the residual of most is rounding.
    assert np.median(out.residual[hit]) < 1e-12


def test_a_secant_step_is_exact_on_a_plane() -> None:
    """Orthographic, a wall that faces the eye: depth is linear along the ray, so one step hits it.

    The ray goes away from the eye at 45°; the wall 1 unit behind the origin is met at length √2.
    """
    view = front_view(False)
    g = one_ray(view, 5, 15, 2.0, (1.0, 0.0, -1.0))
    g.depth[:, 9:] = 3.0
    out = traced(view, g, refine="secant", refine_steps=0, growth="constant", step=0.3)
    plain = traced(view, g, refine="none", growth="constant", step=0.3)
    assert plain.status[15, 5] == out.status[15, 5] == Status.HIT
    assert plain.length[15, 5] == 1.5
    assert out.hit_depth[15, 5] == pytest.approx(3.0, rel=1e-15)
    assert out.length[15, 5] == pytest.approx(2.0**0.5, rel=1e-7)  # normals are float32
    assert out.fetches[15, 5] == plain.fetches[15, 5] + 2  # depth and back of one pixel


# ---- Ends --------------------------------------------------------------------------------------


@pytest.mark.parametrize("perspective", [True, False])
def test_a_ray_into_the_eye(perspective: bool) -> None:
    """BEHIND_CAMERA, and nothing beyond the eye is read, where positions come back mirrored.

    The ray passes the eye's plane at x = 0.3; behind it would be projected to the left half.
    """
    view = front_view(perspective, near=0.1)
    g = one_ray(view, 20, 15, 2.0, (0.15, 0.02, 1.0), rest=50.0)
    left = g.depth.copy()
    left[:, :20] = np.nextafter(np.float32(0.0), np.float32(1.0))  # a hit at any positive depth
    for depth in (g.depth, left):
        out = traced(view, replace(g, depth=depth), thickness=np.inf, **FIXED)
        side = End.LEFT_SCREEN_R if perspective else End.BEHIND_CAMERA
        assert (out.status[15, 20], out.end[15, 20]) == (side + 9, side)
    straight = one_ray(view, 20, 15, 2.0, (1e-3, 0.0, 1.0), rest=50.0)
    out = traced(view, straight, growth="constant", step=0.01)
    assert out.status[15, 20] == Status.BEHIND_CAMERA


@pytest.mark.parametrize("perspective", [True, False])
def test_along_the_view_axis_no_sample_is_tested(perspective: bool) -> None:
    """The middle pixel's ray back to the eye stays in its own pixel."""
    view = front_view(perspective)
    g = one_ray(view, 20, 15, 2.0, (0.0, 0.0, 1.0), rest=1.0)
    for kw in ({}, {"max_distance": np.inf, "max_steps": 9}, {"max_distance": 0.5}):
        out = traced(view, g, **kw)
        end = End.MAX_DISTANCE if kw.get("max_distance") == 0.5 else End.BEHIND_CAMERA
        assert (out.end[15, 20], out.steps[15, 20], out.fetches[15, 20]) == (end, 0, 0)


def test_sides_and_limits() -> None:
    view = front_view()
    for direction, end in (
        ((1.0, 0.0, 0.0), End.LEFT_SCREEN_R),
        ((-1.0, 0.0, 0.0), End.LEFT_SCREEN_L),
        ((0.0, 1.0, 0.0), End.LEFT_SCREEN_T),
        ((0.0, -1.0, 0.0), End.LEFT_SCREEN_B),
        ((0.3, 0.2, -1.0), End.MAX_DISTANCE),
    ):
        g = one_ray(view, 20, 15, 2.0, direction)
        out = traced(view, g)
        assert out.status[15, 20] == end + 9
        assert out.flags[15, 20] == Flag.OVER_EMPTY
        assert out.fetches[15, 20] == out.steps[15, 20]  # one read of an empty pixel
        n = int(out.steps[15, 20])
        # As many steps as there are samples are enough; with one less some remain untested.
        assert traced(view, g, max_steps=n).status[15, 20] == end + 9
        assert traced(view, g, max_steps=n - 1).status[15, 20] == Status.OUT_OF_STEPS


def test_endless_marches_are_refused() -> None:
    for bad in (
        {"max_distance": np.inf},
        {"max_distance": 8.0, "step": 1e-7, "growth": "constant"},
        {"max_distance": 8.0, "step": 1e-15},
    ):
        with pytest.raises(SettingsError, match="max_steps"):
            marching(**bad)
        marching(**bad, max_steps=64)


@pytest.mark.parametrize(
    ("bad", "word"),
    [
        ({"surface": "plane"}, "surface"),
        ({"refine": "rewalk"}, "refine"),
        ({"tracer": "dda", "refine": "secant"}, "refine"),
        ({"listing": True}, "max_steps"),
        ({"tracer": "cells", "listing": True, "max_steps": 5}, "tracer"),
        ({"listing": True, "max_steps": 5, "refine": "secant"}, "secant"),
        ({"step": 0.0}, "step"),
        ({"step": np.inf}, "step"),
        ({"refine_steps": 65}, "refine_steps"),
        ({"growth": "quadratic"}, "growth"),
    ],
)
def test_settings_that_contradict(bad: dict[str, Any], word: str) -> None:
    with pytest.raises(SettingsError, match=word) as caught:
        marching(**bad)
    assert "\n" not in str(caught.value) and "expected" in str(caught.value)


def test_defaults_come_from_the_radius_and_the_tracer() -> None:
    """Spec 5.7: step 2⁻⁷ r. Spec 5.4: the edge's power is 2 for the march, 3 for the others."""
    for tracer, power in (("march", 2.0), ("dda", 3.0), ("cells", 3.0)):
        made = Settings(tracer=tracer).resolved(4.0)  # type: ignore[arg-type]
        assert (made.step, made.edge_power) == (2.0**-5, power)
    assert Settings(tracer="march", edge_power=1.5, step=0.5).resolved(4.0).edge_exponent == 1.5


# ---- What it finds -----------------------------------------------------------------------------


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_small_constant_steps_find_what_exact_cells_find(projection: str) -> None:
    """A step below the slabs' depth and a quarter of a pixel loses few hits, and moves few.

    A sample is a point, a cell an interval: corners cut by less than a step, and contacts within
    the slab's first sample, may differ. Measured: 4 and 1 of 900 hits missed, 97 % within 0.1 px.
    """
    view, g = floor_and_box(projection)
    exact = trace(view, g, resolved((61, 41), tracer="cells", thickness=0.25))
    near = traced(
        view, g, growth="constant", step=2.0**-8, refine_steps=24, thickness=0.25, max_distance=40.0
    )
    a, b = exact.status == Status.HIT, near.status == Status.HIT
    assert a.sum() > 100
    assert (b & ~a).sum() == 0  # a sample in a slab is an interval in a slab
    assert (a & ~b).sum() <= 0.02 * a.sum()
    moved = np.abs(exact.hit_px - near.hit_px)[a & b].max(axis=1)
    assert (moved < 0.1).mean() > 0.95, np.quantile(moved, [0.5, 0.9, 0.95, 0.99, 1.0])


def test_thicker_slabs_are_hit_no_later() -> None:
    """The sample that hits does not come later when every slab grows at its back."""
    view = view_of("perspective", SIZE)
    g = noise_buffers(view, 3)
    lengths = []
    for thickness in (0.0, 0.01, 0.1, 0.5, 2.0, np.inf):
        out = traced(view, g, thickness=thickness, refine="none", **FIXED)
        lengths.append(np.where(out.status == Status.HIT, out.length, np.inf))
    for thin, thick in itertools.pairwise(lengths):
        assert (thick <= thin).all()
    assert (lengths[-1] < lengths[1]).sum() > 50


def test_large_steps_go_through_thin_things() -> None:
    """The march's known hole: a post of 2 px between two samples is not seen; the DDA sees it."""
    view = front_view(False)
    g = one_ray(view, 10, 15, 2.0, (1.0, 0.0, 0.0))
    g.depth[:, 26:28] = 2.0
    kw = {"self_rejection": "none", **FIXED}
    assert traced(view, g, growth="constant", step=1.5, **kw).status[15, 10] == Status.LEFT_SCREEN_R
    assert traced(view, g, growth="constant", step=0.1, **kw).status[15, 10] == Status.HIT
    dda = trace(view, g, resolved((41, 31), **kw))
    assert dda.status[15, 10] == Status.HIT


def nearly_tangent(projection: str) -> tuple[ViewParams, GBuffer]:
    """A floor with shading normals that send its rays 2⁻⁷ above it, in all directions."""
    view = view_of(projection, (61, 41), eye=(1.0, 0.9, 3.2))
    g = draw(view, lone(shapes.grid(8.0, 8.0, 1, 1), np.eye(4)))
    assert g.geo_normal_vs is not None
    n = g.geo_normal_vs.astype(float)

    def unit(v: np.ndarray) -> np.ndarray:
        return v / np.maximum(np.linalg.norm(v, axis=2, keepdims=True), 1e-300)

    along = unit(np.cross(n, np.random.default_rng(2).normal(size=n.shape))) + n * 2.0**-7
    normal = unit(unit(along) - unit(pixel_rays(view))) * n.any(axis=2, keepdims=True)
    return view, replace(g, normal_vs=normal.astype(np.float32))


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_a_mirror_floor_does_not_meet_itself(projection: str) -> None:
    """Nearly tangent rays of a floor alone, bias 0: no hit by rule 4.5, and hundreds without it.

    A pixel's depth is its centre's: in its far half the floor, and a ray just above, are deeper.
    """
    view, g = nearly_tangent(projection)
    kw = {"growth": "constant", "step": 2.0**-6, "max_distance": 1.0, "thickness": 1.0, **FIXED}
    seen = agree(view, g, marching((61, 41), **kw))
    assert seen["HIT"] == 0 and seen["SELF"] > 300
    wrong = traced(view, g, self_rejection="none", **kw)
    assert (wrong.status == Status.HIT).sum() > 300


# ---- Invariance --------------------------------------------------------------------------------


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_scaling_by_a_power_of_two(projection: str) -> None:
    """All lengths times 2ᵏ: positions, counts and statuses keep every byte (spec 2.5)."""
    view = view_of(projection, SIZE)
    g = noise_buffers(view, 11)
    kw = {"jitter": True, "bias": 2.0**-8, "refine": "secant"}
    one = traced(view, g, **kw)
    assert (one.status == Status.HIT).sum() > 30
    for k in (-40, -3, 40):
        scale = 2.0**k
        eye = {n: getattr(view, n) * scale for n in ("eye_x", "eye_y", "eye_z", "near")}
        if not view.perspective:
            across = ("p00", "p11", "fx", "fy")
            eye |= {n: getattr(view, n) / scale for n in across}
            eye |= {n: getattr(view, n) * scale for n in ("inverse_fx", "inverse_fy")}
        scaled = replace(
            g, depth=g.depth * np.float32(scale), back_depth=g.back_depth * np.float32(scale)
        )  # type: ignore[operator]
        lengths = {"step": 2.0**-4, "max_distance": 8.0, "thickness": 0.2, "bias": 2.0**-8}
        lengths = {n: v * scale for n, v in lengths.items()}
        out = traced(view._replace(**eye), scaled, **(kw | lengths))
        same_hits(one, out, (*COUNTS, "hit_px"))
        for name in ("hit_depth", "residual", "length"):
            assert (getattr(one, name) * scale).tobytes() == getattr(out, name).tobytes()


def test_threads_and_chunks_keep_every_byte() -> None:
    view = view_of("off-axis", SIZE)
    g = noise_buffers(view, 31)
    threads = numba.get_num_threads()
    for kw in ({"jitter": True, "refine": "secant"}, {"listing": True, "max_steps": 20}):
        settings = marching(**kw)
        try:
            numba.set_num_threads(1)
            one = trace(view, g, settings)
            numba.set_num_threads(min(2, numba.config.NUMBA_NUM_THREADS))
            two = trace(view, g, settings)
        finally:
            numba.set_num_threads(threads)
        chunked = trace(view, g, settings, lambda share: None)
        same_hits(one, two)
        same_hits(one, chunked)


# ---- The published listing ---------------------------------------------------------------------


def listed(view: ViewParams, g: GBuffer, x: int, y: int, slips: int, **kw: Any) -> Any:
    """One pixel by the listing's kernel with a choice of slips."""
    from ssr_ref.ssr.ray import set_up_ray
    from ssr_ref.ssr.trace import prepare_slabs
    from ssr_ref.vecmath.vec import Vec3

    o = {"step": 2.0**-4, "growth": LINEAR, "jittered": False, "seed": 0, "halvings": 8,
         "max_steps": 30, "max_distance": 8.0, "thickness": 0.2, "bias": 0.0} | kw  # fmt: skip
    slabs = np.empty((view.height, view.width, 2))
    back = np.empty((0, 0), np.float32)
    prepare_slabs(
        view, g.depth, g.geo_normal_vs, back, 0, o["thickness"], back, o["bias"], 0.0, slabs
    )
    n, m = (Vec3(*map(float, image[y, x])) for image in (g.normal_vs, g.geo_normal_vs))  # type: ignore[index]
    ray = set_up_ray(view, x, y, float(g.depth[y, x]), n, m, np.inf)[1]
    return march_listing(
        view, slabs, g.depth, back, ray, o["step"], o["growth"], o["jittered"], o["seed"],
        o["halvings"], o["max_steps"], o["max_distance"], slips,
    )  # fmt: skip


def test_listing_strict_inequality() -> None:
    """A sample exactly on the front, or on the back, is a miss as published."""
    slabs = np.array([[[2.0, 2.5]]])
    for depth, strict, equal in (
        (2.0, False, True),
        (2.5, False, True),
        (2.25, True, True),
        (np.nextafter(2.0, 0.0), False, False),
        (np.nextafter(2.5, 9.0), False, False),
    ):
        assert meets(slabs, 0, 0, depth, True) == strict
        assert meets(slabs, 0, 0, depth, False) == equal


def test_listing_does_not_end_at_the_window() -> None:
    """A ray that leaves on the right goes on over the clamped border pixel, and hits it."""
    view = front_view(False)
    g = one_ray(view, 30, 15, 2.0, (1.0, 0.0, -0.25))
    g.depth[:, 40] = 2.5  # met at x = 2 units beyond the border
    out = listed(view, g, 30, 15, NO_WINDOW, halvings=0)
    assert out.walk.hit.found and out.walk.hit.px == np.nextafter(41.0, 0.0)
    assert out.fade_px > 60.0
    assert not listed(view, g, 30, 15, 0).walk.hit.found


def test_listing_comes_back_mirrored_behind_the_eye() -> None:
    """Perspective: the ray passes the eye on its right; behind, samples read the left half."""
    view = front_view()
    g = one_ray(view, 20, 15, 1.0, (0.15, 0.0, 1.0), rest=5.0)
    p = point_of(view, 20.5, 15.5, 1.0) + np.outer([1.5, 3.0], np.array([0.15, 0.0, 1.0]))
    assert (p[:, 2] > 0.0).all()  # behind the eye
    mirrored = window_of(view, p)
    assert (mirrored[:, 0] < 20.5).all() and (mirrored[:, 0] > 0.0).all()
    out = listed(view, g, 20, 15, NO_WINDOW | NO_DISTANCE)
    assert out.walk.cells == 30 and out.walk.out_of_cells  # every step is spent
    ended = listed(view, g, 20, 15, NO_DISTANCE)
    assert ended.walk.cells < 7 and not ended.walk.out_of_cells


def test_listing_noise_changes_along_the_ray() -> None:
    """Replayed: each increment has the noise of the pixel that the ray was in before it."""
    view = front_view(False)
    g = one_ray(view, 10, 15, 2.0, (1.0, 0.0, 0.0))
    g.depth[:, 30:] = 2.0
    for slips, along in ((NOISE_ALONG, True), (0, False)):
        t, x, i = 0.0, 10, 0
        while x < 30:
            t += (i + jitter(x if along else 10, 15, 3)) * 2.0**-4
            x, i = int(10.5 + 15.5 * t), i + 1
        out = listed(view, g, 10, 15, slips, jittered=True, seed=3, halvings=0)
        assert out.walk.hit.s == pytest.approx(t, rel=1e-14)


def test_listing_hits_its_own_pixel() -> None:
    """Slope 45°, a ray of small steps: deeper than its own pixel's depth at once, if bias is 0."""
    view = front_view(False)
    g = one_ray(view, 10, 15, 2.0, (0.5, 0.0, -1.0))
    kw = {"step": 2.0**-7, "halvings": 0}
    own = listed(view, g, 10, 15, OWN_PIXEL, **kw).walk
    assert own.hit.found and own.cells == 1 and int(own.hit.px) == 10
    assert not listed(view, g, 10, 15, 0, **kw).walk.hit.found
    assert not listed(view, g, 10, 15, OWN_PIXEL, bias=0.19, thickness=0.19, **kw).walk.hit.found


def test_listing_refines_by_the_base_step() -> None:
    """A wall 1 unit behind, met by the seventh increment of 7 steps: halves of one step fall short.

    Orthographic and 45°, step 2⁻⁴: samples at 1, 3, 6, …, 28 steps; the wall at √2 = 22.6 steps.
    Halving the last increment ends within 7/2⁸ steps of it; halving the base step goes back by less
    than one step from 28.
    """
    view = front_view(False)
    g = one_ray(view, 5, 15, 2.0, (1.0, 0.0, -1.0))
    g.depth[:, 9:] = 3.0
    kw = {"thickness": 1.0}
    right = listed(view, g, 5, 15, 0, **kw)
    short = listed(view, g, 5, 15, BASE_STEP, **kw)
    assert right.walk.cells == short.walk.cells == 7
    assert abs(right.walk.hit.s - 2.0**0.5) <= 7 * 2.0**-4 / 2**8
    assert short.walk.hit.s == (28 - 1 + 2.0**-8) * 2.0**-4
    assert short.walk.hit.residual > 0.19


def test_listing_is_not_limited_by_the_distance() -> None:
    view = front_view(False)
    g = one_ray(view, 5, 15, 2.0, (1.0, 0.0, -1.0))
    g.depth[:, 9:] = 3.0
    kw = {"thickness": 1.0, "max_distance": 1.0}
    assert not listed(view, g, 5, 15, 0, **kw).walk.hit.found
    assert listed(view, g, 5, 15, NO_DISTANCE, **kw).walk.hit.s > 1.0


def test_listing_fades_are_those_of_the_sample() -> None:
    view = front_view(False)
    g = one_ray(view, 5, 15, 2.0, (1.0, 0.0, -1.0))
    g.depth[:, 9:] = 3.0
    out = listed(view, g, 5, 15, UNREFINED_FADES, thickness=1.0)
    assert out.fade_length == 28 * 2.0**-4 > out.walk.hit.s
    assert out.fade_px - out.walk.hit.px > 2.0
    fine = listed(view, g, 5, 15, 0, thickness=1.0)
    assert (fine.fade_length, fine.fade_px) == (fine.walk.hit.s, fine.walk.hit.px)


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_the_listing_with_all_slips_is_what_the_setting_runs(projection: str) -> None:
    """Through `trace`: the kernel with ALL_SLIPS, image by image, and only its own statuses."""
    view = view_of(projection, SIZE)
    g = noise_buffers(view, 8)
    kw = {"listing": True, "max_steps": 30, "jitter": True, **FIXED}
    out = traced(view, g, **kw)
    assert out.fade_px is not None and out.fade_length is not None
    walked = np.isin(out.status, (Status.HIT, Status.PASSED_BEHIND, Status.OUT_OF_STEPS))
    assert walked.sum() > 500
    none = (Status.BACKGROUND, Status.NOT_REFLECTIVE, Status.INVALID_INPUT, Status.BELOW_SURFACE)
    assert np.isin(out.status[~walked], none).all()
    for y, x in np.argwhere(walked)[::7]:
        want = listed(view, g, x, y, ALL_SLIPS, jittered=True)
        assert out.steps[y, x] == want.walk.cells and out.fetches[y, x] == want.walk.fetches
        assert (out.status[y, x] == Status.HIT) == want.walk.hit.found
        if want.walk.hit.found:
            assert tuple(out.hit_px[y, x]) == (want.walk.hit.px, want.walk.hit.py)
            assert out.length[y, x] == want.walk.hit.s
            assert tuple(out.fade_px[y, x]) == (want.fade_px, want.fade_py)
            assert out.fade_length[y, x] == want.fade_length
    hit = out.status == Status.HIT
    assert (out.hit_px[hit] >= 0.0).all() and (out.hit_px[hit] < SIZE).all()


def test_a_listed_hit_has_no_end() -> None:
    """A ray that leaves the image within its own pixel is walked all the same, and hits there."""
    view = front_view(False)
    g = one_ray(view, 0, 15, 2.0, (-1.0, 0.0, -1.0))
    kw = {"max_steps": 9, **FIXED}
    assert traced(view, g, **kw).end[15, 0] == End.LEFT_SCREEN_L
    out = traced(view, g, listing=True, **kw)
    assert (out.status[15, 0], out.end[15, 0], out.steps[15, 0]) == (Status.HIT, 0, 1)

"""Why a ray ends: each bound, each reason for no ray, their order, and what may never be hit.

Most images hold one reflective pixel (`one_ray`), so that its ray is known in closed form.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tracing import (
    PROJECTIONS,
    buffers,
    front_view,
    noise_buffers,
    one_ray,
    pixel_rays,
    point_of,
    resolved,
    view_of,
    window_of,
)

from ssr_ref.buffers import STATUS_OF_END, End, Flag, GBuffer, HitBuffer, Status
from ssr_ref.camera import ViewParams
from ssr_ref.ssr.trace import trace

SIZE = (41, 31)
X, Y = 20, 15  # the middle pixel; its ray is the view axis
WALKS: tuple[dict[str, Any], ...] = (
    {"tracer": "cells"},
    {"stride": 1},
    {"stride": 4},
    {"stride": 4, "refine": "none", "jitter": True, "seed": 3},
    {"stride": 1, "interval": "cell", "thickness_from": "constant"},
)


def outcome(view: ViewParams, gbuffer: GBuffer, **kw: Any) -> HitBuffer:
    """The trace of a made-up image."""
    return trace(view, gbuffer, resolved((view.width, view.height), **kw))


def ends(view: ViewParams, gbuffer: GBuffer, at: tuple[int, int] = (X, Y), **kw: Any) -> End:
    """The end of one ray over an empty image, by every walk; its status has the same name."""
    found = set()
    for walk in WALKS:
        hits = outcome(view, gbuffer, **(walk | kw))
        end = End(int(hits.end[at[1], at[0]]))
        assert Status(int(hits.status[at[1], at[0]])).name == end.name
        assert hits.flags[at[1], at[0]] in (0, Flag.OVER_EMPTY)
        found.add(end)
    assert len(found) == 1
    return found.pop()


# --- Bounds ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("perspective", [True, False])
@pytest.mark.parametrize("deeper", [0.0, 0.3, -0.3])
@pytest.mark.parametrize(
    ("direction", "end"),
    [
        ((-1, 0.2), End.LEFT_SCREEN_L),
        ((1, 0.2), End.LEFT_SCREEN_R),
        ((0.2, 1), End.LEFT_SCREEN_T),
        ((0.2, -1), End.LEFT_SCREEN_B),
    ],
)
def test_each_side(
    perspective: bool, deeper: float, direction: tuple[float, float], end: End
) -> None:
    """View y is up and image y down; a ray may leave while it recedes or approaches."""
    view = front_view(perspective, SIZE)
    # Receding rays converge: at slope 0.3 they still leave a 90° image, 1/0.3 > 41/31.
    assert ends(view, one_ray(view, X, Y, 2.0, (*direction, -deeper))) == end


def test_corner_ties_follow_the_order_of_ends() -> None:
    """Left before right before top before bottom: rays exactly through the corners of a square."""
    view = front_view(False, (31, 31))
    for direction, end in (
        ((-1, 1), End.LEFT_SCREEN_L),
        ((-1, -1), End.LEFT_SCREEN_L),
        ((1, 1), End.LEFT_SCREEN_R),
        ((1, -1), End.LEFT_SCREEN_R),
    ):
        # Normal (dx, dy, 1)/√… of a float32 image would tilt the ray: half vectors that are exact.
        gbuffer = one_ray(view, 15, 15, 2.0, (*direction, 0.0))
        exact = np.array([direction[0], direction[1], np.sqrt(2.0)])
        gbuffer.normal_vs[15, 15] = gbuffer.geo_normal_vs[15, 15] = exact
        assert ends(view, gbuffer, (15, 15)) == end


@pytest.mark.parametrize("near", [0.001, 0.1, 5.0])
@pytest.mark.parametrize("degrees", [0.0, 1.0, 10.0])
def test_a_mirror_that_faces_the_camera(near: float, degrees: float) -> None:
    """Straight on and 1° off, the ray ends at the near plane, and hits nothing
    on the other side of the screen, although a wall fills the image behind the near plane."""
    view = front_view(True, SIZE, near)
    depth = 1.01 * near
    angle = np.radians(degrees)
    # Straight on: the reflection of the axis comes back, (0, 0, 1) turned by twice the angle.
    direction = (np.sin(2 * angle), 0.0, np.cos(2 * angle))
    gbuffer = one_ray(view, X, Y, depth, direction)
    assert ends(view, gbuffer) == End.BEHIND_CAMERA
    far = one_ray(view, X, Y, 7.0, direction)
    if degrees == 0.0:
        hits = outcome(view, far)
        assert hits.end[Y, X] == End.BEHIND_CAMERA and hits.steps[Y, X] == 0  # stays in its pixel
    # A mirror over the whole image at one depth: parallel rays, no hit anywhere.
    mirror = np.full((SIZE[1], SIZE[0]), 7.0)
    normal = np.tile([np.sin(angle), 0.0, np.cos(angle)], (*mirror.shape, 1))
    for walk in WALKS:
        kw = {"thickness_from": "constant", "thickness": np.inf} | walk
        hits = outcome(view, buffers(mirror, normal), **kw)
        assert not (hits.status == Status.HIT).any()
        if degrees == 0.0:
            # Off the axis a ray leaves the image before it is back, unless near is large.
            assert hits.end[Y, X] == End.BEHIND_CAMERA
            assert (hits.end <= End.BEHIND_CAMERA).all()
            assert near < 5.0 or (hits.end == End.BEHIND_CAMERA)[10:21, 15:26].all()


def test_near_does_not_matter_to_geometry_beyond_it() -> None:
    """Every byte is the same for near 0.001, 0.1 and 2.9 unless a ray comes back."""
    images = []
    for near in (0.001, 0.1, 2.9):
        view = view_of("perspective", SIZE, near=near)
        images.append(outcome(view, noise_buffers(view, 4)))
    stays = np.all([h.end != End.BEHIND_CAMERA for h in images], axis=0)
    stays &= np.all([h.status == images[0].status for h in images], axis=0)
    # Rays that hit before the near plane change their last bits with it: S and dk do.
    same = stays & (images[0].end > 0)
    assert same.sum() > 200
    for other in images[1:]:
        for name, array in images[0].arrays().items():
            assert np.array_equal(array[same], other.arrays()[name][same], equal_nan=True), name
    hit = stays & (images[0].status == Status.HIT)
    assert hit.sum() > 200
    for other in images[1:]:
        assert np.abs(other.hit_px[hit] - images[0].hit_px[hit]).max() < 1e-9


@pytest.mark.parametrize("perspective", [True, False])
def test_max_distance(perspective: bool) -> None:
    """The ray (1, 0, 0) at depth 2 crosses fx/2 (orthographic: fx) pixels a unit; it ends where
    its length is max_distance, before the side of the image if that is nearer."""
    view = front_view(perspective, SIZE)
    gbuffer = one_ray(view, X, Y, 2.0, (1, 0, 0))
    per_unit = view.fx / (2.0 if perspective else 1.0)
    to_side = (SIZE[0] - (X + 0.5)) / per_unit
    assert ends(view, gbuffer, max_distance=0.99 * to_side) == End.MAX_DISTANCE
    assert ends(view, gbuffer, max_distance=1.01 * to_side) == End.LEFT_SCREEN_R
    for length in (0.3, 0.6, 0.9):
        hits = outcome(view, gbuffer, max_distance=length, tracer="cells")
        # Cells after the own one: floor(½ + S), S pixels.
        assert hits.steps[Y, X] == np.floor(0.5 + length * per_unit)


def test_reach_is_a_length_not_a_count_of_pixels() -> None:
    """A hit at length 1.5 is found from 4 and from 8 units away unless
    max_distance is less, whatever number of pixels that is."""
    for distance in (4.0, 8.0):
        view = front_view(True, (161, 121))
        gbuffer = one_ray(view, 80, 60, distance, (1, 0, 0))
        column = int(
            window_of(view, point_of(view, 80.5 + 1.5 * view.fx / distance, 60.5, distance))[0]
        )
        gbuffer.depth[:, column] = 0.98 * distance  # the float32 normal tilts the ray a little
        assert outcome(view, gbuffer, max_distance=1.7).status[60, 80] == Status.HIT
        assert outcome(view, gbuffer, max_distance=1.3).end[60, 80] == End.MAX_DISTANCE


@pytest.mark.parametrize("perspective", [True, False])
def test_out_of_steps_only_if_samples_remained(perspective: bool) -> None:
    """From pixel 20 to the right of 41 there are 20 pixels: 20 steps suffice, 19 do not."""
    view = front_view(perspective, SIZE)
    gbuffer = one_ray(view, X, Y, 2.0, (1, 0, 0))
    for walk in ({"tracer": "cells"}, {"stride": 1}):
        assert outcome(view, gbuffer, **walk).steps[Y, X] == 20
        hits = outcome(view, gbuffer, max_steps=20, **walk)
        assert hits.status[Y, X] == Status.LEFT_SCREEN_R and hits.steps[Y, X] == 20
        hits = outcome(view, gbuffer, max_steps=19, **walk)
        assert hits.status[Y, X] == Status.OUT_OF_STEPS == hits.end[Y, X] + STATUS_OF_END
        assert hits.steps[Y, X] == hits.fetches[Y, X] == 19
    # Stride 4: samples at 4, 8, 12, 16, 20 and, as 20 + 2 > S = 20.5, none in between.
    assert outcome(view, gbuffer, stride=4, refine="none").steps[Y, X] == 5
    # Stride 16: one at 16, whose interval ends at S.
    assert outcome(view, gbuffer, stride=16, refine="none").steps[Y, X] == 1
    # Stride 64: none below S, so one in the middle of [½, S].
    assert outcome(view, gbuffer, stride=64, refine="none").steps[Y, X] == 1


@pytest.mark.parametrize(
    ("perspective", "direction", "max_distance", "end"),
    [
        (True, (0, 0, 1), np.inf, End.BEHIND_CAMERA),
        (False, (0, 0, 1), np.inf, End.BEHIND_CAMERA),
        (False, (0, 0, 1), 0.5, End.MAX_DISTANCE),
        (True, (0.001, 0, 1), 0.5, End.MAX_DISTANCE),
    ],
)
def test_a_ray_that_stays_in_its_pixel_has_no_sample(
    perspective: bool, direction: tuple[float, float, float], max_distance: float, end: End
) -> None:
    """Spec 4.1: S ≤ ½, the status is the end's and nothing is nudged."""
    view = front_view(perspective, SIZE)
    gbuffer = one_ray(view, X, Y, 2.0, direction, rest=1.0)
    for walk in WALKS:
        hits = outcome(view, gbuffer, max_distance=max_distance, **walk)
        assert hits.end[Y, X] == end and hits.status[Y, X] == end + STATUS_OF_END
        assert hits.steps[Y, X] == hits.fetches[Y, X] == hits.flags[Y, X] == 0


def test_an_endless_ray_walks_to_its_vanishing_point() -> None:
    """max_distance = inf and a direction inside the image: S is finite and the depth at S +inf."""
    view = front_view(True, SIZE)
    origin, direction = (3, 15), np.array([0.5, 0.1, -1.0])
    gbuffer = one_ray(view, *origin, 2.0, direction)
    assert ends(view, gbuffer, origin) == End.MAX_DISTANCE
    vanishing = window_of(view, direction)
    cells = abs(int(vanishing[0]) - 3) + abs(int(vanishing[1]) - 15)
    hits = outcome(view, gbuffer, tracer="cells")
    assert hits.steps[origin[1], origin[0]] == cells
    # The pixel of the vanishing point is hit however far its surface is.
    gbuffer.depth[int(vanishing[1]), int(vanishing[0])] = 1e30
    hits = outcome(view, gbuffer, tracer="cells")
    assert hits.status[origin[1], origin[0]] == Status.HIT
    assert abs(hits.hit_depth[origin[1], origin[0]] / 1e30 - 1) < 1e-6


# --- Pixels without a ray, and the order of reasons -----------------------------------------------


def all_bad(projection: str) -> tuple[ViewParams, GBuffer, np.ndarray]:
    """A wall of valid pixels; row by row one defect more, from the last of 5.1's list to the
    first: the status of each row is the defect added there."""
    view = view_of(projection, (9, 7))
    unit = pixel_rays(view) / np.linalg.norm(pixel_rays(view), axis=2, keepdims=True)
    depth = np.full((7, 9), 3.0)
    normal, geo = -unit.copy(), -unit.copy()
    reflectivity = np.ones((7, 9, 3))
    want = np.zeros((7, 9), int)
    # Row 1 on: the shading normal turned so far that the ray goes below the geometric surface.
    side = np.cross(unit, [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side, axis=2, keepdims=True)
    normal[1:] = (side - 0.5 * unit)[1:]
    want[1] = Status.BELOW_SURFACE
    # Rows 2 and 3: bad depths and normals. Row 4: black. Row 5 on: background.
    bad_depth = [np.nan, -np.inf, 0.0, -0.0, -1.0]
    depth[2, :5] = bad_depth
    depth[4, :5] = bad_depth
    geo[2, 5] = 0.0
    normal[2, 6] = 0.0
    geo[2, 7, 1] = np.nan
    normal[2, 8, 2] = np.inf
    geo[3] = unit[3]  # faces away
    geo[3, 0] = np.cross(unit[3, 0], [0.0, 1.0, 0.0])  # edge-on: n·d = 0 up to rounding
    geo[3, 0] += 1e-3 * unit[3, 0]
    want[2:4] = Status.INVALID_INPUT
    reflectivity[4:6] = 0.0
    want[4] = Status.NOT_REFLECTIVE
    depth[5:] = np.inf
    geo[6] = np.nan
    normal[6] = 0.0
    want[5:] = Status.BACKGROUND
    return view, buffers(depth, geo, normal=normal, reflectivity=reflectivity), want


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_pixels_without_a_ray_in_the_order_of_5_1(projection: str) -> None:
    view, gbuffer, want = all_bad(projection)
    for walk in WALKS:
        hits = outcome(view, gbuffer, **walk)
        assert (hits.status[1:] == want[1:]).all(), hits.status
        assert (hits.status[0] > Status.BELOW_SURFACE).all()
        without = hits.status <= Status.BELOW_SURFACE
        for array in (hits.end, hits.flags, hits.steps, hits.fetches):
            assert not array[without & (hits.status != Status.HIT)].any()
        for array in (hits.hit_px, hits.hit_depth, hits.residual, hits.length):
            assert np.isnan(array[without & (hits.status != Status.HIT)]).all()


def test_not_reflective_needs_every_channel_to_be_0() -> None:
    view = front_view(True, (5, 3))
    gbuffer = one_ray(view, 2, 1, 2.0, (1, 0, 0))
    for channel in range(3):
        gbuffer.reflectivity[1, 2] = np.eye(3)[channel]
        assert outcome(view, gbuffer).status[1, 2] == Status.LEFT_SCREEN_R


@pytest.mark.parametrize("scale", [0.1, 10.0])
@pytest.mark.parametrize("projection", PROJECTIONS)
def test_the_length_of_a_normal_does_not_matter(scale: float, projection: str) -> None:
    """Statuses stay, hits move by rounding only. ε of 4.5 scales with n, and not with
    m; float32 rounds the scaled normals anew, 2⁻²⁴ of a direction each."""
    view = view_of(projection, SIZE)
    gbuffer = noise_buffers(view, 6)
    scaled = replace(
        gbuffer,
        normal_vs=(gbuffer.normal_vs * scale).astype(np.float32),
        geo_normal_vs=(gbuffer.geo_normal_vs * scale).astype(np.float32),
    )
    for walk in WALKS:
        a, b = outcome(view, gbuffer, **walk), outcome(view, scaled, **walk)
        assert (a.status == b.status).all() and (a.end == b.end).all()
        hit = a.status == Status.HIT
        assert hit.sum() > 100
        assert np.abs(a.hit_px[hit] - b.hit_px[hit]).max() < 1e-4
    # By a power of two nothing changes at all.
    twice = replace(
        gbuffer, normal_vs=gbuffer.normal_vs * 4, geo_normal_vs=gbuffer.geo_normal_vs * 4
    )
    a, b = outcome(view, gbuffer), outcome(view, twice)
    assert a.hit_px.tobytes() == b.hit_px.tobytes() and (a.flags == b.flags).all()


# --- What may be hit ------------------------------------------------------------------------------


def post(depth: float, back: float = np.inf, columns: int = 5) -> tuple[ViewParams, GBuffer]:
    """A ray at depth 2 to the right, and a column of pixels to its right with this depth.

    The normal (1, 0, 1) reflects (0, 0, −1) exactly into (1, 0, 0), up to one rounding.
    """
    view = front_view(False, SIZE)
    gbuffer = one_ray(view, X, Y, 2.0, (1, 0, 0))
    assert gbuffer.back_depth is not None
    gbuffer.depth[:, X + columns] = depth
    gbuffer.back_depth[:, X + columns] = back
    return view, gbuffer


SEES_EVERY_COLUMN = [w for w in WALKS if "jitter" not in w]


@pytest.mark.parametrize("walk", SEES_EVERY_COLUMN)
def test_slab_and_flags(walk: dict[str, Any]) -> None:
    """The ray is at depth 2 everywhere (4.4): equality hits at both ends of the slab."""

    def run(depth: float, back: float = np.inf, **kw: Any) -> tuple[Status, Flag, float]:
        # Re-walked cells set no flags: at stride 4 the sample must be on the column, 20 + 4.
        view, gbuffer = post(depth, back, 4 if walk.get("stride") == 4 else 5)
        hits = outcome(view, gbuffer, **({"thickness": 0.25} | walk | kw))
        status, flags = Status(int(hits.status[Y, X])), Flag(int(hits.flags[Y, X]))
        return status, flags & ~Flag.OVER_EMPTY, float(hits.residual[Y, X])

    below = float(np.nextafter(np.float32(1.75), np.float32(0)))
    above = float(np.nextafter(np.float32(2), np.float32(3)))
    assert run(2.0) == (Status.HIT, Flag.OPEN, 0.0)
    assert run(1.75) == (Status.HIT, Flag.OPEN, 0.25)  # on the back
    assert run(below)[:2] == (Status.PASSED_BEHIND, Flag.PASSED_BEHIND)
    assert run(above)[:2] == (Status.LEFT_SCREEN_R, Flag(0))
    assert run(1.75, bias=0.25) == (Status.HIT, Flag.OPEN, 0.25)
    assert run(1.75, bias=0.2500001)[0] == Status.LEFT_SCREEN_R
    if "thickness_from" not in walk:
        assert run(1.0, 2.0) == (Status.HIT, Flag(0), 1.0)  # back faces: no thickness needed
        assert run(1.0, 1.999)[:2] == (Status.PASSED_BEHIND, Flag.PASSED_BEHIND)


@pytest.mark.parametrize("walk", [{"tracer": "cells"}, {"stride": 1}])
def test_self_rejection_and_its_place_in_the_order(walk: dict[str, Any]) -> None:
    """Spec 4.5 and 5.1: SELF for a coplanar pixel in the slab; PASSED_BEHIND goes before it.

    The origin's plane recedes by 1 unit a unit to the right, the ray by 0.95, so after 5 pixels
    the ray is 5 · 0.05 pixels' worth in front of the plane and its interval, ± ½ · 0.95, reaches
    it.
    """
    view = front_view(False, SIZE)
    gbuffer = one_ray(view, X, Y, 2.0, (1.0, 0.0, -0.95))
    gbuffer.geo_normal_vs[Y] = (1.0, 0.0, 1.0)

    def run(**kw: Any) -> tuple[Status, Flag]:
        hits = outcome(view, gbuffer, **walk, **kw)
        flags = Flag(int(hits.flags[Y, X])) & ~Flag.OVER_EMPTY & ~Flag.OPEN
        return Status(int(hits.status[Y, X])), flags

    plane = 2.0 + 5.0 / view.fx
    gbuffer.depth[Y, X + 5] = plane
    assert run() == (Status.SELF, Flag.SELF_REJECTED)
    assert run(self_rejection="none") == (Status.HIT, Flag(0))
    # ε is a few 2⁻⁸ of a pixel's depth: a tenth of a pixel above the plane is a hit.
    gbuffer.depth[Y, X + 5] = plane - 0.1 / view.fx
    assert run() == (Status.HIT, Flag(0))
    gbuffer.depth[Y, X + 5] = plane - 0.0001 / view.fx
    assert run() == (Status.SELF, Flag.SELF_REJECTED)
    # Something thin in front of the ray, two pixels on.
    gbuffer.depth[Y, X + 2] = 1.0
    both = Flag.SELF_REJECTED | Flag.PASSED_BEHIND
    assert run() == (Status.PASSED_BEHIND, both)


@pytest.mark.parametrize("walk", WALKS)
@pytest.mark.parametrize("bad", ["nan", "zero", "negative", "-inf", "away", "zero normal", "inf"])
def test_bad_targets_count_as_empty(walk: dict[str, Any], bad: str) -> None:
    """Spec 4.4: a target with NaN or non-positive depth, or n_g·d ≥ 0, is an empty pixel."""
    view, gbuffer = post(2.0)
    assert outcome(view, gbuffer).status[Y, X] == Status.HIT
    column = np.s_[:, X + 5]
    depths = {"nan": np.nan, "zero": 0.0, "negative": -2.0, "-inf": -np.inf, "inf": np.inf}
    if bad in depths:
        gbuffer.depth[column] = depths[bad]
    else:
        gbuffer.geo_normal_vs[column] = (0, 0, -1) if bad == "away" else (0, 0, 0)
    hits = outcome(view, gbuffer, **walk)
    assert hits.status[Y, X] == Status.LEFT_SCREEN_R
    assert hits.flags[Y, X] == Flag.OVER_EMPTY


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_background_is_never_hit_and_looks_of_it_do_not_matter(projection: str) -> None:
    """Normals, back depths and R of empty pixels are never looked at."""
    view = view_of(projection, SIZE)
    gbuffer = noise_buffers(view, 12)
    empty = np.isinf(gbuffer.depth)
    assert empty.sum() > 100
    junk = replace(
        gbuffer,
        back_depth=np.where(empty, np.float32(1.0), gbuffer.back_depth),
        geo_normal_vs=np.where(empty[..., None], np.float32(np.nan), gbuffer.geo_normal_vs),
        normal_vs=np.where(empty[..., None], np.float32(7.0), gbuffer.normal_vs),
        reflectivity=np.where(empty[..., None], np.float32(0.0), gbuffer.reflectivity),
    )
    for walk in WALKS:
        a, b = outcome(view, gbuffer, **walk), outcome(view, junk, **walk)
        for name, array in a.arrays().items():
            assert array.tobytes() == b.arrays()[name].tobytes(), name
        assert (a.status == Status.HIT).sum() > 100


@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize("bias", [0.0, 0.03])
def test_hits_lie_in_their_slab(projection: str, bias: float) -> None:
    """Bias ≤ residual ≤ thickness, or ≤ back − front where there is a back face."""
    view = view_of(projection, SIZE)
    for seed in range(3):
        gbuffer = noise_buffers(view, seed)
        assert gbuffer.back_depth is not None
        # No slab [front + bias, back] is inside out: the specification does not say what it is.
        gbuffer.back_depth[:] += np.float32(0.05)
        for walk in WALKS:
            hits = outcome(view, gbuffer, thickness=0.1, bias=bias, **walk)
            hit = hits.status == Status.HIT
            px = hits.hit_px[hit].astype(int)
            front = gbuffer.depth[px[:, 1], px[:, 0]].astype(float)
            back = gbuffer.back_depth[px[:, 1], px[:, 0]].astype(float)
            residual = hits.residual[hit]
            is_open = (hits.flags[hit] & Flag.OPEN) > 0
            assert hit.sum() > 50
            assert (residual >= bias * (1 - 1e-9)).all()
            assert (residual[is_open] <= 0.1).all()
            constant = "thickness_from" in walk
            assert is_open.all() or not constant
            # An interval of a column may find its depth outside the pixel that was read.
            if "interval" in walk or "tracer" in walk:
                assert (is_open == ((back == np.inf) | constant)).all()
                assert np.abs(residual - (hits.hit_depth[hit] - front)).max() < 1e-12
                assert (residual <= np.where(is_open, 0.1, back - front)).all()


def test_every_number_is_there_exactly_where_it_should_be() -> None:
    """Whatever the input, every number is finite where it must be."""
    for projection in PROJECTIONS:
        view = view_of(projection, SIZE)
        for walk in WALKS:
            hits = outcome(view, noise_buffers(view, 20), **walk)
            hit = hits.status == Status.HIT
            for name, array in hits.arrays().items():
                if array.dtype == np.float64:
                    assert np.isfinite(array[hit]).all(), name
                    assert np.isnan(array[~hit]).all(), name
            assert (hits.status != Status.NOT_COMPUTED).all()
            assert ((hits.hit_px[hit] >= 0) & (hits.hit_px[hit] <= SIZE)).all()
            assert ((hits.end > 0) == (hits.status > Status.BLOCKED)).all()

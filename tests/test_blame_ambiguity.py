"""The ambiguity mask: each bit by hand on a made-up buffer, and reruns that change nothing."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from blame_frames import render, same_bytes
from tracing import front_view, one_ray, resolved, same_hits, view_of

from ssr_ref import SsrRefError
from ssr_ref.analytic.scenes import SCENES
from ssr_ref.blame import MOVE_PX, Rerun, ambiguity
from ssr_ref.blame.ambiguity import changed, rerun, with_depths_moved
from ssr_ref.buffers import GBuffer, HitBuffer, Status
from ssr_ref.ssr.ray import set_up_ray, start_ray
from ssr_ref.ssr.trace import trace
from ssr_ref.vecmath.vec import Vec3

pytestmark = pytest.mark.slow  # compiles much

NOTHING = Rerun(0)
X, Y = 5, 15
"""The only pixel that reflects."""
TRACERS: tuple[dict[str, Any], ...] = (
    {"tracer": "cells"},
    {},
    {"stride": 4},
    {"tracer": "march", "step": 1 / 64, "growth": "constant", "max_distance": 16.0},
    {"surface": "plane", "tracer": "cells"},
    {"surface": "plane"},
)
EXACT = TRACERS[:3]
"""Those whose answer at an equality is known; planes and the march have their own rounding."""
VIEW = front_view(perspective=False)
"""41 × 31 pixels, 2 units high: 15.5 px a unit."""


def mask(gbuffer: GBuffer, quantum: Any = None, **options: Any) -> tuple[Status, Rerun]:
    """Status and bits of the reflecting pixel; the others have none."""
    settings = resolved((41, 31), **({"thickness_from": "constant"} | options))
    before = trace(VIEW, gbuffer, settings)
    bits = np.zeros((31, 41), np.uint8)
    for bit in Rerun:
        bits[changed(before, rerun(VIEW, gbuffer, settings, bit, quantum))] |= np.uint8(bit)
    assert np.delete(bits.ravel(), Y * 41 + X).max() == 0
    return Status(int(before.status[Y, X])), Rerun(int(bits[Y, X]))


def wall(direction: tuple[float, float, float], depth: float, rows: slice, *,
         rest: float = np.inf) -> GBuffer:  # fmt: skip
    """One ray from depth 1, and a wall that faces the eye from column 20 on in some rows."""
    gbuffer = one_ray(VIEW, X, Y, 1.0, direction, rest=rest)
    gbuffer.depth[rows, 20:] = depth
    return gbuffer


@pytest.mark.parametrize("options", TRACERS, ids=str)
def test_the_middle_of_a_wall_is_certain(options: dict[str, Any]) -> None:
    """A ray that goes deep into a wall of depth 1.5 and meets it at column 21."""
    gbuffer = wall((1.0, 0.0, -0.5), 1.5, slice(None), rest=1.5)
    assert mask(gbuffer, thickness=1.0, **options) == (Status.HIT, NOTHING)


@pytest.mark.parametrize("options", [o for o in TRACERS if o.get("stride") != 4], ids=str)
def test_a_silhouette_hangs_on_the_start(options: dict[str, Any]) -> None:
    """The ray ends at row 15.9975, over a wall that begins in row 16 and has the ray's depth a
    quarter of a pixel before its end: 0.01 px further down meets it there, 0.01 px to the side
    moves it by 0.00014 rows. So with the picture turned over.
    """
    slope, depth = 0.4975 / 35.5, 1.0 + 0.25 * 35.25 / 15.5
    below = wall((1.0, -slope, -0.25), depth, slice(16, None))
    found = mask(below, thickness=1.0, **options)
    assert found == (Status.LEFT_SCREEN_R, Rerun.START_DOWN)
    above = wall((1.0, slope, -0.25), depth, slice(None, 15))
    found = mask(above, thickness=1.0, **options)
    assert found == (Status.LEFT_SCREEN_R, Rerun.START_UP)


def test_a_corner_hangs_on_the_start_both_ways() -> None:
    """A ray at about 45° that comes to the lower left corner (20, 30) of a wall, in row 29 from
    column 20 on, at x = 19.995: 0.01 px to the right or up takes it in, left or down does not.
    """
    gbuffer = wall((1.0, -14.5 / 14.495, 0.0), 0.75, slice(29, 30))
    found = mask(gbuffer, thickness=1.0, tracer="cells")
    assert found == (Status.LEFT_SCREEN_B, Rerun.START_RIGHT | Rerun.START_UP)


def between_two_floats(depth: float) -> GBuffer:
    """A wall in columns 20 to 30, and a ray that is deeper than 1 by less than an ulp there.

    The normal (1, 0, 1 − 2⁻²⁴), exact in float32, turns the view ray by a right angle and a slope
    of 2⁻²⁴: depth is 1 + 0.935·2⁻²⁴ where the wall begins and 1 + 1.65·2⁻²⁴ where it ends, between
    the float32 numbers 1 and 1 + 2·2⁻²⁴.
    """
    gbuffer = wall((1.0, 0.0, 0.0), depth, slice(None))
    gbuffer.depth[:, 31:] = np.inf
    for normal in (gbuffer.normal_vs, gbuffer.geo_normal_vs):
        assert normal is not None
        normal[Y, X] = 1.0, 0.0, 1.0 - 2.0**-24
    return gbuffer


@pytest.mark.parametrize("options", EXACT, ids=str)
def test_a_front_hangs_on_an_ulp(options: dict[str, Any]) -> None:
    """A front of 1 is met, the next float32 is not."""
    gbuffer = between_two_floats(1.0)
    assert mask(gbuffer, thickness=0.25, **options) == (Status.HIT, Rerun.FARTHER)


@pytest.mark.parametrize("options", EXACT, ids=str)
def test_a_back_hangs_on_an_ulp_and_on_thickness(options: dict[str, Any]) -> None:
    """A slab that ends at 1 + 2⁻²⁴ is met where it begins; an ulp of 0.75, 2⁻²⁴, less it is not."""
    gbuffer = between_two_floats(0.75)
    bits = Rerun.NEARER | Rerun.THINNER
    thickness = 0.25 + 2.0**-24
    assert mask(gbuffer, thickness=thickness, **options) == (Status.HIT, bits)
    # Each material's own thickness is changed alike.
    own = replace(gbuffer, thickness=np.full((31, 41), thickness, np.float32))
    material = {"thickness_from": "material", "thickness": 9.0}
    assert mask(own, **material, **options) == (Status.HIT, bits)
    # A back face at the float32 after 1 in the place of it: no thickness is read.
    assert gbuffer.back_depth is not None
    gbuffer.back_depth[:, 20:31] = 1.0 + 2.0**-23
    faces = {"thickness_from": "back_faces", "thickness": 0.25}
    assert mask(gbuffer, **faces, **options) == (Status.HIT, Rerun.NEARER)


def test_a_thicker_wall_is_met() -> None:
    """It ends at 0.75 + 0.24851 = 0.99851: 1 % more reaches 1.000995."""
    gbuffer = wall((1.0, 0.0, 0.0), 0.75, slice(None))
    found = mask(gbuffer, thickness=0.24851, tracer="cells")
    assert found == (Status.PASSED_BEHIND, Rerun.THICKER)


@pytest.mark.parametrize(
    ("quantum", "bits"),
    [(None, 0), (2.0**-6, 0), (2.0**-4, Rerun.NEARER | Rerun.FARTHER)],
)
def test_a_quantum_in_the_place_of_an_ulp(quantum: float | None, bits: int) -> None:
    """A ray of depth 1 in a slab from 31/32 to 33/32: a step of 1/64 keeps it, 1/16 does not."""
    gbuffer = wall((1.0, 0.0, 0.0), 31 / 32, slice(None))
    assert mask(gbuffer, quantum, thickness=1 / 16, tracer="cells") == (Status.HIT, bits)
    image = None if quantum is None else np.full((31, 41), quantum)
    assert mask(gbuffer, image, thickness=1 / 16, tracer="cells") == (Status.HIT, bits)


def test_a_hit_that_moves_by_more_than_a_pixel() -> None:
    """Status stays HIT: 1 px is the same answer, 1.125 px and no place are not."""

    def hits(columns: list[float], status: Status = Status.HIT) -> HitBuffer:
        n = len(columns)
        px = np.stack([np.array([columns]), np.full((1, n), 0.5)], axis=2)
        zero = np.zeros((1, n))
        return HitBuffer(
            np.full((1, n), status, np.uint8), zero.astype(np.uint8), zero.astype(np.uint8), px,
            zero, zero, zero, zero.astype(np.uint32), zero.astype(np.uint32),
        )  # fmt: skip

    before, after = hits([1.0, 1.0, 1.0, 1.0]), hits([1.0, 2.0, 2.125, np.nan])
    assert changed(before, after).tolist() == [[False, False, True, True]]
    nan = [np.nan, np.nan]
    assert not changed(hits(nan, Status.SELF), hits(nan, Status.SELF)).any()
    assert changed(hits(nan, Status.SELF), hits(nan, Status.PASSED_BEHIND)).all()


# ---- What a rerun changes, and what it keeps ---------------------------------------------------


@pytest.mark.parametrize("projection", ["off-axis", "orthographic"])
def test_a_moved_start_keeps_depth_and_direction(projection: str) -> None:
    view = view_of(projection)
    n = Vec3(0.3, 0.8, 0.6)
    zero = Vec3(0.0, 0.0, 0.0)
    args = (view, 11, 7, 4.0, n, n, np.inf)
    status, ray = set_up_ray(*args)
    _, same = start_ray(*args, 0.0, 0.0, zero)
    _, moved = start_ray(*args, MOVE_PX, -MOVE_PX, zero)
    assert status == 0 and same == ray
    assert (moved.p0_x, moved.p0_y) == (11.5 + MOVE_PX, 7.5 - MOVE_PX)
    assert (moved.k0, moved.direction_vs, moved.origin_depth) == (
        ray.k0,
        ray.direction_vs,
        ray.origin_depth,
    )
    assert moved.origin_vs != ray.origin_vs and moved.origin_vs.z == ray.origin_vs.z
    _, turned = start_ray(*args, 0.0, 0.0, Vec3(0.6, 0.8, 0.0))
    assert turned.direction_vs == (0.6, 0.8, 0.0)
    assert turned.origin_vs == ray.origin_vs


METHODS: tuple[dict[str, Any], ...] = (
    {},
    {"stride": 5, "jitter": True},
    {"tracer": "cells", "thickness_from": "slope"},
    {"tracer": "march"},
    {"tracer": "march", "listing": True, "max_steps": 32},
    {"surface": "plane", "tracer": "cells"},
    {"surface": "plane", "stride": 3},
    {"buffer_dtype": "float64"},
)


@pytest.mark.parametrize("options", METHODS, ids=str)
def test_a_rerun_of_nothing_has_the_bytes_of_the_trace(options: dict[str, Any]) -> None:
    frame = render(SCENES["clutter"](), **({"thickness": 0.3, "max_distance": 9.0} | options))
    view = frame.camera.params(frame.settings.size)
    stored = {name: array.copy() for name, array in frame.gbuffer.arrays().items()}
    same_hits(frame.hits, rerun(view, frame.gbuffer, frame.settings, NOTHING))

    # The mask: rays alone, not many, and the buffers are as they were.
    bits = ambiguity(frame)
    ray = (frame.hits.status == Status.HIT) | (frame.hits.status >= Status.BLOCKED)
    assert bits.dtype == np.uint8 and not bits[~ray].any()
    assert (bits != 0).sum() < 0.2 * ray.sum()
    for name, array in frame.gbuffer.arrays().items():
        assert same_bytes(array, stored[name]), name


def test_rays_start_where_they_did() -> None:
    """Every depth moves but the ray's own: alone on the screen it is the same ray to the bit."""
    gbuffer = one_ray(VIEW, X, Y, 1.0, (1.0, 0.2, -0.5))
    settings = resolved((41, 31), tracer="cells")
    before = trace(VIEW, gbuffer, settings)
    for bit in (Rerun.NEARER, Rerun.FARTHER):
        same_hits(before, rerun(VIEW, gbuffer, settings, bit, 0.25))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_steps_of_a_depth(dtype: Any) -> None:
    """One ulp of the type either way; only finite depths above 0 move, and stay so."""
    huge, tiny = np.finfo(dtype).max, np.nextafter(dtype(0), dtype(1))
    depth = np.array([[1.0, np.inf, np.nan, -1.0, 0.0, huge, tiny]], dtype)
    gbuffer = GBuffer(depth=depth, triangle_id=np.zeros((1, 7), np.int32), back_depth=depth)
    for way in (-1, 1):
        for quantum in (None, 0.0, 2.0**-70):
            moved = with_depths_moved(gbuffer, way, quantum)
            assert moved.back_depth is not None
            assert same_bytes(moved.depth, moved.back_depth) and moved.depth.dtype == dtype
            assert moved.depth[0, 0] == np.nextafter(dtype(1), dtype(1 + way))
            assert same_bytes(moved.depth[0, 1:5], depth[0, 1:5])
            assert moved.depth[0, 6] > 0 and np.isfinite(moved.depth[0, 5])
    assert with_depths_moved(gbuffer, -1, 2.0).depth[0, 0] == tiny
    assert with_depths_moved(gbuffer, 1, np.full((1, 7), 0.5)).depth[0, 0] == 1.5


@pytest.mark.parametrize(
    ("quantum", "message"),
    [(np.zeros((2, 3)), r"shape \(2, 3\); expected one number or \(23, 37\)"),
     (-1.0, "below 0"), (np.nan, "not finite")],
)  # fmt: skip
def test_a_bad_quantum_is_refused(quantum: Any, message: str) -> None:
    frame = render(SCENES["sphere_on_plane"]())
    with pytest.raises(SsrRefError, match=message):
        ambiguity(frame, quantum=quantum)

"""Clipping and setting up a reflected ray; walks never go back, in float64 and in float32."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from maths_checks import check_clip

from ssr_ref import Camera, End, MathsError, Status, clip_ray, ray_setup
from ssr_ref.maths.rays import STUDY_CAMERA, STUDY_SIZE
from ssr_ref.study import oracle_ray
from ssr_ref.study.sampling import examples

WIDE = Camera.frustum(np.eye(4), -1.0, 1.0, -1.0, 1.0, near=0.5)
SIZE = (8, 6)


def test_clip() -> None:
    check_clip(clip_ray)


def test_bounds_by_hand() -> None:
    """Frustum |x|, |y| ≤ depth, near ½, from (0, 0, −4)."""
    cases = {
        (-1.0, 0.0, 0.0): (4.0, End.LEFT_SCREEN_L),
        (2.0, 0.0, 0.0): (4.0, End.LEFT_SCREEN_R),
        (0.0, 1e-9, 0.0): (4.0, End.LEFT_SCREEN_T),
        (0.0, -1e200, 0.0): (4.0, End.LEFT_SCREEN_B),
        (0.0, 0.0, 1.0): (3.5, End.BEHIND_CAMERA),
        (0.0, 0.0, -1.0): (np.inf, End.MAX_DISTANCE),
        (3.0, 0.0, 4.0): (20.0 / 7.0, End.LEFT_SCREEN_R),
    }
    directions = np.array(list(cases))
    found = clip_ray(WIDE, SIZE, (0.0, 0.0, -4.0), directions)
    for i, (t, end) in enumerate(cases.values()):
        assert found.end[i] == end
        assert found.t[i] == t or abs(found.t[i] - t) < 1e-15 * t
    assert found.clip[4].tolist() == [0.0, 0.0, 0.5]
    assert found.clip[5].tolist() == [0.0, 0.0, 1.0], "the vanishing point of an endless ray"
    assert clip_ray(WIDE, SIZE, (0.0, 0.0, -4.0), (1.0, 0.0, 0.0), 2.5).t == 2.5


def test_no_ray() -> None:
    """No point before the eye, no direction, no distance: NONE and NaN."""
    for o, d, limit in (
        ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 1.0),
        ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0),
        ((0.0, np.nan, -1.0), (1.0, 0.0, 0.0), 1.0),
        ((0.0, 0.0, -1.0), (0.0, 0.0, 0.0), 1.0),
        ((0.0, 0.0, -1.0), (np.inf, 0.0, 0.0), 1.0),
        ((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), -1.0),
        ((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), np.nan),
    ):
        found = clip_ray(WIDE, SIZE, o, d, limit)
        assert found.end == End.NONE and np.isnan(found.t) and np.isnan(found.clip).all()


def test_orthographic_clip() -> None:
    camera = Camera.orthographic(np.eye(4), 4.0, 2.0, near=0.25)
    found = clip_ray(camera, SIZE, (1.0, 0.5, -3.0), [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert found.t.tolist() == [3.0, 2.75]
    assert found.end.tolist() == [End.LEFT_SCREEN_R, End.BEHIND_CAMERA]
    assert (found.clip[:, 2] == 1.0).all()


finite = st.floats(-1e3, 1e3, width=32)


@settings(max_examples=200, derandomize=True, deadline=None)
@given(
    st.tuples(finite, finite), st.floats(-30, 30), st.tuples(finite, finite, finite),
    st.floats(-40, -1),
)  # fmt: skip
def test_clip_never_yields_w_at_or_below_zero(
    across: tuple[float, float], depth: float, direction: tuple[float, ...], near: float
) -> None:
    """Any origin in front of the near plane, any direction, near planes down to 2⁻⁴⁰."""
    camera = Camera.frustum(np.eye(4), -0.75, 1.25, -0.375, 0.625, near=2.0**near)
    z = 2.0**near + 2.0**depth
    found = clip_ray(camera, STUDY_SIZE, (across[0] * z, across[1] * z, -z), direction)
    if any(direction):
        assert found.t >= 0.0
        assert found.clip[2] > 0.0 or found.t == np.inf


def test_setup_by_hand() -> None:
    """Frustum |x|, |y| ≤ depth on 8 × 6 pixels; pixel (4, 3) looks along (⅛, −⅙, −1). At depth 4 a
    wall that faces +x mirrors x: P runs along the row's own line to the left edge.
    """
    ray = ray_setup(WIDE, SIZE, (4, 3), 4.0, (-1.0, 0.0, 0.0))
    assert ray.status == Status.NOT_COMPUTED
    assert ray.p0.tolist() == [4.5, 3.5] and ray.k0 == 0.25
    # r = (−⅛, −⅙, −1): its vanishing point is ndc (−⅛, −⅙), px (3.5, 3.5)
    assert ray.end == End.MAX_DISTANCE
    assert np.allclose(ray.dp, [-1.0, 0.0], atol=1e-15) and abs(ray.s_end - 1.0) < 1e-15
    assert abs(ray.dk + 0.25) < 1e-15


def test_setup_statuses() -> None:
    depth = [np.inf, np.nan, -1.0, 0.0, 2.0, 2.0, 2.0]
    normal = [[0, 0, 1.0]] * 4 + [[0, 0, 0], [0, 0, -1.0], [0.0, 0.0, 1.0]]
    ray = ray_setup(WIDE, SIZE, (4, 3), depth, normal)
    bad = Status.INVALID_INPUT
    assert ray.status.tolist() == [Status.BACKGROUND, bad, bad, bad, bad, bad, 0]
    assert np.isnan(ray.s_end[:6]).all() and ray.s_end[6] > 0.0
    below = ray_setup(WIDE, SIZE, (4, 3), 2.0, (1.0, 0.0, 0.05), geo_normal=(0.0, 0.2, 1.0))
    assert below.status in (Status.BELOW_SURFACE, Status.INVALID_INPUT, Status.NOT_COMPUTED)
    steep = ray_setup(WIDE, SIZE, (4, 3), 2.0, (0.0, 1.0, 0.1), geo_normal=(0.0, 0.0, 1.0))
    assert steep.status == Status.BELOW_SURFACE


def test_setup_ends_where_the_clip_says() -> None:
    pixel, depth, normal, limit = examples("ray_setup/end_position", 200, 6)
    ray = ray_setup(STUDY_CAMERA, STUDY_SIZE, pixel, depth, normal, max_distance=limit)
    view = oracle_ray.view_numbers(STUDY_CAMERA, STUDY_SIZE)
    width, height, p00, p11, p02, p12, _ = view
    for i in range(200):
        px, py = pixel[i] + 0.5
        sight = [(2 * px / width - 1 + p02) / p00, (1 - 2 * py / height + p12) / p11, -1.0]
        origin = [float(depth[i]) * x for x in sight]
        r = oracle_ray.reflect(sight, normal[i].tolist())
        assert ray.end[i] == oracle_ray.clip_ray_end(view, origin, r, float(limit[i]))[1]
    assert (np.abs(ray.dp).max(axis=-1) == 1.0).all()
    assert len(set(ray.end.tolist())) == 6


def test_errors() -> None:
    for call, words in (
        (lambda: clip_ray("camera", SIZE, [0, 0, -1], [1, 0, 0]), "camera is a str"),
        (lambda: clip_ray(WIDE, SIZE, [0, -1], [1, 0, 0]), "origin has shape"),
        (lambda: ray_setup(WIDE, SIZE, (8, 0), 1.0, (0, 0, 1)), "no pixel of 8x6"),
        (lambda: ray_setup(WIDE, SIZE, (0.5, 0), 1.0, (0, 0, 1)), "no pixel"),
        (lambda: ray_setup(WIDE, SIZE, 3, 1.0, (0, 0, 1)), "pixel has shape"),
        (lambda: ray_setup(WIDE, SIZE, (0, 0), [1, 2], np.ones((3, 3))), "do not broadcast"),
    ):
        with pytest.raises(MathsError, match=words) as caught:
            call()
        assert "\n" not in str(caught.value)


# --- A walk never goes back -----------------------------------------------------------------------
# P(s) = P0 + s·dP and depth = 1/(k0 + s·dk), each of its own s: rounding is monotone, so a sum or
# product of a monotone number and a constant is monotone. Searched for counter-examples all the
# same, in both precisions; and the quotient q(s)/k(s) of the published code has them in both.


def goes_back(values: np.ndarray) -> bool:
    steps = np.diff(values)
    return bool((steps > 0).any() and (steps < 0).any())


def walk_numbers(rng: np.random.Generator, kind: type) -> tuple[np.ndarray, ...]:
    """P0, P1, z0, z1 of rays on an 8K image, depths nearly equal or decades apart."""
    p0, p1 = rng.uniform(0.0, 8192.0, 2)
    z0 = 10.0 ** rng.uniform(-3, 4)
    z1 = z0 * (1.0 + rng.uniform(-1.0, 1.0) * 10.0 ** rng.uniform(-9, 0))
    return tuple(kind(v) for v in (p0, p1, z0, abs(z1) + 1e-9))


@pytest.mark.parametrize("kind", [np.float64, np.float32])
@pytest.mark.parametrize("stride", [1, 3])
def test_pixel_index_and_depth_never_go_back(kind: type, stride: int) -> None:
    rng = np.random.default_rng(17)
    for _ in range(1500):
        p0, p1, z0, z1 = walk_numbers(rng, kind)
        s_end = kind(abs(p1 - p0) * rng.uniform(1.0, 1.5) + 1.0)
        dp = (p1 - p0) / s_end
        k0 = kind(1.0) / z0
        dk = (kind(1.0) / z1 - k0) / s_end
        jitter = kind(rng.uniform())
        s = ((np.arange(int(s_end)) + jitter) * stride).astype(kind)
        s = s[s < s_end]
        position, k = p0 + s * dp, k0 + s * dk
        assert position.dtype == k.dtype == kind
        assert not goes_back(np.floor(position)) and not goes_back(position)
        assert not goes_back(kind(1.0) / k[k > 0])


@settings(max_examples=200, derandomize=True, deadline=None)
@given(
    st.floats(0, 16384, width=32), st.floats(-1, 1, width=32), st.floats(0, 16384, width=32),
    st.sampled_from([np.float64, np.float32]),
)  # fmt: skip
def test_hypothesis_finds_no_walk_that_goes_back(
    p0: float, dp: float, s: float, kind: type
) -> None:
    start = kind(s)
    following = np.array([start, np.nextafter(start, kind(np.inf)), start + kind(1)], kind)
    assert not goes_back(kind(p0) + following * kind(dp))


def smallest_walk_back(kind: type, seed: int = 5) -> int:
    """Fewest samples of a walk whose depth q(s)/k(s) goes back, over many rays; 0 if none did.

    q = z/w and k = 1/w, both interpolated, as in the published listing: the true depth is monotone.
    """
    rng = np.random.default_rng(seed)
    best = 0
    for length in (3, 4, 5, 8, 16, 64):
        for _ in range(400):
            w0, w1 = (kind(10.0 ** rng.uniform(-1, 2)) for _ in range(2))
            z0 = kind(rng.uniform(0.5, 2.0))
            z1 = kind(z0 * kind(1.0 + rng.integers(-2, 3) * float(np.finfo(kind).eps)))
            k0, k1 = kind(1) / w0, kind(1) / w1
            q0, q1 = z0 * k0, z1 * k1
            n = kind(length - 1)
            s = np.arange(length).astype(kind)
            if goes_back((q0 + s * ((q1 - q0) / n)) / (k0 + s * ((k1 - k0) / n))):
                return length
    return best


def test_the_published_quotient_goes_back_in_both_precisions() -> None:
    """Three samples are enough: why k = 1/depth is walked instead of q/k."""
    assert smallest_walk_back(np.float32) == 3
    assert smallest_walk_back(np.float64) == 3

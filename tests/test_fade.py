"""Fades against their closed forms (spec 5.4) and Schlick's term against its own."""

from __future__ import annotations

import math

import mpmath
import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ssr_ref.ssr.fade import LINEAR, NO_FADE, PUBLISHED, clamp01, distance_fade, edge_fade
from ssr_ref.ssr.resolve import reflectance, schlick
from ssr_ref.vecmath.vec import Vec3

ULP = 2.0**-52
unit = st.floats(0.0, 1.0)


@pytest.mark.parametrize("p", [2.0, 3.0, 2.5, 1.0, 8.0])
def test_edge_fade_on_a_grid(p: float) -> None:
    """(1 − (2·|u − ½|)^p)·(1 − (2·|v − ½|)^p) at 50 digits, and its corners and middle."""
    for u in np.linspace(0.0, 1.0, 17):
        for v in (0.0, 0.03125, 0.5, 0.7, 1.0):
            exact = mpmath.mpf(1)
            for c in (float(u), v):
                exact *= 1 - (2 * abs(mpmath.mpf(c) - 0.5)) ** p
            # Each factor rounds three times near 1, the product once.
            assert abs(edge_fade(float(u), v, p) - float(exact)) <= 4 * ULP
    assert edge_fade(0.5, 0.5, p) == 1.0
    for corner in ((0.0, 0.0), (1.0, 1.0), (0.0, 0.5), (0.5, 1.0)):
        assert edge_fade(*corner, p) == 0.0


@settings(deadline=None, derandomize=True)  # the first example compiles
@given(unit, unit, st.sampled_from([2.0, 3.0, 2.5]))
def test_edge_fade_is_symmetric_and_in_range(u: float, v: float, p: float) -> None:
    fade = edge_fade(u, v, p)
    assert 0.0 <= fade <= 1.0
    assert fade == edge_fade(v, u, p)
    if 1.0 - (1.0 - u) == u:  # 1 − u is exact
        assert fade == edge_fade(1.0 - u, v, p)


@pytest.mark.parametrize("p", [2.0, 3.0, 2.5])
def test_edge_fade_is_clamped_beyond_the_image(p: float) -> None:
    """The published form goes negative there, and two negatives make a positive corner."""
    for u, v in ((-0.25, -0.25), (1.25, 1.25), (-0.01, 0.5), (1.5, -0.5)):
        assert edge_fade(u, v, p) == 0.0


def test_edge_fade_takes_the_powers_without_pow() -> None:
    """p = 2 and 3 are products, so these values are exact: q = ½, ¾."""
    assert edge_fade(0.25, 0.5, 2.0) == 0.75
    assert edge_fade(0.25, 0.5, 3.0) == 0.875
    assert edge_fade(0.125, 0.5, 3.0) == 1.0 - 0.421875
    assert edge_fade(0.25, 0.125, 2.0) == 0.75 * 0.4375


@settings(deadline=None, derandomize=True)  # the first example compiles
@given(st.floats(0.0, 4.0), st.sampled_from([2.0**-3, 1.0, 5.0]))
def test_distance_fade(share: float, most: float) -> None:
    length = share * most
    published = distance_fade(length, most, PUBLISHED)
    exact = mpmath.mpf("0.75") ** (mpmath.mpf(length) / mpmath.mpf(most))
    # One rounding of length/most, |ln ¾| · share of it, then pow's 0.65 ulp.
    assert abs(published - float(exact)) <= (1 + share) * ULP
    assert distance_fade(length, most, LINEAR) == max(0.0, 1.0 - length / most)
    assert distance_fade(length, most, NO_FADE) == 1.0
    for kind in (NO_FADE, PUBLISHED, LINEAR):
        assert distance_fade(length, math.inf, kind) == 1.0  # spec 5.4: max = inf: 1


def test_distance_fade_ends() -> None:
    """The published fade still is ¾ at the maximum distance; the linear one is 0."""
    assert distance_fade(0.0, 2.0, PUBLISHED) == distance_fade(0.0, 2.0, LINEAR) == 1.0
    assert distance_fade(2.0, 2.0, PUBLISHED) == 0.75
    assert distance_fade(2.0, 2.0, LINEAR) == distance_fade(3.0, 2.0, LINEAR) == 0.0
    assert distance_fade(1.0, 2.0, LINEAR) == 0.5


def test_clamp() -> None:
    assert [clamp01(v) for v in (-math.inf, -1.0, 0.0, 0.5, 1.0, 2.0)] == [0, 0, 0, 0.5, 1, 1]


@settings(deadline=None, derandomize=True)  # the first example compiles
@given(unit, unit)
def test_schlick(f0: float, cosine: float) -> None:
    exact = f0 + (1 - mpmath.mpf(f0)) * (1 - mpmath.mpf(cosine)) ** 5
    want = 0.0 if f0 == 0.0 else float(exact)
    # Five roundings of the power, two of the sum: below 8 half ulps of a number up to 1.
    assert abs(schlick(f0, cosine) - want) <= 4 * ULP
    assert f0 <= schlick(f0, cosine) <= 1.0 + ULP


def test_schlick_ends() -> None:
    """Straight on it is f0, grazing 1; f0 = 0 means no mirror at all, at any angle."""
    assert schlick(0.04, 1.0) == 0.04
    assert schlick(0.04, 0.0) == pytest.approx(1.0, abs=ULP)
    assert schlick(0.5, 0.5) == 0.5 + 0.5 * 0.03125
    assert schlick(0.0, 0.0) == 0.0


@numba.njit(error_model="numpy")
def reflectance_at(view, x: int, y: int, f0: Vec3, normal: Vec3, fresnel: bool):  # type: ignore
    """`reflectance` takes a view, which only compiled code can pass on."""
    return reflectance(view, x, y, f0, normal, fresnel)


@pytest.mark.parametrize("perspective", [True, False])
def test_reflectance_uses_the_angle_of_the_pixel_s_own_ray(perspective: bool) -> None:
    from tracing import front_view, pixel_rays

    view = front_view(perspective, (5, 3))
    f0 = Vec3(0.04, 0.5, 0.0)
    rng = np.random.default_rng(1)
    for x, y in ((0, 0), (4, 1), (2, 2)):
        ray = pixel_rays(view)[y, x]
        normal = rng.normal(size=3)
        normal *= -np.sign(normal @ ray) * 3.0  # any length
        cosine = -(normal @ ray) / np.linalg.norm(normal) / np.linalg.norm(ray)
        got = reflectance_at(view, x, y, f0, Vec3(*normal), True)
        want = [f + (1 - f) * (1 - cosine) ** 5 if f else 0.0 for f in f0]
        assert np.abs(np.array(got) - want).max() < 1e-14
        assert reflectance_at(view, x, y, f0, Vec3(*normal), False) == f0
        # A normal that looks away counts as grazing, R = 1 where f0 > 0.
        away = reflectance_at(view, x, y, f0, Vec3(*-normal), True)
        assert away == pytest.approx((1.0, 1.0, 0.0), abs=ULP)

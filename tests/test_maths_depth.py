"""Depth formats: bounds, exact ends, order, storage, the eight conventions, what float32 loses."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from maths_b_checks import (
    ENDS,
    INF,
    accuracy,
    depth_classes,
    depth_ends,
    depth_middle,
    depth_order,
    depth_storage,
    infos,
    worst_error,
)

import ssr_ref
from ssr_ref.depth import storage as storage_module
from ssr_ref.maths import depth as m
from ssr_ref.study.sampling_maps import SAMPLES

STEADY = settings(derandomize=True, deadline=None, max_examples=40)
f32 = st.floats(0.0, 1.0, width=32)


@pytest.mark.parametrize("key", infos(m))
def test_errors_stay_within_the_stated_bounds(key: str) -> None:
    accuracy(m, key, n=300)


@pytest.mark.parametrize("key", infos(m))
def test_bounds_hold_for_numbers_of_53_bits(key: str) -> None:
    first, *rest = SAMPLES[key](150, 29)
    bits = np.random.default_rng(4).integers(0, 2**20, first.shape) / 2.0**46
    if key.startswith("device_depth") and len(rest) == 2 and key[-11:] != "logarithmic":
        first = np.clip(first - first * bits, *rest)
    else:
        first = first - first * bits
        if key.startswith("device_depth") and "infinite" in key:
            first = np.maximum(first, rest[0])
    error, args = worst_error(infos(m)[key], (first, *rest))
    assert error <= infos(m)[key].bound, args


def test_ends_are_exact() -> None:
    depth_ends(m)


def test_the_middle_of_each_range() -> None:
    depth_middle(m)


def test_decoding_keeps_the_order() -> None:
    depth_order(m)


def test_what_is_no_depth_and_what_is_empty() -> None:
    depth_classes(m)


def test_unorm_and_float_storage() -> None:
    depth_storage(m)


def test_eight_conventions_give_one_depth() -> None:
    """One scene written by textbook matrices in eight ways; equal to 1e-6 relative."""
    near, far = 0.1, 100.0
    z = np.geomspace(near, far, 41)[1:-1].reshape(3, 13)
    # Row 2 of the projections of the OpenGL and Direct3D manuals times (…, −z, 1), over w = z.
    gl = ((far + near) / (far - near) * z - 2 * far * near / (far - near)) / z
    d3d = (far / (far - near) * z - far * near / (far - near)) / z
    camera = ssr_ref.Camera.frustum(np.eye(4), -0.3, 0.9, -0.6, 0.25, near=near)
    length = ssr_ref.ray_lengths((13, 3), camera=camera)
    written = {
        "gl_ndc": (gl, {"near": near, "far": far}),
        "gl_window": (0.5 * gl + 0.5, {"near": near, "far": far}),
        "d3d": (d3d, {"near": near, "far": far}),
        "reversed": (1.0 - d3d, {"near": near, "far": far}),
        "reversed, infinite": (near / z, {"near": near, "far": INF}),
        "linear": (z, {}),
        "negative_z": (-z, {}),
        "distance": (z * length, {"ray_length": length}),
    }
    for name, (device, kind) in written.items():
        got = ssr_ref.linear_depth(device, name.split(",")[0], **kind)
        assert np.abs(got / z - 1.0).max() < 1e-6, name
        assert np.abs(ssr_ref.device_depth(z, name.split(",")[0], **kind) - device).max() < 1e-12
    with pytest.raises(ssr_ref.SsrRefError, match="format is 'depth24'; expected gl_ndc"):
        ssr_ref.linear_depth(gl, "depth24", near=near, far=far)  # type: ignore[arg-type]


def test_ray_lengths_against_the_pixel_s_ray() -> None:
    """|d| from the field of view by trigonometry, and from a camera that is off-axis."""
    length = ssr_ref.ray_lengths((5, 3), fov_y_degrees=90.0)  # tan 45° = 1: y runs from −1 to 1
    x, y = np.meshgrid((np.arange(5) - 2) / 1.5, (np.arange(3) - 1) / 1.5)
    assert np.abs(length / np.sqrt(1 + x * x + y * y) - 1).max() < 4 * 2.0**-53
    assert length[1, 2] == 1.0
    camera = ssr_ref.Camera.frustum(np.eye(4), -0.25, 0.75, -0.5, 0.25, near=1.0)
    length = ssr_ref.ray_lengths((4, 3), camera=camera)
    # Pixel (0, 0): x = −0.25 + 1/8, y = 0.25 − 1/8.
    assert abs(length[0, 0] ** 2 - (1 + 2 / 64)) < 1e-15
    assert abs(length[2, 3] ** 2 - (1 + (0.75 - 1 / 8) ** 2 + (0.5 - 1 / 8) ** 2)) < 1e-15
    flat = ssr_ref.Camera.orthographic(np.eye(4), 2.0, 1.0, near=0.1)
    assert (ssr_ref.ray_lengths((4, 3), camera=flat) == 1.0).all()
    for both in ({}, {"camera": camera, "fov_y_degrees": 40.0}):
        with pytest.raises(ssr_ref.SsrRefError, match="one of camera and fov_y_degrees"):
            ssr_ref.ray_lengths((4, 3), **both)


# --- Storage: what comes back ---------------------------------------------------------------------

STORED = [
    ("d3d", "perspective", "unorm16"), ("d3d", "perspective", "unorm24"),
    ("d3d", "perspective", "float32"), ("gl_window", "orthographic", "unorm24"),
    ("gl_ndc", "perspective", "float32"), ("reversed", "perspective", "float32"),
    ("reversed", "orthographic", "float16"), ("logarithmic_near", "perspective", "unorm24"),
    ("linear", "perspective", "float16"), ("linear", "perspective", "float32"),
    ("negative_z", "perspective", "float32"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "projection", "kept"), STORED)
@given(part=f32, exponent=st.integers(0, 12), ratio=st.integers(1, 14))
@STEADY
def test_round_trip_is_within_one_quantum(
    name: str, projection: str, kept: str, part: float, exponent: int, ratio: int
) -> None:
    """z → d → code → d → z lands between the depths of d half a quantum down and up."""
    near, far = 2.0**-exponent, 2.0 ** (ratio - exponent)
    z = near * (far / near) ** part
    kind = {"projection": projection}
    if name not in ("linear", "negative_z"):
        kind |= {"near": near, "far": far}
    d = ssr_ref.device_depth(z, name, **kind)
    back = ssr_ref.stored_depth(ssr_ref.depth_codes(d, kept), kept)
    quantum = float(storage_module.quantum(np.asarray(d), kept))
    assert abs(back - d) <= 0.5 * quantum * (1 + 1e-9)
    got = ssr_ref.linear_depth(back, name, **kind)
    around = np.array([d - quantum, d + quantum])
    if name in ENDS:
        around = np.clip(around, min(ENDS[name]), max(ENDS[name]))
    low, high = np.sort(ssr_ref.linear_depth(around, name, **kind))
    assert low <= got <= high, (z, got, low, high)


@given(
    device=f32, near=st.floats(2.0**-10, 8.0, width=32), ratio=st.integers(1, 2**20),
    power=st.integers(-40, 40),
)  # fmt: skip
@STEADY
def test_scaling_by_a_power_of_two_is_exact(
    device: float, near: float, ratio: int, power: int
) -> None:
    far = near * (1.0 + ratio / 16.0)
    scale = 2.0**power
    for name in ("gl_ndc", "d3d", "reversed"):
        for top in (far, INF):
            a = ssr_ref.linear_depth(device, name, near=near, far=top)
            b = ssr_ref.linear_depth(device, name, near=near * scale, far=top * scale)
            assert a * scale == b
            z = max(near, min(float(a), far))
            d = ssr_ref.device_depth(z, name, near=near, far=top)
            e = ssr_ref.device_depth(z * scale, name, near=near * scale, far=top * scale)
            assert d == e
        kind = {"projection": "orthographic"}
        a = ssr_ref.linear_depth(device, name, near=near, far=far, **kind)
        b = ssr_ref.linear_depth(device, name, near=near * scale, far=far * scale, **kind)
        assert a * scale == b


@given(
    codes=st.lists(st.integers(0, 0xFFFFFF), min_size=2, max_size=30, unique=True),
    near=st.floats(2.0**-10, 8.0), ratio=st.floats(1.0, 2.0**30, exclude_min=True),
)  # fmt: skip
@STEADY
def test_decoding_is_monotone(codes: list[int], near: float, ratio: float) -> None:
    far = near * ratio
    if not far > near:
        return
    d = ssr_ref.stored_depth(sorted(codes), "unorm24")
    for name, device in (("d3d", d), ("gl_ndc", 2 * d - 1), ("reversed", d[::-1])):
        for projection in ("perspective", "orthographic"):
            z = ssr_ref.linear_depth(device, name, near=near, far=far, projection=projection)
            assert (np.diff(z) >= 0).all() and z[0] >= near and z[-1] <= far
    if ratio > 1.001:  # codes 2⁻²⁴ apart are told apart by the logarithm's 2⁻⁵⁰
        z = ssr_ref.linear_depth(d, "logarithmic_near", near=near, far=far)
        assert (np.diff(z) > 0).all()


# --- float32 as the subject -----------------------------------------------------------------------

# Largest relative error of z over [near, far] after storage, and where it comes from:
# half a quantum 2⁻²⁵ of d next to 1 moves z at far by 2⁻²⁵·f/n of itself; otherwise half an ulp.
LOSSES = [
    ("d3d", "float32", 0.1, 1e3, 2.0**-25 * 1e4),
    ("d3d", "unorm24", 0.1, 1e3, 0.5 / 0xFFFFFF * 1e4),
    ("reversed", "float32", 0.1, 1e3, 2.0**-24),
    ("reversed", "float32", 0.1, INF, 2.0**-24),
    ("linear", "float32", 0.1, 1e3, 2.0**-24),
    ("linear", "float16", 0.1, 1e3, 2.0**-11),
    ("d3d", "float32", 0.01, 1e5, 2.0**-25 * 1e7),
    ("d3d", "unorm24", 0.01, 1e5, 0.5 / 0xFFFFFF * 1e7),
    ("reversed", "float32", 0.01, 1e5, 2.0**-24),
    ("reversed", "float32", 0.01, INF, 2.0**-24),
    ("linear", "float32", 0.01, 1e5, 2.0**-24),
]


@pytest.mark.parametrize(("name", "kept", "near", "far", "loss"), LOSSES)
def test_what_storage_loses(name: str, kept: str, near: float, far: float, loss: float) -> None:
    top = far if far < INF else 1e3
    rng = np.random.default_rng(3)
    z = np.concatenate([
        near * (top / near) ** rng.random(20000), top * (1.0 - 0.5 * rng.random(20000) ** 2)
    ]).clip(near, top)  # fmt: skip
    kind = {} if name == "linear" else {"near": near, "far": far}
    codes = ssr_ref.depth_codes(ssr_ref.device_depth(z, name, **kind), kept)
    back = ssr_ref.linear_depth(ssr_ref.stored_depth(codes, kept), name, **kind)
    worst = np.abs(back / z - 1.0).max()
    assert 0.95 * loss <= worst <= 1.0001 * loss
    if loss < 1e-3:
        assert np.abs(back - z).max() <= 1.0001 * loss * top


def test_float16_overflows() -> None:
    codes = ssr_ref.depth_codes([65504.0, 1e5], "float16")
    assert ssr_ref.linear_depth(codes, "linear").tolist() == [65504.0, INF]


def test_far_away_float32_standard_against_reversed() -> None:
    """near 0.01, far 1e4, z = 5000: one code of float32 is 2⁻²⁴·z²·(f − n)/(n·f) = 149 away."""
    kind = {"near": 0.01, "far": 1e4}
    d = np.float32(ssr_ref.device_depth(5000.0, "d3d", **kind))
    z, further = ssr_ref.linear_depth([d, np.nextafter(d, np.float32(1))], "d3d", **kind)
    assert 130.0 < further - z < 170.0 and 0 < abs(z - 5000.0) <= 0.5 * (further - z) * 1.1
    kind = {"near": 0.01, "far": INF}
    d = np.float32(ssr_ref.device_depth(5000.0, "reversed", **kind))
    z, nearer = ssr_ref.linear_depth([d, np.nextafter(d, np.float32(1))], "reversed", **kind)
    assert abs(z - 5000.0) <= 0.5 * (z - nearer) * 1.0001 and z - nearer < 6e-4


def test_arithmetic_in_float32_with_and_without_cancellation() -> None:
    """The same float32 depths decoded in float32: n·f/(f − d·(f − n)) against n/(r + e·(1 − r)).

    The first subtracts f and nearly f: an error of 2⁻²⁴ of f in a difference of n. The second only
    adds positive terms: 5 roundings, whatever f/n.
    """
    near, far = np.float32(0.1), np.float32(1e3)
    d = (1.0 - np.arange(1, 4000) * 2.0**-24).astype(np.float32)
    n, f = Fraction(float(near)), Fraction(float(far))
    exact = [n * f / (f - Fraction(float(v)) * (f - n)) for v in d]
    usual = near * far / (far - d * (far - near))
    r, e = near / far, np.float32(1) - d
    ours = near / (r + e * (np.float32(1) - r))
    assert usual.dtype == ours.dtype == np.float32

    def worst(z: np.ndarray) -> float:
        return max(float(abs(Fraction(float(v)) / x - 1)) for v, x in zip(z, exact)) * 2.0**24

    assert worst(ours) <= 5.0
    assert 1000.0 < worst(usual) < 2 * 1e4  # f/n = 10⁴ half-ulps, twice


# --- Interface ------------------------------------------------------------------------------------


def test_broadcasting_and_the_caller_s_arrays() -> None:
    d = np.float32([[0.0, 0.25, 1.0]])
    kept = d.copy()
    near = [[0.5], [0.25]]
    z = ssr_ref.linear_depth(d, "d3d", near=near, far=8.0, empty=1.0)
    assert z.shape == (2, 3) and z.dtype == np.float64 and np.array_equal(d, kept)
    assert z[:, 0].tolist() == [0.5, 0.25] and np.isinf(z[:, 2]).all()
    assert abs(z[0, 1] - 0.5 * 8 / (8 - 0.25 * 7.5)) < 1e-15
    assert ssr_ref.linear_depth(np.zeros((0, 4)), "linear").shape == (0, 4)
    assert ssr_ref.device_depth(2.0, "reversed", near=0.5, far=INF).shape == ()
    assert ssr_ref.linear_depth([1, 2], "linear").tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    ("call", "what"),
    [
        (lambda: m.linear_depth(0.5, "d3d"), "needs near"),
        (lambda: m.linear_depth(0.5, "d3d", near=0.1), "needs far"),
        (lambda: m.linear_depth(0.5, "logarithmic", far=9.0), "needs constant"),
        (lambda: m.linear_depth(0.5, "distance"), "needs ray_length"),
        (lambda: m.linear_depth(0.5, "linear", ray_length=1.0), "takes no ray_length"),
        (lambda: m.linear_depth(0.5, "d3d", near=0.1, far=9.0, constant=1.0), "takes no constant"),
        (lambda: m.linear_depth(0.5, "d3d", near=0.0, far=9.0), "near is 0.0"),
        (lambda: m.linear_depth(0.5, "d3d", near=np.nan, far=9.0), "near is nan"),
        (lambda: m.linear_depth(0.5, "d3d", near=9.0, far=[10.0, 9.0]), "near 9.0, far 9.0"),
        (lambda: m.linear_depth(0.5, "d3d", near=1.0, far=np.nan), "far is nan"),
        (lambda: m.linear_depth(0.5, "logarithmic_near", near=1.0, far=INF), "far is inf"),
        (lambda: m.linear_depth(0.5, "d3d", near=1, far=INF, projection="orthographic"),
         "far is inf"),
        (lambda: m.linear_depth(0.5, "d3d", near=1, far=2, projection="fish"),
         "projection is 'fish'"),
        (lambda: m.device_depth([1.0, 2.0], "d3d", near=[1, 2, 3], far=9), "do not broadcast"),
        (lambda: m.linear_depth("x", "linear"), "device is of type"),
        (lambda: m.depth_codes([0.5, np.nan], "unorm24"), "holds NaN"),
        (lambda: m.depth_codes(0.5, "unorm8"), "storage is 'unorm8'"),
        (lambda: m.stored_depth([2**24], "unorm24"), "from 0 to 16777215"),
        (lambda: m.stored_depth([0.5], "unorm16"), "from 0 to 65535"),
    ],
)  # fmt: skip
def test_errors_are_one_line(call, what: str) -> None:
    with pytest.raises(ssr_ref.SsrRefError, match=what) as caught:
        call()
    assert "\n" not in str(caught.value)

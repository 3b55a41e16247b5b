"""Octahedral normals, sRGB, fades and noise: bounds against 60 digits, properties, bad input."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mpf

import ssr_ref
from ssr_ref.errors import MathsError
from ssr_ref.maths import codes
from ssr_ref.maths.registry import kernels
from ssr_ref.report import colors
from ssr_ref.study import oracle_codes as oracle
from ssr_ref.study import sampling_codes as sampling
from ssr_ref.study.accuracy import errors
from ssr_ref.study.rounding import FLOAT32, correctly_rounded
from ssr_ref.study.sampling import examples
from ssr_ref.vecmath.srgb import CODE_THRESHOLD, LINEAR_THRESHOLD

U = mpf(2) ** -53
INFO = {i.name: i for i in kernels() if getattr(codes, i.name, None) is i.function}
third = 3.0**-0.5


# At least so much of each bound is reached, so that none is an empty promise.
REACHED = {"octahedral_encode": 1.2, "octahedral_decode": 1.2, "srgb_encode": 2.5}
REACHED |= {"srgb_decode": 1.6, "edge_fade": 0.8, "distance_fade": 0.5}


@pytest.mark.parametrize("name", INFO)
def test_errors_stay_below_the_stated_bound(name: str) -> None:
    """In units of u · (1 + condition), against the oracle itself, not a rounding of it."""
    worst = float(errors(INFO[name], examples(name, 500, 11)).max())
    assert REACHED.get(name, 0.0) <= worst <= INFO[name].bound


def test_the_linear_distance_fade_stays_below_the_bound() -> None:
    samples = sampling.lengths(500, 11)
    got = codes.distance_fade(*map(list, zip(*samples)), "linear")
    with mpmath.workdps(60):
        exact = [oracle.distance_fade(*s, oracle.LINEAR)[0] for s in samples]
        worst = max(abs(mpf(a) - b) / U for a, b in zip(got.tolist(), exact))
    assert 0.5 <= worst <= INFO["distance_fade"].bound


# ---- Octahedral codes ----------------------------------------------------------------------------


def test_octahedral_corners_and_the_sign_of_zero() -> None:
    """Axes by hand; below, sign(0) = sign(−0) = +1, so −z is the corner (1, 1) alone."""
    down = [[0.0, 0.0, -1.0], [-0.0, -0.0, -1.0], [0.0, -0.0, -7.0]]
    assert codes.octahedral_encode(down).tolist() == [[1.0, 1.0]] * 3
    axes = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [1, 0, -0.0]]
    want = [[1, 0], [-1, 0], [0, 1], [0, -1], [0, 0], [1, 0]]
    assert codes.octahedral_encode(axes).tolist() == want
    # The fold edge x = 0 below: u is positive whichever zero x is. 0.75 / (0.25 + 0.75), 1 − 0.75.
    edge = codes.octahedral_encode([[0.0, 0.25, -0.75], [-0.0, 0.25, -0.75]])
    assert edge.tolist() == [[0.75, 1.0]] * 2
    corners = codes.octahedral_decode([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    assert corners.tolist() == [[0.0, 0.0, -1.0]] * 4


def test_octahedral_codes_keep_small_coordinates() -> None:
    """Just below +x, v = (|y| + |z|)/sum; the published 1 − |x|/sum has no digit of it left."""
    u, v = codes.octahedral_encode([1.0, 2.0**-70, -(2.0**-71)])
    assert (u, v) == (1.0, 1.5 * 2.0**-70)


@pytest.mark.parametrize(
    "bad", [[0.0, 0.0, 0.0], [np.nan, 0, 1], [0, np.inf, 1], [0, 1, -np.inf], [1e308, 1e308, 1e308]]
)
def test_no_direction_gives_nan(bad: list[float]) -> None:
    assert np.isnan(codes.octahedral_encode(bad)).all()


@pytest.mark.parametrize("bad", [[np.nan, 0.0], [0.0, np.inf], [1.0 + 2.0**-52, 0.0], [0.0, -1.5]])
def test_no_code_gives_nan(bad: list[float]) -> None:
    assert np.isnan(codes.octahedral_decode(bad)).all()


def random_directions(n: int) -> np.ndarray:
    d = np.random.default_rng(4).normal(size=(n, 3))
    return d / np.sqrt((d * d).sum(axis=1, keepdims=True))


def test_decoding_inverts_encoding() -> None:
    """To 16 u: 4u of the code, times √6/2 · √3 · √2 ≤ 3, and 4u of decoding."""
    d = np.concatenate([random_directions(20_000), np.array(sampling.directions(3000, 3))])
    d /= np.sqrt((d * d).sum(axis=1, keepdims=True))
    back = codes.octahedral_decode(codes.octahedral_encode(d))
    assert np.abs(back - d).max() <= 16 * 2.0**-53
    assert np.abs((back * back).sum(axis=1) - 1.0).max() <= 8 * 2.0**-53


@pytest.mark.parametrize("scale", [2.0**-1000, 2.0**-7, 2.0**900])
def test_octahedral_codes_do_not_see_the_length(scale: float) -> None:
    d = random_directions(500)
    assert np.array_equal(codes.octahedral_encode(d * scale), codes.octahedral_encode(d))


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_quantised_directions_turn_by_at_most_the_stated_angle(bits: int) -> None:
    """3/√2 / (2^(b−1) − 1) radians; the bound is nearly reached, at the middle of a face."""
    most = 2.0 ** (bits - 1) - 1.0
    d = random_directions(200_000)
    stored = np.rint(codes.octahedral_encode(d) * most) / most
    cosine = (codes.octahedral_decode(stored) * d).sum(axis=1)
    chord = np.sqrt(2.0 * (1.0 - cosine).clip(0.0))
    angle = 2.0 * np.arcsin(chord / 2.0)
    bound = 3.0 / np.sqrt(2.0) / most
    assert 0.9 * bound < angle.max() <= bound


# ---- sRGB ----------------------------------------------------------------------------------------


def test_all_bytes_decode_to_the_correctly_rounded_float32() -> None:
    """decode(i/255) of the exact fraction, by mpmath's own power at 60 digits."""
    linear = codes.srgb_decode(np.arange(256) / 255.0)
    with mpmath.workdps(60):
        for i, value in enumerate(linear.tolist()):
            c = mpf(i) / 255
            base = (c + mpf("0.055")) / mpf("1.055")
            line = c <= mpf("0.04045")
            want = c / mpf("12.92") if line else mpmath.power(base, mpf("2.4"))
            # The kernel's bound, and the rounding of i/255 by u, times 2.4.
            assert abs(mpf(value) - want) <= 12 * U * want
            assert float(np.float32(value)) == correctly_rounded(want, FLOAT32)
    assert np.rint(codes.srgb_encode(linear) * 255.0).tolist() == list(range(256))
    single = linear.astype(np.float32)
    assert np.rint(codes.srgb_encode(single) * 255.0).tolist() == list(range(256))


def test_srgb_known_values_and_classes() -> None:
    """Both lines are exact there; 1 maps to 1; mid grey by mpmath: 0.73535698305244..."""
    assert codes.srgb_encode([0.0, -1.0, 0.001]).tolist() == [0.0, -12.92, 12.92 * 0.001]
    assert codes.srgb_decode([0.0, -12.92, 0.04]).tolist() == [0.0, -1.0, 0.04 / 12.92]
    assert abs(codes.srgb_encode(1.0) - 1.0) <= 2.0**-52 and codes.srgb_decode(1.0) == 1.0
    assert abs(codes.srgb_encode(0.5) - 0.7353569830524495) < 2e-16
    for function in (codes.srgb_encode, codes.srgb_decode):
        out = function([np.nan, np.inf, -np.inf])
        assert np.isnan(out[0]) and out[1:].tolist() == [np.inf, -np.inf]


def test_the_pieces_miss_each_other_by_the_standard_s_rounding() -> None:
    """−2.85e-8 and +2.33e-9, from the standard's constants at 60 digits."""
    up = codes.srgb_encode(np.nextafter(LINEAR_THRESHOLD, 1.0)) - codes.srgb_encode(0.0031308)
    assert up == pytest.approx(-2.8517e-8, rel=1e-3)
    up = codes.srgb_decode(np.nextafter(CODE_THRESHOLD, 1.0)) - codes.srgb_decode(0.04045)
    assert up == pytest.approx(2.3295e-9, rel=1e-3)


@settings(deadline=None, derandomize=True)
@given(st.floats(0.0, 16.0))
def test_srgb_decode_inverts_encode(x: float) -> None:
    """Except between the thresholds' images, 0.0031308 ± 1e-8, where the pieces overlap."""
    if abs(x - LINEAR_THRESHOLD) < 1e-8:
        return
    assert abs(float(codes.srgb_decode(codes.srgb_encode(x))) - x) <= 60 * 2.0**-53 * x + 5e-324


def test_the_previews_encode_alike() -> None:
    """They use NumPy's power, for speed; the formula is the same one."""
    x = np.concatenate([np.linspace(0.0, 1.0, 4001), sampling.intensities(400, 0.0031308)])
    x = x[x <= 1.0]
    assert np.allclose(colors.srgb_encode(x), codes.srgb_encode(x), rtol=2e-15, atol=0.0)
    assert np.array_equal(
        colors.to_bytes(colors.srgb_encode(x)), colors.to_bytes(codes.srgb_encode(x))
    )


# ---- Fades and noise -----------------------------------------------------------------------------


def test_fades_broadcast_and_equal_their_kernels() -> None:
    from ssr_ref.ssr import fade

    uv = np.random.default_rng(2).random((5, 1, 2))
    power = np.array([2.0, 3.0, 2.5])
    got = codes.edge_fade(uv, power)
    assert got.shape == (5, 3)
    assert got[3, 2] == fade.edge_fade(uv[3, 0, 0], uv[3, 0, 1], 2.5)
    assert codes.distance_fade(np.ones((4, 1)), [2.0, 4.0], "linear").tolist() == [[0.5, 0.75]] * 4
    assert codes.distance_fade(2.0, 2.0) == 0.75
    far = codes.distance_fade([np.nan, np.inf, 3.0], np.inf)
    assert far.tolist() == [1.0, 1.0, 1.0]
    assert np.isnan(codes.distance_fade(np.nan, 1.0)) and codes.distance_fade(np.inf, 1.0) == 0.0
    assert np.isnan(codes.edge_fade([np.nan, 0.5]))


def test_hashes_equal_the_oracle() -> None:
    samples = sampling.words(400, 9)
    x, y, z = map(list, zip(*samples))
    assert codes.pcg3d(x, y, z).tolist() == [list(oracle.pcg3d(*w)) for w in samples]
    assert codes.jitter(x, y, z).tolist() == [float(oracle.jitter(*w)[0]) for w in samples]
    # (1, 2, 3) → 0xfa9f79a6, docs/dda.md.
    assert codes.pcg3d(1, 2, 3)[0] == 0xFA9F79A6 and codes.jitter(1, 2, 3) == 0xFA9F7A / 2**24


# ---- Arrays in and out ---------------------------------------------------------------------------

CALLS: dict[str, tuple[Any, ...]] = {
    "octahedral_encode": (np.full((2, 3, 3), third),),
    "octahedral_decode": (np.full((2, 3, 2), 0.3),),
    "srgb_encode": (np.full((2, 3), 0.3),),
    "srgb_decode": (np.full((2, 3), 0.3),),
    "edge_fade": (np.full((2, 3, 2), 0.3), 2.5),
    "distance_fade": (np.full((2, 3), 0.3), 2.0),
    "pcg3d": (np.full((2, 3), 7), 1, 2),
    "jitter": (np.full((2, 3), 7), 1, 2),
}
LAST = {"octahedral_encode": (2,), "octahedral_decode": (3,), "pcg3d": (3,)}


@pytest.mark.parametrize("name", CALLS)
def test_any_leading_shape_and_nothing_is_modified(name: str) -> None:
    assert set(CALLS) == set(INFO)
    function = getattr(ssr_ref, name)
    assert function is getattr(codes, name)
    first, *rest = CALLS[name]
    before = first.copy()
    out = function(first, *rest)
    assert out.shape == (2, 3, *LAST.get(name, ()))
    assert out.flags.owndata or out.base is not first
    assert np.array_equal(first, before)
    # Lists, strided views, one case, and none.
    assert np.array_equal(function(first.tolist(), *rest), out)
    assert np.array_equal(function(np.asfortranarray(first)[::-1], *rest), out[::-1])
    assert np.array_equal(function(first[1, 2], *rest), out[1, 2])
    assert function(first[:0], *rest).shape == (0, *out.shape[1:])


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        (
            "octahedral_encode",
            ([[1.0, 2.0]],),
            r"direction has shape \(1, 2\); expected \(..., 3\)",
        ),
        ("octahedral_encode", (1.0,), r"direction has shape \(\); expected \(..., 3\)"),
        ("octahedral_decode", ([1.0, 2.0, 3.0],), r"code has shape \(3,\); expected \(..., 2\)"),
        ("srgb_encode", ("white",), "linear is of type <U5; expected real numbers"),
        ("srgb_decode", ([1.0, [2.0]],), "code is no array .*; expected real numbers"),
        ("srgb_decode", (1j,), "code is of type complex128; expected real numbers"),
        ("edge_fade", ([0.5, 0.5], 0.0), "power is not a finite number > 0 everywhere"),
        ("edge_fade", (np.zeros((4, 2)), [1.0, 2.0]), r"uv \(4,\), power \(2,\); expected equal"),
        ("distance_fade", (1.0, 2.0, "cubic"), "kind is 'cubic'; expected none, published, linear"),
        ("distance_fade", ([1.0, 2.0], [1.0, 2.0, 3.0]), r"length \(2,\), max_distance \(3,\)"),
        ("pcg3d", (1.0, 2, 3), "x is of type float64; expected whole numbers"),
        ("pcg3d", (1, -2, 3), "y holds -2; expected whole numbers from 0 to 4294967295"),
        ("jitter", (1, 2, 2**32), "seed holds 4294967296; expected whole numbers"),
    ],
)
def test_bad_arrays_are_one_clean_error(
    name: str, arguments: tuple[Any, ...], message: str
) -> None:
    with pytest.raises(MathsError, match=message) as caught:
        getattr(codes, name)(*arguments)
    assert "\n" not in str(caught.value)

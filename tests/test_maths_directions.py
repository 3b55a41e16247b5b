"""Directions to cube, cross, lat-long and ball: bounds, tables, ties, seams, round trips."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from maths_b_checks import accuracy, infos, worst_error
from maths_direction_checks import (
    LAYOUTS,
    ball_close_to_rim,
    ball_rim,
    cross_seams,
    cube_letter,
    cube_table,
    cube_ties,
    latlong_seam,
    no_direction,
    texel_round_trip,
    there_and_back,
    to_direction,
    to_uv,
)

import ssr_ref
from ssr_ref.maths import directions as m
from ssr_ref.study.sampling_maps import SAMPLES

STEADY = settings(derandomize=True, deadline=None, max_examples=60)
part = st.floats(-1.0, 1.0, allow_subnormal=False)
vector = st.tuples(part, part, part).filter(lambda d: max(abs(v) for v in d) > 1e-6)


@pytest.mark.parametrize("key", infos(m))
def test_errors_stay_within_the_stated_bounds(key: str) -> None:
    accuracy(m, key)


@pytest.mark.parametrize("key", ["cube_face/uv", "cross_uv", "latlong_uv", "latlong_direction",
                                 "ball_uv", "ball_direction", "cross_direction"])  # fmt: skip
def test_bounds_hold_for_numbers_of_53_bits(key: str) -> None:
    (values,) = SAMPLES[key](300, 23)
    bits = np.random.default_rng(4).integers(0, 2**20, values.shape) / 2.0**46
    (info,) = [info for name, info in infos(m).items() if name == key]
    if key == "ball_direction":  # towards the middle, so that all stay on the ball
        values = values + (0.5 - values) * bits
    elif key == "cross_direction":
        # On the last few bits 3·v may be a whole number although v·3 is not: keep off the seams.
        values = values - values * bits
        away = np.abs(values[:, 1] * 3.0 - np.rint(values[:, 1] * 3.0)) > 1e-6
        values = values[away & (np.abs(values[:, 0] * 4.0 - np.rint(values[:, 0] * 4.0)) > 1e-6)]
    else:
        values = values - values * bits
    error, args = worst_error(info, (values,))
    assert error <= info.bound, args


def test_face_table_of_the_specification() -> None:
    cube_table(m)


def test_ties_go_to_z_then_y_then_x() -> None:
    cube_ties(m)


def test_letter_f_is_not_mirrored() -> None:
    cube_letter(m)


def test_what_is_no_direction() -> None:
    no_direction(m)


def test_cross_has_no_holes_at_its_seams() -> None:
    cross_seams(m)


def test_latlong_seam_and_poles() -> None:
    latlong_seam(m)


def test_ball_middle_and_rim() -> None:
    ball_rim(m)
    ball_close_to_rim(m)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_there_and_back(layout: str) -> None:
    there_and_back(m, layout)


@pytest.mark.parametrize("layout", LAYOUTS)
@given(d=st.lists(vector, min_size=1, max_size=20), n=st.integers(1, 300), rows=st.integers(1, 300))
@STEADY
def test_texel_centre_is_within_half_a_texel(layout: str, d: list, n: int, rows: int) -> None:
    if layout == "cross":  # whole faces
        n, rows = 4 * n, 3 * n
    texel_round_trip(m, layout, np.array(d), n, rows)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_texel_round_trip_in_the_hard_regions(layout: str) -> None:
    (d,) = SAMPLES["ball_uv"](3000, 9)
    sizes = [(52, 39), (4, 3)] if layout == "cross" else [(37, 23), (1, 9), (1, 1), (512, 256)]
    for width, height in sizes:
        counted = texel_round_trip(m, layout, d, width, height)
        # Texels cut by the ball's rim have no centre on it: those of −Z and its surroundings.
        assert counted > (1000 if layout == "ball" else 2999)


@given(d=vector, power=st.integers(-900, 900))
@STEADY
def test_length_of_the_direction_does_not_matter(d: tuple, power: int) -> None:
    long = np.ldexp(np.array(d), power)
    if not (np.ldexp(long, -power) == d).all():  # a component became subnormal
        return
    for layout in LAYOUTS:
        face, uv = to_uv(m, layout, d)
        scaled_face, scaled = to_uv(m, layout, long)
        assert np.array_equal(scaled, uv) and scaled_face == face, layout


@given(d=vector)
@STEADY
def test_faces_turn_with_the_axes(d: tuple) -> None:
    sizes = sorted(abs(v) for v in d)
    if sizes[1] == sizes[2]:  # ties have a rule of their own
        return
    face = int(m.cube_face(d)[0])
    # x → y → z → x moves every face by one axis; −d is the opposite face.
    assert int(m.cube_face((d[2], d[0], d[1]))[0]) == (face + 2) % 6
    assert int(m.cube_face(tuple(-v for v in d))[0]) == face ^ 1
    for axis, flip in enumerate("xyz"):
        turned = [-v if i == axis else v for i, v in enumerate(d)]
        got, uv = m.cube_face(d, flip=flip)
        expected, expected_uv = m.cube_face(turned)
        assert got == expected and np.array_equal(uv, expected_uv)
        assert np.array_equal(m.cross_uv(d, flip=flip), m.cross_uv(turned))
        back = m.cube_direction(got, uv, flip=flip)
        largest = max(abs(v) for v in d)
        assert np.abs(back - np.array(d) / largest).max() <= 2.0**-52
        assert np.abs(m.cross_direction(m.cross_uv(d, flip=flip), flip=flip) - back).max() < 2e-15


def test_directions_are_unit_where_it_is_said() -> None:
    for layout in ("latlong", "ball"):
        key = f"{layout}_direction"
        d = to_direction(m, layout, 0, SAMPLES[key](2000, 1)[0])
        assert np.abs((d * d).sum(axis=1) - 1.0).max() <= 14 * 2.0**-53
    d = m.cube_direction(*SAMPLES["cube_direction"](2000, 1))
    assert (np.abs(d).max(axis=1) == 1.0).all()


def test_uv_beyond_a_face_goes_on_in_its_plane() -> None:
    assert m.cube_direction(4, (1.25, -0.5)).tolist() == [1.5, 2.0, 1.0]


def test_shapes_types_and_the_caller_s_arrays() -> None:
    d = np.random.default_rng(1).normal(size=(2, 1, 5, 3)).astype(np.float32)
    kept = d.copy()
    face, uv = ssr_ref.cube_face(d)
    assert face.shape == (2, 1, 5) and face.dtype == np.int32
    assert uv.shape == (2, 1, 5, 2) and uv.dtype == np.float64
    for name in ("cross_uv", "latlong_uv", "ball_uv"):
        assert getattr(ssr_ref, name)(d).shape == (2, 1, 5, 2)
        assert getattr(ssr_ref, name)(np.zeros((0, 3))).shape == (0, 2)
    assert np.array_equal(d, kept)
    assert ssr_ref.cube_direction([[0], [5]], np.zeros((3, 2))).shape == (2, 3, 3)
    assert ssr_ref.latlong_direction([0.5, 0.5]).tolist() == [0.0, 0.0, -1.0]
    out = ssr_ref.latlong_uv(d)
    assert out.flags.writeable and out.flags.owndata


@pytest.mark.parametrize(
    ("call", "what"),
    [
        (lambda: ssr_ref.cube_face([1.0, 2.0]), r"direction has shape \(2,\)"),
        (lambda: ssr_ref.latlong_uv(1.0), "direction has shape"),
        (lambda: ssr_ref.latlong_uv(["a", "b", "c"]), "direction is of type"),
        (lambda: ssr_ref.ball_direction([0.5, 0.5, 0.5]), "uv has shape"),
        (lambda: ssr_ref.cube_face([1.0, 0, 0], flip="w"), "flip is 'w'"),
        (lambda: ssr_ref.cube_direction(6, (0, 0)), "face is 6"),
        (lambda: ssr_ref.cube_direction(0.5, (0, 0)), "face is 0.5"),
        (lambda: ssr_ref.cube_direction(np.nan, (0, 0)), "face is nan"),
        (lambda: ssr_ref.cube_direction([0, 1], np.zeros((3, 2))), "do not broadcast"),
    ],
)
def test_errors_are_one_line(call, what: str) -> None:
    with pytest.raises(ssr_ref.SsrRefError, match=what) as caught:
        call()
    assert "\n" not in str(caught.value) and "expected" in str(caught.value)

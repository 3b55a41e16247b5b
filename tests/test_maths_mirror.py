"""reflect and the mirror matrix: bounds, invariants, what other normals give, the printed slips."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from maths_checks import U, check_mirror_matrix, check_reflect, lengths

from benchmarks.published import (
    WRONG_ENTRIES,
    published_mirror_matrix,
    published_mirror_point,
    worst_displacement,
)
from ssr_ref import MathsError, look_at, mirror_matrix, reflect
from ssr_ref.study.sampling import examples


def test_reflect() -> None:
    check_reflect(reflect)


def test_published_reflect_with_unit_normals() -> None:
    check_reflect(lambda d, n: reflect(d, n, form="published"), key="reflect/published")


def test_a_normal_that_is_not_unit() -> None:
    """v = (1, 0), n = (1, 1): the printed formula gives (−1, −2); the mirror image is (0, −1)."""
    v, n = (1.0, 0.0, 0.0), (1.0, 1.0, 0.0)
    assert reflect(v, n).tolist() == [0.0, -1.0, 0.0]
    assert reflect(v, n, form="published").tolist() == [-1.0, -2.0, 0.0]
    # Length s: along n the printed formula gives 1 − 2s² times the component instead of −1.
    for s in (0.5, 0.9, 1.1):
        got = reflect((0.0, -1.0, 0.0), (0.0, s, 0.0), form="published")
        assert abs(got[1] + (1.0 - 2.0 * s * s)) < 4.0 * U


def test_bad_normals_and_the_other_side() -> None:
    d = (0.3, -0.9, 0.1)
    for bad in ((0.0, 0.0, 0.0), (np.nan, 1.0, 0.0), (0.0, np.inf, 0.0)):
        assert np.isnan(reflect(d, bad)).all()
    assert reflect(d, (0.0, 0.0, 0.0), form="published").tolist() == list(d)
    up, down = reflect(d, (0.1, 2.0, 0.3)), reflect(d, (-0.1, -2.0, -0.3))
    assert np.array_equal(up, down)


@pytest.mark.parametrize("length", [1e-300, 1e-160, 1e160, 1e300])
def test_normals_of_extreme_length(length: float) -> None:
    got = reflect((1.0, -2.0, 0.5), (0.0, length, length))
    assert np.abs(got - [1.0, -0.5, 2.0]).max() <= 17.0 * U * 2.3


def test_view_and_world_agree() -> None:
    """Mirroring, then turning into view space, is turning both, then mirroring."""
    world = look_at((3.0, 2.0, 5.0), (0.1, 0.3, -0.2))
    turn = world[:3, :3].T
    d, n = examples("reflect/normalizing", 200, 9)

    def to_view(v: np.ndarray) -> np.ndarray:
        return (turn[None] * v[:, None, :]).sum(axis=-1)

    there = reflect(to_view(d), to_view(n))
    assert (lengths(there - to_view(reflect(d, n))) <= 40.0 * U * lengths(d)).all()


numbers = st.floats(-1e6, 1e6, width=32)


@settings(max_examples=150, derandomize=True, deadline=None)
@given(st.tuples(*[numbers] * 6))
def test_length_is_kept_and_twice_is_identity(values: tuple[float, ...]) -> None:
    d, n = np.array(values[:3]), np.array(values[3:])
    if not n.any():
        return
    r = reflect(d, n)
    assert abs(lengths(r) - lengths(d)) <= 21.0 * U * lengths(d)
    assert lengths(reflect(r, n) - d) <= 36.0 * U * lengths(d)
    assert np.array_equal(reflect(d * 2.0**-40, n * 2.0**60), r * 2.0**-40)


def test_mirror_matrix() -> None:
    check_mirror_matrix(mirror_matrix)


def test_mirror_of_the_floor() -> None:
    """Plane y = 2: (x, y, z) → (x, 4 − y, z), exactly; any length of normal; the transpose."""
    want = [[1, 0, 0, 0], [0, -1, 0, 4], [0, 0, 1, 0], [0, 0, 0, 1]]
    for length in (1.0, 3.0, 1e-200, 1e200):
        m = mirror_matrix((0.0, length, 0.0), -2.0 * length)
        assert m.tolist() == want
    assert mirror_matrix((0.0, 1.0, 0.0), -2.0, row_vectors=True).T.tolist() == want
    assert np.isnan(mirror_matrix((0.0, 0.0, 0.0), 1.0)[:3]).all()


def test_mirror_matrix_is_reflect_for_directions() -> None:
    d, n = examples("reflect/normalizing", 100, 4)
    m = mirror_matrix(n, 0.0)[:, :3, :3]
    assert (
        lengths((m * d[:, None, :]).sum(axis=-1) - reflect(d, n)) <= 24.0 * U * lengths(d)
    ).all()


def test_shapes_and_errors() -> None:
    normals = np.ones((3, 1, 3))
    assert mirror_matrix(normals, np.zeros(5)).shape == (3, 5, 4, 4)
    assert reflect(np.ones((4, 3)), [0, 1, 0]).shape == (4, 3)
    assert mirror_matrix(np.zeros((0, 3)), 0.0).shape == (0, 4, 4)
    assert (normals == 1.0).all()
    for call, words in (
        (lambda: reflect([1.0, 2.0], [0, 1, 0]), "incident has shape"),
        (lambda: reflect([1.0, 2.0, 3.0], [0, 1, 0], form="phong"), "form is 'phong'"),
        (lambda: mirror_matrix(np.ones((2, 3)), np.ones(3)), "do not broadcast"),
        (lambda: mirror_matrix(["up"], 0.0), "normal is of type"),
        (lambda: reflect(np.ones(3) * 1j, [0, 1, 0]), "incident is of type complex"),
    ):
        with pytest.raises(MathsError, match=words) as caught:
            call()
        assert "\n" not in str(caught.value)


def test_the_printed_matrix_is_wrong_in_three_entries() -> None:
    """n = (2, 3, 6)/7, d = ½: off in exactly the entries named, by 2nz(1 − ny), 2nx(nz − ny) and
    2d(1 − ny); a point of the unit cube lands up to 2.1 away. And M·M is far from I.
    """
    n, d = np.array([2.0, 3.0, 6.0]) / 7.0, 0.5
    printed, true = published_mirror_matrix(n, d), mirror_matrix(n, d, row_vectors=True)
    off = np.abs(printed - true) > 1e-12
    assert {tuple(map(int, place)) for place in np.argwhere(off)} == set(WRONG_ENTRIES)
    want = {(1, 2): 2 * n[2] * (1 - n[1]), (2, 0): 2 * n[0] * (n[2] - n[1]), (3, 1): 1 - n[1]}
    for place, value in want.items():
        assert abs(abs(printed[place] - true[place]) - value) < 1e-14
    assert 1.0 < worst_displacement(n, d) < 3.0
    square = (printed[:, :, None] * printed[None]).sum(axis=1)
    assert np.abs(square - np.eye(4)).max() > 0.3
    # The formula above it: right only for planes through the origin, else off by 2|d|.
    p = np.array([0.3, 0.4, 0.5])
    image = p - 2.0 * ((p * n).sum() + d) * n
    assert abs(lengths(published_mirror_point(p, n) - image) - 2.0 * d) < 1e-15 * 8

"""The line-drawing DDA: octants, ties, transposition, pure positions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from maths_checks import check_line

from ssr_ref import MathsError, dda_line


def test_against_rationals() -> None:
    check_line(dda_line, 600)


def test_a_line_by_hand() -> None:
    """(0, 0) to (5, 2): y = 0, 0.4, 0.8, 1.2, 1.6, 2 rounded; a tie goes to the higher pixel."""
    assert dda_line((0, 0), (5, 2)).tolist() == [[0, 0], [1, 0], [2, 1], [3, 1], [4, 2], [5, 2]]
    assert dda_line((0, 0), (2, 1)).tolist() == [[0, 0], [1, 1], [2, 1]]
    assert dda_line((2, 1), (0, 0)).tolist() == [[2, 1], [1, 1], [0, 0]]
    assert dda_line((0, 0), (-2, -1)).tolist() == [[0, 0], [-1, 0], [-2, -1]]
    assert dda_line((3, -4), (3, -4)).tolist() == [[3, -4]]


@pytest.mark.parametrize(
    "end", [(7, 3), (3, 7), (-3, 7), (-7, 3), (-7, -3), (-3, -7), (3, -7), (7, -3)]
)
def test_all_octants(end: tuple[int, int]) -> None:
    """One pixel a step on the longer axis, never more than one on the other; mirrored octants are
    mirror images off ties (3/7 has none).
    """
    line = dda_line((0, 0), end)
    assert line.shape == (8, 2)
    steps = np.abs(np.diff(line, axis=0))
    assert (steps.max(axis=-1) == 1).all()
    base = dda_line((0, 0), (7, 3))
    longer = 0 if abs(end[0]) == 7 else 1
    signs = np.sign(end)
    mirrored = base if longer == 0 else base[:, ::-1]
    assert np.array_equal(line, mirrored * signs)


pixel = st.integers(-(2**29), 2**29)
near_pixel = st.integers(-40, 40)


@settings(max_examples=150, derandomize=True, deadline=None)
@given(st.tuples(*[near_pixel] * 4))
def test_transposed_ends_give_transposed_pixels(ends: tuple[int, ...]) -> None:
    """Both axes round alike, so this holds at ties too; and the way back is the same off ties."""
    x0, y0, x1, y1 = ends
    line = dda_line((x0, y0), (x1, y1))
    assert np.array_equal(dda_line((y0, x0), (y1, x1)), line[:, ::-1])
    assert line[0].tolist() == [x0, y0] and line[-1].tolist() == [x1, y1]
    steps = max(abs(x1 - x0), abs(y1 - y0))
    if steps and not any((2 * i * min(abs(x1 - x0), abs(y1 - y0))) % (2 * steps) == steps
                         for i in range(steps + 1)):  # fmt: skip
        assert np.array_equal(dda_line((x1, y1), (x0, y0))[::-1], line)


@settings(max_examples=80, derandomize=True, deadline=None)
@given(st.tuples(*[pixel] * 4), st.floats(0.0, 1.0))
def test_a_pixel_of_a_huge_line_is_within_half_a_pixel(ends: tuple[int, ...], part: float) -> None:
    x0, y0, x1, y1 = ends
    steps = max(abs(x1 - x0), abs(y1 - y0))
    index = int(part * steps)
    found = dda_line((x0, y0), (x1, y1), index)
    for value, a, b in zip(found.tolist(), (x0, y0), (x1, y1)):
        # |value − (a + i·(b − a)/S)| ≤ ½ in whole numbers
        assert abs(2 * (value - a) * steps - 2 * index * (b - a)) <= steps


def test_broadcasting_and_errors() -> None:
    many = dda_line(np.zeros((4, 1, 2), int), [[8, 3], [3, 8]], np.arange(4)[:, None])
    assert many.shape == (4, 2, 2)
    assert many[3].tolist() == [[3, 1], [1, 3]]
    for arguments, words in (
        (((0, 0), (1.5, 2)), "end is of type float64"),
        (((0, 0, 0), (1, 2)), "start has shape"),
        (((0, 0), (2**29 + 1, 2)), "beyond"),
        (((0, 0), (5, 2), 6), "index is outside"),
        (((0, 0), (5, 2), -1), "index is outside"),
        (([(0, 0)], (5, 2)), "several lines"),
        (((0, 0), ([1, 2], [1])), "end is no array"),
    ):
        with pytest.raises(MathsError, match=words) as caught:
            dda_line(*arguments)
        assert "\n" not in str(caught.value)

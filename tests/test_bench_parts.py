"""Parts of `bench` by hand: fronts, blocks, judging, recommendation, tables."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from frames import made_up_frame

from ssr_ref.buffers import Status, Truth, TruthClass
from ssr_ref.cli.bench import parse_cameras, parse_seconds, parse_share
from ssr_ref.errors import CameraError, SettingsError
from ssr_ref.pipeline import Frame
from ssr_ref.report import bench_table
from ssr_ref.settings import METHODS, Settings
from ssr_ref.study.bench import Bench, Row, block_maxima, work_of
from ssr_ref.study.judge import Judged, judge, pooled
from ssr_ref.study.pareto import best_within, cheapest_within, pareto_front
from ssr_ref.study.sweep import sweep

NAN = float("nan")


def test_the_front_is_what_nothing_beats() -> None:
    cost = [3.0, 1.0, 2.0, 2.0, 5.0, 4.0, NAN, 1.0]
    error = [0.2, 0.9, 0.5, 0.4, 0.2, NAN, 0.0, 0.9]
    # (1, .9) first of two equal ones, (2, .4) beats (2, .5), (3, .2) beats (5, .2).
    assert pareto_front(cost, error) == [1, 3, 0]
    assert pareto_front([], []) == []


def test_a_front_of_random_ways_by_brute_force() -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        cost, error = rng.integers(0, 6, (2, 20)).astype(float)
        ways = list(zip(cost.tolist(), error.tolist()))

        def beaten(i: int, ways: list = ways) -> bool:
            (c, e) = ways[i]
            return any(
                (a <= c and b <= e and (a < c or b < e)) or ((a, b) == (c, e) and j < i)
                for j, (a, b) in enumerate(ways)
            )

        expected = sorted((i for i in range(20) if not beaten(i)), key=lambda i: cost[i])
        assert pareto_front(cost, error) == expected


def test_recommended_within_a_bound_and_within_a_budget() -> None:
    cost, error = [5.0, 2.0, 9.0, NAN], [0.01, 0.2, 0.001, 0.0]
    assert cheapest_within(cost, error, 0.01) == 0
    assert cheapest_within(cost, error, 0.0005) is None
    assert best_within(cost, error, 8.0) == 0 and best_within(cost, error, 9.0) == 2
    assert best_within(cost, error, 1.0) is None


def test_blocks_are_8_by_4_and_may_be_cut_off() -> None:
    steps = np.zeros((5, 17), np.uint32)
    steps[3, 7], steps[4, 7], steps[0, 16] = 5, 2, 9
    assert block_maxima(steps).tolist() == [[5, 0, 9], [2, 0, 0]]


FRAME = made_up_frame((5, 3))


def one_row(kinds: list[tuple[TruthClass, float | None, int]]) -> tuple[Frame, Truth]:
    """A 1-pixel-high image: of each pixel its class, how far right of X the hit is (None: no hit),
    and the object that is hit (X lies on object 1).
    """
    n = len(kinds)
    frame = made_up_frame((2 * n, 1))
    status = np.full((1, 2 * n), Status.NOT_REFLECTIVE, np.uint8)
    hit_px = np.full((1, 2 * n, 2), np.nan)
    truth = np.zeros((1, 2 * n), np.uint8)
    x_px = np.full((1, 2 * n, 2), np.nan)
    objects = np.full((1, 2 * n), -1, np.int32)
    for i, (kind, off, met) in enumerate(kinds):
        truth[0, i] = kind
        x_px[0, i] = (n + i + 0.25, 0.5)
        status[0, i] = Status.LEFT_SCREEN_T if off is None else Status.HIT
        if off is not None:
            hit_px[0, i] = (n + i + 0.25 + off, 0.5)
            objects[0, int(n + i + 0.25 + off)] = met
    blank = np.zeros((1, 2 * n))
    return (
        replace(
            frame,
            gbuffer=replace(frame.gbuffer, object_id=objects),
            hits=replace(frame.hits, status=status, hit_px=hit_px),
        ),
        Truth(
            truth=truth,
            side=np.zeros_like(truth),
            triangle_id=np.zeros_like(objects),
            object_id=np.where(truth > TruthClass.NOTHING, 1, -1).astype(np.int32),
            distance=blank,
            hit_px=x_px,
            hit_depth=blank,
            radiance=np.full((1, 2 * n, 3), 0.5),
        ),
    )


def test_right_and_wrong_by_hand() -> None:
    frame, truth = one_row(
        [
            (TruthClass.VISIBLE, 0.25, 1),  # right
            (TruthClass.VISIBLE, 0.0, 2),  # another object
            (TruthClass.VISIBLE, 1.25, 1),  # too far
            (TruthClass.VISIBLE, None, 1),  # missed
            (TruthClass.OFF_SCREEN, None, 1),  # right
            (TruthClass.OCCLUDED, 0.0, 1),  # a guess
            (TruthClass.NOTHING, None, 1),  # right
            (TruthClass.NO_RAY, None, 1),  # not counted
        ]
    )
    found = judge((frame.hits, frame.resolved), truth, frame.gbuffer, frame.settings, flip=False)
    assert (found.rays, found.visible, found.hits) == (7, 4, 4)
    assert found.right_hits == 1 and found.wrong_rays == 4
    assert found.wrong == 4 / 7 and found.recall == 1 / 4 and found.precision == 1 / 4
    best = judge(None, truth, frame.gbuffer, frame.settings, flip=False)
    assert (best.wrong_rays, best.right_hits, best.hits) == (0, 4, 4)
    assert best.recall == best.precision == 1.0 and best.p95 == 0.0
    both = pooled([found, found])
    assert both.rays == 14 and both.wrong == found.wrong and len(both.distances) == 4


def test_relative_squared_error_by_hand_and_non_finite_apart() -> None:
    frame, truth = one_row([(TruthClass.VISIBLE, 0.0, 1)] * 3)
    shown = np.zeros((1, 6, 3), np.float32)
    shown[0, 0] = 0.5
    shown[0, 1] = (0.5, 0.75, 0.5)
    shown[0, 2] = np.nan
    resolved = replace(frame.resolved, reflection=shown)
    found = judge((frame.hits, resolved), truth, frame.gbuffer, frame.settings, flip=False)
    assert found.non_finite == 1
    # One channel of six is 0.25 off: 0.0625 / (0.25 + 0.01), over 3 channels, over 2 pixels.
    assert found.rel_mse == pytest.approx(0.0625 / 0.26 / 3 / 2, rel=1e-12)
    assert np.isnan(found.flip) and found.to_json()["flip"] is None


@pytest.mark.slow
def test_flip_is_0_for_equal_images_and_large_for_white_on_black() -> None:
    pytest.importorskip("flip_evaluator")
    frame, truth = one_row([(TruthClass.VISIBLE, 0.0, 1)] * 3)
    truth = replace(truth, radiance=np.zeros((1, 6, 3)))
    values = []
    for level in (0.0, 1.0):
        resolved = replace(frame.resolved, reflection=np.full((1, 6, 3), level, np.float32))
        found = judge((frame.hits, resolved), truth, frame.gbuffer, frame.settings, flip=True)
        values.append(found.flip)
    assert values[0] == 0.0 and 0.5 < values[1] <= 1.0


def test_the_sweep_covers_what_changes_cost_and_error() -> None:
    cases = sweep(Settings(size=(9, 7)), 4.0)
    labels = [case.label for case in cases]
    assert len(set(labels)) == len(labels)
    assert {case.method for case in cases} == set(METHODS)
    march = [case.settings for case in cases if case.method == "march"]
    assert {s.step for s in march} == {4.0 * 2.0**-n for n in range(4, 10)}
    assert {s.refine for s in march} == {"none", "bisect", "secant"}
    dda = [case.settings for case in cases if case.method == "dda" and case.settings.stride > 1]
    kinds = {(s.stride, s.refine, s.jitter, s.thickness_from) for s in dda if s.surface != "plane"}
    assert len(kinds) == 4 * 3 * 2 * 2
    assert "dda stride=4 refine=bisect jitter thickness_from=constant" in labels
    only = sweep(Settings(), 4.0, ("exact",))
    assert [case.label for case in only] == [
        "exact thickness_from=back_faces", "exact thickness_from=constant",
    ]  # fmt: skip
    with pytest.raises(SettingsError, match="'hi-z'"):
        sweep(Settings(), 1.0, ("hi-z",))


def made_up_bench(scene: str = "made up", rays: int = 10) -> Bench:
    errors = Judged(rays, 8, 7, 6, 2, np.array([0.0, 0.5]), 0.1, NAN, 1)
    row = Row(
        "dda", "dda stride=1", {"stride": 1}, Settings().resolved(1.0), 0.002, 0.001, 0.004, 0.001,
        1.5, 3.0, 6.0, 4.0, 0, errors,
    )  # fmt: skip
    slow = replace(row, label="exact", method="exact", seconds=0.02)
    return Bench(
        scene, "ab" * 32, 12, (9, 7), 1, 3, rays, (row, slow), errors, 0.5, (("planar", "curved"),)
    )


def test_tables_have_every_column_and_mark_the_front() -> None:
    bench = made_up_bench()
    text = bench_table.markdown(bench)
    assert "| **dda stride=1** | 3.00 | 6.0 | 4.0 | 20.000 | 75.000 | 0.4750 |" in text
    assert "| exact | 21.00 |" in text and "Not applicable: planar: curved." in text
    lines = bench_table.csv_text([bench, bench]).splitlines()
    assert len(lines) == 5 and lines[0].split(",")[:4] == [
        "scene", "method", "case", "pareto_seconds",
    ]  # fmt: skip
    assert all(len(line.split(",")) == 5 + len(bench_table.COLUMNS) for line in lines)
    assert lines[1].split(",")[3] == "1" and lines[2].split(",")[3] == "0"


def test_work_sums() -> None:
    hits = replace(
        FRAME.hits,
        steps=np.arange(15, dtype=np.uint32).reshape(3, 5),
        fetches=np.full((3, 5), 2, np.uint32),
    )
    assert work_of(hits).tolist() == [105.0, 30.0, 1.0, 14.0]


@pytest.mark.parametrize(
    ("text", "value"), [("1%", 0.01), ("0.5 %", 0.005), ("0.02", 0.02), ("1e-3", 1e-3)]
)
def test_shares(text: str, value: float) -> None:
    assert parse_share(text) == value


@pytest.mark.parametrize(("text", "value"), [("20ms", 0.02), ("0.5s", 0.5), ("1.5 ms", 0.0015)])
def test_times(text: str, value: float) -> None:
    assert parse_seconds(text) == value


@pytest.mark.parametrize(
    ("parse", "text"),
    [(parse_share, "few"), (parse_share, "200%"), (parse_share, "-1%"), (parse_seconds, "20"),
     (parse_seconds, "fast"), (parse_seconds, "-1ms")],
)  # fmt: skip
def test_bad_bounds(parse: Any, text: str) -> None:
    with pytest.raises(SettingsError, match=f"is '{text}'; expected"):
        parse(text)


def test_cameras_are_a_list() -> None:
    view = {"eye": [0, 0, 5], "target": [0, 0, 0], "fov_y_degrees": 40}
    assert len(parse_cameras([view, view])) == len(parse_cameras({"cameras": [view] * 2})) == 2
    for bad in ([], {}, {"cameras": 3}, 4):
        with pytest.raises(CameraError, match="expected one camera or view at least"):
            parse_cameras(bad)

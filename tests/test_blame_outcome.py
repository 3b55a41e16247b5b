"""Outcome tables and measures: by hand, and in agreement with the closed forms' own."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from blame_frames import closed_form_truth, hits_of, made_up, render, truth_of

from ssr_ref import Settings, SsrRefError
from ssr_ref.analytic import analytic_reflections, hit_errors
from ssr_ref.analytic.scenes import SCENES
from ssr_ref.blame import Outcome, outcome
from ssr_ref.blame.outcome import spread
from ssr_ref.buffers import GBuffer, Side, Status, TruthClass
from ssr_ref.pipeline import Frame


def hand_frame(objects: bool = True) -> tuple[Frame, Any]:
    """2 × 5 pixels; every truth has X at (2.5, 0.5), depth 4, object 2. By pixel:

    row 0: VISIBLE hit at X; VISIBLE hit 0.75 right, depth 5; VISIBLE hit 2 left, depth 2, which is
    object 0; VISIBLE missed (SELF); OCCLUDED hit.
    row 1: OFF_SCREEN LEFT, left the screen left; OFF_SCREEN BEHIND, passed behind; NOTHING, maximum
    distance; no ray, hit; no ray, background.
    """
    v = TruthClass.VISIBLE
    classes = [
        [v, v, v, v, TruthClass.OCCLUDED],
        [TruthClass.OFF_SCREEN, TruthClass.OFF_SCREEN, TruthClass.NOTHING, 0, 0],
    ]
    h = Status.HIT
    status = [
        [h, h, h, Status.SELF, h],
        [Status.LEFT_SCREEN_L, Status.PASSED_BEHIND, Status.MAX_DISTANCE, h, Status.BACKGROUND],
    ]
    px = np.full((2, 5, 2), np.nan)
    px[0, [0, 1, 2, 4]] = (2.5, 0.5), (3.25, 0.5), (0.5, 0.5), (2.5, 0.5)
    px[1, 3] = (2.5, 0.5)
    depth = np.full((2, 5), np.nan)
    depth[0, [0, 1, 2, 4]] = 4.0, 5.0, 2.0, 4.0
    ids = np.array([[0, 0, 2, 2, 4]] * 2, np.int32)
    truth = truth_of(
        classes,
        np.full((2, 5, 2), (2.5, 0.5)),
        np.full((2, 5), 2),
        np.zeros((2, 5, 3)),
        np.full((2, 5), 4.0),
        [[0] * 5, [Side.LEFT, Side.BEHIND, 0, 0, 0]],
    )
    gbuffer = GBuffer(
        depth=np.ones((2, 5)), triangle_id=ids, object_id=ids if objects else None,
        radiance=np.zeros((2, 5, 3)),
    )  # fmt: skip
    frame = made_up(gbuffer, hits_of(status, px, depth), np.zeros((2, 5, 3)), Settings(size=(5, 2)))
    return frame, truth


def test_the_tables_by_hand() -> None:
    found = outcome(*hand_frame())
    by_class = {
        (Status.HIT, TruthClass.VISIBLE): 3, (Status.SELF, TruthClass.VISIBLE): 1,
        (Status.HIT, TruthClass.OCCLUDED): 1, (Status.LEFT_SCREEN_L, TruthClass.OFF_SCREEN): 1,
        (Status.PASSED_BEHIND, TruthClass.OFF_SCREEN): 1,
        (Status.MAX_DISTANCE, TruthClass.NOTHING): 1, (Status.HIT, TruthClass.NO_RAY): 1,
        (Status.BACKGROUND, TruthClass.NO_RAY): 1,
    }  # fmt: skip
    expected = np.zeros((len(Status), len(TruthClass)), int)
    for cell, count in by_class.items():
        expected[cell] = count
    assert np.array_equal(found.status_by_class, expected)
    sides = np.zeros((len(Status), len(Side)), int)
    sides[Status.LEFT_SCREEN_L, Side.LEFT] = sides[Status.PASSED_BEHIND, Side.BEHIND] = 1
    assert np.array_equal(found.status_by_side, sides)
    data = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert data["status_by_class"]["SELF"] == {c.name: int(c == 5) for c in TruthClass}
    assert list(data["status_by_class"]) == [s.name for s in Status]


def test_the_measures_by_hand() -> None:
    """V has 4, of which 3 are hit; 4 of all rays hit. Distances 0, 0.75, 2; depths off by 0, 1/4,
    1/2; the one at column 0 shows object 0. Recall 3/4, precision 3/4, F1 6/8.
    """
    found = outcome(*hand_frame())
    assert (found.rays, found.visible, found.hits, found.common) == (8, 4, 4, 3)
    assert (found.recall, found.precision, found.f1) == (0.75, 0.75, 0.75)
    d, z = found.distance, found.depth_error
    assert (d.count, d.non_finite, d.median, d.most, d.worst) == (3, 0, 0.75, 2.0, (2, 0))
    assert d.p95 == pytest.approx(0.75 + 0.9 * 1.25)  # 0.95·2 = 1.9 of the way along (0, ¾, 2)
    assert (z.median, z.most, z.worst) == (0.25, 0.5, (2, 0))
    assert found.wrong_object == pytest.approx(1 / 3)
    assert found.error.mean_square == 0.0


def test_the_measures_of_nothing() -> None:
    frame, _ = hand_frame(objects=False)
    found = outcome(frame, truth_of(np.zeros((2, 5))))
    assert (found.rays, found.visible, found.hits, found.common) == (0, 0, 0, 0)
    assert np.isnan([found.recall, found.precision, found.f1, found.wrong_object]).all()
    data = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert data["recall"] is None and data["distance"]["worst"] is None
    with pytest.raises(SsrRefError, match="expected the frame's 5x2"):
        outcome(frame, truth_of(np.zeros((2, 4))))


def test_values_that_are_not_finite_are_counted_apart() -> None:
    frame, truth = hand_frame()
    frame.hits.hit_px[0, 0, 0] = np.nan
    frame.hits.hit_depth[0, 1] = np.inf
    found = outcome(frame, truth)
    d, z = found.distance, found.depth_error
    assert (d.count, d.non_finite, d.median, d.most, d.worst) == (2, 1, 1.375, 2.0, (2, 0))
    assert (z.count, z.non_finite, z.most, z.worst) == (2, 1, 0.5, (2, 0))
    assert found.wrong_object == 0.5
    assert (found.common, found.recall) == (3, 0.75)  # a hit by its status


def test_the_worst_pixel_is_the_first() -> None:
    image = np.array([[9.0, 1.0, 3.0], [3.0, np.nan, 0.0]])
    where = np.array([[False, True, True], [True, True, True]])
    found = spread(image, where)
    assert (found.count, found.non_finite, found.most, found.worst) == (4, 1, 3.0, (2, 0))
    assert found.median == 2.0


@pytest.mark.parametrize(
    "options", [{}, {"tracer": "cells"}, {"stride": 8, "refine": "none"}], ids=str
)
def test_it_agrees_with_the_errors_of_closed_forms(options: dict[str, Any]) -> None:
    """`hit_errors` measures the same rays: what both have is the same number."""
    for name in ("clutter", "sphere_on_plane"):
        frame = render(SCENES[name](), thickness=np.inf, **options)
        found: Outcome = outcome(frame, closed_form_truth(frame))
        known = analytic_reflections(
            frame.scene,
            frame.camera,
            frame.settings.size,
            frame.gbuffer,  # type: ignore[arg-type]
        )
        errors = hit_errors(frame.hits, known, frame.gbuffer)
        assert (found.rays, found.visible) == (errors.rays, errors.visible)
        assert 1.0 - found.recall == pytest.approx(errors.missed, abs=1e-15)
        assert (found.distance.median, found.distance.p95) == (errors.p50, errors.p95)
        off = (errors.false + errors.unseen) * errors.rays
        assert found.hits - found.common == pytest.approx(off)
        assert found.status_by_class.sum() == 37 * 23
        assert found.status_by_class[:, 1:].sum() == found.rays
        assert found.status_by_side.sum() == found.status_by_class[:, TruthClass.OFF_SCREEN].sum()
        assert found.status_by_side[:, Side.NONE].sum() == 0

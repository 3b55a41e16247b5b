"""Blame of every built-in scene, and of three whose answer is known before."""

from __future__ import annotations

import numpy as np
import pytest

import ssr_ref
from ssr_ref.analytic import AnalyticScene, Box, Plane
from ssr_ref.analytic.scenes import MATERIALS, MIRROR, RED
from ssr_ref.blame import Charge, blame, outcome
from ssr_ref.blame.parts import PARTS
from ssr_ref.buffers import Side, Status, TruthClass
from ssr_ref.scenes import BUILTIN

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("name", BUILTIN)
def test_the_parts_add_up_on_every_built_in_scene(name: str) -> None:
    """To 8 · 2⁻⁵³ of what is added, in every pixel and channel; shares to 1e-12."""
    settings = ssr_ref.Settings(size=(96, 54), stride=4, jitter=True)
    frame = ssr_ref.render(ssr_ref.load(name, tessellation=6), settings=settings)
    truth = ssr_ref.trace_truth(frame.scene, frame.camera, frame.settings, frame.gbuffer)
    found = blame(frame, truth)
    parts = [getattr(found, part) for part in PARTS]
    bound = 8 * 2.0**-53 * sum(np.abs(part) for part in parts)
    assert (np.abs(sum(parts) - found.error) <= bound).all()
    assert found.totals.rays > 100 and found.totals.non_finite == 0
    assert abs(sum(found.totals.shares.values()) - 1.0) < 1e-12


def look(box: Box, *, size: tuple[int, int] = (160, 90), **options: object):
    """A box over a mirror floor, seen a little from above; edge fade off."""
    floor = Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), MIRROR, "floor")
    view = ssr_ref.View(eye=(0.0, 1.2, 5.0), target=(0.0, 0.4, 0.0), fov_y_degrees=40.0)
    scene = AnalyticScene((floor, box), MATERIALS, view=view, name="known")
    settings = ssr_ref.Settings(size=size, edge_fade=False, max_distance=np.inf, **options)
    frame = ssr_ref.render(scene, settings=settings)
    truth = ssr_ref.trace_truth(scene, frame.camera, frame.settings, frame.gbuffer)
    return frame, truth, outcome(frame, truth), blame(frame, truth)


def test_a_floating_box_shows_a_lower_side_that_the_screen_has_not() -> None:
    """Below the box the mirror shows its lower side first, and the camera sees none of that."""
    _frame, truth, seen, found = look(Box.between((-0.5, 0.6, -0.5), (0.5, 1.0, 0.5), RED))
    lower = truth.truth == TruthClass.BACK_FACING
    assert lower.sum() > 100 and (truth.object_id[lower] == 1).all()
    # All that is met is the box, from the front or from below: no other class is there.
    kinds = set(np.unique(truth.truth)) - {TruthClass.NO_RAY, TruthClass.NOTHING}
    assert kinds == {TruthClass.BACK_FACING, TruthClass.VISIBLE}
    # What is not on screen is no fault of depth or tracer: K − T is −T there.
    counted = lower & found.counted
    assert np.allclose(found.information[counted], -truth.radiance[counted], atol=0.0)
    assert not found.information[truth.truth == TruthClass.VISIBLE].any()
    assert seen.recall > 0.98


def test_an_object_that_crosses_the_windows_edge_is_missed_where_it_is_outside() -> None:
    """A box reaches beyond the right border: rays to its far part are OFF_SCREEN to the RIGHT."""
    frame, truth, _seen, found = look(Box.between((1.6, 0.0, -0.5), (6.0, 0.8, 0.5), RED))
    outside = truth.truth == TruthClass.OFF_SCREEN
    assert outside.sum() > 30 and set(np.unique(truth.side[outside])) == {Side.RIGHT}
    assert (truth.hit_px[outside][:, 0] >= frame.settings.size[0]).all()
    # The tracer leaves the window there, and says so.
    assert (frame.hits.status[outside] == Status.LEFT_SCREEN_R).mean() > 0.95
    missed = outside & (frame.hits.status != Status.HIT)
    assert (found.charge[missed] == Charge.INFORMATION).mean() > 0.95


def test_a_pole_thinner_than_the_stride_is_lost_in_traversal() -> None:
    """At stride 16 without refinement rays step over a level pole that is a pixel or two thick."""
    pole = Box.between((-1.5, 0.5, -0.02), (1.5, 0.55, 0.02), RED)
    coarse = {"stride": 16, "refine": "none"}
    _, _truth, exact_seen, exact = look(pole, tracer="cells", buffer_dtype="float64")
    _, _, seen, found = look(pole, buffer_dtype="float64", **coarse)
    assert exact_seen.visible > 30 and exact_seen.recall > 0.9 and seen.recall < 0.5
    assert exact.totals.charged["TRAVERSAL"] == 0
    lost = exact_seen.common - seen.common
    assert found.totals.charged["TRAVERSAL"] >= 0.8 * lost > 10
    # What the screen has, and what one depth a pixel makes of it, is as it was.
    for part in ("information", "depth_model"):
        assert getattr(found, part).tobytes() == getattr(exact, part).tobytes(), part

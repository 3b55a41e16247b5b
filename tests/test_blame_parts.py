"""Four parts of error: their sum, numbers by hand, planted mistakes, what is left out."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from blame_frames import (
    closed_form_truth,
    hits_of,
    made_up,
    parts_add_up,
    render,
    same_bytes,
    truth_of,
    with_hits,
)
from mutants import mutant
from tracing import same_hits

from ssr_ref import Settings, SsrRefError, View
from ssr_ref.analytic import AnalyticScene, Plane
from ssr_ref.analytic.scenes import SCENES
from ssr_ref.blame import Blame, Charge, blame, total_error, trace_oracle
from ssr_ref.blame.parts import PARTS, shares
from ssr_ref.buffers import GBuffer, Status, TruthClass
from ssr_ref.pipeline import Frame
from ssr_ref.scene import Material
from ssr_ref.ssr.trace import trace

HIT, MISS, SELF = Status.HIT, Status.PASSED_BEHIND, Status.SELF
FOG: dict[str, Any] = {"fallback": "constant", "fallback_color": (0.1, 0.2, 0.3)}
METHODS: dict[str, dict[str, Any]] = {
    "dda": {},
    "stride 4, jitter": {"stride": 4, "jitter": True, "seed": 3, **FOG},
    "stride 8, no refinement": {"stride": 8, "refine": "none", "edge_fade": False},
    "cells": {"tracer": "cells", "distance_fade": "linear", "max_distance": 16.0},
    "cells, planes": {"tracer": "cells", "surface": "plane", **FOG},
    "stride 3, planes": {"stride": 3, "surface": "plane", "edge_fade": False},
    "march, jitter": {"tracer": "march", "jitter": True, "max_distance": 8.0},
    "march as published": {"tracer": "march", "listing": True, "max_steps": 64},
    "three steps": {"max_steps": 3, "thickness_from": "constant", "thickness": 0.25},
}
SCENE_NAMES = ("clutter", "corner", "inside_a_sphere")


@pytest.fixture(scope="module")
def frames() -> dict[tuple[str, str], tuple[Frame, Blame]]:
    """Every method on every scene, blamed; the truth of one G-buffer is traced once."""
    out = {}
    for name in SCENE_NAMES:
        for method, options in METHODS.items():
            scene = SCENES[name](orthographic=name == "corner")
            frame = render(scene, **({"thickness": np.inf} | options))
            out[name, method] = frame, blame(frame, closed_form_truth(frame))
    return out


@pytest.mark.parametrize("method", METHODS)
def test_the_parts_add_up(frames: Any, method: str) -> None:
    for name in SCENE_NAMES:
        frame, blamed = frames[name, method]
        totals = blamed.totals
        parts_add_up(blamed)
        assert totals.counted == totals.rays == int(blamed.counted.sum()) > 100
        assert totals.non_finite == totals.only_truth == totals.only_method == 0
        # n terms summed one after the other, twice: within 4·n·2⁻⁵³ of 1.
        assert abs(sum(totals.shares.values()) - 1.0) < 1e-12
        assert totals.mean_square > 0.0
        assert sum(totals.charged.values()) == totals.counted
        for image in (*(getattr(blamed, part) for part in PARTS), blamed.error):
            assert (image[~blamed.counted] == 0.0).all()
        if not frame.settings.edge_fade:
            assert (blamed.shading == 0.0).all()
        if frame.settings.tracer == "cells":
            same_hits(frame.hits, blamed.oracle)
            assert (blamed.traversal == 0.0).all()


def test_what_each_part_depends_on(frames: Any) -> None:
    """Information is the scene's alone: the same bytes for each method with the same fallback and
    max_distance. The depth model is that of the solid: the same for each of its tracers.
    """
    for name in SCENE_NAMES:
        dda, rough = (frames[name, key][1] for key in ("dda", "stride 8, no refinement"))
        assert same_bytes(dda.information, rough.information)
        assert same_bytes(dda.depth_model, rough.depth_model)
        thin = frames[name, "three steps"][1]
        assert same_bytes(dda.information, thin.information)
        assert not same_bytes(dda.depth_model, thin.depth_model)
        planes = frames[name, "stride 3, planes"][1]
        assert same_bytes(dda.information, planes.information)
        assert not same_bytes(dda.depth_model, planes.depth_model)


def test_an_oracle_can_be_shared(frames: Any) -> None:
    for name in SCENE_NAMES:
        first = frames[name, "dda"][1]
        frame, second = frames[name, "stride 8, no refinement"]
        again = blame(frame, closed_form_truth(frame), oracle=first.oracle)
        assert again.oracle is first.oracle
        for key, image in second.arrays().items():
            assert same_bytes(image, again.arrays()[key]), key


# ---- By hand ----------------------------------------------------------------------------------


def row(values: list[Any]) -> np.ndarray:
    return np.array([values], float)


def hand_frame() -> tuple[Frame, Any, Any]:
    """A row of nine pixels; texel i has red i/8 and object i. F is 1/2.

    Pixel by pixel: truth, oracle, method, shown (red; green and blue are 0 but for F):
     0  VISIBLE at texel 4, oracle and method hit it, shown as is
     1  OFF_SCREEN 7/4, all miss
     2  VISIBLE at texel 6, the oracle hits texel 2, the method too
     3  VISIBLE at texel 6, the oracle hits it, the method misses
     4  VISIBLE at texel 4, both hit, a fade shows 3/8
     5  NOTHING, the oracle hits texel 2, the method misses: compensated
     6  NOTHING, all miss
     7  OCCLUDED at texel 8, the method hits right there: by chance
     8  no ray
    """
    v, o, n = TruthClass.VISIBLE, TruthClass.OFF_SCREEN, TruthClass.NOTHING
    classes = [[v, o, v, v, v, n, n, TruthClass.OCCLUDED, TruthClass.NO_RAY]]
    at = [4, 99, 6, 6, 4, None, None, 8, None]
    red = [4 / 8, 7 / 4, 6 / 8, 6 / 8, 4 / 8, np.nan, np.nan, 5 / 8, np.nan]
    oracle_at = [4, None, 2, 6, 4, 2, None, None, None]
    method_at = [4, None, 2, None, 4, None, None, 8, None]
    shown = [4 / 8, 1 / 2, 2 / 8, 1 / 2, 3 / 8, 1 / 2, 1 / 2, 8 / 8, 0.0]

    def px(columns: list[int | None]) -> np.ndarray:
        return row([[np.nan, np.nan] if c is None else [c + 0.25, 0.75] for c in columns])

    def hits(columns: list[int | None]) -> Any:
        status = [[MISS if c is None else HIT for c in columns[:8]] + [Status.NOT_REFLECTIVE]]
        return hits_of(status, px(columns))

    gray = np.array([1.0, 0.0, 0.0])
    texels = np.arange(9)[None, :, None] / 8 * gray
    fallback = (0.5, 0.0, 0.0)
    gbuffer = GBuffer(
        depth=np.ones((1, 9)),
        triangle_id=np.arange(9, dtype=np.int32)[None],
        object_id=np.arange(9, dtype=np.int32)[None],
        radiance=texels,
    )
    settings = Settings(size=(9, 1), fallback="constant", fallback_color=fallback)
    objects = [[-1 if c is None else c for c in at]]
    truth = truth_of(classes, px(at), objects, row(red)[..., None] * gray)
    frame = made_up(gbuffer, hits(method_at), row(shown)[..., None] * gray, settings)
    return frame, truth, hits(oracle_at)


def test_the_parts_by_hand() -> None:
    """Eighths; K, O, M, A of each pixel by the list in `hand_frame`, F = 4:

         T   K   O   M   A    information  depth  traversal  shading
    0    4   4   4   4   4         0         0        0         0
    1   14   4   4   4   4       −10         0        0         0
    2    6   6   2   2   2         0        −4        0         0
    3    6   6   6   4   4         0         0       −2         0
    4    4   4   4   4   3         0         0        0        −1
    5    4   4   2   4   4         0        −2        2         0
    6    4   4   4   4   4         0         0        0         0
    7    5   4   4   8   8        −1         0        4         0
    """
    frame, truth, oracle = hand_frame()
    blamed = blame(frame, truth, oracle=oracle)
    eighths = {
        "information": [0, -10, 0, 0, 0, 0, 0, -1, 0],
        "depth_model": [0, 0, -4, 0, 0, -2, 0, 0, 0],
        "traversal": [0, 0, 0, -2, 0, 2, 0, 4, 0],
        "shading": [0, 0, 0, 0, -1, 0, 0, 0, 0],
    }
    error = np.array([0, -10, -4, -2, -1, 0, 0, 3, 0])
    for part, expected in eighths.items():
        assert (getattr(blamed, part)[0, :, 0] * 8).tolist() == expected, part
        assert (getattr(blamed, part)[0, :, 1:] == 0.0).all()
    assert (blamed.error[0, :, 0] * 8).tolist() == error.tolist()
    # Shares: Σ part·error / Σ error², 130 = 100 + 16 + 4 + 1 + 9.
    totals = blamed.totals
    for part, numerator in zip(PARTS, (100 - 3, 16, 4 + 12, 1), strict=True):
        assert totals.shares[part] == pytest.approx(float(Fraction(numerator, 130)), abs=1e-15)
    assert totals.mean_square == pytest.approx(130 / 64 / (8 * 3), abs=1e-15)
    names = (
        "RIGHT", "INFORMATION", "DEPTH_MODEL", "TRAVERSAL", "SHADING", "COMPENSATED", "RIGHT",
        "BY_CHANCE", "NOT_COUNTED",
    )  # fmt: skip
    assert [Charge(c).name for c in blamed.charge[0].tolist()] == list(names)
    assert totals.charged == {
        "RIGHT": 2, "INFORMATION": 1, "DEPTH_MODEL": 1, "TRAVERSAL": 1, "SHADING": 1,
        "COMPENSATED": 1, "BY_CHANCE": 1,
    }  # fmt: skip
    assert (totals.rays, totals.counted, totals.non_finite) == (8, 8, 0)
    assert json.loads(json.dumps(totals.to_json()))["charged"] == totals.charged


@pytest.mark.parametrize(
    ("column", "change", "charge"),
    [
        (0, {"px": (5.25, 0.75)}, Charge.TRAVERSAL),  # object 5 in the place of 4
        (0, {"px": (4.25, 0.75), "truth": (4.25, 1.875)}, Charge.TRAVERSAL),  # 1.125 px
        (0, {"px": (4.25, 0.75), "truth": (4.25, 1.75)}, Charge.RIGHT),  # exactly 1 px
        (6, {"px": (6.25, 0.75)}, Charge.TRAVERSAL),  # a hit on nothing
        (4, {"shown": 0.4999}, Charge.RIGHT),  # 1/5000 of the colour
        (4, {"shown": 0.495}, Charge.SHADING),  # 1/100
    ],
)
def test_when_a_pixel_is_wrong(column: int, change: dict[str, Any], charge: Charge) -> None:
    frame, truth, oracle = hand_frame()
    hits, shown = frame.hits, frame.resolved.reflection
    if "px" in change:
        hits.hit_px[0, column], hits.status[0, column] = change["px"], HIT
        shown[0, column, 0] = np.floor(change["px"][0]) / 8
    if "truth" in change:
        truth.hit_px[0, column] = change["truth"]
        oracle.hit_px[0, column] = change["truth"]
    if "shown" in change:
        shown[0, column, 0] = change["shown"]
    assert blame(frame, truth, oracle=oracle).charge[0, column] == charge


def test_nothing_is_blamed_where_the_picture_is_true() -> None:
    """Only pixels whose colours agree: shares are 0, not 0/0, and stay so for one pixel."""
    frame, truth, oracle = hand_frame()
    truth.truth[0, [1, 2, 3, 4, 5, 7]] = TruthClass.NO_RAY
    blamed = blame(frame, truth, oracle=oracle)
    assert blamed.totals.shares == dict.fromkeys(PARTS, 0.0)
    assert blamed.totals.mean_square == 0.0
    assert (blamed.totals.rays, blamed.totals.only_method) == (2, 6)


def test_no_ray_at_all() -> None:
    frame, truth, oracle = hand_frame()
    truth.truth[:] = TruthClass.NO_RAY
    totals = blame(frame, truth, oracle=oracle).totals
    assert (totals.rays, totals.only_method) == (0, 8)
    assert np.isnan(totals.mean_square)
    assert totals.to_json()["mean_square"] is None
    assert totals.shares == dict.fromkeys(PARTS, 0.0)


def test_a_share_below_zero_cancels_another() -> None:
    """Parts 3 and −1 of an error 2: shares 3/2 and −1/2; a part at right angles has none."""
    one = np.ones((1, 1, 3))
    other = np.array([[[1.0, -1.0, 0.0]]])
    found = shares({"a": 3.0 * one, "b": -one, "c": other}, 2.0 * one)
    assert found == {"a": 1.5, "b": -0.5, "c": 0.0}


@pytest.mark.parametrize("where", ["truth", "texel", "place", "shown"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_pixel_that_is_not_finite_is_counted_and_left_out(where: str, value: float) -> None:
    """Pixel 0 breaks; all others keep their bytes."""
    frame, truth, oracle = hand_frame()
    before = blame(frame, truth, oracle=oracle)
    if where == "truth":
        truth.radiance[0, 0, 1] = value
    elif where == "texel":
        frame.gbuffer.radiance[0, 4, 2] = value  # of pixels 0 and 4
    elif where == "place":
        frame.hits.hit_px[0, 0, 1] = value
    else:
        frame.resolved.reflection[0, 0, 0] = value
    after = blame(frame, truth, oracle=oracle)
    broken = [0, 4] if where == "texel" else [0]
    assert after.totals.non_finite == len(broken)
    assert after.totals.counted == 8 - len(broken)
    for name, image in before.arrays().items():
        kept = np.delete(image, broken, axis=1)
        assert same_bytes(kept, np.delete(after.arrays()[name], broken, axis=1)), name
        assert name == "rays" or not after.arrays()[name][0, broken].any()
    assert np.isfinite(list(after.totals.shares.values())).all()


def test_a_mirror_that_shows_only_what_is_behind_the_eye() -> None:
    """A mirror square to the view, a wall of radiance (1/4, 1/2, 1) behind the eye: the screen has
    none of it. K − T = −T in every pixel and nothing else; with F equal to it nothing is wrong.
    """
    glow = Material("glow", (0.25, 0.5, 1.0), unlit=True)
    mirror = Material("mirror", (0.9, 0.9, 0.9), metallic=1.0, roughness=0.0)
    scene = AnalyticScene(
        (Plane((0, 0, -4), (0, 0, 1), 0), Plane((0, 0, 1), (0, 0, -1), 1)),
        (mirror, glow),
        view=View((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), near=2.0**-6),
    )
    frame = render(scene)
    truth = closed_form_truth(frame)
    assert (truth.truth == TruthClass.OFF_SCREEN).all()
    blamed = blame(frame, truth)
    assert (blamed.information == [-0.25, -0.5, -1.0]).all()
    assert not (blamed.depth_model.any() or blamed.traversal.any() or blamed.shading.any())
    assert blamed.totals.shares == {"information": 1.0} | dict.fromkeys(PARTS[1:], 0.0)
    assert blamed.totals.charged["INFORMATION"] == 37 * 23
    assert blamed.totals.mean_square == (1 / 16 + 1 / 4 + 1) / 3

    glowing = render(scene, fallback="constant", fallback_color=(0.25, 0.5, 1.0))
    blamed = blame(glowing, truth)
    assert not blamed.error.any()
    assert blamed.totals.shares == dict.fromkeys(PARTS, 0.0)
    # Still a wrong hit: the truth has one.
    assert blamed.totals.charged["INFORMATION"] == 37 * 23

    # F given as an image, as for an environment map.
    image = np.broadcast_to(np.array([0.25, 0.5, 1.0]), (23, 37, 3))
    given = blame(replace(frame, resolved=glowing.resolved), truth, fallback=image)
    assert not given.error.any()


def test_a_thick_marker_is_the_depth_models_fault() -> None:
    """A bright marker before nothing, thickness without end: rays that pass behind it hit it. The
    depth model adds the marker's colour there; a tracer that stops at once takes it away again.
    """
    scene = SCENES["marker"]()
    bright = replace(scene.materials[2], base_color=(1.0, 0.5, 0.25), unlit=True)
    materials = (*scene.materials[:2], bright, *scene.materials[3:])
    shapes = scene.shapes[0], replace(scene.shapes[1], radius=0.7)  # 2 px, and above the floor
    scene = replace(scene, shapes=shapes, materials=materials)
    frame = render(scene, tracer="cells", thickness=np.inf, edge_fade=False)
    truth = closed_form_truth(frame)
    blamed = blame(frame, truth)
    color = np.array([1.0, 0.5, 0.25])
    hit = frame.hits.status == HIT
    shadow = hit & (truth.truth == TruthClass.NOTHING)
    lost = ~hit & (truth.truth == TruthClass.VISIBLE)
    assert shadow.sum() > 3 and (truth.truth <= TruthClass.NOTHING).sum() > 800
    expected = shadow[..., None] * color - lost[..., None] * color
    assert same_bytes(blamed.depth_model + 0.0, expected + 0.0)
    assert not (blamed.information.any() or blamed.traversal.any() or blamed.shading.any())
    assert blamed.totals.shares["depth_model"] == 1.0

    stopped = render(scene, thickness=np.inf, edge_fade=False, max_steps=1)
    again = blame(stopped, truth)
    assert same_bytes(again.depth_model, blamed.depth_model)
    gone = hit & (stopped.hits.status != HIT)
    assert (again.traversal[gone] == -color).all()
    assert again.totals.charged["COMPENSATED"] == (gone & shadow).sum() > 0


# ---- Planted mistakes -------------------------------------------------------------------------


def planted(frame: Frame, truth: Any, hits: Any) -> tuple[Blame, Blame]:
    """Before and after a tracer's mistake: what must not move has kept its bytes."""
    wrong = with_hits(frame, hits)
    before, after = blame(frame, truth), blame(wrong, truth)
    assert same_bytes(before.information, after.information)
    assert same_bytes(before.depth_model, after.depth_model)
    assert not same_bytes(before.traversal, after.traversal)
    same = before.charge == after.charge
    same &= (frame.hits.status == hits.status) & (
        (frame.hits.hit_px == hits.hit_px).all(axis=2) | (hits.status != HIT)
    )
    assert same.any() and not same.all()
    assert same_bytes(before.shading[same], after.shading[same])
    assert same_bytes(before.traversal[same], after.traversal[same])
    parts_add_up(after)
    return before, after


@pytest.mark.parametrize("mistake", [{"stride": 12}, {"thickness": 0.0}, {"bias": 0.05}])
def test_a_mistake_of_the_tracer_moves_the_traversal(mistake: dict[str, Any]) -> None:
    """A doubled stride, a dropped thickness, a bias: in the tracer, not in what is asked for."""
    frame = render(SCENES["clutter"](), stride=6, refine="none", thickness=0.2,
                   thickness_from="constant")  # fmt: skip
    view = frame.camera.params(frame.settings.size)
    hits = trace(view, frame.gbuffer, replace(frame.settings, **mistake))
    before, after = planted(frame, closed_form_truth(frame), hits)
    assert after.totals.charged["TRAVERSAL"] > before.totals.charged["TRAVERSAL"]


def test_a_wrong_sign_in_reflect_leaves_the_oracle_alone() -> None:
    """A copy of the package whose reflect adds instead of subtracts y: its tracer errs, its oracle
    gives every byte of ours.
    """
    frame = render(SCENES["clutter"](), size=(19, 11), thickness=np.inf)
    view = frame.camera.params(frame.settings.size)
    truth = closed_form_truth(frame)
    edit = "incident.y - k * normal.y", "incident.y + k * normal.y"
    with mutant("vecmath.vec", *edit) as package:
        assert package.__name__ == "ssr_ref"
        from ssr_ref.blame.oracle import trace_oracle as their_oracle
        from ssr_ref.ssr.trace import trace as their_trace

        hits = their_trace(view, frame.gbuffer, frame.settings)
        oracle = their_oracle(view, frame.gbuffer, frame.settings)
    same_hits(trace_oracle(view, frame.gbuffer, frame.settings), oracle)
    before, after = planted(frame, truth, hits)
    assert after.totals.mean_square > before.totals.mean_square


# ---- Arguments --------------------------------------------------------------------------------


def test_what_cannot_be_blamed() -> None:
    frame, _, oracle = hand_frame()
    with pytest.raises(SsrRefError, match=r"the truth is 3x2; expected the frame's 9x1"):
        blame(frame, truth_of(np.zeros((2, 3))), oracle=oracle)


def test_the_total_of_any_method() -> None:
    """By hand: errors −2 and 1/2 of truths 3 and 0 in one channel; relMSE (4/9.01 + 25)/6."""
    truth = truth_of([[TruthClass.VISIBLE, TruthClass.NOTHING, TruthClass.NO_RAY,
                       TruthClass.VISIBLE]],
                     radiance=row([[3, 0, 0], [7, 7, 7], [0, 0, 0], [np.inf, 0, 0]]))  # fmt: skip
    shown = row([[1, 0, 0], [0.5, 0, 0], [9, 9, 9], [1, 1, 1]]).astype(np.float32)
    found = total_error(truth, shown, np.zeros(3))
    assert found.error.tolist() == [[[-2, 0, 0], [0.5, 0, 0], [0, 0, 0], [0, 0, 0]]]
    assert found.counted.tolist() == [[True, True, False, False]]
    assert found.non_finite == 1
    assert found.mean_square == pytest.approx((4 + 0.25) / 6)
    assert found.rel_mse == pytest.approx((4 / 9.01 + 0.25 / 0.01) / 6)
    assert found.to_json()["counted"] == 2

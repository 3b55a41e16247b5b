"""Planes per pixel against closed-form reflections: self-hits, contact, sub-pixel hits, blocked."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ssr_ref import Settings, Status
from ssr_ref.analytic import (
    analytic_gbuffer,
    analytic_reflections,
    contact_gaps,
    hit_errors,
)
from ssr_ref.analytic.scenes import SCENES
from ssr_ref.pipeline import make_camera
from ssr_ref.ssr.trace import trace

SIZE = (161, 91)
METHODS: dict[str, dict[str, Any]] = {
    "cells": {"tracer": "cells"},
    "dda": {},
    "stride 4": {"stride": 4},
    "jittered": {"stride": 3, "jitter": True, "seed": 5},
}


def measured(name: str, orthographic: bool, **method: Any) -> tuple[Any, ...]:
    """Hits, truth, G-buffer of a named scene; sheets are half-spaces."""
    scene = SCENES[name](orthographic=orthographic)
    settings = Settings(
        size=SIZE,
        thickness=np.inf,
        max_distance=np.inf,
        buffer_dtype="float64",
        **({"surface": "plane"} | method),
    ).resolved(scene.radius())
    camera = make_camera(scene, None, settings, scene.radius())
    gbuffer = analytic_gbuffer(scene, camera, SIZE)
    truth = analytic_reflections(scene, camera, SIZE, gbuffer)
    return trace(camera.params(SIZE), gbuffer, settings), truth, gbuffer


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("name", ["sphere_on_plane", "box_on_plane", "corner", "clutter"])
def test_no_self_hit_and_no_gap_at_contact(name: str, orthographic: bool) -> None:
    for label, method in METHODS.items():
        hits, truth, gbuffer = measured(name, orthographic, **method)
        errors = hit_errors(hits, truth, gbuffer)
        assert errors.rays > 1000
        assert errors.self_hits == 0, label
        if name != "clutter":
            shape = 2 if name == "corner" else 1
            stride = method.get("stride", 1)
            gaps = contact_gaps(hits, truth, gbuffer, floor=0, shape=shape, stride=stride)
            assert gaps.max(initial=0) <= 1, label


@pytest.mark.parametrize("name", ["box_on_plane", "corner", "clutter"])
def test_hits_are_sub_pixel_where_faces_are_flat(name: str) -> None:
    """p95 is at most 0.06 px at this small size; constant depth is many times off."""
    plane = hit_errors(*measured(name, False, tracer="cells"))
    constant = hit_errors(*measured(name, False, tracer="cells", surface="constant"))
    assert plane.visible > 500
    assert plane.p95 <= 0.06
    assert constant.p95 > 0.3
    assert plane.wrong < constant.wrong


def test_a_ray_that_enters_through_a_hidden_face_is_blocked() -> None:
    """Under a floating box the floor's rays meet its bottom, which the camera does not see."""
    hits, _, _ = measured("box_over_plane", False, tracer="cells")
    blocked = hits.status == Status.BLOCKED
    assert blocked.sum() > 50
    assert np.isnan(hits.hit_px[blocked]).all()
    assert (hits.end[blocked] == 0).all()
    # Without back faces nobody can know: the ray goes on.
    open_hits, _, _ = measured("box_over_plane", False, tracer="cells", thickness_from="constant")
    assert not (open_hits.status == Status.BLOCKED).any()

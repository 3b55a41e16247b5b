"""One ray shown: the recorded walk is the traced one, row by row."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest

import ssr_ref
from ssr_ref import Flag, Settings, SsrRefError, Status
from ssr_ref.ssr.explain import trace_pixel
from ssr_ref.ssr.record import Verdict

SIZE = (37, 23)
CASES: list[dict[str, Any]] = [
    {},
    {"tracer": "cells"},
    {"stride": 4, "jitter": True, "seed": 2},
    {"stride": 3, "refine": "none", "facing_test": True},
    {"surface": "plane"},
    {"surface": "plane", "tracer": "cells"},
    {"surface": "plane", "stride": 4},
]
FLAG_OF = {
    Verdict.EMPTY: Flag.OVER_EMPTY,
    Verdict.BEHIND: Flag.PASSED_BEHIND,
    Verdict.SELF_REJECTED: Flag.SELF_REJECTED,
    Verdict.BACK_FACE_REJECTED: Flag.BACK_FACE_REJECTED,
}


@pytest.mark.slow
@pytest.mark.parametrize("options", CASES)
def test_every_ray_of_an_image(options: dict[str, Any]) -> None:
    """Outcome, steps, reads and flags are those of the trace; rows follow one another."""
    frame = ssr_ref.render(
        ssr_ref.load("teapot", tessellation=3), settings=Settings(size=SIZE, **options)
    )
    view, hits = frame.camera.params(SIZE), frame.hits
    seen: Counter[Verdict] = Counter()
    for y in range(0, SIZE[1], 2):
        for x in range(SIZE[0]):
            walk = trace_pixel(view, frame.gbuffer, frame.settings, x, y)
            at = (y, x)
            assert walk.status == hits.status[at] and walk.end == hits.end[at]
            assert walk.flags == hits.flags[at]
            assert (walk.steps, walk.fetches) == (hits.steps[at], hits.fetches[at])
            assert np.array_equal(walk.hit_px, hits.hit_px[at], equal_nan=True)
            assert np.array_equal(walk.hit_depth, hits.hit_depth[at], equal_nan=True)

            level = walk.rows[:, 0]
            samples = [v for v, top in zip(walk.verdicts, level == 0) if top]
            assert len(samples) == walk.steps
            starts, ends = walk.rows[level == 0, 4], walk.rows[level == 0, 5]
            assert (starts <= ends).all() and (np.diff(ends) >= 0).all()
            hit = walk.status == Status.HIT
            assert (Verdict.HIT in walk.verdicts) == hit
            if hit:
                assert walk.verdicts[-1] == Verdict.HIT
                px = walk.rows[-1, 2:4] + 0.5
                assert np.abs(px - walk.hit_px).max() < 4.5
            assert (Verdict.BLOCKED in walk.verdicts) == (walk.status == Status.BLOCKED)
            for verdict, flag in FLAG_OF.items():
                # A sample that proposed a re-walk says so instead of what it met.
                assert verdict not in samples or flag in walk.flags
            seen.update(walk.verdicts)
    assert seen[Verdict.HIT] > 50 and seen[Verdict.IN_FRONT] > 500
    if options.get("stride") and options.get("refine") != "none":
        assert seen[Verdict.PROPOSED] > 50
    if options.get("surface") == "plane":
        assert seen[Verdict.BLOCKED] > 0


def test_what_cannot_be_shown() -> None:
    frame = ssr_ref.render(ssr_ref.load("teapot", tessellation=1), settings=Settings(size=(9, 7)))
    view = frame.camera.params((9, 7))
    for x, y in ((9, 0), (0, -1)):
        with pytest.raises(SsrRefError, match="outside the image"):
            trace_pixel(view, frame.gbuffer, frame.settings, x, y)

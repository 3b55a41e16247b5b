"""One ray shown: the recorded walk is the traced one, row by row."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tracing import pixel_rays

import ssr_ref
from ssr_ref import Flag, Settings, SsrRefError, Status
from ssr_ref.ssr.explain import PixelWalk, trace_pixel
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
    {"stride": 5, "refine": "bisect"},
    {"tracer": "march", "growth": "constant", "step": 0.0625},
    {"tracer": "march", "refine": "secant", "jitter": True},
]
FLAG_OF = {
    Verdict.EMPTY: Flag.OVER_EMPTY,
    Verdict.BEHIND: Flag.PASSED_BEHIND,
    Verdict.SELF_REJECTED: Flag.SELF_REJECTED,
    Verdict.BACK_FACE_REJECTED: Flag.BACK_FACE_REJECTED,
}


def read_count(frame: ssr_ref.pipeline.Frame, walk: PixelWalk) -> int:
    """Reads by the rows: one of an empty pixel, else one of the front and one of the back."""
    g, (x, y) = frame.gbuffer, walk.rows[:, 2:4].astype(int).T
    assert g.geo_normal_vs is not None
    d = rays(frame)[y, x]
    empty = ~np.isfinite(g.depth[y, x]) | ((g.geo_normal_vs[y, x] * d).sum(axis=1) >= 0.0)
    return int(np.where(empty, 1, 1 if g.back_depth is None else 2).sum())


def rays(frame: ssr_ref.pipeline.Frame) -> np.ndarray:
    """(H, W, 3) directions through the pixels' centres."""
    return pixel_rays(frame.camera.params(frame.settings.size))


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
            assert read_count(frame, walk) == walk.fetches
            starts, ends = walk.rows[level == 0, 4], walk.rows[level == 0, 5]
            assert (starts <= ends).all() and (np.diff(ends) >= 0).all()
            hit = walk.status == Status.HIT
            assert (Verdict.HIT in walk.verdicts) == hit
            if hit:
                refined = frame.settings.refinement in ("bisect", "secant")
                assert walk.verdicts[-1] == Verdict.HIT or refined
                px = walk.rows[-1, 2:4] + 0.5
                assert np.abs(px - walk.hit_px).max() <= 7.5  # an interval of 7 px, half a pixel
            assert (Verdict.BLOCKED in walk.verdicts) == (walk.status == Status.BLOCKED)
            for verdict, flag in FLAG_OF.items():
                # A sample that proposed a re-walk says so instead of what it met.
                assert verdict not in samples or flag in walk.flags
            seen.update(walk.verdicts)
    assert seen[Verdict.HIT] > 50 and seen[Verdict.IN_FRONT] > 500
    if options.get("stride") and "refine" not in options:
        assert seen[Verdict.PROPOSED] > 50
    if options.get("surface") == "plane":
        assert seen[Verdict.BLOCKED] > 0


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"tracer": "cells", "thickness_from": "constant"},
        {"stride": 4, "jitter": True},
        {"stride": 5, "refine": "bisect"},
        pytest.param({"surface": "plane", "tracer": "cells"}, marks=pytest.mark.slow),
        pytest.param({"surface": "plane", "stride": 3}, marks=pytest.mark.slow),
        {"tracer": "march", "step": 0.125},
        {"tracer": "march", "step": 0.125, "growth": "constant", "refine": "secant"},
    ],
)
def test_counts_are_those_of_every_walk_and_add_up_to_the_reads(options: dict[str, Any]) -> None:
    """Image counts, rows of single walks and fetches say the same of every pixel."""
    size = (19, 13)
    scene = ssr_ref.load("teapot", tessellation=3)
    frame = ssr_ref.render(scene, settings=Settings(size=size, sample_counts=True, **options))
    view, counts = frame.camera.params(size), frame.hits.sample_count
    assert counts is not None and counts.dtype == np.uint32
    expected = np.zeros_like(counts)
    refinements = 0
    for y in range(size[1]):
        for x in range(size[0]):
            walk = trace_pixel(view, frame.gbuffer, frame.settings, x, y)
            assert read_count(frame, walk) == walk.fetches == frame.hits.fetches[y, x], (x, y)
            assert np.array_equal(walk.length, frame.hits.length[y, x], equal_nan=True)
            expected += walk.counts(counts.shape)
            refinements += int(walk.rows[:, 0].sum())
    assert np.array_equal(counts, expected) and counts.sum() > 300
    assert (refinements > 0) == (frame.settings.refinement != "none")

    # A trace without it has no counts and the same bytes.
    plain = ssr_ref.render(scene, settings=Settings(size=size, **options))
    assert plain.hits.sample_count is None
    for name, image in plain.hits.arrays().items():
        assert image.tobytes() == frame.hits.arrays()[name].tobytes(), name


def test_what_cannot_be_shown() -> None:
    frame = ssr_ref.render(ssr_ref.load("teapot", tessellation=1), settings=Settings(size=(9, 7)))
    view = frame.camera.params((9, 7))
    listing = replace(frame.settings, listing=True, tracer="march", max_steps=9)
    with pytest.raises(SsrRefError, match="has no log"):
        trace_pixel(view, frame.gbuffer, listing, 1, 1)
    with pytest.raises(SsrRefError, match="has no log"):
        replace(listing, sample_counts=True)
    for x, y in ((9, 0), (0, -1)):
        with pytest.raises(SsrRefError, match="outside the image"):
            trace_pixel(view, frame.gbuffer, frame.settings, x, y)

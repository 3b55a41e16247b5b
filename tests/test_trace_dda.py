"""The tracers against a second implementation, written in plain Python from spec 4 and 5 alone.

Noise buffers make every branch common: holes, targets that face away, rays that pass behind, own
planes, backs in front of and behind the ray, all four sides of the image.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from oracles.dda import Outcome, inputs_of, trace_pixel
from tracing import PROJECTIONS, draw, noise_buffers, resolved, view_of

from ssr_ref.buffers import End, Flag, GBuffer, Status
from ssr_ref.camera import ViewParams
from ssr_ref.scenes import build
from ssr_ref.settings import Settings
from ssr_ref.ssr.trace import trace

SIZE = (37, 23)
COUNTS = ("status", "end", "flags", "steps", "fetches")


def agree(view: ViewParams, gbuffer: GBuffer, settings: Settings) -> Counter[str]:
    """Every pixel equals the oracle's; how often each status, end and flag occurred.

    Counts are equal. Positions and depths agree to 1e-9 px and 1e-12 relative: both sides round
    some ten operations of float64, in different orders, on coordinates below 100.
    """
    hits = trace(view, gbuffer, settings)
    inputs = inputs_of(view, gbuffer, settings)
    seen: Counter[str] = Counter()
    for y in range(view.height):
        for x in range(view.width):
            want = trace_pixel(inputs, x, y)
            got = tuple(int(getattr(hits, name)[y, x]) for name in COUNTS)
            assert got == tuple(int(v) for v in want[:5]), ((x, y), COUNTS, got, want)
            seen[want.status.name] += 1
            seen[f"end {End(want.end).name}"] += 1
            seen.update(flag.name for flag in Flag if want.flags & flag)
            if want.status == Status.HIT:
                check_hit(hits, want, x, y)
            else:
                assert np.isnan(hits.hit_px[y, x]).all() and np.isnan(hits.hit_depth[y, x])
                assert np.isnan(hits.residual[y, x]) and np.isnan(hits.length[y, x])
    return seen


def check_hit(hits: Any, want: Outcome, x: int, y: int) -> None:
    """Position, depth and residual of one hit; hit_px lies in the pixel it was tested against."""
    assert want.hit is not None and want.pixel is not None
    assert np.abs(hits.hit_px[y, x] - want.hit).max() < 1e-9, ((x, y), hits.hit_px[y, x], want)
    assert abs(hits.hit_depth[y, x] / want.depth - 1.0) < 1e-12
    assert abs(hits.residual[y, x] - want.residual) < 1e-12 * want.depth
    assert np.isfinite(hits.length[y, x]) and hits.length[y, x] > 0.0


CONSTANT = {"thickness_from": "constant"}
CASES: list[tuple[int, dict[str, Any]]] = [
    *((stride, {}) for stride in (1, 2, 3, 4, 7, 16, 64)),
    *((stride, {"jitter": True, "seed": 5, "bias": 0.03, **CONSTANT}) for stride in (1, 2, 7, 64)),
    *((stride, {"refine": "none", "interval": "cell", "max_steps": 5}) for stride in (1, 3, 64)),
    *((stride, {"refine": "none", "jitter": True, "seed": 9}) for stride in (2, 4, 16)),
    (1, {"refine": "rewalk", "max_distance": 1.5}),
    (3, {"refine": "rewalk", "max_distance": 0.4, "interval": "cell"}),
    (4, {"max_steps": 2, "max_distance": 3.0, "bias": 0.2}),
    (1, {"interval": "cell", "self_rejection": "none", **CONSTANT}),
    (2, {"interval": "cell", "self_rejection": "none", "jitter": True, "seed": 2**32 - 1}),
    (1, {"thickness": np.inf, **CONSTANT}),
    (1, {"thickness": 0.0, **CONSTANT}),
    (1, {"max_steps": 1}),
    (1, {"tracer": "cells"}),
    (1, {"tracer": "cells", "max_steps": 4, "max_distance": 2.0, "bias": 0.05}),
    (1, {"tracer": "cells", "thickness": np.inf, "self_rejection": "none", **CONSTANT}),
]


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_noise_buffers(projection: str) -> None:
    """Each case of `CASES` on its own random buffers."""
    view = view_of(projection, SIZE)
    seen: Counter[str] = Counter()
    for number, (stride, kw) in enumerate(CASES):
        gbuffer = noise_buffers(view, number)
        seen += agree(view, gbuffer, resolved(SIZE, stride=stride, **kw))
    # The comparison is worth something: everything that can occur did (no back face and no
    # blocking in this hit rule; a ray can only turn back to the eye if the camera sees it).
    never = {"NOT_COMPUTED", "BLOCKED", "BACK_FACE", "BACK_FACE_REJECTED"}
    names = {s.name for s in Status} | {f"end {e.name}" for e in End} | {f.name for f in Flag}
    rare = {"BEHIND_CAMERA", "end BEHIND_CAMERA"}
    assert {name for name in names if seen[name] == 0} - rare == never
    assert seen["HIT"] > 4000 and seen["SELF"] >= 5 and seen["OUT_OF_STEPS"] > 500


@pytest.mark.parametrize("name", ["teapot", "poles"])
@pytest.mark.parametrize("orthographic", [False, True])
def test_built_in_scenes(name: str, orthographic: bool) -> None:
    """Real buffers, all features of them: contact, thin posts, smooth normals."""
    scene = build(name, 4)
    assert scene.view is not None
    size = (64, 37)
    view = scene.view
    if orthographic:
        view = replace(view, fov_y_degrees=None, orthographic_height=2.4)
    params = view.camera(size, 2.0**-8).params(size)
    gbuffer = draw(params, scene)
    cases: list[dict[str, Any]] = [
        {"stride": 1},
        {"stride": 4, "jitter": True, "seed": 3, "max_distance": 2.0},
        {"stride": 3, "refine": "none", "interval": "cell", **CONSTANT},
        {"stride": 16, "max_steps": 2},
        {"tracer": "cells"},
    ]
    hits = 0
    for kw in cases:
        hits += agree(params, gbuffer, resolved(size, **({"thickness": 2.0**-4} | kw)))["HIT"]
    assert hits > 500


@pytest.mark.slow
def test_float64_buffers() -> None:
    """Slow: compiles `trace_rows` anew. u = 2⁻⁵³ in 4.5, and depths that no float32 holds."""
    view = view_of("perspective", SIZE)
    for stride, kw in ((1, {}), (4, {"jitter": True}), (1, {"tracer": "cells"})):
        gbuffer = noise_buffers(view, 100 + stride, np.float64)
        assert agree(view, gbuffer, resolved(SIZE, stride=stride, **kw))["HIT"] > 50


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (2, 3), (5, 1)])
@pytest.mark.parametrize("projection", PROJECTIONS)
def test_tiny_images(size: tuple[int, int], projection: str) -> None:
    """Sizes at which every loop bound is an edge case."""
    view = view_of(projection, size)
    for seed, stride in enumerate((1, 1, 2, 16)):
        kw = {"tracer": "cells"} if seed == 0 else {}
        agree(view, noise_buffers(view, seed), resolved(size, stride=stride, **kw))

"""Invariants of whole renders on tiny images: quick enough to run interpreted and bounds-checked.

`.ci/run` runs this file with NUMBA_DISABLE_JIT=1 (true coverage, and Python raises where compiled
code would read stray memory) and with NUMBA_BOUNDSCHECK=1.
"""

from __future__ import annotations

import numpy as np
import pytest

import ssr_ref
from ssr_ref import End, Flag, Settings, Status

SIZES = [(9, 7), (1, 1), (1, 9), (9, 1)]
VARIANTS = [
    {},
    {"tracer": "cells"},
    {"tracer": "cells", "thickness_from": "constant", "thickness": 0.0},
    {"stride": 3, "jitter": True, "seed": 3},
    {"stride": 64, "refine": "none"},
    {"interval": "cell", "bias": 0.01},
    {"thickness_from": "constant", "thickness": np.inf, "max_distance": np.inf},
    {"self_rejection": "none", "max_steps": 2},
    {"self_rejection": "slope_bias", "geo_normals": "fitted", "thickness_from": "slope"},
    {"surface": "plane", "geo_normals": "fitted", "thickness_from": "relative", "stride": 2},
    {"fresnel": True, "distance_fade": "linear", "fallback": "constant",
     "fallback_color": (0.1, 0.2, 0.3)},
    {"buffer_dtype": "float64", "snap": "gpu_vertices", "back_any_object": True},
]  # fmt: skip
VIEWS = {
    "own": None,
    "orthographic": ssr_ref.View((1.0, 1.5, 3.0), (0.0, 0.3, 0.0), orthographic_height=3.0),
    "close": ssr_ref.View(
        (0.0, 0.15, 1.2), (0.0, 0.1, 0.0), fov_y_degrees=120.0, jitter=(0.3, -0.4)
    ),
    "away": ssr_ref.View((0.0, 50.0, 0.0), (0.0, 60.0, 1.0)),
}


@pytest.fixture(scope="module")
def scene() -> ssr_ref.Scene:
    return ssr_ref.load("teapot", tessellation=1)


def check(frame: ssr_ref.Frame) -> None:
    """What holds for every frame."""
    g, h, r, s = frame.gbuffer, frame.hits, frame.resolved, frame.settings
    status = h.status
    width, height = s.size
    assert status.shape == (height, width)
    assert set(np.unique(status)) <= {int(v) for v in Status}
    assert not (status == Status.NOT_COMPUTED).any()

    # The G-buffer: all finite where drawn, empty elsewhere.
    seen = g.triangle_id >= 0
    assert np.array_equal(seen, np.isfinite(g.depth))
    assert (g.depth > 0).all()
    assert np.array_equal(status == Status.BACKGROUND, ~seen)
    for image in (g.geo_normal_vs, g.normal_vs, g.albedo, g.reflectivity, g.radiance):
        assert image is not None
        assert np.isfinite(image).all()
        assert (image[~seen] == 0).all()
    squared = (g.geo_normal_vs.astype(np.float64)[seen] ** 2).sum(axis=-1)
    assert np.abs(squared - 1.0).max(initial=0.0) < 1e-6
    if g.back_depth is not None:
        assert (g.back_depth >= g.depth).all()

    # Hits: numbers where there is one, NaN elsewhere, inside the image, within the slab.
    hit = status == Status.HIT
    for image in (h.hit_depth, h.residual, h.length):
        assert np.array_equal(np.isfinite(image), hit)
    assert np.array_equal(np.isfinite(h.hit_px).all(axis=-1), hit)
    assert (h.hit_px[hit] >= 0).all() and (h.hit_px[hit] <= (width, height)).all()
    assert (h.residual[hit] >= s.bias * (1 - 1e-12)).all()
    if s.thickness_from == "constant":
        assert (h.residual[hit] <= s.thickness).all()
    assert (h.length[hit] <= s.max_distance * (1 + 1e-9)).all()

    # Ends and flags say why there is none.
    walked = h.steps > 0
    assert ((h.end == End.NONE) | ~hit).all()
    ended = h.end > 0
    plain = ended & ~np.isin(status, (Status.PASSED_BEHIND, Status.SELF))
    assert np.array_equal(status[plain], h.end[plain] + (Status.LEFT_SCREEN_L - 1))
    assert ((h.flags & Flag.OPEN) == 0)[~hit].all()
    assert (h.fetches >= h.steps).all()
    assert (walked | ~hit).all()
    if s.max_steps is not None:
        assert (h.steps <= s.max_steps).all()

    # Colours.
    for image in (r.edge_fade, r.distance_fade, r.confidence):
        assert ((image >= 0) & (image <= 1)).all()
        assert (image[~hit] == 0).all()
    assert np.isfinite(r.reflection).all() and np.isfinite(r.composite).all()
    dull = np.isin(status, (Status.BACKGROUND, Status.NOT_REFLECTIVE))
    assert np.array_equal(r.composite[dull], g.radiance[dull])


@pytest.mark.parametrize("settings", VARIANTS, ids=str)
def test_variants(scene: ssr_ref.Scene, settings: dict) -> None:
    check(ssr_ref.render(scene, settings=Settings(size=(9, 7), **settings)))


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("view", VIEWS)
def test_sizes_and_views(scene: ssr_ref.Scene, size: tuple[int, int], view: str) -> None:
    frame = ssr_ref.render(scene, VIEWS[view], Settings(size=size, jitter=True))
    check(frame)
    assert ("empty" in " ".join(frame.warnings)) == (view == "away" or not frame_seen(frame))


def frame_seen(frame: ssr_ref.Frame) -> bool:
    return bool((frame.gbuffer.triangle_id >= 0).any())


def test_the_caller_s_arrays_stay_as_they_are() -> None:
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    faces = np.array([[0, 1, 2]])
    matrix = np.eye(4)
    copies = [a.copy() for a in (positions, faces, matrix)]
    scene = ssr_ref.Scene(
        (ssr_ref.Mesh("m", (ssr_ref.Primitive(positions, faces),)),),
        (ssr_ref.Node("n", 0, matrix),),
    )
    ssr_ref.render(scene, settings=Settings(size=(9, 7)))
    for before, after in zip(copies, (positions, faces, matrix)):
        assert np.array_equal(before, after)
    positions[0] = 7.0  # and the scene does not follow the caller's later changes
    assert scene.meshes[0].primitives[0].positions[0, 0] == 0.0


@pytest.mark.parametrize(
    "bad",
    [{"size": (0, 5)}, {"size": (5, 16385)}, {"size": (2.5, 3)}, {"stride": 0}, {"stride": 1.5},
     {"bias": -1.0}, {"bias": np.nan}, {"thickness": -0.1}, {"max_distance": 0.0}, {"seed": -1},
     {"tracer": "hiz"}, {"jitter": 1}, {"edge_power": 0.0}, {"max_steps": 0}, {"step": -1.0},
     {"fallback_color": (0.0, -1.0, 0.0)}, {"interval": "nearest"}],
    ids=str,
)  # fmt: skip
def test_settings_out_of_range_are_one_line(bad: dict) -> None:
    with pytest.raises(ssr_ref.SsrRefError) as caught:
        Settings(**bad)
    message = str(caught.value)
    assert "\n" not in message
    assert next(iter(bad)) in message
    assert "expected" in message


def test_settings_survive_json() -> None:
    import json

    made = Settings(size=(5, 4), max_distance=np.inf, fallback_color=(0.1, 0.2, 0.3), stride=7)
    assert Settings.from_json(json.loads(json.dumps(made.to_json()))) == made
    with pytest.raises(ssr_ref.SsrRefError, match="unknown setting 'strid'"):
        Settings.from_json({"strid": 3})

"""Slope bias, the solid's end behind planes, and the study's own walk in NumPy."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_fit_planes import plane_depth
from tracing import buffers, noise_buffers, resolved, view_of

from benchmarks.hit_rules import PLANES, RULES, gaps_of, settings_of
from benchmarks.hit_scenes import Case, grazing, lone_bodies, make_case
from benchmarks.plane_walk import walk_planes
from ssr_ref import Settings, Status
from ssr_ref.analytic import hit_errors
from ssr_ref.analytic.scenes import SCENES
from ssr_ref.errors import SettingsError
from ssr_ref.ssr.trace import prepare, trace

pytestmark = pytest.mark.slow  # compiles much

SIZE = (101, 67)
MODELS = ("constant", "back_faces", "relative", "slope", "material")


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("model", MODELS)
def test_planes_and_slabs_end_at_the_same_depth(model: str, projection: str) -> None:
    """Nearness of the one is the other's, for every model; by hand for one pixel of each."""
    view = view_of(projection)
    g = noise_buffers(view, 3)
    rng = np.random.default_rng(6)
    g = replace(g, thickness=rng.uniform(0.1, 0.4, g.depth.shape).astype(np.float32))
    settings = resolved((view.width, view.height), thickness_from=model)
    slabs = prepare(view, g, settings).fixed[-1]
    planes = prepare(view, g, replace(settings, surface="plane")).fixed[-1]
    good = slabs[..., 0] < np.inf
    assert good.sum() > 300
    ends = 1.0 / slabs[..., 1] if view.perspective else -slabs[..., 1]
    assert planes[good, 3].tobytes() == ends[good].tobytes()
    assert (planes[~good, 0] == -np.inf).all()

    y, x = np.argwhere(good & (np.isinf(g.back_depth)))[7]  # type: ignore[arg-type]
    z = float(g.depth[y, x])
    span = float((abs(planes[y, x, 1]) + abs(planes[y, x, 2])) * (z * z if view.perspective else 1))
    assert g.thickness is not None
    expected = {
        "constant": z + 0.2, "back_faces": z + 0.2, "relative": z * 1.2, "slope": z + 0.2 + span,
        "material": z + float(g.thickness[y, x]),
    }[model]  # fmt: skip
    assert slabs[y, x, 1] == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_slope_bias_is_the_depth_at_the_far_corner(projection: str) -> None:
    """Orthographic: exactly. Perspective: to first order, off by less than (range/depth)²·depth."""
    view = view_of(projection)
    normal = np.array([0.48, -0.6, 0.64])
    depth = np.minimum(plane_depth(view, normal), 1e9)
    fine = plane_depth(view_of(projection, (74, 46)), normal)
    g = buffers(depth, np.broadcast_to(normal, (*depth.shape, 3)), dtype=np.float64)
    settings = resolved((37, 23), self_rejection="slope_bias", bias=0.125)
    slabs = prepare(view, g, settings).fixed[-1]
    # Centres of an image of twice the size lie a quarter of a pixel off: half way to the corners.
    quarters = np.max([fine[i::2, j::2] for i in (0, 1) for j in (0, 1)], axis=0)
    good = np.isfinite(quarters) & (slabs[..., 0] < np.inf)
    assert good.sum() > 400
    pushed, to_corner = (slabs[..., 0] - depth - 0.125)[good], 2.0 * (quarters - depth)[good]
    assert (pushed > 0.0).all()
    error = np.abs(pushed - to_corner)
    if projection == "orthographic":
        assert error.max() < 1e-12
    else:
        near = pushed < 0.1 * depth[good]
        assert near.sum() > 300
        assert (error <= 2.0 * pushed**2 / depth[good])[near].all()
    plain = prepare(view, g, replace(settings, self_rejection="none")).fixed[-1]
    assert plain[..., 1].tobytes() == slabs[..., 1].tobytes()
    assert (plain[good, 0] == depth[good] + 0.125).all()


def test_slope_bias_has_no_meaning_for_planes() -> None:
    with pytest.raises(SettingsError, match="'slope_bias' with surface 'plane'; expected 'plane'"):
        Settings(self_rejection="slope_bias", surface="plane")
    chosen = Settings(self_rejection="slope_bias", geo_normals="fitted")
    assert Settings.from_json(chosen.to_json()) == chosen
    with pytest.raises(SettingsError, match="geo_normals is 'guessed'; expected one of buffer"):
        Settings(geo_normals="guessed")  # type: ignore[arg-type]


def bodies() -> list[Case]:
    """Some lone convex mirrors, in both projections."""
    found = lone_bodies()
    some = [*found["sphere"][::2], *found["plane"][3::7], *found["box"][::4]]
    return [make_case(scene, SIZE, "exact", coarse=True) for scene in some]


def self_hits(cases: list[Case], method: dict[str, Any]) -> tuple[int, int]:
    """Hits and pixels of lone bodies."""
    hits = pixels = 0
    for case in cases:
        status = trace(case.view, case.gbuffer, settings_of(case, method)).status
        hits += int((status == Status.HIT).sum())
        pixels += int((case.gbuffer.depth < np.inf).sum())
    return hits, pixels


def test_what_slope_bias_costs() -> None:
    """Against the tangent-plane rule: the gap opens, hits move, grazing rays still hit themselves.

    The first two as in docs/hit_rules.md, main table.
    """
    case = make_case(SCENES["sphere_on_plane"](), (320, 181), "exact")
    found = {}
    for name in ("column, tangent plane", "slope bias"):
        hits = trace(case.view, case.gbuffer, settings_of(case, RULES[name]))
        found[name] = (gaps_of(hits, case, 1, {}), hit_errors(hits, case.truth, case.gbuffer))
    gaps, errors = found["column, tangent plane"]
    biased_gaps, biased = found["slope bias"]
    assert max(gaps) <= 1 < max(biased_gaps)
    assert biased.wrong > 2.0 * errors.wrong
    assert biased.p95 > 1.3 * errors.p95

    hard = [grazing(case, seed) for seed, case in enumerate(bodies())]
    hits, pixels = self_hits(hard, RULES["slope bias"])
    assert hits > 0.05 * pixels > 1000
    for name in ("column, tangent plane", "planes, exact cells", "planes, one fetch"):
        assert self_hits(hard, RULES[name])[0] == 0, name


@pytest.mark.parametrize("name", ["corner", "clutter"])
@pytest.mark.parametrize("orthographic", [False, True])
def test_the_walk_in_numpy_is_the_packages_in_float64(name: str, orthographic: bool) -> None:
    """Statuses and positions to the bit, with the tangent-plane rule and without."""
    case = make_case(SCENES[name](orthographic=orthographic), SIZE, "exact")
    for rejection in ("plane", "none"):
        method = PLANES | {"tracer": "cells", "self_rejection": rejection}
        hits = trace(case.view, case.gbuffer, settings_of(case, method))
        walked = walk_planes(case.view, case.gbuffer, np.float64, tangent=rejection == "plane")
        for status in (Status.HIT, Status.BLOCKED):
            assert np.array_equal(hits.status == status, walked.status == status)
        assert np.array_equal(hits.hit_px, walked.hit_px, equal_nan=True)
        assert (hits.status == Status.HIT).sum() > 1000


def test_float32_arithmetic_does_not_hit_itself() -> None:
    """With the tangent-plane rule; every operation is float32, also for grazing rays."""
    cases = bodies()
    for case in [*cases, *(grazing(case, seed) for seed, case in enumerate(cases))]:
        walked = walk_planes(case.view, case.gbuffer, np.float32)
        assert walked.hit_px.dtype == np.float32
        assert not (walked.status == Status.HIT).any()

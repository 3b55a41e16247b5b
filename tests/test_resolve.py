"""From hits to colour (spec 5.4, 5.5): nearest texel, product of fades, fallback, composite."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tracing import noise_buffers, resolved, view_of

from ssr_ref.buffers import GBuffer, HitBuffer, Resolved, Status
from ssr_ref.camera import ViewParams
from ssr_ref.settings import Settings
from ssr_ref.ssr.resolve import resolve

SIZE = (37, 23)
NO_RAY = (Status.BACKGROUND, Status.NOT_REFLECTIVE)


def made_up(seed: int = 0) -> tuple[ViewParams, GBuffer, HitBuffer]:
    """Random colours, and hits of every status at random places, borders and corners too."""
    rng = np.random.default_rng(seed)
    view = view_of("perspective", SIZE)
    shape = (SIZE[1], SIZE[0])
    gbuffer = replace(
        noise_buffers(view, seed),
        radiance=(3.0 * rng.random((*shape, 3))).astype(np.float32),
        reflectivity=rng.random((*shape, 3)).astype(np.float32),
    )
    status = rng.choice([0, 1, 1, 1, 2, 3, 4, 5, 8, 12, 16], shape).astype(np.uint8)
    hit = status == Status.HIT
    hit_px = rng.random((*shape, 2)) * SIZE
    hit_px[0, :4] = [(0.0, 0.0), (37.0, 23.0), (0.0, 23.0), (36.999999, 0.0)]
    hit_px[1, :3] = [(5.0, 7.0), (np.nextafter(5.0, 0), 7.0), (4.5, np.nextafter(7.0, 0))]
    status[0, :4] = status[1, :3] = Status.HIT
    hit = status == Status.HIT
    length = np.where(hit, rng.random(shape) * 3.0, np.nan)
    hits = HitBuffer(
        status=status,
        end=np.zeros(shape, np.uint8),
        flags=np.zeros(shape, np.uint8),
        hit_px=np.where(hit[..., None], hit_px, np.nan),
        hit_depth=np.full(shape, np.nan),
        residual=np.full(shape, np.nan),
        length=length,
        steps=np.zeros(shape, np.uint32),
        fetches=np.zeros(shape, np.uint32),
    )
    return view, gbuffer, hits


def run(gbuffer: GBuffer, hits: HitBuffer, **kw: Any) -> Resolved:
    """Resolve with edge fade off unless asked for."""
    settings = resolved(SIZE, **({"edge_fade": False, "max_distance": 4.0} | kw))
    return resolve(view_of("perspective", SIZE), gbuffer, hits, settings)


def with_r(gbuffer: GBuffer, value: float) -> GBuffer:
    """The same buffers with one R for all."""
    return replace(gbuffer, reflectivity=np.full_like(gbuffer.reflectivity, value))


def texels(gbuffer: GBuffer, hits: HitBuffer) -> np.ndarray:
    """Radiance at floor(hit_px), the last pixel for a coordinate on the far border."""
    assert gbuffer.radiance is not None
    px = np.nan_to_num(hits.hit_px)
    x = np.minimum(np.floor(px[..., 0]).astype(int), SIZE[0] - 1)
    y = np.minimum(np.floor(px[..., 1]).astype(int), SIZE[1] - 1)
    return gbuffer.radiance[y, x]


def test_nothing_reflected_keeps_every_bit() -> None:
    """R = 0, and pixels without a ray: composite is L, whatever the hits say."""
    _, gbuffer, hits = made_up()
    assert gbuffer.radiance is not None
    constant = {"fallback": "constant", "fallback_color": (0.5, 0.25, 0.125)}
    out = run(with_r(gbuffer, 0.0), hits, **constant)
    assert out.composite.tobytes() == gbuffer.radiance.tobytes()
    out = run(gbuffer, hits, **constant)
    without = np.isin(hits.status, NO_RAY)
    assert without.sum() > 50
    assert (out.composite[without] == gbuffer.radiance[without]).all()
    for image in (out.reflection, out.confidence, out.edge_fade, out.distance_fade):
        assert not image[without].any()


def test_full_reflection_of_a_certain_hit_is_the_texel() -> None:
    """R = 1, c = 1: composite = L_hit = texel at floor(hit_px), to the bit."""
    _, gbuffer, hits = made_up()
    out = run(with_r(gbuffer, 1.0), hits)
    hit = hits.status == Status.HIT
    assert (out.composite[hit] == texels(gbuffer, hits)[hit]).all()
    assert (out.reflection[hit] == texels(gbuffer, hits)[hit]).all()
    assert (out.confidence[hit] == 1.0).all()
    # (5, 7) lies in pixel (5, 7); an ulp to the left or above is pixel 4 or 6.
    assert gbuffer.radiance is not None
    for x, (column, row) in enumerate([(5, 7), (4, 7), (4, 6)]):
        assert (out.composite[1, x] == gbuffer.radiance[row, column]).all()


@pytest.mark.parametrize("fallback", [(0.0, 0.0, 0.0), (0.5, 0.25, 2.0)])
def test_misses_show_the_fallback(fallback: tuple[float, float, float]) -> None:
    """R = 1: a miss is F; confidence 0. Pixels that could not be traced are misses too."""
    _, gbuffer, hits = made_up()
    out = run(with_r(gbuffer, 1.0), hits, fallback="constant", fallback_color=fallback)
    missed = ~np.isin(hits.status, (*NO_RAY, Status.HIT))
    assert missed.sum() > 100
    assert (out.composite[missed] == np.float32(fallback)).all()
    assert not out.confidence[missed].any()
    none = run(with_r(gbuffer, 1.0), hits, fallback="none", fallback_color=(9.0, 9.0, 9.0))
    assert not none.composite[missed].any()


@pytest.mark.parametrize("power", [2.0, 3.0, 2.5])
@pytest.mark.parametrize("distance", ["none", "published", "linear"])
def test_confidence_is_the_product_and_mixes_hit_and_fallback(power: float, distance: str) -> None:
    """Every pixel against the formulas of spec 5.4 and 5.5 in NumPy; float32 rounds once."""
    _, gbuffer, hits = made_up(3)
    f = (0.5, 0.25, 2.0)
    kw = {"edge_fade": True, "edge_power": power, "distance_fade": distance}
    out = run(gbuffer, hits, fallback="constant", fallback_color=f, **kw)
    hit = hits.status == Status.HIT
    uv = np.nan_to_num(hits.hit_px) / SIZE
    edge = np.clip(1.0 - (2.0 * np.abs(uv - 0.5)) ** power, 0.0, 1.0).prod(axis=2) * hit
    share = np.nan_to_num(hits.length) / 4.0
    fade = {"none": 1.0 + 0 * share, "published": 0.75**share, "linear": 1.0 - share}[distance]
    fade = np.clip(fade, 0.0, 1.0) * hit
    c = (edge * fade)[..., None]
    reflection = c * texels(gbuffer, hits) + (1.0 - c) * np.array(f)
    assert gbuffer.radiance is not None and gbuffer.reflectivity is not None
    r = gbuffer.reflectivity.astype(float)
    composite = gbuffer.radiance * (1.0 - r) + r * reflection
    traced = ~np.isin(hits.status, NO_RAY)
    for got, want in (
        (out.edge_fade, edge),
        (out.distance_fade, fade),
        (out.confidence, edge * fade),
        (out.reflection, reflection),
        (out.composite, composite),
    ):
        assert np.allclose(got[traced], want[traced], rtol=2.0**-23, atol=1e-15)


def test_fallback_of_a_foggy_hit_is_between_both() -> None:
    """The mix is convex: no channel leaves the range of texel and fallback."""
    _, gbuffer, hits = made_up(5)
    out = run(with_r(gbuffer, 1.0), hits, edge_fade=True, fallback="constant")
    hit = hits.status == Status.HIT
    both = texels(gbuffer, hits)[hit]
    assert (out.composite[hit] >= 0.0).all() and (out.composite[hit] <= both).all()


def test_not_a_number_never_comes_out() -> None:
    """hit_px and length are NaN where there is no hit; no output may be."""
    _, gbuffer, hits = made_up(6)
    for fresnel in (False, True):
        out = run(gbuffer, hits, edge_fade=True, distance_fade="published", fresnel=fresnel)
        for name, image in out.arrays().items():
            assert np.isfinite(image).all(), name


def test_each_fade_is_available_alone() -> None:
    """Spec 5.4: switching one off leaves the other's image as it is."""
    _, gbuffer, hits = made_up(7)
    both = run(gbuffer, hits, edge_fade=True, distance_fade="linear")
    edge = run(gbuffer, hits, edge_fade=True)
    distance = run(gbuffer, hits, distance_fade="linear")
    hit = hits.status == Status.HIT
    assert both.edge_fade.tobytes() == edge.edge_fade.tobytes() == edge.confidence.tobytes()
    assert both.distance_fade.tobytes() == distance.confidence.tobytes()
    assert (edge.distance_fade[hit] == 1.0).all() and (distance.edge_fade[hit] == 1.0).all()


def test_default_fades_are_the_edge_alone() -> None:
    """Spec 5.4: all off by default but the edge; its power is 3 for the DDA and cells."""
    settings = Settings().resolved(1.0)
    assert (settings.edge_fade, settings.edge_power, settings.distance_fade) == (True, 3.0, "none")
    assert not settings.fresnel

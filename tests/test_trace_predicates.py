"""What must hold between two traces: subsets of pixels, thicker slabs, swapped axes, crops."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_trace_invariance import EYE, TARGET, small_scene
from tracing import PROJECTIONS, draw, noise_buffers, resolved, view_of

from ssr_ref.buffers import Status
from ssr_ref.camera import Camera, look_at
from ssr_ref.ssr.explain import trace_pixel
from ssr_ref.ssr.trace import trace

SIZE = (37, 23)


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_pixels_read_by_the_dda_are_among_those_the_ray_crosses(projection: str) -> None:
    """A bias beyond every depth: nothing is hit, so all rays are walked to their end."""
    view = view_of(projection, SIZE)
    gbuffer = noise_buffers(view, 5)
    rng = np.random.default_rng(1)
    read = 0
    for x, y in zip(rng.integers(0, SIZE[0], 150), rng.integers(0, SIZE[1], 150)):
        cells = trace_pixel(view, gbuffer, resolved(SIZE, tracer="cells", bias=1e9), x, y)
        crossed = [tuple(row) for row in cells.rows[:, 2:4]]
        assert len(set(crossed)) == len(crossed)  # each once
        for stride, jitter in ((1, False), (1, True), (3, True)):
            options = {"stride": stride, "jitter": jitter, "refine": "none", "seed": 3}
            dda = trace_pixel(view, gbuffer, resolved(SIZE, bias=1e9, **options), x, y)
            own = [tuple(row) for row in dda.rows[:, 2:4]]
            assert set(own) <= set(crossed), (x, y, stride)
            # In the ray's order; two samples of one column may read the same pixel.
            places = [crossed.index(pixel) for pixel in own]
            assert places == sorted(places)
            read += len(own)
    assert read > 3000


WALKS: tuple[dict[str, Any], ...] = (
    {"tracer": "cells"},
    {},
    {"interval": "point"},
    {"stride": 4},
    {"stride": 3, "refine": "none", "jitter": True},
)


@pytest.mark.parametrize("walk", WALKS)
def test_the_first_hit_is_no_later_in_thicker_slabs(walk: dict[str, Any]) -> None:
    """A thicker slab holds the thinner one, so a hit stays or comes earlier."""
    for projection in PROJECTIONS:
        view = view_of(projection, SIZE)
        gbuffer = noise_buffers(view, 8)
        before = np.full(SIZE[::-1], np.inf)
        hits = []
        for thickness in (0.0, 0.02, 0.2, 2.0, np.inf):
            settings = resolved(SIZE, thickness=thickness, thickness_from="constant", **walk)
            found = trace(view, gbuffer, settings)
            length = np.where(found.status == Status.HIT, found.length, np.inf)
            assert (length <= before).all(), thickness
            before = length
            hits.append(int(np.isfinite(length).sum()))
        assert hits == sorted(hits) and hits[-1] > hits[1] > 5


@pytest.mark.parametrize("walk", [{"tracer": "cells"}, {}, {"stride": 4}, {"surface": "plane"}])
def test_swapped_axes_swap_the_result(walk: dict[str, Any]) -> None:
    """Rows for columns: the image mirrored in its main diagonal, with x' = −y and y' = −x.

    Off ties: a corner crossed exactly steps x first in both.
    """
    aspect = SIZE[0] / SIZE[1]
    wide = Camera.frustum(np.eye(4), -aspect, aspect, -1.0, 1.0, near=0.1).params(SIZE)
    high = Camera.frustum(np.eye(4), -1.0, 1.0, -aspect, aspect, near=0.1).params(SIZE[::-1])
    a = noise_buffers(wide, 21)
    flipped = [-1.0, -1.0, 1.0]

    def swapped(image: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(np.swapaxes(image, 0, 1))

    images = {name: swapped(image) for name, image in a.arrays().items()}
    for name in ("geo_normal_vs", "normal_vs"):
        n = images[name]
        images[name] = (n[..., [1, 0, 2]] * flipped).astype(n.dtype)
    b = replace(a, **images)
    one = trace(wide, a, resolved(SIZE, **walk))
    two = trace(high, b, resolved(SIZE[::-1], **walk))

    names = {Status.LEFT_SCREEN_L: Status.LEFT_SCREEN_T, Status.LEFT_SCREEN_R: Status.LEFT_SCREEN_B}
    table = np.arange(len(Status))
    for x, y in names.items():
        table[x], table[y] = y, x
    same = one.status == table[swapped(two.status)]
    assert (~same).sum() <= 2, np.argwhere(~same)
    hit = same & (one.status == Status.HIT)
    assert hit.sum() > 100
    # Positions and lengths are sums in another order, through depths' slopes of any size.
    error = np.abs(one.hit_px - swapped(two.hit_px)[..., ::-1])[hit]
    assert np.quantile(error, 0.99) < 1e-9
    assert np.array_equal(one.steps[same], swapped(two.steps)[same])


@pytest.mark.parametrize("walk", [{"tracer": "cells"}, {}, {"surface": "plane"}])
def test_an_off_axis_image_is_a_crop_of_a_symmetric_one(walk: dict[str, Any]) -> None:
    """96 × 80 pixels of 128 × 96: the same pixels, and the same hits inside.

    Rays end at the crop's own sides, so only what lies inside it can agree; a hit in the outermost
    pixels may be cut off with its interval.
    """
    pose, size, corner = look_at(EYE, TARGET), (128, 96), (8, 16)
    width, height = 96, 80
    whole = Camera.frustum(pose, -0.8, 0.8, -0.6, 0.6, near=0.05).params(size)
    crop = Camera.frustum(pose, -0.7, 0.5, -0.6, 0.4, near=0.05).params((width, height))
    scene = small_scene()
    big, small = draw(whole, scene), draw(crop, scene)
    window = np.s_[corner[1] : corner[1] + height, corner[0] : corner[0] + width]
    assert np.array_equal(big.triangle_id[window], small.triangle_id)
    drawn = small.triangle_id >= 0
    assert drawn.mean() > 0.5
    steps = big.depth[window][drawn].view(np.int32) - small.depth[drawn].view(np.int32)
    assert np.abs(steps).max() <= 1  # float32 steps

    a = trace(whole, big, resolved(size, **walk))
    b = trace(crop, small, resolved((width, height), **walk))
    hit_a, hit_b = a.status[window] == Status.HIT, b.status == Status.HIT
    px = a.hit_px[window] - corner
    inside = ((px >= 1.0) & (px <= [width - 1.0, height - 1.0])).all(axis=2)
    assert np.array_equal(hit_a & inside, hit_b & inside)
    both = hit_a & hit_b & inside
    assert both.sum() > 200
    # Last bits of depths, over surfaces seen at a low angle: 64 px wide.
    assert np.abs(px - b.hit_px)[both].max() < 1e-2
    # Whatever the crop hits, the whole image hits too.
    assert not (hit_b & ~hit_a).any()

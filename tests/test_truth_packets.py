"""Packets of rays give the bytes of rays traced alone: that is all they may do."""

from __future__ import annotations

import numpy as np
import pytest
from truth_rays import aimed, ball, same, soup_tree, tree

from ssr_ref import _jit
from ssr_ref.raster.geometry import DOUBLE_SIDED
from ssr_ref.truth import packets
from ssr_ref.truth.bvh import Bvh, build_bvh
from ssr_ref.truth.nearest import Rays, nearest_plain, rays_of

LANES, CHUNK = packets.LANES, packets.PACKET_CHUNK


def check(bvh: Bvh, rays: Rays) -> float:
    """The share of the rays that meet something."""
    alone, together = nearest_plain(bvh, rays), packets.nearest(bvh, rays)
    assert same(alone, together)
    return float((alone.triangle_id >= 0).mean()) if len(rays.origin) else 0.0


def image_rays(n: int, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """n rays from one eye, side by side."""
    side = int(np.ceil(np.sqrt(n)))
    y, x = (np.mgrid[:side, :side].reshape(2, -1)[:, :n] / side - 0.5) * scale
    return np.tile([0.1, -0.2, 2.7], (n, 1)), np.stack([x, y, -np.ones(n)], axis=1)


@pytest.mark.parametrize("n", [0, 1, LANES - 1, LANES, LANES + 1, CHUNK + 5, 3 * CHUNK - 1])
def test_any_number_of_rays(n: int) -> None:
    points, faces = ball(3, 1)
    share = check(tree(points, faces, double_sided=False), rays_of(*image_rays(n, 1.2)))
    assert n < CHUNK or 0.3 < share < 1.0


def test_rays_that_run_apart() -> None:
    points, faces = ball(2, 2)
    rng = np.random.default_rng(3)
    o, d = rng.uniform(-1.2, 1.2, (2500, 3)), rng.normal(size=(2500, 3))
    d[:600] = rng.integers(-1, 2, (600, 3))  # along axes, diagonals, and nowhere
    d[600:640] *= 2.0 ** rng.integers(-600, 600, (40, 1)).astype(float)
    o[640:660, 1] = np.nan
    d[660:680, 2] = np.inf
    d[680:700, 0] = 5e-324
    assert 0.15 < check(tree(points, faces), rays_of(o, d)) < 0.9


def test_rays_at_edges_and_vertices() -> None:
    points, faces = ball(2, 5)
    for origins in (np.zeros((700, 3)), np.full((700, 3), 3.0), np.full((700, 3), 1e6)):
        rays = aimed(points, faces, origins, 6)
        share = check(tree(points, faces), rays_of(rays[:, 0], rays[:, 1]))
        assert share > 0.7


def test_equal_triangles_and_grids() -> None:
    rng = np.random.default_rng(8)
    triangles = rng.integers(-2, 3, (300, 3, 3)).astype(float)
    triangles[1::2] = triangles[::2][:, [2, 0, 1]]
    o = rng.integers(-4, 5, (2000, 3)).astype(float)
    d = rng.integers(-4, 5, (2000, 3)) / 4.0
    assert check(soup_tree(triangles), rays_of(o, d)) > 0.15


def test_skip_guard_and_limit() -> None:
    rng = np.random.default_rng(9)
    points, faces = ball(2, 4)
    flags = np.where(rng.uniform(size=len(faces)) < 0.5, DOUBLE_SIDED, 0).astype(np.uint8)
    bvh = build_bvh(points, faces, flags)
    o, d = image_rays(3000, 1.0)
    first = nearest_plain(bvh, rays_of(o, d))
    guard = np.stack([rng.uniform(0, 2e-15, 3000), rng.normal(size=3000), rng.normal(size=3000),
                      np.ones(3000)], axis=1)  # fmt: skip
    for t_max in (np.inf, float(np.median(first.t[first.triangle_id >= 0]))):
        check(bvh, Rays(o, d, first.triangle_id, guard, t_max))
        check(bvh, Rays(o, d, first.triangle_id, guard[:0], t_max))
    met = nearest_plain(bvh, Rays(o, d, first.triangle_id, guard, np.inf)).triangle_id
    assert ((met >= 0) & (met != first.triangle_id)).sum() > 50


@pytest.mark.parametrize("power", [-330, -160, 150, 300])
def test_scenes_of_any_size(power: int) -> None:
    """Far beyond where products of edges are exact, or numbers at all: the bytes still agree."""
    points, faces = ball(1, 4)
    o, d = image_rays(500, 1.0)
    s = 2.0**power
    with np.errstate(all="ignore"):
        share = check(tree(points * s, faces), rays_of(o * s, d))
    if abs(power) <= 300:
        assert share > 0.3


@pytest.mark.slow  # compiles the plain driver with textures
def test_masks() -> None:
    """By the truth of a scene with a masked card, traced both ways."""
    from test_truth_meshes import SIZE, camera_of, gallery, gbuffer_of

    from ssr_ref.raster.geometry import flatten
    from ssr_ref.raster.textures import texture_store
    from ssr_ref.truth.accept import Cutout
    from ssr_ref.truth.reflections import reflected_rays, reflective_pixels

    scene, camera = gallery(), camera_of("perspective")
    view, geometry, store = camera.params(SIZE), flatten(scene), texture_store(scene)
    g = gbuffer_of(scene, camera)
    points = geometry.positions_ws - camera.world_from_view[:3, 3]
    rays = reflected_rays(camera, view, geometry, points, g, reflective_pixels(view, g))
    assert store is not None
    masks = store.pack(geometry, store.masked)
    cutout = Cutout(geometry.faces, geometry.triangle_material, masks)
    bvh = build_bvh(points, geometry.faces, geometry.triangle_flags)
    alone, together = nearest_plain(bvh, rays, cutout), packets.nearest(bvh, rays, cutout)
    assert same(alone, together)
    assert not same(alone, packets.nearest(bvh, rays))  # solid, the card shows more


def test_one_thread_and_many() -> None:
    if not _jit.JIT_ENABLED:
        pytest.skip("interpreted code has no threads")
    import numba

    points, faces = ball(3, 2)
    bvh, rays = tree(points, faces), rays_of(*image_rays(5000, 1.5))
    before = numba.get_num_threads()
    found = []
    try:
        for threads in {1, numba.config.NUMBA_NUM_THREADS}:
            numba.set_num_threads(threads)
            found.append(packets.nearest(bvh, rays))
    finally:
        numba.set_num_threads(before)
    assert same(found[0], found[-1])
    assert len(packets.trace_packets.dispatcher.signatures) <= 2  # with and without cutouts

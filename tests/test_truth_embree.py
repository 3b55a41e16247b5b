"""Many rays beside Embree. Where the two differ, exact rationals say which triangles are met."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from oracles import ray_triangle
from truth_rays import aimed, ball, soup_tree, tree

from ssr_ref.truth.bvh import Bvh
from ssr_ref.truth.nearest import rays_of
from ssr_ref.truth.packets import nearest

pytestmark = pytest.mark.slow
embreex = pytest.importorskip("embreex", reason="wheels for x86-64 only")


def by_embree(triangles: np.ndarray, o: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Triangle that each ray meets first, −1 for none."""
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh

    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, np.float32(triangles))
    return np.asarray(scene.run(np.float32(o), np.float32(d), output=1)["primID"]).astype(np.int64)


def judge(triangles: np.ndarray, bvh: Bvh, o: np.ndarray, d: np.ndarray) -> tuple[int, int, int]:
    """(rays, of which Embree answers otherwise, of which it may: a line on an edge or corner).

    Everything is float32, so both trace the same rays. Each disagreement is judged exactly: ours
    must be the exact answer; or the line passes within rounding of an edge (the weights' margin is
    below 1e-12 of the triangle for ours), where both answers touch the line.
    """
    hits = nearest(bvh, rays_of(o, d))
    theirs = by_embree(triangles, o, d)
    differ = np.flatnonzero(hits.triangle_id != theirs)
    near = 0
    for i in differ:
        ours = int(hits.triangle_id[i])
        number, exact = ray_triangle.nearest(o[i], d[i], triangles)
        if ours == number:
            continue
        near += 1
        # Ours is not the exact answer: only because the line touches an outline within rounding.
        touched = [t for t in (ours, number) if t >= 0]
        margins = [abs(ray_triangle.margin(o[i], d[i], triangles[t])) for t in touched]
        assert min(margins) < 1e-12, (i, ours, number, margins)
        if exact is not None and ours >= 0:
            assert abs(Fraction(float(hits.t[i])) / exact.t - 1) < Fraction(1, 10**9)
    return len(o), len(differ), near


def float32(*arrays: np.ndarray) -> list[np.ndarray]:
    """Rounded to float32, so that Embree traces the same numbers."""
    return [np.float64(np.float32(a)) for a in arrays]


def test_a_soup() -> None:
    rng = np.random.default_rng(61)
    (triangles,) = float32(rng.normal(size=(300, 3, 3)))
    o, d = float32(rng.normal(size=(200_000, 3)) * 2, rng.normal(size=(200_000, 3)))
    n, differ, near = judge(triangles, soup_tree(triangles), o, d)
    assert differ <= 2e-4 * n and near == 0


@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (3.0, -2.0, 4.0)])
def test_edges_and_vertices_of_a_closed_mesh(origin: tuple[float, float, float]) -> None:
    """Rays at edges and corners: which of the neighbours is met may differ, that one is may not."""
    points, faces = ball(2, 7)
    (points,) = float32(points)
    start = np.tile(origin, (2000, 1))
    rays = aimed(points, faces, start, 71)
    o, d = float32(rays[:, 0], rays[:, 1])
    triangles = points[faces]
    n, differ, _ = judge(triangles, tree(points, faces), o, d)
    assert n == 4000 and differ > 0
    if origin == (0.0, 0.0, 0.0):
        assert (nearest(tree(points, faces), rays_of(o, d)).triangle_id >= 0).all()


def test_random_rays_of_a_large_mesh() -> None:
    points, faces = ball(6, 3)
    (points,) = float32(points)
    rng = np.random.default_rng(81)
    o = rng.normal(size=(300_000, 3)) * 2
    o, d = float32(o, rng.normal(size=o.shape) - o)
    hits, theirs = nearest(tree(points, faces), rays_of(o, d)), by_embree(points[faces], o, d)
    differ = np.flatnonzero(hits.triangle_id != theirs)
    assert len(differ) <= 2e-4 * len(o)
    # Too many triangles to try all: the two answers are compared with each other.
    for i in differ:
        found = []
        for t in (int(hits.triangle_id[i]), int(theirs[i])):
            line = (
                [ray_triangle.exact(v) for v in (o[i], d[i], *points[faces[t]])] if t >= 0 else []
            )
            crossed = ray_triangle.crossing(*line) if line else None
            found.append(crossed if crossed is not None and crossed.t > 0 else None)
        ours, other = found
        assert ours is not None or (other is None and hits.triangle_id[i] < 0), i
        if ours is not None and other is not None:
            assert (ours.t, hits.triangle_id[i]) < (other.t, theirs[i]), i

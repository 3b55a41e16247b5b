"""Triangles and rays for tests of the truth: soups on a grid, closed meshes, aimed rays."""

from __future__ import annotations

import numpy as np

from ssr_ref.raster.geometry import DOUBLE_SIDED
from ssr_ref.truth.bvh import Bvh, build_bvh
from ssr_ref.truth.nearest import Hits


def tree(points: np.ndarray, faces: np.ndarray, *, double_sided: bool = True) -> Bvh:
    """The hierarchy of a mesh."""
    flags = np.full(len(faces), DOUBLE_SIDED if double_sided else 0, np.uint8)
    return build_bvh(np.ascontiguousarray(points, np.float64), np.int32(faces), flags)


def soup_tree(triangles: np.ndarray, *, double_sided: bool = True) -> Bvh:
    """The hierarchy of (n, 3, 3) triangles that share no vertex."""
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    return tree(triangles.reshape(-1, 3), faces, double_sided=double_sided)


def ball(levels: int, seed: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """A closed, convex-ish mesh about the origin: an octahedron's faces halved `levels` times.

    Its vertices lie near the unit sphere, each moved a little if there is a seed. Counter-clockwise
    seen from outside.
    """
    points = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    corners = [np.array(p, float) for p in points]
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(levels):
        halves: dict[tuple[int, int], int] = {}

        def half(i: int, j: int, halves: dict[tuple[int, int], int] = halves) -> int:
            key = (min(i, j), max(i, j))
            if key not in halves:
                p = corners[i] + corners[j]
                halves[key] = len(corners)
                corners.append(p / np.sqrt((p * p).sum()))
            return halves[key]

        faces = [
            f
            for a, b, c in faces
            for f in (
                (a, half(a, b), half(c, a)),
                (b, half(b, c), half(a, b)),
                (c, half(c, a), half(b, c)),
                (half(a, b), half(b, c), half(c, a)),
            )
        ]
    out = np.array(corners)
    if seed is not None:
        out = out * (1.0 + 0.02 * np.random.default_rng(seed).uniform(-1, 1, (len(out), 1)))
    return out, np.array(faces, np.int32)


def aimed(points: np.ndarray, faces: np.ndarray, origins: np.ndarray, seed: int) -> np.ndarray:
    """(2n, 2, 3) origin and direction of rays at n vertices and at n points of edges, rounded."""
    rng = np.random.default_rng(seed)
    n = len(origins)
    at_vertex = points[rng.integers(0, len(points), n)]
    a, b = points[faces[rng.integers(0, len(faces), n)][:, :2]].transpose(1, 0, 2)
    share = rng.choice([0.25, 0.5, 1 / 3, 0.7], (n, 1))
    at_edge = a + share * (b - a)
    target = np.concatenate([at_vertex, at_edge])
    start = np.concatenate([origins, origins])
    return np.stack([start, target - start], axis=1)


def same(a: Hits, b: Hits) -> bool:
    """Whether two traces agree in every byte."""
    return all(x.tobytes() == y.tobytes() for x, y in zip(a, b, strict=True))

"""A mirror matrix as it stands in print, with its slips, kept as data: what they cost is measured.

The page uses row vectors, x' = x·M, for the plane n·x + d = 0 with unit n. Three of its entries are
wrong (row and column counted from 1): row 2 column 3 lacks ny, row 3 column 1 has ny for nz, row 4
column 2 lacks ny. The formula above the matrix, p' = p − 2 (p·n) n, forgets the plane's offset.

    python -m benchmarks.published
"""

from __future__ import annotations

import numpy as np

import ssr_ref
from ssr_ref.typed import F64Array

WRONG_ENTRIES = ((1, 2), (2, 0), (3, 1))
"""Row and column from 0."""


def published_mirror_matrix(normal: F64Array, offset: float) -> F64Array:
    """(4, 4) as printed, for row vectors; unit normal."""
    x, y, z = (float(c) for c in normal)
    d = float(offset)
    return np.array(
        [
            [1 - 2 * x * x, -2 * x * y, -2 * x * z, 0],
            [-2 * x * y, 1 - 2 * y * y, -2 * z, 0],
            [-2 * x * y, -2 * y * z, 1 - 2 * z * z, 0],
            [-2 * x * d, -2 * d, -2 * z * d, 1],
        ]
    )


def published_mirror_point(point: F64Array, normal: F64Array) -> F64Array:
    """p − 2 (p·n) n, the formula above the matrix."""
    n = np.asarray(normal, np.float64)
    p = np.asarray(point, np.float64)
    return np.asarray(p - 2.0 * (p * n).sum() * n, np.float64)


def worst_displacement(normal: F64Array, offset: float, seed: int = 0) -> float:
    """Largest distance between the printed and the true image of 1000 points of [−1, 1]³."""
    rng = np.random.default_rng(seed)
    points = np.concatenate([rng.uniform(-1.0, 1.0, (1000, 3)), np.ones((1000, 1))], axis=-1)
    printed = (points[:, :, None] * published_mirror_matrix(normal, offset)).sum(axis=1)
    true = ssr_ref.mirror_matrix(normal, offset, row_vectors=True)
    exact = (points[:, :, None] * true).sum(axis=1)
    return float(np.sqrt(((printed - exact)[:, :3] ** 2).sum(axis=-1)).max())


def main() -> None:
    """Print one row a plane."""
    print("| plane | largest entry error | largest displacement of a point of [-1, 1]³ |")
    print("|---|---|---|")
    planes = {
        "floor y = 0": ((0.0, 1.0, 0.0), 0.0),
        "floor y = −0.5": ((0.0, 1.0, 0.0), 0.5),
        "wall x = 0": ((1.0, 0.0, 0.0), 0.0),
        "wall z = −2": ((0.0, 0.0, 1.0), 2.0),
        "slanted (2, 3, 6)/7": ((2 / 7, 3 / 7, 6 / 7), 0.5),
    }
    for name, (normal, offset) in planes.items():
        n = np.array(normal)
        true = ssr_ref.mirror_matrix(n, offset, row_vectors=True)
        entry = np.abs(published_mirror_matrix(n, offset) - true).max()
        print(f"| {name} | {entry:.3g} | {worst_displacement(n, offset):.3g} |")


if __name__ == "__main__":
    main()

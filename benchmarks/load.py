"""Time to load a GLB of about 1 million triangles, a quarter and a sixteenth, beside trimesh.

python -m benchmarks.load
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from ssr_ref.fileio.scene_glb import write_scene_glb
from ssr_ref.meshfiles.meshes import load_mesh
from ssr_ref.scene import Mesh, Node, Primitive, Scene

from .common import machine, median_ms

SIDE = 708
"""Squares along an edge of the largest grid: 2 · 708² = 1 002 528 triangles."""


def grid(side: int) -> Scene:
    """A wavy grid of side × side squares with normals."""
    y, x = np.mgrid[: side + 1, : side + 1].reshape(2, -1).astype(np.float32)
    positions = np.stack([x, ((x * 7 + y * 3) % 11) / 11, y], axis=1)
    normals = np.tile(np.float32([0, 1, 0]), (len(positions), 1))
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    a, b, c, d = corner, corner + 1, corner + side + 1, corner + side + 2
    faces = np.stack([a, c, b, b, c, d], axis=1).reshape(-1, 3)
    return Scene((Mesh("grid", (Primitive(positions, faces, 0, normals),)),), (Node("grid", 0),))


def main() -> None:
    """Print the table."""
    import trimesh

    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "grid.glb"
        for side in (SIDE, SIDE // 2, SIDE // 4):
            write_scene_glb(grid(side), path)
            ours = median_ms(lambda: load_mesh(path))
            theirs = median_ms(lambda: trimesh.load(path, process=False))
            print(
                f"{2 * side * side:9,} triangles, {path.stat().st_size / 2**20:5.1f} MiB: "
                f"load_mesh {ours:7.1f} ms, trimesh.load(process=False) {theirs:7.1f} ms, "
                f"{1e6 * ours / (2 * side * side):5.0f} ns a triangle"
            )


if __name__ == "__main__":
    main()

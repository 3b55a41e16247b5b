"""Small scenes, and drawing them without the rest of the pipeline, for tests of the rasterizer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ssr_ref.buffers import GBuffer
from ssr_ref.camera import Camera
from ssr_ref.pipeline import with_radiance
from ssr_ref.raster.geometry import flatten
from ssr_ref.raster.rasterize import RasterOptions, rasterize
from ssr_ref.raster.textures import texture_store
from ssr_ref.scene import Material, Mesh, Node, Primitive, Scene

TWO_SIDED = Material("two-sided", double_sided=True)
ONE_SIDED = Material("one-sided")


class Drawn(NamedTuple):
    """A G-buffer with the view-space vertices (nv, 3) and faces (nt, 3) that made it."""

    g: GBuffer
    positions_vs: np.ndarray
    faces: np.ndarray

    def corners(self, t: int) -> np.ndarray:
        """(3, 3) view-space corners of triangle t."""
        return self.positions_vs[self.faces[t]]


def draw(scene: Scene, camera: Camera, size: tuple[int, int], **options: Any) -> Drawn:
    """The scene's G-buffer with radiance; float64 unless told otherwise."""
    view = camera.params(size)
    geometry = flatten(scene)
    store = texture_store(scene)
    chosen = RasterOptions(**{"dtype": np.float64, **options})
    g, positions_vs = rasterize(view, geometry, chosen, store=store)
    lit = with_radiance(view, geometry, positions_vs, g, scene, store)
    return Drawn(lit, positions_vs, geometry.faces)


def soup(
    triangles: Any,
    material: Material = TWO_SIDED,
    transform: np.ndarray | None = None,
    **parts: Any,
) -> Scene:
    """One object of (n, 3, 3) triangles that share no vertex."""
    corners = np.asarray(triangles, np.float32).reshape(-1, 3)
    faces = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    return objects([(Primitive(corners, faces, 0, **parts), transform)], (material,))


def objects(
    parts: Sequence[tuple[Primitive | Sequence[Primitive], np.ndarray | None]],
    materials: Sequence[Material] = (ONE_SIDED,),
    **scene: Any,
) -> Scene:
    """One object for each (primitives, world_from_mesh)."""
    meshes, nodes = [], []
    for i, (primitives, transform) in enumerate(parts):
        many = (primitives,) if isinstance(primitives, Primitive) else tuple(primitives)
        meshes.append(Mesh(f"mesh {i}", many))
        nodes.append(Node(f"node {i}", i, np.eye(4) if transform is None else transform))
    return Scene(tuple(meshes), tuple(nodes), tuple(materials), **scene)


def pixel_camera(size: tuple[int, int], *, near: float = 0.5, **more: Any) -> Camera:
    """Orthographic; view x is the pixel column and −y the row, before rounding of 2/W and 2/H."""
    width, height = size
    m = np.zeros((4, 4))
    m[0, 0], m[0, 3] = 2.0 / width, -1.0
    m[1, 1], m[1, 3] = 2.0 / height, 1.0
    m[3, 3] = 1.0
    return Camera(np.eye(4), m, near, **more)


def quad(a: Any, b: Any, c: Any, d: Any) -> Primitive:
    """Two triangles a b c, a c d."""
    return Primitive(np.array([a, b, c, d], np.float32), np.array([[0, 1, 2], [0, 2, 3]]))


def image_bytes(g: GBuffer) -> dict[str, bytes]:
    """Every image of a G-buffer as bytes."""
    return {name: array.tobytes() for name, array in g.arrays().items()}

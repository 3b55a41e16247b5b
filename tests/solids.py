"""Measures of triangle meshes and scenes, for tests: edges, volumes, loops, places on screen."""

from __future__ import annotations

from collections import Counter

import numpy as np

from ssr_ref import transforms
from ssr_ref.scene import Primitive, Scene


def directed_edges(primitive: Primitive) -> Counter[tuple[bytes, bytes]]:
    """How often each directed edge occurs; a vertex is its float32 position."""
    key = [p.tobytes() for p in primitive.positions + np.float32(0)]
    return Counter(
        (key[face[i]], key[face[(i + 1) % 3]]) for face in primitive.faces for i in range(3)
    )


def open_edges(primitive: Primitive) -> list[tuple[bytes, bytes]]:
    """Directed edges without their reverse. Fails if an edge is used twice the same way."""
    edges = directed_edges(primitive)
    assert set(edges.values()) == {1}
    assert all(a != b for a, b in edges)
    return [(a, b) for a, b in edges if (b, a) not in edges]


def corners(primitive: Primitive) -> np.ndarray:
    """(m, 3, 3) float64 corners of the triangles."""
    return primitive.positions.astype(np.float64)[primitive.faces]


def volume(triangles: np.ndarray) -> float:
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    return float((a * np.cross(b, c)).sum() / 6.0)


def point(key: bytes) -> np.ndarray:
    return np.frombuffer(key, np.float32).astype(np.float64)


def loops(edges: list[tuple[bytes, bytes]]) -> list[np.ndarray]:
    """Closed loops of directed edges, each (k, 3) points in order."""
    after = dict(edges)
    assert len(after) == len(edges)
    found = []
    while after:
        start, here = after.popitem()
        loop = [start]
        while here != start:
            loop.append(here)
            here = after.pop(here)
        found.append(np.array([point(key) for key in loop]))
    return found


def capped(primitive: Primitive) -> np.ndarray:
    """The triangles with every open loop closed by a fan about its mean point."""
    triangles = [corners(primitive)]
    for loop in loops(open_edges(primitive)):
        fan = np.empty((len(loop), 3, 3))
        fan[:, 0], fan[:, 1], fan[:, 2] = np.roll(loop, -1, axis=0), loop, loop.mean(axis=0)
        triangles.append(fan)
    return np.concatenate(triangles)


def check_normals(primitive: Primitive, *, lowest: float = 0.0) -> None:
    """Vertex normals are unit and each is on the outer side of all its faces."""
    assert primitive.normals is not None
    n = primitive.normals.astype(np.float64)
    assert np.abs(np.sqrt((n * n).sum(axis=1)) - 1.0).max() < 1e-6
    t = corners(primitive)
    face = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    length = np.sqrt((face * face).sum(axis=1))
    assert (length > 0.0).all()
    cosine = (n[primitive.faces] * (face / length[:, None])[:, None]).sum(axis=2)
    assert cosine.min() > lowest


def world_points(scene: Scene, name: str) -> np.ndarray:
    """World positions of the node's vertices."""
    node = next(node for node in scene.nodes if node.name == name)
    p = np.concatenate([p.positions for p in scene.meshes[node.mesh].primitives])
    out = np.empty((len(p), 3))
    transforms.transform_points(node.world_from_mesh, p, out)
    return out


def project(scene: Scene, points: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Pixel coordinates by the view's definition, with trigonometry: not the camera's code."""
    view = scene.view
    assert view is not None and view.fov_y_degrees is not None
    eye, target = np.array(view.eye), np.array(view.target)
    forward = (target - eye) / np.sqrt(((target - eye) ** 2).sum())
    right = np.cross(forward, view.up)
    right /= np.sqrt((right**2).sum())
    up = np.cross(right, forward)
    d = points - eye
    depth = d @ forward
    assert (depth > 0.0).all()
    scale = size[1] / 2.0 / np.tan(np.radians(view.fov_y_degrees) / 2.0)
    return np.stack(
        [size[0] / 2 + scale * (d @ right) / depth, size[1] / 2 - scale * (d @ up) / depth], axis=1
    )

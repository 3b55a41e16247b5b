"""Newell's teapot on a mirror floor, with a box, a sphere and two coloured walls.

The teapot is a little metallic, so its body must reflect its own spout: an environment map cannot
show that. Everything touches the floor at y = 0 exactly.
"""

from __future__ import annotations

import numpy as np

from .. import transforms
from ..camera import View
from ..scene import DirectionalLight, Lights, Material, Mesh, Node, Primitive, Scene
from ..typed import F64Array
from . import shapes, teapot_patches

SCALE = 0.3125
"""Scene units per unit of Newell's table: the teapot is 0.984 high. Exact in binary."""

FLOOR, POT, BALL, BLOCK, BACK, LEFT = range(6)
MATERIALS = (
    Material("mirror floor", (0.86, 0.87, 0.9), metallic=0.9, roughness=0.0),
    Material("ceramic", (0.88, 0.86, 0.8), metallic=0.4, roughness=0.1),
    Material("green ball", (0.2, 0.75, 0.3), metallic=0.5, roughness=0.05),
    Material("orange block", (0.95, 0.42, 0.05), metallic=0.0, roughness=0.8),
    Material("blue wall", (0.12, 0.3, 0.8), metallic=0.0, roughness=0.9),
    Material("red wall", (0.8, 0.1, 0.12), metallic=0.0, roughness=0.9),
)
BLOCK_TURN = (0.0, 7.0 / 25.0, 0.0, 24.0 / 25.0)
"""Unit quaternion with rational components: 32.5° about y."""


def teapot(tessellation: int = 16) -> Scene:
    """The scene; every patch of the pot is cut into tessellation² cells of two triangles.

    The pot has 64 n² − 8 n triangles (16,256 at 16), the ball 20 n².
    """
    ball = shapes.sphere(0.28, tessellation, material=BALL)
    meshes = (
        Mesh("floor", (shapes.box((-2.2, -0.1, -1.8), (3.8, 0.0, 2.8), material=FLOOR),)),
        Mesh("teapot", pot(tessellation, material=POT)),
        Mesh("ball", (ball,)),
        Mesh("block", (shapes.box((-0.19, 0.0, -0.19), (0.19, 0.5, 0.19), material=BLOCK),)),
        Mesh("back wall", (shapes.box((-1.9, 0.0, -1.6), (3.4, 1.4, -1.5), material=BACK),)),
        Mesh("left wall", (shapes.box((-2.0, 0.0, -1.6), (-1.9, 1.4, 1.2), material=LEFT),)),
    )
    ball_height = -float(ball.positions[:, 1].min())
    block_place = transforms.multiply(
        transforms.translation(1.2, 0.0, 0.5), transforms.from_quaternion(*BLOCK_TURN)
    )
    nodes = (
        Node("floor", 0),
        Node("teapot", 1),
        Node("ball", 2, transforms.translation(-0.95, ball_height, 0.7)),
        Node("block", 3, block_place),
        Node("back wall", 4),
        Node("left wall", 5),
    )
    return Scene(meshes, nodes, MATERIALS, lights=_lights(), view=_view(), name="teapot")


def _lights() -> Lights:
    return Lights(
        ambient=(0.3, 0.3, 0.32),
        directional=(
            DirectionalLight((-0.45, -1.0, -0.55), (0.65, 0.63, 0.6)),
            DirectionalLight((0.8, -0.35, -0.6), (0.2, 0.21, 0.25)),
        ),
    )


def _view() -> View:
    return View(eye=(0.8, 1.2, 3.75), target=(0.08, 0.2, 0.0), fov_y_degrees=36.0)


def pot(tessellation: int, *, material: int = 0) -> tuple[Primitive, ...]:
    """Body with rim and bottom, lid, handle, spout: y up, spout towards +x, lowest point y = 0.

    Each part is watertight but for these open ends of Newell's data: the rim's inner edge, the
    lid's edge, both roots and the spout's lip (4, 4, 2 + 2 and 2 + 2 times n edges).
    At tessellation 1 handle and spout are flat.
    """
    return tuple(_part(name, tessellation, material) for name in teapot_patches.PARTS)


def _part(name: str, n: int, material: int) -> Primitive:
    """One part as a grid that is closed around; a row that is one point becomes one vertex."""
    rows = teapot_patches.patches(name)
    along, around = len(rows), len(rows[0])
    points = np.empty((along * n + 1, around * n, 3))
    normals = np.empty_like(points)
    for i, row in enumerate(rows):
        for j, control in enumerate(row):
            p, unit = evaluate(control, n)
            # Rows i·n are written twice, with the same bits (both ends of a Bézier curve).
            points[i * n : (i + 1) * n + 1, j * n : (j + 1) * n] = p[:, :n]
            normals[i * n : (i + 1) * n + 1, j * n : (j + 1) * n] = unit[:, :n]

    index = np.arange(points.shape[0] * points.shape[1]).reshape(points.shape[:2])
    control_points = teapot_patches.PARTS[name]
    for end, up in ((0, 1.0), (-1, -1.0)):
        if (control_points[end] == control_points[end, 0]).all():
            # ∂P/∂v vanishes at a pole; the limit of the normal is the axis.
            index[end] = index[end, 0]
            normals[end] = (0.0, 0.0, up)

    after = np.roll(index, -1, axis=1)
    faces = shapes.split_quads(np.stack([index[:-1], index[1:], after[1:], after[:-1]], axis=2))
    a, b, c = faces[:, 0], faces[:, 1], faces[:, 2]
    faces = faces[(a != b) & (b != c) & (c != a)]

    used, renumbered = np.unique(faces, return_inverse=True)
    return Primitive(
        _y_up(points.reshape(-1, 3)[used] * SCALE).astype(np.float32),
        renumbered.reshape(-1, 3).astype(np.int32),
        material,
        normals=_y_up(normals.reshape(-1, 3)[used]).astype(np.float32),
    )


def evaluate(control: F64Array, n: int) -> tuple[F64Array, F64Array]:
    """Points and unit normals (n + 1, n + 1, 3) of a bicubic patch at (i/n, j/n).

    control : (4, 4, 3). Sums run left to right, first along the columns, then along the rows; at
    parameter 0 or 1 three of four weights are 0, so patches that share a boundary's control points
    share its bits. Where a derivative vanishes the normal means nothing.
    """
    value, slope = bernstein(n)
    # along[i]: the curve's points in v for row i of the control points; its slope likewise.
    along = [_sum4(value, row) for row in control]
    along_slope = [_sum4(slope, row) for row in control]
    points = _sum4_rows(value, along)
    du = _sum4_rows(slope, along)
    dv = _sum4_rows(value, along_slope)
    normal = np.stack(
        [
            du[..., 1] * dv[..., 2] - du[..., 2] * dv[..., 1],
            du[..., 2] * dv[..., 0] - du[..., 0] * dv[..., 2],
            du[..., 0] * dv[..., 1] - du[..., 1] * dv[..., 0],
        ],
        axis=2,
    )
    x, y, z = normal[..., 0], normal[..., 1], normal[..., 2]
    length = np.sqrt(x * x + y * y + z * z)
    length[length == 0.0] = 1.0
    return points, normal / length[..., None]


def bernstein(n: int) -> tuple[F64Array, F64Array]:
    """Values and derivatives (4, n + 1) of the cubic Bernstein polynomials at i/n."""
    t = np.arange(n + 1, dtype=np.float64) / n
    s = 1.0 - t
    value = np.stack([s * s * s, 3.0 * (s * s) * t, 3.0 * s * (t * t), t * t * t])
    slope = np.stack(
        [
            -3.0 * (s * s),
            3.0 * (s * s) - 6.0 * (s * t),
            6.0 * (s * t) - 3.0 * (t * t),
            3.0 * (t * t),
        ]
    )
    return value, slope


def _sum4(weights: F64Array, points: F64Array) -> F64Array:
    """Σ weights[k] · points[k] of four points: (n + 1, 3)."""
    w = weights[:, :, None]
    total: F64Array = w[0] * points[0] + w[1] * points[1] + w[2] * points[2] + w[3] * points[3]
    return total


def _sum4_rows(weights: F64Array, rows: list[F64Array]) -> F64Array:
    """Σ weights[k] · rows[k] of four curves: (n + 1, n + 1, 3)."""
    w = weights[:, :, None, None]
    total: F64Array = w[0] * rows[0] + w[1] * rows[1] + w[2] * rows[2] + w[3] * rows[3]
    return total


def _y_up(v: F64Array) -> F64Array:
    """(x, y, z) with z up to (x, z, −y) with y up; + 0 turns −0 into 0."""
    return np.stack([v[:, 0], v[:, 2], -v[:, 1]], axis=1) + 0.0

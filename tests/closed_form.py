"""Exact rays and scaled scenes, for the tests of closed-form shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from ssr_ref.analytic import AnalyticScene, Box, Disc, Plane, Sphere
from ssr_ref.camera import Camera, View
from ssr_ref.scene import Lights, Material

MIRROR = Material("mirror", (0.9, 0.9, 0.9), metallic=1.0, roughness=0.0)
MATT = Material("matt", (0.8, 0.3, 0.1))
BOTH = Material("both sides", (0.5, 0.6, 0.7), metallic=1.0, roughness=0.0, double_sided=True)
SIDES = (MIRROR, MATT, BOTH)
NEAR = 2.0**-6


def front(
    size: tuple[int, int], *, orthographic: bool = False, near: float = NEAR, far: float = np.inf
) -> Camera:
    """Eye at the origin, down −Z; 90° high, or 2 units high, so that one unit is simple."""
    aspect = size[0] / size[1]
    if orthographic:
        return Camera.orthographic(np.eye(4), 2.0, aspect, near=near, far=far)
    return Camera.frustum(np.eye(4), -aspect, aspect, -1.0, 1.0, near=near, far=far)


def scene_of(*shapes: object, view: View | None = None) -> AnalyticScene:
    """Shapes with the materials of `SIDES`: 0 mirror, 1 matt, 2 seen from both sides."""
    return AnalyticScene(tuple(shapes), SIDES, view=view)  # type: ignore[arg-type]


Vector = tuple[Fraction, Fraction, Fraction]


def fractions(values: Sequence[float]) -> Vector:
    """Three floats exactly."""
    x, y, z = (Fraction(float(v)) for v in values)
    return (x, y, z)


def exact_dot(a: Sequence[Fraction], b: Sequence[Fraction]) -> Fraction:
    """a·b."""
    return sum((x * y for x, y in zip(a, b)), Fraction(0))


def exact_ray(camera: Camera, size: tuple[int, int], px: float, py: float) -> tuple[Vector, Vector]:
    """World origin and direction through a pixel position, from the camera's floats exactly.

    The world ray is R⁻ᵀ of the view ray (view space is Rᵀ·(p − eye)); t is the view depth.
    """
    m = [[Fraction(float(v)) for v in row] for row in camera.clip_from_view]
    w = [[Fraction(float(v)) for v in row] for row in camera.world_from_view]
    ndc_x = 2 * Fraction(px) / size[0] - 1
    ndc_y = 1 - 2 * Fraction(py) / size[1]
    if camera.is_perspective:
        d = [(ndc_x + m[0][2]) / m[0][0], (ndc_y + m[1][2]) / m[1][1], Fraction(-1)]
        o = [Fraction(0)] * 3
    else:
        d = [Fraction(0), Fraction(0), Fraction(-1)]
        o = [(ndc_x - m[0][3]) / m[0][0], (ndc_y - m[1][3]) / m[1][1], Fraction(0)]

    def cofactor(i: int, j: int) -> Fraction:
        a, b, c, e = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
        return w[a][c] * w[b][e] - w[a][e] * w[b][c]

    det = sum((w[0][j] * cofactor(0, j) for j in range(3)), Fraction(0))

    def turned(v: Sequence[Fraction]) -> list[Fraction]:
        return [sum((cofactor(i, j) * v[j] for j in range(3)), Fraction(0)) / det for i in range(3)]

    start, way = turned(o), turned(d)
    x, y, z = (start[i] + w[i][3] for i in range(3))
    return (x, y, z), (way[0], way[1], way[2])


def scaled(scene: AnalyticScene, k: float) -> AnalyticScene:
    """Every length times k."""

    def times(v: Sequence[float]) -> tuple[float, float, float]:
        return (v[0] * k, v[1] * k, v[2] * k)

    shapes: list[object] = []
    for s in scene.shapes:
        if isinstance(s, Sphere):
            shapes.append(replace(s, center=times(s.center), radius=s.radius * k))
        elif isinstance(s, Plane):
            shapes.append(replace(s, point=times(s.point)))
        elif isinstance(s, Disc):
            shapes.append(replace(s, center=times(s.center), radius=s.radius * k))
        elif isinstance(s, Box):
            pose = s.world_from_box.copy()
            pose[:3, 3] *= k
            shapes.append(replace(s, half_size=times(s.half_size), world_from_box=pose))
    view = scene.view
    assert view is not None and view.near is not None
    height = view.orthographic_height
    return replace(
        scene,
        shapes=tuple(shapes),  # type: ignore[arg-type]
        lights=Lights(),
        view=replace(
            view,
            eye=times(view.eye),
            target=times(view.target),
            near=view.near * k,
            orthographic_height=None if height is None else height * k,
        ),
    )

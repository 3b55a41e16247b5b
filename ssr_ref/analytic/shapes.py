"""Spheres, planes, discs and boxes as data: world space, float64, a material each.

A shape has an outside: away from a sphere's or a box's centre, and where the normal of a plane or a
disc points. What is met from the outside is its front. As with triangles, a back is drawn only if
the material is double-sided.

Surfaces are numbered through the scene in the order of the shapes, in the place of triangle ids:
one for a sphere, plane or disc, six for a box (−x, +x, −y, +y, −z, +z of its own axes).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, TypeAlias

import numpy as np

from .. import transforms
from ..errors import SceneError
from ..typed import F64Array

Point: TypeAlias = tuple[float, float, float]

RIGID_TOLERANCE = 1e-12
"""How far a box's axes may be from unit and square: float64 rotations are to about 1e-15."""


def _point(shape: Shape, name: str) -> None:
    value = getattr(shape, name)
    try:
        x, y, z = (float(v) for v in value)
    except (TypeError, ValueError):
        x = np.nan
    if not (np.isfinite(x) and np.isfinite(y) and np.isfinite(z)):
        raise SceneError(f"'{shape.name}' has {name} {value}; expected three finite numbers")
    object.__setattr__(shape, name, (x, y, z))


def _positive(shape: Shape, name: str) -> None:
    value = float(getattr(shape, name))
    if not (np.isfinite(value) and value > 0.0):
        raise SceneError(f"'{shape.name}' has {name} {value:g}; expected a finite number above 0")
    object.__setattr__(shape, name, value)


def _direction(shape: Plane | Disc) -> None:
    _point(shape, "normal")
    if not np.isfinite(transforms.normalized3(shape.normal)[0]):
        raise SceneError(f"'{shape.name}' has normal {shape.normal}; expected one that is not zero")


@dataclass(frozen=True, slots=True)
class Sphere:
    """A solid ball. radius in scene units, above 0. material: index into the scene's."""

    center: Point
    radius: float
    material: int = 0
    name: str = "sphere"
    surfaces: ClassVar[int] = 1

    def __post_init__(self) -> None:
        _point(self, "center")
        _positive(self, "radius")

    def bounds(self) -> tuple[F64Array, F64Array]:
        """Least and greatest world position, two (3,) arrays."""
        center = np.array(self.center)
        return center - self.radius, center + self.radius


@dataclass(frozen=True, slots=True)
class Plane:
    """An endless sheet through `point`; normal: of any length, towards its front."""

    point: Point
    normal: Point
    material: int = 0
    name: str = "plane"
    surfaces: ClassVar[int] = 1

    def __post_init__(self) -> None:
        _point(self, "point")
        _direction(self)

    def bounds(self) -> tuple[F64Array, F64Array]:
        """The given point alone: an endless shape has no bounds."""
        return np.array(self.point), np.array(self.point)


@dataclass(frozen=True, slots=True)
class Disc:
    """A round sheet; normal: of any length, towards its front. The rim belongs to it."""

    center: Point
    normal: Point
    radius: float
    material: int = 0
    name: str = "disc"
    surfaces: ClassVar[int] = 1

    def __post_init__(self) -> None:
        _point(self, "center")
        _direction(self)
        _positive(self, "radius")

    def bounds(self) -> tuple[F64Array, F64Array]:
        """Least and greatest world position, two (3,) arrays."""
        n = np.array(transforms.normalized3(self.normal))
        reach = self.radius * np.sqrt(np.maximum(0.0, 1.0 - n * n))
        center = np.array(self.center)
        return center - reach, center + reach


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """A solid box about the origin of its own axes.

    half_size: half the length along each own axis, above 0. world_from_box: (4, 4) float64,
    a rotation and a translation, acting on column vectors.
    """

    half_size: Point
    world_from_box: F64Array = field(default_factory=transforms.identity)
    material: int = 0
    name: str = "box"
    surfaces: ClassVar[int] = 6

    def __post_init__(self) -> None:
        _point(self, "half_size")
        if not min(self.half_size) > 0.0:
            raise SceneError(
                f"'{self.name}' has half_size {self.half_size}; expected three numbers above 0"
            )
        m = np.array(self.world_from_box, np.float64)
        if m.shape != (4, 4) or not np.isfinite(m).all() or tuple(m[3]) != (0.0, 0.0, 0.0, 1.0):
            raise SceneError(
                f"'{self.name}' has the pose {m.tolist()}; expected a finite 4 × 4 matrix with "
                "the last row [0, 0, 0, 1]"
            )
        for i in range(3):
            for j in range(3):
                product = float(m[0, i] * m[0, j] + m[1, i] * m[1, j] + m[2, i] * m[2, j])
                if abs(product - (i == j)) > RIGID_TOLERANCE:
                    raise SceneError(
                        f"'{self.name}' has pose columns {i} and {j} with the dot product "
                        f"{product:.6g}; expected a rotation: put sizes into half_size"
                    )
        m.setflags(write=False)
        object.__setattr__(self, "world_from_box", m)

    @staticmethod
    def between(
        low: Sequence[float], high: Sequence[float], material: int = 0, name: str = "box"
    ) -> Box:
        """The box along the world's axes with these two corners."""
        pairs = [(float(a), float(b)) for a, b in zip(low, high, strict=True)]
        middle = transforms.translation(*((a + b) / 2.0 for a, b in pairs))
        x, y, z = ((b - a) / 2.0 for a, b in pairs)
        return Box((x, y, z), middle, material, name)

    def bounds(self) -> tuple[F64Array, F64Array]:
        """Least and greatest world position, two (3,) arrays."""
        m, center = np.abs(self.world_from_box), self.world_from_box[:3, 3]
        h = self.half_size
        reach = m[:3, 0] * h[0] + m[:3, 1] * h[1] + m[:3, 2] * h[2]
        return center - reach, center + reach


Shape: TypeAlias = Sphere | Plane | Disc | Box
SHAPES = (Sphere, Plane, Disc, Box)

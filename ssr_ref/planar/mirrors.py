"""A flat mirror as data: its plane, and the triangles whose pixels show its image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import transforms
from ..errors import SceneError
from ..raster.geometry import Geometry
from ..typed import BoolArray, F64Array, I32Array

FLAT = 2.0**-20
"""How far a vertex may lie from its mirror's plane, as a share of the scene's radius: about 1e-6,
above the rounding of float32 vertices."""


@dataclass(frozen=True, slots=True, eq=False)
class PlanarMirror:
    """The plane through `point_ws` with unit normal `normal_ws`, either way round.

    triangles: (n,) int32 ids of what the mirror is made of, in ascending order. They are left out
    of the mirror's own image. Raises SceneError for a zero normal or a negative id.
    """

    point_ws: tuple[float, float, float]
    normal_ws: tuple[float, float, float]
    triangles: I32Array

    def __post_init__(self) -> None:
        x, y, z = (float(c) for c in self.point_ws)
        normal = transforms.normalized3(self.normal_ws)
        if not np.isfinite((x, y, z, *normal)).all():
            raise SceneError(
                f"a mirror has point {self.point_ws} and normal {self.normal_ws}; expected finite "
                "numbers and a normal that is not zero"
            )
        triangles = np.unique(np.array(self.triangles, np.int32))
        if len(triangles) and triangles[0] < 0:
            raise SceneError(f"a mirror has triangle {triangles[0]}; expected ids of 0 or more")
        triangles.setflags(write=False)
        object.__setattr__(self, "point_ws", (x, y, z))
        object.__setattr__(self, "normal_ws", normal)
        object.__setattr__(self, "triangles", triangles)

    @property
    def offset(self) -> float:
        """d of the plane n·x + d = 0."""
        n, p = self.normal_ws, self.point_ws
        return -(n[0] * p[0] + n[1] * p[1] + n[2] * p[2])

    def distance(self, points: F64Array) -> F64Array:
        """Signed distance of points (..., 3) from the plane, above 0 where the normal points.

        From differences to the mirror's own point, so that a plane far from the origin costs no
        digits.
        """
        n, p = self.normal_ws, self.point_ws
        with np.errstate(invalid="ignore", over="ignore"):
            x, y, z = (points[..., i] - p[i] for i in range(3))
            return np.asarray((x * n[0] + y * n[1]) + z * n[2])


def corners_within(geometry: Geometry, mirror: PlanarMirror, reach: float) -> BoolArray:
    """(nt,) whether all three corners of a triangle lie within `reach` of the mirror's plane."""
    near = np.abs(mirror.distance(geometry.positions_ws)) <= reach
    return np.asarray(near[geometry.faces].all(axis=1))


def mirror_on_plane(
    geometry: Geometry,
    point_ws: Sequence[float],
    normal_ws: Sequence[float],
    reach: float,
) -> PlanarMirror:
    """A mirror of all triangles whose corners lie within `reach` (scene units) of a given plane.

    For mirrors that are known beforehand, whatever their material. Raises SceneError for a zero
    normal, or if no triangle lies there.
    """
    p, n = tuple(map(float, point_ws)), tuple(map(float, normal_ws))
    plane = PlanarMirror((p[0], p[1], p[2]), (n[0], n[1], n[2]), np.empty(0, np.int32))
    found = np.flatnonzero(corners_within(geometry, plane, reach))
    if not len(found):
        raise SceneError(
            f"no triangle lies within {reach:g} of the plane through {p} with normal {n}; expected "
            "at least one: move the plane or widen the reach"
        )
    return PlanarMirror(plane.point_ws, plane.normal_ws, found.astype(np.int32))

"""A scene of closed-form shapes, with what the pipeline asks of any scene."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import SceneError
from ..scene import Lights, Material, radius_of_bounds
from ..typed import F64Array
from .shapes import SHAPES, Shape

if TYPE_CHECKING:
    from ..camera import View


@dataclass(frozen=True, slots=True, eq=False)
class AnalyticScene:
    """Shapes without triangles, their materials, lights, and the view they were made for (if any).

    An *object* is one shape. notes: lines that a frame repeats among its warnings.
    Raises SceneError for no shape, an index out of range, or a material with textures or a mask.
    """

    shapes: tuple[Shape, ...]
    materials: tuple[Material, ...] = (Material(),)
    lights: Lights = field(default_factory=Lights)
    view: View | None = None
    name: str = "analytic"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "shapes", tuple(self.shapes))
        object.__setattr__(self, "materials", tuple(self.materials))
        if not self.shapes:
            raise SceneError(f"scene '{self.name}' has no shape; expected at least one")
        for shape in self.shapes:
            if not isinstance(shape, SHAPES):
                raise SceneError(
                    f"scene '{self.name}' holds a {type(shape).__name__}; expected "
                    f"{', '.join(kind.__name__ for kind in SHAPES)}"
                )
            if not 0 <= shape.material < len(self.materials):
                raise SceneError(
                    f"'{shape.name}' uses material {shape.material} of {len(self.materials)}; "
                    f"expected 0 to {len(self.materials) - 1}"
                )
        for material in self.materials:
            if any(t is not None for t in material.textures) or material.alpha_cutoff is not None:
                raise SceneError(
                    f"material '{material.name}' has a texture or an alpha mask; closed-form "
                    "shapes have no texture coordinates: use factors, or a mesh scene"
                )

    @property
    def nodes(self) -> tuple[Shape, ...]:
        """The objects by object id, each with a name."""
        return self.shapes

    @property
    def triangle_count(self) -> int:
        """Numbered surfaces, which stand in the place of triangles: 6 a box, else 1."""
        return sum(shape.surfaces for shape in self.shapes)

    def world_bounds(self) -> tuple[F64Array, F64Array]:
        """Least and greatest world position, two (3,) arrays; a plane counts as its point."""
        lows, highs = zip(*(shape.bounds() for shape in self.shapes), strict=True)
        return np.minimum.reduce(lows), np.maximum.reduce(highs)

    def radius(self) -> float:
        """Half the diagonal of the world bounds, rounded to a power of two (nearest in log)."""
        return radius_of_bounds(*self.world_bounds())

    def with_lights(self, lights: Lights) -> AnalyticScene:
        """The same scene under other lights."""
        return replace(self, lights=lights)

    def content_sha256(self) -> str:
        """Hash of everything that is drawn: shapes, materials, lights (not names)."""
        from .scene_json import scene_to_json

        data = scene_to_json(self)
        drawn = [
            [{k: v for k, v in item.items() if k != "name"} for item in data[group]]
            for group in ("shapes", "materials")
        ]
        text = json.dumps([*drawn, self.lights.to_json()], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

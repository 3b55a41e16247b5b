"""scene.json: a closed-form scene as text that reads back to the same bits.

Floats are written with the 17 digits that float64 needs. Lights and camera travel in their own
files of a bundle. Infinite numbers do not occur: shapes and materials are finite.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import SceneError
from ..scene import Material
from .scene import AnalyticScene
from .shapes import SHAPES, Shape

FORMAT = "ssr_ref analytic scene"
_FACTORS = (
    "base_color", "metallic", "roughness", "emissive", "reflectivity", "double_sided", "unlit",
)  # fmt: skip
_KINDS = {kind.__name__.lower(): kind for kind in SHAPES}


def scene_to_json(scene: AnalyticScene) -> dict[str, Any]:
    """A dictionary that `scene_from_json` reads back exactly, lights and view left out."""
    return {
        "format": FORMAT,
        "name": scene.name,
        "shapes": [_shape_to_json(shape) for shape in scene.shapes],
        "materials": [_material_to_json(m) for m in scene.materials],
    }


def _material_to_json(material: Material) -> dict[str, Any]:
    own = {} if material.thickness is None else {"thickness": material.thickness}
    return {"name": material.name, **{n: getattr(material, n) for n in _FACTORS}, **own}


def _shape_to_json(shape: Shape) -> dict[str, Any]:
    values = {name: getattr(shape, name) for name in type(shape).__dataclass_fields__}
    values.pop("surfaces", None)
    entry = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in values.items()}
    return {"type": type(shape).__name__.lower(), **entry}


def scene_from_json(data: Any) -> AnalyticScene:
    """The scene of `scene_to_json`'s dictionary; raises SceneError for anything else."""
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise SceneError(f"this is not a closed-form scene; expected 'format': '{FORMAT}'")
    try:
        return AnalyticScene(
            shapes=tuple(_shape_from_json(entry) for entry in data["shapes"]),
            materials=tuple(Material(**entry) for entry in data["materials"]),
            name=str(data["name"]),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise SceneError(
            f"the closed-form scene is incomplete ({error}); expected what a bundle's scene.json "
            "holds"
        ) from None


def _shape_from_json(entry: dict[str, Any]) -> Shape:
    values = dict(entry)
    kind = values.pop("type")
    if kind not in _KINDS:
        raise SceneError(f"'{kind}' is no closed-form shape; expected one of {', '.join(_KINDS)}")
    return _KINDS[kind](**values)

"""Built-in scenes, made by code alone, and two helpers for scenes from files.

Scene classes compile through Numba's modules, so they are imported on first use.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from ..errors import SceneError, SettingsError

if TYPE_CHECKING:
    from ..camera import View
    from ..scene import Scene
    from ..typed import F64Array

DEFAULT_TESSELLATION = 16
MAX_TESSELLATION = 256
MIRROR_FLOOR = "added mirror floor"
"""Name of the node that `with_mirror_floor` adds and `framed_view` does not frame."""


class Builtin(NamedTuple):
    """A built-in scene: one line on what it is for, and what makes it of the tessellation."""

    description: str
    make: Callable[[int], Scene]


def _module(name: str) -> Callable[[int], Scene]:
    """The function of the module and the name `name`, imported when it is called."""

    def make(tessellation: int) -> Scene:
        function = getattr(import_module(f".{name}", __name__), name)
        return cast("Scene", function(tessellation))

    return make


BUILTIN: dict[str, Builtin] = {
    name: Builtin(description, _module(name))
    for name, description in {
        "teapot": "Newell's teapot must reflect its own spout, which no environment map can show",
        "poles": "posts from thick to one pixel thin: what a large step or stride misses",
        "spheres": "mirror, metal and diffuse spheres: curved and mutual reflections, contact",
        "corridor": "two facing mirrors: reflections of reflections, and what is hidden or unseen",
        "steps": "boxes floating over a mirror: a gap must show under each, so thickness matters",
        "water": "a city behind a rippled basin: grazing and long rays, near and far depths",
        "curved": "a mirror ball and a mirror cylinder: neighbouring rays end far apart",
        "textured": "wraps, a transform, 16 bits, leaf masks, emission and a metal map by a pool",
    }.items()
}
"""Built-in scenes by name; each is made by the function of that name in the module of that name."""


def build(name: str, tessellation: int | None = None) -> Scene:
    """The built-in scene `name`; tessellation 1 to 256 scales its triangle count, default 16.

    Raises SceneError for an unknown name, SettingsError for a tessellation out of range.
    """
    if name not in BUILTIN:
        raise SceneError(
            f"there is no built-in scene '{name}'; expected one of {', '.join(sorted(BUILTIN))}"
        )
    n = DEFAULT_TESSELLATION if tessellation is None else tessellation
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or not 1 <= n <= MAX_TESSELLATION:
        raise SettingsError(
            f"tessellation is {n}; expected a whole number, 1 to {MAX_TESSELLATION}"
        )
    return BUILTIN[name].make(int(n))


def with_mirror_floor(scene: Scene) -> Scene:
    """The scene with a square mirror exactly under it, as one more node.

    It faces up at the least y of the world bounds, 8 half diagonals wide, centred below them. The
    mesh is the square ±1 at y = 0; size and place are in the node's float64 transform, so y is
    exact. A scene that has such a node already is returned as it is.
    """
    from ..scene import Material, Mesh, Node
    from .shapes import quad

    if any(node.name == MIRROR_FLOOR for node in scene.nodes):
        return scene
    low, high = scene.world_bounds()
    centre, half_diagonal = _ball(low, high)

    place = np.zeros((4, 4))
    place[0, 0] = place[1, 1] = place[2, 2] = 4.0 * half_diagonal
    place[:, 3] = (centre[0], low[1], centre[2], 1.0)
    material = Material(MIRROR_FLOOR, (0.9, 0.9, 0.9), metallic=0.9, roughness=0.0)
    square = quad([(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)], material=len(scene.materials))
    return replace(
        scene,
        meshes=(*scene.meshes, Mesh(MIRROR_FLOOR, (square,))),
        nodes=(*scene.nodes, Node(MIRROR_FLOOR, len(scene.meshes), place)),
        materials=(*scene.materials, material),
    )


VIEW_FROM = (0.48, 0.36, 0.8)
"""Unit direction from the target to the eye: 31° to the right of the front, 21° up."""

ONE_OVER_SIN_20 = 2.923804400163087
"""1 / sin 20°: a sphere of radius 1 at this distance just fits a field of view of 40°."""

MARGIN = 1.06
"""Free space about the framed sphere, as a factor on the distance."""


def framed_view(scene: Scene) -> View:
    """A three-quarter view from slightly above that shows everything but an added mirror floor.

    The bounding sphere fits a vertical field of view of 40° with a margin (images at least as wide
    as high). With an added mirror floor the view moves down and back, so that it also holds the
    mirror image down to one radius below the floor.
    """
    shown = tuple(node for node in scene.nodes if node.name != MIRROR_FLOOR)
    mirrored = 0 < len(shown) < len(scene.nodes)
    low, high = (replace(scene, nodes=shown) if mirrored else scene).world_bounds()
    target, radius = _ball(low, high)
    if mirrored:
        # The least ball about the bounding sphere and the point its radius below the floor.
        drop = (target[1] - float(low[1])) / 2.0
        radius = radius + drop
        target = (target[0], target[1] - drop, target[2])
    return _view_of_ball(target, radius)


def view_of_bounds(low: F64Array, high: F64Array) -> View:
    """The same view of whatever lies within these bounds, two (3,) arrays."""
    return _view_of_ball(*_ball(low, high))


def _view_of_ball(target: tuple[float, float, float], radius: float) -> View:
    from ..camera import View

    distance = MARGIN * ONE_OVER_SIN_20 * radius
    eye = tuple(t + distance * d for t, d in zip(target, VIEW_FROM))
    return View(eye=(eye[0], eye[1], eye[2]), target=target, fov_y_degrees=40.0)


def _ball(low: F64Array, high: F64Array) -> tuple[tuple[float, float, float], float]:
    """Centre and half diagonal of bounds; a single point counts as radius 1."""
    h = [(float(b) - float(a)) / 2.0 for a, b in zip(low, high)]
    largest = max(h)
    centre = [float(a) + v for a, v in zip(low, h)]
    if largest == 0.0:
        return (centre[0], centre[1], centre[2]), 1.0
    # Scaled by the largest side, so that no square under- or overflows.
    x, y, z = (v / largest for v in h)
    radius = largest * float(np.sqrt(x * x + y * y + z * z))
    return (centre[0], centre[1], centre[2]), radius

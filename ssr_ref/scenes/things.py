"""Small solids that stand on the floor of several scenes: boxes, posts and spheres."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

from .. import transforms
from ..scene import Material, Mesh, Node
from ..typed import Rgb
from . import shapes

TURN = (0.0, 7.0 / 25.0, 0.0, 24.0 / 25.0)
"""How boxes are turned: a unit quaternion with rational components, 32.5° about y."""


class Thing(NamedTuple):
    """A solid on the floor: place, half width, height (scene units), colour, metallic factor.

    A sphere's height is twice its half width.
    """

    name: str
    kind: Literal["box", "post", "sphere"]
    x: float
    z: float
    half: float
    height: float
    color: Rgb
    metallic: float = 0.0


def add(
    things: Sequence[Thing],
    meshes: list[Mesh],
    nodes: list[Node],
    materials: list[Material],
    *,
    sphere_frequency: int,
    post_segments: int,
) -> None:
    """Append a mesh, a node and a material for each thing; the lowest point of each is y = 0."""
    for thing in things:
        material, half = len(materials), thing.half
        place = transforms.translation(thing.x, 0.0, thing.z)
        if thing.kind == "sphere":
            shape = shapes.sphere(half, sphere_frequency, material=material)
            place[1, 3] = -float(shape.positions[:, 1].min())
        elif thing.kind == "post":
            shape = shapes.round_post(half, thing.height, post_segments, material=material)
        else:
            low, high = (-half, 0.0, -half), (half, thing.height, half)
            shape = shapes.box(low, high, material=material)
            place = transforms.multiply(place, transforms.from_quaternion(*TURN))
        roughness = 0.0 if thing.metallic > 0.0 else 0.7
        materials.append(
            Material(thing.name, thing.color, metallic=thing.metallic, roughness=roughness)
        )
        nodes.append(Node(thing.name, len(meshes), place))
        meshes.append(Mesh(thing.name, (shape,)))

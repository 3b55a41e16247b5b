"""Thin posts on a mirror floor before a striped wall: what a large step or stride misses.

Posts are round or square, 0.2 down to 0.006 units thick; the thinnest is about one pixel wide in
the default view at 960×540. The camera is low, so the floor's rays graze.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .. import transforms
from ..camera import View
from ..scene import DirectionalLight, Lights, Material, Mesh, Node, Primitive, Scene
from ..typed import Rgb
from . import shapes


class Post(NamedTuple):
    """One post: where it stands, how thick and high it is (scene units)."""

    name: str
    round: bool
    x: float
    z: float
    width: float
    height: float
    color: Rgb


POSTS = (
    Post("red, round, 0.2", True, -1.65, 0.1, 0.2, 1.2, (0.85, 0.08, 0.06)),
    Post("yellow, square, 0.12", False, -1.15, -0.5, 0.12, 1.5, (0.9, 0.75, 0.05)),
    Post("green, round, 0.08", True, -0.75, 0.6, 0.08, 0.9, (0.1, 0.65, 0.15)),
    Post("magenta, square, 0.05", False, -0.3, -0.2, 0.05, 1.3, (0.8, 0.1, 0.6)),
    Post("cyan, round, 0.03", True, 0.05, 0.8, 0.03, 0.8, (0.05, 0.7, 0.75)),
    Post("orange, square, 0.02", False, 0.45, 0.2, 0.02, 1.1, (0.95, 0.45, 0.05)),
    Post("white, round, 0.012", True, 0.95, -0.4, 0.012, 1.4, (0.9, 0.9, 0.9)),
    Post("black, square, 0.008", False, 1.25, 0.5, 0.008, 1.0, (0.02, 0.02, 0.02)),
    Post("violet, round, 0.006", True, 1.9, 0.0, 0.006, 1.2, (0.35, 0.1, 0.8)),
)
STRIPES: tuple[Rgb, ...] = ((0.75, 0.7, 0.58), (0.08, 0.22, 0.45), (0.4, 0.5, 0.12))
STRIPE_COUNT = 17
WALL_LOW, WALL_HIGH = (-3.7, 0.0, -1.5), (3.7, 1.7, -1.4)


def poles(tessellation: int = 16) -> Scene:
    """The scene; round posts have `tessellation` sides, rounded up to a multiple of 4."""
    materials = [
        Material("mirror floor", (0.85, 0.86, 0.88), metallic=0.9, roughness=0.0),
        Material("wall", (1.0, 1.0, 1.0), metallic=0.0, roughness=0.9),
    ]
    meshes = [
        Mesh("floor", (shapes.grid(4.0, 2.4, 2, 2, material=0),)),
        Mesh("wall", (striped_wall(material=1),)),
    ]
    nodes = [Node("floor", 0, transforms.translation(0.0, 0.0, 0.8)), Node("wall", 1)]
    for post in POSTS:
        half = post.width / 2.0
        if post.round:
            shape = shapes.round_post(half, post.height, tessellation, material=len(materials))
        else:
            low, high = (-half, 0.0, -half), (half, post.height, half)
            shape = shapes.box(low, high, material=len(materials))
        materials.append(Material(post.name, post.color, metallic=0.0, roughness=0.7))
        nodes.append(Node(post.name, len(meshes), transforms.translation(post.x, 0.0, post.z)))
        meshes.append(Mesh(post.name, (shape,)))

    lights = Lights(
        ambient=(0.35, 0.35, 0.37),
        directional=(
            DirectionalLight((-0.5, -1.0, -0.6), (0.6, 0.59, 0.55)),
            DirectionalLight((0.7, -0.3, -0.7), (0.25, 0.25, 0.3)),
        ),
    )
    view = View(eye=(0.15, 0.62, 4.2), target=(0.0, 0.28, 0.0), fov_y_degrees=36.0)
    return Scene(
        tuple(meshes), tuple(nodes), tuple(materials), lights=lights, view=view, name="poles"
    )


def striped_wall(*, material: int = 0) -> Primitive:
    """One closed box cut into upright stripes, each with its own vertices and colour."""
    edge = np.arange(STRIPE_COUNT + 1, dtype=np.float64) / STRIPE_COUNT
    xs = WALL_LOW[0] + (WALL_HIGH[0] - WALL_LOW[0]) * edge
    positions, faces, colors = [], [], []
    for i in range(STRIPE_COUNT):
        stripe = shapes.box((xs[i], *WALL_LOW[1:]), (xs[i + 1], *WALL_HIGH[1:]))
        # The first two quads are the sides −x and +x; only the wall's own ends have them.
        keep = np.ones(12, bool)
        keep[0:2], keep[2:4] = i == 0, i == STRIPE_COUNT - 1
        faces.append(stripe.faces[keep] + 8 * i)
        positions.append(stripe.positions)
        colors.append(np.tile(np.array(STRIPES[i % len(STRIPES)], np.float32), (8, 1)))
    return Primitive(
        np.concatenate(positions), np.concatenate(faces), material, colors=np.concatenate(colors)
    )

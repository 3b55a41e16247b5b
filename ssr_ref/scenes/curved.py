"""A mirror ball and a mirror cylinder on a checkered floor, with coloured objects around.

A curved mirror shrinks what it shows, so neighbouring rays end far apart on screen; the cylinder
does it in one direction only. The floor's checkers show how.
"""

from __future__ import annotations

from .. import transforms
from ..camera import View
from ..scene import DirectionalLight, Lights, Material, Mesh, Node, Scene
from . import shapes, things
from .things import Thing

BALL_RADIUS = 0.7
CYLINDER_RADIUS, CYLINDER_HEIGHT = 0.5, 1.6
FLOOR_TILES = ((0.85, 0.82, 0.74), (0.12, 0.2, 0.24))
WALL = ((0.0, (0.95, 0.5, 0.22)), (0.45, (0.6, 0.18, 0.2)), (1.0, (0.12, 0.06, 0.2)))
"""Colours of the back wall by share of its height."""

THINGS = (
    Thing("red post", "post", -2.05, 0.0, 0.16, 1.3, (0.85, 0.08, 0.06)),
    Thing("yellow box", "box", -1.62, 0.9, 0.22, 0.44, (0.95, 0.72, 0.05)),
    Thing("blue ball", "sphere", -0.35, 1.15, 0.2, 0.4, (0.08, 0.22, 0.85)),
    Thing("green post", "post", 0.08, 0.35, 0.1, 0.9, (0.1, 0.62, 0.2)),
    Thing("orange ball", "sphere", 0.62, 1.2, 0.17, 0.34, (0.98, 0.4, 0.04)),
    Thing("magenta box", "box", 1.62, 0.85, 0.18, 0.5, (0.8, 0.08, 0.5)),
    Thing("white post", "post", 2.1, 0.1, 0.13, 1.45, (0.9, 0.9, 0.88)),
)


def curved(tessellation: int = 16) -> Scene:
    """The scene; the mirror ball has 80 n² triangles, each coloured ball 20 ⌈n/2⌉².

    The mirror cylinder has 16 n, each of three posts 4 n; n is the tessellation.
    """
    n = tessellation
    materials = [
        Material("tiles", (1.0, 1.0, 1.0), metallic=0.0, roughness=0.8),
        Material("wall", (1.0, 1.0, 1.0), metallic=0.0, roughness=0.9),
        Material("mirror", (0.84, 0.86, 0.88), metallic=0.95, roughness=0.0),
    ]
    ball = shapes.sphere(BALL_RADIUS, 2 * n, material=2)
    ball_height = -float(ball.positions[:, 1].min())
    floor = shapes.checker(5.0, 2.5, 20, 10, FLOOR_TILES)
    wall = shapes.layered_box((-5.0, 0.0, -1.6), (5.0, 3.0, -1.5), WALL, material=1)
    cylinder = shapes.round_post(CYLINDER_RADIUS, CYLINDER_HEIGHT, 4 * n, material=2)
    meshes = [
        Mesh("floor", (floor,)),
        Mesh("wall", (wall,)),
        Mesh("mirror ball", (ball,)),
        Mesh("mirror cylinder", (cylinder,)),
    ]
    nodes = [
        Node("floor", 0, transforms.translation(0.0, 0.0, 1.0)),
        Node("wall", 1),
        Node("mirror ball", 2, transforms.translation(-0.95, ball_height, 0.0)),
        Node("mirror cylinder", 3, transforms.translation(1.1, 0.0, -0.1)),
    ]
    things.add(THINGS, meshes, nodes, materials, sphere_frequency=-(-n // 2), post_segments=n)

    lights = Lights(
        ambient=(0.34, 0.33, 0.34),
        directional=(
            DirectionalLight((-0.5, -1.0, -0.55), (0.6, 0.58, 0.54)),
            DirectionalLight((0.75, -0.3, -0.6), (0.2, 0.2, 0.26)),
        ),
    )
    view = View(eye=(0.1, 1.3, 5.6), target=(0.05, 0.58, 0.0), fov_y_degrees=29.0)
    return Scene(
        tuple(meshes), tuple(nodes), tuple(materials), lights=lights, view=view, name="curved"
    )

"""Spheres of many sizes and materials on a mirror floor: curved reflectors and contact.

Mirrors see mirrors (one bounce: a reflection shows what is reflected without its own reflection),
small spheres give short rays, and every sphere touches the floor at y = 0 exactly.
"""

from __future__ import annotations

from typing import NamedTuple

from .. import transforms
from ..camera import View
from ..scene import DirectionalLight, Lights, Material, Mesh, Node, Scene
from ..typed import Rgb
from . import shapes


class Ball(NamedTuple):
    """One sphere: place on the floor, radius (scene units), material; small ones are coarser."""

    name: str
    x: float
    z: float
    radius: float
    color: Rgb
    metallic: float = 0.0

    @property
    def small(self) -> bool:
        return self.radius < 0.25


BALLS = (
    Ball("chrome", 0.0, -0.1, 0.75, (0.84, 0.86, 0.88), 0.9),
    Ball("gold", 1.42, 0.2, 0.45, (1.0, 0.6, 0.13), 0.35),
    Ball("red", -1.4, 0.1, 0.5, (0.78, 0.06, 0.07)),
    Ball("teal", -0.7, 0.95, 0.22, (0.05, 0.55, 0.5), 0.4),
    Ball("white", 0.62, 1.0, 0.2, (0.9, 0.88, 0.84)),
    Ball("violet", 2.0, 0.9, 0.16, (0.4, 0.16, 0.7)),
    Ball("orange", 0.02, 1.2, 0.13, (0.98, 0.42, 0.04)),
    Ball("lime", -1.62, 1.05, 0.1, (0.45, 0.8, 0.1)),
)
WALL = ((0.0, (0.95, 0.62, 0.42)), (0.3, (0.55, 0.36, 0.42)), (1.0, (0.08, 0.12, 0.34)))
"""Colours of the back wall by share of its height: warm haze to deep blue."""


def spheres(tessellation: int = 16) -> Scene:
    """The scene; a large sphere has 20 n² triangles, a small one 20 ⌈n/2⌉²: 85 n² + 32 for even n.

    n is the tessellation.
    """
    materials = [
        Material("mirror floor", (0.86, 0.87, 0.9), metallic=0.95, roughness=0.0),
        Material("wall", (1.0, 1.0, 1.0), metallic=0.0, roughness=0.9),
    ]
    floor = shapes.box((-6.0, -0.1, -2.5), (6.0, 0.0, 6.0))
    wall = shapes.layered_box((-6.0, 0.0, -2.4), (6.0, 3.2, -2.3), WALL, material=1)
    meshes = [Mesh("floor", (floor,)), Mesh("wall", (wall,))]
    nodes = [Node("floor", 0), Node("wall", 1)]
    for ball in BALLS:
        frequency = -(-tessellation // 2) if ball.small else tessellation
        shape = shapes.sphere(ball.radius, frequency, material=len(materials))
        place = transforms.translation(ball.x, -float(shape.positions[:, 1].min()), ball.z)
        materials.append(Material(ball.name, ball.color, metallic=ball.metallic, roughness=0.0))
        nodes.append(Node(ball.name, len(meshes), place))
        meshes.append(Mesh(ball.name, (shape,)))

    lights = Lights(
        ambient=(0.3, 0.31, 0.34),
        directional=(
            DirectionalLight((-0.55, -1.0, -0.6), (0.62, 0.6, 0.56)),
            DirectionalLight((0.8, -0.25, -0.55), (0.16, 0.18, 0.24)),
        ),
    )
    view = View(eye=(0.3, 0.75, 6.2), target=(0.14, 0.02, 0.0), fov_y_degrees=28.5)
    return Scene(
        tuple(meshes), tuple(nodes), tuple(materials), lights=lights, view=view, name="spheres"
    )

"""A stair of boxes that float over a mirror floor: what thickness does.

Behind each box the depth buffer says nothing. With the true thickness a gap shows under every box
and its mirror image; with a constant one that is too large the boxes reach down to the floor.
"""

from __future__ import annotations

from .. import transforms
from ..camera import View
from ..scene import DirectionalLight, Lights, Material, Mesh, Node, Scene
from ..typed import Rgb
from . import shapes

STEPS = 9
FIRST_GAP, RISE = 0.125, 0.125
"""Height of the lowest step's underside, and how much higher each next one is. Exact in binary."""
SPACING = 0.4375
HALF_SIZE = (0.203125, 0.046875, 0.40625)
COLORS: tuple[Rgb, ...] = (
    (0.82, 0.06, 0.1),
    (0.93, 0.25, 0.04),
    (0.95, 0.5, 0.03),
    (0.9, 0.75, 0.05),
    (0.45, 0.72, 0.08),
    (0.06, 0.58, 0.3),
    (0.03, 0.5, 0.62),
    (0.08, 0.25, 0.78),
    (0.36, 0.12, 0.7),
)
WALL = ((0.0, (0.8, 0.82, 0.8)), (0.4, (0.4, 0.5, 0.55)), (1.0, (0.06, 0.1, 0.16)))
"""Colours of the back wall by share of its height."""


def gap(step: int) -> float:
    """Distance from the floor to the underside of a step, scene units."""
    return FIRST_GAP + RISE * step


def steps(tessellation: int = 16) -> Scene:
    """The scene; nothing but the pillar is round: it has 4 n triangles, n the tessellation."""
    materials = [
        Material("mirror floor", (0.86, 0.87, 0.9), metallic=0.95, roughness=0.0),
        Material("wall", (1.0, 1.0, 1.0), metallic=0.0, roughness=0.9),
        Material("pillar", (0.85, 0.83, 0.78), metallic=0.0, roughness=0.8),
    ]
    wall = shapes.layered_box((-6.0, 0.0, -1.6), (6.0, 3.0, -1.5), WALL, material=1)
    meshes = [
        Mesh("floor", (shapes.box((-6.0, -0.1, -1.7), (6.0, 0.0, 6.5)),)),
        Mesh("wall", (wall,)),
        Mesh("pillar", (shapes.round_post(0.15, 1.0, tessellation, material=2),)),
    ]
    nodes = [
        Node("floor", 0),
        Node("wall", 1),
        Node("pillar", 2, transforms.translation(-2.3, 0.0, -0.25)),
    ]
    high = HALF_SIZE
    low = tuple(-v for v in high)
    for i, color in enumerate(COLORS):
        name = f"step {i + 1}"
        x = SPACING * (i - (STEPS - 1) / 2.0)
        place = transforms.translation(x, gap(i) + HALF_SIZE[1], 0.0)
        nodes.append(Node(name, len(meshes), place))
        meshes.append(Mesh(name, (shapes.box(low, high, material=len(materials)),)))
        materials.append(Material(name, color, metallic=0.0, roughness=0.7))

    lights = Lights(
        ambient=(0.34, 0.34, 0.36),
        directional=(
            DirectionalLight((-0.45, -1.0, -0.6), (0.58, 0.57, 0.54)),
            DirectionalLight((0.8, -0.3, -0.6), (0.2, 0.2, 0.25)),
        ),
    )
    view = View(eye=(-0.75, 0.8, 6.2), target=(-0.2, 0.03, 0.0), fov_y_degrees=28.0)
    return Scene(
        tuple(meshes), tuple(nodes), tuple(materials), lights=lights, view=view, name="steps"
    )

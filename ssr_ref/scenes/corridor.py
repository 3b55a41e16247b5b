"""Two facing mirrors seen along a corridor: reflections of reflections, and what is off screen.

The inner faces of the walls are the planes x = ±HALF_WIDTH, exactly parallel. A mirror sees the
other mirror's own colour only (one bounce), and the sides of things that the camera does not see
are missing.
"""

from __future__ import annotations

from .. import transforms
from ..camera import View
from ..scene import DirectionalLight, Lights, Material, Mesh, Node, Primitive, Scene
from . import shapes, things
from .things import Thing

HALF_WIDTH = 1.25
NEAR_Z, FAR_Z = 3.0, -6.0
HEIGHT = 2.5
THICKNESS = 0.125
PLINTH, LINTEL = 0.25, 2.25
"""Heights between which the walls are mirrors."""
FLOOR_TILES = ((0.72, 0.66, 0.55), (0.3, 0.08, 0.06))
DOOR = ((0.0, (0.9, 0.4, 0.12)), (0.5, (0.95, 0.68, 0.3)), (1.0, (0.98, 0.9, 0.66)))
"""Colours of the lit end of the corridor by share of its height."""

THINGS = (
    Thing("blue ball", "sphere", -0.55, 0.1, 0.3, 0.6, (0.06, 0.2, 0.8)),
    Thing("yellow box", "box", 0.6, -0.4, 0.22, 0.7, (0.95, 0.7, 0.05)),
    Thing("red post", "post", -0.6, -1.9, 0.14, 1.7, (0.8, 0.06, 0.05)),
    Thing("green ball", "sphere", 0.45, -2.4, 0.35, 0.7, (0.08, 0.55, 0.16)),
    Thing("white post", "post", 0.6, -4.2, 0.14, 1.9, (0.9, 0.88, 0.82)),
    Thing("violet box", "box", -0.55, -4.4, 0.25, 0.6, (0.4, 0.1, 0.65)),
)


def corridor(tessellation: int = 16) -> Scene:
    """The scene; each of two spheres has 20 n² triangles, each of two posts 4 n.

    n is the tessellation.
    """
    materials = [
        Material("mirror", (0.85, 0.9, 0.9), metallic=0.95, roughness=0.0),
        Material("frame", (0.42, 0.24, 0.1), metallic=0.0, roughness=0.8),
        Material("floor", (1.0, 1.0, 1.0), metallic=0.0, roughness=0.8),
        Material("ceiling", (0.62, 0.6, 0.56), metallic=0.0, roughness=0.9),
        Material("end wall", (1.0, 1.0, 1.0), metallic=0.0, roughness=0.9),
        Material("lamp", (0.9, 0.9, 0.9), emissive=(1.0, 0.93, 0.78), roughness=0.9),
    ]
    length = NEAR_Z - FAR_Z
    floor = shapes.checker(HALF_WIDTH, length / 2.0, 5, 18, FLOOR_TILES, material=2)
    end = shapes.layered_box(
        (-HALF_WIDTH, 0.0, FAR_Z - THICKNESS), (HALF_WIDTH, HEIGHT, FAR_Z), DOOR, material=4
    )
    ceiling = shapes.box(
        (-HALF_WIDTH, HEIGHT, FAR_Z), (HALF_WIDTH, HEIGHT + THICKNESS, NEAR_Z), material=3
    )
    lamp = shapes.box((-0.3, HEIGHT - 0.0625, -0.09375), (0.3, HEIGHT, 0.09375), material=5)
    meshes = [
        Mesh("floor", (floor,)),
        Mesh("ceiling", (ceiling,)),
        Mesh("end wall", (end,)),
        Mesh("lamp", (lamp,)),
        Mesh("left mirror", (_wall_part(-1.0, PLINTH, LINTEL, 0),)),
        Mesh("right mirror", (_wall_part(1.0, PLINTH, LINTEL, 0),)),
        Mesh("left frame", (_wall_part(-1.0, 0.0, PLINTH, 1), _wall_part(-1.0, LINTEL, HEIGHT, 1))),
        Mesh("right frame", (_wall_part(1.0, 0.0, PLINTH, 1), _wall_part(1.0, LINTEL, HEIGHT, 1))),
    ]
    nodes = [
        Node("floor", 0, transforms.translation(0.0, 0.0, (NEAR_Z + FAR_Z) / 2.0)),
        Node("ceiling", 1),
        Node("end wall", 2),
        *(Node(f"lamp {i + 1}", 3, transforms.translation(0.0, 0.0, -2.0 * i)) for i in range(3)),
        *(Node(meshes[i].name, i) for i in range(4, 8)),
    ]
    things.add(
        THINGS,
        meshes,
        nodes,
        materials,
        sphere_frequency=tessellation,
        post_segments=tessellation,
    )

    lights = Lights(
        ambient=(0.36, 0.35, 0.34),
        directional=(
            DirectionalLight((-0.35, -1.0, -0.6), (0.5, 0.48, 0.44)),
            DirectionalLight((0.5, 0.5, -0.7), (0.24, 0.22, 0.2)),
        ),
    )
    view = View(eye=(0.3, 1.3, 2.9), target=(-0.1, 1.0, -3.0), fov_y_degrees=52.0)
    return Scene(
        tuple(meshes), tuple(nodes), tuple(materials), lights=lights, view=view, name="corridor"
    )


def _wall_part(side: float, low: float, high: float, material: int) -> Primitive:
    """The part of a wall between two heights; side −1 is left, 1 right."""
    x = (side * HALF_WIDTH, side * (HALF_WIDTH + THICKNESS))
    return shapes.box((min(x), low, FAR_Z), (max(x), high, NEAR_Z), material=material)

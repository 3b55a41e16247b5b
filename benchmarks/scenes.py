"""One scene at 5 thousand, 100 thousand and 1 million triangles: spheres and boxes on a mirror."""

from __future__ import annotations

from ssr_ref import Material, Mesh, Node, Scene, View, transforms
from ssr_ref.scenes import shapes

GOAL_MS = {"S": 10.0, "M": 21.0, "L": 55.0}
"""G-buffer with back depth at 1920×1080 on one core, of a prototype; reach twice that or better."""


def scene(name: str) -> Scene:
    """S: 5 k, M: 100 k, L: 1 M triangles; covers more than 55 % of the picture."""
    frequency, rows = {"S": (5, 3), "M": (24, 3), "L": (74, 3)}[name]
    sphere = Mesh("sphere", (shapes.sphere(0.45, frequency, material=1),))
    box = Mesh("box", (shapes.box((-0.15, 0.0, -0.15), (0.15, 0.6, 0.15), material=2),))
    corners = ((-20, 0, 20), (20, 0, 20), (20, 0, -20), (-20, 0, -20))
    floor = Mesh("floor", (shapes.quad(corners),))
    nodes = [Node("floor", 2)]
    for i in range(rows):
        for j in range(rows):
            x, z = 1.1 * (i - (rows - 1) / 2), 1.1 * (j - (rows - 1) / 2)
            nodes.append(Node(f"sphere {i} {j}", 0, transforms.translation(x, 0.45, z)))
            nodes.append(Node(f"box {i} {j}", 1, transforms.translation(x + 0.5, 0.0, z + 0.5)))
    return Scene(
        meshes=(sphere, box, floor),
        nodes=tuple(nodes),
        materials=(
            Material("floor", (0.8, 0.8, 0.8), metallic=0.9, roughness=0.0),
            Material("sphere", (0.8, 0.3, 0.2), metallic=0.3, roughness=0.1),
            Material("box", (0.2, 0.5, 0.8)),
        ),
        view=View(eye=(3.0, 2.2, 4.5), target=(0.0, 0.2, 0.0), fov_y_degrees=45.0, near=0.1),
        name=name,
    )

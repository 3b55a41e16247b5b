"""A city behind a wide rippled basin, seen close to the water: grazing and long rays.

The water is a height field, a sum of sines, with the analytic normals of that sum. In the
default view depths go from 3.8 units, the nearest ripple, to 162, the sky's backdrop.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .. import transforms
from ..camera import View
from ..scene import DirectionalLight, Lights, Material, Mesh, Node, Primitive, Scene
from ..typed import F64Array, Rgb
from ..vecmath.elementary import sincos_host
from . import shapes


class Wave(NamedTuple):
    """height · sin(along_x · x + along_z · z + phase): scene units, radians per unit, radians."""

    height: float
    along_x: float
    along_z: float
    phase: float


WAVES = (
    Wave(0.018, 0.31, 1.7, 0.3),
    Wave(0.011, -0.52, 2.6, 1.9),
    Wave(0.006, 0.85, 3.9, 4.1),
    Wave(0.004, -1.2, 5.3, 2.2),
)
HALF_WIDTH = 40.0
NEAR_Z, FAR_Z = 6.0, -58.0
"""The basin, from behind the eye to the quay."""
SKY = (
    (0.0, (1.0, 0.5, 0.16)),
    (0.12, (0.95, 0.34, 0.2)),
    (0.3, (0.5, 0.2, 0.34)),
    (0.6, (0.14, 0.1, 0.34)),
    (1.0, (0.03, 0.04, 0.16)),
)
"""Colours of the backdrop by share of its height: an evening sky."""


class House(NamedTuple):
    """A building on the quay: left edge, width, height, depth of its front, colour."""

    x: float
    width: float
    height: float
    z: float
    color: Rgb


HOUSES = (
    House(-36.0, 7.0, 9.0, -61.0, (0.1, 0.07, 0.12)),
    House(-27.5, 5.0, 15.0, -63.0, (0.07, 0.06, 0.13)),
    House(-21.0, 8.0, 7.0, -60.5, (0.13, 0.08, 0.11)),
    House(-11.5, 4.5, 19.0, -64.0, (0.06, 0.06, 0.14)),
    House(-5.5, 6.5, 8.5, -61.5, (0.12, 0.08, 0.12)),
    House(9.0, 5.0, 12.0, -62.0, (0.09, 0.07, 0.13)),
    House(15.5, 9.0, 6.5, -60.5, (0.12, 0.08, 0.1)),
    House(26.0, 4.0, 17.0, -63.5, (0.06, 0.06, 0.13)),
    House(31.5, 7.0, 10.0, -61.0, (0.1, 0.07, 0.12)),
)
HOUSE_DEPTH = 6.0
WINDOW, WINDOW_SPACING, WINDOW_LIFT = (0.5, 0.7), (1.0, 1.5), 0.0625
"""Size and spacing of windows, and how far they stand before the wall (scene units)."""


class Post(NamedTuple):
    """A mooring post: where it stands, radius, height over the still water."""

    x: float
    z: float
    radius: float
    height: float


POSTS = (
    Post(-2.6, -5.5, 0.12, 0.75),
    Post(-3.9, -9.5, 0.14, 0.9),
    Post(-5.6, -15.0, 0.16, 1.05),
    Post(3.4, -7.5, 0.13, 0.85),
    Post(6.6, -20.0, 0.18, 1.2),
)
BUOY = (1.5, -5.4, 0.28)
"""x, z and radius of a buoy, half in the water."""


def water(tessellation: int = 16) -> Scene:
    """The scene; the water has 96 n² triangles (4 n × 12 n cells), n the tessellation.

    The sun has 20 n², the buoy 20 ⌈n/2⌉² and each of five posts 4 n.
    """
    n = tessellation
    materials = (
        Material("water", (0.02, 0.05, 0.07), roughness=0.0, reflectivity=(0.86, 0.88, 0.9)),
        Material("sky", (1.0, 1.0, 1.0), metallic=0.0, roughness=0.9),
        Material("sun", (0.9, 0.7, 0.4), emissive=(1.0, 0.72, 0.3), roughness=0.9),
        Material("quay", (0.16, 0.1, 0.1), metallic=0.0, roughness=0.9),
        Material("window", (0.8, 0.6, 0.3), emissive=(0.95, 0.62, 0.2), roughness=0.9),
        Material("post", (0.5, 0.24, 0.1), metallic=0.0, roughness=0.9),
        Material("buoy", (0.9, 0.1, 0.05), metallic=0.0, roughness=0.7),
        *(Material(f"house {i + 1}", h.color, roughness=0.9) for i, h in enumerate(HOUSES)),
    )
    sky = shapes.layered_box((-150.0, -1.0, -161.0), (150.0, 70.0, -160.0), SKY, material=1)
    quay = shapes.box((-HALF_WIDTH, -1.0, -72.0), (HALF_WIDTH, 0.75, FAR_Z), material=3)
    meshes = [
        Mesh("water", (ripples(4 * n, 12 * n),)),
        Mesh("sky", (sky,)),
        Mesh("sun", (shapes.sphere(6.0, n, material=2),)),
        Mesh("quay", (quay,)),
        Mesh("buoy", (shapes.sphere(BUOY[2], -(-n // 2), material=6),)),
    ]
    nodes = [
        Node("water", 0),
        Node("sky", 1),
        Node("sun", 2, transforms.translation(12.0, 8.5, -150.0)),
        Node("quay", 3),
        Node("buoy", 4, transforms.translation(BUOY[0], 0.0625, BUOY[1])),
    ]
    for i, post in enumerate(POSTS):
        shape = shapes.round_post(post.radius, post.height + 0.5, n, material=5)
        nodes.append(
            Node(f"post {i + 1}", len(meshes), transforms.translation(post.x, -0.5, post.z))
        )
        meshes.append(Mesh(f"post {i + 1}", (shape,)))
    for i, house in enumerate(HOUSES):
        nodes.append(Node(f"house {i + 1}", len(meshes)))
        meshes.append(Mesh(f"house {i + 1}", (_walls(house, 7 + i), _windows(house, i))))

    lights = Lights(
        ambient=(0.55, 0.52, 0.56),
        directional=(
            DirectionalLight((-0.3, -0.35, -1.0), (0.45, 0.42, 0.42)),
            DirectionalLight((-0.2, -0.15, 1.0), (0.5, 0.3, 0.16)),
        ),
    )
    view = View(eye=(0.0, 1.1, 1.0), target=(0.0, 1.25, -10.0), fov_y_degrees=33.0)
    return Scene(tuple(meshes), tuple(nodes), materials, lights=lights, view=view, name="water")


def surface(x: F64Array, z: F64Array) -> tuple[F64Array, F64Array, F64Array]:
    """Height and its slopes ∂/∂x, ∂/∂z over a grid: three (len(z), len(x)) arrays.

    sin(a + b) = sin a cos b + cos a sin b: one sine a row and one a column, within a few ulp.
    """
    shape = (len(z), len(x))
    height, slope_x, slope_z = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for wave in WAVES:
        a = np.array([sincos_host(wave.along_x * v) for v in x.tolist()])
        b = np.array([sincos_host(wave.along_z * v + wave.phase) for v in z.tolist()])
        sine = b[:, :1] * a[:, 1] + b[:, 1:] * a[:, 0]
        cosine = b[:, 1:] * a[:, 1] - b[:, :1] * a[:, 0]
        height += wave.height * sine
        slope_x += wave.height * wave.along_x * cosine
        slope_z += wave.height * wave.along_z * cosine
    return height, slope_x, slope_z


def ripples(columns: int, rows: int) -> Primitive:
    """The water's surface, columns × rows cells, smooth and open; rows are denser near the eye."""
    flat = shapes.grid(HALF_WIDTH, 1.0, columns, rows)
    x = flat.positions[: columns + 1, 0].astype(np.float64)
    t = np.arange(rows + 1, dtype=np.float64) / rows
    # From the quay to the eye: 1.75 times the mean spacing down to a quarter of it.
    z = FAR_Z + (NEAR_Z - FAR_Z) * (1.75 * t - 0.75 * (t * t))
    z = z.astype(np.float32).astype(np.float64)
    height, slope_x, slope_z = surface(x, z)
    length = np.sqrt(slope_x * slope_x + slope_z * slope_z + 1.0)

    positions, normals = np.empty((2, rows + 1, columns + 1, 3))
    positions[:, :, 0], positions[:, :, 1], positions[:, :, 2] = x, height, z[:, None]
    normals[:, :, 0], normals[:, :, 1], normals[:, :, 2] = -slope_x, 1.0, -slope_z
    normals /= length[:, :, None]
    return Primitive(
        positions.reshape(-1, 3).astype(np.float32),
        flat.faces,
        normals=normals.reshape(-1, 3).astype(np.float32),
    )


def _walls(house: House, material: int) -> Primitive:
    """A building's closed box, its foot on the quay."""
    low = (house.x, 0.75, house.z - HOUSE_DEPTH)
    return shapes.box(low, (house.x + house.width, house.height, house.z), material=material)


def _windows(house: House, number: int) -> Primitive:
    """Lit windows as one primitive of flat squares before the front; every third or so is dark."""
    columns = int((house.width - 0.5) // WINDOW_SPACING[0])
    floors = int((house.height - 2.0) // WINDOW_SPACING[1])
    margin = (house.width - columns * WINDOW_SPACING[0] + WINDOW_SPACING[0] - WINDOW[0]) / 2.0
    corners = []
    for floor in range(floors):
        for column in range(columns):
            if (7 * column + 5 * floor + 3 * column * floor + number) % 5 < 2:
                continue
            x = house.x + margin + column * WINDOW_SPACING[0]
            y = 1.75 + floor * WINDOW_SPACING[1]
            z = house.z + WINDOW_LIFT
            corners += [(x, y, z), (x + WINDOW[0], y, z)]
            corners += [(x + WINDOW[0], y + WINDOW[1], z), (x, y + WINDOW[1], z)]
    quads = np.arange(len(corners)).reshape(-1, 4)
    return Primitive(np.array(corners, np.float32), shapes.split_quads(quads), 4)

"""A courtyard of textures beside a mirror pool: wraps, a transform, masks, emission, metal maps.

Leaves are flat bent cards whose outline is an alpha mask: a ray must pass between the leaflets.
The pool's mirror ends at lily pads that only its metallic-roughness texture knows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .. import transforms
from ..camera import View
from ..scene import DirectionalLight, Lights, Material, Mesh, Node, Primitive, Scene
from ..texture import Image, Texture
from . import patterns, shapes

QUARTER_TURN = 0.7853981633974483
"""π/4 radians: the flagstones lie diagonally."""
POOL_EDGE = -0.25
BACK_WALL = -2.5
FLOOR, POOL, KERB, BRICK, TILES, ART, FRAME, LANTERN, POT, SOIL, LEAF = range(11)


class Fern(NamedTuple):
    """A fern in a pot: place, the pot's half width, the fronds' count, reach, rise and width."""

    x: float
    z: float
    pot: float
    fronds: int
    reach: float
    rise: float
    width: float


FERNS = (
    Fern(-1.9, -1.15, 0.26, 8, 0.85, 1.15, 0.4),
    Fern(0.62, -1.2, 0.22, 12, 0.6, 0.7, 0.28),
    Fern(2.2, -0.8, 0.25, 12, 0.7, 0.6, 0.3),
)
POT_HEIGHT = 0.4
LANTERNS = ((-0.75, -0.8), (1.5, -1.5))
"""x and z of the lanterns."""


def textured(tessellation: int = 16) -> Scene:
    """The scene; each of 32 fronds is bent in n segments of two triangles, n the tessellation."""
    images, materials = _images(), _materials()
    brick = shapes.unwrapped_box((-5.0, 0.0, BACK_WALL - 0.25), (1.0, 2.5, BACK_WALL))
    tiles = shapes.unwrapped_box((1.0, 0.0, BACK_WALL - 0.25), (5.0, 2.5, BACK_WALL))
    meshes = [
        Mesh("terrace", (_with_material(_terrace(), FLOOR),)),
        Mesh("pool", (_pool(),)),
        Mesh("kerb", (shapes.box((-5.0, -0.25, -0.375), (5.0, 0.0625, -0.25), material=KERB),)),
        Mesh("brick wall", (_with_material(brick, BRICK),)),
        Mesh("tiled wall", (_with_material(tiles, TILES),)),
        Mesh("painting", _painting()),
        Mesh("lantern", _lantern()),
    ]
    nodes = [Node(mesh.name, i) for i, mesh in enumerate(meshes[:6])]
    nodes += [
        Node(f"lantern {i + 1}", 6, transforms.translation(x, 0.0, z))
        for i, (x, z) in enumerate(LANTERNS)
    ]
    for i, fern in enumerate(FERNS):
        nodes.append(
            Node(f"fern {i + 1}", len(meshes), transforms.translation(fern.x, 0.0, fern.z))
        )
        meshes.append(Mesh(f"fern {i + 1}", (*_pot(fern), fronds(fern, tessellation))))

    lights = Lights(
        ambient=(0.36, 0.36, 0.38),
        directional=(
            DirectionalLight((-0.5, -1.0, -0.6), (0.62, 0.6, 0.54)),
            DirectionalLight((0.8, -0.3, -0.6), (0.2, 0.21, 0.26)),
        ),
    )
    view = View(eye=(-0.5, 1.0, 4.2), target=(0.0, 0.3, -1.0), fov_y_degrees=34.0)
    return Scene(
        tuple(meshes), tuple(nodes), materials, lights=lights, view=view, name="textured",
        images=images,
    )  # fmt: skip


def _images() -> tuple[Image, ...]:
    water, water_metal = patterns.pool()
    return (
        Image("paving", patterns.paving()),
        Image("pool", water),
        Image("pool, metallic and roughness", water_metal),
        Image("bricks, 16 bit", patterns.bricks()),
        Image("tile", patterns.tile()),
        Image("painting", patterns.painting()),
        Image("lantern", patterns.lantern()),
        Image("frond", patterns.frond()),
    )


def _materials() -> tuple[Material, ...]:
    paving = Texture(0, rotation=QUARTER_TURN, scale=(1.0, 1.0), offset=(0.25, 0.125))
    pool = Texture(1, wrap=("clamp", "clamp"))
    pool_metal = Texture(2, wrap=("clamp", "clamp"))
    tiles = Texture(4, wrap=("mirror", "mirror"), scale=(4.0, 4.0))
    return (
        Material("paving", (1.0, 1.0, 1.0), roughness=0.8, base_color_texture=paving),
        Material(
            "pool", (1.0, 1.0, 1.0), metallic=1.0, roughness=1.0,
            base_color_texture=pool, metallic_roughness_texture=pool_metal,
        ),
        Material("kerb", (0.6, 0.57, 0.5), roughness=0.9),
        Material("bricks", (1.0, 1.0, 1.0), roughness=0.9, base_color_texture=Texture(3)),
        Material("tiles", (1.0, 1.0, 1.0), roughness=0.6, base_color_texture=tiles),
        Material(
            "painting", (1.0, 1.0, 1.0), roughness=0.8,
            base_color_texture=Texture(5, wrap=("clamp", "clamp")),
        ),
        Material("frame", (0.16, 0.08, 0.03), roughness=0.8),
        Material(
            "lantern", (0.1, 0.06, 0.03), roughness=0.8, emissive=(1.0, 1.0, 1.0),
            emissive_texture=Texture(6),
        ),
        Material("pot", (0.62, 0.24, 0.12), roughness=0.9),
        Material("soil", (0.06, 0.04, 0.03), roughness=0.9),
        Material(
            "leaf", (1.0, 1.0, 1.0), roughness=0.9, double_sided=True, alpha_cutoff=0.5,
            base_color_texture=Texture(7, wrap=("clamp", "clamp")),
        ),
    )  # fmt: skip


def _with_material(primitive: Primitive, material: int) -> Primitive:
    return Primitive(primitive.positions, primitive.faces, material, uv0=primitive.uv0)


def _terrace() -> Primitive:
    return shapes.unwrapped_box((-5.0, -0.25, BACK_WALL), (5.0, 0.0, -0.375))


def _pool() -> Primitive:
    """A closed slab; the image lies once on 5 × 2.5 units of it, its border texels go on beyond."""
    shape = shapes.unwrapped_box((-5.0, -0.25, POOL_EDGE), (5.0, 0.0, 4.75))
    assert shape.uv0 is not None
    uv = (shape.uv0.astype(np.float64) - (2.5, 0.0)) / (5.0, 2.5)
    return Primitive(shape.positions, shape.faces, POOL, uv0=uv.astype(np.float32))


def _painting() -> tuple[Primitive, ...]:
    """A frame and in it a picture whose coordinates run from −1/8 to 9/8: its border goes on."""
    z = BACK_WALL + 0.0625
    frame = shapes.box((-1.35, 0.85, BACK_WALL), (0.15, 1.95, z), material=FRAME)
    x, y = (-1.3, 0.1), (0.9, 1.9)
    z += 0.00390625
    picture = shapes.quad(
        [(x[0], y[0], z), (x[1], y[0], z), (x[1], y[1], z), (x[0], y[1], z)],
        uv=[(-0.125, 1.125), (1.125, 1.125), (1.125, -0.125), (-0.125, -0.125)],
        material=ART,
    )
    return frame, picture


def _lantern() -> tuple[Primitive, ...]:
    """A paper box on a foot, with a lid; each side of the paper shows the image once."""
    half, low, high = 0.15625, 0.09375, 0.53125
    paper = shapes.unwrapped_box((-half, low, -half), (half, high, half))
    assert paper.uv0 is not None
    uv = paper.uv0.astype(np.float64) / (2.0 * half, high - low)
    return (
        shapes.box((-0.1875, 0.0, -0.1875), (0.1875, low, 0.1875), material=FRAME),
        Primitive(paper.positions, paper.faces, LANTERN, uv0=uv.astype(np.float32)),
        shapes.box((-0.21875, high, -0.21875), (0.21875, 0.59375, 0.21875), material=FRAME),
    )


def _pot(fern: Fern) -> tuple[Primitive, ...]:
    h = fern.pot
    return (
        shapes.box((-h, 0.0, -h), (h, POT_HEIGHT, h), material=POT),
        shapes.quad(
            [(s * (h - 0.03), POT_HEIGHT + 0.00390625, t * (h - 0.03))
             for s, t in ((-1, 1), (1, 1), (1, -1), (-1, -1))],
            material=SOIL,
        ),
    )  # fmt: skip


def fronds(fern: Fern, segments: int) -> Primitive:
    """A fern's leaves as one open primitive: bent cards around the y axis.

    A leaf's middle is the parabola (reach·t, rise·(2.2 t − 1.6 t²)) of t from 0 at the pot to 1 at
    the tip; every other leaf is shorter and steeper. uv0: u across, v from 1 at the pot to 0 at
    the tip.
    """
    t = np.arange(segments + 1, dtype=np.float64) / segments
    around = shapes.unit_circle(fern.fronds)
    positions, normals = np.empty((2, len(around), segments + 1, 2, 3))
    for i, (x, z) in enumerate(around):
        size = 1.0 if i % 2 == 0 else 0.75
        reach, rise = fern.reach * size, fern.rise * (1.0 if i % 2 == 0 else 1.1)
        out = 0.04 + reach * t
        up = POT_HEIGHT + rise * (2.2 * t - 1.6 * (t * t))
        slope = rise * (2.2 - 3.2 * t)
        length = np.sqrt(slope * slope + reach * reach)
        half = 0.5 * fern.width * size
        for side, sign in ((0, -1.0), (1, 1.0)):
            positions[i, :, side, 0] = x * out - sign * half * z
            positions[i, :, side, 1] = up
            positions[i, :, side, 2] = z * out + sign * half * x
            normals[i, :, side, 0] = -x * slope / length
            normals[i, :, side, 1] = reach / length
            normals[i, :, side, 2] = -z * slope / length

    uv = np.empty((len(around), segments + 1, 2, 2))
    uv[..., 0], uv[..., 1] = (0.0, 1.0), (1.0 - t)[:, None]
    first = np.arange(len(around) * (segments + 1)).reshape(len(around), -1)[:, :-1].ravel() * 2
    quads = np.stack([first, first + 1, first + 3, first + 2], axis=1)
    return Primitive(
        positions.reshape(-1, 3).astype(np.float32),
        shapes.split_quads(quads),
        LEAF,
        normals=normals.reshape(-1, 3).astype(np.float32),
        uv0=uv.reshape(-1, 2).astype(np.float32),
    )

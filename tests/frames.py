"""A small frame with made-up buffers, for tests of what is done with frames."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ssr_ref.buffers import End, Flag, GBuffer, HitBuffer, RasterCounts, Resolved, Status
from ssr_ref.camera import View
from ssr_ref.pipeline import Frame
from ssr_ref.scene import Material, Mesh, Node, Primitive, Scene
from ssr_ref.settings import Settings

BOX_POSITIONS = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
BOX_FACES = [
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
    [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
]  # fmt: skip
VIEW = View(eye=(2.0, 3.0, 5.0), target=(0.0, 0.5, 0.0))


def box_scene() -> Scene:
    """A box over a mirroring square: two objects, two materials."""
    box = Primitive(np.array(BOX_POSITIONS, np.float32), np.array(BOX_FACES, np.int32), 0)
    floor = Primitive(
        np.array([[-4, -1, 4], [4, -1, 4], [4, -1, -4], [-4, -1, -4]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        1,
    )
    lifted = np.eye(4)
    lifted[:3, 3] = (0.1, 1.0 / 3.0, 0.0)
    return Scene(
        meshes=(Mesh("box", (box,)), Mesh("floor", (floor,))),
        nodes=(Node("box", 0, lifted), Node("floor", 1)),
        materials=(
            Material("red", base_color=(0.8, 0.1, 0.1)),
            Material("mirror", base_color=(0.9, 0.9, 0.9), metallic=1.0, roughness=0.0),
        ),
        view=VIEW,
        name="box",
    )


def made_up_frame(size: tuple[int, int] = (37, 23), seed: int = 1, **settings: Any) -> Frame:
    """A frame of `box_scene` with random buffers: every status, NaN where there is no hit."""
    rng = np.random.default_rng(seed)
    width, height = size
    shape = (height, width)
    scene = box_scene()
    chosen = replace(Settings(size=size, **settings).resolved(scene.radius()))
    floats = np.dtype(chosen.buffer_dtype)

    drawn = rng.random(shape) < 0.8
    status = rng.integers(0, len(Status), shape).astype(np.uint8)
    hit = status == Status.HIT

    def image(*channels: int) -> np.ndarray:
        return rng.random((*shape, *channels)).astype(floats)

    def ids(most: int) -> np.ndarray:
        return np.where(drawn, rng.integers(0, most, shape), -1).astype(np.int32)

    def where_hit(values: np.ndarray) -> np.ndarray:
        keep = hit if values.ndim == 2 else hit[..., None]
        return np.where(keep, values, np.nan)

    gbuffer = GBuffer(
        depth=np.where(drawn, 1 + 5 * image(), np.inf).astype(floats),
        triangle_id=ids(14),
        object_id=ids(2),
        material_id=ids(2),
        back_depth=np.where(drawn & (image() < 0.5), 7 + image(), np.inf).astype(floats),
        geo_normal_vs=image(3),
        normal_vs=image(3),
        albedo=image(3),
        reflectivity=image(3),
        roughness=image(),
        radiance=image(3),
        counts=RasterCounts(triangles=14, drawn=12, culled=2),
    )
    hits = HitBuffer(
        status=status,
        end=rng.integers(0, len(End), shape).astype(np.uint8),
        flags=rng.integers(0, 2 * max(Flag), shape).astype(np.uint8),
        hit_px=where_hit(rng.random((*shape, 2)) * [width, height]),
        hit_depth=where_hit(1 + rng.random(shape)),
        residual=where_hit(rng.random(shape) / 64),
        length=where_hit(rng.random(shape)),
        steps=rng.integers(0, 2**32, shape, dtype=np.uint32),
        fetches=rng.integers(0, 1000, shape, dtype=np.uint32),
    )
    resolved = Resolved(
        edge_fade=rng.random(shape, np.float32),
        distance_fade=rng.random(shape, np.float32),
        confidence=rng.random(shape, np.float32),
        reflection=rng.random((*shape, 3), np.float32),
        composite=rng.random((*shape, 3), np.float32),
    )
    camera = VIEW.camera(size, 2.0**-8)
    timings = {"rasterize": 0.25, "trace": 0.5}
    return Frame(scene, camera, chosen, gbuffer, hits, resolved, ("made-up buffers",), timings)

"""What each scene beyond teapot and poles promises: gaps, parallel mirrors, waves, masks, maps."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scene_frames import SIZE, frame, hit_objects, objects
from solids import corners, open_edges, project, world_points

from ssr_ref import scenes
from ssr_ref.buffers import Status
from ssr_ref.pipeline import Frame, render
from ssr_ref.scenes import patterns, spheres, steps, water
from ssr_ref.scenes.textured import LEAF, POOL
from ssr_ref.settings import Settings


def test_spheres_have_mirror_metal_and_diffuse_and_see_each_other() -> None:
    scene = scenes.build("spheres", 6)
    metallic = {ball.name: ball.metallic for ball in spheres.BALLS}
    assert metallic["chrome"] >= 0.8 and 0.2 < metallic["gold"] < 0.6 and metallic["red"] == 0.0
    radii = [ball.radius for ball in spheres.BALLS]
    assert max(radii) / min(radii) > 7.0
    number = objects(scene)
    picture = frame("spheres")
    own, seen = picture.gbuffer.object_id, hit_objects(picture)
    for a, b in (("chrome", "gold"), ("gold", "chrome"), ("chrome", "floor"), ("floor", "chrome")):
        assert ((own == number[a]) & (seen == number[b])).any(), (a, b)
    for i, a in enumerate(spheres.BALLS):  # none runs into another
        for b in spheres.BALLS[:i]:
            d = np.array([a.x - b.x, a.radius - b.radius, a.z - b.z])
            assert (d**2).sum() > (a.radius + b.radius) ** 2, (a.name, b.name)


def test_corridor_mirrors_are_exactly_parallel() -> None:
    scene = scenes.build("corridor", 2)
    for name, side in (("left mirror", -1.0), ("right mirror", 1.0)):
        p = world_points(scene, name)
        inner = p[np.abs(p[:, 0]) == np.abs(p[:, 0]).min()]
        assert len(inner) == 4 and set(inner[:, 0].tolist()) == {side * 1.25}
    picture = frame("corridor")
    number = objects(picture.scene)
    left, right = number["left mirror"], number["right mirror"]
    own, seen = picture.gbuffer.object_id, hit_objects(picture)
    normal = picture.gbuffer.geo_normal_vs
    assert own is not None and normal is not None
    ours, theirs = normal[own == left], normal[own == right]
    assert len(ours) > 100 and len(theirs) > 100
    assert (ours == ours[0]).all() and (theirs == -ours[0]).all()  # in every bit
    # Reflections of reflections, and places that the camera cannot know.
    assert ((own == left) & (seen == right)).sum() > 10
    assert ((own == right) & (seen == left)).sum() > 10
    mirrors = (own == left) | (own == right)
    missed = mirrors & (picture.hits.status != Status.HIT)
    assert 0.03 < missed.sum() / mirrors.sum() < 0.5


def test_steps_float_at_their_heights() -> None:
    scene = scenes.build("steps")
    ends = []
    for i in range(steps.STEPS):
        p = world_points(scene, f"step {i + 1}")
        assert p[:, 1].min() == (1 + i) / 8.0 == steps.gap(i)
        assert p[:, 1].max() == (1 + i) / 8.0 + 3.0 / 32.0
        ends.append((p[:, 0].min(), p[:, 0].max()))
    # Neighbours leave 1/32 of a unit free: 7/16 apart, 13/32 wide.
    assert {b[0] - a[1] for a, b in pairwise(ends)} == {1.0 / 32.0}


def test_steps_show_a_gap_unless_thickness_is_too_large() -> None:
    """Between a step and its mirror image neither the step nor its reflection may show.

    In the column of the front edge's middle: from its projection down to that of the mirrored rear
    edge, one pixel less at either end.
    """
    scene = scenes.build("steps", 4)
    size = (241, 135)
    number = objects(scene)

    def in_gaps(picture: Frame) -> list[int]:
        own, seen = picture.gbuffer.object_id, hit_objects(picture)
        assert own is not None
        found = []
        for i in range(steps.STEPS):
            x = steps.SPACING * (i - (steps.STEPS - 1) / 2.0)
            z, y = steps.HALF_SIZE[2], steps.gap(i)
            ends = project(scene, np.array([[x, y, z], [x, -y, -z]]), size)
            column = int(ends[0, 0])
            rows = slice(int(np.ceil(ends[0, 1])) + 1, int(np.floor(ends[1, 1])) - 1)
            step = number[f"step {i + 1}"]
            assert rows.stop - rows.start >= 2
            assert (own[rows, column] != step).all()
            found.append(int((seen[rows, column] == step).sum()))
        return found

    assert in_gaps(render(scene, settings=Settings(size=size))) == [0] * steps.STEPS
    thick = Settings(size=size, thickness_from="constant", thickness=4.0)
    filled = in_gaps(render(scene, settings=thick))
    assert sum(n > 0 for n in filled) >= steps.STEPS - 2


def height(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The water's height by its definition, with the C library's sine."""
    waves = water.WAVES
    total: np.ndarray = sum(
        w.height * np.sin(w.along_x * x + w.along_z * z + w.phase) for w in waves
    )
    return total


def test_water_is_the_height_field_and_its_normals_the_derivative() -> None:
    surface = water.ripples(9, 31)
    p = surface.positions.astype(np.float64)
    x, z = p[:, 0], p[:, 2]
    # float32 rounding of a height below 2**-4: half an ulp, 2**-29; the sines to 1e-15.
    assert np.abs(p[:, 1] - height(x, z)).max() <= 2.0**-29 + 1e-14

    # Central differences: the error is h²/6 · Σ height · k³ < 5e-10 for h = 1e-4.
    h = 1e-4
    slope_x = (height(x + h, z) - height(x - h, z)) / (2.0 * h)
    slope_z = (height(x, z + h) - height(x, z - h)) / (2.0 * h)
    normal = np.stack([-slope_x, np.ones_like(x), -slope_z], axis=1)
    normal /= np.sqrt((normal**2).sum(axis=1))[:, None]
    assert surface.normals is not None
    assert np.abs(surface.normals - normal).max() < 2.0**-25 + 2e-9
    assert np.abs(slope_z).max() > 0.02  # it is not flat

    t = corners(surface)
    assert (np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])[:, 1] > 0.0).all()
    assert len(open_edges(surface)) == 2 * (9 + 31)
    rows = z.reshape(32, 10)[:, 0]
    assert rows[0] == water.FAR_Z and rows[-1] == water.NEAR_Z and (np.diff(rows) > 0.0).all()
    assert np.diff(rows)[0] > 5.0 * np.diff(rows)[-1]


def test_water_has_grazing_and_long_rays() -> None:
    picture = frame("water", 16)
    depth = picture.gbuffer.depth
    assert depth.min() < 5.0 and 150.0 < depth[np.isfinite(depth)].max() < 170.0
    length = picture.hits.length[picture.hits.status == Status.HIT]
    assert length.max() > 100.0 and length.min() < 2.0
    # The quay's windows and the sun show in the water.
    names = {picture.scene.nodes[i].name for i in np.unique(hit_objects(picture)) if i >= 0}
    assert {"sun", "sky", "buoy", "post 1"} <= names
    assert sum(name.startswith("house") for name in names) >= 7


def test_curved_mirrors_show_the_things_around_them() -> None:
    picture = frame("curved", 16)
    number = objects(picture.scene)
    own, seen = picture.gbuffer.object_id, hit_objects(picture)
    for mirror in ("mirror ball", "mirror cylinder"):
        names = {
            picture.scene.nodes[i].name for i in np.unique(seen[own == number[mirror]]) if i >= 0
        }
        assert {"floor", "blue ball", "orange ball", "green post"} <= names, mirror
    mirrored = {m.name for m in picture.scene.materials if m.metallic > 0.0}
    assert mirrored == {"mirror"}


def test_textured_uses_every_way_to_read_an_image() -> None:
    scene = scenes.build("textured", 2)
    textures = [t for m in scene.materials for t in m.textures if t is not None]
    assert {wrap for t in textures for wrap in t.wrap} == {"repeat", "mirror", "clamp"}
    assert any(t.rotation != 0.0 and t.offset != (0.0, 0.0) for t in textures)
    assert any(t.scale != (1.0, 1.0) for t in textures)
    types = [image.pixels.dtype for image in scene.images]
    assert types.count(np.dtype(np.uint16)) == 1 and types.count(np.dtype(np.uint8)) == 7
    assert {t.image for t in textures} == set(range(len(scene.images)))
    assert sum(m.emissive_texture is not None for m in scene.materials) == 1
    assert sum(m.metallic_roughness_texture is not None for m in scene.materials) == 1
    for mesh in scene.meshes:
        for primitive in mesh.primitives:
            if any(scene.materials[primitive.material].textures):
                assert primitive.uv0 is not None, mesh.name


def test_pool_mirrors_but_for_its_lily_pads() -> None:
    picture = frame("textured")
    material, status = picture.gbuffer.material_id, picture.hits.status
    roughness = picture.gbuffer.roughness
    assert material is not None and roughness is not None
    water_surface = (material == POOL) & (roughness == 0.0)
    pad = (material == POOL) & (roughness > 0.9)
    assert water_surface.sum() > 1000 and pad.sum() > 20
    assert (status[pad] == Status.NOT_REFLECTIVE).all()
    assert (status[water_surface] == Status.HIT).mean() > 0.9
    green = picture.resolved.composite[pad].mean(axis=0)
    assert green[1] > 1.5 * green[0] and green[1] > 1.5 * green[2]

    # The larger pads where the image puts them: 5 × 2.5 units of it from x = −2.5, z = −1/4.
    for cx, cy, r in patterns.PADS:
        if r < 10:
            continue
        place = np.array([[-2.5 + (cx - 4) * 5.0 / 256, 0.0, -0.25 + cy * 2.5 / 128]])
        px, py = project(picture.scene, place, SIZE)[0].astype(int)
        assert pad[py, px], (cx, cy)


def test_leaves_are_masked() -> None:
    alpha = patterns.frond()[..., 3]
    assert set(np.unique(alpha)) == {0, 255}
    # Under the parabola lie 2/3 of 60/64 of the card; 10 of 16 rows of it are leaflets, and the
    # rib of 4 texels fills the other 6/16 of its part: 0.391 + 0.023.
    assert (alpha == 255).mean() == pytest.approx(0.414, abs=0.02)
    assert (np.abs(np.diff(alpha.astype(int), axis=0)) > 0).any(axis=1).sum() > 100

    scene = scenes.build("textured", 6)
    leaf = replace(scene.materials[LEAF], alpha_cutoff=None)
    solid = replace(scene, materials=(*scene.materials[:LEAF], leaf, *scene.materials[LEAF + 1 :]))
    seen = [
        np.count_nonzero(picture.gbuffer.material_id == LEAF)
        for picture in (frame("textured"), render(solid, settings=Settings(size=SIZE)))
    ]
    # Measured: 273 of 391; leaves overlap, so more than a card's own share stays.
    assert 0.5 < seen[0] / seen[1] < 0.8


def test_images_repeat_and_mirror_without_a_seam() -> None:
    tile = patterns.tile().astype(int)
    assert np.array_equal(tile, tile.transpose(1, 0, 2))  # a rosette with diagonals
    bricks = patterns.bricks()
    assert bricks.dtype == np.uint16 and (bricks[..., :3] % 257 != 0).mean() > 0.9  # not 8 bits
    # Two courses above each other are shifted by half a brick: joints of row 8 and row 24.
    joints = [np.flatnonzero(bricks[row, :, 2] > 30000) for row in (8, 24, 40)]
    assert joints[0].tolist() == [0, 1, 32, 33] == joints[2].tolist()
    assert joints[1].tolist() == [16, 17, 48, 49]
    paving = patterns.paving()[..., :3].astype(int).sum(axis=2)
    light, dark = paving[4:28, 4:28], paving[4:28, 36:60]
    assert light.min() > dark.max() and (paving[0] < dark.min()).all()

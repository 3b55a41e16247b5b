"""Alpha masks: alpha at the pixel's centre decides coverage, in front and in back depth."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from oracles import texture as oracle
from raster_drawing import draw, image_bytes, objects, pixel_camera

from ssr_ref import transforms
from ssr_ref.camera import Camera, look_at
from ssr_ref.scene import Material, Primitive, Scene
from ssr_ref.texture import Image, Texture

SIZE = (37, 23)
RNG = np.random.default_rng(5)
LEAVES = RNG.integers(0, 256, (6, 9, 4), dtype=np.uint8)
MASK = Material("leaves", (1, 1, 1), alpha_cutoff=0.5, base_color_texture=Texture(0))


def card(z: float, material: int = 0, **parts: Any) -> Primitive:
    """A quad at view z that covers the image, counter-clockwise, uv 0 to 1, v down."""
    w, h = SIZE
    corners = np.array([[0, 0, z], [w, 0, z], [w, -h, z], [0, -h, z]], np.float32)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    faces = np.array([[0, 2, 1], [0, 3, 2]], np.int32)
    return Primitive(corners, faces, material, uv0=uv, **parts)


def scene(parts: Any, materials: Any) -> Scene:
    return objects([(p, None) for p in parts], materials, images=(Image("leaves", LEAVES),))


def alpha() -> np.ndarray:
    """(H, W) alpha of the card's texture at the pixel centres."""
    w, h = SIZE
    return np.array(
        [
            [oracle.sample(LEAVES, Texture(0), (x + 0.5) / w, (y + 0.5) / h)[3] for x in range(w)]
            for y in range(h)
        ]
    )


ALPHA = alpha()


@pytest.mark.parametrize("cutoff", [0.0, 0.25, 0.5, 0.75, 1.0])
def test_coverage_is_alpha_at_the_centre(cutoff: float) -> None:
    """Behind the holes the wall shows, with its own depth and colour."""
    wall = Material("wall", (0.2, 0.4, 0.6))
    made = scene([card(-2.0), card(-5.0, 1)], (replace(MASK, alpha_cutoff=cutoff), wall))
    g = draw(made, pixel_camera(SIZE), SIZE).g
    covered = g.object_id == 0
    clear = np.abs(ALPHA - cutoff) > 1e-12  # where the oracle's rounding cannot decide
    assert clear.sum() > 0.99 * clear.size
    np.testing.assert_array_equal(covered[clear], (cutoff <= ALPHA)[clear])
    np.testing.assert_array_equal(g.depth, np.where(covered, 2.0, 5.0))
    np.testing.assert_array_equal(
        g.albedo[~covered], np.tile([0.2, 0.4, 0.6], (~covered).sum()).reshape(-1, 3)
    )


def test_equality_with_the_cutoff_is_covered() -> None:
    """Factor ½, white texture, cutoff ½: drawn; the next float of the cutoff: nothing is."""
    parts = [card(-2.0)]
    plain = replace(MASK, base_color_texture=None, alpha=0.5)
    at = draw(scene(parts, (plain,)), pixel_camera(SIZE), SIZE).g
    assert (at.triangle_id >= 0).all()
    above = replace(plain, alpha_cutoff=float(np.nextafter(0.5, 1.0)))
    assert (draw(scene(parts, (above,)), pixel_camera(SIZE), SIZE).g.triangle_id < 0).all()


def test_factor_texture_and_vertex_alpha_multiply() -> None:
    """Vertex alpha falls from 1 at the left to 0 at the right edge."""
    alphas = np.array([1, 0, 0, 1], np.float32)
    made = scene([card(-2.0, alphas=alphas)], (replace(MASK, alpha=0.75, alpha_cutoff=0.25),))
    covered = draw(made, pixel_camera(SIZE), SIZE).g.triangle_id >= 0
    share = 1.0 - (np.arange(SIZE[0]) + 0.5) / SIZE[0]
    product = 0.75 * ALPHA * share
    clear = np.abs(product - 0.25) > 1e-12
    np.testing.assert_array_equal(covered[clear], (product >= 0.25)[clear])
    assert 0.1 < covered.mean() < 0.9


def test_a_mask_that_hides_nothing_changes_no_byte() -> None:
    """All alpha 1: the same images as without the mask, ties and intersections included."""
    rng = np.random.default_rng(8)
    corners = rng.uniform(-1, 1, (3 * 200, 3)) * (6, 4, 2) + (0, 0, -6)
    corners = np.round(corners * 2) / 2  # a coarse grid: shared planes, equal k
    soup = Primitive(
        corners.astype(np.float32),
        np.arange(600, dtype=np.int32).reshape(-1, 3),
        uv0=np.zeros((600, 2), np.float32),
    )
    half = replace(soup, faces=soup.faces[::2]), replace(soup, faces=soup.faces[1::2], material=1)
    camera = Camera.perspective(np.eye(4), 70.0, SIZE[0] / SIZE[1], near=5.0)
    opaque = Material("opaque", double_sided=False)
    masked = replace(opaque, alpha_cutoff=0.5)
    for two_sided in (False, True):
        kinds = [
            tuple(replace(m, double_sided=two_sided) for m in pair)
            for pair in ((opaque, opaque), (opaque, masked), (masked, opaque), (masked, masked))
        ]
        images = [image_bytes(draw(scene([half], pair), camera, SIZE).g) for pair in kinds]
        assert all(other == images[0] for other in images[1:])
        counts = draw(scene([half], kinds[3]), camera, SIZE).g.counts
        assert counts.clipped > 0


def test_back_faces_are_masked_too() -> None:
    """A closed box of leaves: back depth is the back wall where its own alpha covers, else +inf."""
    w, h = SIZE
    front = card(-2.0)
    back = replace(card(-5.0), faces=card(-5.0).faces[:, ::-1])
    body = [front, back]
    solid = Material("solid")
    made = objects(
        [([front, replace(back, material=1)], None)],
        (solid, MASK),
        images=(Image("leaves", LEAVES),),
    )
    g = draw(made, pixel_camera(SIZE), SIZE).g
    clear = np.abs(ALPHA - 0.5) > 1e-12
    want = np.where(ALPHA >= 0.5, 5.0, np.inf)
    np.testing.assert_array_equal(g.back_depth[clear], want[clear])
    assert (g.object_id == 0).all()
    # Through a hole of the front the back face is not seen: it faces away.
    both = objects([(body, None)], (MASK,), images=(Image("leaves", LEAVES),))
    seen = draw(both, pixel_camera(SIZE), SIZE).g
    np.testing.assert_array_equal((seen.object_id == 0)[clear], (ALPHA >= 0.5)[clear])
    assert (seen.depth[seen.object_id == 0] == 2.0).all()
    assert (w, h) == SIZE


def test_a_masked_card_cut_by_the_near_plane() -> None:
    """Pieces of a clipped triangle read the uv of the whole one."""
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    floor = Primitive(
        np.array([[-3, 0, 4], [3, 0, 4], [3, 0, -6], [-3, 0, -6]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        uv0=uv,
    )
    pose = look_at((0, 0.7, 1.0), (0, 0, -2))
    camera = Camera.perspective(pose, 65.0, SIZE[0] / SIZE[1], near=0.5)
    made = scene([floor], (MASK,))
    g = draw(made, camera, SIZE).g
    assert g.counts.clipped > 0
    view = camera.params(SIZE)
    checked = 0
    for y in range(SIZE[1]):
        for x in range(SIZE[0]):
            d_vs = np.array([(x + 0.5 - view.cx) / view.fx, (view.cy - y - 0.5) / view.fy, -1.0])
            d = pose[:3, :3] @ d_vs
            if d[1] >= -1e-6:
                assert g.triangle_id[y, x] < 0
                continue
            t = -pose[1, 3] / d[1]
            p = pose[:3, 3] + t * d
            inside = abs(p[0]) < 2.99 and -5.99 < p[2] < 3.99 and t > 0.51
            a = oracle.sample(LEAVES, Texture(0), (p[0] + 3) / 6, (4 - p[2]) / 10)[3]
            if inside and abs(a - 0.5) > 1e-9:
                assert (g.triangle_id[y, x] >= 0) == (a >= 0.5)
                checked += 1
    assert checked > 200


def test_a_masked_reflection() -> None:
    """A mirror floor shows the leaves with their holes: every hit on the card is on a leaf."""
    import ssr_ref
    from ssr_ref import Settings, Status

    leaf = Primitive(
        np.array([[-1, 0, 0], [1, 0, 0], [1, 2, 0], [-1, 2, 0]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        uv0=np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32),
    )
    floor = Primitive(
        np.array([[-4, 0, 4], [4, 0, 4], [4, 0, -4], [-4, 0, -4]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        1,
    )
    mirror = Material("mirror", (0.9, 0.9, 0.9), metallic=1.0, roughness=0.0)
    masked = replace(MASK, double_sided=True)
    made = scene([leaf, floor], (masked, mirror))
    view = ssr_ref.View(eye=(0.3, 1.2, 4.0), target=(0, 0.5, 0))
    settings = Settings(
        size=(61, 41), thickness_from="constant", tracer="cells", buffer_dtype="float64"
    )
    frame = ssr_ref.render(made, view, settings)
    solid = ssr_ref.render(
        scene([leaf, floor], (replace(masked, alpha_cutoff=None), mirror)), view, settings
    )
    hits, all_hits = (f.hits.status == Status.HIT for f in (frame, solid))
    assert 20 < hits.sum() < 0.8 * all_hits.sum()
    px = np.floor(frame.hits.hit_px[hits]).astype(int)
    assert (frame.gbuffer.object_id[px[:, 1], px[:, 0]] == 0).mean() > 0.9


def test_transforms_do_not_move_the_mask() -> None:
    """Mirrored in x: the holes are mirrored too."""
    mirror = transforms.multiply(
        transforms.translation(SIZE[0], 0, 0), transforms.scaling(-1, 1, 1)
    )
    images = (Image("leaves", LEAVES),)
    plain, flipped = (
        draw(objects([(card(-2.0), m)], (MASK,), images=images), pixel_camera(SIZE), SIZE).g
        for m in (None, mirror)
    )
    clear = np.abs(ALPHA - 0.5) > 1e-12
    got = flipped.triangle_id[:, ::-1] >= 0
    np.testing.assert_array_equal(got[clear], (plain.triangle_id >= 0)[clear])

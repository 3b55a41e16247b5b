"""Planar mirrors: what is drawn and counted, mirrors in mirrors, masks, exactness, errors."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from raster_drawing import objects, quad
from tracing import MIRROR

from ssr_ref import Material, Scene, Settings, transforms
from ssr_ref.buffers import GBuffer
from ssr_ref.camera import Camera, ViewParams, look_at
from ssr_ref.errors import SceneError, SettingsError
from ssr_ref.pipeline import with_radiance
from ssr_ref.planar import (
    PlanarMirror,
    PlanarReflection,
    find_mirrors,
    mirror_on_plane,
    planar_reflections,
)
from ssr_ref.raster.geometry import Geometry, flatten
from ssr_ref.raster.rasterize import RasterOptions, draw_visibility, project, rasterize
from ssr_ref.raster.textures import texture_store
from ssr_ref.scenes import shapes
from ssr_ref.ssr.resolve import schlick

pytestmark = pytest.mark.slow  # compiles much

SIZE = (61, 37)
GREEN = Material("green", (0.0, 1.0, 0.0), unlit=True)
HALF_MIRROR = Material("half", (0.25, 0.0, 0.0), reflectivity=(0.5, 0.5, 0.5), unlit=True)


def gbuffer_of(
    scene: Scene, camera: Camera, size: tuple[int, int] = SIZE, **options: Any
) -> tuple[ViewParams, Geometry, GBuffer]:
    """View, geometry and a G-buffer with radiance, float64 unless told otherwise."""
    view, geometry, store = camera.params(size), flatten(scene), texture_store(scene)
    chosen = RasterOptions(**{"dtype": np.float64, "back_depth": False, **options})
    g, positions = rasterize(view, geometry, chosen, store=store)
    return view, geometry, with_radiance(view, geometry, positions, g, scene, store)


def planar(
    scene: Scene,
    camera: Camera,
    *,
    size: tuple[int, int] = SIZE,
    settings: Settings | None = None,
    bounces: int = 1,
    mirrors: tuple[PlanarMirror, ...] | None = None,
    **options: Any,
) -> PlanarReflection:
    """The planar reflections of the mirrors that are found."""
    view, geometry, g = gbuffer_of(scene, camera, size, **options)
    if mirrors is None:
        mirrors = find_mirrors(scene, geometry).mirrors
    store = texture_store(scene)
    return planar_reflections(
        view, geometry, g, scene.lights, mirrors, settings, store=store, bounces=bounces
    )


def front_camera(size: tuple[int, int] = SIZE, half_height: float = 1.0) -> Camera:
    """Eye at the origin, down −Z; x/depth runs over ±aspect · half_height."""
    x = size[0] / size[1] * half_height
    return Camera.frustum(np.eye(4), -x, x, -half_height, half_height, near=2.0**-6)


# --- Mirrors in mirrors ---------------------------------------------------------------------------


def hall() -> Scene:
    """Two facing mirrors at x = ±1 and a green wall across the end of them at z = −4."""
    left = quad((-1, -99, 4), (-1, -99, -4), (-1, 99, -4), (-1, 99, 4))
    right = quad((1, -99, -4), (1, -99, 4), (1, 99, 4), (1, 99, -4))
    wall = quad((-1, -99, -4), (1, -99, -4), (1, 99, -4), (-1, 99, -4))
    parts = [replace(left, material=0), replace(right, material=0), replace(wall, material=1)]
    return objects([(p, None) for p in parts], (HALF_MIRROR, GREEN))


def crossings(size: tuple[int, int]) -> np.ndarray:
    """(W,) mirrors on the path of each column's ray: unfolded, it meets z = −4 at x = 4·dx, and
    crosses a mirror at each odd x.
    """
    dx = ((np.arange(size[0]) + 0.5) / size[0] * 2 - 1) * size[0] / size[1]
    return ((np.abs(4 * dx) + 1) // 2).astype(int)


@pytest.mark.parametrize("bounces", [1, 2, 3])
def test_facing_mirrors(bounces: int) -> None:
    """By hand: W the wall, L a mirror's own radiance, R = 1/2. One mirror on the path shows W; m of
    them show L/2 + (what m − 1 show)/2 while bounces last, then L.
    """
    n = crossings(SIZE)
    assert set(n) == {0, 1, 2, 3}
    wall, own = np.array([0.0, 1.0, 0.0]), np.array([0.25, 0.0, 0.0])

    def shown(m: int, left: int) -> np.ndarray:
        """Reflection in the first of m mirrors."""
        if m == 1:
            return wall
        return own if left == 1 else 0.5 * own + 0.5 * shown(m - 1, left - 1)

    got = planar(hall(), front_camera(), bounces=bounces)
    for x, m in enumerate(n):
        if m == 0:
            assert not got.mask[:, x].any()
            np.testing.assert_array_equal(got.composite[:, x], np.broadcast_to(wall, (SIZE[1], 3)))
            continue
        assert got.mask[:, x].all(), x
        want = shown(m, bounces)
        np.testing.assert_array_equal(got.reflection[:, x], np.broadcast_to(want, (SIZE[1], 3)))
        both = 0.5 * own + 0.5 * want
        np.testing.assert_array_equal(got.composite[:, x], np.broadcast_to(both, (SIZE[1], 3)))
        # What is met first: the wall, or the other mirror; the left is object 0.
        other = 1 if x < SIZE[0] / 2 else 0
        assert (got.object_id[:, x] == (2 if m == 1 else other)).all()
    # Each picture leaves its own mirror out: 2 objects of 2 triangles. Both mirrors are seen in
    # each other, and again in those (three crossings).
    assert (got.passes, got.draws, got.triangles) == (2 * bounces, 4 * bounces, 8 * bounces)


def test_a_point_in_a_mirror_by_hand() -> None:
    """Column 45 of 61: dx = (91/61 − 1)·61/37 = 30/37, so the wall is met at unfolded x = 120/37,
    folded back 2 − 120/37 = −46/37 … two mirrors on the path: first met at x = 1, then at x = −1,
    which the first shows at depth 3/dx = 3.7.
    """
    got = planar(hall(), front_camera())
    x, y = 45, 18  # row 18 of 37 is the horizon
    assert crossings(SIZE)[x] == 2
    np.testing.assert_allclose(got.point_ws[y, x], (-1.0, 0.0, -3.7), atol=1e-14)
    # From x = 1 to x = −1: 2 units of x along (dx, 0, −1).
    np.testing.assert_allclose(got.distance[y, x], 2 * np.hypot(1, 37 / 30), rtol=1e-14)


def test_more_bounces_than_are_seen_cost_nothing() -> None:
    """Three crossings need three bounces; more find no further mirror on screen."""
    three, six = (planar(hall(), front_camera(), bounces=n) for n in (3, 6))
    assert (six.passes, six.draws) == (three.passes, three.draws) == (6, 12)
    assert six.composite.tobytes() == three.composite.tobytes()


# --- What is drawn --------------------------------------------------------------------------------


def room() -> tuple[Scene, Camera]:
    """A mirror floor with one box on it, one through it, one under it, and a mirror out of view."""
    floor = quad((-4, 0, 4), (4, 0, 4), (4, 0, -4), (-4, 0, -4))
    away = quad((-4, 0, 9), (4, 0, 9), (4, 4, 9), (-4, 4, 9))  # behind the eye, faces away from it
    box = shapes.box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5), material=1)
    at = [transforms.translation(*p) for p in ((-1, 0.5, 0), (0.75, 0.25, 0.5), (2, -2, 0))]
    parts = [(floor, None), *((box, m) for m in at), (away, None)]
    scene = objects(parts, (MIRROR, Material("matt", (0.8, 0.3, 0.1))))
    pose = look_at((0.7, 1.6, 5.0), (0.0, 0.2, 0.0))
    return scene, Camera.perspective(pose, 45.0, SIZE[0] / SIZE[1], near=0.05)


def test_draws_are_counted_and_unseen_mirrors_cost_nothing() -> None:
    """The floor alone is on screen: its picture holds two boxes of 12 triangles less the bottom of
    the one that stands on it (2, in the mirror's plane) and of the one through it (2, behind it),
    and the other mirror (2).
    """
    scene, camera = room()
    got = planar(scene, camera)
    assert len(find_mirrors(scene, flatten(scene)).mirrors) == 2
    assert (got.passes, got.draws, got.triangles) == (1, 3, 22)
    assert set(np.unique(got.mirror)) == {-1, 0}
    assert set(np.unique(got.object_id)) == {-1, 1, 2}
    nothing = planar(scene, camera, mirrors=())
    assert not nothing.mask.any() and nothing.passes == nothing.draws == nothing.triangles == 0


def test_the_mirror_plane_cuts_an_object_across_it() -> None:
    """No point that is shown lies under the floor, and the box through it is shown down to it."""
    scene, camera = room()
    got = planar(scene, camera)
    shown = got.object_id == 2
    assert shown.sum() > 25
    assert got.point_ws[got.object_id >= 0][:, 1].min() >= -1e-15
    assert got.point_ws[shown][:, 1].min() < 0.2


def test_images_are_masked_to_their_mirror() -> None:
    """Outside the mask: nothing, and the composite is the radiance; inside, the formula."""
    scene, camera = room()
    view, geometry, g = gbuffer_of(scene, camera)
    assert g.radiance is not None and g.reflectivity is not None
    sky = Settings(fallback="constant", fallback_color=(0.2, 0.3, 0.4))
    mirrors = find_mirrors(scene, geometry).mirrors
    got = planar_reflections(view, geometry, g, scene.lights, mirrors, sky)
    np.testing.assert_array_equal(got.mask, g.object_id == 0)
    np.testing.assert_array_equal(got.composite[~got.mask], g.radiance[~got.mask])
    assert (got.reflection[~got.mask] == 0).all() and (got.triangle_id[~got.mask] == -1).all()
    r = g.reflectivity[got.mask]
    want = g.radiance[got.mask] * (1 - r) + r * got.reflection[got.mask]
    np.testing.assert_array_equal(got.composite[got.mask], want)
    empty = got.mask & (got.triangle_id < 0)
    assert empty.sum() > 100
    assert (got.reflection[empty] == (0.2, 0.3, 0.4)).all()
    assert (
        np.isnan(got.point_ws[empty]).all() and np.isfinite(got.distance[~empty & got.mask]).all()
    )


def test_a_mirror_beyond_far_still_shows_what_is_there() -> None:
    """Rays are not clipped at far: the wall's image lies at depths up to 12, far is 9."""
    floor = quad((-9, 0, 9), (9, 0, 9), (9, 0, -3), (-9, 0, -3))
    wall = replace(quad((-9, 0, -4), (9, 0, -4), (9, 9, -4), (-9, 9, -4)), material=1)
    scene = objects([(floor, None), (wall, None)], (MIRROR, GREEN))
    pose = look_at((0, 3, 5), (0, 0, 0))
    near, far = (
        planar(scene, Camera.perspective(pose, 30.0, SIZE[0] / SIZE[1], near=0.1, far=f))
        for f in (9.0, np.inf)
    )
    shared = near.mask & far.mask
    assert shared.sum() > 500
    np.testing.assert_array_equal(near.reflection[shared], far.reflection[shared])
    assert (near.reflection[shared] == (0.0, 1.0, 0.0)).all(axis=1).mean() > 0.5


def test_fresnel_in_a_mirror_in_a_mirror() -> None:
    """Schlick's term at each mirror's own angle: |n·d| is |dx| / √(1 + dx² + dy²) at both."""
    size = (61, 1)
    camera = front_camera(size, half_height=1 / 37)  # the columns of the hall, the horizon alone
    got = planar(
        hall(), camera, size=size, bounces=2, settings=Settings(fresnel=True), fresnel=True
    )
    x = 45
    cosine = (30 / 37) / np.hypot(1, 30 / 37)
    r = float(schlick(0.5, cosine))
    want = np.array([0.25, 0.0, 0.0]) * (1 - r) + r * np.array([0.0, 1.0, 0.0])
    np.testing.assert_allclose(got.reflection[0, x], want, rtol=1e-13)
    outer = np.array([0.25, 0.0, 0.0]) * (1 - r) + r * want
    np.testing.assert_allclose(got.composite[0, x], outer, rtol=1e-13)


def test_pixels_without_reflectivity_are_left_out() -> None:
    """Two tiles of one mirror; vertex colours make one black, so that its R, metal times base
    colour times vertex colour, is 0.
    """
    bright = quad((-2, 0, 2), (0, 0, 2), (0, 0, -2), (-2, 0, -2))
    black = quad((0, 0, 2), (2, 0, 2), (2, 0, -2), (0, 0, -2))
    black = replace(black, colors=np.zeros((4, 3), np.float32))
    scene = objects([(bright, None), (black, None)], (MIRROR,))
    pose = look_at((0, 2, 3), (0, 0, 0))
    camera = Camera.perspective(pose, 45.0, SIZE[0] / SIZE[1], near=0.1)
    _, geometry, g = gbuffer_of(scene, camera)
    assert len(find_mirrors(scene, geometry).mirrors) == 1
    got = planar(scene, camera)
    assert (g.object_id == 1).sum() > 200
    np.testing.assert_array_equal(got.mask, g.object_id == 0)


def test_a_mirror_that_is_not_quite_flat_does_not_show_itself() -> None:
    """One corner stands 2⁻¹⁸ over the plane of the larger triangle: flat enough, and left out."""
    tile = quad((-5, 0, 4), (4, 0, 4), (4, 0, -4), (-4, 2.0**-18, -4))
    scene = objects([(tile, None)], (MIRROR,))
    pose = look_at((0, 2, 6), (0, 0, 0))
    got = planar(scene, Camera.perspective(pose, 45.0, SIZE[0] / SIZE[1], near=0.1))
    assert got.mask.sum() > 500
    assert (got.passes, got.draws, got.triangles) == (1, 0, 0)
    assert (got.triangle_id == -1).all()


def test_a_mirror_that_another_shows_beside_its_own_pixels_is_not_drawn() -> None:
    """Eye 1 over a floor tile, z −1.2 to −2: rows dy −0.83 to −0.5. A wall mirror at z = −4 reaches
    0.5 up: its image in the floor's plane has dy −0.38 to −0.25, beside the tile. The tile's image
    in the wall, z −6 to −6.8, has dy −0.17 to −0.15, inside the wall's −0.25 to −0.125.
    """
    tile = quad((-1, 0, -1.2), (1, 0, -1.2), (1, 0, -2), (-1, 0, -2))
    wall = quad((-1, 0, -4), (1, 0, -4), (1, 0.5, -4), (-1, 0.5, -4))
    pose = transforms.translation(0, 1, 0)
    x = SIZE[0] / SIZE[1]
    camera = Camera.frustum(pose, -x, x, -1.0, 1.0, near=2.0**-6)
    scene = objects([(tile, None), (wall, None)], (MIRROR,))
    one, two = (planar(scene, camera, bounces=n) for n in (1, 2))
    assert (one.passes, one.draws) == (2, 2)
    assert (two.passes, two.draws) == (3, 3)  # and the wall in the floor in the wall
    assert set(np.unique(one.object_id[one.mirror >= 0])) == {-1, 0}


@pytest.mark.slow
def test_an_alpha_mask_cuts_holes_in_the_image_too() -> None:
    """A panel with alpha below its cutoff stands before the green wall: the mirror shows the wall;
    with alpha above it, the panel.
    """
    floor = quad((-9, 0, 9), (9, 0, 9), (9, 0, -3), (-9, 0, -3))
    wall = replace(quad((-9, 0, -4), (9, 0, -4), (9, 9, -4), (-9, 9, -4)), material=1)
    panel = replace(quad((-9, 0, -3), (9, 0, -3), (9, 9, -3), (-9, 9, -3)), material=2)
    pose = look_at((0, 3, 5), (0, 0, 0))
    camera = Camera.perspective(pose, 30.0, SIZE[0] / SIZE[1], near=0.1)
    for alpha, shown in ((0.25, 1), (0.75, 2)):
        masked = Material("masked", alpha=alpha, alpha_cutoff=0.5)
        parts = [(floor, None), (wall, None), (panel, None)]
        got = planar(objects(parts, (MIRROR, GREEN, masked)), camera)
        assert (got.object_id == shown).sum() > 500
        assert set(np.unique(got.object_id)) <= {-1, shown}


def test_given_mirrors() -> None:
    """A plane given by hand is the one that is found, and shows the same bytes."""
    scene, camera = room()
    geometry = flatten(scene)
    given = mirror_on_plane(geometry, (1, 0, 1), (0, -3, 0), 1e-6)
    # Both boxes' sides cross the plane; the bottom of the first lies in it.
    assert set(given.triangles[:2]) == {0, 1}
    found = find_mirrors(scene, geometry).mirrors[0]
    given = PlanarMirror(given.point_ws, given.normal_ws, found.triangles)
    a, b = planar(scene, camera, mirrors=(found,)), planar(scene, camera, mirrors=(given,))
    for name in ("reflection", "composite", "triangle_id", "mirror", "mask"):
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes(), name
    with pytest.raises(SceneError, match="no triangle lies within"):
        mirror_on_plane(geometry, (0, 7, 0), (0, 1, 0), 0.1)
    with pytest.raises(SceneError, match="normal that is not zero"):
        mirror_on_plane(geometry, (0, 0, 0), (0, 0, 0), 0.1)


# --- Exactness ------------------------------------------------------------------------------------


@pytest.mark.parametrize("power", [-13, 21])
def test_a_power_of_two_keeps_every_byte(power: int) -> None:
    """Positions, eye and near times 2ᵏ: same images, lengths exactly scaled (turned mirror)."""
    k = 2.0**power
    scene, _ = room()
    tilt = transforms.from_quaternion(0.0, 0.0, 0.6, 0.8)  # unit: 3-4-5

    def scaled(s: float) -> PlanarReflection:
        nodes = tuple(
            replace(
                node,
                world_from_mesh=transforms.multiply(
                    transforms.scaling(s, s, s), transforms.multiply(tilt, node.world_from_mesh)
                ),
            )
            for node in scene.nodes
        )
        pose = look_at((-1.5, 1.9, 5.0), (0.0, 0.2, 0.0)).copy()
        pose[:3, 3] *= s
        camera = Camera.perspective(pose, 45.0, SIZE[0] / SIZE[1], near=0.05 * s)
        return planar(replace(scene, nodes=nodes), camera)

    one, other = scaled(1.0), scaled(k)
    assert (one.triangle_id >= 0).sum() > 50
    for name in ("mask", "mirror", "reflection", "composite", "triangle_id", "object_id"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name
    for name in ("point_ws", "distance"):
        np.testing.assert_array_equal(getattr(one, name) * k, getattr(other, name))
    assert (one.draws, one.triangles) == (other.draws, other.triangles)


def test_a_clip_distance_that_cuts_nothing_changes_no_byte() -> None:
    """All distances above 0, and none at all, draw the same; all below draw nothing."""
    scene, camera = room()
    view, geometry = camera.params(SIZE), flatten(scene)
    nv = len(geometry.positions_ws)

    def drawn(distance: np.ndarray | None) -> tuple[bytes, bytes, np.ndarray]:
        depth, ids = np.empty((SIZE[1], SIZE[0])), np.empty((SIZE[1], SIZE[0]), np.int32)
        options = RasterOptions(back_depth=False, dtype=np.float64)
        projected = project(view, geometry)
        draw_visibility(
            view, geometry, projected, options, None, depth, ids, np.empty((0, 0)), distance
        )
        return depth.tobytes(), ids.tobytes(), ids

    without = drawn(None)
    assert drawn(np.full(nv, 0.0))[:2] == without[:2]
    assert drawn(np.linspace(1.0, 9.0, nv))[:2] == without[:2]
    assert (drawn(np.full(nv, -1.0))[2] == -1).all()
    # Half a quad: distances −1 and 1 at its ends keep the side above 0, to the pixel.
    tile = objects([(quad((-1, -1, -2), (1, -1, -2), (1, 1, -2), (-1, 1, -2)), None)])
    view, geometry = front_camera().params(SIZE), flatten(tile)
    ids = drawn(geometry.positions_ws[:, 0] - 0.25)[2]
    x = ((np.arange(SIZE[0]) + 0.5) / SIZE[0] * 2 - 1) * SIZE[0] / SIZE[1] * 2
    y = (1 - (np.arange(SIZE[1]) + 0.5) / SIZE[1] * 2) * 2
    want = ((x > 0.25) & (x < 1))[None, :] & (np.abs(y) < 1)[:, None]
    np.testing.assert_array_equal(ids >= 0, want)


@pytest.mark.slow
def test_float32_buffers_are_the_float64_ones_rounded() -> None:
    scene, camera = room()
    wide, narrow = planar(scene, camera), planar(scene, camera, dtype=np.float32)
    assert narrow.reflection.dtype == narrow.composite.dtype == np.float32
    np.testing.assert_array_equal(narrow.triangle_id, wide.triangle_id)
    np.testing.assert_array_equal(narrow.reflection, wide.reflection.astype(np.float32))
    seen = wide.triangle_id >= 0
    np.testing.assert_allclose(narrow.distance[seen], wide.distance[seen], atol=1e-6)


# --- What is refused ------------------------------------------------------------------------------


def test_errors_say_what_was_found() -> None:
    scene, camera = room()
    view, geometry, g = gbuffer_of(scene, camera)
    (mirror, other) = find_mirrors(scene, geometry).mirrors

    def run(mirrors: Any, buffers: GBuffer = g, **options: Any) -> None:
        planar_reflections(view, geometry, buffers, scene.lights, mirrors, **options)

    for bounces in (0, 17, 1.5, True):
        with pytest.raises(SettingsError, match=r"bounces is .*expected a whole number, 1 to 16"):
            run([mirror], bounces=bounces)
    with pytest.raises(SettingsError, match="belongs to mirrors 0 and 1"):
        run([mirror, mirror])
    with pytest.raises(SettingsError, match="has triangle 99 of 40"):
        run([replace(other, triangles=np.array([99]))])
    with pytest.raises(SettingsError, match="reflectivity is not there; expected 61x37"):
        run([mirror], replace(g, reflectivity=None))
    with pytest.raises(SettingsError, match="depth is 5x4; expected 61x37"):
        run([mirror], replace(g, depth=np.ones((4, 5))))
    with pytest.raises(SceneError, match="triangle -2; expected ids of 0 or more"):
        replace(mirror, triangles=np.array([-2]))

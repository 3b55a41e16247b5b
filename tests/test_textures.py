"""Textures: texels, filtering, wraps and transforms against exact rationals; what they multiply."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from oracles import texture as oracle
from raster_drawing import Drawn, draw, image_bytes, objects, pixel_camera

from ssr_ref import transforms
from ssr_ref.errors import SceneError
from ssr_ref.raster.textures import TextureStore
from ssr_ref.scene import Lights, Material, Primitive, Scene
from ssr_ref.texture import Image, Texture

SIZE = (37, 23)
WHITE = Lights(ambient=(1.0, 1.0, 1.0), directional=())
RNG = np.random.default_rng(11)
EIGHT = RNG.integers(0, 256, (5, 7, 4), dtype=np.uint8)
SIXTEEN = RNG.integers(0, 65536, (3, 2, 4), dtype=np.uint16)
EXACT = 2.0**-49
"""Of a value of at most 1: the oracle's libm and ours, and five roundings."""


def card(uv: Any = None, material: int = 0, **parts: Any) -> Primitive:
    """A quad that covers the image of pixel_camera(SIZE) with uv 0 to 1, v down."""
    w, h = SIZE
    corners = np.array([[0, 0, -1], [w, 0, -1], [w, -h, -1], [0, -h, -1]], np.float32)
    if uv is None:
        uv = [[0, 0], [1, 0], [1, 1], [0, 1]]
    faces = np.array([[0, 2, 1], [0, 3, 2]], np.int32)
    return Primitive(corners, faces, material, uv0=np.array(uv, np.float32), **parts)


def scene(material: Material, *images: Any, primitive: Primitive | None = None) -> Scene:
    made = objects(
        [(primitive or card(), None)],
        (material,),
        images=tuple(Image(f"image {i}", p) for i, p in enumerate(images)),
    )
    return made.with_lights(WHITE)


def drawn(material: Material, *images: Any, primitive: Primitive | None = None, **o: Any) -> Drawn:
    result = draw(scene(material, *images, primitive=primitive), pixel_camera(SIZE), SIZE, **o)
    assert (result.g.triangle_id >= 0).all()
    return result


def textured(texture: Texture | None = None, **values: Any) -> Material:
    values = {"base_color": (1.0, 1.0, 1.0), "metallic": 1.0, "roughness": 0.0} | values
    return Material("textured", base_color_texture=texture or Texture(0), **values)


def expected(pixels: Any, texture: Texture, uv: Any = None, srgb: bool = True) -> np.ndarray:
    """(H, W, 4) by the oracle; uv = (u of column 0 to 1, v of row 0 to 1) at the image's edges."""
    w, h = SIZE
    (u0, u1), (v0, v1) = uv or ((0.0, 1.0), (0.0, 1.0))
    out = np.empty((h, w, 4))
    for y in range(h):
        for x in range(w):
            u = u0 + (u1 - u0) * (x + 0.5) / w
            v = v0 + (v1 - v0) * (y + 0.5) / h
            out[y, x] = oracle.sample(pixels, texture, u, v, srgb)
    return out


# --- Filtering ------------------------------------------------------------------------------------


@pytest.mark.parametrize("pixels", [EIGHT, SIXTEEN], ids=["8 bits", "16 bits"])
def test_magnified_texels_are_filtered_after_decoding(pixels: Any) -> None:
    """Uv is off by 2⁻⁵⁰ at most, times the texels' difference times the image's width."""
    g = drawn(textured(), pixels).g
    np.testing.assert_allclose(g.albedo, expected(pixels, Texture(0))[..., :3], rtol=0, atol=1e-13)
    # Filtering the codes and then decoding would be another picture.
    assert np.abs(g.albedo - expected(pixels, Texture(0), srgb=False)[..., :3]).max() > 0.05


def test_one_texel_a_pixel_is_that_texel() -> None:
    """A centre on a texel's centre shows the decoded code alone, row 0 at v = 0."""
    w, h = SIZE
    pixels = RNG.integers(0, 256, (h, w, 4), dtype=np.uint8)
    table = np.array([oracle.decoded(code, 255, True) for code in range(256)])
    np.testing.assert_allclose(
        drawn(textured(), pixels).g.albedo, table[pixels[..., :3]], rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("wrap_u", ["repeat", "mirror", "clamp"])
@pytest.mark.parametrize("wrap_v", ["repeat", "mirror", "clamp"])
def test_wraps(wrap_u: Any, wrap_v: Any) -> None:
    """Two and a half images to the left, three to the right; other counts along v."""
    uv = [[-2.5, -1.25], [3.0, -1.25], [3.0, 2.75], [-2.5, 2.75]]
    texture = Texture(0, wrap=(wrap_u, wrap_v))
    want = expected(EIGHT, texture, ((-2.5, 3.0), (-1.25, 2.75)))
    got = drawn(textured(texture), EIGHT, primitive=card(uv)).g.albedo
    np.testing.assert_allclose(got, want[..., :3], rtol=0, atol=1e-12)


def test_offset_and_scale() -> None:
    texture = Texture(0, wrap=("mirror", "repeat"), offset=(0.25, -0.5), scale=(-1.5, 2.0))
    want = expected(EIGHT, texture)
    got = drawn(textured(texture), EIGHT).g.albedo
    np.testing.assert_allclose(got, want[..., :3], rtol=0, atol=1e-12)


def test_rotation_is_counter_clockwise_with_v_down() -> None:
    """A quarter turn takes (u, v) to (v, −u): the image's left column appears along the top."""
    quarter = Texture(0, rotation=float(np.pi / 2), wrap=("repeat", "repeat"))
    by_hand = [[0, 0], [0, -1], [1, -1], [1, 0]]  # (v, −u) of the card's corners
    np.testing.assert_allclose(
        drawn(textured(quarter), EIGHT).g.albedo,
        drawn(textured(), EIGHT, primitive=card(by_hand)).g.albedo,
        rtol=0,
        atol=1e-12,
    )
    # And the order is scale, rotation, offset.
    both = replace(quarter, scale=(2.0, 0.5), offset=(0.125, 0.0))
    by_hand = [[0.125, 0], [0.125, -2], [0.625, -2], [0.625, 0]]
    np.testing.assert_allclose(
        drawn(textured(both), EIGHT).g.albedo,
        drawn(textured(), EIGHT, primitive=card(by_hand)).g.albedo,
        rtol=0,
        atol=1e-12,
    )


def test_second_uv_set() -> None:
    """uv_set 1 reads uv1; a primitive without that set reads (0, 0)."""
    other = np.array([[1, 1], [0, 1], [0, 0], [1, 0]], np.float32)
    turned = replace(card(), uv1=other)
    got = drawn(textured(Texture(0, uv_set=1)), EIGHT, primitive=turned).g.albedo
    want = drawn(textured(), EIGHT, primitive=card(other)).g.albedo
    assert got.tobytes() == want.tobytes()
    missing = drawn(textured(Texture(0, uv_set=1)), EIGHT).g.albedo
    corner = oracle.sample(EIGHT, Texture(0), 0.0, 0.0)[:3]
    np.testing.assert_allclose(missing, np.broadcast_to(corner, missing.shape), atol=EXACT, rtol=0)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e30, -3e38])
@pytest.mark.parametrize("wrap", ["repeat", "mirror", "clamp"])
def test_unusable_and_huge_uv_stay_inside_the_image(bad: float, wrap: Any) -> None:
    """A value of one of the image's texels or between them, never stray memory."""
    uv = [[bad, 0.5], [bad, 0.5], [bad, 0.5], [bad, 0.5]]
    a = drawn(textured(Texture(0, wrap=(wrap, wrap))), EIGHT, primitive=card(uv)).g.albedo
    assert np.isfinite(a).all()
    assert a.min() >= 0.0 and a.max() <= 1.0
    if not np.isfinite(bad):  # read as 0
        want = oracle.sample(EIGHT, Texture(0, wrap=(wrap, wrap)), 0.0, 0.5)[:3]
        np.testing.assert_allclose(a, np.broadcast_to(want, a.shape), rtol=0, atol=EXACT)


def test_an_image_of_one_colour_is_that_colour_in_every_bit() -> None:
    """White texels decode to 1.0 exactly, so the factors' image comes out, byte for byte."""
    white = np.full((3, 5, 4), 255, np.uint8)
    plain = Material("plain", (0.3, 0.7, 0.11), metallic=0.8, roughness=0.1, emissive=(0.1, 0.2, 0))
    same = replace(
        plain,
        base_color_texture=Texture(0),
        metallic_roughness_texture=Texture(0),
        emissive_texture=Texture(0),
    )
    assert image_bytes(drawn(same, white).g) == image_bytes(drawn(plain).g)


def test_perspective() -> None:
    """A receding card: uv is that of the point where the pixel's ray meets it."""
    from ssr_ref.camera import Camera, look_at

    size = (31, 17)
    camera = Camera.perspective(look_at((0.0, 0.6, 1.2), (0, 0, -1)), 60.0, 31 / 17, near=0.01)
    floor = Primitive(
        np.array([[-4, 0, 2], [4, 0, 2], [4, 0, -6], [-4, 0, -6]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        uv0=np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32),
    )
    g = draw(scene(textured(), EIGHT, primitive=floor), camera, size).g
    view, pose = camera.params(size), camera.world_from_view
    checked = 0
    for y in range(size[1]):
        for x in range(size[0]):
            d_vs = np.array([(x + 0.5 - view.cx) / view.fx, (view.cy - y - 0.5) / view.fy, -1.0])
            d = pose[:3, :3] @ d_vs
            if d[1] >= 0.0 or g.triangle_id[y, x] < 0:
                continue
            p = pose[:3, 3] - d * (pose[1, 3] / d[1])
            want = oracle.sample(EIGHT, Texture(0), (p[0] + 4) / 8, (p[2] + 6) / 8)[:3]
            np.testing.assert_allclose(g.albedo[y, x], want, rtol=0, atol=1e-11)
            checked += 1
    assert checked > 200


# --- What textures multiply -----------------------------------------------------------------------


def test_factor_texture_and_vertex_colour_multiply() -> None:
    colors = np.tile(np.array([[0.5, 0.25, 1.0]], np.float32), (4, 1))
    got = drawn(textured(base_color=(0.5, 1.0, 0.25)), EIGHT, primitive=card(colors=colors)).g
    want = expected(EIGHT, Texture(0))[..., :3] * (0.25, 0.25, 0.25)
    np.testing.assert_allclose(got.albedo, want, rtol=0, atol=1e-13)
    np.testing.assert_allclose(got.radiance, got.albedo, rtol=0, atol=1e-15)  # ambient is 1


def test_metallic_is_blue_and_roughness_is_green_of_the_linear_image() -> None:
    material = Material("m", (0.5, 1.0, 0.25), 0.75, 0.8, metallic_roughness_texture=Texture(0))
    g = drawn(material, EIGHT, max_roughness=0.4).g
    want = expected(EIGHT, Texture(0), srgb=False)
    np.testing.assert_allclose(g.roughness, 0.8 * want[..., 1], rtol=0, atol=1e-13)
    metallic = 0.75 * want[..., 2]
    rough = 0.8 * want[..., 1] > 0.4
    assert 0.1 < rough.mean() < 0.9
    r = np.where(rough[..., None], 0.0, metallic[..., None] * np.array([0.5, 1.0, 0.25]))
    np.testing.assert_allclose(g.reflectivity, r, rtol=0, atol=1e-13)


def test_emissive_texture() -> None:
    material = Material("e", (0, 0, 0), emissive=(2.0, 1.0, 0.5), emissive_texture=Texture(1))
    got = drawn(material, SIXTEEN, EIGHT).g.radiance
    want = expected(EIGHT, Texture(0))[..., :3] * (2.0, 1.0, 0.5)
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-12)


def test_unlit_shows_the_base_colour() -> None:
    lights = Lights(ambient=(0.1, 0.2, 0.3), directional=())
    for pixels in ((), (EIGHT,)):
        material = Material("u", (0.5, 0.25, 1.0), emissive=(1, 1, 1), unlit=True)
        if pixels:
            material = replace(material, base_color_texture=Texture(0))
        made = scene(material, *pixels).with_lights(lights)
        g = draw(made, pixel_camera(SIZE), SIZE).g
        assert g.radiance.tobytes() == g.albedo.tobytes()


def test_a_mirrored_instance_keeps_uv_and_colours_on_their_corners() -> None:
    """x → −x: the winding is flipped once, and the picture is the mirror image."""
    w, _ = SIZE
    colors = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], np.float32)
    part = card(colors=colors)
    mirror = transforms.multiply(transforms.translation(w, 0, 0), transforms.scaling(-1, 1, 1))
    material = textured()
    images = (Image("i", EIGHT),)
    plain, flipped = (
        draw(objects([(part, m)], (material,), images=images), pixel_camera(SIZE), SIZE).g
        for m in (None, mirror)
    )
    assert (flipped.triangle_id >= 0).all()
    np.testing.assert_allclose(flipped.albedo, plain.albedo[:, ::-1], rtol=0, atol=1e-12)


# --- What is left out -----------------------------------------------------------------------------


def test_textures_that_are_not_seen_are_not_packed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A textured and a masked card behind the camera cost no packing and change no byte."""
    hidden = card(material=1)
    away = transforms.translation(0, 0, 50)
    parts = [(card(), None), (hidden, away)]
    materials = (Material("plain"), textured(alpha_cutoff=0.5))
    made = objects(parts, materials, images=(Image("i", EIGHT),))

    def refuse(*_: Any) -> None:
        raise AssertionError("a texture was packed")

    monkeypatch.setattr(TextureStore, "_pack", refuse)
    got = image_bytes(draw(made, pixel_camera(SIZE), SIZE).g)
    assert got == image_bytes(draw(objects(parts[:1], materials[:1]), pixel_camera(SIZE), SIZE).g)


def test_only_visible_images_are_packed() -> None:
    """Of two textured cards one above the other, the hidden one's image is left out."""
    big = RNG.integers(0, 256, (64, 64, 4), dtype=np.uint8)
    made = objects(
        [(card(), None), (card(material=1), transforms.translation(0, 0, -3))],
        (textured(), textured(Texture(1))),
        images=(Image("small", EIGHT), Image("big", big)),
    )
    store = TextureStore(made)
    from ssr_ref.raster.geometry import flatten
    from ssr_ref.raster.rasterize import RasterOptions, rasterize, visible_textures

    geometry = flatten(made)
    g, _ = rasterize(pixel_camera(SIZE).params(SIZE), geometry, RasterOptions(), store=store)
    packed = visible_textures(geometry, g.triangle_id, store)
    assert packed is not None
    assert len(packed.texels) == EIGHT.shape[0] * EIGHT.shape[1]
    assert len(packed.decode) == 512  # no 16-bit image, no 16-bit table


# --- Data that cannot be used ---------------------------------------------------------------------


def test_bad_textures_and_images_are_refused() -> None:
    with pytest.raises(SceneError, match="uses image 1 of 1"):
        scene(textured(Texture(1)), EIGHT)
    with pytest.raises(SceneError, match="expected uint8 or uint16"):
        Image("i", EIGHT.astype(np.float32))
    with pytest.raises(SceneError, match=r"expected \(H, W, 4\)"):
        Image("i", EIGHT[..., :3])
    with pytest.raises(SceneError, match="expected sides of 1"):
        Image("i", np.zeros((0, 4, 4), np.uint8))
    with pytest.raises(SceneError, match="wrap is"):
        Texture(0, wrap=("repeat", "border"))  # type: ignore[arg-type]
    with pytest.raises(SceneError, match="uv_set is 2"):
        Texture(0, uv_set=2)
    with pytest.raises(SceneError, match="two finite numbers"):
        Texture(0, scale=(1.0, np.nan))
    with pytest.raises(SceneError, match="5 uv0 for 4 vertices"):
        card(np.zeros((5, 2)))


def test_an_image_is_a_copy_that_cannot_be_changed() -> None:
    mine = EIGHT.copy()
    image = Image("i", mine)
    mine[:] = 0
    assert np.array_equal(image.pixels, EIGHT)
    with pytest.raises(ValueError, match="read-only"):
        image.pixels[0, 0, 0] = 1


def test_the_content_hash_covers_textures() -> None:
    """Each of these changes what may be drawn, and the hash."""
    base = scene(textured(alpha_cutoff=0.5), EIGHT)
    other = EIGHT.copy()
    other[0, 0, 0] ^= 1
    changed = [
        scene(textured(alpha_cutoff=0.5), other),
        scene(textured(alpha_cutoff=0.25), EIGHT),
        scene(textured(Texture(0, wrap=("clamp", "repeat")), alpha_cutoff=0.5), EIGHT),
        scene(textured(Texture(0, offset=(0.5, 0.0)), alpha_cutoff=0.5), EIGHT),
        scene(textured(alpha_cutoff=0.5, unlit=True), EIGHT),
        scene(textured(alpha_cutoff=0.5), EIGHT, primitive=card([[0, 0], [1, 0], [1, 1], [0, 2]])),
        scene(
            textured(alpha_cutoff=0.5),
            EIGHT,
            primitive=card(alphas=np.ones(4, np.float32)),
        ),
    ]
    hashes = {s.content_sha256() for s in (base, *changed)}
    assert len(hashes) == 1 + len(changed)

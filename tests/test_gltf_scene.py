"""What a glTF file becomes: geometry, materials, textures, scenes, report. Files are made here."""

from __future__ import annotations

import base64
import io
import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from glb_file import TRIANGLE, Glb, one_triangle, with_png
from PIL import Image as PillowImage

from ssr_ref.errors import FileError
from ssr_ref.meshfiles.gltf_accessors import as_float32
from ssr_ref.meshfiles.gltf_scene import load_gltf
from ssr_ref.meshfiles.images import png_bytes
from ssr_ref.meshfiles.options import LoadOptions
from ssr_ref.scene import Material, Primitive, Scene
from ssr_ref.texture import Image, Texture

PENTAGON = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0]])


def load(glb: Glb, **options: Any) -> Scene:
    return load_gltf(Path("folder/model.glb"), glb.bytes(), LoadOptions(**options))


def fails(glb: Glb, *words: str, **options: Any) -> None:
    with pytest.raises(FileError) as caught:
        load(glb, **options)
    message = str(caught.value)
    assert message.startswith("folder/model.glb: ")
    assert "\n" not in message
    assert "expected" in message
    for word in words:
        assert word in message, message


def only(scene: Scene) -> Primitive:
    ((primitive,),) = (mesh.primitives for mesh in scene.meshes)
    return primitive


def with_attributes(attributes: dict[str, Any], material: Any = None, **root: Any) -> Glb:
    """One triangle with more attributes (arrays, or (array, accessor properties))."""
    glb = one_triangle(**root)
    primitive = glb.root["meshes"][0]["primitives"][0]
    for name, value in attributes.items():
        array, more = value if isinstance(value, tuple) else (value, {})
        primitive["attributes"][name] = glb.add(array, **more)
    if material is not None:
        glb.root["materials"] = [material]
        primitive["material"] = 0
    return glb


def nearest(numerator: int, denominator: int) -> np.float32:
    """The float32 nearest to a fraction: of its neighbours the closest, by exact arithmetic."""
    guess = np.float32(numerator / denominator)
    around = [np.nextafter(guess, np.float32(s)) for s in (-2, 2)]
    exact = Fraction(numerator, denominator)
    return min([guess, *around], key=lambda v: abs(Fraction(float(v)) - exact))


# ---------------------------------------------------------------------- topology


def test_strips_wind_alike_and_fans_share_the_first(tmp_path):
    for mode, expected in (
        (5, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]),  # glTF 2.0, 3.7.2.1: p_i as listed there
        (6, [[1, 2, 0], [2, 3, 0], [3, 4, 0]]),
    ):
        glb = Glb(nodes=[{"mesh": 0}], scenes=[{"nodes": [0]}])
        glb.mesh({"attributes": {"POSITION": glb.add(PENTAGON)}, "mode": mode})
        assert only(load(glb)).faces.tolist() == expected
        order = np.uint16([4, 3, 2, 1, 0])
        glb.root["meshes"][0]["primitives"][0]["indices"] = glb.add(order)
        assert only(load(glb)).faces.tolist() == (4 - np.array(expected)).tolist()
    glb.root["meshes"][0]["primitives"][0]["mode"] = 5
    glb.root["meshes"][0]["primitives"][0]["indices"] = glb.add(np.uint8([0, 1, 2, 3]))
    faces = only(load(glb)).faces
    p = PENTAGON[faces].astype(float)
    # All triangles of a flat strip face the same way.
    assert (np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2] > 0).all()


@pytest.mark.parametrize("mode", [5, 6])
@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_short_strips_hold_no_triangle(mode, count):
    glb = one_triangle()
    short = {"attributes": {"POSITION": glb.add(np.zeros((count, 3), np.float32))}, "mode": mode}
    glb.root["meshes"][0]["primitives"].append(short)
    scene = load(glb)
    assert scene.triangle_count == 1
    assert scene.meshes[0].primitives[1].faces.shape == (0, 3)


def test_points_and_lines_are_counted():
    glb = one_triangle()
    glb.root["meshes"][0]["primitives"] += [glb.triangle(mode=m) for m in (0, 1, 2, 3)]
    scene = load(glb)
    assert scene.triangle_count == 1
    assert scene.notes == ("4 primitives are of points or lines: not drawn",)
    assert scene.report.skipped == ("4 primitives of points or lines",)
    fails(glb, "strict", "4 primitives of points or lines", strict=True)
    glb.root["meshes"][0]["primitives"][1]["mode"] = 7
    fails(glb, "mode is 7")


# --------------------------------------------------------------------- accessors


@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.int16, np.uint16])
def test_every_normalised_integer_is_the_nearest_float32(dtype):
    info = np.iinfo(dtype)
    codes = np.arange(info.min, info.max + 1).astype(dtype)
    found = as_float32(codes, normalized=True)
    assert found.dtype == np.float32
    step = 1 if codes.size == 256 else 251
    for code, value in zip(codes[::step].tolist(), found[::step]):
        assert value == max(nearest(code, info.max), np.float32(-1)), code
    assert found[-1] == 1.0
    assert found[0] == (0.0 if info.min == 0 else -1.0)
    assert (as_float32(codes, normalized=False) == codes.astype(np.float64)).all()


@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.int16, np.uint16])
@pytest.mark.parametrize("normalized", [False, True])
def test_quantised_meshes(dtype, normalized):
    most = np.iinfo(dtype).max
    codes = np.array([[0, 1, most], [most, 3, 2], [5, most, 7]], dtype)
    signed = np.iinfo(dtype).min < 0
    glb = Glb(nodes=[{"mesh": 0}], scenes=[{"nodes": [0]}])
    more = {"normalized": True} if normalized else {}
    uvs = np.ascontiguousarray(codes[:, :2])
    attributes = {
        "POSITION": glb.add(codes, stride=8, **more),
        "TEXCOORD_1": glb.add(uvs, stride=4, **more),
    }
    if signed:
        attributes["NORMAL"] = glb.add(-codes, stride=8, normalized=True)
    glb.mesh({"attributes": attributes})
    core = normalized and not signed
    fails(glb, "POSITION", "KHR_mesh_quantization")
    glb.root["extensionsRequired"] = glb.root["extensionsUsed"] = ["KHR_mesh_quantization"]
    primitive = only(load(glb))
    scale = float(most) if normalized else 1.0
    assert (primitive.positions == (codes / scale).astype(np.float32)).all()
    assert (primitive.uv1 == (uvs / scale).astype(np.float32)).all()
    assert primitive.uv0 is None
    if signed:
        assert (primitive.normals == -(codes / float(most)).astype(np.float32)).all()
    # Without the extension, texture coordinates may still be unsigned and normalised.
    glb = with_attributes({"TEXCOORD_0": (uvs, more)})
    if core:
        assert (only(load(glb)).uv0 == (uvs / scale).astype(np.float32)).all()
    else:
        fails(glb, "TEXCOORD_0", "KHR_mesh_quantization")


def test_quantised_normals_may_not_be_unsigned():
    glb = with_attributes({"NORMAL": (np.uint8([[0, 0, 255]] * 3), {"normalized": True})})
    glb.root["extensionsUsed"] = ["KHR_mesh_quantization"]
    fails(glb, "NORMAL is 3 × u1n")


@pytest.mark.parametrize("index_type", [np.uint8, np.uint16, np.uint32])
@pytest.mark.parametrize("base", [True, False])
def test_sparse_accessors(index_type, base):
    glb = one_triangle()
    places, values = index_type([0, 2]), np.float32([[9, 8, 7], [6, 5, 4]])
    views = [glb.embed(b"junk" + places.tobytes()), glb.embed(bytes(8) + values.tobytes())]
    accessor = glb.root["accessors"][0]
    accessor["sparse"] = {
        "count": 2,
        "indices": {
            "bufferView": views[0],
            "byteOffset": 4,
            "componentType": {1: 5121, 2: 5123, 4: 5125}[places.itemsize],
        },
        "values": {"bufferView": views[1], "byteOffset": 8},
    }
    expected = TRIANGLE.copy()
    if not base:
        del accessor["bufferView"]
        expected[:] = 0
    expected[[0, 2]] = values
    assert (only(load(glb)).positions == expected).all()
    for places, word in (
        ([2, 0], "growing"), ([1, 1], "growing"), ([0, 3], "reach 3 of 3")
    ):  # fmt: skip
        view = glb.embed(index_type(places).tobytes())
        accessor["sparse"]["indices"] |= {"bufferView": view, "byteOffset": 0}
        fails(glb, "sparse", word)
    accessor["sparse"]["count"] = 4
    fails(glb, "replaces 4 of 3")


def test_sparse_indices_change_triangles():
    glb = one_triangle()
    glb.root["meshes"][0]["primitives"][0]["indices"] = glb.add(np.uint16([0, 1, 2]))
    accessor = glb.root["accessors"][-1]
    accessor["sparse"] = {
        "count": 2,
        "indices": {"bufferView": glb.embed(b"\1\2"), "componentType": 5121},
        "values": {"bufferView": glb.embed(np.uint16([2, 1]).tobytes())},
    }
    assert only(load(glb)).faces.tolist() == [[0, 2, 1]]


def test_interleaved_attributes():
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(3, 8)).astype(np.float32)
    glb = Glb(nodes=[{"mesh": 0}], scenes=[{"nodes": [0]}])
    view = glb.embed(b"head" + rows.tobytes())
    glb.root["bufferViews"][view]["byteStride"] = 32
    for offset, shape in ((4, "VEC3"), (16, "VEC3"), (28, "VEC2")):
        glb.root["accessors"].append(
            {"bufferView": view, "byteOffset": offset, "componentType": 5126, "count": 3,
             "type": shape}
        )  # fmt: skip
    glb.mesh({"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}})
    primitive = only(load(glb))
    assert (primitive.positions == rows[:, :3]).all()
    assert (primitive.normals == rows[:, 3:6]).all()
    assert (primitive.uv0 == rows[:, 6:]).all()


def test_uvs_that_are_not_finite_become_zero():
    uvs = np.float32([[0.25, 1e30], [np.nan, 2], [3, np.inf]])
    scene = load(with_attributes({"TEXCOORD_0": uvs}))
    assert only(scene).uv0.tolist() == [[0.25, np.float32(1e30)], [0, 2], [3, 0]]
    assert scene.notes == ("2 texture coordinates are NaN or infinite: 0 is used",)


@pytest.mark.parametrize("kind", [np.float32, np.uint8, np.uint16])
@pytest.mark.parametrize("mode", ["MASK", "BLEND", "OPAQUE", None])
def test_vertex_alpha_is_kept_for_masks_only(kind, mode):
    most = 1 if kind is np.float32 else np.iinfo(kind).max
    rgba = (np.array([[0, 1, 0.5, 0.25], [1, 0, 0, 1], [0, 0, 1, 0]]) * most).astype(kind)
    glb = with_attributes(
        {"COLOR_0": (rgba, {"normalized": True})}, {"alphaMode": mode} if mode else {}
    )
    primitive = only(load(glb))
    expected = (rgba / float(most)).astype(np.float32)
    assert (primitive.colors == expected[:, :3]).all()
    if mode == "MASK":
        assert (primitive.alphas == expected[:, 3]).all()
    else:
        assert primitive.alphas is None


# --------------------------------------------------------------------- materials


def material_of(entry: dict[str, Any]) -> Material:
    scene = load(with_attributes({}, entry))
    return scene.materials[0]


def test_alpha_modes():
    pbr = {"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.75]}}
    mask = material_of({"alphaMode": "MASK", **pbr})
    assert (mask.alpha, mask.alpha_cutoff) == (0.75, 0.5)
    assert material_of({"alphaMode": "MASK", "alphaCutoff": 0.125, **pbr}).alpha_cutoff == 0.125
    for mode in ({}, {"alphaMode": "OPAQUE"}, {"alphaMode": "BLEND", "alphaCutoff": 0.125}):
        found = material_of({**mode, **pbr})
        assert (found.alpha, found.alpha_cutoff) == (1.0, None)
    glb = with_attributes({}, {"alphaMode": "BLEND"})
    glb.root["materials"] += [{"alphaMode": "BLEND"}, {"alphaMode": "BLEND"}]
    glb.root["meshes"][0]["primitives"] += [glb.triangle(material=2), glb.triangle(material=0)]
    scene = load(glb)
    assert scene.notes == ("2 materials with alpha are drawn opaque",)
    assert scene.report.unsupported == ("alphaMode BLEND",)
    fails(glb, "strict", "alphaMode BLEND", strict=True)


def test_emission_and_its_strength():
    entry: dict[str, Any] = {"emissiveFactor": [0.5, 0.25, 1]}
    assert material_of(entry).emissive == (0.5, 0.25, 1.0)
    entry["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": 12.5}}
    assert material_of(entry).emissive == (6.25, 3.125, 12.5)
    entry["extensions"] = {"KHR_materials_emissive_strength": {}}  # default 1
    assert material_of(entry).emissive == (0.5, 0.25, 1.0)


def test_unlit_has_a_colour_only():
    entry: dict[str, Any] = {
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 1], "roughnessFactor": 0.0},
        "emissiveFactor": [1, 1, 1],
        "extensions": {"KHR_materials_unlit": {}},
    }
    found = material_of(entry)
    assert found.unlit
    # The default metallic of 1 would make it a mirror.
    assert (found.base_color, found.metallic, found.emissive) == ((0.5, 0.25, 1), 0.0, (0, 0, 0))
    entry["extras"] = {"ssr_ref_unlit": True}
    found = material_of(entry)
    assert (found.unlit, found.metallic, found.roughness) == (True, 1.0, 0.0)
    assert found.emissive == (1, 1, 1)
    del entry["extensions"]
    assert not material_of(entry).unlit


def test_double_sided_and_factors():
    entry = {
        "name": "m",
        "doubleSided": True,
        "pbrMetallicRoughness": {"metallicFactor": 0.25, "roughnessFactor": 0.75},
    }
    assert material_of(entry) == Material("m", (1, 1, 1), 0.25, 0.75, double_sided=True)


# ---------------------------------------------------------------------- textures


TEXELS = np.arange(2 * 3 * 4, dtype=np.uint8).reshape(2, 3, 4)
SLOTS = ("baseColorTexture", "metallicRoughnessTexture", "emissiveTexture")


def textured(info: dict[str, Any], slot: str = SLOTS[0], **root: Any) -> Glb:
    """A triangle whose material reads texture 0, image 0."""
    entry = {slot: info} if slot == SLOTS[2] else {"pbrMetallicRoughness": {slot: info}}
    glb = with_attributes({"TEXCOORD_0": np.float32([[0, 0], [1, 0], [0, 1]])}, entry)
    with_png(glb, TEXELS, name="texels")
    glb.root.update({"textures": [{"source": 0}], **root})
    return glb


@pytest.mark.parametrize(("slot", "name"), list(enumerate(SLOTS)))
def test_a_texture_in_each_slot(slot, name):
    scene = load(textured({"index": 0}, name))
    (material,) = scene.materials
    assert material.textures[slot] == Texture(0)
    assert sum(t is not None for t in material.textures) == 1
    assert (scene.images[0].pixels == TEXELS).all()
    assert scene.images[0].name == "texels"
    assert scene.report.textures == (("texels", 3, 2),)
    assert scene.notes == ()
    assert scene.report.fallbacks == scene.report.unsupported == ()


WRAPS = {10497: "repeat", 33648: "mirror", 33071: "clamp"}


@pytest.mark.parametrize("s", WRAPS)
@pytest.mark.parametrize("t", WRAPS)
def test_sampler_wraps(s, t):
    glb = textured({"index": 0}, samplers=[{"wrapS": s, "wrapT": t, "magFilter": 9729}])
    glb.root["textures"][0]["sampler"] = 0
    scene = load(glb)
    assert scene.materials[0].base_color_texture == Texture(0, 0, (WRAPS[s], WRAPS[t]))
    del glb.root["samplers"][0]["wrapS"]
    assert load(glb).materials[0].base_color_texture.wrap == ("repeat", WRAPS[t])
    glb.root["samplers"][0]["wrapS"] = 33069
    fails(glb, "samplers[0].wrapS is 33069")


def test_nearest_filters_are_noted():
    glb = textured({"index": 0}, samplers=[{"magFilter": 9728}])
    glb.root["textures"][0]["sampler"] = 0
    glb.root["materials"][0]["emissiveTexture"] = {"index": 0}
    assert load(glb).notes == ("1 texture asks for NEAREST filters: drawn bilinear",)


def test_texture_transform_and_uv_sets():
    transform: dict[str, Any] = {"offset": [0.25, -1], "rotation": 0.5, "scale": [2, -3.5]}
    info: dict[str, Any] = {"index": 0, "texCoord": 1}
    glb = textured(info, extensionsRequired=["KHR_texture_transform"])
    attributes = glb.root["meshes"][0]["primitives"][0]["attributes"]
    attributes["TEXCOORD_1"] = glb.add(np.float32([[0, 0.5], [1, 0], [0, 1]]))
    assert load(glb).materials[0].base_color_texture == Texture(0, 1)
    info["extensions"] = {"KHR_texture_transform": transform}
    found = load(glb).materials[0].base_color_texture
    assert found == Texture(0, 1, offset=(0.25, -1.0), rotation=0.5, scale=(2.0, -3.5))
    transform["texCoord"] = 0  # the extension's set wins
    assert load(glb).materials[0].base_color_texture.uv_set == 0
    transform.clear()
    assert load(glb).materials[0].base_color_texture == Texture(0, 1)
    transform["rotation"] = 1e7
    fails(glb, "rotation is too large")
    transform["rotation"] = "x"
    fails(glb, "rotation")


def test_a_third_uv_set_falls_back():
    glb = textured({"index": 0, "texCoord": 2})
    scene = load(glb)
    assert scene.materials[0].base_color_texture is None
    assert scene.images == ()
    assert scene.report.fallbacks == ("material 0",)
    assert scene.notes == (
        "material 'material 0': its factor is used for baseColorTexture: it reads texture "
        "coordinates 2 (0 and 1 are read)",
    )


def test_a_texture_without_coordinates_is_noted():
    glb = textured({"index": 0})
    del glb.root["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"]
    assert load(glb).notes == ("1 primitive has no coordinates for a texture: read at (0, 0)",)


def test_only_used_images_are_read_and_each_once(tmp_path):
    glb = textured({"index": 1})
    glb.root["images"] = [{"uri": "missing.png"}, {"bufferView": 99}, *glb.root["images"] * 2]
    glb.root["textures"] = [{"source": 0}, {"source": 2}, {"source": 3}, {"source": 1}]
    glb.root["materials"] += [
        {"emissiveTexture": {"index": 0}},  # of no primitive
        {"emissiveTexture": {"index": 2}},  # the same bytes as an image of its own
    ]
    glb.root["meshes"][0]["primitives"] += [glb.triangle(material=2), glb.triangle(material=2)]
    scene = load(glb)
    assert len(scene.images) == 1
    assert scene.materials[0].base_color_texture == Texture(0)
    assert scene.materials[1].emissive_texture is None
    assert scene.materials[2].emissive_texture == Texture(0)


def test_images_and_buffers_inside_and_beside(tmp_path):
    glb = textured({"index": 0})
    reference = load(glb)
    data = png_bytes(Image("x", TEXELS))
    (tmp_path / "tex tures").mkdir()
    (tmp_path / "tex tures" / "a.png").write_bytes(data)
    (tmp_path / "b.bin").write_bytes(glb.data)
    encoded = base64.b64encode(data).decode()
    for uri, name in (
        ("tex%20tures/a.png", "a.png"),
        ("data:image/png;base64," + encoded, "image 0"),
        ("data:application/gltf-buffer;base64," + encoded.replace("=", "%3D"), "image 0"),
    ):
        root = glb.root | {"images": [{"uri": uri}]}
        root["buffers"] = [{"byteLength": len(glb.data), "uri": "b.bin"}]
        scene = load_gltf(tmp_path / "m.gltf", json.dumps(root).encode(), LoadOptions())
        assert scene.content_sha256() == reference.content_sha256()
        assert scene.report.textures == ((name, 3, 2),)
        assert scene.report.format == "glTF"
    assert reference.report.format == "GLB"


def test_missing_and_broken_images_fall_back(tmp_path):
    glb = textured({"index": 0}, "emissiveTexture")
    glb.root["materials"][0].update(name="lamp", emissiveFactor=[1, 1, 1])
    for image, word in (
        ({"uri": "missing.png"}, "'missing.png', which is missing"),
        ({"uri": "../up.png"}, "allow_outside"),
        ({"uri": "https://example.org/a.png"}, "URL"),
        ({"uri": "data:image/png;base64,AAAA"}, "PNG, JPEG or WebP"),
        ({"uri": "data:image/png;base64,#"}, "base64"),
        ({"bufferView": 0}, "PNG, JPEG or WebP"),
    ):
        glb.root["images"] = [image]
        scene = load(glb)
        assert scene.materials[0].emissive_texture is None
        assert scene.materials[0].emissive == (0, 0, 0)  # white would make it glow
        assert scene.report.fallbacks == ("lamp",)
        (note,) = scene.notes
        assert note.startswith("material 'lamp': nothing is used for emissiveTexture: ")
        assert word in note
        assert "\n" not in note
        fails(glb, word, strict=True)  # the reason itself
    glb.root["images"] = [{}]
    fails(glb, "images[0] has no data")
    glb.root["textures"] = []
    fails(glb, "textures[0] of 0")


def test_texture_extensions_use_their_fallback():
    for name in ("KHR_texture_basisu", "MSFT_texture_dds", "EXT_texture_webp"):
        other = {"extensions": {name: {"source": 7}}}
        glb = textured({"index": 0}, textures=[{"source": 0, **other}], extensionsUsed=[name])
        scene = load(glb)
        assert scene.materials[0].base_color_texture == Texture(0)
        assert scene.notes == ()
        if name == "EXT_texture_webp":
            continue
        glb.root.update(textures=[other], extensionsRequired=[name])
        scene = load(glb)
        assert scene.materials[0].base_color_texture is None
        assert scene.notes == (
            "material 'material 0': its factor is used for baseColorTexture: its image is in "
            f"{name} only",
        )
    file = io.BytesIO()
    PillowImage.new("RGBA", (5, 3), (9, 8, 7, 6)).save(file, "WEBP", lossless=True, exact=True)
    glb = textured({"index": 0})
    glb.root["images"].append({"bufferView": glb.embed(file.getvalue())})
    glb.root["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 1}}}]
    (image,) = load(glb).images
    assert (image.pixels == [9, 8, 7, 6]).all()
    assert image.size == (5, 3)


# ------------------------------------------------------------------------ scenes


def two_scenes() -> Glb:
    glb = Glb(nodes=[{"mesh": 0, "name": "a"}, {"mesh": 0, "name": "b"}, {"mesh": 0, "name": "c"}])
    glb.mesh(glb.triangle())
    glb.root["scenes"] = [{"nodes": [0], "name": "first"}, {"nodes": [1]}, {"nodes": [2, 1]}]
    glb.root["scene"] = 2
    return glb


def test_scenes_by_index_and_name():
    glb = two_scenes()
    for wanted, names, spoken in (
        (None, ["c", "b"], "scene 2"),
        (0, ["a"], "first"),
        ("first", ["a"], "first"),
        (1, ["b"], "scene 1"),
        ("scene 1", ["b"], "scene 1"),
    ):
        scene = load(glb, scene=wanted)
        assert [node.name for node in scene.nodes] == names
        assert scene.notes == (f"3 scenes: '{spoken}' is drawn",)
    fails(glb, "3 scenes", "scene 3", scene=3)
    fails(glb, "0 scenes named 'none'", "'first', 'scene 1', 'scene 2'", scene="none")
    glb.root["scenes"][1]["name"] = "first"
    fails(glb, "2 scenes named 'first'", scene="first")
    assert load(one_triangle()).notes == ()
    glb = one_triangle()
    del glb.root["scenes"], glb.root["scene"]
    fails(glb, "0 scenes", scene=0)
    fails(glb, "0 scenes", "none", scene="x")


def test_a_deep_tree_is_walked():
    count = 3000
    nodes: list[dict[str, Any]] = [
        {"children": [i + 1], "translation": [1, 0, 0]} for i in range(count)
    ]
    glb = Glb(nodes=[*nodes, {"mesh": 0}], scenes=[{"nodes": [0]}])
    glb.mesh(glb.triangle())
    assert load(glb).nodes[0].world_from_mesh[0, 3] == count


# ------------------------------------------------------------------ not drawn


def test_what_is_not_drawn_is_named():
    glb = with_attributes(
        {},
        {
            "normalTexture": {"index": 0},
            "occlusionTexture": {"index": 0},
            "extensions": {
                "KHR_materials_clearcoat": {},
                "KHR_materials_transmission": {"transmissionFactor": 1},
                "KHR_materials_pbrSpecularGlossiness": {},
                "KHR_materials_emissive_strength": {},
            },
        },
        cameras=[{"type": "perspective"}],
        animations=[{}, {}],
        extensionsUsed=["KHR_lights_punctual", "KHR_materials_sheen", "EXT_nobody", "KHR_xmp"],
    )
    glb.root["nodes"] = [
        {"mesh": 0, "skin": 0, "children": [1, 2, 3]},
        {"camera": 0},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}},
        {"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {}}}},
        {"camera": 0},  # of no scene
    ]
    glb.root["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 0}]
    glb.root["materials"].append({"extensions": {"KHR_materials_sheen": {}}})  # of no primitive
    scene = load(glb)
    assert scene.report.unsupported == (
        "EXT_mesh_gpu_instancing",
        "EXT_nobody",
        "KHR_lights_punctual",
        "KHR_materials_clearcoat",
        "KHR_materials_pbrSpecularGlossiness",
        "KHR_materials_transmission",
        "animations",
        "cameras",
        "morph targets",
        "normalTexture",
        "occlusionTexture",
        "skins",
    )
    assert scene.notes == (
        "1 node with EXT_mesh_gpu_instancing is drawn once",
        "EXT_nobody is not drawn",
        "1 light is not used",
        "KHR_materials_clearcoat is not drawn",
        "KHR_materials_pbrSpecularGlossiness is not drawn",
        "KHR_materials_transmission is not drawn",
        "2 animations are not played",
        "1 camera is not used",
        "1 primitive with morph targets is drawn in base shape",
        "normalTexture is not drawn",
        "occlusionTexture is not drawn",
        "1 skinned mesh is drawn in bind pose",
    )
    fails(glb, "strict", "EXT_mesh_gpu_instancing; EXT_nobody; KHR_lights_punctual and 9 more",
          strict=True)  # fmt: skip


def test_variants_draw_the_default():
    glb = with_attributes({}, {"name": "default look"}, extensionsUsed=["KHR_materials_variants"])
    glb.root["materials"].append({"name": "other"})
    variants = {"mappings": [{"material": 1, "variants": [0]}]}
    primitive = glb.root["meshes"][0]["primitives"][0]
    primitive["extensions"] = {"KHR_materials_variants": variants}
    scene = load(glb, strict=True)
    assert scene.materials[only(scene).material].name == "default look"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("KHR_draco_mesh_compression", ["export without Draco"]),
        ("EXT_meshopt_compression", ["export without meshopt"]),
        ("KHR_meshopt_compression", ["export without meshopt"]),
        ("EXT_mesh_gpu_instancing", ["not drawn", "export without"]),
        ("KHR_materials_pbrSpecularGlossiness", ["export without"]),
        ("KHR_materials_transmission", ["export without"]),
        ("VENDOR_nobody_knows", ["export without"]),
    ],
)
def test_required_extensions_that_are_refused(name, words):
    glb = one_triangle(extensionsRequired=[name])
    fails(glb, name, *words)


@pytest.mark.parametrize(
    "name", ["KHR_mesh_quantization", "KHR_texture_transform", "KHR_materials_unlit",
             "KHR_materials_emissive_strength", "KHR_materials_variants", "KHR_materials_ior",
             "KHR_lights_punctual", "KHR_xmp_json_ld"],
)  # fmt: skip
def test_required_extensions_that_are_not(name):
    assert load(one_triangle(extensionsRequired=[name], extensionsUsed=[name])).triangle_count == 1


def test_compression_with_a_fallback_beside_it():
    glb = one_triangle(extensionsUsed=["KHR_draco_mesh_compression", "EXT_meshopt_compression"])
    primitive = glb.root["meshes"][0]["primitives"][0]
    draco = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    primitive["extensions"] = draco
    glb.root["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": {"buffer": 0}}
    scene = load(glb)
    assert (only(scene).positions == TRIANGLE).all()
    assert scene.report.unsupported == ()
    view = glb.root["accessors"][0].pop("bufferView")
    fails(glb, "KHR_draco_mesh_compression", "export without Draco")
    glb.root["accessors"][0]["bufferView"] = view
    glb.root["bufferViews"][0]["buffer"] = 1
    buffers = [{"byteLength": 36}, {"byteLength": 36, "extensions": {}}]
    data = json.dumps({**glb.root, "buffers": buffers}).encode()
    with pytest.raises(FileError, match="export without meshopt"):
        load_gltf(Path("a.gltf"), data, LoadOptions())


# ------------------------------------------------------------------------ report


def test_triangles_that_cannot_be_seen_are_counted():
    nan, inf = np.nan, np.inf
    points = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, 0, 0], [nan, 0, 0], [inf, 0, 0]])
    faces = [[0, 1, 2], [0, 1, 1], [0, 1, 3], [1, 2, 1], [0, 1, 4], [5, 5, 1], [2, 1, 0]]
    glb = Glb(nodes=[{"mesh": 0}, {"mesh": 0}], scenes=[{"nodes": [0, 1]}])
    glb.mesh(
        {"attributes": {"POSITION": glb.add(points)},
         "indices": glb.add(np.uint8(faces).reshape(-1))},
        glb.triangle(),
    )  # fmt: skip
    scene = load(glb)
    report = scene.report
    assert (report.triangles, report.degenerate, report.non_finite) == (8, 3, 2)
    assert scene.triangle_count == 16  # two instances

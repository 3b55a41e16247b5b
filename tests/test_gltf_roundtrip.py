"""scene.glb gives back what was drawn: random scenes with every feature on and off."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ssr_ref.errors import FileError
from ssr_ref.fileio import scene_glb
from ssr_ref.fileio.scene_glb import scene_glb_bytes
from ssr_ref.meshfiles.gltf_scene import load_gltf
from ssr_ref.meshfiles.options import LoadOptions
from ssr_ref.scene import Material, Mesh, Node, Primitive, Scene
from ssr_ref.texture import Image, Texture

FACTOR = st.one_of(st.sampled_from([0.0, -0.0, 1.0, 0.1, 1 / 3, 5e-324]), st.floats(0, 1))
NUMBER = st.one_of(st.sampled_from([0.0, -0.0, 1.0, -1.0]), st.floats(-1e9, 1e9))


def reload(scene: Scene, **options: Any) -> Scene:
    return load_gltf(Path("scene.glb"), scene_glb_bytes(scene), LoadOptions(**options))


def maybe(strategy: Any) -> Any:
    return st.one_of(st.none(), strategy)


@st.composite
def textures(draw: Any, images: int) -> Texture:
    wrap = st.sampled_from(["repeat", "mirror", "clamp"])
    pair = st.tuples(NUMBER, NUMBER)
    moved = draw(st.booleans())
    more = {"offset": draw(pair), "rotation": draw(st.floats(-9, 9)), "scale": draw(pair)}
    return Texture(
        draw(st.integers(0, images - 1)),
        draw(st.integers(0, 1)),
        (draw(wrap), draw(wrap)),
        **(more if moved else {}),
    )


@st.composite
def materials(draw: Any, images: int) -> Material:
    rgb = st.tuples(FACTOR, FACTOR, FACTOR)
    texture = maybe(textures(images)) if images else st.none()
    emission = st.tuples(*[st.one_of(FACTOR, st.floats(0, 1e6), st.just(1.7e308))] * 3)
    return Material(
        "m",
        draw(rgb),
        draw(FACTOR),
        draw(FACTOR),
        draw(emission),
        draw(maybe(rgb)),
        draw(st.booleans()),
        draw(st.sampled_from([1.0, 0.0, -0.0, 0.3, 2.0])),
        draw(maybe(st.sampled_from([0.0, 0.5, 0.7, 1.5]))),
        draw(st.booleans()),
        draw(texture),
        draw(texture),
        draw(texture),
        draw(maybe(st.sampled_from([0.0, 0.3, np.inf]))),
    )


@st.composite
def primitives(draw: Any, count: int) -> Primitive:
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    n = draw(st.integers(3, 9))

    def attribute(*shape: int) -> np.ndarray | None:
        if not draw(st.booleans()):
            return None
        return (rng.normal(size=(n, *shape)) * 10.0 ** rng.integers(-20, 20)).astype(np.float32)

    return Primitive(
        rng.normal(size=(n, 3)) * 10.0 ** rng.integers(-30, 30, (n, 3)),
        rng.integers(0, n, (draw(st.integers(1, 5)), 3)),
        draw(st.integers(0, count - 1)),
        attribute(3),
        attribute(3),
        attribute(2),
        attribute(2),
        attribute(),
    )


@st.composite
def scenes(draw: Any) -> Scene:
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    images = []
    for i in range(draw(st.integers(0, 2))):
        dtype = draw(st.sampled_from([np.uint8, np.uint16]))
        shape = (draw(st.integers(1, 4)), draw(st.integers(1, 5)), 4)
        images.append(Image(f"i{i}", rng.integers(0, np.iinfo(dtype).max + 1, shape).astype(dtype)))
    looks = draw(st.lists(materials(len(images)), min_size=1, max_size=3))
    meshes = [
        Mesh("mesh", tuple(draw(st.lists(primitives(len(looks)), min_size=1, max_size=3))))
        for _ in range(draw(st.integers(1, 2)))
    ]
    nodes = []
    for _ in range(draw(st.integers(1, 3))):
        matrix = np.eye(4) + 0.1 * rng.normal(size=(4, 4))
        matrix[3] = (0, 0, 0, 1)
        nodes.append(Node("node", int(rng.integers(len(meshes))), matrix))
    return Scene(tuple(meshes), tuple(nodes), tuple(looks), images=tuple(images), name="s")


@settings(deadline=None, max_examples=120)
@given(scenes())
def test_a_scene_comes_back_whole(scene):
    again = reload(scene, strict=True)
    assert again.content_sha256() == scene.content_sha256()
    # A loaded scene writes itself again: what the hash may not see is kept too.
    twice = replace(reload(again), name=again.name)
    assert scene_glb_bytes(twice) == scene_glb_bytes(again)


def full_scene(**more: Any) -> Scene:
    triangle = Primitive(
        np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]),
        [[0, 1, 2]],
        0,
        uv0=np.float32([[0, 0.1], [1, 0], [0, 1]]),
        uv1=np.float32([[5, 0.2], [1, 0], [0, 1]]),
        colors=np.float32([[0.1, 0.2, 0.3]] * 3),
        alphas=np.float32([0.25, 0.5, 1]),
    )
    material = Material(
        alpha=0.75,
        alpha_cutoff=0.25,
        unlit=True,
        metallic=0.5,
        base_color_texture=Texture(1, 1, ("clamp", "mirror"), (0.5, 0.25), 0.5, (2.0, 3.0)),
        metallic_roughness_texture=Texture(0),
        emissive_texture=Texture(1, 1, ("clamp", "mirror")),
    )
    images = tuple(
        Image(name, np.full((2, 3, 4), value, dtype))
        for name, value, dtype in (("grey", 7, np.uint8), ("deep", 777, np.uint16), ("un", 1, "u1"))
    )
    return replace(
        Scene((Mesh("m", (triangle,)),), (Node("n", 0),), (material,), images=images), **more
    )


def file_json(data: bytes) -> Any:
    return json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])


def test_the_file_says_what_it_uses():
    root = file_json(scene_glb_bytes(full_scene()))
    assert root["extensionsUsed"] == ["KHR_materials_unlit", "KHR_texture_transform"]
    assert root["extensionsRequired"] == ["KHR_texture_transform"]
    assert [image["name"] for image in root["images"]] == ["deep", "grey"]  # used ones only
    assert root["samplers"] == [
        {"wrapS": 33071, "wrapT": 33648},
        {"wrapS": 10497, "wrapT": 10497},
    ]
    assert root["textures"] == [{"source": 0, "sampler": 0}, {"source": 1, "sampler": 1}]
    (material,) = root["materials"]
    assert (material["alphaMode"], material["alphaCutoff"]) == ("MASK", 0.25)
    assert material["pbrMetallicRoughness"]["baseColorFactor"][3] == 0.75
    (primitive,) = root["meshes"][0]["primitives"]
    color = root["accessors"][primitive["attributes"]["COLOR_0"]]
    assert color["type"] == "VEC4"
    assert all(view["byteOffset"] % 4 == 0 for view in root["bufferViews"])
    assert root["buffers"][0]["byteLength"] % 4 == 0


@pytest.mark.parametrize(
    "change",
    [
        {"alpha": 0.5}, {"alpha_cutoff": 0.5}, {"alpha_cutoff": None}, {"unlit": False},
        {"metallic": 0.25}, {"base_color_texture": None}, {"emissive_texture": Texture(0)},
        {"metallic_roughness_texture": Texture(1)}, {"emissive": (0.0, 0.0, 1.0)},
        {"base_color_texture": Texture(1, 1, ("clamp", "mirror"), (0.5, 0.25), 0.5, (2.0, 4.0))},
        {"base_color_texture": Texture(1, 1, ("clamp", "mirror"), (0.5, 0.25), -0.5, (2.0, 3.0))},
        {"base_color_texture": Texture(1, 1, ("clamp", "clamp"), (0.5, 0.25), 0.5, (2.0, 3.0))},
        {"emissive_texture": Texture(1, 1, ("clamp", "mirror"), (-0.0, 0.0))},
        {"emissive": (0.0, 5e-324, 2.0)}, {"emissive": (1.7e308, 0.5, 0.0)},
        {"base_color_texture": Texture(1, 0, ("clamp", "mirror"), (0.5, 0.25), 0.5, (2.0, 3.0))},
    ],
)  # fmt: skip
def test_every_field_travels(change):
    """Each change alters the hash, on both sides alike: none is lost on the way."""
    scene = full_scene()
    changed = replace(scene, materials=(replace(scene.materials[0], **change),))
    assert changed.content_sha256() != scene.content_sha256()
    assert reload(changed).content_sha256() == changed.content_sha256()


def test_bytes_of_a_plain_scene_hold_nothing_new():
    """A scene without the optional parts is written without a trace of them."""
    plain = Primitive(np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]])
    root = file_json(scene_glb_bytes(Scene((Mesh("m", (plain,)),), (Node("n", 0),))))
    assert sorted(root) == [
        "accessors", "asset", "bufferViews", "buffers", "materials", "meshes", "nodes", "scene",
        "scenes",
    ]  # fmt: skip
    assert sorted(root["materials"][0]) == [
        "doubleSided", "emissiveFactor", "name", "pbrMetallicRoughness",
    ]  # fmt: skip
    assert root["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][3] == 1.0
    assert sorted(root["meshes"][0]["primitives"][0]) == [
        "attributes", "indices", "material", "mode",
    ]  # fmt: skip


def test_a_scene_over_four_gigabytes_is_refused(monkeypatch):
    scene = full_scene()
    monkeypatch.setattr(scene_glb, "_MOST_BYTES", len(scene_glb_bytes(scene)) - 1)
    with pytest.raises(FileError, match="expected at most"):
        scene_glb_bytes(scene)
    monkeypatch.setattr(scene_glb, "_MOST_BYTES", scene_glb._MOST_BYTES + 1)
    assert scene_glb_bytes(scene)


def test_trimesh_sees_texture_and_coordinates(tmp_path):
    import trimesh

    scene = full_scene()
    material = replace(scene.materials[0], base_color_texture=Texture(0), unlit=False)
    path = tmp_path / "scene.glb"
    path.write_bytes(scene_glb_bytes(replace(scene, materials=(material,))))
    (found,) = trimesh.load_scene(path, process=False).geometry.values()
    uv0 = scene.meshes[0].primitives[0].uv0
    # trimesh turns v up.
    assert np.allclose(found.visual.uv, np.stack([uv0[:, 0], 1 - uv0[:, 1]], axis=1))
    assert np.array_equal(
        np.asarray(found.visual.material.baseColorTexture), scene.images[0].pixels
    )

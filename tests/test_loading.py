"""Loading mesh files and writing scene.glb. Every input is built here, in `tmp_path`."""

from __future__ import annotations

import base64
import copy
import json
import logging
import os
import random
import struct
import subprocess
import sys
import types
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from glb_file import TRIANGLE, Glb, one_triangle

import ssr_ref
from ssr_ref import transforms
from ssr_ref.errors import FileError, SettingsError
from ssr_ref.fileio import meshes as meshes_module
from ssr_ref.fileio.load import load
from ssr_ref.fileio.meshes import FORMATS, load_mesh, with_normals
from ssr_ref.fileio.scene_glb import scene_glb_bytes, write_scene_glb
from ssr_ref.scene import Lights, Material, Mesh, Node, Primitive, Scene

CUBE_CORNERS = np.array(
    [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32
)  # corner 4x + 2y + z
CUBE_QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def same_bits(a: Any, b: Any) -> bool:
    a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


def fails(path: Path, *words: str, call: Callable[..., Any] = load_mesh, **options: Any) -> str:
    """The one line of the FileError that `call(path)` must raise, with all of `words` in it."""
    with pytest.raises(FileError) as caught:
        call(path, **options)
    message = str(caught.value)
    assert "\n" not in message
    assert "expected" in message
    assert len(message) < 700
    for word in words:
        assert word in message, message
    return message


# ------------------------------------------------------------------ glTF: arrays


@pytest.mark.parametrize("index_type", [np.uint8, np.uint16, np.uint32])
@pytest.mark.parametrize("stride", [0, 12, 28])
def test_positions_and_normals_arrive_bit_for_bit(tmp_path, index_type, stride):
    rng = np.random.default_rng(7)
    # Any finite float32: subnormals, both zeros, 1e38. Normals need be neither unit nor plausible.
    bits = rng.integers(0, 2**32, (2, 97, 3), dtype=np.uint32)
    bits[(bits >> 23) & 0xFF == 0xFF] ^= 1 << 30
    positions, normals = bits.view(np.float32)
    faces = rng.integers(0, 97, (61, 3)).astype(index_type)
    glb = Glb(nodes=[{"mesh": 0, "name": "soup"}], scenes=[{"nodes": [0]}])
    glb.mesh(
        {
            "attributes": {
                "POSITION": glb.add(positions, stride=stride, offset=8),
                "NORMAL": glb.add(normals, stride=stride),
            },
            "indices": glb.add(faces.reshape(-1, 1)),
        }
    )
    scene = load_mesh(glb.write(tmp_path / "soup.GLB"))
    (primitive,) = scene.meshes[0].primitives
    assert same_bits(primitive.positions, positions)
    assert same_bits(primitive.normals, normals)
    assert same_bits(primitive.faces, faces.astype(np.int32))
    assert primitive.colors is None
    assert scene.name == "soup"
    assert scene.nodes[0].name == "soup"
    assert scene.view is None
    assert scene.notes == ()


def test_colours_are_normalised_and_nan_becomes_white(tmp_path):
    glb = Glb(nodes=[{"mesh": 0}], scenes=[{"nodes": [0]}])
    u8 = np.array([[0, 1, 255, 7], [128, 64, 32, 255], [254, 3, 2, 1]], np.uint8)
    u16 = np.array([[0, 1, 65535], [32768, 5, 6], [65534, 8, 9]], np.uint16)
    f32 = np.array([[0.1, 0.2, np.nan], [0.25, 0.5, 1.0], [0, -0.0, 0.3]], np.float32)
    glb.mesh(
        *(
            {"attributes": {"POSITION": glb.add(TRIANGLE), "COLOR_0": glb.add(c, stride=s)}}
            for c, s in ((u8, 0), (u16, 8), (f32, 0))
        )
    )
    scene = load_mesh(glb.write(tmp_path / "colours.glb"))
    a, b, c = (p.colors for p in scene.meshes[0].primitives)
    # One division, rounded once: the float32 nearest to the exact quotient.
    assert same_bits(a, (u8[:, :3].astype(np.float64) / 255).astype(np.float32))
    assert same_bits(b, (u16.astype(np.float64) / 65535).astype(np.float32))
    f32[0] = 1.0
    assert same_bits(c, f32)
    assert scene.notes == ("1 vertex colour is NaN or infinite: white is used",)


def test_missing_indices_and_normals(tmp_path):
    glb = Glb(nodes=[{"mesh": 0}], scenes=[{"nodes": [0]}])
    glb.mesh({"attributes": {"POSITION": glb.add(np.tile(TRIANGLE, (2, 1)))}})
    scene = load_mesh(glb.write(tmp_path / "plain.glb"))
    (primitive,) = scene.meshes[0].primitives
    assert primitive.faces.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert primitive.normals is None  # flat, as glTF demands


def test_other_primitive_modes_are_skipped_with_a_note(tmp_path):
    glb = Glb(nodes=[{"mesh": 0}, {"mesh": 1}], scenes=[{"nodes": [0, 1]}])
    glb.mesh(glb.triangle(mode=1), glb.triangle(mode=4), glb.triangle(mode=3))
    glb.mesh(glb.triangle(mode=0))
    scene = load_mesh(glb.write(tmp_path / "modes.glb"))
    assert scene.triangle_count == 1
    assert len(scene.nodes) == 1
    assert scene.notes == ("3 primitives are of points or lines: not drawn",)
    glb.root["scenes"] = [{"nodes": [1]}]
    fails(glb.write(tmp_path / "points.glb"), "no triangles", "1 primitives of points")


# ------------------------------------------------------------------- glTF: nodes


Matrix = list[list[Fraction]]


def exact_product(a: Matrix, b: Matrix) -> Matrix:
    return [
        [sum((a[i][k] * b[k][j] for k in range(4)), Fraction(0)) for j in range(4)]
        for i in range(4)
    ]


def exact_local(node: dict[str, Any], *, absolute: bool = False, order: str = "TRS") -> Matrix:
    """T·R·S as rationals; `absolute`: the sum of the terms' sizes instead, for error bounds."""
    f = abs if absolute else (lambda v: v)
    sign = 1 if absolute else -1
    one = [[Fraction(int(i == j)) for j in range(4)] for i in range(4)]
    t, r, s = copy.deepcopy(one), copy.deepcopy(one), copy.deepcopy(one)
    for i, v in enumerate(node.get("translation", [0, 0, 0])):
        t[i][3] = f(Fraction(v))
    for i, v in enumerate(node.get("scale", [1, 1, 1])):
        s[i][i] = f(Fraction(v))
    x, y, z, w = (f(Fraction(v)) for v in node.get("rotation", [0, 0, 0, 1]))
    r[0][:3] = [1 + sign * 2 * (y * y + z * z), 2 * (x * y + sign * z * w), 2 * (x * z + y * w)]
    r[1][:3] = [2 * (x * y + z * w), 1 + sign * 2 * (x * x + z * z), 2 * (y * z + sign * x * w)]
    r[2][:3] = [2 * (x * z + sign * y * w), 2 * (y * z + x * w), 1 + sign * 2 * (x * x + y * y)]
    m = {"T": t, "R": r, "S": s}
    return exact_product(exact_product(m[order[0]], m[order[1]]), m[order[2]])


def random_node(rng: random.Random) -> dict[str, Any]:
    """Float32 values as exporters write them; scales of both signs, a rotation of unit length."""
    q = [rng.gauss(0, 1) for _ in range(4)]
    length = sum(v * v for v in q) ** 0.5
    node = {
        "translation": [rng.uniform(-50, 50) for _ in range(3)],
        "rotation": [v / length for v in q],
        "scale": [rng.choice([-1, 1]) * rng.uniform(0.1, 8) for _ in range(3)],
    }
    return {k: [float(np.float32(v)) for v in values] for k, values in node.items()}


@pytest.mark.parametrize("seed", range(12))
def test_world_positions_equal_exact_rationals_to_two_ulp(tmp_path, seed):
    rng = random.Random(seed)
    chain = [random_node(rng) for _ in range(3)]
    nodes = [{**chain[2], "mesh": 0}, {**chain[0], "children": [2]}, {**chain[1], "children": [0]}]
    glb = Glb(nodes=nodes, scenes=[{"nodes": [1]}])
    positions = np.array([[rng.uniform(-9, 9) for _ in range(3)] for _ in range(12)], np.float32)
    glb.mesh({"attributes": {"POSITION": glb.add(positions)}})
    scene = load_mesh(glb.write(tmp_path / "nested.glb"))
    (node,) = scene.nodes
    found = np.empty((12, 3))
    transforms.transform_points(
        node.world_from_mesh, scene.meshes[0].primitives[0].positions, found
    )

    def worst(order: str) -> float:
        """Greatest error in units of 2⁻⁵³ times the sum of the sizes of all terms."""
        world, size = (
            exact_product(exact_product(m[0], m[1]), m[2])
            for m in (
                [exact_local(n, order=order) for n in chain],
                [exact_local(n, absolute=True) for n in chain],
            )
        )
        errors = []
        for p, got in zip(positions.tolist(), found.tolist()):
            h = [*map(Fraction, p), Fraction(1)]
            for i in range(3):
                exact = sum((world[i][k] * h[k] for k in range(4)), Fraction(0))
                scale = sum((size[i][k] * abs(h[k]) for k in range(4)), Fraction(0))
                errors.append(abs(Fraction(got[i]) - exact) / (scale * Fraction(1, 2**52)))
        return float(max(errors))

    assert worst("TRS") <= 2.0
    assert worst("SRT") > 1e6  # the predicate sees a wrong order
    mirrored = np.prod([np.sign(n["scale"]).prod() for n in chain]) < 0
    assert (transforms.determinant3(node.world_from_mesh) < 0) == mirrored


def test_exact_transforms_and_column_major_matrices(tmp_path):
    # A quarter turn about (1, 1, 1) sends x to y to z to x: quaternion (½, ½, ½, ½). All exact.
    columns = [0, 2, 0, 0, -3, 0, 0, 0, 0, 0, 1, 0, 10, 20, 30, 1]
    nodes = [
        {"matrix": columns, "children": [1]},
        {"rotation": [0.5] * 4, "scale": [-1, 4, 0.5], "translation": [5, 6, 7], "mesh": 0},
    ]
    glb = Glb(nodes=nodes, scenes=[{"nodes": [0]}])
    glb.mesh(glb.triangle())
    (node,) = load_mesh(glb.write(tmp_path / "exact.glb")).nodes
    # parent: x' = −3y + 10, y' = 2x + 20, z' = z + 30; child: (0.5z + 5, −x + 6, 4y + 7).
    assert node.world_from_mesh.tolist() == [
        [3.0, 0.0, 0.0, -8.0],
        [0.0, 0.0, 1.0, 30.0],
        [0.0, 4.0, 0.0, 37.0],
        [0.0, 0.0, 0.0, 1.0],
    ]


def test_instances_default_scene_and_unreachable_nodes(tmp_path):
    nodes = [
        {"mesh": 1, "name": "unreachable"},
        {"mesh": 1, "name": "left", "translation": [-2, 0, 0]},
        {"children": [1, 3], "scale": [1, 1, -1], "camera": 0},
        {"mesh": 1, "translation": [2, 0, 0]},
        {"mesh": 0, "name": "other scene"},
    ]
    scenes = [{"nodes": [4]}, {"nodes": [2]}]
    glb = Glb(nodes=nodes, scenes=scenes, cameras=[{"type": "perspective"}])
    glb.mesh(glb.triangle(), name="unused")
    glb.mesh(glb.triangle(), name="shared")
    glb.root["scene"] = 1
    scene = load_mesh(glb.write(tmp_path / "instances.glb"))
    assert [n.name for n in scene.nodes] == ["left", "shared"]
    assert [n.mesh for n in scene.nodes] == [0, 0]
    assert [m.name for m in scene.meshes] == ["shared"]
    assert [n.world_from_mesh[0, 3] for n in scene.nodes] == [-2.0, 2.0]
    assert [transforms.determinant3(n.world_from_mesh) for n in scene.nodes] == [-1.0, -1.0]
    del glb.root["scene"]  # then the first
    names = [n.name for n in load_mesh(glb.write(tmp_path / "first.glb")).nodes]
    assert names == ["other scene"]
    del glb.root["scenes"]  # then every root
    names = [n.name for n in load_mesh(glb.write(tmp_path / "none.glb")).nodes]
    assert names == ["unreachable", "left", "shared", "other scene"]


def test_two_primitives_with_materials_and_the_default(tmp_path):
    glb = one_triangle(
        materials=[
            {"name": "unused", "normalTexture": {"index": 3}},
            {
                "name": "gold",
                "pbrMetallicRoughness": {
                    "baseColorFactor": [1.0, 0.75, 0.25, 0.5],
                    "metallicFactor": 0.875,
                    "roughnessFactor": 0.125,
                },
                "emissiveFactor": [0.5, 0.25, 0],
                "extensions": {
                    "KHR_materials_emissive_strength": {"emissiveStrength": 4},
                    "KHR_materials_clearcoat": {"clearcoatTexture": {"index": 2}},
                },
                "doubleSided": True,
                "alphaMode": "BLEND",
            },
            {"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}},  # of no image
        ],
        textures=[{}],
    )
    glb.root["nodes"] = [{"mesh": 1}]
    glb.mesh(*(glb.triangle(**m) for m in ({"material": 1}, {}, {"material": 2}, {"material": 1})))
    scene = load_mesh(glb.write(tmp_path / "materials.glb"))
    gold, default, glowing, again = (
        scene.materials[p.material] for p in scene.meshes[0].primitives
    )
    assert gold == Material(
        "gold", (1.0, 0.75, 0.25), 0.875, 0.125, (2.0, 1.0, 0.0), double_sided=True
    )
    assert again is gold
    # glTF 2.0, 3.9: every factor of the default material is 1, emission 0.
    assert default == Material("default", (1.0, 1.0, 1.0), 1.0, 1.0)
    assert glowing.emissive == (0.0, 0.0, 0.0)
    assert scene.notes == (
        "material 'material 2': nothing is used for emissiveTexture: no image",
        "KHR_materials_clearcoat is not drawn",
        "1 material with alpha is drawn opaque",
    )
    assert len(scene.nodes) == 1  # one object with all its primitives


def test_gltf_with_data_uri_and_with_a_file_beside(tmp_path):
    glb = one_triangle(extensionsRequired=["KHR_materials_unlit"])
    reference = load_mesh(glb.write(tmp_path / "a.glb")).content_sha256()
    uri = "data:application/octet-stream;base64," + base64.b64encode(glb.data).decode()
    (tmp_path / "my data").mkdir()
    (tmp_path / "my data" / "b.bin").write_bytes(glb.data)
    for name, source in (("inline.gltf", uri), ("beside.GLTF", "my%20data/b.bin")):
        root = glb.root | {"buffers": [{"byteLength": len(glb.data), "uri": source}]}
        (tmp_path / name).write_text(json.dumps(root))
        assert load_mesh(tmp_path / name).content_sha256() == reference
    (tmp_path / "my data" / "b.bin").write_bytes(glb.data[:-1])
    fails(tmp_path / "beside.GLTF", "35 bytes", "expected 36")
    (tmp_path / "my data" / "b.bin").unlink()
    fails(tmp_path / "beside.GLTF", "my data/b.bin", "missing")


# -------------------------------------------------------------------- glTF: errors


def put(*keys: Any, value: Any) -> Callable[[Glb], None]:
    def change(glb: Glb) -> None:
        target: Any = glb.root
        for key in keys[:-1]:
            target = target[key]
        target[keys[-1]] = value

    return change


BAD_GLTF = {
    "version 1": (put("asset", value={"version": "1.0"}), "version 1.0"),
    "no asset": (put("asset", value=None), "version None"),
    "draco": (put("extensionsRequired", value=["KHR_draco_mesh_compression"]), "KHR_draco"),
    "meshopt": (put("extensionsRequired", value=["EXT_meshopt_compression"]), "EXT_meshopt"),
    "sparse": (put("accessors", 0, "sparse", value={"count": 1}), "sparse"),
    "no buffer view": (lambda g: g.root["accessors"][0].pop("bufferView"), "no data"),
    "count too large": (put("accessors", 0, "count", value=4), "truncated or damaged"),
    "count negative": (put("accessors", 0, "count", value=-3), "count is -3"),
    "count a float": (put("accessors", 0, "count", value=3.0), "count is 3.0"),
    "offset too large": (put("accessors", 0, "byteOffset", value=4), "truncated or damaged"),
    "stride too small": (put("bufferViews", 0, "byteStride", value=4), "truncated or damaged"),
    "view past buffer": (put("bufferViews", 0, "byteOffset", value=8), "truncated or damaged"),
    "integer positions": (put("accessors", 0, "componentType", value=5121), "VEC3 of float32"),
    "unknown component": (put("accessors", 0, "componentType", value=5130), "component type 5130"),
    "VEC2 positions": (put("accessors", 0, "type", value="VEC2"), "VEC3 of float32"),
    "unknown type": (put("accessors", 0, "type", value="VEC9"), "VEC9"),
    "no POSITION": (put("meshes", 0, "primitives", 0, "attributes", value={}), "no POSITION"),
    "accessor missing": (
        put("meshes", 0, "primitives", 0, "attributes", "POSITION", value=9),
        "accessors[9]",
    ),
    "negative accessor": (
        put("meshes", 0, "primitives", 0, "attributes", "POSITION", value=-1),
        "accessors[-1]",
    ),
    "float indices": (put("meshes", 0, "primitives", 0, "indices", value=0), "indices"),
    "material missing": (put("meshes", 0, "primitives", 0, "material", value=0), "materials[0]"),
    "mesh missing": (put("nodes", 0, "mesh", value=1), "meshes[1]"),
    "node missing": (put("scenes", 0, "nodes", value=[1]), "nodes[1]"),
    "scene missing": (put("scene", value=3), "scenes[3]"),
    "cycle": (put("nodes", 0, "children", value=[0]), "reached twice"),
    "children no list": (put("nodes", 0, "children", value=7), "children"),
    "meshes no list": (put("meshes", value={"a": 1}), "'meshes' is not a list"),
    "mesh no object": (put("meshes", value=[3]), "meshes[0]"),
    "zero scale": (put("nodes", 0, "scale", value=[1, 0, 1]), "singular"),
    "short translation": (put("nodes", 0, "translation", value=[1, 0]), "translation"),
    "text rotation": (put("nodes", 0, "rotation", value=["a", 0, 0, 1]), "rotation"),
    "infinite scale": (put("nodes", 0, "scale", value=[1, 1e999, 1]), "Infinity"),
    "huge integer scale": (put("nodes", 0, "scale", value=[1, 10**400, 1]), "scale"),
    "projective matrix": (put("nodes", 0, "matrix", value=[1] * 16), "affine"),
    "buffer without data": (put("bufferViews", 0, "buffer", value=1), "buffers[1]"),
    "no nodes": (put("scenes", 0, "nodes", value=[]), "no triangles"),
}


@pytest.mark.parametrize("name", BAD_GLTF)
def test_bad_gltf_is_one_line(tmp_path, name):
    change, word = BAD_GLTF[name]
    glb = one_triangle()
    change(glb)
    path = glb.write(tmp_path / "bad.glb")
    assert str(path) in fails(path, word)


def test_bad_indices_and_unequal_counts_are_one_line(tmp_path):
    for name, indices, word in (
        ("range", np.array([0, 1, 3], np.uint8), "vertex 3 of 3"),
        ("huge", np.array([0, 1, 2**32 - 1], np.uint32), "vertex 4294967295 of 3"),
        ("pair", np.array([0, 1], np.uint16), "multiple of 3"),
        ("signed", np.array([0, 1, 2], np.int16), "component type 5122"),
        ("vectors", np.array([[0, 1, 2]], np.uint8), "SCALAR"),
    ):
        glb = one_triangle()
        glb.root["meshes"][0]["primitives"][0]["indices"] = glb.add(indices)
        fails(glb.write(tmp_path / f"{name}.glb"), word)
    for attribute in ("NORMAL", "COLOR_0"):
        glb = one_triangle()
        attributes = glb.root["meshes"][0]["primitives"][0]["attributes"]
        attributes[attribute] = glb.add(TRIANGLE[:2])
        fails(glb.write(tmp_path / f"{attribute}.glb"), "2 ", "3 vertices")


@pytest.mark.parametrize(
    ("uri", "word"),
    [
        ("https://example.org/a.bin", "is a URL"),
        ("/etc/passwd", "not inside the file's folder"),
        ("data:text/plain,abc", "base64"),
        ("data:;base64,###", "URI is broken"),
        ("a\0b", "a"),
        (None, "no data"),
        (7, "no data"),
    ],
)
def test_bad_buffer_uri_is_one_line(tmp_path, uri, word):
    root = one_triangle().root | {"buffers": [{"byteLength": 36, "uri": uri}]}
    path = tmp_path / "a.gltf"
    path.write_text(json.dumps(root))
    fails(path, word)


def test_every_truncation_of_a_glb_is_one_line(tmp_path):
    path = tmp_path / "cut.glb"
    data = one_triangle().bytes()
    for length in range(len(data)):
        path.write_bytes(data[:length])
        fails(path)


def test_damaged_glb_never_raises_anything_else(tmp_path):
    """Bytes of the JSON changed at random: a scene, or one FileError line."""
    glb = one_triangle(materials=[{"pbrMetallicRoughness": {"metallicFactor": 0.5}}])
    glb.root["meshes"][0]["primitives"][0].update(material=0, indices=glb.add(np.uint8([0, 1, 2])))
    glb.root["nodes"][0].update(translation=[1, 2, 3], name="n", children=[])
    data = glb.bytes()
    rng = random.Random(3)
    path = tmp_path / "damaged.glb"
    loaded = 0
    for _ in range(1500):
        bad = bytearray(data)
        for _ in range(rng.randint(1, 3)):
            bad[rng.randrange(20, len(bad))] = rng.choice(b'0129-.,:{}[]"aeE \x00\xff')
        path.write_bytes(bad)
        try:
            load_mesh(path)
            loaded += 1
        except FileError as error:
            assert "\n" not in str(error)
    assert 0 < loaded < 1500


# --------------------------------------------------------------- files of any kind


BINARY_STL_2 = bytes(80) + struct.pack("<I", 2) + np.zeros((2, 50), np.uint8).tobytes()
PLY_HEAD = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
PLY_HEAD += "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
OBJ_TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"

BAD_FILES: dict[str, tuple[str, bytes | str, str]] = {
    "glb garbage": ("a.glb", b"\x00\x01garbage\xff" * 9, "not a glTF"),
    "glb magic only": ("a.glb", b"glTF", "truncated"),
    "gltf broken JSON": ("a.gltf", '{"asset": {"version": "2.0"', "JSON"),
    "gltf deep JSON": ("a.gltf", "[" * 100_000, "JSON"),
    "gltf a list": ("a.gltf", "[]", "version"),
    "ply garbage": ("a.ply", b"\x89\xff\x00\x12" * 40, "PLY"),
    "ply without end": ("a.ply", "ply\nformat ascii 1.0\nelement vertex 3\n", "PLY"),
    "ply truncated vertices": ("a.ply", PLY_HEAD + "0 0 0\n1 0 0\n", "2 vertex rows"),
    "ply truncated face": ("a.ply", PLY_HEAD + "0 0 0\n1 0 0\n0 1 0\n", "face"),
    "ply text for number": ("a.ply", PLY_HEAD + "0 0 0\n1 x 0\n0 1 0\n3 0 1 2\n", "PLY"),
    "ply bad index": ("a.ply", PLY_HEAD + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "vertex 3 of 3"),
    "ply negative index": ("a.ply", PLY_HEAD + "0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n", "vertex -1"),
    "ply points only": (
        "a.ply",
        PLY_HEAD.replace("face 1", "face 0") + "0 0 0\n1 0 0\n0 1 0\n",
        "no triangles (3 vertices",
    ),
    "ply edges only": ("a.ply", PLY_HEAD + "0 0 0\n1 0 0\n0 1 0\n2 0 1\n", "no triangles"),
    "ply all NaN": ("a.ply", PLY_HEAD + "nan 0 0\nnan 0 0\nnan 1 0\n3 0 1 2\n", "NaN"),
    "stl garbage": ("a.stl", b"\x12\x34\xff" * 60, "no triangles"),
    "stl short": ("a.stl", b"\x12\x34", "no triangles"),
    "stl truncated": ("a.stl", BINARY_STL_2[:-1], "no triangles (183 bytes"),
    "stl none": ("a.stl", bytes(84), "no triangles"),
    "stl ASCII cut": ("a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n", "ASCII"),
    "stl all NaN": (
        "a.stl",
        bytes(80) + struct.pack("<I", 1) + np.full(12, np.nan, "<f4").tobytes() + b"\0\0",
        "NaN",
    ),
    "obj garbage": ("a.obj", b"\xff\xfe\x00\x12" * 40, "no triangles"),
    "obj points only": ("a.obj", OBJ_TRIANGLE, "no triangles (3 vertices"),
    "obj lines only": ("a.obj", OBJ_TRIANGLE + "l 1 2 3\n", "no triangles"),
    "obj text for number": ("a.obj", "v 0 0 0\nv 1 x 0\nv 0 1 0\nf 1 2 3\n", "OBJ"),
    "obj short vertex": ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1\nf 1 2 3\n", "2 coordinates"),
    "obj two corners": ("a.obj", OBJ_TRIANGLE + "f 1 2\n", "line 4"),
    "obj index zero": ("a.obj", OBJ_TRIANGLE + "f 0 1 2\n", "line 4"),
    "obj text for index": ("a.obj", OBJ_TRIANGLE + "f 1 2 3\nf 1 2 c\n", "line 5"),
    "obj index too large": ("a.obj", OBJ_TRIANGLE + "f 1 2 4\n", "OBJ"),
    "obj index too low": ("a.obj", OBJ_TRIANGLE + "f -1 -2 -4\n", "line 4"),
    "obj missing normals": ("a.obj", OBJ_TRIANGLE + "vn 0 0 1\nf 1//1 2//1 3//2\n", "normals"),
    "obj mixed corners": ("a.obj", OBJ_TRIANGLE + "vn 0 0 1\nf 1//1 2//1 3\n", "line 5"),
    "obj all NaN": ("a.obj", "v nan 0 0\nv nan 0 0\nv nan 1 0\nf 1 2 3\n", "NaN"),
    **{f"empty {ext}": (f"a{ext}", b"", "empty (0 bytes)") for ext in FORMATS},
    "unknown extension": ("a.fbx", b"Kaydara FBX", "'.fbx'"),
    "no extension": ("mesh", b"v 0 0 0", ".glb, .gltf, .obj, .ply, .stl"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_file_is_one_silent_line(tmp_path, name, capfd, caplog, recwarn):
    file, data, word = BAD_FILES[name]
    path = tmp_path / file
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    before = path.read_bytes()
    assert str(path) in fails(path, word)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == [file]
    assert capfd.readouterr() == ("", "")
    assert not caplog.records
    assert not recwarn.list


def test_trimesh_is_silenced_and_then_as_before(caplog, capfd):
    logger = logging.getLogger("trimesh")
    with meshes_module._strict_and_silent():
        logger.error("unheard")
    assert not caplog.records
    logger.error("heard")
    assert [record.message for record in caplog.records] == ["heard"]
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize("ext", [*FORMATS, ".xyz"])
def test_missing_directory_and_unreadable(tmp_path, ext, monkeypatch):
    path = tmp_path / f"a{ext}"
    fails(path, "no such file")
    fails(tmp_path / ("a" * 300 + ext), "expected")  # a name too long for the file system
    fails(Path(f"a\0b{ext}"), "expected")
    path.mkdir()
    fails(path, "is a directory")
    path.rmdir()
    if hasattr(os, "mkfifo"):
        os.mkfifo(path)
        fails(path, "a pipe")
        path.unlink()
    if ext != ".xyz":
        path.write_bytes(b"x")

        def refuse(self: Path) -> bytes:  # root reads everything, so chmod would not do
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr(Path, "read_bytes", refuse)
        fails(path, "Permission denied", "permissions")


def test_truncated_binary_files_never_give_half_a_scene(tmp_path):
    ply = PLY_HEAD.replace("ascii", "binary_little_endian").encode() + TRIANGLE.tobytes()
    ply += struct.pack("<B3i", 3, 0, 1, 2)
    stl = tmp_path / "a.stl"
    (tmp_path / "a.ply").write_bytes(ply)
    assert load_mesh(tmp_path / "a.ply").triangle_count == 1
    for length in range(1, len(ply)):
        (tmp_path / "a.ply").write_bytes(ply[:length])
        fails(tmp_path / "a.ply")
    for length in range(1, len(BINARY_STL_2)):
        stl.write_bytes(BINARY_STL_2[:length])
        fails(stl)


# ---------------------------------------------------------------------------- OBJ


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_obj_objects_materials_and_authored_normals(tmp_path):
    write(
        tmp_path / "a.mtl",
        "newmtl red\nKd 0.3 0.1 0.7\nKe 0 2 0\nPm 0.75\nPr 0.1\nmap_Kd missing.png\n",
    )
    write(tmp_path / "b c.mtl", "newmtl dull grey\nKd 0.5\nbump bump.png\nd 0.5\n")
    path = write(
        tmp_path / "two.OBJ",
        "mtllib a.mtl\nmtllib b c.mtl\nmtllib gone.mtl\n"
        + OBJ_TRIANGLE
        + "v 0.1 0.2 1e-3\nvn 0.6 0 0.8\nvn 0 0.1 0\n"
        "o first thing\nusemtl red\nf 1//1 2//1 3//2\nusemtl dull grey\nf 1 2 4\n"
        "o second\nusemtl red\nf 2//1 3//1 4//1\nusemtl nobody\nf 1 3 4\n"
        "o first thing\nusemtl red\nf 1//2 3//2 4//2\n",
    )
    scene = load_mesh(path)
    assert [n.name for n in scene.nodes] == ["first thing", "second"]
    first, second = scene.meshes
    red, grey, unknown = scene.materials
    # Kd 0.3 as written (trimesh's material would give 77/255), one number for all channels.
    assert red == Material("red", (0.3, 0.1, 0.7), 0.75, 0.1, (0.0, 2.0, 0.0))
    assert grey == Material("dull grey", (0.5, 0.5, 0.5))
    assert unknown == Material()
    assert [p.material for p in (*first.primitives, *second.primitives)] == [0, 1, 0, 2]
    shiny = first.primitives[0]
    # Corners with the same position and normal share a vertex, numbered by first use.
    corners = shiny.positions[shiny.faces].tolist()
    p = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.1, 0.2, 1e-3]], np.float32)
    assert corners == p[[[0, 1, 2], [0, 2, 3]]].tolist()
    n = np.array([[0.6, 0, 0.8], [0, 0.1, 0]], np.float32)
    assert shiny.normals is not None
    assert shiny.normals[shiny.faces].tolist() == n[[[0, 0, 1], [1, 1, 1]]].tolist()
    assert shiny.faces.tolist() == [[0, 1, 2], [3, 2, 4]]
    assert first.primitives[1].normals is None
    assert scene.notes == (
        "2 textures are not drawn yet: base colour factor used",
        "1 .mtl file is missing or unreadable",
        "1 material is in no .mtl file: grey is used",
    )


def test_obj_polygons_negative_indices_and_odd_spacing(tmp_path):
    path = write(
        tmp_path / "odd.obj",
        "# comment\n  v\t0 0 0 # origin\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 \\\n -2   -1\n"
        "s off\ng a b\n"
        "v 0 0 1\nv 1 0 1\nv 2 1 1\nv 1 2 1\nv 0 1 1\nvt 0 0\nf -5/1 -4/1 -3/-1 -2/1 -1/1\n"
        "f 1/ 2/ 3/\r\n",
    )
    scene = load_mesh(path)
    corners = [
        triangle
        for primitive in scene.meshes[0].primitives
        for triangle in primitive.positions[primitive.faces].tolist()
    ]
    v = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    v += [[0, 0, 1], [1, 0, 1], [2, 1, 1], [1, 2, 1], [0, 1, 1]]
    indices = [(0, 1, 2), (0, 2, 3), (0, 1, 2), (4, 5, 6), (4, 6, 7), (4, 7, 8)]
    assert corners == [[v[i] for i in triangle] for triangle in indices]
    assert len(scene.nodes) == 1


def test_obj_vertex_colours(tmp_path):
    rows = "v 0 0 0 0.1 0.2 0.3\nv 1 0 0 nan nan nan\nv 0 1 0 0 1 2.5\nf 1 2 3\n"
    scene = load_mesh(write(tmp_path / "c.obj", rows))
    (primitive,) = scene.meshes[0].primitives
    expected = np.array([[0.1, 0.2, 0.3], [1, 1, 1], [0, 1, 2.5]], np.float32)
    assert same_bits(primitive.colors, expected)  # not rounded to bytes
    assert scene.materials == (Material(base_color=(1.0, 1.0, 1.0)),)
    assert scene.notes == (
        "1 vertex colour is NaN or infinite: white is used",
        "1 vertex colour is above 1: used as linear RGB",
    )
    mixed = load_mesh(write(tmp_path / "m.obj", "v 0 0 1\n" + rows.replace("f 1", "f 4 1")))
    assert mixed.meshes[0].primitives[0].colors is None
    assert mixed.notes == ("vertex colours are not used: some vertices have none",)


def test_obj_vertex_order_is_that_of_first_use(tmp_path):
    """trimesh's own order of split vertices depends on an unstable sort, so on the processor."""
    rng = random.Random(5)
    rows = [f"v {rng.uniform(-1, 1)} {rng.uniform(-1, 1)} {rng.uniform(-1, 1)}" for _ in range(40)]
    rows += [f"vn {rng.uniform(-1, 1)} {rng.uniform(-1, 1)} 1" for _ in range(30)]
    pairs = [[(rng.randint(1, 40), rng.randint(1, 30)) for _ in range(3)] for _ in range(300)]
    rows += ["f " + " ".join(f"{v}//{n}" for v, n in face) for face in pairs]
    (primitive,) = load_mesh(write(tmp_path / "a.obj", "\n".join(rows))).meshes[0].primitives
    numbers = {pair: i for i, pair in enumerate(dict.fromkeys(p for face in pairs for p in face))}
    assert primitive.faces.tolist() == [[numbers[pair] for pair in face] for face in pairs]


# -------------------------------------------------------------------- PLY and STL


def test_ply_ascii_and_binary_agree(tmp_path):
    rng = np.random.default_rng(2)
    quad = rng.normal(size=(4, 3)).astype(np.float32)
    normals = rng.normal(size=(4, 3)).astype(np.float32)
    colors = np.array([[255, 0, 1, 9], [1, 2, 3, 9], [4, 5, 6, 9], [7, 128, 9, 9]], np.uint8)
    fields = [f"property float {k}" for k in ("x", "y", "z", "nx", "ny", "nz")]
    fields += [f"property uchar {k}" for k in ("red", "green", "blue", "alpha")]
    expected = (colors[:, :3].astype(np.float64) / 255).astype(np.float32)
    for kind, order in (("ascii", "<"), ("binary_little_endian", "<"), ("binary_big_endian", ">")):
        head = [
            "ply",
            f"format {kind} 1.0",
            "comment Übung",
            "comment TextureFile a.png",
            "element vertex 4",
            *fields,
            "element face 1",
            "property list uchar int vertex_indices",
            "end_header\n",
        ]
        if kind == "ascii":
            rows = [
                " ".join(map(repr, [*map(float, p), *map(float, n), *map(int, c)]))
                for p, n, c in zip(quad, normals, colors)
            ]
            body = "\n".join([*rows, "4 0 1 2 3", ""]).encode()
        else:
            body = b"".join(
                np.concatenate([p, n]).astype(f"{order}f4").tobytes() + c.tobytes()
                for p, n, c in zip(quad, normals, colors)
            )
            body += struct.pack(f"{order}B4i", 4, 0, 1, 2, 3)
        path = tmp_path / f"{kind}.PLY"
        path.write_bytes("\n".join(head).encode("latin-1") + body)
        scene = load_mesh(path)
        (primitive,) = scene.meshes[0].primitives
        assert same_bits(primitive.positions, quad)
        assert same_bits(primitive.normals, normals)
        assert same_bits(primitive.colors, expected)
        assert primitive.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
        assert scene.materials == (Material(base_color=(1.0, 1.0, 1.0)),)
        assert scene.notes == ("1 texture is not drawn yet: base colour factor used",)


def test_ply_mixed_polygons(tmp_path):
    text = PLY_HEAD.replace("vertex 3", "vertex 6").replace("face 1", "face 3")
    text += "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n4 0 1 2 3\n3 0 1 4\n5 0 1 2 3 4\n"
    (primitive,) = load_mesh(write(tmp_path / "a.ply", text)).meshes[0].primitives
    assert sorted(primitive.faces.tolist()) == sorted(
        [[0, 1, 2], [2, 3, 0], [0, 1, 4], [0, 1, 2], [0, 2, 3], [0, 3, 4]]
    )


def test_stl_binary_and_ascii(tmp_path):
    rng = np.random.default_rng(4)
    corners = rng.normal(size=(5, 3, 3)).astype(np.float32)
    rows = b"".join(np.zeros(3, "<f4").tobytes() + c.tobytes() + b"\0\0" for c in corners)
    path = tmp_path / "b.stl"
    path.write_bytes(b"solid but binary".ljust(80) + struct.pack("<I", 5) + rows)
    scene = load_mesh(path)
    (primitive,) = scene.meshes[0].primitives
    assert same_bits(primitive.positions[primitive.faces], corners)
    assert primitive.normals is None
    text = "".join(
        f"solid s{k}\n"
        + "".join(
            "facet normal 0 0 1\nouter loop\n"
            + "".join(f"vertex {float(x)!r} {float(y)!r} {float(z)!r}\n" for x, y, z in c)
            + "endloop\nendfacet\n"
            for c in part
        )
        + f"endsolid s{k}\n"
        for k, part in enumerate((corners[:2], corners[2:]))
    )
    scene = load_mesh(write(tmp_path / "a.STL", text))
    assert [n.name for n in scene.nodes] == ["s0", "s1"]
    found = [m.primitives[0].positions[m.primitives[0].faces] for m in scene.meshes]
    assert same_bits(np.concatenate(found), corners)


# ------------------------------------------------------------------------ normals


def split_cube() -> Primitive:
    """A cube whose faces share no vertex, with normals that nothing would compute."""
    positions = CUBE_CORNERS[np.array(CUBE_QUADS).ravel()]
    faces = [[4 * f, 4 * f + i, 4 * f + i + 1] for f in range(6) for i in (1, 2)]
    return Primitive(positions, faces, 0, np.full((24, 3), 0.25))


def test_smooth_normals_of_a_cube(tmp_path):
    """By symmetry a corner's three unit squares give (±1, ±1, ±1)/√3, but the diagonals weigh.

    Area weighting makes the two triangles of a square count as often as they touch the corner, 1 or
    2 times: the sum is (a, b, c) with entries 1 or 2 times 4, from each face's own diagonal.
    """
    primitive = split_cube()
    scene = Scene((Mesh("cube", (primitive,)),), (Node("cube", 0),))
    (smooth,) = with_normals(scene, "smooth").meshes[0].primitives
    expected = np.zeros((24, 3))
    for i, position in enumerate(primitive.positions):
        for f, face in enumerate(primitive.faces):
            touching = (primitive.positions[face] == position).all(axis=1).sum()
            axis = np.cross(
                *(
                    CUBE_CORNERS[list(CUBE_QUADS[f // 2])][[1, 3]]
                    - CUBE_CORNERS[CUBE_QUADS[f // 2][0]]
                )
            )
            expected[i] += touching * axis
    expected /= np.sqrt((expected**2).sum(axis=1))[:, None]
    assert smooth.normals is not None
    assert np.abs(smooth.normals - expected).max() < 1e-7
    outward = np.sign(primitive.positions)
    assert (np.sign(smooth.normals) == outward).all()
    (flat,) = with_normals(scene, "flat").meshes[0].primitives
    assert flat.normals is None
    assert with_normals(scene, "authored") is scene


def test_smooth_normals_join_primitives_and_signed_zeros_but_not_meshes(tmp_path):
    # Two triangles that meet in an edge at a right angle, areas ½ and 2; −0 equals +0.
    a = Primitive(np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]])
    b = Primitive(np.float32([[-0.0, 0, 0], [-0.0, -0.0, 4], [1, 0, -0.0]]), [[0, 1, 2]])
    nan = Primitive(np.float32([[0, 0, 0], [np.nan, 0, 0], [0, 1, 0]]), [[0, 1, 2]])
    lone = Mesh("lone", (a,))
    scene = Scene((Mesh("pair", (a, b, nan)), lone), (Node("pair", 0), Node("lone", 1)))
    scene = with_normals(scene, "smooth")
    na, nb, nn = (p.normals for p in scene.meshes[0].primitives)
    # (b − a) × (c − a): (0, 0, 1) and (0, 0, 4) × (1, 0, 0) = (0, 4, 0).
    shared = np.float32([0, 4 / 17**0.5, 1 / 17**0.5])
    assert same_bits(na, np.stack([shared, shared, np.float32([0, 0, 1])]))
    assert same_bits(nb, np.stack([shared, np.float32([0, 1, 0]), shared]))
    assert nn is not None
    assert same_bits(nn[0], shared)
    assert same_bits(nn[1], np.zeros(3, np.float32))  # NaN adds nothing and spoils nothing
    assert same_bits(scene.meshes[1].primitives[0].normals, np.float32([[0, 0, 1]] * 3))


def test_smooth_normals_compiled_equal_interpreted():
    rng = np.random.default_rng(11)
    positions = rng.normal(size=(50, 3)).astype(np.float32)
    positions[7] = np.inf
    faces = rng.integers(0, 50, (80, 3)).astype(np.int32)
    group = meshes_module._position_groups(np.concatenate([positions[:25], positions[:25]]))
    assert (group[:25] == group[25:]).all()
    assert len(set(group.tolist())) == 25
    out = np.empty((2, 50, 3), np.float32)
    driver = meshes_module._smooth_normals
    driver(positions, faces, group, np.zeros((50, 3)), out[0])
    plain = getattr(driver.dispatcher, "py_func", driver.dispatcher)
    with np.errstate(all="ignore"):
        plain(positions, faces, group, np.zeros((50, 3)), out[1])
    assert same_bits(out[0], out[1])
    assert np.isfinite(out).all()


def test_normals_option_on_files(tmp_path):
    glb = one_triangle()
    attributes = glb.root["meshes"][0]["primitives"][0]["attributes"]
    authored = np.float32([[0, 1, 0], [0, 0.6, 0.8], [3, 4, 5]])
    attributes["NORMAL"] = glb.add(authored)
    path = glb.write(tmp_path / "a.glb")
    for option, expected in (
        ("authored", authored),
        ("smooth", np.float32([[0, 0, 1]] * 3)),
        ("flat", None),
    ):
        found = load_mesh(path, normals=option).meshes[0].primitives[0].normals
        assert found is expected if expected is None else same_bits(found, expected)
    with pytest.raises(SettingsError, match="'round'; expected one of authored, flat, smooth"):
        load_mesh(tmp_path / "missing.glb", normals="round")


# ---------------------------------------------------------------------- scene.glb


def rich_scene() -> Scene:
    rng = np.random.default_rng(9)
    cube = split_cube()
    soup = Primitive(
        rng.normal(size=(30, 3)) * 10.0 ** rng.integers(-30, 30, (30, 3)),
        rng.integers(0, 30, (17, 3)),
        material=2,
        colors=rng.random((30, 3)),
    )
    odd = Primitive(np.float32([[0, 0, -0.0], [1, np.nan, 0], [0, np.inf, 1]]), [[0, 1, 2]], 1)
    empty = Primitive(np.zeros((0, 3)), np.zeros((0, 3)), 1)
    materials = (
        Material("ε", (1.0 / 3.0, 0.1, 0.7), 0.3, 0.1 + 0.2, double_sided=True),
        Material("lamp", emissive=(5.3, 1e-3, 0.1), reflectivity=(0.9, 0.1, 1.0 / 7.0)),
        Material(emissive=(0.1, 0.2, 1.0)),
    )
    tilted = rng.normal(size=(4, 4)) * 1e3
    tilted[3] = (0, 0, 0, 1)
    mirrored = np.diag([-1.0, 1.0 / 3.0, 5e-5, 1.0])
    mirrored[0, 1] = -0.0
    return Scene(
        (Mesh("cube", (cube, soup)), Mesh("odd", (odd, empty)), Mesh("unused", (cube,))),
        (Node("a", 0, tilted), Node("b", 1), Node("c", 0, mirrored)),
        materials,
        name="rich",
    )


def test_scene_glb_gives_back_the_same_content(tmp_path):
    scene = rich_scene()
    path = tmp_path / "scene.glb"
    write_scene_glb(scene, path)
    again = load_mesh(path)
    assert again.lights == Lights()
    assert again.content_sha256() == scene.content_sha256()
    lit = scene.with_lights(Lights(ambient=(0.5, 0.5, 0.5)))
    assert again.content_sha256() != lit.content_sha256()
    assert again.with_lights(lit.lights).content_sha256() == lit.content_sha256()
    assert [n.name for n in again.nodes] == ["a", "b", "c"]
    assert [m.name for m in again.materials] == ["ε", "lamp", "material"]
    # glTF allows emissive factors up to 1; more needs the strength extension.
    data = path.read_bytes()
    root = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    assert max(max(m["emissiveFactor"]) for m in root["materials"]) <= 1.0
    assert root["extensionsUsed"] == ["KHR_materials_emissive_strength"]
    # The hash sees the last bit of a vertex and of a matrix.
    bumped = np.nextafter(scene.nodes[0].world_from_mesh, np.inf)
    bumped[3] = (0, 0, 0, 1)
    nodes = (replace(scene.nodes[0], world_from_mesh=bumped), *scene.nodes[1:])
    assert replace(scene, nodes=nodes).content_sha256() != scene.content_sha256()


def test_scene_glb_bytes_repeat(tmp_path):
    first = scene_glb_bytes(rich_scene())
    code = (
        "import sys; sys.path[:0] = ['.', 'tests'];"
        "from test_loading import rich_scene, scene_glb_bytes;"
        "sys.stdout.buffer.write(scene_glb_bytes(rich_scene()))"
    )
    root = Path(ssr_ref.__file__).parents[1]
    env = {**os.environ, "PYTHONHASHSEED": "99", "TZ": "Asia/Tokyo", "HOSTNAME": "elsewhere"}
    done = subprocess.run([sys.executable, "-c", code], cwd=root, env=env, capture_output=True)
    assert done.stdout == first, done.stderr.decode()
    # A loaded scene writes itself again: a fixed point.
    path = tmp_path / "a.glb"
    path.write_bytes(first)
    loaded = replace(load_mesh(path), name="rich")
    path.write_bytes(scene_glb_bytes(loaded))
    assert scene_glb_bytes(replace(load_mesh(path), name="rich")) == scene_glb_bytes(loaded)


def test_scene_glb_is_what_another_reader_sees(tmp_path):
    """trimesh, which shares no code with the writer, finds the vertices and world transforms."""
    import trimesh

    scene = rich_scene()
    scene = replace(scene, nodes=(scene.nodes[0], scene.nodes[2]), meshes=scene.meshes[:2])
    path = tmp_path / "scene.glb"
    write_scene_glb(scene, path)
    other = trimesh.load_scene(path, process=False, merge_primitives=False)
    assert len(other.graph.nodes_geometry) == 4  # two instances of two primitives
    for name in other.graph.nodes_geometry:
        matrix, geometry = other.graph[name]
        index = 0 if len(other.geometry[geometry].vertices) == 24 else 1
        primitive = scene.meshes[0].primitives[index]
        found = other.geometry[geometry]
        assert np.array_equal(found.vertices.astype(np.float32), primitive.positions)
        assert np.array_equal(found.faces, primitive.faces)
        assert any(np.allclose(matrix, node.world_from_mesh, rtol=1e-12) for node in scene.nodes)


def test_scene_glb_cannot_be_written(tmp_path):
    scene = rich_scene()
    fails(
        tmp_path / "no" / "scene.glb", "cannot be written", call=lambda p: write_scene_glb(scene, p)
    )
    (tmp_path / "scene.glb").mkdir()
    fails(tmp_path / "scene.glb", "cannot be written", call=lambda p: write_scene_glb(scene, p))
    assert [p.name for p in tmp_path.iterdir()] == ["scene.glb"]


# --------------------------------------------------------------------------- load


@pytest.fixture
def builtin(monkeypatch):
    """A stand-in for `ssr_ref.scenes`, which has tests of its own."""

    def build(name: str, tessellation: int | None) -> Scene:
        return Scene((Mesh(name, (split_cube(),)),), (Node(f"{name} {tessellation}", 0),))

    def with_mirror_floor(scene: Scene) -> Scene:
        return replace(scene, name=scene.name + " on a mirror")

    module = types.ModuleType("ssr_ref.scenes")
    module.__dict__.update(BUILTIN={"teapot": 1, "poles": 2})
    module.__dict__.update(build=build, with_mirror_floor=with_mirror_floor)
    monkeypatch.setitem(sys.modules, "ssr_ref.scenes", module)
    monkeypatch.setattr(ssr_ref, "scenes", module, raising=False)


@pytest.mark.usefixtures("builtin")
def test_load_names_and_paths(tmp_path, monkeypatch):
    scene = load("teapot", tessellation=5)
    assert scene.nodes[0].name == "teapot 5"
    assert load("poles", mirror_floor=True).name == "scene on a mirror"
    assert load("poles", normals="flat").meshes[0].primitives[0].normals is None
    path = one_triangle().write(tmp_path / "teapot.glb")
    assert load(path).triangle_count == 1
    assert load(str(path), mirror_floor=True).name == "teapot on a mirror"
    assert ssr_ref.load(path).content_sha256() == load_mesh(path).content_sha256()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "teapot").write_bytes(b"")
    assert load("teapot").nodes[0].name == "teapot None"  # a built-in name is never a file
    fails(Path("teapot"), "unknown extension", call=load)  # a Path always is
    fails("teepot", "teapot, poles", ".glb, .gltf, .obj, .ply, .stl", call=load)
    fails("", "teapot, poles", call=load)
    fails("missing.obj", "no such file", call=load)
    with pytest.raises(SettingsError, match="tessellation"):
        load(path, tessellation=4)
    with pytest.raises(SettingsError, match="normals"):
        load("teapot", normals="round")


def test_trimesh_is_imported_only_when_needed(tmp_path):
    """A GLB needs no trimesh, and importing the loader reads nothing."""
    path = one_triangle().write(tmp_path / "a.glb")
    code = (
        "import sys, ssr_ref, ssr_ref.fileio.load, ssr_ref.fileio.meshes as m;"
        f"m.load_mesh({str(path)!r}); print('trimesh' in sys.modules)"
    )
    root = Path(ssr_ref.__file__).parents[1]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True)
    assert done.stdout.strip() == "False", done.stderr

"""Loading mesh files and writing scene.glb. Every input is built here, in `tmp_path`."""

from __future__ import annotations

import base64
import copy
import json
import os
import random
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
from mesh_files import fails, same_bits

import ssr_ref
from ssr_ref import transforms
from ssr_ref.errors import FileError, SettingsError
from ssr_ref.fileio.load import load
from ssr_ref.fileio.scene_glb import scene_glb_bytes, write_scene_glb
from ssr_ref.meshfiles.meshes import load_mesh
from ssr_ref.scene import Lights, Material, Mesh, Node, Primitive, Scene

CUBE_CORNERS = np.array(
    [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32
)  # corner 4x + 2y + z
CUBE_QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


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


# ---------------------------------------------------------------------- scene.glb


def split_cube() -> Primitive:
    """A cube whose faces share no vertex, with normals that nothing would compute."""
    positions = CUBE_CORNERS[np.array(CUBE_QUADS).ravel()]
    faces = [[4 * f, 4 * f + i, 4 * f + i + 1] for f in range(6) for i in (1, 2)]
    return Primitive(positions, faces, 0, np.full((24, 3), 0.25))


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
    fails("teepot", "teapot, poles", ".glb, .gltf, .obj, .ply, .stl, .off, .3mf", call=load)
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
        "import sys, ssr_ref, ssr_ref.fileio.load, ssr_ref.meshfiles.meshes as m;"
        f"m.load_mesh({str(path)!r}); print('trimesh' in sys.modules)"
    )
    root = Path(ssr_ref.__file__).parents[1]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True)
    assert done.stdout.strip() == "False", done.stderr

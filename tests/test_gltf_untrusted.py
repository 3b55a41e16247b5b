"""Hostile and damaged glTF files: one FileError line each, and memory in proportion to the file."""

from __future__ import annotations

import json
import random
import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from glb_file import Glb, one_triangle, with_png

from ssr_ref.errors import FileError
from ssr_ref.meshfiles import gltf_accessors, gltf_textures
from ssr_ref.meshfiles.gltf_scene import load_gltf
from ssr_ref.meshfiles.options import LoadOptions


def fails(data: bytes, *words: str, path: str = "m.glb") -> None:
    with pytest.raises(FileError) as caught:
        load_gltf(Path(path), data, LoadOptions())
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert "expected" in message
    assert len(message) < 500
    for word in words:
        assert word in message, message


GOOD = json.dumps(one_triangle().root | {"buffers": []})

BAD_JSON = {
    "NaN": ('{"asset":{"version":"2.0"},"x":NaN}', "NaN is no JSON number"),
    "infinite": ('{"asset":{"version":"2.0"},"x":-Infinity}', "Infinity"),
    "a key twice": ('{"asset":{"version":"2.0"},"meshes":[],"meshes":[]}', "'meshes' stands twice"),
    "a key twice within": (GOOD.replace('"count": 3', '"count": 3, "count": 4'), "'count'"),
    "lists too deep": ("[" * 200_000 + "]" * 200_000, "JSON"),
    "objects too deep": ('{"a":' * 200_000 + "1" + "}" * 200_000, "JSON"),
    "a number of many digits": (GOOD.replace('"count": 3', '"count": ' + "9" * 5000), "JSON"),
    "a large number": (GOOD.replace('"count": 3', '"count": ' + "9" * 99), "count is 999"),
    "2^53": (GOOD.replace('"count": 3', f'"count": {2**53}'), "expected"),
    "1e999": (GOOD.replace('{"mesh": 0}', '{"mesh": 0, "scale": [1, 1e999, 1]}'), "scale"),
    "not UTF-8": ('{"asset":{"version":"2.0"},"x":"\udcff"}', "utf-8"),
    "cut": (GOOD[:-1], "JSON"),
    "two values": (GOOD + "{}", "JSON"),
    "a string": ('"x"', "version"),
    "later": ('{"asset":{"version":"2.1","minVersion":"2.1"}}', "version 2.1"),
    "earlier": ('{"asset":{"version":"1.0"}}', "version 1.0"),
}


@pytest.mark.parametrize("name", BAD_JSON)
def test_bad_json_is_one_line(name):
    text, word = BAD_JSON[name]
    fails(text.encode("utf-8", "surrogateescape"), word)


def test_a_later_version_that_needs_no_more_is_read():
    glb = one_triangle(asset={"version": "2.9", "minVersion": "2.0"})
    assert load_gltf(Path("m.glb"), glb.bytes(), LoadOptions()).triangle_count == 1


def put(*keys: Any, value: Any) -> Callable[[Glb], None]:
    def change(glb: Glb) -> None:
        target: Any = glb.root
        for key in keys[:-1]:
            target = target[key]
        target[keys[-1]] = value

    return change


WRONG_TYPES = [None, True, -1, 2**40, 1.5, "x", [], [1], {}, [{}], [[]], {"index": 0}]
PLACES = [
    ("nodes",), ("nodes", 0), ("nodes", 0, "children"), ("nodes", 0, "mesh"),
    ("nodes", 0, "extensions"), ("nodes", 0, "matrix"), ("scenes", 0), ("scenes", 0, "nodes"),
    ("scene",), ("meshes", 0), ("meshes", 0, "primitives"), ("meshes", 0, "primitives", 0),
    ("meshes", 0, "primitives", 0, "attributes"), ("meshes", 0, "primitives", 0, "mode"),
    ("meshes", 0, "primitives", 0, "indices"), ("meshes", 0, "primitives", 0, "material"),
    ("meshes", 0, "primitives", 0, "targets"), ("meshes", 0, "primitives", 0, "extensions"),
    ("meshes", 0, "primitives", 0, "extras"),
    ("meshes", 0, "primitives", 0, "attributes", "POSITION"),
    ("meshes", 0, "primitives", 0, "attributes", "TEXCOORD_0"),
    ("meshes", 0, "primitives", 0, "attributes", "COLOR_0"),
    ("accessors", 0, "bufferView"), ("accessors", 0, "count"), ("accessors", 0, "componentType"),
    ("accessors", 0, "type"), ("accessors", 0, "sparse"), ("accessors", 0, "normalized"),
    ("bufferViews", 0, "buffer"), ("bufferViews", 0, "byteLength"),
    ("bufferViews", 0, "byteStride"), ("materials", 0), ("materials", 0, "pbrMetallicRoughness"),
    ("materials", 0, "extensions"),
    ("materials", 0, "extras"), ("materials", 0, "alphaMode"), ("materials", 0, "emissiveTexture"),
    ("materials", 0, "pbrMetallicRoughness", "baseColorTexture"),
    ("materials", 0, "pbrMetallicRoughness", "baseColorTexture", "index"),
    ("materials", 0, "pbrMetallicRoughness", "baseColorTexture", "extensions"),
    ("materials", 0, "pbrMetallicRoughness", "baseColorFactor"),
    ("textures", 0), ("textures", 0, "source"), ("textures", 0, "sampler"),
    ("textures", 0, "extensions"), ("images", 0), ("images", 0, "bufferView"), ("images", 0, "uri"),
    ("images", 0, "name"), ("samplers", 0), ("samplers", 0, "wrapS"), ("extensionsUsed",),
    ("extensionsRequired",), ("animations",), ("cameras",), ("asset", "minVersion"),
]  # fmt: skip


def rich() -> Glb:
    glb = one_triangle(
        materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        textures=[{"source": 0, "sampler": 0}],
        samplers=[{}],
    )
    primitive = glb.root["meshes"][0]["primitives"][0]
    primitive.update(material=0, indices=glb.add(np.uint8([0, 1, 2])), extras={})
    primitive["attributes"]["TEXCOORD_0"] = glb.add(np.float32([[0, 0], [1, 0], [0, 1]]))
    with_png(glb)
    return glb


@pytest.mark.parametrize("place", PLACES, ids=lambda p: ".".join(map(str, p)))
def test_wrong_types_never_raise_anything_else(place):
    for value in WRONG_TYPES:
        glb = rich()
        put(*place, value=value)(glb)
        try:
            load_gltf(Path("m.glb"), glb.bytes(), LoadOptions())
        except FileError as error:
            assert "\n" not in str(error)
            assert "expected" in str(error)


def test_damaged_bytes_never_raise_anything_else(recwarn):
    data = rich().bytes()
    rng = random.Random(4)
    loaded = 0
    for _ in range(1500):
        bad = bytearray(data)
        for _ in range(rng.randint(1, 3)):
            bad[rng.randrange(12, len(bad))] = rng.choice(b'0129-.,:{}[]"aeE \x00\xff')
        try:
            load_gltf(Path("m.glb"), bytes(bad), LoadOptions())
            loaded += 1
        except FileError as error:
            assert "\n" not in str(error)
    assert 0 < loaded < 1500
    assert not recwarn.list


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("a ring", put("nodes", value=[{"mesh": 0, "children": [1]}, {"children": [0]}]), "twice"),
        (
            "two parents",
            put("nodes", value=[{"mesh": 0, "children": [1, 2]}, {"children": [2]}, {}]),
            "reached twice",
        ),
        ("root twice", put("scenes", 0, "nodes", value=[0, 0]), "reached twice"),
    ],
)
def test_node_graphs_that_are_no_trees(name, change, words):
    glb = one_triangle()
    change(glb)
    fails(glb.bytes(), words)


# ------------------------------------------------------------------------ memory


def peak_of(data: bytes, *words: str) -> int:
    tracemalloc.start()
    fails(data, *words)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def sparse_zeros(count: int) -> Glb:
    glb = one_triangle()
    view = glb.embed(bytes(16))
    glb.root["accessors"][0] = {
        "componentType": 5126, "type": "VEC3", "count": count,
        "sparse": {"count": 1, "indices": {"bufferView": view, "componentType": 5121},
                   "values": {"bufferView": view}},
    }  # fmt: skip
    return glb


def test_zeros_that_no_file_holds_are_refused():
    assert peak_of(sparse_zeros(2**31).bytes(), "bytes of zeros") < 2**20
    most = gltf_accessors.MAX_ZEROS // 12
    assert peak_of(sparse_zeros(most + 1).bytes(), "bytes of zeros") < 2**20
    glb = sparse_zeros(3)
    assert load_gltf(Path("m.glb"), glb.bytes(), LoadOptions()).report.degenerate == 1


def test_counts_are_checked_before_memory_is_taken():
    for key, value in (("count", 2**40), ("byteOffset", 2**40)):
        glb = one_triangle()
        glb.root["accessors"][0][key] = value
        assert peak_of(glb.bytes(), "truncated or damaged") < 2**20
    for key in ("byteLength", "byteOffset", "byteStride"):
        glb = one_triangle()
        glb.root["bufferViews"][0][key] = 2**40
        assert peak_of(glb.bytes(), "truncated or damaged") < 2**20


def test_a_buffer_may_not_be_read_without_end(monkeypatch):
    """Each primitive that shares an accessor costs few bytes of JSON and all of its vertices."""
    glb = one_triangle()
    glb.root["meshes"][0]["primitives"] *= 50  # 36 bytes each
    size = len(glb.bytes())
    monkeypatch.setattr(gltf_accessors, "_BUDGET", 50 * 36 - size)
    monkeypatch.setattr(gltf_accessors, "_BUDGET_PER_BYTE", 1)
    assert load_gltf(Path("m.glb"), glb.bytes(), LoadOptions()).triangle_count == 50
    monkeypatch.setattr(gltf_accessors, "_BUDGET", 50 * 36 - size - 1)
    fails(glb.bytes(), "share accessors less")


def test_images_may_not_be_decoded_without_end(monkeypatch):
    glb = rich()
    glb.root["textures"].append({"source": with_png(glb, np.zeros((40, 30, 4), np.uint8))})
    glb.root["materials"][0]["emissiveTexture"] = {"index": 1}
    monkeypatch.setattr(gltf_textures, "_BUDGET_PER_BYTE", 0)
    monkeypatch.setattr(gltf_textures, "_BUDGET", 4 + 4800)
    assert len(load_gltf(Path("m.glb"), glb.bytes(), LoadOptions()).images) == 2
    monkeypatch.setattr(gltf_textures, "_BUDGET", 4 + 4799)
    fails(glb.bytes(), "takes 4800 bytes")


def test_files_beside_may_not_be_read_without_end(tmp_path, monkeypatch):
    root = one_triangle().root
    root["buffers"] = [{"byteLength": 36, "uri": name} for name in ("a.bin", "./a.bin", "a.bin")]
    root["bufferViews"] = [{"buffer": i, "byteLength": 36} for i in range(3)]
    root["accessors"] = [{**root["accessors"][0], "bufferView": i} for i in range(3)]
    primitives = [{"attributes": {"POSITION": i}} for i in range(3)]
    root["meshes"] = [{"primitives": primitives}]
    (tmp_path / "a.bin").write_bytes(bytes(36))
    data = json.dumps(root).encode()
    path = tmp_path / "m.gltf"
    monkeypatch.setattr(gltf_accessors, "_MAX_BUFFERS", 72)  # two names, one of them twice
    assert load_gltf(path, data, LoadOptions()).triangle_count == 3
    monkeypatch.setattr(gltf_accessors, "_MAX_BUFFERS", 71)
    fails(data, "over 71 bytes", path=str(path))


def test_glb_chunks_are_checked():
    data = one_triangle().bytes()
    (length,) = struct.unpack("<I", data[12:16])
    for size in (2**32 - 1, len(data), length + 1):
        fails(data[:12] + struct.pack("<I", size) + data[16:])
    fails(data[:8] + struct.pack("<I", len(data) + 1) + data[12:], "truncated")
    fails(data[:4] + struct.pack("<I", 1) + data[8:], "GLB of version 1")
    # An unknown chunk, and bytes after the length of the header, are skipped.
    more = data + struct.pack("<I4s", 4, b"XTRA") + b"abcd"
    whole = more[:8] + struct.pack("<I", len(more)) + more[12:] + b"tail"
    assert load_gltf(Path("m.glb"), whole, LoadOptions()).triangle_count == 1
    # Of two binary chunks the first counts.
    second = data + struct.pack("<I4s", 36, b"BIN\0") + bytes(36)
    whole = second[:8] + struct.pack("<I", len(second)) + second[12:]
    assert load_gltf(Path("m.glb"), whole, LoadOptions()).report.degenerate == 0

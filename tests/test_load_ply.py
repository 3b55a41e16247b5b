"""PLY in its three encodings. Every expected number stands in the file, or is sRGB's formula."""

from __future__ import annotations

import random
import struct
import tracemalloc
from typing import Any

import numpy as np
import pytest
from mesh_files import corners, fails, only, ply_header, same_bits, strict, write_image

from ssr_ref.errors import FileError
from ssr_ref.meshfiles.colors import linear_from_codes
from ssr_ref.meshfiles.meshes import load_mesh
from ssr_ref.scene import Material
from ssr_ref.texture import Texture

KINDS = ("ascii", "binary_little_endian", "binary_big_endian")
FORMATS = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f",
    "double": "d", "uint8": "B", "int32": "i", "float32": "f",
}  # fmt: skip
XYZ = ("float x", "float y", "float z")
FACES = ("list uchar int vertex_indices",)
QUAD = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
Elements = list[tuple[str, tuple[str, ...], list[list[Any]]]]


def ply(kind: str, elements: Elements, *more: str) -> bytes:
    """A PLY of rows; a list property takes one value that is a list."""
    head = ply_header(kind, [(name, len(rows), props) for name, props, rows in elements], *more)
    order = ">" if "big" in kind else "<"
    body = b""
    for _, properties, rows in elements:
        for row in rows:
            line = []
            for declared, value in zip(properties, row, strict=True):
                words = declared.split()
                values = [len(value), *value] if words[0] == "list" else [value]
                types = [words[1], *[words[2]] * len(value)] if words[0] == "list" else [words[0]]
                line += [repr(v) for v in values]
                if kind != "ascii":
                    body += struct.pack(order + "".join(FORMATS[t] for t in types), *values)
            body += (" ".join(line) + "\n").encode() if kind == "ascii" else b""
    return head + body


def loaded(tmp_path, data: bytes):
    path = tmp_path / "a.PLY"
    path.write_bytes(data)
    return load_mesh(path)


def quad_file(kind: str, properties: tuple[str, ...], columns: Any, *more: str) -> bytes:
    rows = [[*map(float, p), *c] for p, c in zip(QUAD, columns)]
    return ply(
        kind, [("vertex", (*XYZ, *properties), rows), ("face", FACES, [[[0, 1, 2, 3]]])], *more
    )


@pytest.mark.parametrize("kind", KINDS)
def test_normals_and_uv_keep_their_bits(tmp_path, kind):
    rng = np.random.default_rng(2)
    values = rng.normal(size=(4, 5)).astype(np.float32)
    properties = tuple(f"float {k}" for k in ("nx", "ny", "nz", "s", "t"))
    scene = loaded(tmp_path, quad_file(kind, properties, values.astype(float).tolist()))
    primitive = only(scene)
    assert same_bits(primitive.positions, np.float32(QUAD))
    assert same_bits(primitive.normals, values[:, :3])
    assert same_bits(primitive.uv0, values[:, 3:])
    assert primitive.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert scene.materials == (Material(),)
    assert scene.notes == ()
    assert scene.report is not None
    assert scene.report.format == "PLY"


@pytest.mark.parametrize("kind", KINDS)
def test_uchar_colours_are_srgb_and_float_ones_linear(tmp_path, kind):
    codes = [[255, 0, 10], [1, 2, 3], [4, 5, 6], [7, 128, 11]]
    names = ("red", "green", "blue")
    scene = loaded(tmp_path, quad_file(kind, tuple(f"uchar {n}" for n in names), codes))
    c = np.array(codes, np.float64) / 255
    expected = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    found = only(scene).colors
    assert np.abs(found - expected).max() < 1e-7
    assert found[0].tolist() == [1.0, 0.0, np.float32(10 / 255 / 12.92)]
    assert scene.materials == (Material(base_color=(1.0, 1.0, 1.0)),)
    floats = (np.array(codes) / 256).tolist()
    scene = loaded(tmp_path, quad_file(kind, tuple(f"float {n}" for n in names), floats))
    assert same_bits(only(scene).colors, np.float32(floats))


def test_srgb_codes_against_the_formula():
    codes = np.arange(256, dtype=np.uint8)
    c = codes / 255
    expected = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    assert np.abs(linear_from_codes(codes) - expected).max() < 1e-7
    assert linear_from_codes(np.uint16([65535, 0])).tolist() == [1.0, 0.0]
    # Code c of 8 bits is code 257·c of 16 bits.
    assert same_bits(
        linear_from_codes(codes.astype(np.uint16) * np.uint16(257)), linear_from_codes(codes)
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("index", ["list uchar int vertex_indices", "list int uint vertex_index"])
def test_mixed_polygons_and_empty_faces(tmp_path, kind, index):
    """A quad, a triangle, a concave polygon, faces of 0, 1 and 2 corners; in file order."""
    arrow = [[5, 0, 0], [7, 1, 0], [5, 2, 0], [5.5, 1, 0]]
    points = [[float(v) for v in p] for p in (*QUAD, *arrow)]
    faces = [[0, 1, 2, 3], [], [0, 1, 4], [2], [5, 6, 7, 4], [1, 2], [1, 2, 3]]
    rows = [[1.5, face, 7] for face in faces]
    elements: Elements = [
        ("vertex", XYZ, points),
        ("face", ("float quality", index, "uchar flags"), rows),
    ]
    scene = loaded(tmp_path, ply(kind, elements))
    found = corners(only(scene))
    fan = [[points[i] for i in t] for t in ([0, 1, 2], [0, 2, 3], [0, 1, 4])]
    assert found[:3] == fan
    assert found[5:] == [[points[1], points[2], points[3]]]
    # The fan of the arrow from its second corner would turn round; these cover it once.
    a, b, c = (np.array([t[k] for t in found[3:5]]) for k in range(3))
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert sorted(areas) == sorted([0.75, 0.75])
    assert scene.report is not None
    assert scene.report.skipped == ("3 faces of fewer than 3 corners",)


@pytest.mark.parametrize("kind", KINDS)
def test_uv_of_corners_splits_vertices(tmp_path, kind):
    faces = [
        [[0, 1, 2], [0.0, 0.5, 1.0, 0.5, 1.0, 1.0]],
        [[0, 2, 3], [0.25, 0.5, 1.0, 1.0, 0.0, 1.0]],
    ]
    elements: Elements = [
        ("vertex", XYZ, [[float(v) for v in p] for p in QUAD]),
        ("face", ("list uchar int vertex_indices", "list uchar float texcoord"), faces),
    ]
    primitive = only(loaded(tmp_path, ply(kind, elements)))
    expected = [np.reshape(uv, (3, 2)).tolist() for _, uv in faces]
    assert corners(primitive, "uv0") == expected
    assert corners(primitive) == [[QUAD[i] for i in face] for face, _ in faces]
    elements[1][2][1][1] = [0.5, 0.5]
    report = loaded(tmp_path, ply(kind, elements)).report
    assert report is not None
    assert report.fallbacks == ("texcoord: some faces have not two numbers for each corner",)


def test_colours_of_faces(tmp_path):
    properties = (*FACES, "uchar red", "uchar green", "uchar blue")
    faces = [[[0, 1, 2], 255, 0, 0], [[0, 2, 3], 0, 255, 0]]
    points = [[float(v) for v in p] for p in QUAD]
    scene = loaded(tmp_path, ply("ascii", [("vertex", XYZ, points), ("face", properties, faces)]))
    assert corners(only(scene), "colors") == [[[1, 0, 0]] * 3, [[0, 1, 0]] * 3]


def test_a_texture_file(tmp_path):
    write_image(tmp_path / "my image.png", np.array([[[9, 8, 7]]], np.uint8))
    uv = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    data = quad_file("ascii", ("float u", "float v"), uv, "comment TextureFile my image.png")
    (tmp_path / "a.ply").write_bytes(data)
    scene = strict(tmp_path / "a.ply")
    texture = Texture(0, offset=(0.0, 1.0), scale=(1.0, -1.0))
    assert scene.materials == (Material(base_color=(1, 1, 1), base_color_texture=texture),)
    assert scene.images[0].pixels.tolist() == [[[9, 8, 7, 255]]]
    (tmp_path / "my image.png").unlink()
    scene = load_mesh(tmp_path / "a.ply")
    assert scene.materials == (Material(),)
    assert scene.report is not None
    assert scene.report.fallbacks == ("texture refers to 'my image.png', which is missing",)
    fails(tmp_path / "a.ply", "strict", "my image.png", call=strict)


def test_other_elements_and_encodings_of_comments(tmp_path):
    points = [[float(v) for v in p] for p in QUAD]
    elements: Elements = [
        ("camera", ("float a", "list uchar short b"), [[1.0, [1, 2]], [2.0, []]]),
        ("vertex", (*XYZ, "uchar alpha", "int label"), [[*p, 7, 1] for p in points]),
        ("edge", ("int vertex1", "int vertex2"), [[0, 1]]),
        ("face", FACES, [[[0, 1, 2]]]),
    ]
    for kind in KINDS:
        data = ply(kind, elements, "comment Übung").replace("Ü".encode(), b"\xdc")
        scene = loaded(tmp_path, data)
        assert corners(only(scene)) == [QUAD[:3]]
        assert scene.report is not None
        assert scene.report.skipped == ("2 rows of element 'camera'", "1 row of element 'edge'")
        assert scene.report.unsupported == ("alpha of vertices: drawn opaque",)
    crlf = ply("ascii", elements[1:]).replace(b"\n", b"\r\n")
    assert corners(only(loaded(tmp_path, crlf))) == [QUAD[:3]]


HEAD = ply_header("ascii", [("vertex", 3, XYZ), ("face", 1, FACES)]).decode()
POINTS = "0 0 0\n1 0 0\n0 1 0\n"
BAD = {
    "garbage": (b"\x89\xff\x00\x12" * 40, "PLY"),
    "without end": ("ply\nformat ascii 1.0\nelement vertex 3\n", "PLY"),
    "truncated vertices": (HEAD + "0 0 0\n1 0 0\n", "2 vertex rows"),
    "truncated face": (HEAD + POINTS, "0 face rows"),
    "half a face": (HEAD + POINTS + "3 0 1", "0 face rows"),
    "text for number": (HEAD + "0 0 0\n1 x 0\n0 1 0\n3 0 1 2\n", "no number"),
    "bad index": (HEAD + POINTS + "3 0 1 3", "vertex 3 of 3"),
    "negative index": (HEAD + POINTS + "3 0 1 -1", "vertex -1"),
    "index not whole": (HEAD + POINTS + "3 0 1 1.5", "vertex_indices 1.5 is no int32"),
    "index beyond int": (
        HEAD + POINTS + "3 0 1 3000000000",
        "vertex_indices 3000000000 is no int32",
    ),
    "length negative": (HEAD + POINTS + "-3 0 1 2", "face rows"),
    "points only": (
        HEAD.replace("face 1", "face 0") + POINTS,
        "no triangles (3 vertices, 0 faces)",
    ),
    "no face element": (HEAD.replace("face 1", "edge 1") + POINTS + "2 0 1", "no triangles"),
    "edges only": (HEAD + POINTS + "2 0 1", "1 face of fewer than 3 corners"),
    "all NaN": (HEAD + "nan 0 0\nnan 0 0\nnan 1 0\n3 0 1 2\n", "NaN"),
    "no x": (HEAD.replace("float x", "float q") + POINTS + "3 0 1 2", "without x, y and z"),
    "unknown type": (HEAD.replace("float x", "quad x") + POINTS + "3 0 1 2", "quad x"),
    "unknown format": (HEAD.replace("ascii", "utf8") + POINTS + "3 0 1 2", "PLY"),
    "list of float length": (HEAD.replace("uchar int", "float int") + POINTS, "list float"),
    "property first": (HEAD.replace("element vertex 3\n", "") + POINTS, "property float x"),
    "negative count": (HEAD.replace("vertex 3", "vertex -3") + POINTS, "negative"),
    "element twice": (HEAD.replace("element face", "element vertex") + POINTS, "one name"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_file_is_one_line(tmp_path, name):
    data, word = BAD[name]
    path = tmp_path / "a.ply"
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    fails(path, word)


def most_memory(path, word: str) -> int:
    """Bytes that a load takes before it fails with this word."""
    tracemalloc.start()
    try:
        fails(path, word)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("counts", [(2**31, 1), (3, 10**15), (10**18, 10**18)])
def test_counts_that_lie_take_no_memory(tmp_path, kind, counts):
    head = ply_header(kind, [("vertex", counts[0], XYZ), ("face", counts[1], FACES)])
    path = tmp_path / "a.ply"
    path.write_bytes(head + (b"0 " * 12 if kind == "ascii" else bytes(60)))
    assert most_memory(path, f"expected {max(counts) if counts[0] == 3 else counts[0]}") < 2**20


@pytest.mark.parametrize("kind", KINDS)
def test_list_lengths_that_lie_take_no_memory(tmp_path, kind):
    head = ply_header(kind, [("vertex", 1, XYZ), ("face", 2, ("list uint int vertex_indices",))])
    order = ">" if "big" in kind else "<"
    body = struct.pack(order + "3f2I", 0, 0, 0, 4_000_000_000, 1)
    path = tmp_path / "a.ply"
    path.write_bytes(head + (b"0 0 0 4000000000 1" if kind == "ascii" else body))
    assert most_memory(path, "face rows") < 2**20


def test_every_truncation_of_a_binary_file_is_one_line(tmp_path):
    elements: Elements = [
        ("vertex", XYZ, [[float(v) for v in p] for p in QUAD]),
        ("face", FACES, [[[0, 1, 2]], [[0, 1, 2, 3]]]),
    ]
    data = ply("binary_little_endian", elements)
    path = tmp_path / "a.ply"
    for length in range(1, len(data)):
        path.write_bytes(data[:length])
        fails(path)


def test_damaged_files_are_a_scene_or_one_line(tmp_path):
    rng = random.Random(3)
    path = tmp_path / "a.ply"
    done = 0
    for kind in KINDS:
        elements: Elements = [
            (
                "vertex",
                (*XYZ, "uchar red", "uchar green", "uchar blue"),
                [[*map(float, p), 1, 2, 3] for p in QUAD],
            ),
            ("face", FACES, [[[0, 1, 2]], [[0, 1, 2, 3]]]),
        ]
        data = ply(kind, elements)
        for _ in range(250):
            bad = bytearray(data)
            for _ in range(rng.randint(1, 3)):
                bad[rng.randrange(len(bad))] = rng.choice(b"019- .\nx\x00\xff\x04")
            path.write_bytes(bad)
            try:
                load_mesh(path)
                done += 1
            except FileError as error:
                assert "\n" not in str(error)
    assert 0 < done < 750

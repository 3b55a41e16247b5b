"""STL and OFF. Every expected number stands in the file."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from mesh_files import binary_stl, corners, fails, only, same_bits, strict, write

from ssr_ref.meshfiles.meshes import load_mesh
from ssr_ref.scene import Material

TRIANGLES = [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0.5], [0, 1, 0]]]
FACET = "facet normal 0 0 0\n outer loop\n" + "vertex {}\n" * 3 + " endloop\nendfacet\n"
POINTS = ("0 0 0", "1 0 0", "0 1 0")


def stl(path, data: bytes):
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("header", [b"", b"solid that is binary", b"\xff\xfe"])
def test_binary_stl_keeps_its_bits_and_not_its_normals(tmp_path, header):
    rng = np.random.default_rng(4)
    soup = rng.normal(size=(5, 3, 3)).astype(np.float32)
    scene = strict(stl(tmp_path / "b.STL", binary_stl(soup, header=header)))
    primitive = only(scene)
    assert same_bits(primitive.positions[primitive.faces], soup)
    for face, corner in zip(primitive.faces, soup.astype(np.float64)):
        n = np.cross(corner[1] - corner[0], corner[2] - corner[0])
        assert np.abs(primitive.normals[face] - n / np.sqrt((n**2).sum())).max() < 1e-6
    assert [node.name for node in scene.nodes] == ["b"]
    assert scene.report is not None
    assert scene.report.generated_normals == 1


def test_a_bent_binary_stl_is_smooth_where_its_triangles_meet(tmp_path):
    """Over the fold from (1, 0) to (0, 1), 0.5 high is 35.3°, sharp; 0.25 is 19.5°, smooth."""
    for height, same in ((0.5, False), (0.25, True)):
        soup = np.float32(TRIANGLES)
        soup[1, 1, 2] = height
        primitive = only(load_mesh(stl(tmp_path / "b.stl", binary_stl(soup))))
        a, b = primitive.normals[primitive.faces]
        assert same_bits(a[1], b[0]) == same
        assert same_bits(a[2], b[2]) == same


def test_attribute_bytes_are_reported(tmp_path):
    report = load_mesh(stl(tmp_path / "b.stl", binary_stl(TRIANGLES, attribute=5))).report
    assert report is not None
    assert report.unsupported == ("attribute bytes of facets (colours of some programs)",)


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_ascii_stl(tmp_path, end):
    text = "solid my vertex 7\n" + FACET.format(*POINTS) + "endsolid my vertex 7\n"
    text += "SOLID\nFACET NORMAL 0 0 1\nOUTER LOOP\nVERTEX 1 0 0\nVERTEX 1e0 1 .5\nvertex 0 1 0\n"
    text += "ENDLOOP\nENDFACET\nendsolid\nsolid my vertex 7\n" + FACET.format(*POINTS)  # no end
    scene = strict(write(tmp_path / "a.stl", text.replace("\n", end)))
    assert [n.name for n in scene.nodes] == ["my vertex 7", "a", "my vertex 7 2.1"]
    found = [corners(mesh.primitives[0]) for mesh in scene.meshes]
    assert found == [TRIANGLES[:1], TRIANGLES[1:], TRIANGLES[:1]]


ONE = "solid a\n" + FACET.format(*POINTS)
BAD_STL = {
    "garbage": (b"\x12\x34\xff" * 60, "no triangles"),
    "short": (b"\x12\x34", "no triangles"),
    "binary cut": (binary_stl(TRIANGLES)[:-1], "no triangles (183 bytes"),
    "binary with more": (binary_stl(TRIANGLES) + b"\0", "a binary file with this header has 184"),
    "binary of none": (bytes(84), "no triangles"),
    "huge count": (bytes(80) + struct.pack("<I", 2**32 - 1), "214748364834"),
    "ASCII without a facet": (b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n", "ASCII"),
    "ASCII cut": (("solid a\n" + FACET.format(*POINTS) * 2)[:-40].encode(), "truncated"),
    "text for number": (ONE.replace("1 0 0", "1 x 0").encode(), "line 5"),
    "two numbers": (ONE.replace("1 0 0", "1 0").encode(), "line 5"),
    "a quad": (
        ONE.replace(" endloop", "vertex 0 0 0\nendloop").encode(),
        "a loop of 4 vertices",
    ),
    "six vertices": (ONE.replace(" endloop", "vertex 0 0 0\n" * 3 + "endloop").encode(), "of 6 v"),
    "no vertex": (ONE.replace("endloop", "endloop\nendloop").encode(), "of 0 vertices"),
    "all NaN": (binary_stl(np.full((1, 3, 3), np.nan)), "NaN"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD_STL)
def test_bad_stl_is_one_line(tmp_path, name):
    data, word = BAD_STL[name]
    fails(stl(tmp_path / "a.stl", data), word)


# ---------------------------------------------------------------------------- OFF

SQUARE = ("0 0 0", "1 0 0", "1 1 0", "0 1 0")
P = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


def off(tmp_path, text: str):
    return load_mesh(write(tmp_path / "a.off", text))


@pytest.mark.parametrize(
    "head", ["OFF\n4 2 0\n", "OFF 4 2 0\n", "OFF # a\n\n# b\n4 2\n", "\ufeffOFF\r\n4 2 0\r\n"]
)
def test_off_counts_comments_and_polygons(tmp_path, head):
    text = head + "\n".join(SQUARE) + "\n\n4 0 1 2 3 # a quad\n3 2 1 0\n"
    scene = off(tmp_path, text)
    assert corners(only(scene)) == [[P[0], P[1], P[2]], [P[0], P[2], P[3]], [P[2], P[1], P[0]]]
    assert scene.materials == (Material(),)
    assert scene.notes == ()


def test_coff_colours(tmp_path):
    """Whole numbers above 1 are sRGB codes: 255 and 0 are 1 and 0, 10 is 10/255/12.92."""
    colors = ("255 0 10 255", "0 255 10 255", "0 0 255 0", "10 10 10 9")
    rows = "\n".join(f"{p} {c}" for p, c in zip(SQUARE, colors))
    scene = off(tmp_path, "COFF\n4 1 0\n" + rows + "\n4 0 1 2 3\n")
    t = np.float32(10 / 255 / 12.92)
    assert same_bits(only(scene).colors, np.float32([[1, 0, t], [0, 1, t], [0, 0, 1], [t, t, t]]))
    assert scene.materials == (Material(base_color=(1, 1, 1)),)
    floats = ("0.5 0 1 1", "0 0.25 0 1", "1 1 1 1", "0 0 0.125 1")
    rows = "\n".join(f"{p} {c}" for p, c in zip(SQUARE, floats))
    scene = off(tmp_path, "COFF 4 1 0\n" + rows + "\n4 0 1 2 3\n")
    expected = [[0.5, 0, 1], [0, 0.25, 0], [1, 1, 1], [0, 0, 0.125]]
    assert only(scene).colors.tolist() == expected


def test_off_colours_of_faces_normals_and_uv(tmp_path):
    text = "OFF\n4 2 0\n" + "\n".join(SQUARE) + "\n3 0 1 2 255 0 0\n3 0 2 3 0 0 255 128\n"
    scene = off(tmp_path, text)
    assert corners(only(scene), "colors") == [[[1, 0, 0]] * 3, [[0, 0, 1]] * 3]
    rows = "\n".join(f"{p} 0 0.6 0.8 1 0.5 0 1 0.25 {i / 4}" for i, p in enumerate(SQUARE))
    primitive = only(off(tmp_path, "STCNOFF\n4 1 0\n" + rows + "\n4 0 1 2 3\n"))
    assert same_bits(primitive.normals, np.float32([[0, 0.6, 0.8]] * 4))
    assert same_bits(primitive.uv0, np.float32([[0.25, i / 4] for i in range(4)]))
    assert primitive.colors.tolist() == [[1, 0.5, 0]] * 4
    odd = off(tmp_path, "OFF\n4 2 0\n" + "\n".join(SQUARE) + "\n3 0 1 2 1 0 0\n3 0 2 3\n")
    assert odd.report is not None
    assert odd.report.unsupported == ("colours of 1 faces",)


BAD_OFF = {
    "garbage": ("\0\1\2\3", "OFF"),
    "4OFF": ("4OFF\n1 1 0\n", "OFF"),
    "binary": ("OFF BINARY\n", "BINARY"),
    "no counts": ("OFF\n", "before its counts"),
    "one count": ("OFF 3\n0 0 0\n", "line 1"),
    "huge counts": ("OFF 99999999999999999999 1 0\n", "line 1"),
    "negative count": ("OFF -1 1 0\n", "line 1"),
    "cut vertices": ("OFF 3 1 0\n0 0 0\n1 0 0\n", "before vertex 2 of 3"),
    "wrapped vertex": ("OFF 3 1 0\n0 0 0 1 0\n0\n0 1 0\n3 0 1 2\n", "line 3 has '0'"),
    "text for number": ("OFF 3 1 0\n0 0 0\n1 x 0\n0 1 0\n3 0 1 2\n", "line 3"),
    "cut face": ("OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n", "before face 0 of 1"),
    "short face": ("OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "line 5"),
    "negative size": ("OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n-3 0 1 2\n", "line 5"),
    "bad index": ("OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "vertex 3 of 3"),
    "huge index": ("OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 99999999999999999999\n", "line 5"),
    "no faces": ("OFF 3 0 0\n0 0 0\n1 0 0\n0 1 0\n", "no triangles (3 vertices, 0 faces)"),
}


@pytest.mark.parametrize("name", BAD_OFF)
def test_bad_off_is_one_line(tmp_path, name):
    text, word = BAD_OFF[name]
    fails(write(tmp_path / "a.off", text), word)

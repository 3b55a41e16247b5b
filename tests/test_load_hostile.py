"""What fuzzing found in the readers: one named test for each kind of fault."""

from __future__ import annotations

import json
import struct
import tracemalloc
import warnings
import zlib

import numpy as np
import pytest
from fuzz_files import MODEL, zipped
from glb_file import one_triangle
from mesh_files import fails, ply_header, write

from ssr_ref import transforms
from ssr_ref.errors import FileError, SceneError
from ssr_ref.meshfiles.building import MAX_LINE, one_line
from ssr_ref.meshfiles.images import read_image
from ssr_ref.meshfiles.meshes import load_mesh
from ssr_ref.scene import Mesh, Node, Primitive, Scene

ESCAPES = "\x1b[2J\x07\x7f\u202e"
"""Clears a terminal, rings, deletes, turns the direction of text round."""


def test_one_line_keeps_plain_text_and_escapes_the_rest():
    assert one_line("m.obj:\n\tü ≠ ✓") == "m.obj: ü ≠ ✓"
    assert one_line(ESCAPES + "\0\ud800") == r"\x1b[2J\x07\x7f\u202e\x00\ud800"
    long = one_line("a" * 5000 + "\0" * 5000)
    assert len(long) <= MAX_LINE
    assert long.startswith("aaa")
    assert long.endswith(r"\x00")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("m.obj", f"v 0 0 {ESCAPES}\n"),
        ("m.obj", f"{ESCAPES} 1\n"),
        ("m.off", f"OFF\n3 1 0\n0 0 {ESCAPES}\n"),
        ("m.ply", f"ply\nformat ascii 1.0\nproperty {ESCAPES}\nend_header\n"),
        ("m.stl", f"solid a\nvertex 0 0 {ESCAPES}\n"),
    ],
)
def test_errors_do_not_pass_terminal_escapes_on(tmp_path, name, text):
    assert fails(write(tmp_path / name, text), r"\x1b[2J").isprintable()


def test_errors_about_files_beside_do_not_pass_terminal_escapes_on(tmp_path):
    glb = one_triangle()
    root = glb.root | {"buffers": [{"byteLength": 36, "uri": f"{ESCAPES}.bin"}]}
    message = fails(write(tmp_path / "m.gltf", json.dumps(root)), r"\x1b[2J", "is missing")
    assert message.isprintable()


def test_notes_and_reports_do_not_pass_terminal_escapes_on(tmp_path):
    text = f"v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl {ESCAPES}{'long' * 500}\nf 1 2 3\n"
    scene = load_mesh(write(tmp_path / "m.obj", text))
    assert scene.report is not None
    lines = [*scene.notes, *scene.report.fallbacks]
    assert len(lines) == 2
    for line in lines:
        assert line.isprintable()
        assert len(line) <= MAX_LINE
        assert r"\x1b[2J" in line


@pytest.mark.parametrize("name", ["\\ud800", "\\uDC00 \\uD800", "\\udfff"])
def test_half_a_surrogate_pair_in_json_is_refused(tmp_path, name):
    text = json.dumps(one_triangle(asset={"version": "2.0", "generator": "NAME"}).root)
    fails(write(tmp_path / "m.gltf", text.replace("NAME", name)), "JSON", "surrogates not allowed")


def test_a_whole_surrogate_pair_in_json_is_a_character(tmp_path):
    glb = one_triangle()
    glb.root["nodes"][0]["name"] = "\U0001f5ff"  # json.dumps writes two escapes, one of each half
    scene = load_mesh(glb.write(tmp_path / "m.glb"))
    assert scene.nodes[0].name == "\U0001f5ff"


def test_signalling_nan_in_ply_is_no_warning(tmp_path):
    """float32 0x7F800001 beside a double: NumPy's cast raises the invalid flag."""
    elements = [
        ("vertex", 4, ("float x", "float y", "double z")),
        ("face", 1, ("list uchar int vertex_indices",)),
    ]
    rows = b"".join(
        np.array(v, "<f4").tobytes() + np.float64(0).tobytes() for v in ((0, 0), (1, 0), (0, 1))
    )
    odd = np.array([0x7F800001, 0], "<u4").tobytes() + np.float64(0).tobytes()
    face = b"\3" + np.array([0, 1, 2], "<i4").tobytes()
    path = tmp_path / "m.ply"
    path.write_bytes(ply_header("binary_little_endian", elements) + rows + odd + face)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert load_mesh(path).triangle_count == 1


@pytest.mark.parametrize("size", [1e-140, 1e-100, 1.0, 1e110, 1e155, 1e300])
def test_whether_a_transform_is_singular_does_not_depend_on_its_size(size):
    triangle = Primitive(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))
    mesh = Mesh("m", (triangle,))
    good = transforms.scaling(size, 2.0 * size, -size)
    bad = good.copy()
    bad[:3, 1] = bad[:3, 0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Scene((mesh,), (Node("n", 0, good),))
        with pytest.raises(SceneError, match="singular"):
            Scene((mesh,), (Node("n", 0, bad),))


def test_huge_transform_in_3mf_is_no_warning(tmp_path):
    model = MODEL.replace("2 0 0 0 2 0 0 0 2 0 0 0", "1e308 0 0 0 1e308 0 0 0 2 0 0 0")
    path = tmp_path / "m.3mf"
    path.write_bytes(zipped({"3D/3dmodel.model": model.encode()}))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert load_mesh(path).triangle_count == 6


def png(width: int, height: int, depth: int, color: int, raw: bytes) -> bytes:
    """A PNG whose pixel data unpack to `raw`, whatever its header says."""
    header = struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, 0)
    out = b"\x89PNG\r\n\x1a\n"
    for kind, body in ((b"IHDR", header), (b"IDAT", zlib.compress(raw, 9)), (b"IEND", b"")):
        checksum = struct.pack(">I", zlib.crc32(kind + body))
        out += struct.pack(">I", len(body)) + kind + body + checksum
    return out


@pytest.mark.parametrize("color", [0, 2, 4, 6])
def test_deep_png_that_unpacks_to_more_than_its_header_says_is_refused(color):
    """2^26 zeros in 64 kB behind a header of 3 × 3 texels: refused before they take memory."""
    data = png(3, 3, 16, color, bytes(2**26))
    tracemalloc.start()
    try:
        with pytest.raises(FileError, match="unpacks to more than 3 × 3 texels"):
            read_image("bomb", data)
        assert tracemalloc.get_traced_memory()[1] < 2**20
    finally:
        tracemalloc.stop()


def test_png_of_few_bits_that_would_take_minutes_is_refused():
    """4096 × 4096 texels of 1 bit in 2 kB; 1024 × 1024 in 1 kB are read."""
    with pytest.raises(FileError, match="4096 × 4096 texels of 1 bits"):
        read_image("bomb", png(4096, 4096, 1, 0, bytes(4096 * 513)))
    assert read_image("flat", png(1024, 1024, 1, 0, bytes(1024 * 129))).size == (1024, 1024)

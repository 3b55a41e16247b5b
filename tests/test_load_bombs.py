"""Small mesh files that ask for much: what they become is bounded before memory is taken."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib

import numpy as np
import pytest
from glb_file import TRIANGLE, Glb, one_triangle
from mesh_files import fails, write

from ssr_ref.errors import FileError
from ssr_ref.meshfiles import gltf_accessors, meshes, mtl
from ssr_ref.meshfiles.images import SIGNATURE, _chunk, read_image
from ssr_ref.meshfiles.meshes import load_mesh
from ssr_ref.meshfiles.mtl_maps import plain_reference


def textured(name="m", count=1, **texture):
    """A triangle for each of `count` materials, whose texture has no image."""
    look = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    materials = [{"name": name, **look} for _ in range(count)]
    glb = Glb(nodes=[{"mesh": 0}], scenes=[{"nodes": [0]}], materials=materials, textures=[texture])
    position = glb.add(TRIANGLE)
    glb.mesh(*[{"attributes": {"POSITION": position}, "material": i} for i in range(count)])
    return glb


def grey_png(width, height, depth=8):
    """A black PNG, which DEFLATE packs a thousandfold."""
    pack = zlib.compressobj(9)
    row = bytes(1 + width * depth // 8)
    body = b"".join(pack.compress(row) for _ in range(height)) + pack.flush()
    head = struct.pack(">IIBBBBB", width, height, depth, 0, 0, 0, 0)
    return SIGNATURE + _chunk(b"IHDR", head) + _chunk(b"IDAT", body) + _chunk(b"IEND", b"")


def test_notes_of_a_kind_are_eight_and_a_count(tmp_path):
    notes = load_mesh(textured(count=50).write(tmp_path / "m.glb")).notes
    assert len(notes) == 9 and notes[-1] == "replaced: 42 more, see the load report"
    extensions = [f"X_{i}" for i in range(50)]
    notes = load_mesh(one_triangle(extensionsUsed=extensions).write(tmp_path / "m.glb")).notes
    assert len(notes) == 9 and notes[-1] == "42 features are not drawn either"


@pytest.mark.parametrize(("width", "height", "depth"), [(8191, 4099, 8), (4099, 2053, 16)])
def test_an_image_bomb_is_refused_by_its_header(width, height, depth):
    data = grey_png(width, height, depth)
    with pytest.raises(FileError, match="image bomb"):
        read_image("black", data)
    assert len(data) < 100_000  # that is why


def test_a_jpeg_that_lies_about_its_size_is_refused():
    from PIL import Image as PillowImage

    file = io.BytesIO()
    PillowImage.new("RGB", (9, 7), (9, 99, 199)).save(file, "JPEG")
    data = bytearray(file.getvalue())
    assert read_image("small", bytes(data)).size == (9, 7)
    at = data.index(b"\xff\xc0")
    data[at + 5 : at + 9] = struct.pack(">HH", 8000, 8000)
    with pytest.raises(FileError, match=r"256000000 bytes.*image bomb"):
        read_image("large", bytes(data))


def test_a_large_image_with_its_bytes_is_read():
    assert read_image("black", grey_png(4096, 4096)).size == (4096, 4096)


def test_one_library_under_many_names_is_read_once(tmp_path, monkeypatch):
    write(tmp_path / "m.mtl", "newmtl a\nKd 1 0 0\n")
    read = []

    def read_beside(asset, reference, options):
        read.append(reference)
        return (tmp_path / reference).read_bytes()

    monkeypatch.setattr(mtl, "read_beside", read_beside)
    libraries = "".join(f"mtllib {'./' * i}m.mtl\n" for i in range(9))
    text = libraries + "usemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    scene = load_mesh(write(tmp_path / "m.obj", text))
    assert read == ["m.mtl"] and scene.materials[0].base_color == (1.0, 0.0, 0.0)


def test_a_plain_reference_keeps_its_root_and_its_way_up():
    assert plain_reference(r".\a\.\b//c.png") == "a/b/c.png"
    assert plain_reference("/a/./b") == "/a/b"
    assert plain_reference(r"\\server\b") == "//server/b"
    assert plain_reference("../b") == "../b"


def test_bytes_that_become_triangles_count_as_these(tmp_path, monkeypatch):
    # 1000 one-byte indices of a strip: 4 bytes each as numbers, 12 each as triangles.
    glb = Glb(nodes=[{"mesh": 0}], scenes=[{"nodes": [0]}])
    position, indices = glb.add(TRIANGLE), glb.add(np.zeros(1000, "u1"))
    glb.mesh({"attributes": {"POSITION": position}, "indices": indices, "mode": 5})
    path = glb.write(tmp_path / "m.glb")
    monkeypatch.setattr(gltf_accessors, "_BUDGET_PER_BYTE", 0)
    monkeypatch.setattr(gltf_accessors, "_BUDGET", 36 + 16_000)
    assert load_mesh(path).triangle_count == 998
    monkeypatch.setattr(gltf_accessors, "_BUDGET", 36 + 15_999)
    fails(path, "16036 bytes", "expected at most 16035")


def test_a_mesh_may_not_be_placed_without_end(tmp_path, monkeypatch):
    glb = Glb(nodes=[{"mesh": 0}] * 5, scenes=[{"nodes": list(range(5))}])
    glb.mesh(glb.triangle())
    path = glb.write(tmp_path / "m.glb")
    monkeypatch.setattr(meshes, "MAX_DRAWN", 15)
    assert load_mesh(path).triangle_count == 5
    monkeypatch.setattr(meshes, "MAX_DRAWN", 14)  # 5 triangles, but 15 vertices
    fails(path, "places 15 triangles or vertices", "at most 14")


def test_3mf_components_that_double_are_counted_without_large_numbers(tmp_path):
    part = "<component objectid='{0}'/>"
    objects = "<object id='0'><mesh><vertices/><triangles/></mesh></object>" + "".join(
        f"<object id='{i}'><components>{2 * part.format(i - 1)}</components></object>"
        for i in range(1, 20_000)
    )
    items = "".join(f"<item objectid='{i}'/>" for i in range(20_000))
    model = f"<model><resources>{objects}</resources><build>{items}</build></model>"
    with zipfile.ZipFile(tmp_path / "m.3mf", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", model)
    fails(tmp_path / "m.3mf", "objects or more; expected at most 10000")

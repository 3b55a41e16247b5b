"""Small mesh files that ask for much: what they become is bounded before memory is taken."""

from __future__ import annotations

import zipfile

import numpy as np
from glb_file import TRIANGLE, Glb
from mesh_files import fails

from ssr_ref.meshfiles import gltf_accessors, meshes
from ssr_ref.meshfiles.meshes import load_mesh


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

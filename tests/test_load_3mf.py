"""3MF: transforms, units and components in closed form; archives and XML that mean harm."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest
from mesh_files import corners, fails, only, same_bits

from ssr_ref.meshfiles import threemf
from ssr_ref.meshfiles.meshes import load_mesh
from ssr_ref.meshfiles.options import LoadOptions

CORE = 'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"'
MESH = (
    '<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>'
    '<vertex x="0" y="1" z="0.1"/></vertices>'
    '<triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh>'
)
OBJECT = f'<object id="1" name="part" type="model">{MESH}</object>'
ITEM = '<item objectid="1"/>'


def model(resources: str, build: str, unit: str = "") -> str:
    return (
        f'<?xml version="1.0"?><model {unit} {CORE}><resources>{resources}</resources>'
        f"<build>{build}</build></model>"
    )


def write(path, text: str | bytes, name: str = "3D/3dmodel.model", *, packed: bool = True):
    method = zipfile.ZIP_DEFLATED if packed else zipfile.ZIP_STORED
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr(name, text)
    return path


def test_a_mesh_and_its_unit(tmp_path):
    path = write(tmp_path / "a.3MF", model(OBJECT, ITEM))
    scene = load_mesh(path)
    assert same_bits(only(scene).positions, np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0.1]]))
    assert scene.nodes[0].name == "part"
    assert scene.report is not None
    assert (scene.report.format, scene.report.generated_normals) == ("3MF", 1)
    for unit, scale in (("", 1e-3), ('unit="micron"', 1e-6), ('unit="inch"', 0.0254)):
        scene = load_mesh(write(path, model(OBJECT, ITEM, unit)))
        assert scene.nodes[0].world_from_mesh.tolist() == np.diag([scale] * 3 + [1]).tolist()
    scene = load_mesh(path, LoadOptions(unit="foot"))  # wins over the file's inches
    assert scene.nodes[0].world_from_mesh[0, 0] == 0.3048
    fails(write(path, model(OBJECT, ITEM, 'unit="parsec"')), "parsec")


def test_components_and_items_place_the_mesh(tmp_path):
    """3MF's rows act from the left: (x, y, z, 1) · M, M's last row the translation."""
    turn = "0 1 0 -1 0 0 0 0 1 10 20 30"  # x → y, y → −x, then moved
    move = "2 0 0 0 2 0 0 0 2 1 0 0"
    group = (
        f'<object id="2"><components><component objectid="1" transform="{move}"/>'
        '<component objectid="1"/></components></object>'
    )
    build = f'<item objectid="2" transform="{turn}"/><item objectid="1"/>'
    scene = load_mesh(write(tmp_path / "a.3mf", model(OBJECT + group, build, 'unit="meter"')))
    assert len(scene.meshes) == 1
    turned = [[0, -1, 0, 10], [1, 0, 0, 20], [0, 0, 1, 30], [0, 0, 0, 1]]
    # Moved first: (2x + 1, 2y, 2z), then turned: (−2y + 10, 2x + 1 + 20, 2z + 30).
    moved = [[0, -2, 0, 10], [2, 0, 0, 21], [0, 0, 2, 30], [0, 0, 0, 1]]
    assert [node.world_from_mesh.tolist() for node in scene.nodes] == [
        moved, turned, np.eye(4).tolist(),
    ]  # fmt: skip


def test_support_and_colours_are_reported(tmp_path):
    support = OBJECT.replace('id="1"', 'id="2"').replace("model", "support")
    color = '<basematerials id="9"><base name="red" displaycolor="#FF0000"/></basematerials>'
    text = model(
        color + OBJECT.replace('v3="2"', 'v3="2" pid="9"') + support, ITEM + '<item objectid="2"/>'
    )
    scene = load_mesh(write(tmp_path / "a.3mf", text))
    assert len(scene.nodes) == 1
    assert scene.report is not None
    assert scene.report.skipped == ("1 support object",)
    assert scene.report.unsupported == (
        "1 elements 'basematerials'",
        "1 elements 'triangle pid (colour)'",
    )


def component(number: int, *children: int) -> str:
    inner = "".join(f'<component objectid="{c}"/>' for c in children)
    return f'<object id="{number}"><components>{inner}</components></object>'


# Each doubles the one before: 2^40 empty places, or triangles, of 41 objects.
DOUBLING = "".join(component(i, i - 1, i - 1) for i in range(2, 42))
BAD = {
    "no build item": (model(OBJECT, ""), "no triangles (1 objects, 0 build items)"),
    "missing object": (model(OBJECT, '<item objectid="7"/>'), "'7', which is missing"),
    "cycle": (model(component(1, 1), ITEM), "in themselves"),
    "exponential": (model(OBJECT + DOUBLING, '<item objectid="41"/>'), "expected at most 10000"),
    "exponential and empty": (
        model('<object id="1"/>' + DOUBLING, '<item objectid="41"/>'), "at most 10000"),
    "bad index": (model(OBJECT.replace('v3="2"', 'v3="3"'), ITEM), "vertex 3 of 3"),
    "negative index": (model(OBJECT.replace('v3="2"', 'v3="-1"'), ITEM), "vertex -1"),
    "text for number": (model(OBJECT.replace('x="1"', 'x="one"'), ITEM), "broken XML"),
    "no coordinate": (model(OBJECT.replace('x="1"', ""), ITEM), "broken XML"),
    "short transform": (model(OBJECT, '<item objectid="1" transform="1 0 0"/>'), "3 numbers"),
    "singular": (model(OBJECT, f'<item objectid="1" transform="{"0 " * 12}"/>'), "singular"),
    "not closed": (model(OBJECT, ITEM)[:-9], "broken XML"),
    "entities": (
        '<?xml version="1.0"?><!DOCTYPE m [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]>'
        + model(OBJECT, ITEM)[21:], "document type"),
    "all NaN": (model(OBJECT.replace('x="0"', 'x="nan"').replace('x="1"', 'x="nan"'), ITEM), "NaN"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_model_is_one_line(tmp_path, name):
    text, word = BAD[name]
    fails(write(tmp_path / "a.3mf", text), word)


def test_bad_archives_are_one_line(tmp_path, monkeypatch):
    path = tmp_path / "a.3mf"
    path.write_bytes(b"PK\3\4 no zip at all")
    fails(path, "zip")
    fails(write(path, "x", "readme.txt"), "3D/3dmodel.model")
    good = write(path, model(OBJECT, ITEM), packed=False).read_bytes()
    for at in range(0, len(good), 7):
        bad = bytearray(good)
        bad[at] ^= 0xFF
        path.write_bytes(bad)
        try:
            assert corners(only(load_mesh(path)))
        except Exception as error:
            assert type(error).__name__ == "FileError", error
            assert "\n" not in str(error)
    fails(write(path, b" " * 10**6), "zip bomb")  # packs 1 : 1000
    monkeypatch.setattr(threemf, "MAX_UNPACKED", 100)
    fails(write(path, model(OBJECT, ITEM)), "expected at most 100 ")


def test_a_size_that_lies_is_cut_off(tmp_path):
    """The directory says 10 bytes where 5,000 unpack: zipfile or our own count stops it."""
    path = write(tmp_path / "a.3mf", model(OBJECT * 20, ITEM))
    data = bytearray(path.read_bytes())
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        size = archive.infolist()[0].file_size.to_bytes(4, "little")
    for at in (data.find(size), data.rfind(size)):
        data[at : at + 4] = (10).to_bytes(4, "little")
    path.write_bytes(data)
    fails(path)

"""Files of any kind, up axis, unit, strictness, the load report and where it goes."""

from __future__ import annotations

import json
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest
from mesh_files import binary_stl, fails, same_bits, strict, write

import ssr_ref
from ssr_ref import transforms
from ssr_ref.__main__ import main
from ssr_ref.errors import SettingsError
from ssr_ref.fileio.load import load
from ssr_ref.meshfiles import meshes
from ssr_ref.meshfiles.meshes import FORMATS, load_mesh
from ssr_ref.meshfiles.options import LoadOptions
from ssr_ref.scene import LoadReport, Scene

OBJ = "v 0.1 0.2 0.3\nv 1 0 7\nv 0 1 0\nf 1 2 3\n"
PLY = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
PLY += "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
PLY += "0.1 0.2 0.3\n1 0 7\n0 1 0\n3 0 1 2\n"
POINTS = np.float32([[0.1, 0.2, 0.3], [1, 0, 7], [0, 1, 0]])


def files(folder: Path) -> list[Path]:
    """The same triangle in every format but glTF."""
    paths = [write(folder / "a.obj", OBJ), write(folder / "a.ply", PLY)]
    paths.append(write(folder / "a.off", "OFF 3 1 0\n0.1 0.2 0.3\n1 0 7\n0 1 0\n3 0 1 2\n"))
    (folder / "a.stl").write_bytes(binary_stl(POINTS[None]))
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in POINTS)
    text = (
        '<model unit="meter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
        f'<resources><object id="1"><mesh><vertices>{vertices}</vertices><triangles>'
        '<triangle v1="0" v2="1" v3="2"/></triangles></mesh></object></resources>'
        '<build><item objectid="1"/></build></model>'
    )
    with zipfile.ZipFile(folder / "a.3mf", "w") as archive:
        archive.writestr("3D/3dmodel.model", text)
    return [*paths, folder / "a.stl", folder / "a.3mf"]


def world_points(scene: Scene) -> np.ndarray:
    primitive = scene.meshes[0].primitives[0]
    out = np.empty((len(primitive.positions), 3))
    transforms.transform_points(scene.nodes[0].world_from_mesh, primitive.positions, out)
    return out[primitive.faces[0]]


def test_every_format_gives_the_same_triangle_its_up_axis_and_its_unit(tmp_path):
    x, y, z = POINTS.astype(np.float64).T
    for path in files(tmp_path):
        scene = load(path)
        assert same_bits(scene.meshes[0].primitives[0].positions, POINTS)
        assert np.array_equal(world_points(scene), np.stack([x, y, z], 1))
        turned = load(path, up="z")
        assert same_bits(turned.meshes[0].primitives[0].positions, POINTS)  # the file's bits
        assert np.array_equal(world_points(turned), np.stack([x, z, -y], 1))  # exact
        assert transforms.determinant3(turned.nodes[0].world_from_mesh) == 1.0
        for unit, metres in (
            ("mm", 1e-3),
            ("cm", 1e-2),
            ("m", 1),
            ("inch", 0.0254),
            ("foot", 0.3048),
        ):
            small = load(path, up="z", unit=unit)
            assert np.array_equal(world_points(small), np.stack([x, z, -y], 1) * metres)
        assert scene.report is not None
        assert scene.report.format.lower() == path.suffix[1:]
        assert (scene.report.triangles, scene.report.generated_normals) == (1, 1)


def test_unknown_and_unusable_options(tmp_path):
    (path, *_) = files(tmp_path)
    for name, value in (("up", "x"), ("unit", "yard"), ("normals", "round"), ("strict", 1)):
        with pytest.raises(SettingsError, match=f"{name} is "):
            load(path, **{name: value})
    with pytest.raises(SettingsError, match="only glTF files have several"):
        load(path, scene=0)
    with pytest.raises(SettingsError, match="built-in scene"):
        load("teapot", up="z")


def test_strict_accepts_what_is_drawn_as_it_stands(tmp_path):
    for path in files(tmp_path):
        assert strict(path).triangle_count == 1
    path = write(tmp_path / "b.obj", "usemtl red\n" + OBJ)
    assert load_mesh(path).triangle_count == 1
    fails(path, "strict", "red: in no .mtl file", call=strict)


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
    path.write_bytes(b"")
    fails(path, "'.xyz'" if ext == ".xyz" else "empty (0 bytes)")
    if ext != ".xyz":
        path.write_bytes(b"garbage \xff\xfe\n" * 7)
        fails(path)
        with monkeypatch.context() as patch:
            patch.setattr(meshes, "MAX_FILE_BYTES", 50)
            fails(path, "77 bytes; expected at most 50")

        def refuse(self: Path) -> bytes:  # root reads everything, so chmod would not do
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr(Path, "read_bytes", refuse)
        fails(path, "Permission denied", "permissions")


def test_a_bad_file_is_silent_and_unchanged(tmp_path, capfd, caplog, recwarn):
    (tmp_path / "a.stl").write_bytes(binary_stl(POINTS[None])[:-1])
    write(tmp_path / "a.ply", PLY.replace("1 0 7", "1 x 7"))
    before = {p: p.read_bytes() for p in tmp_path.iterdir()}
    for path in before:
        fails(path)
    assert {p: p.read_bytes() for p in tmp_path.iterdir()} == before
    assert capfd.readouterr() == ("", "")
    assert not caplog.records
    assert not recwarn.list


def test_very_many_parts_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("ssr_ref.meshfiles.building.MAX_PARTS", 3)
    objects = "".join(f"o {i}\nf 1 2 3\n" for i in range(4))
    fails(write(tmp_path / "a.obj", OBJ + objects), "over 3 parts")
    solid = "solid {}\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
    solids = "".join(solid.format(i) for i in range(4))
    fails(write(tmp_path / "a.stl", solids), "over 3 parts")


# ------------------------------------------------------------------ command line


def split(line: str) -> list[str]:
    return line.split()


@pytest.fixture
def rendered(monkeypatch, tmp_path):
    """The scenes that are rendered, by a stand-in for the pipeline."""
    from test_cli import made_up_render

    scenes = []

    def render(scene, camera=None, settings=None, *, more=None, progress=None):
        scenes.append(scene)
        return made_up_render(scene, camera, settings, progress=progress)

    monkeypatch.setattr("ssr_ref.pipeline.render", render, raising=False)
    monkeypatch.chdir(tmp_path)
    return scenes


def test_the_report_is_in_the_manifest_and_printed_with_v(rendered, tmp_path, capsys):
    write(tmp_path / "a.obj", "usemtl red\nl 1 2\n" + OBJ + "f 1 1 2\n")
    assert main(["render", "a.obj", "-o", "out", "--no-previews", "-v", "--size", "9x7"]) == 0
    out = capsys.readouterr().out
    for line in (
        "OBJ, 2 triangles in 1 meshes, 1 degenerate, 0 not finite",
        "1 primitives with generated ones",
        "1 line or point (l, p)",
        "red: in no .mtl file, the default is used",
    ):
        assert line in out
    assert rendered[0].notes == (
        "not drawn: 1 line or point (l, p)",
        "replaced: red: in no .mtl file, the default is used",
    )  # which the pipeline warns of
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_bytes())
    assert manifest["scene"]["load"] == {
        "format": "OBJ",
        "triangles": 2,
        "degenerate": 1,
        "non_finite": 0,
        "skipped": ["1 line or point (l, p)"],
        "fallbacks": ["red: in no .mtl file, the default is used"],
        "unsupported": [],
        "textures": [],
        "generated_normals": 1,
    }
    assert str(tmp_path) not in json.dumps(manifest["scene"])
    assert main(["render", "a.obj", "-o", "quiet", "--no-previews", "--size", "9x7"]) == 0
    assert "primitives with generated ones" not in capsys.readouterr().out
    assert main(["render", "a.obj", "-o", "json", "--no-previews", "--json", "--size", "9x7"]) == 0
    assert json.loads(capsys.readouterr().out)["load"]["triangles"] == 2
    assert ssr_ref.load_bundle(tmp_path / "out") is not None


def test_scenes_made_by_code_have_no_report(rendered, tmp_path, capsys):
    assert (
        main(
            [
                "render",
                "poles",
                "--tessellation",
                "1",
                "-o",
                "out",
                "--no-previews",
                "-v",
                "--size",
                "9x7",
            ]
        )
        == 0
    )
    assert "primitives with generated ones" not in capsys.readouterr().out
    assert rendered[0].report is None
    assert "load" not in json.loads((tmp_path / "out" / "manifest.json").read_bytes())["scene"]
    assert Scene(rendered[0].meshes, rendered[0].nodes, rendered[0].materials).report is None
    assert LoadReport(format="x").generated_normals == 0


def test_options_on_the_command_line(rendered, tmp_path, capsys):
    write(tmp_path / "a.obj", "usemtl red\n" + OBJ)
    line = "render a.obj -o a --no-previews --up z --unit inch --normals crease --size 9x7"
    assert main([*line.split(), "--allow-outside"]) == 0
    (node,) = rendered[0].nodes
    assert node.world_from_mesh.tolist() == [
        [0.0254, 0, 0, 0], [0, 0, 0.0254, 0], [0, -0.0254, 0, 0], [0, 0, 0, 1],
    ]  # fmt: skip
    for extra, told in (
        ("--strict", "strict"),
        ("--up x", "up is 'x'; expected one of y, z"),
        ("--unit mile", "unit is 'mile'"),
        ("--scene 2", "scene is 2"),
        ("--scene Front", "scene is 'Front'"),
        ("--normals round", "normals is 'round'"),
    ):
        capsys.readouterr()
        assert (
            main(
                [*["render", "a.obj", "-o", "b", "--no-previews", "--size", "9x7"], *extra.split()]
            )
            == 2
        )
        out, err = capsys.readouterr()
        assert out == ""
        assert err.startswith("error: ")
        assert err.count("\n") == 1
        assert told in err
    assert not (tmp_path / "b").exists()
    assert LoadOptions(up="z").unit is None

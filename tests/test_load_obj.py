"""OBJ: what the text says arrives, corner by corner. Every expected number stands in the file."""

from __future__ import annotations

import random

import numpy as np
import pytest
from mesh_files import corners, fails, only, same_bits, strict, write

from ssr_ref.errors import FileError
from ssr_ref.meshfiles.meshes import load_mesh
from ssr_ref.scene import Material

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
P = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


def test_authored_normals_and_uv_keep_their_bits(tmp_path):
    rng = np.random.default_rng(3)
    v, vt, vn = (rng.normal(size=(9, k)).astype(np.float32) for k in (3, 2, 3))
    lines = [
        f"{key} " + " ".join(repr(float(x)) for x in row)
        for key, rows in (("v", v), ("vt", vt), ("vn", vn))
        for row in rows
    ]
    picks = rng.integers(0, 9, (40, 3, 3))
    lines += ["f " + " ".join(f"{a + 1}/{b + 1}/{c + 1}" for a, b, c in face) for face in picks]
    scene = load_mesh(write(tmp_path / "a.obj", "\n".join(lines)))  # no newline at the end
    primitive = only(scene)
    for name, table, column in (("positions", v, 0), ("uv0", vt, 1), ("normals", vn, 2)):
        assert same_bits(getattr(primitive, name)[primitive.faces], table[picks[:, :, column]])
    assert scene.report is not None
    assert scene.report.generated_normals == 0
    # One vertex for each different corner, numbered by first use: whatever sorts inside.
    numbers = {
        tuple(c): i for i, c in enumerate(dict.fromkeys(map(tuple, picks.reshape(-1, 3).tolist())))
    }
    assert primitive.faces.tolist() == [[numbers[tuple(c)] for c in f] for f in picks.tolist()]


def test_objects_groups_and_materials_get_the_right_faces(tmp_path):
    write(
        tmp_path / "m.mtl",
        "newmtl red\nKd 0.9 0.1 0.2\nnewmtl dull green\nKd 0.1 0.8 0.3\nnewmtl unused\nKd 1 1 1\n",
    )
    text = (
        "mtllib m.mtl\n" + SQUARE + "o first thing\ng a\nusemtl red\nf 1 2 3\nusemtl dull green\n"
        "f 1 3 4\ng b\nf 2 3 4\no second\nusemtl red\nf 4 3 2\no first thing\nusemtl red\nf 3 2 1\n"
    )
    scene = strict(write(tmp_path / "a.OBJ", text))
    assert [node.name for node in scene.nodes] == ["first thing", "second"]
    found = [
        [(scene.materials[p.material].base_color, corners(p)) for p in mesh.primitives]
        for mesh in scene.meshes
    ]
    red, green = (0.9, 0.1, 0.2), (0.1, 0.8, 0.3)
    assert found == [
        [(red, [[P[0], P[1], P[2]], [P[2], P[1], P[0]]]), (green, [[P[0], P[2], P[3]], P[1:]])],
        [(red, [[P[3], P[2], P[1]]])],
    ]
    assert [m.name for m in scene.materials] == ["red", "dull green"]


def test_each_kind_of_corner(tmp_path):
    text = SQUARE + "vt 0.25 0.5\nvt 0.75 1\nvt 0 0\nvn 0 0 1\nvn 0 1 0\n"
    text += "f 1 2 3\nf 1/1 2/2 3/3\nf 1//2 2//1 3//1\nf 1/3/1 2/2/1 3/1/2\n"
    text += "f 1/ 2/ 3//\nf 1/2/ 2/2 4/1\n"
    plain, uv, normal, both = load_mesh(write(tmp_path / "a.obj", text)).meshes[0].primitives
    assert corners(plain) == [P[:3], P[:3]]
    assert plain.uv0 is None
    t, n = [[0.25, 0.5], [0.75, 1], [0, 0]], [[0, 0, 1], [0, 1, 0]]
    assert corners(uv, "uv0") == [[t[0], t[1], t[2]], [t[1], t[1], t[0]]]
    assert corners(normal, "normals") == [[n[1], n[0], n[0]]]
    assert normal.uv0 is None
    assert corners(both, "uv0") == [[t[2], t[1], t[0]]]
    assert corners(both, "normals") == [[n[0], n[0], n[1]]]


def test_negative_indices_count_back_from_their_line(tmp_path):
    text = SQUARE + "vt 0 0\nvt 1 1\nf -4/-2 -3/-1 -2/-1\nv 5 5 5\nvt 0.5 0.5\nf -1/-1 -2/1 1/-2\n"
    primitive = only(load_mesh(write(tmp_path / "a.obj", text)))
    assert corners(primitive) == [[P[0], P[1], P[2]], [[5, 5, 5], P[3], P[0]]]
    assert corners(primitive, "uv0") == [[[0, 0], [1, 1], [1, 1]], [[0.5, 0.5], [0, 0], [1, 1]]]


def test_quads_and_polygons_keep_their_uv(tmp_path):
    text = SQUARE + "v -1 0.5 0\n" + "".join(f"vt {i / 8} {i / 4}\n" for i in range(5))
    text += "f 1/1 2/2 3/3 4/4\nf 1/5 2/4 3/3 4/2 5/1\n"
    primitive = only(load_mesh(write(tmp_path / "a.obj", text)))
    five = [*P, [-1, 0.5, 0]]
    fans = [(0, 1, 2), (0, 2, 3), (0, 1, 2), (0, 2, 3), (0, 3, 4)]
    assert corners(primitive) == [[five[i] for i in fan] for fan in fans]
    t = [[i / 8, i / 4] for i in range(5)]
    uv = [[t[i] for i in fan] for fan in fans[:2]] + [[t[4 - i] for i in fan] for fan in fans[2:]]
    assert corners(primitive, "uv0") == uv


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_odd_text(tmp_path, end):
    """BOM, tabs, comments, continued lines, indices of what comes later."""
    lines = [
        "\ufeff# a path in a comment continues nothing: C:\\models\\",
        "  v\t0 0 0 # origin",
        "f 1 \\",
        " 2 \\",
        "   3",
        "v 1   0 0",
        "",
        "v 1 1 0#near",
        "v 0 \\",
        "# within a continued line \\",
        "1 0",
        "\tf\t1 3\t4 # last",
    ]
    primitive = only(strict(write(tmp_path / "odd.obj", end.join(lines))))
    assert corners(primitive) == [P[:3], [P[0], P[2], P[3]]]


def test_vertex_colours_are_linear_as_they_stand(tmp_path):
    rows = "v 0 0 0 0.1 0.2 0.3\nv 1 0 0 nan nan nan\nv 0 1 0 0 1 2.5\nf 1 2 3\n"
    scene = load_mesh(write(tmp_path / "c.obj", rows))
    expected = np.array([[0.1, 0.2, 0.3], [1, 1, 1], [0, 1, 2.5]], np.float32)
    assert same_bits(only(scene).colors, expected)  # not rounded to bytes
    assert scene.materials == (Material(base_color=(1.0, 1.0, 1.0)),)
    assert scene.report is not None
    assert scene.report.fallbacks == ("1 vertex colour is NaN or infinite: white is used",)
    assert scene.notes == (
        "replaced: 1 vertex colour is NaN or infinite: white is used",
        "1 vertex colour is outside 0 to 1: used as linear RGB",
    )
    mixed = load_mesh(write(tmp_path / "m.obj", "v 0 0 1\n" + rows.replace("f 1", "f 4 1")))
    assert only(mixed).colors is None
    assert mixed.report is not None
    assert mixed.report.unsupported == ("vertex colours: 1 vertices have none",)


def test_what_is_not_drawn_is_reported(tmp_path):
    text = SQUARE + "s 1\nl 1 2 3\np 1\nf 1 2\nf 1 2 3\nfoo bar\ncurv 0 1\ncstype bezier\nf 1 1 2\n"
    text += "v nan 0 0\nf 1 2 5\n"
    report = load_mesh(write(tmp_path / "a.obj", text)).report
    assert report is not None
    assert (report.triangles, report.degenerate, report.non_finite) == (3, 1, 1)
    assert report.skipped == (
        "1 face of fewer than 3 corners (the first in line 8)",
        "2 lines or points (l, p)",
        "1 line with an unknown keyword ('foo')",
    )
    assert report.unsupported == (
        "free-form or obsolete: cstype, curv",
        "smoothing groups (s): the crease angle decides",
    )
    with pytest.raises(FileError, match="strict"):
        strict(tmp_path / "a.obj")


BAD = {
    "text for number": ("v 0 0 0\nv 1 x 0\nv 0 1 0\nf 1 2 3\n", "line 2 has '1 x 0'"),
    "short vertex": ("v 0 0 0\nv 1 0 0\nv 0 1\nf 1 2 3\n", "line 3 has a v of 2 numbers"),
    "short normal": (SQUARE + "vn 0 1\nf 1 2 3\n", "line 5 has a vn of 2 numbers"),
    "index zero": (SQUARE + "f 0 1 2\n", "line 5 refers to v 0; expected 1 to 4, or -1 to -4"),
    "index too low": (SQUARE + "f -1 -2 -5\n", "line 5 refers to v -5"),
    "index too large": (
        SQUARE + "f 1 2 3\n\nf 1 2 9\nf 1 2 7\n",
        "line 7 refers to v 9; expected 1 to 4",
    ),
    "uv too large": (SQUARE + "vt 0 0\nf 1/1 2/1 3/2\n", "line 6 refers to vt 2; expected 1 to 1"),
    "normal missing": (SQUARE + "vn 0 0 1\nf 1//1 2//1 3//2\n", "line 6 refers to vn 2"),
    "huge index": (SQUARE + "f 1 2 99999999999999999999\n", "line 5"),
    "text for index": (SQUARE + "f 1 2 3\nf 1 2 c\n", "line 6 has the face '1 2 c'"),
    "mixed corners": (SQUARE + "vn 0 0 1\nf 1//1 2//1 3\n", "line 6"),
    "no position": (SQUARE + "vt 0 0\nf /1 /1 /1\n", "line 6"),
    "four parts": (SQUARE + "f 1/1/1/1 2/1/1/1 3/1/1/1\n", "line 5"),
    "swapped parts": (SQUARE + "vt 0 0\nvn 0 0 1\nf 1/1/1/1 2/1 3/1/1\n", "line 7"),
    "underscore": (SQUARE + "f 1_0 2 3\n", "line 5"),
    "only small faces": (SQUARE + "f 1 2\n", "no triangles"),
}


@pytest.mark.parametrize("name", BAD)
def test_an_error_names_its_line(tmp_path, name):
    text, word = BAD[name]
    fails(write(tmp_path / "a.obj", text), word)


def test_random_text_is_a_scene_or_one_line(tmp_path):
    rng = random.Random(5)
    good = SQUARE + "vt 0 1\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1\nusemtl a\nf 1 2 3 4\no b\nf -1 -2 -3\n"
    path = tmp_path / "a.obj"
    loaded = 0
    for _ in range(400):
        text = list(good)
        for _ in range(rng.randint(1, 4)):
            text[rng.randrange(len(text))] = rng.choice("0129-/. \n\\#\0fvné_e")
        write(path, "".join(text))
        try:
            load_mesh(path)
            loaded += 1
        except FileError as error:
            assert "\n" not in str(error)
    assert 0 < loaded < 400

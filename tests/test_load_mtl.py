"""MTL: factors, maps and their layout, what falls back. Colours and codes stand in the files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mesh_files import fails, only, same_bits, strict, write, write_image

from ssr_ref.meshfiles.meshes import load_mesh
from ssr_ref.meshfiles.options import LoadOptions
from ssr_ref.scene import Material, Scene
from ssr_ref.texture import Texture

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.25 0.75\nvt 1 0\nvt 0 1\n"
RED = np.array([[[200, 10, 20], [1, 2, 3]]], np.uint8)  # 1 × 2
FLIP = {"offset": (0.0, 1.0), "scale": (1.0, -1.0)}


def load(folder: Path, mtl: str, *, options: LoadOptions = LoadOptions(), uv: bool = True) -> Scene:  # noqa: B008
    write(folder / "a.mtl", mtl)
    face = "f 1/1 2/2 3/3\n" if uv else "f 1 2 3\n"
    text = "mtllib a.mtl\n" + TRIANGLE + "usemtl m\n" + face
    return load_mesh(write(folder / "a.obj", text), options)


def reported(scene: Scene) -> tuple[tuple[str, ...], tuple[str, ...]]:
    assert scene.report is not None
    return scene.report.fallbacks, scene.report.unsupported


def test_factors_are_linear_and_not_rounded(tmp_path):
    mtl = "newmtl m\n\tKd 0.3 0.1 0.7 # linear\nKe 0 2.5 0\nPm 0.75\nPr 0.1\nNs 90\nillum 2\n"
    scene = load(tmp_path, mtl, options=LoadOptions(strict=True))
    assert scene.materials == (Material("m", (0.3, 0.1, 0.7), 0.75, 0.1, (0.0, 2.5, 0.0)),)
    assert load(tmp_path, "newmtl m\nKd 0.5\n").materials == (Material("m", (0.5, 0.5, 0.5)),)
    bad = load(tmp_path, "newmtl m\nKd spectral file.rfl 1\nKe -1 0 0\n")
    assert bad.materials == (Material("m"),)
    assert reported(bad)[0] == ("m: Kd spectral file.rfl 1", "m: Ke -1 0 0")


def test_maps_multiply_and_uv_keeps_the_files_bits(tmp_path):
    write_image(tmp_path / "red.png", RED)
    (tmp_path / "sub").mkdir()
    write_image(tmp_path / "sub" / "my glow.png", RED[:, ::-1])
    mtl = "newmtl m\nKd 0.5 1 0.25\nmap_Kd red.png\nmap_Ke sub\\my glow.png\n"
    scene = load(tmp_path, mtl, options=LoadOptions(strict=True))
    (material,) = scene.materials
    assert material.base_color == (0.5, 1.0, 0.25)
    assert material.emissive == (1.0, 1.0, 1.0)  # no Ke: the map alone
    assert material.base_color_texture == Texture(0, **FLIP)
    assert material.emissive_texture == Texture(1, **FLIP)
    assert material.alpha_cutoff is None
    assert same_bits(only(scene).uv0, np.float32([[0.25, 0.75], [1, 0], [0, 1]]))
    assert scene.images[0].pixels[0, 0].tolist() == [200, 10, 20, 255]
    assert scene.report is not None
    assert scene.report.textures == (("red.png", 2, 1), ("sub/my glow.png", 2, 1))


def test_map_options(tmp_path):
    write_image(tmp_path / "red 2.png", RED)
    mtl = "newmtl m\nmap_Kd -s 2 4 1 -o 0.25 0.5 -clamp on -blendu off -type x red 2.png\n"
    scene = load(tmp_path, mtl, options=LoadOptions(strict=True))
    # MTL with v up: (2u + ¼, 4v + ½); v down: 1 − (4v + ½) = ½ − 4v.
    expected = Texture(0, wrap=("clamp", "clamp"), offset=(0.25, 0.5), scale=(2.0, -4.0))
    assert scene.materials[0].base_color_texture == expected
    assert scene.materials[0].base_color == (1.0, 1.0, 1.0)
    mtl = "newmtl m\nmap_Kd -mm 0.1 2 -t 1 -s 3 red 2.png\nmap_Bump b.png\nPc 0.5\n"
    scene = load(tmp_path, mtl)
    assert scene.materials[0].base_color_texture == Texture(0, offset=(0, 1), scale=(3, -1))
    assert reported(scene)[1] == ("m: map_kd with -mm, -t", "m: map_bump, pc")


def test_map_d_is_a_cut_out_and_d_is_not(tmp_path):
    glass = load(tmp_path, "newmtl m\nd 0.25\n")
    assert (glass.materials[0].alpha, glass.materials[0].alpha_cutoff) == (0.25, None)
    assert reported(glass) == ((), ("m: d 0.25, drawn opaque",))
    assert load(tmp_path, "newmtl m\nTr 0.25\n").materials[0].alpha == 0.75
    assert load(tmp_path, "newmtl m\nTr 0.25\nd -halo 0.5\n").materials[0].alpha == 0.5

    leaf = np.concatenate([RED, np.array([[[7], [255]]], np.uint8)], axis=2)
    write_image(tmp_path / "leaf.png", leaf)
    write_image(tmp_path / "grey.png", np.array([[[99] * 3, [13] * 3]], np.uint8))
    same = load(tmp_path, "newmtl m\nmap_Kd leaf.png\nmap_d leaf.png\n")
    assert len(same.images) == 1  # as it is
    other = load(tmp_path, "newmtl m\nmap_Kd leaf.png\nmap_d grey.png\n")
    alone = load(tmp_path, "newmtl m\nmap_d -imfchan m leaf.png\n")
    for scene, rgb, alpha in (
        (same, RED, [7, 255]),  # its alpha, since it has one
        (other, RED, [99, 13]),  # red of an image without alpha
        (alone, np.full_like(RED, 255), [7, 255]),
    ):
        (material,) = scene.materials
        assert (material.alpha, material.alpha_cutoff) == (1.0, 0.5)
        assert material.base_color_texture is not None
        pixels = scene.images[material.base_color_texture.image].pixels
        assert pixels[0, :, 3].tolist() == alpha
        assert (pixels[:, :, :3] == rgb).all()
    write_image(tmp_path / "tall.png", np.zeros((2, 2, 3), np.uint8))
    odd = load(tmp_path, "newmtl m\nmap_Kd leaf.png\nmap_d tall.png\n")
    assert odd.materials[0].alpha_cutoff is None
    assert reported(odd)[0] == ("m: map_d differs in size or layout from map_Kd",)


def test_roughness_and_metallic_are_packed(tmp_path):
    write_image(tmp_path / "r.png", np.array([[[10, 1, 2], [20, 3, 4]]], np.uint8))
    write_image(tmp_path / "m.png", np.array([[[500, 6, 7], [65535, 8, 9]]], np.uint16))
    scene = load(tmp_path, "newmtl m\nPr 0.5\nmap_Pr r.png\nmap_Pm -imfchan r m.png\n")
    (material,) = scene.materials
    assert (material.roughness, material.metallic) == (0.5, 1.0)
    assert material.metallic_roughness_texture == Texture(2, **FLIP)
    # Roughness in green, metallic in blue; 8-bit codes in 16 bits are exactly 257 times as large.
    full = 65535
    assert scene.images[2].pixels.tolist() == [[[full, 2570, 500, full], [full, 5140, full, full]]]
    alone = load(tmp_path, "newmtl m\nmap_Pm r.png\n")
    assert alone.materials[0].roughness == Material().roughness
    assert alone.images[1].pixels.tolist() == [[[255, 255, 10, 255], [255, 255, 20, 255]]]


@pytest.mark.parametrize("key", ["map_Kd", "map_Ke", "map_Pr", "map_d"])
def test_a_missing_map_falls_back_and_strict_refuses(tmp_path, key):
    mtl = f"newmtl m\nKd 0.5 0.25 1\n{key} gone.png\n"
    scene = load(tmp_path, mtl)
    assert scene.materials == (Material("m", (0.5, 0.25, 1.0)),)
    expected = f"m: {key.lower()} refers to 'gone.png', which is missing"
    assert reported(scene) == ((expected,), ())
    assert scene.notes == (f"replaced: {expected}",)
    fails(tmp_path / "a.obj", "strict", "gone.png", call=strict)


def test_a_damaged_map_and_one_outside_fall_back(tmp_path):
    inside = tmp_path / "inside"
    inside.mkdir()
    write_image(tmp_path / "out.png", RED)
    (inside / "bad.png").write_bytes(b"GIF89a")
    scene = load(inside, "newmtl m\nmap_Kd bad.png\nmap_Ke ../out.png\n")
    assert scene.materials == (Material("m"),)
    first, second = reported(scene)[0]
    assert "bad.png" in first
    assert "not inside the file's folder" in second
    assert str(tmp_path) not in first + second  # a manifest holds no paths of this machine
    scene = load(inside, "newmtl m\nmap_Ke ../out.png\n", options=LoadOptions(allow_outside=True))
    assert scene.materials[0].emissive_texture == Texture(0, **FLIP)


def test_faces_without_uv_have_the_factor(tmp_path):
    write_image(tmp_path / "red.png", RED)
    scene = load(tmp_path, "newmtl m\nKd 0.5 0.5 1\nmap_Kd red.png\n", uv=False)
    assert scene.materials == (Material("m", (0.5, 0.5, 1.0)),)
    assert reported(scene)[0] == ("m: map_kd on faces without texture coordinates",)


def test_libraries_that_are_missing_or_have_odd_names(tmp_path):
    write(tmp_path / "b c.mtl", "newmtl x\nKd 0.25\n")
    write(tmp_path / "d.mtl", "newmtl y\nKd 0.75\n")
    text = "mtllib b c.mtl\nmtllib gone.mtl d.mtl\n" + TRIANGLE
    text += "usemtl x\nf 1 2 3\nusemtl y\nf 1 2 3\nusemtl z\nf 1 2 3\n"
    scene = load_mesh(write(tmp_path / "a.obj", text))
    assert [m.base_color[0] for m in scene.materials] == [0.25, 0.75, 0.8]
    assert reported(scene)[0] == (
        "materials: mtllib refers to 'gone.mtl', which is missing",
        "z: in no .mtl file, the default is used",
    )
    fails(tmp_path / "a.obj", "strict", "gone.mtl", call=strict)


def test_a_map_is_read_once_and_its_failure_told_for_each_material(tmp_path):
    mtl = "newmtl a\nmap_Kd no.png\nnewmtl b\nmap_Kd no.png\nnewmtl c\nmap_Kd red.png\nnewmtl d\n"
    write(tmp_path / "a.mtl", mtl + "map_Kd red.png\nmap_Ke red.png\n")
    write_image(tmp_path / "red.png", RED)
    faces = "".join(f"usemtl {k}\nf 1/1 2/2 3/3\n" for k in "abcd")
    scene = load_mesh(write(tmp_path / "a.obj", "mtllib a.mtl\n" + TRIANGLE + faces))
    assert len(scene.images) == 1
    assert [line[0] for line in reported(scene)[0]] == ["a", "b"]

"""Strict loading of glTF: values that are replaced and NEAREST filters are refused."""

from __future__ import annotations

import numpy as np
import pytest
from glb_file import TRIANGLE, Glb, with_png
from mesh_files import fails, strict

from ssr_ref.meshfiles.meshes import load_mesh

NAN = np.float32("nan")
UV = np.zeros((3, 2), np.float32)
CASES = {
    "nan colours": ({"COLOR_0": np.full((3, 3), NAN)}, {}, "3 vertex colours are NaN"),
    "nan coordinates": ({"TEXCOORD_0": UV * NAN}, {}, "3 texture coordinates are NaN"),
    "nearest": ({}, {"magFilter": 9728}, "NEAREST"),
}


def textured(attributes, sampler):
    """A triangle with a texture; attributes: those that differ."""
    look = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    glb = Glb(
        nodes=[{"mesh": 0}],
        scenes=[{"nodes": [0]}],
        materials=[look],
        textures=[{"source": 0, "sampler": 0}],
        samplers=[sampler],
    )
    with_png(glb)
    arrays = {"POSITION": TRIANGLE, "TEXCOORD_0": UV, **attributes}
    glb.mesh(
        {
            "attributes": {name: glb.add(a) for name, a in arrays.items()},
            "material": 0,
        }
    )
    return glb


@pytest.mark.parametrize("name", CASES)
def test_strict_refuses_what_a_note_says(tmp_path, name):
    attributes, sampler, words = CASES[name]
    path = textured(attributes, sampler).write(tmp_path / "m.glb")
    (note,) = load_mesh(path).notes
    assert words in note
    fails(path, "strict loading", words, call=strict)


def test_strict_takes_the_same_file_without_the_fault(tmp_path):
    assert strict(textured({}, {}).write(tmp_path / "m.glb")).notes == ()

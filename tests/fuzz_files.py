"""Small valid files of every format, rich in what their readers branch on: seeds of the fuzz test.

An asset is a dict of file names to bytes; the first one is the mesh file, the others lie beside it.
"""

from __future__ import annotations

import base64
import io
import json
import zipfile
from typing import Any

import numpy as np
from glb_file import TRIANGLE, Glb
from mesh_files import binary_stl, ply_header
from PIL import Image as PillowImage

from ssr_ref.meshfiles.images import png_bytes
from ssr_ref.texture import Image

Asset = dict[str, bytes]

QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.25]], np.float32)
UV = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)


def codes(height: int, width: int, dtype: Any = np.uint8) -> Any:
    """(height, width, 4) codes, all different along a row, alpha too."""
    n = np.arange(height * width * 4).reshape(height, width, 4)
    return (n * 37 % (np.iinfo(dtype).max + 1)).astype(dtype)


def deep_png() -> bytes:
    return png_bytes(Image("deep", codes(3, 5, np.uint16)))


def small_png() -> bytes:
    """Compressed by Pillow, with a palette and tRNS, unlike what `png_bytes` writes."""
    out = io.BytesIO()
    image = PillowImage.fromarray(codes(5, 7)[:, :, 0] % 4, "P")
    image.putpalette(list(range(12)))
    image.save(out, "PNG", transparency=1)
    return out.getvalue()


def jpeg() -> bytes:
    out = io.BytesIO()
    PillowImage.fromarray(codes(9, 11)[:, :, :3].copy()).save(out, "JPEG", quality=60)
    return out.getvalue()


def webp() -> bytes:
    out = io.BytesIO()
    PillowImage.fromarray(codes(5, 3)).save(out, "WEBP", lossless=True)
    return out.getvalue()


def rich_glb() -> Glb:
    """Two scenes, a tree, strips, a fan, points, sparse and quantised accessors, MASK, textures."""
    glb = Glb(
        extensionsUsed=["KHR_mesh_quantization", "KHR_texture_transform", "KHR_materials_unlit"],
        extensionsRequired=["KHR_mesh_quantization"],
        nodes=[
            {"children": [1, 2], "translation": [1, 2, 3]},
            {"mesh": 0, "rotation": [0, 0.6, 0, 0.8], "scale": [1, 2, 1]},
            {"mesh": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1], "name": "b"},
            {"mesh": 0, "camera": 0},
        ],
        scenes=[{"nodes": [0], "name": "first"}, {"nodes": [3]}],
        cameras=[{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
        samplers=[{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}],
        textures=[{"source": 0, "sampler": 0}, {"source": 1}, {"source": 2}],
        materials=[
            {
                "name": "leaf",
                "alphaMode": "MASK",
                "alphaCutoff": 0.4,
                "doubleSided": True,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [0.5, 0.25, 1, 0.75],
                    "metallicFactor": 0.5,
                    "roughnessFactor": 0.25,
                    "baseColorTexture": {
                        "index": 0,
                        "extensions": {
                            "KHR_texture_transform": {
                                "offset": [0.5, 0], "rotation": 1, "scale": [2, 1], "texCoord": 1
                            }
                        },
                    },
                    "metallicRoughnessTexture": {"index": 1},
                },
                "emissiveFactor": [1, 0.5, 0],
                "emissiveTexture": {"index": 2, "texCoord": 0},
                "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 2}},
            },
            {"extensions": {"KHR_materials_unlit": {}}, "alphaMode": "BLEND"},
        ],
    )  # fmt: skip
    indices = glb.add(np.array([0, 1, 2, 0, 2, 3], "<u2"))
    sparse = glb.add(QUAD, stride=16, offset=4)
    glb.root["accessors"][sparse]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": glb.embed(b"\2\0"), "componentType": 5123},
        "values": {"bufferView": glb.embed(QUAD[1].tobytes())},
    }
    full = {
        "POSITION": sparse,
        "NORMAL": glb.add(np.array([[0, 0, 127, 0]] * 4, "|i1")[:, :3], stride=4, normalized=True),
        "TEXCOORD_0": glb.add(UV),
        "TEXCOORD_1": glb.add((UV * 65535).astype("<u2"), normalized=True),
        "COLOR_0": glb.add(codes(2, 2).reshape(4, 4), normalized=True),
    }
    zeros = {"componentType": 5126, "count": 4, "type": "VEC2", "sparse": {
        "count": 4,
        "indices": {"bufferView": glb.embed(b"\0\1\2\3"), "componentType": 5121},
        "values": {"bufferView": glb.embed(UV.tobytes())},
    }}  # fmt: skip
    glb.root["accessors"].append(zeros)
    strip = {
        "POSITION": glb.add((QUAD * 100).astype("<i2"), stride=8),
        "TEXCOORD_0": len(glb.root["accessors"]) - 2,
    }
    glb.mesh(
        {"attributes": full, "indices": indices, "material": 0},
        {"attributes": strip, "mode": 5, "material": 1, "targets": [{"POSITION": sparse}]},
    )
    glb.mesh(
        {"attributes": {"POSITION": glb.add(QUAD)}, "mode": 6},
        {"attributes": {"POSITION": glb.add(TRIANGLE)}, "mode": 0},
        name="fan",
    )
    for raw, kind in ((deep_png(), "png"), (small_png(), "png"), (jpeg(), "jpeg")):
        view = glb.embed(raw)
        glb.root.setdefault("images", []).append(
            {"bufferView": view, "mimeType": f"image/{kind}", "name": kind}
        )
    return glb


def _gltf(glb: Glb, uri: str, images: list[str]) -> bytes:
    """The same as JSON, its buffer and its images at the URIs given."""
    root = glb.root | {"buffers": [{"byteLength": len(glb.data), "uri": uri}]}
    root["images"] = [{"uri": image} for image in images]
    return json.dumps(root, indent=1).encode()


def _data_uri(raw: bytes, kind: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(raw).decode()}"


OBJ = """# all kinds of corners, two objects, groups, negative indices
mtllib m.mtl
v 0 0 0 1 0 0
v 1 0 0 0 1 0
v 1 1 0 0 0 1
v 0 1 0.25 1 1 1
v 2 0 1e-3
vt 0 0
vt 1 0 0
vt 1.5 -1
vn 0 0 1
vn 0.6 0 0.8
o first one
g a b
s 1
usemtl leaf
f 1/1/1 2/2/1 3/3/2
f 1/1 3/3 4/1
usemtl plain
f 1//1 2//2 3//1 4//1
o second
usemtl nowhere
f -1 -2 -3 \\
-4
l 1 2
p 3
"""

MTL = """newmtl leaf
Kd 0.5 0.25 1
Ke 0 0.1 0.2
Ks 1 1 1
Pm 0.5
Pr 0.25
d 0.75
map_Kd -s 2 3 1 -o 0.5 0.25 -clamp on leaf.png
map_Ke glow.jpg
map_Pm leaf.png
map_Pr -imfchan g leaf.png
map_d -imfchan m leaf.png
map_Bump -bm 2 bump.png
newmtl plain
Kd 0.25
Tr 0.5
"""

OFF = """STCNOFF
4 2 5
# x y z  nx ny nz  r g b a  u v
0 0 0  0 0 1  1 0 0 1  0 0
1 0 0  0 0 1  0 1 0 1  1 0
1 1 0  0 0.6 0.8  0 0 1 1  1 1
0 1 0.25  0 0 1  1 1 1 1  0 1
3 0 1 2
4 0 1 2 3
"""

OFF_FACES = """OFF 4 2 0
0 0 0
1 0 0
1 1 0
0 1 0.25
3 0 1 2 255 128 0
3 0 2 3 10 20 30
"""

STL = """solid first one
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 1e-1
endloop
endfacet
endsolid first one
solid
facet normal 0 0 1
outer loop
vertex 0 0 1
vertex 1 0 1
vertex 0 1 1
endloop
endfacet
endsolid
"""

MODEL = """<?xml version="1.0" encoding="UTF-8"?>
<model unit="inch" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources>
<basematerials id="9"><base name="a" displaycolor="#FF0000"/></basematerials>
<object id="1" type="model" name="one" pid="9"><mesh><vertices>
<vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/>
<vertex x="0" y="0" z="1.5e0"/>
</vertices><triangles>
<triangle v1="0" v2="2" v3="1"/><triangle v1="0" v2="1" v3="3"/><triangle v1="0" v2="3" v3="2"/>
</triangles></mesh></object>
<object id="2"><components>
<component objectid="1" transform="1 0 0 0 1 0 0 0 1 5 6 7"/><component objectid="1"/>
</components></object>
<object id="3" type="support"><mesh><vertices/><triangles/></mesh></object>
</resources>
<build><item objectid="2" transform="2 0 0 0 2 0 0 0 2 0 0 0"/><item objectid="3"/></build>
</model>
"""


def zipped(parts: dict[str, bytes]) -> bytes:
    """A zip archive, deflated, with one date, so that its bytes do not change."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in parts.items():
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return out.getvalue()


def plys() -> dict[str, bytes]:
    """One mesh as ASCII with text between, and as binary of both orders."""
    position, normal = ("float x", "float y", "double z"), ("float nx", "float ny", "float nz")
    color = ("uchar red", "uchar green", "uchar blue", "uchar alpha")
    vertex = (*position, *normal, *color, "float s", "float t")
    face = ("list uchar int vertex_indices", "list uchar float texcoord", "short flags")
    elements = [
        ("vertex", 4, vertex),
        ("face", 2, face),
        ("edge", 1, ("int vertex1", "int vertex2")),
    ]
    kinds = {"u": "<u1", "i": "<i4", "f": "<f4", "d": "<f8", "s": "<i2"}
    rows: list[list[tuple[str, float]]] = []
    for p, uv in zip(QUAD.tolist(), UV.tolist()):
        numbers = [*p, 0, 0, 1, 255, 128, 0, 255, *uv]
        rows.append(list(zip("ffdfffuuuuff", numbers)))
    for corners in ((0, 1, 2), (0, 2, 3, 1)):
        wedge = [("f", 0.25 * i) for i in range(2 * len(corners))]
        row = [("u", len(corners)), *(("i", c) for c in corners), ("u", len(wedge)), *wedge]
        rows.append([*row, ("s", -7)])
    rows.append([("i", 0), ("i", 1)])
    text = "\n".join(" ".join(f"{v:g}" for _, v in row) for row in rows).encode() + b"\n"
    comment = "comment TextureFile leaf.png"
    out = {"ascii": ply_header("ascii", elements, comment) + text}
    for name, order in (("little", "<"), ("big", ">")):
        raw = b"".join(
            np.array(v).astype(order + kinds[k][1:]).tobytes() for row in rows for k, v in row
        )
        out[name] = ply_header(f"binary_{name}_endian", elements, comment) + raw
    flat = [("vertex", 3, ("float x", "float y", "float z")), ("face", 1, face[:1])]
    table = TRIANGLE.tobytes() + b"\3" + np.array([0, 1, 2], "<i4").tobytes()
    out["table"] = ply_header("binary_little_endian", flat) + table
    return out


def assets() -> dict[str, Asset]:
    """Every asset by its name."""
    glb = rich_glb()
    web = Glb(nodes=[{"mesh": 0}], textures=[{"extensions": {"EXT_texture_webp": {"source": 0}}}])
    web.root["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    web.mesh(web.triangle(material=0))
    web.root["images"] = [{"bufferView": web.embed(webp()), "mimeType": "image/webp"}]
    png, photo = small_png(), jpeg()
    inside = [_data_uri(deep_png(), "image/png"), "t.png", _data_uri(photo, "image/jpeg")]
    beside = {"m.bin": glb.data, "t.png": png, "my photo.jpg": photo}
    ply = plys()
    return {
        "glb": {"m.glb": glb.bytes()},
        "webp": {"m.glb": web.bytes()},
        "gltf beside": {
            "m.gltf": _gltf(glb, "m.bin", ["t.png", "t.png", "my%20photo.jpg"]),
            **beside,
        },
        "gltf data": {
            "m.gltf": _gltf(glb, _data_uri(glb.data, "application/octet-stream"), inside),
            "t.png": deep_png(),
        },
        "obj": {
            "m.obj": OBJ.encode(),
            "m.mtl": MTL.encode(),
            "leaf.png": png_bytes(Image("leaf", codes(3, 2))),
            "glow.jpg": photo,
        },
        "ply ascii": {"m.ply": ply["ascii"], "leaf.png": png},
        "ply little": {"m.ply": ply["little"], "leaf.png": png},
        "ply big": {"m.ply": ply["big"]},
        "ply table": {"m.ply": ply["table"]},
        "stl ascii": {"m.stl": STL.encode()},
        "stl binary": {"m.stl": binary_stl([TRIANGLE, TRIANGLE + 1.0])},
        "off": {"m.off": OFF.encode()},
        "off faces": {"m.off": OFF_FACES.encode()},
        "3mf": {
            "m.3mf": zipped(
                {"[Content_Types].xml": b"<Types/>", "3D/3dmodel.model": MODEL.encode()}
            )
        },
    }

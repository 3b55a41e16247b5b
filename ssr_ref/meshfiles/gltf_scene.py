"""A `Scene` of a GLB or glTF 2.0 file, with a report of what is not drawn as the file says."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from ..errors import SceneError
from ..scene import LoadReport, Mesh, Node, Scene
from .building import MAX_NOTES, file_error, first_notes
from .census import count_triangles
from .gltf_accessors import DRACO, MESHOPT, QUANTIZATION, Accessors
from .gltf_json import Gltf, read_gltf
from .gltf_materials import DRAWN, Materials
from .gltf_nodes import Walk, scene_index, scene_names, walk_scene
from .gltf_primitives import Primitives
from .gltf_textures import Textures
from .options import LoadOptions, check_strict

_HONOURED = (*DRAWN, QUANTIZATION, "KHR_texture_transform")

# Not honoured, yet without them a diffuse picture stays the same, or a texture's own fallback and
# note say what is missing.
_HARMLESS = (
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_dispersion",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_specular",
    "KHR_lights_punctual",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "KHR_texture_basisu",
    "MSFT_texture_dds",
    "EXT_texture_webp",
    "EXT_texture_avif",
)

# Named where they are met, so that only what the scene uses is counted.
_COUNTED = (
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_",
    "KHR_xmp",
    "EXT_mesh_gpu_instancing",
    DRACO,
    *MESHOPT,
)


def load_gltf(path: Path, data: bytes, options: LoadOptions) -> Scene:
    """The scene of a .glb or .gltf file's bytes; `path` places the files that it refers to.

    Positions, normals, texture coordinates and colours are float32 in mesh space, floats bit for
    bit; a primitive without normals has none (flat shading, section 3.7.2.1). Of `options`, this
    reads `scene`, `strict` and `allow_outside`; normals, up and unit are the caller's to apply.
    What is not drawn as the file says is counted in `Scene.notes` and `Scene.report`.

    Raises FileError (one line) for a damaged file, compressed geometry, an extension that is
    required and would change the picture, or a scene without triangles.
    """
    try:
        return _load(read_gltf(path, data, options))
    except SceneError as error:
        raise file_error(path, str(error)) from None


def _load(gltf: Gltf) -> Scene:
    _check_required(gltf)
    accessors = Accessors(gltf)
    textures = Textures(gltf, accessors)
    materials = Materials(gltf, textures)
    primitives = Primitives(gltf, accessors)
    walk = walk_scene(gltf)
    nodes: list[Node] = []
    meshes: list[Mesh] = []
    place: dict[int, int | None] = {}  # mesh in the file → mesh in the scene, or nothing to draw
    for found in walk.nodes:
        if found.mesh not in place:
            mesh = _mesh(gltf, found.mesh, materials, primitives)
            place[found.mesh] = None if mesh is None else len(meshes)
            meshes += [] if mesh is None else [mesh]
        index = place[found.mesh]
        if index is not None:
            nodes.append(Node(found.name, index, found.world_from_mesh))
    skipped = primitives.counts["points and lines"]
    if not any(len(p.faces) for mesh in meshes for p in mesh.primitives):
        raise gltf.error(
            f"has no triangles ({len(nodes)} meshes in its scene, {skipped} primitives of points "
            "or lines); expected at least one: point clouds and curves cannot be drawn"
        )
    report = _report(gltf, walk, meshes, materials, primitives, textures)
    check_strict(gltf.path, report, gltf.options)
    return Scene(
        tuple(meshes),
        tuple(nodes),
        materials.all,
        name=gltf.path.stem,
        notes=tuple(_notes(gltf, walk, materials, primitives, textures)),
        images=tuple(textures.images),
        report=report,
    )


def _mesh(gltf: Gltf, index: int, materials: Materials, primitives: Primitives) -> Mesh | None:
    """A mesh with its triangles, None if it holds points and lines only."""
    entry = gltf.item("meshes", index)
    where = f"meshes[{index}]"
    entries = gltf.listed(entry, "primitives", where)
    if not all(isinstance(e, dict) for e in entries):
        raise gltf.error(
            f"{where}.primitives is not a list of objects; expected glTF: export again"
        )
    found = []
    for number, primitive in enumerate(entries):
        at = f"{where}.primitives[{number}]"
        if not primitives.is_drawn(primitive, at):
            primitives.counts["points and lines"] += 1
            continue
        material = materials.use(primitive.get("material"))
        found.append(primitives.read(primitive, at, material, materials.look(material)))
    if entries and not found:
        return None
    return Mesh(str(entry.get("name") or f"mesh {index}"), tuple(found))


def _check_required(gltf: Gltf) -> None:
    """Refuse a file that requires what would be missing from the picture."""
    for name in gltf.names("extensionsRequired"):
        if name in _HONOURED or name in _HARMLESS:
            continue
        compression = "Draco" if name == DRACO else "meshopt" if name in MESHOPT else ""
        if compression:
            raise gltf.error(
                f"is compressed with {name}; expected plain geometry: export without {compression} "
                "compression"
            )
        raise gltf.error(
            f"requires the extension {name[:80]}, which is not drawn; expected glTF 2.0 without "
            "it: export without this extension"
        )


# ----------------------------------------------------------------------- report


def _features(gltf: Gltf, walk: Walk, materials: Materials, primitives: Primitives) -> Counter[str]:
    """What the drawn scene asks for and is not drawn, counted; extensions of no known place: 1."""
    found = Counter(materials.features)
    found["alphaMode BLEND"] = materials.blended
    found["skins"] = sum(node.skinned for node in walk.nodes)
    found["morph targets"] = primitives.counts["morph targets"]
    found["EXT_mesh_gpu_instancing"] = sum(node.instanced for node in walk.nodes)
    found["cameras"] = walk.cameras
    found["KHR_lights_punctual"] = walk.lights
    found["animations"] = len(gltf.items("animations"))
    for name in gltf.names("extensionsUsed"):
        if name not in _HONOURED and not name.startswith(_COUNTED):
            found[name] = 1
    return +found  # only what is there


def _report(
    gltf: Gltf,
    walk: Walk,
    meshes: list[Mesh],
    materials: Materials,
    primitives: Primitives,
    textures: Textures,
) -> LoadReport:
    triangles, degenerate, non_finite = count_triangles(meshes)
    skipped = primitives.counts["points and lines"]
    replaced = [n for key in _REPLACED for n in _note(primitives.counts[key], *_ODD[key])]
    otherwise = _note(len(textures.nearest), *_NEAREST)
    return LoadReport(
        format="glTF" if gltf.binary is None else "GLB",
        triangles=triangles,
        degenerate=degenerate,
        non_finite=non_finite,
        skipped=tuple(_note(skipped, "primitive", "primitives", "of points or lines")),
        fallbacks=(*dict.fromkeys(materials.fallbacks), *replaced),
        unsupported=(*sorted(_features(gltf, walk, materials, primitives)), *otherwise),
        textures=tuple((image.name, *image.size) for image in textures.images),
    )


_SPOKEN = {
    "alphaMode BLEND": ("material with alpha is", "materials with alpha are", "drawn opaque"),
    "skins": ("skinned mesh is", "skinned meshes are", "drawn in bind pose"),
    "morph targets": (
        "primitive with morph targets is",
        "primitives with morph targets are",
        "drawn in base shape",
    ),
    "EXT_mesh_gpu_instancing": (
        "node with EXT_mesh_gpu_instancing is",
        "nodes with EXT_mesh_gpu_instancing are",
        "drawn once",
    ),
    "cameras": ("camera is", "cameras are", "not used"),
    "KHR_lights_punctual": ("light is", "lights are", "not used"),
    "animations": ("animation is", "animations are", "not played"),
}
_ODD = {
    "points and lines": ("primitive is", "primitives are", "of points or lines: not drawn"),
    "nan colors": ("vertex colour is", "vertex colours are", "NaN or infinite: white is used"),
    "bright colors": ("vertex colour is", "vertex colours are", "above 1: used as linear RGB"),
    "nan uvs": (
        "texture coordinate is",
        "texture coordinates are",
        "NaN or infinite: 0 is used",
    ),
    "without uv": (
        "primitive has",
        "primitives have",
        "no coordinates for a texture: read at (0, 0)",
    ),
}
_REPLACED = ("nan colors", "nan uvs")
_NEAREST = ("texture asks", "textures ask", "for NEAREST filters: drawn bilinear")


def _notes(
    gltf: Gltf, walk: Walk, materials: Materials, primitives: Primitives, textures: Textures
) -> Iterator[str]:
    scenes = scene_names(gltf)
    if len(scenes) > 1:
        yield f"{len(scenes)} scenes: '{scenes[scene_index(gltf) or 0]}' is drawn"
    yield from first_notes(materials.notes, "replaced")
    for name, what in _ODD.items():
        yield from _note(primitives.counts[name], *what)
    yield from _note(len(textures.nearest), *_NEAREST)
    others = 0
    for name, count in sorted(_features(gltf, walk, materials, primitives).items()):
        if name in _SPOKEN:
            yield from _note(count, *_SPOKEN[name])
        else:
            others += 1
            if others <= MAX_NOTES:
                yield f"{name} is not drawn"
    yield from _note(max(0, others - MAX_NOTES), "feature is", "features are", "not drawn either")


def _note(count: int, one: str, many: str, what: str) -> Iterator[str]:
    """One note, such as "3 lights are not used", or none where the count is 0."""
    if count:
        yield f"{count} {one if count == 1 else many} {what}"

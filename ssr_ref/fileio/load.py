"""`load`: a scene by the name of a built-in one or by a mesh file's path."""

from __future__ import annotations

from pathlib import Path

from ..errors import FileError, SettingsError
from ..scene import Scene
from .meshes import FORMATS, NormalsName, load_mesh, with_normals


def load(
    source: str | Path,
    *,
    normals: NormalsName = "authored",
    mirror_floor: bool = False,
    tessellation: int | None = None,
) -> Scene:
    """A built-in scene by its name, or a mesh file by its path.

    source : a name that `ssr-ref scenes` lists, or a .glb, .gltf, .obj, .ply or .stl file. A `Path`
        is always a file, a name without one of these extensions never is.
    normals : "authored", "flat" or "smooth", see `load_mesh`.
    mirror_floor : add a mirroring floor under the scene.
    tessellation : fineness of a built-in scene's curved surfaces; None: its own default.

    A mesh file's scene has no view: rendering frames it. Raises FileError (one line) for an unknown
    name or a file that cannot be used, SettingsError for a setting that cannot.
    """
    from .. import scenes

    if isinstance(source, str) and source in scenes.BUILTIN:
        scene = with_normals(scenes.build(source, tessellation), normals)
    elif Path(source).suffix.lower() in FORMATS or isinstance(source, Path):
        if tessellation is not None:
            raise SettingsError(
                f"tessellation is {tessellation} for the file {source}; expected none: only "
                "built-in scenes can be tessellated anew"
            )
        scene = load_mesh(source, normals=normals)
    else:
        raise FileError(
            f"unknown scene {source!r}; expected a built-in scene ({', '.join(scenes.BUILTIN)}) or "
            f"a mesh file ({', '.join(FORMATS)}): check the spelling"
        )
    return scenes.with_mirror_floor(scene) if mirror_floor else scene

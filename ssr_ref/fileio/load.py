"""`load`: a scene by the name of a built-in one or by a mesh file's path."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..errors import FileError, SettingsError
from ..meshfiles.meshes import FORMATS, load_mesh, with_normals
from ..meshfiles.options import LoadOptions, NormalsName, UpName
from ..scene import Scene


def load(
    source: str | Path,
    *,
    normals: NormalsName = "authored",
    up: UpName = "y",
    unit: str | None = None,
    strict: bool = False,
    allow_outside: bool = False,
    scene: int | str | None = None,
    mirror_floor: bool = False,
    tessellation: int | None = None,
) -> Scene:
    """A built-in scene by its name, or a mesh file by its path.

    source : a name that `ssr-ref scenes` lists, or a .glb, .gltf, .obj, .ply, .stl, .off or .3mf
        file. A `Path` is always a file, a name without one of these extensions never is.
    normals, up, unit, strict, allow_outside, scene : see `options.LoadOptions`; of a built-in
        scene only the normals can be chosen.
    mirror_floor : add a mirroring floor under the scene.
    tessellation : fineness of a built-in scene's curved surfaces; None: its own default.

    A mesh file's scene has no view: rendering frames it. Raises FileError (one line) for an unknown
    name or a file that cannot be used, SettingsError for a setting that cannot.
    """
    from .. import scenes

    options = LoadOptions(
        normals=normals,
        up=up,
        unit=unit,
        strict=strict,
        allow_outside=allow_outside,
        scene=scene,
    )
    if isinstance(source, str) and source in scenes.BUILTIN:
        if replace(options, normals="authored") != LoadOptions():
            raise SettingsError(
                f"up, unit, strict, allow_outside or scene is given for the built-in scene {source}"
                "; expected none: they are for mesh files"
            )
        loaded = with_normals(scenes.build(source, tessellation), normals)
    elif Path(source).suffix.lower() in FORMATS or isinstance(source, Path):
        if tessellation is not None:
            raise SettingsError(
                f"tessellation is {tessellation} for the file {source}; expected none: only "
                "built-in scenes can be tessellated anew"
            )
        loaded = load_mesh(source, options)
    else:
        raise FileError(
            f"unknown scene {source!r}; expected a built-in scene ({', '.join(scenes.BUILTIN)}) or "
            f"a mesh file ({', '.join(FORMATS)}): check the spelling"
        )
    return scenes.with_mirror_floor(loaded) if mirror_floor else loaded

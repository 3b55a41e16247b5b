"""`load`: a scene by the name of a built-in one or by a mesh file's path.

`load_closed_form` does it for scenes of shapes, which are of another class.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import FileError, SettingsError, SsrRefError
from ..meshfiles.meshes import FORMATS, load_mesh, with_normals
from ..meshfiles.options import LoadOptions, NormalsName, UpName
from ..scene import Scene

if TYPE_CHECKING:
    from ..analytic.scene import AnalyticScene

CLOSED_FORM = "analytic/"
"""What the name of a closed-form scene begins with where scenes of both kinds are named."""


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


def load_closed_form(source: str) -> AnalyticScene | None:
    """A scene of shapes by "analytic/NAME" or by the path of a scene.json; None for anything else.

    Raises FileError for an unknown name or a file that cannot be used.
    """
    if source.startswith(CLOSED_FORM):
        from ..analytic.scenes import SCENES

        name = source.removeprefix(CLOSED_FORM)
        if name not in SCENES:
            raise FileError(
                f"unknown scene {source!r}; expected {CLOSED_FORM} and one of {', '.join(SCENES)}"
            )
        return SCENES[name]()
    if Path(source).suffix.lower() != ".json":
        return None
    from ..analytic.scene_json import scene_from_json

    try:
        return scene_from_json(json.loads(Path(source).read_bytes()))
    except OSError as error:
        raise FileError(
            f"{source} cannot be read ({error.strerror}); expected a closed-form scene"
        ) from None
    except (ValueError, RecursionError) as error:
        raise FileError(f"{source} is not JSON ({error}); expected a closed-form scene") from None
    except SsrRefError as error:
        raise FileError(f"{source}: {error}") from None

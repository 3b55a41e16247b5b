"""Golden bundles: one folder with everything that explains an image, and hashes of all of it.

`docs/bundle.md` is the contract; this file writes and reads it, `manifest.py` says what is in
`manifest.json`, `folder.py` makes the folder appear whole or not at all.
"""

from __future__ import annotations

import json
import os
import platform
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..camera import Camera
from ..errors import BundleError, FileError, SsrRefError
from ..scene import Lights, Scene
from ..settings import Settings
from ..typed import AnyArray
from . import folder as folders
from . import manifest as contents
from .exr import write_exr
from .folder import MANIFEST_FILE, FolderKind, disk_errors, whole_folder
from .npz import content_sha256, file_sha256, read_npz, write_npz

if TYPE_CHECKING:
    from ..analytic.scene import AnalyticScene
    from ..pipeline import Frame, Progress

SCENE_FILE, SHAPES_FILE, PREVIEWS = "scene.glb", "scene.json", "previews"
CAMERA_FILE, LIGHTS_FILE, SETTINGS_FILE = "camera.json", "lights.json", "settings.json"
METHODS_FILE = "methods.json"
NPZ_FILE, EXR_FILE = "golden.npz", "golden.exr"
RUN_FILE = "run.json"
_KIND = FolderKind("golden bundle", "bundle", contents.FORMAT, (MANIFEST_FILE, RUN_FILE))


def write_bundle(
    frame: Frame,
    path: str | Path,
    *,
    force: bool = False,
    previews: bool = True,
    progress: Progress | None = None,
) -> Path:
    """Write a golden bundle, a new folder at `path`; returns the path.

    force : replace what is there, if it is a golden bundle or an empty folder.
    previews : draw PNG pictures too.
    progress : called with ("write", share done).

    Raises FileError if the path is taken or the disk refuses. Then, and on any other exception,
    nothing new is left and what was there is untouched.
    """
    target = Path(path)
    check_target(target, force=force)
    started = time.perf_counter()
    with whole_folder(target) as folder:
        _write_files(frame, folder, previews=previews, progress=progress)
        _write(RUN_FILE, _write_json, folder, _run(frame, time.perf_counter() - started))
    return target


def check_target(path: str | Path, *, force: bool = False) -> None:
    """Raise FileError unless a bundle can be written to `path`: before a render, not after it."""
    folders.check_target(path, _KIND, force=force)


def _write_files(frame: Frame, folder: Path, *, previews: bool, progress: Progress | None) -> None:
    """Everything but run.json; the manifest last, since it has the hashes of the others."""
    arrays = contents.stored_arrays(frame)
    stages: list[tuple[str, Callable[[Path, Any], object], Any]] = [
        (CAMERA_FILE, _write_json, frame.camera.to_json()),
        (LIGHTS_FILE, _write_json, frame.scene.lights.to_json()),
        (SETTINGS_FILE, _write_json, frame.settings.to_json()),
        *_methods_stage(frame),
        _scene_stage(frame.scene),
        (NPZ_FILE, write_npz, arrays),
        (EXR_FILE, _write_exr, arrays),
    ]
    if previews:
        stages.append((PREVIEWS, _write_previews, frame))
    for done, (name, write, data) in enumerate(stages):
        if progress is not None:
            progress("write", done / (len(stages) + 1))
        _write(name, write, folder, data)
    with disk_errors(MANIFEST_FILE):
        hashes = {
            file.relative_to(folder).as_posix(): file_sha256(file)
            for file in sorted(folder.rglob("*"))
            if file.is_file()
        }
        (folder / MANIFEST_FILE).write_bytes(contents.encode(contents.build(frame, arrays, hashes)))
    if progress is not None:
        progress("write", 1.0)


def _write(name: str, write: Callable[[Path, Any], object], folder: Path, data: Any) -> None:
    with disk_errors(name):
        write(folder / name, data)


def _write_json(path: Path, data: Any) -> None:
    path.write_bytes(contents.json_bytes(data))


def _write_exr(path: Path, arrays: dict[str, Any]) -> None:
    write_exr(path, contents.exr_channels(arrays))  # the planes live no longer than this


def _methods_stage(frame: Frame) -> list[tuple[str, Callable[[Path, Any], object], Any]]:
    """Settings of further methods, if there are any."""
    if not frame.more:
        return []
    named = {name: traced.settings.to_json() for name, traced in frame.more.items()}
    return [(METHODS_FILE, _write_json, named)]


def _scene_stage(
    scene: Scene | AnalyticScene,
) -> tuple[str, Callable[[Path, Any], object], Any]:
    """Meshes go into scene.glb, closed-form shapes into scene.json."""
    if isinstance(scene, Scene):
        return SCENE_FILE, _write_scene, scene
    from ..analytic.scene_json import scene_to_json

    return SHAPES_FILE, _write_json, scene_to_json(scene)


def _write_scene(path: Path, scene: Scene) -> None:
    from .scene_glb import write_scene_glb

    write_scene_glb(scene, path)


def _write_previews(folder: Path, frame: Frame) -> None:
    from ..report.previews import write_previews

    try:
        folder.mkdir()
        write_previews(frame, folder)
        for name in frame.more:
            write_previews(frame.of(name), folder / name, shared=False)
    except FileError as error:
        if isinstance(error.__cause__, OSError):  # a full disk is told in the same words everywhere
            raise error.__cause__ from None
        raise


def _run(frame: Frame, seconds: float) -> dict[str, Any]:
    """Facts of this run that the golden does not depend on: timings and versions."""
    numba = sys.modules.get("numba")
    versions = {"python": platform.python_version()}
    for package in ("numpy", "numba", "OpenEXR", "pillow"):
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = "unknown"
    return {
        "seconds": {**{k: float(v) for k, v in frame.timings.items()}, "write": seconds},
        "threads": int(numba.get_num_threads()) if numba is not None else 1,
        "processors": os.cpu_count(),
        "machine": platform.machine(),
        "system": platform.system(),
        "versions": versions,
    }


@dataclass(frozen=True, eq=False)
class Bundle:
    """A verified bundle.

    manifest : the contents of manifest.json. arrays : name to array, as golden.npz holds them
    (docs/bundle.md has shapes and units). settings : resolved, no length is None. more : settings
    of further methods, whose arrays are named "METHOD.array".
    """

    path: Path
    manifest: dict[str, Any]
    arrays: dict[str, AnyArray]
    camera: Camera
    lights: Lights
    settings: Settings
    more: dict[str, Settings]

    @cached_property
    def scene(self) -> Scene | AnalyticScene:
        """The scene that was rendered, read from scene.glb (closed-form shapes: scene.json) and
        lit by lights.json on first use.

        Raises BundleError if it is not the scene whose hash the manifest has.
        """
        scene_file = _scene_file(self.manifest["files"])
        scene: Scene | AnalyticScene
        if scene_file == SHAPES_FILE:
            from ..analytic.scene_json import scene_from_json

            scene = replace(scene_from_json(_read_json(self.path / scene_file)), lights=self.lights)
        else:
            from .load import load

            name = str(self.manifest["scene"]["name"])
            scene = replace(load(self.path / scene_file), lights=self.lights, name=name)
        if scene.content_sha256() != self.manifest["scene"]["content_sha256"]:
            raise BundleError(
                f"{self.path}: {scene_file} and {LIGHTS_FILE} are not the scene of the manifest; "
                "write the bundle anew"
            )
        return scene


def load_bundle(path: str | Path) -> Bundle:
    """Read a bundle and verify every file's and every array's hash.

    Raises BundleError that names the first file or array that is missing or does not agree.
    """
    folder = Path(path)
    if not folder.is_dir():
        what = "is a file" if folder.exists() else "does not exist"
        raise BundleError(f"{folder} {what}; expected the folder of a golden bundle")
    try:
        manifest = _read_manifest(folder)
        _verify_files(folder, manifest)
        arrays = _verified_arrays(folder, manifest)
        return Bundle(
            path=folder,
            manifest=manifest,
            arrays=arrays,
            camera=Camera.from_json(_read_json(folder / CAMERA_FILE)),
            lights=Lights.from_json(_read_json(folder / LIGHTS_FILE)),
            settings=Settings.from_json(_read_json(folder / SETTINGS_FILE)),
            more=_further_settings(folder, manifest),
        )
    except BundleError:
        raise
    except SsrRefError as error:
        raise BundleError(f"{folder}: {error}") from None
    except OSError as error:
        raise BundleError(f"{folder}: cannot be read ({error}); expected a golden bundle") from None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise BundleError(
            f"{folder}: {MANIFEST_FILE} lacks what a reader needs ({error!r}); write the bundle "
            "anew"
        ) from None


def _further_settings(folder: Path, manifest: Mapping[str, Any]) -> dict[str, Settings]:
    if METHODS_FILE not in manifest["files"]:
        return {}
    named = _read_json(folder / METHODS_FILE)
    return {name: Settings.from_json(named[name]) for name in sorted(named)}


def read_identity(path: str | Path) -> str:
    """The content_sha256 that a bundle's manifest names; nothing is verified."""
    return str(_read_manifest(Path(path))["content_sha256"])


def _read_json(path: Path) -> Any:
    return json.loads(path.read_bytes())


def _read_manifest(folder: Path) -> dict[str, Any]:
    """manifest.json, if it is ours, of a version that can be read, and as it was written."""
    path = folder / MANIFEST_FILE
    if not path.is_file():
        raise BundleError(f"{folder} has no {MANIFEST_FILE}; expected a golden bundle")
    encoded = path.read_bytes()
    try:
        data = json.loads(encoded)
    except (ValueError, RecursionError) as error:
        raise BundleError(
            f"{folder}: {MANIFEST_FILE} is not JSON ({error}); it was edited or cut short"
        ) from None
    if not isinstance(data, dict) or data.get("format") != contents.FORMAT:
        raise BundleError(f"{folder}: {MANIFEST_FILE} is not that of a golden bundle")
    if data.get("schema_version") != contents.SCHEMA_VERSION:
        raise BundleError(
            f"{folder} has schema version {data.get('schema_version')}; this ssr_ref reads "
            f"{contents.SCHEMA_VERSION}: use the version that wrote it, or write the bundle anew"
        )
    if not contents.is_as_written(encoded, data):
        raise BundleError(f"{folder}: {MANIFEST_FILE} does not match its own hash; it was edited")
    return data


def _scene_file(named: Mapping[str, str]) -> str:
    """Which of the two scene files a bundle has."""
    return SHAPES_FILE if SHAPES_FILE in named else SCENE_FILE


def _verify_files(folder: Path, manifest: Mapping[str, Any]) -> None:
    named = manifest["files"]
    needed = {NPZ_FILE, EXR_FILE, _scene_file(named), CAMERA_FILE, LIGHTS_FILE, SETTINGS_FILE}
    for name in sorted(needed - set(named)):
        raise BundleError(f"{folder}: {MANIFEST_FILE} does not name {name}; write the bundle anew")
    for name in sorted(named):
        parts = Path(name).parts
        if Path(name).is_absolute() or ".." in parts:
            raise BundleError(f"{folder}: {MANIFEST_FILE} names {name}, outside the bundle")
        if not (folder / name).is_file():
            raise BundleError(f"{folder}: {name} is missing; copy the whole bundle")
        if file_sha256(folder / name) != named[name]:
            raise BundleError(
                f"{folder}: {name} does not match its hash in {MANIFEST_FILE}; it was edited or "
                "cut short"
            )


def _verified_arrays(folder: Path, manifest: Mapping[str, Any]) -> dict[str, AnyArray]:
    arrays = read_npz(folder / NPZ_FILE)
    described = manifest["arrays"]
    for name in sorted(set(arrays) ^ set(described)):
        where = MANIFEST_FILE if name in arrays else NPZ_FILE
        raise BundleError(f"{folder}: array {name} is missing in {where}; write the bundle anew")
    for name, array in arrays.items():
        if content_sha256(array) != described[name]["content_sha256"]:
            raise BundleError(f"{folder}: array {name} in {NPZ_FILE} does not match its hash")
    if contents.identity(manifest) != manifest["content_sha256"]:
        raise BundleError(f"{folder}: content_sha256 in {MANIFEST_FILE} does not match the arrays")
    return arrays


def finite_range(array: AnyArray) -> tuple[float | int | None, float | int | None, int]:
    """Least and greatest finite value (None if there is none) and the number of others."""
    if array.dtype.kind != "f":
        return int(array.min()), int(array.max()), 0
    finite = array[np.isfinite(array)]
    others = int(array.size - finite.size)
    if finite.size == 0:
        return None, None, others
    return float(finite.min()), float(finite.max()), others

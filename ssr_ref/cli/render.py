"""`ssr-ref render`: a scene becomes a golden bundle."""

from __future__ import annotations

import json
import re
import time
import warnings
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, cast

import typer

from ..errors import CameraError, FileError, SceneError, SettingsError, SsrRefError, SsrRefWarning
from .load_report import load_rows
from .output import Output, length, percent

if TYPE_CHECKING:
    from ..camera import Camera, View
    from ..meshfiles.options import NormalsName, UpName
    from ..pipeline import Frame
    from ..scene import Scene
    from ..settings import Settings

T = TypeVar("T")

_SCENE, _CAMERA, _TRACE, _RESOLVE = "Scene", "Camera", "Tracing", "Fades, colours and buffers"


def _option(panel: str, text: str, metavar: str | None = None, *names: str) -> Any:
    return typer.Option(*names, help=text, metavar=metavar, rich_help_panel=panel)


def render(
    ctx: typer.Context,
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE", help="A mesh file, or the name of a built-in scene (`scenes`)."
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder that is created.")
    ],
    size: Annotated[
        str | None, typer.Option(metavar="WxH", help="Pixels, such as 1920x1080. [960x540]")
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace a golden bundle that is there.")
    ] = False,
    settings: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.json", help="Settings, as in a bundle; options given here win over it."
        ),
    ] = None,
    previews: Annotated[bool, typer.Option(help="Draw PNG pictures too.")] = True,
    mirror_floor: Annotated[
        bool, _option(_SCENE, "Add a mirror under the scene.", None, "--mirror-floor")
    ] = False,
    normals: Annotated[
        str, _option(_SCENE, "Where shading normals come from.", "authored|flat|smooth|crease")
    ] = "authored",
    up: Annotated[str, _option(_SCENE, "Upward axis of a mesh file.", "y|z")] = "y",
    unit: Annotated[
        str | None, _option(_SCENE, "What one unit of a mesh file is.", "mm|cm|m|inch|foot")
    ] = None,
    gltf_scene: Annotated[
        str | None, _option(_SCENE, "Scene of a glTF file, by index or name.", "NAME", "--scene")
    ] = None,
    strict: Annotated[
        bool, _option(_SCENE, "Refuse a file that is not drawn as it stands.", None, "--strict")
    ] = False,
    allow_outside: Annotated[
        bool,
        _option(
            _SCENE, "Let a mesh file refer to files outside its folder.", None, "--allow-outside"
        ),
    ] = False,
    tessellation: Annotated[
        int | None, _option(_SCENE, "Fineness of a built-in scene.", "N")
    ] = None,
    lights: Annotated[
        Path | None, _option(_SCENE, "Lights, as a bundle's lights.json.", "FILE.json")
    ] = None,
    camera: Annotated[
        Path | None,
        _option(
            _CAMERA, "Matrices, as a bundle's camera.json, or a view: eye, target.", "FILE.json"
        ),
    ] = None,
    fov: Annotated[
        float | None, _option(_CAMERA, "Vertical field of view in degrees.", "DEG")
    ] = None,
    orthographic: Annotated[
        float | None, _option(_CAMERA, "Parallel projection of this height.", "HEIGHT")
    ] = None,
    near: Annotated[float | None, _option(_CAMERA, "Near view depth.", "X")] = None,
    far: Annotated[float | None, _option(_CAMERA, "Far view depth, may be inf.", "X")] = None,
    tracer: Annotated[str | None, _option(_TRACE, "Method.", "dda|cells|march")] = None,
    surface: Annotated[
        str | None, _option(_TRACE, "What a pixel's surface is.", "constant|plane")
    ] = None,
    stride: Annotated[int | None, _option(_TRACE, "Pixels between DDA samples.", "N")] = None,
    step: Annotated[
        float | None, _option(_TRACE, "Of the 3-D march; default radius/128.", "X")
    ] = None,
    growth: Annotated[
        str | None, _option(_TRACE, "Of the march's increments.", "linear|constant")
    ] = None,
    jitter: Annotated[
        bool | None, _option(_TRACE, "Start each ray at its own share of a stride.")
    ] = None,
    seed: Annotated[int | None, _option(_TRACE, "Of the jitter.", "N")] = None,
    max_steps: Annotated[
        int | None, _option(_TRACE, "Samples of a ray at most; default no limit.", "N")
    ] = None,
    max_distance: Annotated[
        float | None, _option(_TRACE, "Length of a ray at most, may be inf.", "X")
    ] = None,
    bias: Annotated[float | None, _option(_TRACE, "Added to the front of a surface.", "X")] = None,
    thickness: Annotated[
        float | None, _option(_TRACE, "Of a surface without a back face.", "X")
    ] = None,
    thickness_from: Annotated[
        str | None,
        _option(_TRACE, "What thickness is.", "back_faces|constant|relative|slope|material"),
    ] = None,
    back_any_object: Annotated[
        bool | None, _option(_TRACE, "Back faces of any object, as a GPU's buffer holds them.")
    ] = None,
    interval: Annotated[
        str | None, _option(_TRACE, "Ray interval of a sample.", "column|cell|point|published")
    ] = None,
    refine: Annotated[
        str | None, _option(_TRACE, "What a candidate leads to.", "auto|rewalk|bisect|secant|none")
    ] = None,
    refine_steps: Annotated[
        int | None, _option(_TRACE, "Halvings of the march's refinement.", "N")
    ] = None,
    listing: Annotated[
        bool | None, _option(_TRACE, "The march as published, with its slips; needs --max-steps.")
    ] = None,
    self_rejection: Annotated[
        str | None, _option(_TRACE, "How the own surface is left.", "plane|none")
    ] = None,
    facing_test: Annotated[
        bool | None, _option(_TRACE, "Refuse faces that the ray meets from behind.")
    ] = None,
    edge_fade: Annotated[bool | None, _option(_RESOLVE, "Fade towards the image's border.")] = None,
    edge_power: Annotated[float | None, _option(_RESOLVE, "Exponent of that fade.", "X")] = None,
    distance_fade: Annotated[
        str | None, _option(_RESOLVE, "Fade with the ray's length.", "none|published|linear")
    ] = None,
    fresnel: Annotated[bool | None, _option(_RESOLVE, "Schlick's Fresnel term.")] = None,
    fallback_color: Annotated[
        str | None, _option(_RESOLVE, "What a miss shows, linear RGB; default black.", "R,G,B")
    ] = None,
    max_roughness: Annotated[
        float | None, _option(_RESOLVE, "Rougher pixels do not reflect.", "X")
    ] = None,
    snap: Annotated[
        str | None, _option(_RESOLVE, "Vertex positions on screen.", "float64|gpu_vertices")
    ] = None,
    buffer_dtype: Annotated[
        str | None, _option(_RESOLVE, "Of the G-buffer.", "float32|float64")
    ] = None,
) -> None:
    """Render a scene with its reflections and write a golden bundle."""
    from ..fileio.bundle import check_target, write_bundle
    from ..fileio.load import load
    from ..pipeline import render as render_frame
    from ..scene import Lights

    # Whatever can be refused is refused before the work starts.
    chosen = _settings(
        settings,
        size=None if size is None else parse_size(size),
        fallback=None if fallback_color is None else "constant",
        fallback_color=None if fallback_color is None else parse_color(fallback_color),
        tracer=tracer,
        surface=surface,
        stride=stride,
        step=step,
        growth=growth,
        jitter=jitter,
        seed=seed,
        max_steps=max_steps,
        max_distance=max_distance,
        bias=bias,
        thickness=thickness,
        thickness_from=thickness_from,
        back_any_object=back_any_object,
        interval=interval,
        refine=refine,
        refine_steps=refine_steps,
        listing=listing,
        self_rejection=self_rejection,
        facing_test=facing_test,
        edge_fade=edge_fade,
        edge_power=edge_power,
        distance_fade=distance_fade,
        fresnel=fresnel,
        max_roughness=max_roughness,
        snap=snap,
        buffer_dtype=buffer_dtype,
    )
    lit = None if lights is None else read_json(lights, Lights.from_json, SceneError)
    given = None if camera is None else read_json(camera, parse_camera, CameraError)
    check_target(output, force=force)

    out: Output = ctx.obj
    started = time.perf_counter()
    with out.progress() as progress:
        progress("load", 0.0)
        loaded = load(
            scene,
            normals=cast("NormalsName", normals),  # checked where they are used
            up=cast("UpName", up),
            unit=unit,
            strict=strict,
            allow_outside=allow_outside,
            scene=parse_scene(gltf_scene),
            mirror_floor=mirror_floor,
            tessellation=tessellation,
        )
        loaded = loaded if lit is None else loaded.with_lights(lit)
        view = choose_view(loaded, given, fov=fov, orthographic=orthographic, near=near, far=far)
        load_seconds = time.perf_counter() - started
        frame = render_frame(loaded, view, chosen, progress=progress)
        frame = replace(frame, timings={"load": load_seconds, **frame.timings})
        for text in frame.warnings:
            warnings.warn(text, SsrRefWarning, stacklevel=1)
        write_bundle(frame, output, force=force, previews=previews, progress=progress)
    _report(out, frame, output, time.perf_counter() - started)


def _settings(path: Path | None, **given: Any) -> Settings:
    """The settings file, or the defaults, with the options that were given put over it."""
    from ..settings import Settings

    base = Settings() if path is None else read_json(path, Settings.from_json, SettingsError)
    return replace(base, **{name: value for name, value in given.items() if value is not None})


def parse_size(text: str) -> tuple[int, int]:
    """(W, H) of "960x540"; the range is checked by Settings. Raises SettingsError."""
    match = re.fullmatch(r"([0-9]{1,9})[xX×]([0-9]{1,9})", text.strip())
    if match is None:
        raise SettingsError(f"size is '{text}'; expected WIDTHxHEIGHT in pixels, such as 960x540")
    return int(match[1]), int(match[2])


def parse_scene(text: str | None) -> int | str | None:
    """A scene's index where the text is a whole number, else its name."""
    return int(text) if text is not None and re.fullmatch(r"[0-9]{1,9}", text) else text


def parse_color(text: str) -> tuple[float, float, float]:
    """(r, g, b) of "0.1,0.2,0.3"; the range is checked by Settings. Raises SettingsError."""
    try:
        r, g, b = (float(part) for part in text.split(","))
    except ValueError:
        raise SettingsError(
            f"fallback color is '{text}'; expected three numbers such as 0.1,0.2,0.3"
        ) from None
    return r, g, b


def parse_camera(data: Any) -> Camera | View:
    """A camera from its matrices, or a view, which has an eye and a target instead."""
    from ..camera import Camera, View

    if not isinstance(data, dict):
        raise CameraError(f"camera is a {type(data).__name__}; expected a JSON object")
    matrices = "world_from_view" in data or "clip_from_view" in data
    return Camera.from_json(data) if matrices else View.from_json(data)


def read_json(path: Path, parse: Callable[[Any], T], kind: type[SsrRefError]) -> T:
    """Parse a JSON file; every error names the file. `kind`: of an error in its contents."""
    try:
        data = json.loads(path.read_bytes())
    except OSError as error:
        raise FileError(f"{path} cannot be read ({error.strerror}); expected a JSON file") from None
    except (ValueError, RecursionError) as error:
        raise FileError(f"{path} is not JSON ({error}); expected a JSON object") from None
    try:
        return parse(data)
    except SsrRefError as error:
        raise type(error)(f"{path}: {error}") from None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise kind(f"{path}: cannot be read ({error}); expected what a bundle holds") from None


def choose_view(
    scene: Scene,
    given: Camera | View | None,
    *,
    fov: float | None,
    orthographic: float | None,
    near: float | None,
    far: float | None,
) -> Camera | View | None:
    """The camera to render with: the given one, or the scene's own or automatic view, changed.

    None where nothing was given: the pipeline chooses. Raises CameraError where options contradict.
    """
    from ..camera import Camera
    from ..scenes import framed_view

    options = {"--fov": fov, "--orthographic": orthographic, "--near": near, "--far": far}
    used = [name for name, value in options.items() if value is not None]
    if not used:
        return given
    if isinstance(given, Camera):
        raise CameraError(
            f"{used[0]} cannot change a camera given by matrices; expected a view (eye, target) in "
            "the camera file: change the matrices, or leave the option out"
        )
    if fov is not None and orthographic is not None:
        raise CameraError("both --fov and --orthographic are given; expected one of them")
    view = given or scene.view or framed_view(scene)
    if fov is not None or orthographic is not None:
        view = replace(view, fov_y_degrees=fov, orthographic_height=orthographic, focal_length=None)
    return replace(
        view, near=view.near if near is None else near, far=view.far if far is None else far
    )


def _report(out: Output, frame: Frame, output: Path, seconds: float) -> None:
    """What was made, on stdout."""
    from ..fileio.bundle import read_identity
    from ..fileio.manifest import statistics
    from ..scene import Scene

    if out.quiet and not out.json:
        return
    counts = statistics(frame)
    content = read_identity(output)
    settings, camera = frame.settings, frame.camera
    report = frame.scene.report if isinstance(frame.scene, Scene) else None
    width, height = settings.size
    seen = {name: n for name, n in counts["status"].items() if n}
    common = sorted(seen, key=lambda name: -seen[name])
    if out.json:
        out.data(
            {
                "output": str(output),
                "scene": frame.scene.name,
                "load": asdict(report) if report is not None else None,
                "size": [width, height],
                "pixels": counts["pixels"],
                "rays": counts["rays"],
                "hits": counts["hits"],
                "status": seen,
                "near": camera.near,
                "far": "inf" if camera.far == float("inf") else camera.far,
                "settings": settings.to_json(),
                "warnings": list(frame.warnings),
                "seconds": round(seconds, 3),
                "content_sha256": content,
            }
        )
        return
    out.facts(
        [
            ("golden bundle", str(output)),
            ("scene", f"{frame.scene.name} ({frame.scene.triangle_count} triangles)"),
            *(load_rows(frame.scene) if out.verbose and isinstance(frame.scene, Scene) else ()),
            ("size", f"{width}x{height}"),
            (
                "lengths",
                f"thickness {length(settings.thickness)}, max_distance "
                f"{length(settings.max_distance)}, bias {length(settings.bias)}, near "
                f"{length(camera.near)}, far {length(camera.far)}",
            ),
            ("rays", f"{counts['rays']} ({percent(counts['rays'], counts['pixels'])} of pixels)"),
            ("hits", f"{counts['hits']} ({percent(counts['hits'], counts['rays'])} of rays)"),
            *(
                ("statuses" if i == 0 else "", f"{name} {percent(seen[name], counts['pixels'])}")
                for i, name in enumerate(common[:5])
            ),
            ("seconds", f"{seconds:.2f}"),
            ("content sha256", content),
        ]
    )

"""Options that several commands share: which scene, which camera, how it is traced.

A command takes a parameter of an options class; `grouped` puts the class's own options in its place
on the command line. An option of `Settings` is one row of a table here.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, replace
from functools import wraps
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    cast,
    get_type_hints,
)

import typer

from ..errors import CameraError, SceneError, SettingsError
from .parsing import parse_camera, parse_color, parse_pair, parse_scene, parse_size, read_json

if TYPE_CHECKING:
    from ..analytic.scene import AnalyticScene
    from ..camera import Camera, View
    from ..meshfiles.options import NormalsName, UpName
    from ..scene import Scene
    from ..settings import Settings

_SCENE, _CAMERA = "Scene", "Camera"
_TRACE, _RESOLVE = "Tracing", "Fades, colours and buffers"


def _option(panel: str, text: str, metavar: str | None = None, *names: str) -> Any:
    return typer.Option(*names, help=text, metavar=metavar, rich_help_panel=panel)


class Options:
    """Base of the options classes."""

    @classmethod
    def parameters(cls) -> list[inspect.Parameter]:
        """The options as parameters of a command; here: the fields of a dataclass."""
        hints = get_type_hints(cls, include_extras=True)
        return [
            inspect.Parameter(
                field.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=inspect.Parameter.empty if field.default is MISSING else field.default,
                annotation=hints[field.name],
            )
            for field in fields(cast(Any, cls))
        ]

    def given_values(self) -> dict[str, Any]:
        """The options that are not at their defaults."""
        values = {
            field.name: (getattr(self, field.name), field.default)
            for field in fields(cast(Any, self))
        }
        return {name: value for name, (value, default) in values.items() if value != default}


def as_options(values: Mapping[str, Any]) -> list[str]:
    """Values by name as words of a command line."""
    words: list[str] = []
    for name, value in values.items():
        option = _OPTION_NAMES.get(name, "--" + name.replace("_", "-"))
        if isinstance(value, bool):
            words.append(option if value else option.replace("--", "--no-", 1))
        else:
            words += [option, _word(value)]
    return words


def _word(value: Any) -> str:
    """A value as an option reads it back exactly."""
    if isinstance(value, tuple):
        return ",".join(_word(part) for part in value)
    return repr(value) if isinstance(value, float) else str(value)


_OPTION_NAMES = {"gltf_scene": "--scene"}


def grouped(command: Callable[..., Any]) -> Callable[..., Any]:
    """The command with each parameter of an options class replaced by that class's options."""
    hints = get_type_hints(command, include_extras=True)
    parameters: list[inspect.Parameter] = []
    groups: dict[str, tuple[type[Options], list[str]]] = {}
    for parameter in inspect.signature(command).parameters.values():
        kind = hints[parameter.name]
        if isinstance(kind, type) and issubclass(kind, Options):
            own = kind.parameters()
            groups[parameter.name] = kind, [p.name for p in own]
            parameters += own
        else:
            parameters.append(
                parameter.replace(annotation=kind, kind=inspect.Parameter.KEYWORD_ONLY)
            )

    @wraps(command)
    def run(**given: Any) -> Any:
        for name, (kind, names) in groups.items():
            given[name] = kind(**{option: given.pop(option) for option in names})
        return command(**given)

    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in parameters}
    return run


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneOptions(Options):
    """How a scene is loaded and lit."""

    mirror_floor: Annotated[
        bool, _option(_SCENE, "Add a mirror under the scene.", None, "--mirror-floor")
    ] = False
    normals: Annotated[
        str, _option(_SCENE, "Where shading normals come from.", "authored|flat|smooth|crease")
    ] = "authored"
    up: Annotated[str, _option(_SCENE, "Upward axis of a mesh file.", "y|z")] = "y"
    unit: Annotated[
        str | None, _option(_SCENE, "What one unit of a mesh file is.", "mm|cm|m|inch|foot")
    ] = None
    gltf_scene: Annotated[
        str | None, _option(_SCENE, "Scene of a glTF file, by index or name.", "NAME", "--scene")
    ] = None
    strict: Annotated[
        bool, _option(_SCENE, "Refuse a file that is not drawn as it stands.", None, "--strict")
    ] = False
    allow_outside: Annotated[
        bool,
        _option(
            _SCENE, "Let a mesh file refer to files outside its folder.", None, "--allow-outside"
        ),
    ] = False
    tessellation: Annotated[int | None, _option(_SCENE, "Fineness of a built-in scene.", "N")] = (
        None
    )
    lights: Annotated[
        Path | None, _option(_SCENE, "Lights, as a bundle's lights.json.", "FILE.json")
    ] = None

    def check(self) -> None:
        """Raise what can be found wrong before the scene is read."""
        self._lights()

    def load(self, scene: str) -> Scene | AnalyticScene:
        """The scene of a name or a file."""
        from ..fileio.load import load, load_closed_form

        lights = self._lights()
        shapes = load_closed_form(scene)
        if shapes is not None:
            if replace(self, lights=None) != SceneOptions():
                raise SettingsError(
                    f"options of mesh scenes are given for the closed-form scene {scene}; expected "
                    "none but --lights"
                )
            return shapes if lights is None else shapes.with_lights(lights)
        loaded = load(
            scene,
            normals=cast("NormalsName", self.normals),  # checked where they are used
            up=cast("UpName", self.up),
            unit=self.unit,
            strict=self.strict,
            allow_outside=self.allow_outside,
            scene=parse_scene(self.gltf_scene),
            mirror_floor=self.mirror_floor,
            tessellation=self.tessellation,
        )
        return loaded if lights is None else loaded.with_lights(lights)

    def _lights(self) -> Any:
        from ..scene import Lights

        return None if self.lights is None else read_json(self.lights, Lights.from_json, SceneError)


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraOptions(Options):
    """Where a scene is seen from."""

    camera: Annotated[
        Path | None,
        _option(
            _CAMERA, "Matrices, as a bundle's camera.json, or a view: eye, target.", "FILE.json"
        ),
    ] = None
    fov: Annotated[float | None, _option(_CAMERA, "Vertical field of view in degrees.", "DEG")] = (
        None
    )
    orthographic: Annotated[
        float | None, _option(_CAMERA, "Parallel projection of this height.", "HEIGHT")
    ] = None
    near: Annotated[float | None, _option(_CAMERA, "Near view depth.", "X")] = None
    far: Annotated[float | None, _option(_CAMERA, "Far view depth, may be inf.", "X")] = None

    def given(self) -> Camera | View | None:
        """The camera file's contents; raises CameraError before anything is rendered."""
        return None if self.camera is None else read_json(self.camera, parse_camera, CameraError)

    def view(self, scene: Scene | AnalyticScene) -> Camera | View | None:
        """The camera to render with: the given one, or the scene's own or automatic view, changed.

        None where nothing was given: the pipeline chooses. Raises CameraError where options
        contradict.
        """
        from ..camera import Camera
        from ..pipeline import own_view

        options = {
            "--fov": self.fov,
            "--orthographic": self.orthographic,
            "--near": self.near,
            "--far": self.far,
        }
        used = [name for name, value in options.items() if value is not None]
        given = self.given()
        if not used:
            return given
        if isinstance(given, Camera):
            raise CameraError(
                f"{used[0]} cannot change a camera given by matrices; expected a view (eye, "
                "target) in the camera file: change the matrices, or leave the option out"
            )
        if self.fov is not None and self.orthographic is not None:
            raise CameraError("both --fov and --orthographic are given; expected one of them")
        view = given or own_view(scene)
        if self.fov is not None or self.orthographic is not None:
            view = replace(
                view,
                fov_y_degrees=self.fov,
                orthographic_height=self.orthographic,
                focal_length=None,
            )
        return replace(
            view,
            near=view.near if self.near is None else self.near,
            far=view.far if self.far is None else self.far,
        )


SETTING_OPTIONS: tuple[tuple[str, str, str | None, str], ...] = (
    (_TRACE, "tracer", "dda|cells|march", "One of them; --method names several."),
    (_TRACE, "surface", "constant|plane", "What a pixel's surface is."),
    (_TRACE, "stride", "N", "Pixels between DDA samples."),
    (_TRACE, "step", "X", "Of the 3-D march; default radius/128."),
    (_TRACE, "growth", "linear|constant", "Of the march's increments."),
    (_TRACE, "jitter", None, "Start each ray at its own share of a stride."),
    (_TRACE, "seed", "N", "Of the jitter."),
    (_TRACE, "max_steps", "N", "Samples of a ray at most; default no limit."),
    (_TRACE, "max_distance", "X", "Length of a ray at most, may be inf."),
    (_TRACE, "bias", "X", "Added to the front of a surface."),
    (_TRACE, "thickness", "X", "Of a surface without a back face."),
    (_TRACE, "thickness_from", "back_faces|constant|relative|slope|material", "What thickness is."),
    (_TRACE, "back_any_object", None, "Back faces of any object, as a GPU's buffer holds them."),
    (_TRACE, "interval", "column|cell|point|published", "Ray interval of a sample."),
    (_TRACE, "refine", "auto|rewalk|bisect|secant|none", "What a candidate leads to."),
    (_TRACE, "refine_steps", "N", "Halvings of the march's refinement."),
    (_TRACE, "listing", None, "March or DDA as published, slips included; needs --max-steps."),
    (_TRACE, "self_rejection", "plane|slope_bias|none", "How the own surface is left."),
    (_TRACE, "geo_normals", "buffer|fitted", "Where geometric normals come from."),
    (_TRACE, "facing_test", None, "Refuse faces that the ray meets from behind."),
    (_RESOLVE, "edge_fade", None, "Fade towards the image's border."),
    (_RESOLVE, "edge_power", "X", "Exponent of that fade."),
    (_RESOLVE, "edge_shape", "power|smoothstep", "How it falls; docs/fades.md has all formulas."),
    (_RESOLVE, "edge_range", "A,B", "Where it falls: 0 the middle, 1 the border."),
    (_RESOLVE, "edge_unit", "axis|height|mean", "What distances to the border are shares of."),
    (_RESOLVE, "edge_combine", "product|sum|max|area", "How both axes are put together."),
    (_RESOLVE, "distance_fade", "none|published|linear|squared", "Fade with the ray's length."),
    (_RESOLVE, "distance_start", "X", "Share of max_distance where that begins."),
    (_RESOLVE, "steps_fade", "none|linear|power", "Fade with the share of max_steps."),
    (_RESOLVE, "steps_fade_out", "X", "Exponent of what is left of it."),
    (_RESOLVE, "steps_fade_in", "X", "Exponent of what is taken."),
    (_RESOLVE, "facing_fade", "none|linear|smoothstep", "Fade of rays that come back to the eye."),
    (_RESOLVE, "facing_measure", "ray|axis", "How far they do: -I.R, or the ray's own z."),
    (_RESOLVE, "facing_range", "A,B", "Where that fade begins and ends, -1 to 1."),
    (_RESOLVE, "residual_fade", "none|linear|smoothstep", "Fade of hits behind the surface."),
    (_RESOLVE, "residual_end", "X", "Where it is 0; default the thickness."),
    (_RESOLVE, "residual_power", "X", "Its exponent."),
    (_RESOLVE, "fresnel", None, "Schlick's Fresnel term."),
    (_RESOLVE, "max_roughness", "X", "Rougher pixels do not reflect."),
    (_RESOLVE, "snap", "float64|gpu_vertices", "Vertex positions on screen."),
    (_RESOLVE, "buffer_dtype", "float32|float64", "Of the G-buffer."),
    (_RESOLVE, "sample_counts", None, "Count how often all rays test each pixel."),
)
"""Panel, name, metavar and help of every setting with an option of its own, as in `--help`.

The metavar tells the type: N a whole number, X a number, A,B two, a|b words, None on or off.
`Settings` is not asked, since it needs NumPy and help must be quick; a test compares the two.
"""

_OTHER_OPTIONS = {
    "settings": Annotated[
        Path | None,
        _option(_TRACE, "Settings, as in a bundle; options win over it.", "FILE.json"),
    ],
    "preset": Annotated[
        str | None,
        _option(_TRACE, "Defaults of an engine (`presets`); what else is given wins.", "NAME"),
    ],
    "method": Annotated[
        str | None,
        _option(_TRACE, "One or several: march, dda, exact, planes.", "NAME[,NAME...]"),
    ],
    "more": Annotated[
        Path | None,
        _option(_TRACE, "Settings of further methods, as a bundle's methods.json.", "FILE.json"),
    ],
    "size": Annotated[
        str | None, typer.Option(metavar="WxH", help="Pixels, such as 1920x1080. [960x540]")
    ],
    "fallback_color": Annotated[
        str | None, _option(_RESOLVE, "What a miss shows, linear RGB; default black.", "R,G,B")
    ],
}


class TraceOptions(Options):
    """How a scene is rendered: `Settings`, by a file and by options."""

    def __init__(self, **given: Any) -> None:
        self._given = {name: value for name, value in given.items() if value is not None}

    def given_values(self) -> dict[str, Any]:
        return dict(self._given)

    @classmethod
    def parameters(cls) -> list[inspect.Parameter]:
        """One option for each row of `SETTING_OPTIONS`."""
        annotations: dict[str, Any] = dict(_OTHER_OPTIONS)
        for panel, name, metavar, text in SETTING_OPTIONS:
            kind = {None: bool, "N": int, "X": float}.get(metavar, str)
            annotations[name] = Annotated[kind | None, _option(panel, text, metavar)]
        return [
            inspect.Parameter(
                name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation
            )
            for name, annotation in annotations.items()
        ]

    def base(self) -> Settings:
        """The settings without regard to `--method`. Raises SettingsError."""
        base, given = self._parts()
        return replace(base, **given)

    def _parts(self) -> tuple[Settings, dict[str, Any]]:
        """The settings file's contents, and what options put over it."""
        from ..presets import preset_settings
        from ..settings import Settings

        given = dict(self._given)
        path, preset = given.pop("settings", None), given.pop("preset", None)
        for name in ("method", "more"):
            given.pop(name, None)
        base = Settings() if path is None else read_json(path, Settings.from_json, SettingsError)
        if preset is not None:
            if path is not None:
                raise SettingsError("both --preset and --settings are given; expected one of them")
            base = preset_settings(preset)
        if "size" in given:
            given["size"] = parse_size(given["size"])
        for _, name, metavar, _ in SETTING_OPTIONS:
            if metavar == "A,B" and name in given:
                given[name] = parse_pair(given[name], name)
        if "fallback_color" in given:
            given |= {
                "fallback": "constant",
                "fallback_color": parse_color(given["fallback_color"]),
            }
        return base, given

    def method_names(self) -> list[str]:
        """The names after `--method`, each once; none without it."""
        wanted = [name.strip() for name in self._given.get("method", "").split(",")]
        if "method" not in self._given:
            return []
        for name in ("tracer", "more"):
            if name in self._given:
                raise SettingsError(f"both --method and --{name} are given; expected one of them")
        for i, name in enumerate(wanted):
            if name in wanted[:i]:
                raise SettingsError(f"method '{name}' is named twice; expected each once")
        return wanted

    def methods(self) -> dict[str, Settings]:
        """The settings of every method asked for, by name; without `--method` one, named ""."""
        from ..settings import method_settings

        names, more = self.method_names(), self._given.get("more")
        if names:
            base, given = self._parts()
            return {name: method_settings(name, base, **given) for name in names}
        further = {} if more is None else read_json(more, _settings_by_name, SettingsError)
        return {"": self.base(), **further}


def _settings_by_name(data: Any) -> dict[str, Settings]:
    from ..settings import Settings

    if not isinstance(data, dict):
        raise SettingsError(f"methods are a {type(data).__name__}; expected settings by name")
    return {name: Settings.from_json(own) for name, own in data.items()}

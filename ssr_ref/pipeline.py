"""The whole render, one line a stage; each stage returns named buffers."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .buffers import GBuffer, HitBuffer, Resolved
from .camera import Camera, View, ViewParams
from .errors import SettingsError
from .raster.geometry import Geometry, flatten
from .raster.rasterize import RasterOptions, rasterize, visible_textures
from .raster.textures import TextureStore, texture_store
from .scene import Scene
from .scenes import framed_view, view_of_bounds
from .settings import NEAR_PER_RADIUS, Settings
from .shading.diffuse import light_arrays, shade_radiance
from .ssr.resolve import resolve
from .ssr.trace import trace

if TYPE_CHECKING:  # imported where such a scene is rendered: few are
    from .analytic.arrays import MaterialArrays
    from .analytic.scene import AnalyticScene

Progress = Callable[[str, float], None]
"""Called with a stage's name and the share of it that is done, 0 to 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Traced:
    """What one method made of a G-buffer. settings are resolved: no length is None."""

    settings: Settings
    hits: HitBuffer
    resolved: Resolved


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One rendered image with everything that explains it.

    settings are resolved: no length is None. warnings: one line each. timings: seconds a stage.
    more: further methods on the same G-buffer, by name.
    """

    scene: Scene | AnalyticScene
    camera: Camera
    settings: Settings
    gbuffer: GBuffer
    hits: HitBuffer
    resolved: Resolved
    warnings: tuple[str, ...] = ()
    timings: dict[str, float] = field(default_factory=dict)
    more: Mapping[str, Traced] = field(default_factory=dict)

    def of(self, name: str) -> Frame:
        """The frame of one of `more`, as if it had been rendered alone."""
        traced = self.more[name]
        return replace(
            self, settings=traced.settings, hits=traced.hits, resolved=traced.resolved, more={}
        )


def render(
    scene: Scene | AnalyticScene,
    camera: Camera | View | None = None,
    settings: Settings | None = None,
    *,
    more: Mapping[str, Settings] | None = None,
    progress: Progress | None = None,
) -> Frame:
    """Rasterize a scene, trace its reflections, composite.

    A closed-form scene is not rasterized: its rays are cast (`analytic.analytic_gbuffer`).
    camera: a `Camera`, or a `View` that becomes one; None: the scene's own view, or one framed on
    its bounds. settings: None: the defaults. more: further methods by name, which need the same
    G-buffer (`check_same_gbuffer`). progress: called with stage and share done.
    Raises SceneError, CameraError or SettingsError.
    """
    stages = Stages(progress)
    drawn = draw_gbuffer(scene, camera, settings or Settings(), more or {}, stages)
    traced = trace_method(drawn.view, drawn.gbuffer, drawn.settings, stages, "")
    return Frame(
        scene=scene,
        camera=drawn.camera,
        settings=drawn.settings,
        gbuffer=drawn.gbuffer,
        hits=traced.hits,
        resolved=traced.resolved,
        warnings=drawn.warnings,
        timings=stages.seconds,
        more={
            name: trace_method(drawn.view, drawn.gbuffer, other, stages, " " + name)
            for name, other in drawn.more.items()
        },
    )


class Drawn(NamedTuple):
    """A G-buffer before anything is traced; settings and `more` are resolved."""

    camera: Camera
    view: ViewParams
    settings: Settings
    more: dict[str, Settings]
    gbuffer: GBuffer
    warnings: tuple[str, ...]


def draw_gbuffer(
    scene: Scene | AnalyticScene,
    camera: Camera | View | None,
    settings: Settings,
    more: Mapping[str, Settings],
    stages: Stages,
) -> Drawn:
    """The part of `render` before tracing: camera, geometry, G-buffer."""
    others = dict(more)
    for name, other in others.items():
        check_same_gbuffer(settings, other, name)

    with stages("geometry"):
        radius = scene.radius()
        settings = settings.resolved(radius)
        others = {name: other.resolved(radius) for name, other in others.items()}
        camera = make_camera(scene, camera, settings, radius)
        view = camera.params(settings.size)
        materials: Geometry | MaterialArrays
        if isinstance(scene, Scene):
            materials = geometry = flatten(scene)
            store = texture_store(scene)
        else:
            from .analytic.arrays import material_arrays

            materials = material_arrays(scene.materials)
    if isinstance(scene, Scene):
        with stages("raster"):
            options = raster_options(settings, *others.values())
            gbuffer, positions_vs = rasterize(view, geometry, options, store=store)
        with stages("radiance"):
            gbuffer = with_radiance(view, geometry, positions_vs, gbuffer, scene, store)
    else:
        with stages("raster"):
            gbuffer = cast_gbuffer(scene, camera, settings, *others.values())
    gbuffer = with_thickness(gbuffer, scene, settings)
    told = (*scene.notes, *frame_warnings(scene, materials, gbuffer, settings))
    return Drawn(camera, view, settings, others, gbuffer, told)


def trace_method(
    view: ViewParams, gbuffer: GBuffer, settings: Settings, stages: Stages, suffix: str
) -> Traced:
    """Trace and resolve; the stages' names get the suffix."""
    with stages("trace" + suffix):
        hits = trace(view, gbuffer, settings, stages.within("trace" + suffix))
    if settings.sample_counts:
        from .ssr.explain import sample_counts

        with stages("counts" + suffix):
            hits = replace(hits, sample_count=sample_counts(view, gbuffer, settings))
    with stages("resolve" + suffix):
        resolved = resolve(view, gbuffer, hits, settings)
    return Traced(settings, hits, resolved)


GBUFFER_SETTINGS = ("size", "back_any_object", "fresnel", "max_roughness", "snap", "buffer_dtype")
"""Settings that decide what a G-buffer holds, and not only whether it holds it."""


def check_same_gbuffer(settings: Settings, other: Settings, name: str) -> None:
    """Raise SettingsError if a further method would need a G-buffer of its own.

    Its name becomes part of array and file names: ASCII letters, digits, _ and - only.
    """
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,64}", name):
        raise SettingsError(
            f"a method is named {name!r}; expected 1 to 64 ASCII letters, digits, _ and -"
        )
    keys: tuple[str, ...] = GBUFFER_SETTINGS
    if "material" in (settings.thickness_from, other.thickness_from):
        keys = (*keys, "thickness_from", "thickness")
    for key in keys:
        first, second = getattr(settings, key), getattr(other, key)
        if first != second:
            raise SettingsError(
                f"method '{name}' has {key} {second}, the first method {first}; expected the same "
                "G-buffer for all: render it apart"
            )


def make_camera(
    scene: Scene | AnalyticScene, camera: Camera | View | None, settings: Settings, radius: float
) -> Camera:
    """The camera to use; a view's missing near plane is 2⁻¹⁰ of the scene's radius."""
    if isinstance(camera, Camera):
        return camera
    view = camera or own_view(scene)
    return view.camera(settings.size, NEAR_PER_RADIUS * radius)


def own_view(scene: Scene | AnalyticScene) -> View:
    """The scene's own view, or one framed on its bounds."""
    if scene.view is not None:
        return scene.view
    return framed_view(scene) if isinstance(scene, Scene) else view_of_bounds(*scene.world_bounds())


def raster_options(settings: Settings, *others: Settings) -> RasterOptions:
    """What the rasterizer must produce for these settings, and for further methods'."""
    return RasterOptions(
        back_depth=any(s.thickness_from == "back_faces" for s in (settings, *others)),
        back_any_object=settings.back_any_object,
        fresnel=settings.fresnel,
        max_roughness=settings.max_roughness,
        gpu_vertices=settings.snap == "gpu_vertices",
        dtype=np.float64 if settings.buffer_dtype == "float64" else np.float32,
    )


def cast_gbuffer(
    scene: AnalyticScene, camera: Camera, settings: Settings, *others: Settings
) -> GBuffer:
    """The closed-form G-buffer that these settings ask for, and further methods'."""
    from .analytic.gbuffer import OUTPUTS, analytic_gbuffer

    options = raster_options(settings, *others)
    return analytic_gbuffer(
        scene,
        camera,
        settings.size,
        dtype=options.dtype,
        outputs=[n for n in OUTPUTS if n != "back_depth" or options.back_depth],
        back_any_object=options.back_any_object,
        fresnel=options.fresnel,
        max_roughness=options.max_roughness,
    )


def with_radiance(
    view: ViewParams,
    geometry: Geometry,
    positions_vs: np.ndarray,
    gbuffer: GBuffer,
    scene: Scene,
    store: TextureStore | None = None,
) -> GBuffer:
    """The G-buffer with its radiance image; store: as in `rasterize`."""
    radiance = np.empty((*gbuffer.depth.shape, 3), gbuffer.depth.dtype)
    shade_radiance(
        view,
        geometry,
        visible_textures(geometry, gbuffer.triangle_id, store),
        positions_vs,
        gbuffer.triangle_id,
        light_arrays(scene.lights),
        radiance,
    )
    return replace(gbuffer, radiance=radiance)


def with_thickness(gbuffer: GBuffer, scene: Scene | AnalyticScene, settings: Settings) -> GBuffer:
    """The G-buffer with each pixel's own thickness, if the settings ask for it."""
    if settings.thickness_from != "material":
        return gbuffer
    assert gbuffer.material_id is not None
    own = [settings.thickness if m.thickness is None else m.thickness for m in scene.materials]
    table = np.array([*own, 0.0], gbuffer.depth.dtype)  # −1, nothing drawn, is the last
    return replace(gbuffer, thickness=table[gbuffer.material_id])


def frame_warnings(
    scene: Scene | AnalyticScene,
    materials: Geometry | MaterialArrays,
    gbuffer: GBuffer,
    settings: Settings,
) -> list[str]:
    """What the reader of a valid picture must still know."""
    lines: list[str] = []
    counts = gbuffer.counts
    seen = gbuffer.triangle_id >= 0
    if not seen.any():
        what = "triangle" if isinstance(scene, Scene) else "shape"
        lines.append(f"the view is empty: no {what} covers a pixel centre")
    if counts.non_finite:
        lines.append(
            f"{counts.non_finite} of {counts.triangles} triangles have NaN or infinite vertices "
            "and were not drawn"
        )
    if counts.repaired_normals:
        lines.append(
            f"{counts.repaired_normals} pixels have a zero or non-finite shading normal; the "
            "geometric normal was used"
        )
    if seen.any() and gbuffer.material_id is not None:
        visible = np.unique(gbuffer.material_id[seen])
        reflective = materials.metallic[visible] > 0.0
        reflective |= np.nan_to_num(materials.own_reflectivity[visible]).max(axis=1) > 0.0
        # A metallic-roughness map speaks for each pixel; its factors alone mean nothing.
        mapped = [m.metallic_roughness_texture is not None for m in scene.materials]
        reflective &= ~np.array(mapped, bool)[visible]
        rough = reflective & (materials.roughness[visible] > settings.max_roughness)
        blurred = reflective & ~rough & (materials.roughness[visible] > 0.0)
        if rough.any():
            lines.append(
                f"{int(rough.sum())} visible materials are rougher than max_roughness "
                f"{settings.max_roughness:g} and do not reflect"
            )
        if blurred.any():
            lines.append(
                f"{int(blurred.sum())} visible materials have a roughness above 0; their "
                "reflection is drawn sharp"
            )
    return lines


class Stages:
    """Times each stage and tells progress about it."""

    def __init__(self, progress: Progress | None) -> None:
        self.seconds: dict[str, float] = {}
        self._progress = progress
        self._name = ""
        self._start = 0.0

    def __call__(self, name: str) -> Stages:
        self._name = name
        return self

    def __enter__(self) -> None:
        self._start = time.perf_counter()
        if self._progress is not None:
            self._progress(self._name, 0.0)

    def __exit__(self, *exc: object) -> None:
        self.seconds[self._name] = time.perf_counter() - self._start
        if self._progress is not None:
            self._progress(self._name, 1.0)

    def within(self, name: str) -> Callable[[float], None] | None:
        """A callback for the share done inside a stage, or None if nobody listens."""
        if self._progress is None:
            return None
        progress = self._progress
        return lambda share: progress(name, share)

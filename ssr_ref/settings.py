"""Everything a user may tune, range-checked here and nowhere else.

Lengths left at None are derived from the scene's radius r (a power of two): thickness 2⁻⁶ r,
max_distance 4 r, step 2⁻⁷ r. `Settings.resolved` fills them in; a bundle records the result.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import Any, Literal, get_args

import numpy as np

from .camera import check_size
from .errors import SettingsError
from .typed import Rgb, Size

TracerName = Literal["dda", "cells", "march"]
ThicknessSource = Literal["back_faces", "constant", "relative", "slope", "material"]
SurfaceName = Literal["constant", "plane"]
IntervalName = Literal["column", "cell", "point", "published"]
RefineName = Literal["auto", "rewalk", "bisect", "secant", "none"]
GrowthName = Literal["linear", "constant"]
SelfRejection = Literal["plane", "slope_bias", "none"]
GeoNormals = Literal["buffer", "fitted"]
EdgeShape = Literal["power", "smoothstep"]
EdgeCombine = Literal["product", "sum", "max", "area"]
EdgeUnit = Literal["axis", "height", "mean"]
DistanceFade = Literal["none", "published", "linear", "squared"]
StepsFade = Literal["none", "linear", "power"]
FacingFade = Literal["none", "linear", "smoothstep"]
FacingMeasure = Literal["ray", "axis"]
ResidualFade = Literal["none", "linear", "smoothstep"]
FallbackName = Literal["none", "constant"]
SnapName = Literal["float64", "gpu_vertices"]
BufferDtype = Literal["float32", "float64"]

THICKNESS_PER_RADIUS = 2.0**-6
NEAR_PER_RADIUS = 2.0**-10
MAX_DISTANCE_PER_RADIUS = 4.0
STEP_PER_RADIUS = 2.0**-7
MAX_SAMPLES = 2**24
"""Of a 3-D march without max_steps, on the way to max_distance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Settings of one render. Raises SettingsError for a value out of range.

    size : (W, H) pixels, 1 to 16384 each.
    tracer : "dda" (one sample a stride), "cells" (every pixel the ray crosses) or "march" (samples
        along the ray in 3-D).
    surface : a pixel's surface is one depth ("constant", as GPU code reads it) or the plane through
        its surface point ("plane"; bias, interval and refine then have no meaning).
    stride : whole pixels of the major axis between samples, 1 to 1024; DDA only.
    jitter : start offset j in (0, 1] of a stride from a per-pixel hash; off: j = 1. The march's
        noise is the same number.
    step : of the march, scene units, above 0; None: 2⁻⁷ r.
    growth : the march's increments: "linear" (i + j)·step for i = 0, 1, …; "constant" j·step, then
        step.
    seed : of the jitter's hash, 0 to 2³²−1.
    max_steps : samples tested at most; None: no limit.
    max_distance : length of a ray in scene units, above 0, may be inf; None: 4 r.
    bias : added to the front of the slab, scene units, ≥ 0.
    thickness : of the slab where there is no back face, scene units, ≥ 0, may be inf; None: r/64.
    thickness_from : "back_faces" (the same object's back face; constant where there is none),
        "constant", "relative" (thickness is a share of the front depth), "slope" (the constant plus
        the depth range that the surface spans inside its pixel), or "material" (each material's
        own, the constant where it has none).
    back_any_object : the back face of any object, as a GPU's back-face buffer holds it.
    interval : "column" (half a stride either side), "cell" (clamped to the pixel read), "point"
        (the sample alone), or "published" (column, but the first from the origin: self-hits).
    refine : "rewalk" every cell of a candidate's interval, "bisect" it, "none"; "auto": rewalk
        above stride 1. Of the march: "bisect" between the last two samples, "secant" a secant step
        after it, "none"; "auto": bisect.
    refine_steps : halvings of the march's refinement, 0 to 64.
    listing : the march or the DDA as published, with its slips (docs/errata_tracers.md); needs
        max_steps.
    self_rejection : "plane" refuses hits under the origin's tangent plane; "slope_bias" instead
        pushes each front back by half the depth range that the surface spans in its pixel; "none".
    geo_normals : geometric normals are the G-buffer's ("buffer", fitted if it has none) or fitted
        to neighbouring depths ("fitted").
    facing_test : refuse a candidate whose geometric normal the ray does not go against.
    edge_fade : whether confidence falls towards the image's border; edge_power its exponent, above
        0; None: 2 for the march, else 3. Formulas of all fades: docs/fades.md.
    edge_shape : "power" t^edge_power or "smoothstep" 3t² − 2t³ of the way t through edge_range.
    edge_range : (start, end) of an axis' fade; 0 the image's middle, 1 its border; start below end.
    edge_unit : how far from the border is measured: in halves of the "axis" itself, of the
        "height", or of the "mean" of width and height.
    edge_combine : both axes' fades: "product", "sum" of what they take, "max" of it, or "area",
        the product of both distances to the border.
    distance_fade : "none", "published" 0.75^(length/max), "linear" or "squared" (1 − length/max)².
    distance_start : share of max_distance up to which the last two are 1, 0 to below 1.
    steps_fade : "none", "linear" 1 − g, "power" (1 − g)^steps_fade_out · g^steps_fade_in, of the
        share g of max_steps, which it needs.
    facing_fade : "none", "linear" or "smoothstep" from 1 to 0 over facing_range (start, end) of how
        far the ray comes towards the eye, −1 to 1.
    facing_measure : that number: "ray" −I·R, or "axis" the reflected ray's own z.
    residual_fade : "none", or (1 − t)^residual_power of the share t of residual_end that the hit
        lies behind the surface, "linear" or by "smoothstep".
    residual_end : scene units, above 0, may be inf; None: the thickness.
    fresnel : Schlick's term, with f0 = 0.04 for dielectrics.
    fallback : what a miss shows: "none" (0) or "constant" (fallback_color, linear RGB).
    max_roughness : rougher pixels do not reflect.
    snap : "float64" window coordinates, or "gpu_vertices": float32 as a GPU computes them.
    buffer_dtype : of the G-buffer, "float32" (rounded once) or "float64".
    sample_counts : also count how often all rays test each pixel: a second, slower pass.
    """

    size: Size = (960, 540)
    tracer: TracerName = "dda"
    surface: SurfaceName = "constant"
    stride: int = 1
    jitter: bool = False
    seed: int = 0
    step: float | None = None
    growth: GrowthName = "linear"
    max_steps: int | None = None
    max_distance: float | None = None
    bias: float = 0.0
    thickness: float | None = None
    thickness_from: ThicknessSource = "back_faces"
    back_any_object: bool = False
    interval: IntervalName = "column"
    refine: RefineName = "auto"
    refine_steps: int = 8
    listing: bool = False
    self_rejection: SelfRejection = "plane"
    geo_normals: GeoNormals = "buffer"
    facing_test: bool = False
    edge_fade: bool = True
    edge_power: float | None = None
    edge_shape: EdgeShape = "power"
    edge_range: tuple[float, float] = (0.0, 1.0)
    edge_unit: EdgeUnit = "axis"
    edge_combine: EdgeCombine = "product"
    distance_fade: DistanceFade = "none"
    distance_start: float = 0.0
    steps_fade: StepsFade = "none"
    steps_fade_out: float = 1.0
    steps_fade_in: float = 0.0
    facing_fade: FacingFade = "none"
    facing_measure: FacingMeasure = "ray"
    facing_range: tuple[float, float] = (0.0, 1.0)
    residual_fade: ResidualFade = "none"
    residual_end: float | None = None
    residual_power: float = 1.0
    fresnel: bool = False
    fallback: FallbackName = "none"
    fallback_color: Rgb = (0.0, 0.0, 0.0)
    max_roughness: float = 0.5
    snap: SnapName = "float64"
    buffer_dtype: BufferDtype = "float32"
    sample_counts: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", check_size(self.size))
        _check_choices(self)
        _whole(self, "stride", 1, 1024)
        _whole(self, "seed", 0, 2**32 - 1)
        _whole(self, "refine_steps", 0, 64)
        if self.max_steps is not None:
            _whole(self, "max_steps", 1, 2**31 - 1)
        _number(self, "max_distance", above=0.0, inf=True)
        _number(self, "step", above=0.0)
        _number(self, "bias", least=0.0)
        _number(self, "thickness", least=0.0, inf=True)
        _number(self, "edge_power", above=0.0)
        _number(self, "max_roughness", least=0.0)
        color = tuple(float(v) for v in self.fallback_color)
        if len(color) != 3 or not all(np.isfinite(v) and v >= 0.0 for v in color):
            raise SettingsError(
                f"fallback_color is {self.fallback_color}; expected three finite numbers, none "
                "below 0"
            )
        object.__setattr__(self, "fallback_color", color)
        _check_tracer(self)
        _check_fades(self)

    @property
    def refinement(self) -> RefineName:
        """What a candidate leads to, "auto" resolved."""
        if self.refine != "auto":
            return self.refine
        if self.tracer == "march":
            return "bisect"
        return "rewalk" if self.stride > 1 and not self.listing else "none"

    @property
    def plain_edge(self) -> bool:
        """Whether the edge fade has the default form Π (1 − (2·|c − ½|)^edge_power)."""
        return (self.edge_shape, self.edge_range, self.edge_unit, self.edge_combine) == (
            "power",
            (0.0, 1.0),
            "axis",
            "product",
        )

    @property
    def tracer_edge_power(self) -> float:
        """edge_power that goes with the tracer where none is given."""
        return 2.0 if self.tracer == "march" else 3.0

    @property
    def edge_exponent(self) -> float:
        """edge_power, or the tracer's own where it is None."""
        return self.tracer_edge_power if self.edge_power is None else self.edge_power

    def resolved(self, radius: float) -> Settings:
        """The same settings with every default filled in, lengths from the scene's radius.

        residual_end stays None where its fade is off.
        """
        thickness = THICKNESS_PER_RADIUS * radius if self.thickness is None else self.thickness
        faded = self.residual_fade != "none" and self.residual_end is None
        return replace(
            self,
            step=STEP_PER_RADIUS * radius if self.step is None else self.step,
            edge_power=self.edge_exponent,
            thickness=thickness,
            residual_end=thickness if faded else self.residual_end,
            max_distance=(
                MAX_DISTANCE_PER_RADIUS * radius if self.max_distance is None else self.max_distance
            ),
        )

    def to_json(self) -> dict[str, Any]:
        """A dictionary of JSON values; infinite lengths are the string "inf"."""
        return {
            key: "inf" if isinstance(value, float) and np.isinf(value) else value
            for key, value in asdict(self).items()
        }

    @staticmethod
    def from_json(data: Any) -> Settings:
        """Settings from `to_json`'s dictionary; raises SettingsError naming an unknown key."""
        names = {f.name for f in fields(Settings)}
        if not isinstance(data, dict):
            raise SettingsError(f"settings are a {type(data).__name__}; expected a JSON object")
        unknown = sorted(set(data) - names)
        if unknown:
            raise SettingsError(
                f"unknown setting '{unknown[0]}'; expected some of {', '.join(sorted(names))}"
            )
        values: dict[str, Any] = {k: np.inf if v == "inf" else v for k, v in data.items()}
        try:
            return Settings(**values)
        except TypeError as error:
            raise SettingsError(f"settings cannot be read: {error}") from None


METHODS: dict[str, dict[str, Any]] = {
    "march": {"tracer": "march", "surface": "constant"},
    "dda": {"tracer": "dda"},
    "exact": {"tracer": "cells", "surface": "constant"},
    "planes": {"tracer": "cells", "surface": "plane"},
}
"""What a method's name stands for. `surface` "plane" gives "dda" its one-fetch form."""


def method_settings(name: str, base: Settings, **changes: Any) -> Settings:
    """The base with changes, as the method of this name.

    Raises SettingsError for an unknown name, and for what the method has not.
    """
    if name not in METHODS:
        raise SettingsError(f"method is '{name}'; expected one of {', '.join(METHODS)}")
    return replace(base, **{**changes, **METHODS[name]})


_CHOICES: dict[str, tuple[Any, ...]] = {
    "tracer": get_args(TracerName),
    "surface": get_args(SurfaceName),
    "thickness_from": get_args(ThicknessSource),
    "interval": get_args(IntervalName),
    "refine": get_args(RefineName),
    "growth": get_args(GrowthName),
    "self_rejection": get_args(SelfRejection),
    "geo_normals": get_args(GeoNormals),
    "edge_shape": get_args(EdgeShape),
    "edge_unit": get_args(EdgeUnit),
    "edge_combine": get_args(EdgeCombine),
    "distance_fade": get_args(DistanceFade),
    "steps_fade": get_args(StepsFade),
    "facing_fade": get_args(FacingFade),
    "facing_measure": get_args(FacingMeasure),
    "residual_fade": get_args(ResidualFade),
    "fallback": get_args(FallbackName),
    "snap": get_args(SnapName),
    "buffer_dtype": get_args(BufferDtype),
    "jitter": (True, False),
    "listing": (True, False),
    "back_any_object": (True, False),
    "facing_test": (True, False),
    "edge_fade": (True, False),
    "fresnel": (True, False),
    "sample_counts": (True, False),
}


def _check_choices(settings: Settings) -> None:
    for name, choices in _CHOICES.items():
        value = getattr(settings, name)
        if value not in choices or (isinstance(choices[0], bool) and not isinstance(value, bool)):
            listed = ", ".join(str(c) for c in choices)
            raise SettingsError(f"{name} is {value!r}; expected one of {listed}")


_REFINES: dict[str, tuple[str, ...]] = {
    "dda": ("auto", "rewalk", "bisect", "none"),
    "cells": get_args(RefineName),  # has nothing to refine
    "march": ("auto", "bisect", "secant", "none"),
}


def _check_tracer(settings: Settings) -> None:
    """What one tracer has and another has not."""
    tracer = settings.tracer
    if settings.refine not in _REFINES[tracer]:
        listed = ", ".join(_REFINES[tracer])
        raise SettingsError(
            f"refine is '{settings.refine}'; expected one of {listed} with tracer '{tracer}'"
        )
    if settings.listing:
        _check_listing(settings)
        if settings.sample_counts:
            raise SettingsError(
                "sample_counts with listing; expected one of them: a published listing has no log"
            )
    if settings.surface == "plane" and settings.self_rejection == "slope_bias":
        raise SettingsError(
            "self_rejection is 'slope_bias' with surface 'plane'; expected 'plane' or 'none': a "
            "plane has its slope and needs no bias for it"
        )
    if tracer != "march":
        return
    if settings.surface != "constant":
        raise SettingsError(
            f"surface is '{settings.surface}' with tracer 'march'; expected 'constant'"
        )
    far, step = settings.max_distance, settings.step
    if settings.max_steps is not None or far is None:
        return
    samples = np.inf if np.isinf(far) else 0.0
    if step is not None:
        samples = far / step
        if settings.growth == "linear":
            samples = float(np.sqrt(2.0 * samples))
    if samples > MAX_SAMPLES:
        raise SettingsError(
            f"max_distance {far:g} takes the march more than {MAX_SAMPLES} samples of step "
            f"{'2^-7 r' if step is None else format(step, 'g')}; expected fewer: set max_steps, a "
            "longer step or a shorter max_distance"
        )


def _check_listing(settings: Settings) -> None:
    """What the published listings have not."""
    tracer = settings.tracer
    if tracer == "cells" or settings.max_steps is None:
        raise SettingsError(
            f"listing is True with tracer '{tracer}' and max_steps {settings.max_steps}; expected "
            "tracer 'march' or 'dda' and a max_steps: nothing else ends the published loop in time"
        )
    expected = ("auto", "bisect", "none") if tracer == "march" else ("auto", "none")
    if settings.refine not in expected:
        raise SettingsError(
            f"refine is '{settings.refine}' with listing; expected one of {', '.join(expected)}"
        )
    if tracer == "march":
        return
    for name, only in (("surface", "constant"), ("interval", "column")):
        if getattr(settings, name) != only:
            raise SettingsError(
                f"{name} is '{getattr(settings, name)}' with listing; expected '{only}'"
            )


def _check_fades(settings: Settings) -> None:
    for name in ("distance_start", "steps_fade_out", "steps_fade_in", "residual_power"):
        if getattr(settings, name) is None:
            raise SettingsError(f"{name} is None; expected a number")
        _number(settings, name, least=0.0)
    if settings.distance_start >= 1.0:
        raise SettingsError(f"distance_start is {settings.distance_start:g}; expected 0 to below 1")
    _number(settings, "residual_end", above=0.0, inf=True)
    _number(settings, "residual_power", above=0.0)
    _range(settings, "edge_range")
    _range(settings, "facing_range")
    if settings.steps_fade != "none" and settings.max_steps is None:
        raise SettingsError(
            f"steps_fade is '{settings.steps_fade}' without max_steps; expected a max_steps, of "
            "which the fade takes its share"
        )
    if settings.residual_fade != "none" and settings.residual_end is None:
        if settings.thickness_from == "relative" or settings.thickness == 0.0:
            raise SettingsError(
                f"residual_fade is '{settings.residual_fade}' without residual_end, and the "
                "thickness is 0 or relative to depth; expected a residual_end in scene units"
            )
    if settings.listing and not settings.plain_edge:
        raise SettingsError(
            "listing has an edge fade of its own; expected edge_shape, edge_range, edge_unit and "
            "edge_combine as they are by default"
        )


def _range(settings: Settings, name: str) -> None:
    """Two finite numbers, the first below the second, as a tuple of floats."""
    value = getattr(settings, name)
    try:
        start, end = (float(v) for v in value)
    except (TypeError, ValueError):
        raise SettingsError(f"{name} is {value!r}; expected two numbers, start and end") from None
    if not (np.isfinite(start) and np.isfinite(end) and start < end):
        raise SettingsError(f"{name} is {start:g},{end:g}; expected a finite start below its end")
    object.__setattr__(settings, name, (start, end))


def _whole(settings: Settings, name: str, low: int, high: int) -> None:
    value = getattr(settings, name)
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise SettingsError(f"{name} is {value!r}; expected a whole number")
    if not low <= value <= high:
        raise SettingsError(f"{name} is {value}; expected {low} to {high}")
    object.__setattr__(settings, name, int(value))


def _number(
    settings: Settings,
    name: str,
    *,
    least: float | None = None,
    above: float | None = None,
    inf: bool = False,
) -> None:
    value = getattr(settings, name)
    if value is None:
        return
    if isinstance(value, bool) or not isinstance(value, int | float | np.floating | np.integer):
        raise SettingsError(f"{name} is {value!r}; expected a number")
    number = float(value)
    good = not np.isnan(number) and (inf or np.isfinite(number))
    if least is not None:
        good = good and number >= least
    if above is not None:
        good = good and number > above
    if not good:
        bound = f"above {above:g}" if above is not None else f"at least {least:g}"
        raise SettingsError(
            f"{name} is {number:g}; expected {bound}" + (" (inf allowed)" if inf else ", finite")
        )
    object.__setattr__(settings, name, number)

"""From hits to colour: fetch, fade, fallback, Fresnel, composite.

    reflection = c·L_hit + (1 − c)·F          composite = L·(1 − R) + R·reflection

L_hit is the texel at floor(hit_px); c the confidence, the product of the fades in the order edge,
distance, steps, facing, residual; F the fallback; R the reflectivity, with
Schlick's term inside it if asked for. One bounce: L_hit is the diffuse radiance of what was hit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from .._jit import driver, kernel
from ..buffers import GBuffer, HitBuffer, Resolved, Status
from ..camera import ViewParams, ray_through
from ..raster.attributes import store3
from ..settings import Settings
from ..typed import F64Array, FloatArray, U8Array, U32Array
from ..vecmath.vec import Vec3, dot, normalize, reflect
from .fade import (
    AREA,
    LINEAR,
    MAX,
    NO_FADE,
    PRODUCT,
    PUBLISHED,
    SMOOTHSTEP,
    SQUARED,
    SUM,
    edge_fade,
    facing_fade,
    listed_edge_fade,
    residual_fade,
    shaped_edge_fade,
    started_distance_fade,
    steps_fade,
)
from .hit import load3

HIT, BACKGROUND = int(Status.HIT), int(Status.BACKGROUND)
NOT_REFLECTIVE = int(Status.NOT_REFLECTIVE)

NO_EDGE, PLAIN_EDGE, LISTED_EDGE, SHAPED_EDGE = 0, 1, 2, 3
_EDGE_COMBINE = {"product": PRODUCT, "sum": SUM, "max": MAX, "area": AREA}
_KINDS = {
    "none": NO_FADE,
    "published": PUBLISHED,
    "linear": LINEAR,
    "squared": SQUARED,
    "smoothstep": SMOOTHSTEP,
}


class FadeRules(NamedTuple):
    """The fades of `Settings` as numbers; kinds are those of `fade`, NO_FADE is off."""

    edge: int  # NO_EDGE, PLAIN_EDGE, LISTED_EDGE or SHAPED_EDGE
    edge_power: float
    edge_smooth: bool
    edge_combine: int
    edge_start: float
    edge_end: float
    edge_side_x: float
    edge_side_y: float
    distance: int
    max_distance: float
    distance_start: float
    steps: bool
    max_steps: float
    steps_out: float
    steps_in: float
    facing: int
    facing_axis: bool
    facing_start: float
    facing_end: float
    residual: int
    residual_end: float
    residual_power: float


def fade_rules(settings: Settings) -> FadeRules:
    """The numbers that `resolve_rows` takes; settings must be resolved."""
    assert settings.max_distance is not None
    edge = NO_EDGE
    if settings.edge_fade and settings.listing:
        edge = LISTED_EDGE
    elif settings.edge_fade:
        edge = PLAIN_EDGE if settings.plain_edge else SHAPED_EDGE
    width, height = settings.size
    unit = {"axis": None, "height": float(height), "mean": 0.5 * (width + height)}
    of = unit[settings.edge_unit]
    powers = {"none": (0.0, 0.0), "linear": (1.0, 0.0)}
    steps_out, steps_in = powers.get(
        settings.steps_fade, (settings.steps_fade_out, settings.steps_fade_in)
    )
    return FadeRules(
        edge=edge,
        edge_power=settings.edge_exponent,
        edge_smooth=settings.edge_shape == "smoothstep",
        edge_combine=_EDGE_COMBINE[settings.edge_combine],
        edge_start=settings.edge_range[0],
        edge_end=settings.edge_range[1],
        edge_side_x=1.0 if of is None else width / of,
        edge_side_y=1.0 if of is None else height / of,
        distance=_KINDS[settings.distance_fade],
        max_distance=float(settings.max_distance),
        distance_start=settings.distance_start,
        steps=settings.steps_fade != "none",
        max_steps=float(settings.max_steps or 1),
        steps_out=steps_out,
        steps_in=steps_in,
        facing=_KINDS[settings.facing_fade],
        facing_axis=settings.facing_measure == "axis",
        facing_start=settings.facing_range[0],
        facing_end=settings.facing_range[1],
        residual=_KINDS[settings.residual_fade],
        residual_end=1.0 if settings.residual_end is None else settings.residual_end,
        residual_power=settings.residual_power,
    )


@kernel
def schlick(f0: float, cosine: float) -> float:
    """Schlick 1994, eq. 15: f0 + (1 − f0)(1 − cosθ)⁵; a surface with f0 = 0 stays dark."""
    if f0 == 0.0:
        return 0.0
    q = 1.0 - cosine
    q2 = q * q
    return f0 + (1.0 - f0) * (q2 * q2 * q)


@kernel
def reflectance(view: ViewParams, x: int, y: int, f0: Vec3, normal: Vec3, fresnel: bool) -> Vec3:
    """R of a pixel: its reflectivity, with Schlick's term for the angle of view if `fresnel`.

    A normal that is zero or not finite has no angle: R is the reflectivity.
    """
    squared = dot(normal, normal)
    if not fresnel or not (squared > 0.0 and np.isfinite(squared)):
        return f0
    d = ray_through(view, x + 0.5, y + 0.5)
    cosine = -dot(normalize(d), normalize(normal))
    if not cosine > 0.0:
        cosine = 0.0
    if cosine > 1.0:
        cosine = 1.0
    return Vec3(schlick(f0.x, cosine), schlick(f0.y, cosine), schlick(f0.z, cosine))


@kernel
def towards_eye(view: ViewParams, x: int, y: int, normal: Vec3, axis: bool) -> float:
    """How far the reflected ray R of a pixel comes back, −1 to 1; I the ray to the pixel.

    −I·R, or with `axis` the view-space z of R: the view looks along −z. NaN without a normal.
    """
    i = normalize(ray_through(view, x + 0.5, y + 0.5))
    r = normalize(reflect(i, normalize(normal)))
    return r.z if axis else -dot(i, r)


@kernel
def sure(fade: float) -> float:
    """The fade; 0 where it is not a number."""
    return 0.0 if np.isnan(fade) else fade


@kernel
def texel(position: float, size: int) -> int:
    """Index of the texel that holds a pixel coordinate, clamped to the image."""
    return min(max(np.int64(np.floor(position)), 0), size - 1)


@kernel
def blend(own: float, r: float, reflection: float) -> float:
    """L·(1 − R) + R·reflection; R = 0 keeps every bit of L."""
    if r == 0.0:
        return own
    return own * (1.0 - r) + r * reflection


@driver()
def resolve_rows(
    view: ViewParams,
    status: U8Array,
    hit_px: F64Array,
    fade_px: F64Array,
    fade_length: F64Array,
    steps: U32Array,
    residual: F64Array,
    radiance: FloatArray,
    reflectivity: FloatArray,
    normal: FloatArray,
    rules: FadeRules,
    fresnel: bool,
    fallback: F64Array,
    edge_out: FloatArray,
    distance_out: FloatArray,
    steps_out: FloatArray,
    facing_out: FloatArray,
    residual_out: FloatArray,
    confidence: FloatArray,
    reflection: FloatArray,
    composite: FloatArray,
) -> None:
    """Colour of every pixel; see the module's docstring.

    steps_out, facing_out and residual_out hold zeros, and are written at hits where their fade is
    on; they may be empty where it is off.
    """
    for y in prange(view.height):
        for x in range(view.width):
            code = status[y, x]
            own = load3(radiance, y, x)
            if code == BACKGROUND or code == NOT_REFLECTIVE:
                edge_out[y, x] = 0.0
                distance_out[y, x] = 0.0
                confidence[y, x] = 0.0
                store3(reflection, y, x, Vec3(0.0, 0.0, 0.0))
                store3(composite, y, x, own)
                continue
            c = 0.0
            fade_e = 0.0
            fade_d = 0.0
            color = Vec3(fallback[0], fallback[1], fallback[2])
            if code == HIT:
                px, py = hit_px[y, x, 0], hit_px[y, x, 1]
                u, v = fade_px[y, x, 0] / view.width, fade_px[y, x, 1] / view.height
                fade_e = 1.0
                if rules.edge == LISTED_EDGE:
                    fade_e = sure(listed_edge_fade(u, v, rules.edge_power))
                elif rules.edge == PLAIN_EDGE:
                    fade_e = sure(edge_fade(u, v, rules.edge_power))
                elif rules.edge == SHAPED_EDGE:
                    fade_e = shaped_edge_fade(
                        u,
                        v,
                        rules.edge_smooth,
                        rules.edge_power,
                        rules.edge_combine,
                        rules.edge_start,
                        rules.edge_end,
                        rules.edge_side_x,
                        rules.edge_side_y,
                    )
                fade_d = sure(
                    started_distance_fade(
                        fade_length[y, x], rules.max_distance, rules.distance, rules.distance_start
                    )
                )
                c = fade_e * fade_d
                if rules.steps:
                    fade = steps_fade(steps[y, x], rules.max_steps, rules.steps_out, rules.steps_in)
                    steps_out[y, x] = fade
                    c *= fade
                if rules.facing != NO_FADE:
                    facing = towards_eye(view, x, y, load3(normal, y, x), rules.facing_axis)
                    fade = facing_fade(facing, rules.facing, rules.facing_start, rules.facing_end)
                    facing_out[y, x] = fade
                    c *= fade
                if rules.residual != NO_FADE:
                    fade = residual_fade(
                        residual[y, x], rules.residual, rules.residual_end, rules.residual_power
                    )
                    residual_out[y, x] = fade
                    c *= fade
                hit = load3(radiance, texel(py, view.height), texel(px, view.width))
                color = Vec3(
                    c * hit.x + (1.0 - c) * fallback[0],
                    c * hit.y + (1.0 - c) * fallback[1],
                    c * hit.z + (1.0 - c) * fallback[2],
                )
            edge_out[y, x] = fade_e
            distance_out[y, x] = fade_d
            confidence[y, x] = c
            store3(reflection, y, x, color)
            r = reflectance(view, x, y, load3(reflectivity, y, x), load3(normal, y, x), fresnel)
            store3(
                composite,
                y,
                x,
                Vec3(
                    blend(own.x, r.x, color.x),
                    blend(own.y, r.y, color.y),
                    blend(own.z, r.z, color.z),
                ),
            )


def resolve(view: ViewParams, gbuffer: GBuffer, hits: HitBuffer, settings: Settings) -> Resolved:
    """Fades, reflection and composite of a traced G-buffer; settings must be resolved."""
    assert gbuffer.radiance is not None
    assert gbuffer.reflectivity is not None
    assert gbuffer.normal_vs is not None
    shape = gbuffer.depth.shape
    dtype = gbuffer.depth.dtype
    rules = fade_rules(settings)
    off = np.empty((0, 0), dtype)
    out = Resolved(
        edge_fade=np.empty(shape, dtype),
        distance_fade=np.empty(shape, dtype),
        confidence=np.empty(shape, dtype),
        reflection=np.empty((*shape, 3), dtype),
        composite=np.empty((*shape, 3), dtype),
        steps_fade=np.zeros(shape, dtype) if rules.steps else None,
        facing_fade=np.zeros(shape, dtype) if rules.facing != NO_FADE else None,
        residual_fade=np.zeros(shape, dtype) if rules.residual != NO_FADE else None,
    )
    fallback = settings.fallback_color if settings.fallback == "constant" else (0.0, 0.0, 0.0)
    resolve_rows(
        view,
        hits.status,
        hits.hit_px,
        hits.hit_px if hits.fade_px is None else hits.fade_px,
        hits.length if hits.fade_length is None else hits.fade_length,
        hits.steps,
        hits.residual,
        gbuffer.radiance,
        gbuffer.reflectivity,
        gbuffer.normal_vs,
        rules,
        settings.fresnel,
        np.array(fallback, np.float64),
        out.edge_fade,
        out.distance_fade,
        off if out.steps_fade is None else out.steps_fade,
        off if out.facing_fade is None else out.facing_fade,
        off if out.residual_fade is None else out.residual_fade,
        out.confidence,
        out.reflection,
        out.composite,
    )
    return out

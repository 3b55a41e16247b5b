"""From hits to colour: fetch, fade, fallback, Fresnel, composite.

    reflection = c·L_hit + (1 − c)·F          composite = L·(1 − R) + R·reflection

L_hit is the texel at floor(hit_px); c the confidence; F the fallback; R the reflectivity, with
Schlick's term inside it if asked for. One bounce: L_hit is the diffuse radiance of what was hit.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from .._jit import driver, kernel
from ..buffers import GBuffer, HitBuffer, Resolved, Status
from ..camera import ViewParams, ray_through
from ..raster.attributes import store3
from ..settings import Settings
from ..typed import F64Array, FloatArray, U8Array
from ..vecmath.vec import Vec3, dot, normalize
from .fade import LINEAR, NO_FADE, PUBLISHED, distance_fade, edge_fade, listed_edge_fade
from .hit import load3

HIT, BACKGROUND = int(Status.HIT), int(Status.BACKGROUND)
NOT_REFLECTIVE = int(Status.NOT_REFLECTIVE)


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
    radiance: FloatArray,
    reflectivity: FloatArray,
    normal: FloatArray,
    edge: bool,
    edge_power: float,
    listed: bool,
    distance_kind: int,
    max_distance: float,
    fresnel: bool,
    fallback: F64Array,
    edge_out: FloatArray,
    distance_out: FloatArray,
    confidence: FloatArray,
    reflection: FloatArray,
    composite: FloatArray,
) -> None:
    """Colour of every pixel; see the module's docstring."""
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
                if edge and listed:
                    fade_e = listed_edge_fade(u, v, edge_power)
                elif edge:
                    fade_e = edge_fade(u, v, edge_power)
                fade_d = distance_fade(fade_length[y, x], max_distance, distance_kind)
                c = fade_e * fade_d
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
    assert settings.max_distance is not None
    shape = gbuffer.depth.shape
    dtype = gbuffer.depth.dtype
    out = Resolved(
        edge_fade=np.empty(shape, dtype),
        distance_fade=np.empty(shape, dtype),
        confidence=np.empty(shape, dtype),
        reflection=np.empty((*shape, 3), dtype),
        composite=np.empty((*shape, 3), dtype),
    )
    kinds = {"none": NO_FADE, "published": PUBLISHED, "linear": LINEAR}
    fallback = settings.fallback_color if settings.fallback == "constant" else (0.0, 0.0, 0.0)
    resolve_rows(
        view,
        hits.status,
        hits.hit_px,
        hits.hit_px if hits.fade_px is None else hits.fade_px,
        hits.length if hits.fade_length is None else hits.fade_length,
        gbuffer.radiance,
        gbuffer.reflectivity,
        gbuffer.normal_vs,
        settings.edge_fade,
        settings.edge_exponent,
        settings.listing,
        kinds[settings.distance_fade],
        float(settings.max_distance),
        settings.fresnel,
        np.array(fallback, np.float64),
        out.edge_fade,
        out.distance_fade,
        out.confidence,
        out.reflection,
        out.composite,
    )
    return out

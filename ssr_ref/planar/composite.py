"""A reflection over the surface that shows it: L·(1 − R) + R·reflection, at a mask's pixels."""

from __future__ import annotations

from numba import prange

from .._jit import driver
from ..camera import ViewParams
from ..raster.attributes import store3
from ..ssr.hit import load3
from ..ssr.resolve import blend, reflectance
from ..typed import BoolArray, FloatArray
from ..vecmath.vec import Vec3


@driver()
def composite_rows(
    view: ViewParams,
    fresnel: bool,
    mask: BoolArray,
    reflectivity: FloatArray,
    normal_vs: FloatArray,
    reflection: FloatArray,
    radiance: FloatArray,
) -> None:
    """Overwrite `radiance` where `mask`; R with Schlick's term if `fresnel`."""
    for y in prange(view.height):
        for x in range(view.width):
            if mask[y, x]:
                own, color = load3(radiance, y, x), load3(reflection, y, x)
                f0, n = load3(reflectivity, y, x), load3(normal_vs, y, x)
                r = reflectance(view, x, y, f0, n, fresnel)
                mixed = Vec3(
                    blend(own.x, r.x, color.x),
                    blend(own.y, r.y, color.y),
                    blend(own.z, r.z, color.z),
                )
                store3(radiance, y, x, mixed)

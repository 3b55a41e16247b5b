"""Codes and factors over arrays: octahedral normals, sRGB, fades, per-pixel noise.

Every function takes array-likes of any leading shape, broadcasts them, computes in float64 and
returns a new array; its arguments are never changed. Shapes or types that do not fit raise
MathsError. The kernels are those of the pipeline: `vecmath/octahedral.py`, `vecmath/srgb.py`,
`ssr/fade.py` and `vecmath/noise.py`.
"""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from .._jit import driver
from ..errors import MathsError
from ..ssr import fade
from ..typed import F64Array, U32Array
from ..vecmath import noise, octahedral, srgb
from ..vecmath.vec import Vec3
from .arrays import common_shape, flat, numbers, rows, vectors, words
from .registry import KernelInfo

DistanceFade = Literal["none", "published", "linear"]
_KIND = {"none": fade.NO_FADE, "published": fade.PUBLISHED, "linear": fade.LINEAR}


def octahedral_encode(direction: npt.ArrayLike) -> F64Array:
    """Octahedral code of a direction.

    direction : (..., 3), of any length but 0.
    Returns (..., 2) in [−1, 1]². sign(0) and sign(−0) are +1. NaN for the zero vector, for a NaN or
    infinity, and where |x| + |y| + |z| overflows.
    Stored as b-bit snorm and decoded, a direction turns by at most 3/√2 / (2^(b−1) − 1) radians
    (half a step in u and v moves the octahedron's point by √6/2 steps, at distance ≥ 1/√3).
    Source: Cigolle et al., JCGT 3(2), 2014, listing 1.
    """
    d = vectors(direction, "direction", 3)
    shape = d.shape[:-1]
    out = np.empty((*shape, 2))
    _encode_all(rows(d, shape), out.reshape(-1, 2))
    return out


def octahedral_decode(code: npt.ArrayLike) -> F64Array:
    """Unit vector of an octahedral code.

    code : (..., 2) in [−1, 1]².
    Returns (..., 3), unit; NaN outside the square and for NaN.
    Source: Cigolle et al., JCGT 3(2), 2014, listing 2.
    """
    uv = vectors(code, "code", 2)
    shape = uv.shape[:-1]
    out = np.empty((*shape, 3))
    _decode_all(rows(uv, shape), out.reshape(-1, 3))
    return out


def srgb_encode(linear: npt.ArrayLike) -> F64Array:
    """sRGB code of linear light, not clamped: 0 to 1 gives 0 to 1.

    linear : any shape. Below 0.0031308 the line 12.92·x, for negative numbers too; above it
    1.055·x^(1/2.4) − 0.055. NaN gives NaN, ±inf gives ±inf.
    Source: IEC 61966-2-1:1999, section 5.2.
    """
    x = numbers(linear, "linear")
    out = np.empty(x.shape)
    _srgb_all(flat(x, x.shape), False, out.reshape(-1))
    return out


def srgb_decode(code: npt.ArrayLike) -> F64Array:
    """Linear light of an sRGB code, not clamped: 0 to 1 gives 0 to 1.

    code : any shape; a byte is divided by 255 first. Up to 0.04045 the line c/12.92; above it
        ((c + 0.055)/1.055)^2.4. NaN gives NaN, ±inf gives ±inf. Of all 256 bytes the result,
        rounded to float32, is the correctly rounded value.
    Source: IEC 61966-2-1:1999, section 5.2.
    """
    c = numbers(code, "code")
    out = np.empty(c.shape)
    _srgb_all(flat(c, c.shape), True, out.reshape(-1))
    return out


def edge_fade(uv: npt.ArrayLike, power: npt.ArrayLike = 3.0) -> F64Array:
    """Confidence that falls towards the image's border: Π (1 − (2·|c − ½|)^power) over u and v.

    uv : (..., 2), the image is [0, 1]². power : (...), finite and > 0.
    Returns (...) in [0, 1], each factor clamped: 0 on the border and beyond it. NaN gives NaN.
    Raises MathsError for a power that is not > 0.
    """
    at, exponent = vectors(uv, "uv", 2), numbers(power, "power")
    if not ((exponent > 0.0) & np.isfinite(exponent)).all():
        raise MathsError("power is not a finite number > 0 everywhere; expected one such as 2 or 3")
    shape = common_shape(uv=at.shape[:-1], power=exponent.shape)
    out = np.empty(shape)
    _edge_all(rows(at, shape), flat(exponent, shape), out.reshape(-1))
    return out


def distance_fade(
    length: npt.ArrayLike, max_distance: npt.ArrayLike, kind: DistanceFade = "published"
) -> F64Array:
    """Confidence that falls with the length of the ray.

    length, max_distance : (...), in the same unit, > 0.
    kind : "published" 0.75^(length/max), still 0.75 at the maximum; "linear" 1 − length/max,
        clamped to [0, 1]; "none" 1.
    Returns (...) in [0, 1]. An infinite max_distance gives 1, whatever the length; else NaN gives
    NaN, and an infinite length 0.
    """
    if kind not in get_args(DistanceFade):
        raise MathsError(f"kind is '{kind}'; expected {', '.join(get_args(DistanceFade))}")
    far, limit = numbers(length, "length"), numbers(max_distance, "max_distance")
    shape = common_shape(length=far.shape, max_distance=limit.shape)
    out = np.empty(shape)
    _distance_all(flat(far, shape), flat(limit, shape), _KIND[kind], out.reshape(-1))
    return out


def pcg3d(x: npt.ArrayLike, y: npt.ArrayLike, z: npt.ArrayLike) -> U32Array:
    """Three hashed words of three words.

    x, y, z : (...), whole numbers from 0 to 2³² − 1.
    Returns (..., 3) uint32.
    Source: Jarzynski and Olano, Hash Functions for GPU Rendering, JCGT 9(3), 2020, listing 16.
    """
    a, b, c = words(x, "x"), words(y, "y"), words(z, "z")
    shape = common_shape(x=a.shape, y=b.shape, z=c.shape)
    out = np.empty((*shape, 3), np.uint32)
    _pcg3d_all(flat(a, shape), flat(b, shape), flat(c, shape), out.reshape(-1, 3))
    return out


def jitter(x: npt.ArrayLike, y: npt.ArrayLike, seed: npt.ArrayLike = 0) -> F64Array:
    """Noise of a pixel, the same in every language: a multiple of 2⁻²⁴, exact in float32.

    x, y, seed : (...), whole numbers from 0 to 2³² − 1.
    Returns (...) in (0, 1]: the top 24 bits of `pcg3d`'s first word, plus 1, times 2⁻²⁴.
    """
    a, b, c = words(x, "x"), words(y, "y"), words(seed, "seed")
    shape = common_shape(x=a.shape, y=b.shape, seed=c.shape)
    out = np.empty(shape)
    _jitter_all(flat(a, shape), flat(b, shape), flat(c, shape), out.reshape(-1))
    return out


@driver(parallel=False)
def _encode_all(d: Any, out: Any) -> None:
    for i in range(d.shape[0]):
        out[i, 0], out[i, 1] = octahedral.octahedral_encode(Vec3(d[i, 0], d[i, 1], d[i, 2]))


@driver(parallel=False)
def _decode_all(uv: Any, out: Any) -> None:
    for i in range(uv.shape[0]):
        d = octahedral.octahedral_decode(uv[i, 0], uv[i, 1])
        out[i, 0], out[i, 1], out[i, 2] = d.x, d.y, d.z


@driver(parallel=False)
def _srgb_all(values: Any, decode: bool, out: Any) -> None:
    for i in range(values.shape[0]):
        out[i] = srgb.srgb_decode(values[i]) if decode else srgb.srgb_encode(values[i])


@driver(parallel=False)
def _edge_all(uv: Any, power: Any, out: Any) -> None:
    for i in range(uv.shape[0]):
        out[i] = fade.edge_fade(uv[i, 0], uv[i, 1], power[i])


@driver(parallel=False)
def _distance_all(length: Any, max_distance: Any, kind: int, out: Any) -> None:
    for i in range(length.shape[0]):
        out[i] = fade.distance_fade(length[i], max_distance[i], kind)


@driver(parallel=False)
def _pcg3d_all(x: Any, y: Any, z: Any, out: Any) -> None:
    for i in range(x.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = noise.pcg3d(x[i], y[i], z[i])


@driver(parallel=False)
def _jitter_all(x: Any, y: Any, seed: Any, out: Any) -> None:
    for i in range(x.shape[0]):
        out[i] = noise.jitter(x[i], y[i], seed[i])


_CIGOLLE = "Cigolle et al., JCGT 3(2), 2014, section 3.7"
_IEC = "IEC 61966-2-1:1999, section 5.2"
_PCG = "Jarzynski and Olano, JCGT 9(3), 2020, listing 16"

KERNELS = (
    KernelInfo(
        name="octahedral_encode",
        function=octahedral_encode,
        measure="component",
        bound=4.0,
        why="γ₄: two sums of positive numbers below, one above, one division; nothing cancels",
        source=_CIGOLLE,
    ),
    KernelInfo(
        name="octahedral_decode",
        function=octahedral_decode,
        measure="norm",
        bound=7.0,
        why="z to (1 + √3)u of a vector of norm ≥ 1/√3; then γ₃/2 + 1 for the length, 1 to divide",
        source=_CIGOLLE,
    ),
    KernelInfo(
        name="srgb_encode",
        function=srgb_encode,
        measure="component",
        bound=9.0,
        why="up to 2¹⁶, with a pow to 1 ulp and constants to u: at the threshold pow 2u, its "
        "exponent 2.4u, 1.055 and its product 2u, times 2.36 since 0.055 cancels, then 2.4u; "
        "condition 0.98",
        source=_IEC,
    ),
    KernelInfo(
        name="srgb_decode",
        function=srgb_decode,
        measure="component",
        bound=9.0,
        why="with a pow to 1 ulp and constants to u: at the threshold the base to 3.6u, times 2.4, "
        "the exponent 5.8u, pow 2u; condition 1.02",
        source=_IEC,
    ),
    KernelInfo(
        name="edge_fade",
        function=edge_fade,
        measure="absolute",
        bound=11.0,
        why="(p + 3)u for power p ≤ 8, with a pow to 1 ulp: q to u, q^p to (p + 2)u, 1 − q^p to u, "
        "weighted by the other factor",
        source="McGuire and Mara, JCGT 3(4), 2014, clamped",
    ),
    KernelInfo(
        name="distance_fade",
        function=distance_fade,
        measure="absolute",
        bound=3.0,
        why="linear: a division and a subtraction, 2u; published: the division 0.37u, a pow to 1 "
        "ulp 2u",
        source="published form 0.75^(length/max); linear for comparison",
    ),
    KernelInfo(
        name="pcg3d",
        function=pcg3d,
        measure="exact",
        bound=0.0,
        why="integers modulo 2³²",
        source=_PCG,
    ),
    KernelInfo(
        name="jitter",
        function=jitter,
        measure="exact",
        bound=0.0,
        why="25-bit integers times 2⁻²⁴",
        source=_PCG,
    ),
)

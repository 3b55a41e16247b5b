"""Directions to environment-map coordinates and back, over arrays.

    face, uv = cube_face(direction, flip="z")        # uv right and down on that face
    uv = latlong_uv(direction)                       # the middle of the map looks along −Z

Directions have any length but 0. u runs right and v down from 0 to 1: texel i of n holds
[i/n, (i + 1)/n), its centre is (i + ½)/n, and u = 1 belongs to the last. Conventions, figures and
sources: `vecmath/directions.py`.
"""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from .._jit import driver
from ..errors import MathsError
from ..typed import F64Array, I32Array
from ..vecmath import directions
from ..vecmath.vec import Vec3
from .arrays import common_shape, flat, numbers, rows, vectors
from .registry import KernelInfo

Flip = Literal["none", "x", "y", "z"]
_FLIP = {
    "none": directions.NO_FLIP,
    "x": directions.FLIP_X,
    "y": directions.FLIP_Y,
    "z": directions.FLIP_Z,
}
_CUBE, _CROSS, _LATLONG, _BALL = 0, 1, 2, 3


def cube_face(direction: npt.ArrayLike, *, flip: Flip = "none") -> tuple[I32Array, F64Array]:
    """Face of a cube map that a direction meets, and where on it.

    direction : (..., 3).
    flip : the axis negated first. "none": direction is in the cube's own left-handed axes, as the
        OpenGL, Vulkan and Direct3D tables have it. A right-handed world needs one flip, or the
        picture is mirrored: "z" shows −Z, our view ahead, on face +Z; three.js uses "x".
    Returns face (...) int32, 0 to 5 for +X, −X, +Y, −Y, +Z, −Z, and uv (..., 2) in [0, 1]. The
    largest component decides; of equal ones z before y before x. A zero, NaN or infinite direction
    has face −1 and NaN.
    Raises MathsError for a wrong shape, type or flip.
    Source: OpenGL 4.6 core specification, section 8.13, table 8.19.
    """
    out, shape = _to_map(_CUBE, direction, flip)
    return out[:, 0].astype(np.int32).reshape(shape), out[:, 1:].reshape(*shape, 2).copy()


def cube_direction(face: npt.ArrayLike, uv: npt.ArrayLike, *, flip: Flip = "none") -> F64Array:
    """Direction through a point of a cube-map face; the inverse of `cube_face`.

    face : (...), whole numbers −1 to 5. uv : (..., 2); beyond [0, 1] the face's plane goes on.
    Returns (..., 3), not normalised: the face's own axis is exactly ±1. NaN for face −1 and
    non-finite uv. Raises MathsError for other faces, shapes that do not broadcast, a wrong flip.
    """
    at = vectors(uv, "uv", 2)
    f = numbers(face, "face")
    bad = ~((f >= -1.0) & (f <= 5.0) & (f == np.floor(f)))
    if bad.any():
        raise MathsError(f"face is {f[bad].flat[0]:g}; expected 0 to 5, or -1 for none")
    return _from_map(_CUBE, f, at, flip)


def cross_uv(direction: npt.ArrayLike, *, flip: Flip = "none") -> F64Array:
    """Coordinates in a horizontal cross of 4 × 3 faces; n × n texels a face make 4n × 3n.

    Columns and rows from the top left: +Y in (1, 0); −X, +Z, +X, −Z in row 1; −Y in (1, 2).
    direction, flip : as in `cube_face`. Returns (..., 2) in [0, 1], never in an empty cell: an edge
    beside one is given one float64 before it. NaN for no direction.
    """
    out, shape = _to_map(_CROSS, direction, flip)
    return out[:, 1:].reshape(*shape, 2).copy()


def cross_direction(uv: npt.ArrayLike, *, flip: Flip = "none") -> F64Array:
    """Direction shown at a point of the horizontal cross; the inverse of `cross_uv`.

    uv : (..., 2). Returns (..., 3), not normalised: the largest component is ±1. NaN in the six
    empty cells and outside [0, 1]; an outer edge belongs to its face.
    """
    return _from_map(_CROSS, np.zeros(()), vectors(uv, "uv", 2), flip)


def latlong_uv(direction: npt.ArrayLike) -> F64Array:
    """Coordinates in a latitude-longitude (equirectangular) map.

    direction : (..., 3). Returns (..., 2): u in [0, 1), ½ along −Z, growing towards +X; v in
    [0, 1], 0 at +Y. The seam is at +Z. At the poles u = ½, whatever the signs of the zeros. NaN for
    no direction. u is compared modulo 1.
    Source: Debevec, light probes, "latitude-longitude format"; his u runs from 0 to 2.
    """
    out, shape = _to_map(_LATLONG, direction, "none")
    return out[:, 1:].reshape(*shape, 2).copy()


def latlong_direction(uv: npt.ArrayLike) -> F64Array:
    """Unit direction shown at a point of a latitude-longitude map; the inverse of `latlong_uv`.

    uv : (..., 2); u wraps. Returns (..., 3); rows v = 0 and v = 1 are exactly (0, ±1, 0). NaN for
    v outside [0, 1]: clamp it first, as a sampler does.
    """
    return _from_map(_LATLONG, np.zeros(()), vectors(uv, "uv", 2), "none")


def ball_uv(direction: npt.ArrayLike) -> F64Array:
    """Coordinates in an orthographic photograph of a mirrored ball taken along −Z.

    direction : (..., 3), the way one sees from the ball's centre. Returns (..., 2): the disk of
    radius ½ about (½, ½); +Z, where the camera stands, is in the middle, the half sphere of z > 0
    within 1/√2 of the radius. −Z, which the whole rim shows, gives (1, ½). NaN for no direction.
    Source: the law of reflection: the ball's normal halves the angle to +Z, r = sin(θ/2).
    """
    out, shape = _to_map(_BALL, direction, "none")
    return out[:, 1:].reshape(*shape, 2).copy()


def ball_direction(uv: npt.ArrayLike) -> F64Array:
    """Unit direction reflected at a point of the mirrored ball; the inverse of `ball_uv`.

    uv : (..., 2). Returns (..., 3); NaN off the ball.
    """
    return _from_map(_BALL, np.zeros(()), vectors(uv, "uv", 2), "none")


def _check_flip(flip: str) -> None:
    if flip not in get_args(Flip):
        raise MathsError(f"flip is '{flip}'; expected {', '.join(get_args(Flip))}")


def _to_map(kind: int, direction: npt.ArrayLike, flip: str) -> tuple[F64Array, tuple[int, ...]]:
    """(N, 3) of face, u, v, and the shape of N."""
    _check_flip(flip)
    d = vectors(direction, "direction", 3)
    shape = d.shape[:-1]
    flat_d = rows(d, shape)
    out = np.empty((flat_d.shape[0], 3))
    _to_map_all(kind, _FLIP[flip], flat_d, out)
    return out, shape


def _from_map(kind: int, face: F64Array, uv: F64Array, flip: str) -> F64Array:
    _check_flip(flip)
    shape = common_shape(face=face.shape, uv=uv.shape[:-1])
    out = np.empty((*shape, 3))
    _from_map_all(kind, _FLIP[flip], flat(face, shape), rows(uv, shape), out.reshape(-1, 3))
    return out


@driver(parallel=False)
def _to_map_all(kind: int, flip: int, d: Any, out: Any) -> None:
    for i in range(d.shape[0]):
        v = Vec3(d[i, 0], d[i, 1], d[i, 2])
        out[i, 0] = 0.0
        if kind == _CUBE:
            out[i, 0], out[i, 1], out[i, 2] = directions.cube_face(directions.flipped(v, flip))
        elif kind == _CROSS:
            out[i, 1], out[i, 2] = directions.cross_uv(directions.flipped(v, flip))
        elif kind == _LATLONG:
            out[i, 1], out[i, 2] = directions.latlong_uv(v)
        else:
            out[i, 1], out[i, 2] = directions.ball_uv(v)


@driver(parallel=False)
def _from_map_all(kind: int, flip: int, face: Any, uv: Any, out: Any) -> None:
    for i in range(uv.shape[0]):
        if kind == _CUBE:
            d = directions.cube_direction(int(face[i]), uv[i, 0], uv[i, 1])
        elif kind == _CROSS:
            d = directions.cross_direction(uv[i, 0], uv[i, 1])
        elif kind == _LATLONG:
            d = directions.latlong_direction(uv[i, 0], uv[i, 1])
        else:
            d = directions.ball_direction(uv[i, 0], uv[i, 1])
        if kind == _CUBE or kind == _CROSS:
            d = directions.flipped(d, flip)
        out[i, 0], out[i, 1], out[i, 2] = d.x, d.y, d.z


_GL = "OpenGL 4.6 core specification, section 8.13, table 8.19"

KERNELS: tuple[KernelInfo, ...] = (
    KernelInfo(
        name="cube_face",
        form="face",
        function=lambda d: cube_face(d)[0],
        measure="exact",
        bound=0.0,
        why="comparisons of magnitudes only",
        source=_GL,
    ),
    KernelInfo(
        name="cube_face",
        form="uv",
        function=lambda d: cube_face(d)[1],
        measure="component",
        bound=2.0,
        why="gamma_2: the sum s + m and one division; halving is exact",
        source=_GL,
    ),
    KernelInfo(
        name="cube_direction",
        function=cube_direction,
        measure="component",
        bound=1.0,
        why="2u - 1 is one fused operation; the face's own axis is exact",
        source=_GL,
    ),
    KernelInfo(
        name="cross_uv",
        function=cross_uv,
        measure="component",
        bound=4.0,
        why="gamma_4: two roundings of the face's coordinate, the sum with the column or row, the "
        "division by 3 (by 4 it is exact); or 2 u for an edge's place before it",
        source=_GL,
    ),
    KernelInfo(
        name="cross_direction",
        function=cross_direction,
        measure="norm",
        bound=6.0,
        why="3v rounds by at most 2 u, doubled 4 u; 2s - 1 and 2t - 1 by u each; the norm is >= 1",
        source=_GL,
    ),
    KernelInfo(
        name="latlong_uv",
        function=latlong_uv,
        measure="component",
        bound=5.0,
        why="v: hypotenuse 2 u, atan2 0.65 ulp = 1.3 u, pi 0.4 u, division 1 u; u: no hypotenuse, "
        "but the sum with 1; u is compared modulo 1",
        source="Debevec, light probes, latitude-longitude format",
    ),
    KernelInfo(
        name="latlong_direction",
        function=latlong_direction,
        measure="norm",
        bound=7.0,
        why="gamma_7: two factors of 3 u each (pi 0.4, product 1, sine 1.6), their product 1",
        source="Debevec, light probes, latitude-longitude format",
    ),
    KernelInfo(
        name="ball_uv",
        function=ball_uv,
        measure="norm",
        bound=24.0,
        why="x and y within 8.5 u of themselves (length 2.5, sum, quotient, root, hypotenuse 2, "
        "quotient, product), halved; each sum rounds once: 5 u on the rim, over a norm of uv that "
        "is at least 0.2 there",
        source="law of reflection, r = sin(theta/2)",
    ),
    KernelInfo(
        name="ball_direction",
        function=ball_direction,
        measure="norm",
        bound=6.0,
        why="q within 2 u; 2q - 1 adds 4 u + u; the others half of q's 2 u and three roundings",
        source="law of reflection, r = sin(theta/2)",
    ),
)

"""Linear view depth of every device format over arrays, and back, with the storage as a step apart.

    z = linear_depth(d, "reversed", near=0.1, far=np.inf, empty=0.0)
    d = device_depth(z, "d3d", near=0.1, far=1000.0, empty=1.0)
    z = linear_depth(stored_depth(codes, "unorm24"), "gl_window", near=0.1, far=1000.0)

Nothing is guessed: a format, a projection or an empty value that is not given is not assumed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from .._jit import driver
from ..camera import Camera, check_size
from ..depth import formats, storage
from ..depth.storage import Storage
from ..errors import MathsError
from ..transforms import identity
from ..typed import AnyArray, F64Array, Size
from .arrays import common_shape, flat, numbers
from .registry import KernelInfo

DepthFormat = Literal[
    "gl_ndc", "gl_window", "d3d", "vulkan", "reversed", "logarithmic", "logarithmic_near",
    "linear", "negative_z", "distance",
]  # fmt: skip
Projection = Literal["perspective", "orthographic"]

_CODE: dict[str, int] = {
    "gl_ndc": formats.SYMMETRIC,
    "gl_window": formats.ZERO_TO_ONE,
    "d3d": formats.ZERO_TO_ONE,
    "vulkan": formats.ZERO_TO_ONE,
    "reversed": formats.REVERSED,
    "logarithmic": formats.LOGARITHMIC,
    "logarithmic_near": formats.LOGARITHMIC_NEAR,
    "linear": formats.LINEAR,
    "negative_z": formats.NEGATIVE_Z,
    "distance": formats.DISTANCE,
}
_NEAR_AND_FAR = ("gl_ndc", "gl_window", "d3d", "vulkan", "reversed", "logarithmic_near")


def linear_depth(
    device: npt.ArrayLike,
    format: DepthFormat,
    *,
    near: npt.ArrayLike | None = None,
    far: npt.ArrayLike | None = None,
    projection: Projection = "perspective",
    constant: npt.ArrayLike | None = None,
    ray_length: npt.ArrayLike | None = None,
    empty: float | None = None,
) -> F64Array:
    """Linear view depth z > 0, in scene units, of what a depth buffer or a depth pass holds.

    device : (...), what the buffer holds, as numbers (see `stored_depth` for unorm codes).
    format, with its range from near to far and what it needs:
        "gl_ndc" −1 to 1; "gl_window", "d3d", "vulkan" 0 to 1; "reversed" 1 to 0: near, far
        "logarithmic" log(1 + C·z)/log(1 + C·far), 0 at the eye, 1 at far: far, constant (C)
        "logarithmic_near" log(z/near)/log(far/near), 0 to 1: near, far
        "linear" z itself; "negative_z" the view-space coordinate −z: nothing
        "distance" along the pixel's ray, as in Mitsuba's depth and in Blender's where its manual
        says so: ray_length, see `ray_lengths`
    near, far : (...), view depths, 0 < near < far; far may be inf in the formats of the first row
        with a perspective projection. Ignored by the formats that do not need them.
    projection : for the first row; an orthographic device depth is linear in z.
    empty : the value that means "nothing was drawn here", rounded to device's own type; NaN and
        infinities allowed. Those pixels become +inf. None: every value is a depth.
    Returns (...) float64. near and far come back exactly from the ends of the range. NaN where
    device is NaN or outside its range.
    Raises MathsError for an unknown format, a missing argument, a constant or ray_length that the
    format has no use for, shapes that do not broadcast, or numbers out of range.
    Source: OpenGL 4.6 core specification, section 13.8; reversed: Reed, Depth Precision Visualized,
    2015; arrangement and bounds: `depth/formats.py`; logarithmic: `depth/logarithmic.py`.
    """
    d = numbers(device, "device")
    arguments = _arguments(format, projection, near, far, constant, ray_length)
    hole = None if empty is None else _like(empty, device)
    return _convert(_decode_all, "device", d, format, projection, arguments, hole)


def device_depth(
    linear: npt.ArrayLike,
    format: DepthFormat,
    *,
    near: npt.ArrayLike | None = None,
    far: npt.ArrayLike | None = None,
    projection: Projection = "perspective",
    constant: npt.ArrayLike | None = None,
    ray_length: npt.ArrayLike | None = None,
    empty: float | None = None,
) -> F64Array:
    """Device depth of a linear view depth: the inverse of `linear_depth`, before storage.

    linear : (...), view depths > 0; other arguments as in `linear_depth`.
    empty : what to write where linear is +inf. None: +inf is a depth like any other.
    Returns (...) float64; NaN for depths that are NaN, ≤ 0, or outside [near, far] in a format
    that uses them. Raises as `linear_depth` does.
    """
    z = numbers(linear, "linear")
    arguments = _arguments(format, projection, near, far, constant, ray_length)
    hole = None if empty is None else float(empty)
    return _convert(_encode_all, "linear", z, format, projection, arguments, hole)


def depth_codes(device: npt.ArrayLike, storage_type: Storage) -> AnyArray:
    """Device depths as a buffer stores them.

    device : (...). storage_type : "unorm16" (uint16), "unorm24" (uint32), "float16", "float32".
    Returns (...) of that type: unorm clamped to [0, 1] and rounded to nearest, floats by IEEE 754
    (float16 is inf from 65520). Raises MathsError for NaN in a unorm, or an unknown storage.
    Source: OpenGL 4.6 core specification, section 2.3.5.
    """
    return storage.to_storage(numbers(device, "device"), storage_type)


def stored_depth(codes: npt.ArrayLike, storage_type: Storage) -> F64Array:
    """Device depths, float64, of what a buffer stores; the inverse of `depth_codes`.

    codes : (...). unorm24 in the low 24 bits: take the stencil off first.
    Raises MathsError for codes that are no whole numbers or too large.
    """
    numbers(codes, "codes")
    return storage.from_storage(np.asarray(codes), storage_type)


def ray_lengths(
    size: Size, *, camera: Camera | None = None, fov_y_degrees: float | None = None
) -> F64Array:
    """|d| of each pixel's ray with d_z = −1: distance along the ray = depth·|d|.

    size : (W, H). camera, or fov_y_degrees: the whole vertical angle of a symmetric one with square
    pixels. Returns (H, W) float64 ≥ 1; 1 everywhere for an orthographic camera. Error ≤ 4 · 2⁻⁵³.
    Raises MathsError unless exactly one of them is given; CameraError, SettingsError.
    """
    width, height = check_size(size)
    if (camera is None) == (fov_y_degrees is None):
        raise MathsError("ray_lengths expected one of camera and fov_y_degrees")
    if fov_y_degrees is not None:
        camera = Camera.perspective(identity(), fov_y_degrees, width / height, near=1.0)
    assert camera is not None
    view = camera.params((width, height))
    if not view.perspective:
        return np.ones((height, width))
    x = (np.arange(width) + 0.5 - view.cx) / view.fx
    y = (view.cy - (np.arange(height) + 0.5)) / view.fy
    length: F64Array = np.sqrt((x * x)[None, :] + (y * y)[:, None] + 1.0)
    return length


def _convert(
    convert: Callable[..., None],
    name: str,
    values: F64Array,
    format: str,
    projection: str,
    arguments: dict[str, F64Array],
    empty: float | None,
) -> F64Array:
    """`convert` over values and arguments broadcast together; empty: as its driver takes it."""
    shape = common_shape(**{name: values.shape}, **{k: v.shape for k, v in arguments.items()})
    out = np.empty(shape)
    convert(
        _CODE[format],
        projection == "orthographic",
        flat(values, shape),
        *(flat(arguments[key], shape) for key in ("near", "far", "constant", "ray_length")),
        empty is not None,
        0.0 if empty is None else empty,
        out.reshape(-1),
    )
    return out


def _like(value: float, device: npt.ArrayLike) -> float:
    """The value as device's own type holds it: 1e10 in a float32 file is not 1e10 in float64."""
    kind = np.asarray(device).dtype
    if kind.kind != "f":
        return float(value)
    with np.errstate(over="ignore", under="ignore"):
        return float(np.asarray(value).astype(kind))


def _arguments(
    format: str,
    projection: str,
    near: npt.ArrayLike | None,
    far: npt.ArrayLike | None,
    constant: npt.ArrayLike | None,
    ray_length: npt.ArrayLike | None,
) -> dict[str, F64Array]:
    """The four numbers of a format, checked; 1 where it does not use them."""
    if format not in get_args(DepthFormat):
        raise MathsError(
            f"format is '{format}'; expected {', '.join(get_args(DepthFormat))}: ask the "
            "renderer, a depth image does not say"
        )
    if projection not in get_args(Projection):
        raise MathsError(f"projection is '{projection}'; expected perspective or orthographic")
    needed = {
        "near": format in _NEAR_AND_FAR,
        "far": format in _NEAR_AND_FAR or format == "logarithmic",
        "constant": format == "logarithmic",
        "ray_length": format == "distance",
    }
    given = {"near": near, "far": far, "constant": constant, "ray_length": ray_length}
    out = {}
    for name, value in given.items():
        if not needed[name] and name not in ("near", "far") and value is not None:
            raise MathsError(f"format '{format}' takes no {name}; expected none")
        if needed[name] and value is None:
            raise MathsError(f"format '{format}' needs {name}; it cannot be guessed from the image")
        out[name] = numbers(value, name) if needed[name] else np.ones(())
    bounded = format in ("logarithmic", "logarithmic_near") or projection == "orthographic"
    for name, array in out.items():
        good = array > 0.0
        if name != "far" or (bounded and needed["far"]):
            good &= np.isfinite(array)
        if not good.all():
            what = "a number > 0" if name == "far" and not bounded else "a finite number > 0"
            raise MathsError(f"{name} is {array[~good].flat[0]}; expected {what}")
    if needed["near"]:
        common_shape(near=out["near"].shape, far=out["far"].shape)
        low, high = np.broadcast_arrays(out["near"], out["far"])
        if not (low < high).all():
            at = ~(low < high)
            raise MathsError(f"near {low[at].flat[0]}, far {high[at].flat[0]}; expected near < far")
    return out


@driver(parallel=False)
def _decode_all(
    code: int, orthographic: bool, device: Any, near: Any, far: Any, constant: Any, ray_length: Any,
    has_empty: bool, empty: float, out: Any,
) -> None:  # fmt: skip
    for i in range(device.shape[0]):
        d = device[i]
        if has_empty and (d == empty or (np.isnan(d) and np.isnan(empty))):
            out[i] = np.inf
        else:
            out[i] = formats.decode_depth(
                code, orthographic, d, near[i], far[i], constant[i], ray_length[i]
            )


@driver(parallel=False)
def _encode_all(
    code: int, orthographic: bool, depth: Any, near: Any, far: Any, constant: Any, ray_length: Any,
    has_empty: bool, empty: float, out: Any,
) -> None:  # fmt: skip
    for i in range(depth.shape[0]):
        if has_empty and depth[i] == np.inf:
            out[i] = empty
        else:
            out[i] = formats.encode_depth(
                code, orthographic, depth[i], near[i], far[i], constant[i], ray_length[i]
            )


# form: format, projection, what the function takes after the depth, bounds both ways.
_FORMS: dict[str, tuple[DepthFormat, Projection, tuple[str, ...], float, float]] = {
    "gl_ndc": ("gl_ndc", "perspective", ("near", "far"), 5.0, 6.0),
    "d3d": ("d3d", "perspective", ("near", "far"), 5.0, 5.0),
    "reversed": ("reversed", "perspective", ("near", "far"), 4.0, 5.0),
    "gl_ndc_infinite": ("gl_ndc", "perspective", ("near",), 2.0, 4.0),
    "d3d_infinite": ("d3d", "perspective", ("near",), 2.0, 2.0),
    "reversed_infinite": ("reversed", "perspective", ("near",), 1.0, 1.0),
    "gl_ndc_orthographic": ("gl_ndc", "orthographic", ("near", "far"), 3.0, 4.0),
    "d3d_orthographic": ("d3d", "orthographic", ("near", "far"), 3.0, 3.0),
    "reversed_orthographic": ("reversed", "orthographic", ("near", "far"), 3.0, 3.0),
    "logarithmic": ("logarithmic", "perspective", ("far", "constant"), 6.0, 8.0),
    "logarithmic_near": ("logarithmic_near", "perspective", ("near", "far"), 4.0, 8.0),
    "negative_z": ("negative_z", "perspective", (), 0.0, 0.0),
    "distance": ("distance", "perspective", ("ray_length",), 1.0, 1.0),
}
_WHY = {
    "perspective": "r = n/f, 1 - r, e, their fused sum and the last division round once each, all "
    "terms positive; encoding two differences, two quotients, a product; e is exact where reversed",
    "infinite": "1 - d and a quotient; reversed: the quotient alone",
    "orthographic": "t, f - n and the fused sum; encoding two differences and a quotient",
    "logarithmic": "log2(1 + x), 2^x - 1 within 4 u (depth/logarithmic.py); the exponent's error "
    "is multiplied by the condition number",
    "logarithmic_near": "far/near, pow 0.65 ulp, product; encoding two logarithms within 4 u",
    "negative_z": "a sign",
    "distance": "one division or product",
}


def _why(form: str) -> str:
    for key in ("infinite", "orthographic"):
        if form.endswith(key):
            return _WHY[key]
    return _WHY.get(form, _WHY["perspective"])


def _of_arrays(decode: bool, form: str) -> Any:
    """`linear_depth` or `device_depth` of one form, with positional arrays only."""
    format, projection, names, _, _ = _FORMS[form]
    function = linear_depth if decode else device_depth
    infinite = {"far": np.inf} if form.endswith("infinite") else {}

    def call(depth: npt.ArrayLike, *rest: npt.ArrayLike) -> F64Array:
        arguments: Any = dict(zip(names, rest, strict=True)) | infinite
        return function(depth, format, projection=projection, **arguments)

    return call


KERNELS: tuple[KernelInfo, ...] = tuple(
    KernelInfo(
        name="linear_depth" if decode else "device_depth",
        form=form,
        function=_of_arrays(decode, form),
        measure="component" if row[3] else "exact",
        bound=row[3] if decode else row[4],
        why=_why(form),
        source="depth/formats.py",
    )
    for decode in (True, False)
    for form, row in _FORMS.items()
)

"""Cameras of the pinhole and orthographic families, and the pixel's ray.

View space is right-handed and looks down −Z. A projection is normalised once, on entry, so that
clip w is the view depth (orthographic: w = 1); nothing later knows how it was given. Inside:

    perspective   ndc_x = (P00·x + P02·z) / d     ndc_y = (P11·y + P12·z) / d     d = −z
    orthographic  ndc_x = P00·x + P03             ndc_y = P11·y + P13
    px = W/2 + ndc_x·W/2 = cx + fx·x/d            py = H/2 − ndc_y·H/2 = cy − fy·y/d
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from . import transforms
from ._jit import kernel
from .errors import CameraError, SettingsError
from .typed import F64Array, Size
from .vecmath.vec import Vec3

MAX_SIDE = 16384
RIGID_TOLERANCE = 1e-5
"""How far RᵀR may be from the identity: float32 files hold rotations to about 1e-7."""


class ViewParams(NamedTuple):
    """What kernels know of a camera and an image; see the module's docstring for the letters."""

    perspective: bool
    width: int
    height: int
    p00: float
    p11: float
    offset_x: float  # P02 (perspective) or P03 (orthographic)
    offset_y: float  # P12 or P13
    fx: float  # pixels, W/2·P00
    fy: float
    cx: float  # pixel coordinates of the view axis
    cy: float
    inverse_fx: float  # 1/fx
    inverse_fy: float
    near: float
    far: float
    # The columns of world_from_view: right, up, back, eye. Scalars, because a parallel loop can
    # take a tuple of numbers but not a tuple of tuples.
    right_x: float
    right_y: float
    right_z: float
    up_x: float
    up_y: float
    up_z: float
    back_x: float
    back_y: float
    back_z: float
    eye_x: float
    eye_y: float
    eye_z: float
    mirrored: bool = False  # the columns are left-handed: a front face winds the other way


@kernel
def to_view(view: ViewParams, p_ws: Vec3) -> Vec3:
    """R·(p − eye): subtract, then rotate, so a scene moved on its grid keeps every bit."""
    x = p_ws.x - view.eye_x
    y = p_ws.y - view.eye_y
    z = p_ws.z - view.eye_z
    return Vec3(
        view.right_x * x + view.right_y * y + view.right_z * z,
        view.up_x * x + view.up_y * y + view.up_z * z,
        view.back_x * x + view.back_y * y + view.back_z * z,
    )


@kernel
def rotate_to_view(view: ViewParams, d_ws: Vec3) -> Vec3:
    """A direction from world to view space."""
    return Vec3(
        view.right_x * d_ws.x + view.right_y * d_ws.y + view.right_z * d_ws.z,
        view.up_x * d_ws.x + view.up_y * d_ws.y + view.up_z * d_ws.z,
        view.back_x * d_ws.x + view.back_y * d_ws.y + view.back_z * d_ws.z,
    )


@kernel
def clip_xyw(view: ViewParams, p_vs: Vec3) -> Vec3:
    """Clip coordinates (x, y, w) of a view-space point; w = depth, or 1 if orthographic."""
    if view.perspective:
        return Vec3(
            view.p00 * p_vs.x + view.offset_x * p_vs.z,
            view.p11 * p_vs.y + view.offset_y * p_vs.z,
            -p_vs.z,
        )
    return Vec3(view.p00 * p_vs.x + view.offset_x, view.p11 * p_vs.y + view.offset_y, 1.0)


@kernel
def ray_through(view: ViewParams, px: float, py: float) -> Vec3:
    """View direction with z = −1 through pixel coordinates (px, py); orthographic: (0, 0, −1)."""
    if view.perspective:
        return Vec3((px - view.cx) / view.fx, (view.cy - py) / view.fy, -1.0)
    return Vec3(0.0, 0.0, -1.0)


@kernel
def point_at(view: ViewParams, px: float, py: float, depth: float) -> Vec3:
    """View-space point of view depth `depth` seen at pixel coordinates (px, py)."""
    x = (px - view.cx) / view.fx
    y = (view.cy - py) / view.fy
    if view.perspective:
        return Vec3(x * depth, y * depth, -depth)
    return Vec3(x, y, -depth)


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A camera: `clip = clip_from_view · view_from_world · p`.

    world_from_view : (4, 4) float64, rigid; its last column is the eye.
    clip_from_view : (4, 4) float64, normalised, OpenGL clip range [−1, 1], y up.
    near, far : view depths, 0 < near < far, far may be inf.

    Make one with `perspective`, `physical`, `frustum`, `orthographic`, `from_matrices` or
    `from_json`. Each raises CameraError for what cannot be represented.
    """

    world_from_view: F64Array
    clip_from_view: F64Array
    near: float
    far: float = np.inf

    def __post_init__(self) -> None:
        world = np.array(self.world_from_view, np.float64)
        clip = np.array(self.clip_from_view, np.float64)
        _check_rigid(world)
        _check_range(self.near, self.far)
        _check_projection(clip)
        for array in (world, clip):
            array.setflags(write=False)
        object.__setattr__(self, "world_from_view", world)
        object.__setattr__(self, "clip_from_view", clip)
        object.__setattr__(self, "near", float(self.near))
        object.__setattr__(self, "far", float(self.far))

    @property
    def is_perspective(self) -> bool:
        """False for an orthographic camera."""
        return bool(self.clip_from_view[3, 2] != 0.0)

    @staticmethod
    def frustum(
        world_from_view: F64Array,
        left: float,
        right: float,
        bottom: float,
        top: float,
        *,
        near: float,
        far: float = np.inf,
    ) -> Camera:
        """A perspective camera from the edges of its image at depth 1; off-axis allowed."""
        _check_range(near, far)
        _check_edges(left, right, bottom, top)
        m = np.zeros((4, 4))
        m[0, 0] = 2.0 / (right - left)
        m[1, 1] = 2.0 / (top - bottom)
        m[0, 2] = (right + left) / (right - left)
        m[1, 2] = (top + bottom) / (top - bottom)
        m[2, 2], m[2, 3] = _gl_depth_row(near, far)
        m[3, 2] = -1.0
        return Camera(world_from_view, m, near, far)

    @staticmethod
    def perspective(
        world_from_view: F64Array,
        fov_y_degrees: float,
        aspect: float,
        *,
        near: float,
        far: float = np.inf,
    ) -> Camera:
        """A symmetric perspective camera; fov_y is the whole vertical angle, aspect = W/H."""
        if not (np.isfinite(fov_y_degrees) and 0.0 < fov_y_degrees < 180.0):
            raise CameraError(
                f"field of view {fov_y_degrees:g} degrees; expected more than 0 and less than 180"
            )
        from .vecmath.elementary import tan_host

        top = float(tan_host(float(fov_y_degrees) * (np.pi / 360.0)))
        return Camera.frustum(
            world_from_view, -top * aspect, top * aspect, -top, top, near=near, far=far
        )

    @staticmethod
    def physical(
        world_from_view: F64Array,
        focal_length: float,
        sensor_height: float,
        aspect: float,
        *,
        near: float,
        far: float = np.inf,
    ) -> Camera:
        """A perspective camera from focal length and sensor height in the same unit (mm)."""
        for name, value in (("focal length", focal_length), ("sensor height", sensor_height)):
            if not (np.isfinite(value) and value > 0.0):
                raise CameraError(f"{name} {value:g}; expected a finite number above 0")
        top = float(sensor_height) / (2.0 * float(focal_length))
        return Camera.frustum(
            world_from_view, -top * aspect, top * aspect, -top, top, near=near, far=far
        )

    @staticmethod
    def orthographic(
        world_from_view: F64Array,
        height: float,
        aspect: float,
        *,
        near: float,
        far: float = np.inf,
    ) -> Camera:
        """A parallel projection; height is the image's height in scene units."""
        if not (np.isfinite(height) and height > 0.0):
            raise CameraError(f"orthographic height {height:g}; expected a finite number above 0")
        _check_range(near, far)
        _check_edges(-height * aspect, height * aspect, -height, height)
        m = np.zeros((4, 4))
        m[0, 0] = 2.0 / (height * aspect)
        m[1, 1] = 2.0 / height
        if np.isinf(far):  # no finite matrix maps an infinite range linearly: depth row unused
            m[2, 2], m[2, 3] = 0.0, 0.0
        else:
            m[2, 2], m[2, 3] = -2.0 / (far - near), -(far + near) / (far - near)
        m[3, 3] = 1.0
        return Camera(world_from_view, m, near, far)

    @staticmethod
    def from_matrices(
        world_from_view: F64Array,
        clip_from_view: F64Array,
        *,
        near: float,
        far: float = np.inf,
        y: str = "up",
    ) -> Camera:
        """A camera from matrices of any clip-depth range; `y` says where clip y points.

        The depth row is rebuilt from near and far, so OpenGL, Direct3D and reversed ranges are all
        accepted. Scaled projection matrices are normalised. Raises CameraError that names the
        element for a shear, an oblique near plane, a singular or a mirrored projection.
        """
        if y not in ("up", "down"):
            raise CameraError(f"y is '{y}'; expected 'up' or 'down'")
        _check_range(near, far)
        m = np.array(clip_from_view, np.float64)
        _check_shape(m, "clip_from_view")
        if y == "down":
            m[1] = -m[1]
        scale = -m[3, 2] if m[3, 2] != 0.0 else m[3, 3]
        if not (np.isfinite(scale) and scale != 0.0):
            raise CameraError(
                "clip_from_view[3] is all zero or not finite; expected [0, 0, -1, 0] (perspective) "
                "or [0, 0, 0, 1] (orthographic)"
            )
        m = m / scale
        if m[3, 2] != 0.0:
            m[2, 2:] = _gl_depth_row(near, far)
        elif np.isinf(far):
            m[2, 2:] = 0.0
        else:
            m[2, 2:] = (-2.0 / (far - near), -(far + near) / (far - near))
        return Camera(world_from_view, m, near, far)

    def jittered(self, dx: float, dy: float, size: Size) -> Camera:
        """The same camera with every sample moved by (dx, dy) pixels, x right and y down."""
        if not (np.isfinite(dx) and np.isfinite(dy)):
            raise CameraError(f"jitter ({dx}, {dy}); expected two finite numbers of pixels")
        width, height = check_size(size)
        m = np.array(self.clip_from_view)
        # The sample at the pixel's centre must see what lay (dx, dy) pixels away before.
        if self.is_perspective:
            m[0, 2] += 2.0 * dx / width
            m[1, 2] -= 2.0 * dy / height
        else:
            m[0, 3] -= 2.0 * dx / width
            m[1, 3] += 2.0 * dy / height
        return replace(self, clip_from_view=m)

    def params(self, size: Size) -> ViewParams:
        """The numbers that kernels use, for an image of (W, H) pixels."""
        width, height = check_size(size)
        m, world = self.clip_from_view, self.world_from_view
        persp = self.is_perspective
        half_w, half_h = width / 2.0, height / 2.0
        offset_x = float(m[0, 2] if persp else m[0, 3])
        offset_y = float(m[1, 2] if persp else m[1, 3])
        sign = -1.0 if persp else 1.0
        fx, fy = half_w * float(m[0, 0]), half_h * float(m[1, 1])
        columns = {
            f"{name}_{axis}": float(world[i, j])
            for j, name in enumerate(("right", "up", "back", "eye"))
            for i, axis in enumerate("xyz")
        }
        return ViewParams(
            perspective=persp,
            width=width,
            height=height,
            p00=float(m[0, 0]),
            p11=float(m[1, 1]),
            offset_x=offset_x,
            offset_y=offset_y,
            fx=fx,
            fy=fy,
            cx=half_w + sign * half_w * offset_x,
            cy=half_h - sign * half_h * offset_y,
            inverse_fx=1.0 / fx,
            inverse_fy=1.0 / fy,
            near=self.near,
            far=self.far,
            mirrored=False,
            **columns,
        )

    def to_json(self) -> dict[str, Any]:
        """Matrices row by row, decimal with their hexadecimal twin; far is null if infinite."""
        return {
            "type": "perspective" if self.is_perspective else "orthographic",
            "near": self.near,
            "far": None if np.isinf(self.far) else self.far,
            "world_from_view": self.world_from_view.tolist(),
            "world_from_view_hex": _hex_rows(self.world_from_view),
            "clip_from_view": self.clip_from_view.tolist(),
            "clip_from_view_hex": _hex_rows(self.clip_from_view),
            "clip_range": "z in [-1, 1] (OpenGL), y up, w = view depth",
        }

    @staticmethod
    def from_json(data: Any) -> Camera:
        """A camera from `to_json`'s dictionary. Raises CameraError naming the element."""
        _check_object(data)
        world = _matrix_from_json(data, "world_from_view")
        clip = _matrix_from_json(data, "clip_from_view")
        near, far = data.get("near"), data.get("far")
        if not isinstance(near, int | float) or isinstance(near, bool):
            raise CameraError(f"camera 'near' is {near}; expected a number above 0")
        if far is not None and (not isinstance(far, int | float) or isinstance(far, bool)):
            raise CameraError(f"camera 'far' is {far}; expected a number above near, or null")
        return Camera(world, clip, float(near), np.inf if far is None else float(far))


def _check_object(data: Any) -> None:
    if not isinstance(data, dict):
        raise CameraError(f"camera is a {type(data).__name__}; expected a JSON object")


def _hex_rows(m: F64Array) -> list[list[str]]:
    return [[float(v).hex() for v in row] for row in m]


def _matrix_from_json(data: Any, name: str) -> F64Array:
    rows = data.get(name)
    try:
        m = np.array(rows, np.float64)
    except (TypeError, ValueError):
        raise CameraError(f"camera '{name}' is {rows}; expected 4 rows of 4 numbers") from None
    _check_shape(m, name)
    twin = data.get(name + "_hex")
    if twin is not None:
        try:
            exact = np.array([[float.fromhex(v) for v in row] for row in twin])
        except (TypeError, ValueError):
            raise CameraError(
                f"camera '{name}_hex' is {twin}; expected 4 rows of 4 hexadecimal numbers"
            ) from None
        if exact.shape != m.shape or not np.array_equal(exact, m):
            raise CameraError(
                f"camera '{name}' and '{name}_hex' differ; expected the same numbers: remove the "
                "one that is out of date"
            )
    return m


def _check_shape(m: F64Array, name: str) -> None:
    if m.shape != (4, 4):
        raise CameraError(f"{name} has shape {m.shape}; expected (4, 4)")


def _check_range(near: float, far: float) -> None:
    if not (np.isfinite(near) and near > 0.0):
        raise CameraError(f"near is {near:g}; expected a finite number above 0")
    if not far > near:
        raise CameraError(f"near {near:g} and far {far:g}; expected near < far (far may be inf)")


def _check_edges(left: float, right: float, bottom: float, top: float) -> None:
    edges = (left, right, bottom, top)
    if not (all(np.isfinite(v) for v in edges) and left < right and bottom < top):
        raise CameraError(f"image edges {edges}; expected finite left < right and bottom < top")


def _gl_depth_row(near: float, far: float) -> tuple[float, float]:
    if np.isinf(far):
        return -1.0, -2.0 * near
    return -(far + near) / (far - near), -2.0 * far * near / (far - near)


def _check_rigid(m: F64Array) -> None:
    _check_shape(m, "world_from_view")
    for i in range(4):
        for j in range(4):
            if not np.isfinite(m[i, j]):
                raise CameraError(f"world_from_view[{i}][{j}] is {m[i, j]}; expected finite")
    if tuple(m[3]) != (0.0, 0.0, 0.0, 1.0):
        raise CameraError(
            f"world_from_view[3] is {m[3].tolist()}; expected [0, 0, 0, 1]: give the camera's pose "
            "row-major, acting on column vectors"
        )
    for i in range(3):
        for j in range(3):
            product = m[0, i] * m[0, j] + m[1, i] * m[1, j] + m[2, i] * m[2, j]
            if abs(product - (1.0 if i == j else 0.0)) > RIGID_TOLERANCE:
                raise CameraError(
                    f"world_from_view columns {i} and {j} have the dot product {product:.6g}; "
                    "expected a rotation: remove scale and shear"
                )
    if transforms.determinant3(m) < 0.0:
        raise CameraError("world_from_view mirrors (determinant -1); expected a right-handed pose")


def _check_projection(m: F64Array) -> None:
    """Only the elements of a pinhole or orthographic matrix may be set; name the one that is."""
    _check_shape(m, "clip_from_view")
    if tuple(m[3]) == (0.0, 0.0, -1.0, 0.0):
        free, family = {(0, 0), (1, 1), (0, 2), (1, 2), (2, 2), (2, 3), (3, 2)}, "perspective"
    elif tuple(m[3]) == (0.0, 0.0, 0.0, 1.0):
        free, family = {(0, 0), (1, 1), (0, 3), (1, 3), (2, 2), (2, 3), (3, 3)}, "orthographic"
    else:
        raise CameraError(
            f"clip_from_view[3] is {m[3].tolist()}; expected [0, 0, -1, 0] (perspective) or "
            "[0, 0, 0, 1] (orthographic)"
        )
    what = {(2, 0): "an oblique near plane", (2, 1): "an oblique near plane", (0, 1): "a shear"}
    for i in range(4):
        for j in range(4):
            if not np.isfinite(m[i, j]):
                raise CameraError(f"clip_from_view[{i}][{j}] is {m[i, j]}; expected finite")
            if (i, j) not in free and m[i, j] != 0.0:
                reason = what.get((i, j), what.get((j, i), "a general matrix"))
                raise CameraError(
                    f"clip_from_view[{i}][{j}] is {m[i, j]:g} ({reason}); expected 0 in a "
                    f"{family} projection"
                )
    for i in range(2):
        if not m[i, i] > 0.0:
            raise CameraError(
                f"clip_from_view[{i}][{i}] is {m[i, i]:g}; expected above 0 (0 is singular, below "
                "0 mirrors the image: give y='down' for a y-down clip space)"
            )


def check_size(size: Sequence[int]) -> Size:
    """(W, H) as ints, each 1 to 16384; raises SettingsError otherwise."""
    try:
        width, height = (int(v) for v in size)
        exact = all(int(v) == v for v in size)
    except (TypeError, ValueError):
        raise SettingsError(f"size {size}; expected two whole numbers, W and H") from None
    if not exact or not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise SettingsError(f"size {size[0]}x{size[1]}; expected 1 to {MAX_SIDE} each way")
    return width, height


def look_at(
    eye: Sequence[float], target: Sequence[float], up: Sequence[float] = (0.0, 1.0, 0.0)
) -> F64Array:
    """world_from_view of a camera at `eye` that looks at `target`; raises CameraError if
    they coincide or the view is along `up`.
    """
    back = transforms.normalized3([float(e) - float(t) for e, t in zip(eye, target)])
    if not np.isfinite(back[0]):
        raise CameraError(f"eye {list(eye)} and target {list(target)}; expected two finite points")
    right_raw = transforms.cross3(transforms.normalized3(up), back)
    right = transforms.normalized3(right_raw)
    largest = max(abs(v) for v in right_raw)
    if not (np.isfinite(right[0]) and largest > 1e-9):
        raise CameraError(f"up {list(up)} is zero or along the view; expected another direction")
    out = transforms.identity()
    out[:3, 0] = right
    out[:3, 1] = transforms.normalized3(transforms.cross3(back, right))
    out[:3, 2] = back
    out[:3, 3] = [float(e) for e in eye]
    return out


@dataclass(frozen=True, slots=True)
class View:
    """Where to look from, before image size and scene scale are known; makes a `Camera`.

    One of fov_y_degrees, focal_length with sensor_height, or orthographic_height sets the lens.
    near None: 2⁻¹⁰ of the scene's radius.
    """

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    fov_y_degrees: float | None = None
    focal_length: float | None = None
    sensor_height: float = 24.0
    orthographic_height: float | None = None
    near: float | None = None
    far: float = np.inf
    jitter: tuple[float, float] = field(default=(0.0, 0.0))

    def camera(self, size: Size, default_near: float) -> Camera:
        """The camera for an image of (W, H) square pixels."""
        width, height = check_size(size)
        aspect = width / height
        pose = look_at(self.eye, self.target, self.up)
        near = default_near if self.near is None else self.near
        given = [
            v is not None for v in (self.fov_y_degrees, self.focal_length, self.orthographic_height)
        ]
        if sum(given) > 1:
            raise CameraError(
                "a view has more than one of fov_y_degrees, focal_length and orthographic_height; "
                "expected one"
            )
        if self.orthographic_height is not None:
            made = Camera.orthographic(
                pose, self.orthographic_height, aspect, near=near, far=self.far
            )
        elif self.focal_length is not None:
            made = Camera.physical(
                pose, self.focal_length, self.sensor_height, aspect, near=near, far=self.far
            )
        else:
            fov = 40.0 if self.fov_y_degrees is None else self.fov_y_degrees
            made = Camera.perspective(pose, fov, aspect, near=near, far=self.far)
        dx, dy = self.jitter
        return made if (dx, dy) == (0.0, 0.0) else made.jittered(dx, dy, size)

    @staticmethod
    def from_json(data: Any) -> View:
        """A view from a dictionary with the field's names. Raises CameraError naming the key."""
        _check_object(data)
        names = set(View.__dataclass_fields__)
        unknown = set(data) - names
        if unknown:
            raise CameraError(
                f"camera has the unknown key '{sorted(unknown)[0]}'; expected the matrices of a "
                f"camera.json or some of {', '.join(sorted(names))}"
            )
        values = dict(data)
        try:
            for key in ("eye", "target", "up"):
                if key in values:
                    x, y, z = (float(v) for v in values[key])
                    values[key] = (x, y, z)
            if "jitter" in values:
                x, y = (float(v) for v in values["jitter"])
                values["jitter"] = (x, y)
            for key in names - {"eye", "target", "up", "jitter"}:
                if values.get(key) is not None:
                    values[key] = float(values[key])
            if values.get("far", 0.0) is None:
                values["far"] = np.inf
            return View(**values)
        except (TypeError, ValueError) as error:
            raise CameraError(
                f"camera cannot be read ({error}); expected at least eye: [x, y, z] and "
                "target: [x, y, z]"
            ) from None

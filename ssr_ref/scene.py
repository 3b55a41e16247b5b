"""What is rendered: meshes in their own space, instances, materials, lights. Data only.

Positions stay float32 as files hold them; a node's world transform is float64. An *object* is one
node: one mesh instance with all its primitives.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from . import transforms
from .errors import SceneError
from .texture import Image, Texture
from .typed import F32Array, F64Array, I32Array, Rgb

if TYPE_CHECKING:
    from .camera import View

SINGULAR = 1e-12
"""A transform is singular if |det| is at most this share of the product of its column lengths."""


def _rgb(value: Any, name: str, low: float = 0.0) -> Rgb:
    numbers = [float(v) for v in value]
    if len(numbers) != 3 or not all(np.isfinite(v) and v >= low for v in numbers):
        bound = "" if low == -np.inf else f", none below {low:g}"
        raise SceneError(f"{name} is {value}; expected three finite numbers{bound}")
    return (numbers[0], numbers[1], numbers[2])


@dataclass(frozen=True, slots=True)
class Material:
    """A metallic-roughness material, linear RGB.

    R, the share of the reflection, is `metallic · base_color` unless `reflectivity` is given.
    Textures multiply their factors: base colour and emission by the decoded sRGB image, alpha by
    the image's alpha, roughness by green and metallic by blue of the linear one.
    alpha_cutoff: where alpha (factor · texture · vertex) is below it nothing is drawn; None:
    opaque, whatever the alpha. unlit: radiance is the base colour. thickness: of the solid behind a
    pixel for `thickness_from = "material"`, scene units, may be inf; None: the setting's.
    """

    name: str = "material"
    base_color: Rgb = (0.8, 0.8, 0.8)
    metallic: float = 0.0
    roughness: float = 0.5
    emissive: Rgb = (0.0, 0.0, 0.0)
    reflectivity: Rgb | None = None
    double_sided: bool = False
    alpha: float = 1.0
    alpha_cutoff: float | None = None
    unlit: bool = False
    base_color_texture: Texture | None = None
    metallic_roughness_texture: Texture | None = None
    emissive_texture: Texture | None = None
    thickness: float | None = None

    def __post_init__(self) -> None:
        for name in ("base_color", "emissive", "reflectivity"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _rgb(value, f"{self.name}: {name}"))
        for name in ("metallic", "roughness", "alpha", "alpha_cutoff"):
            if getattr(self, name) is None:
                continue
            number = float(getattr(self, name))
            if not (np.isfinite(number) and number >= 0.0):
                raise SceneError(
                    f"material '{self.name}' has {name} {number:g}; expected a finite number of 0 "
                    "or more"
                )
            object.__setattr__(self, name, number)
        if self.thickness is not None:
            if not float(self.thickness) >= 0.0:
                raise SceneError(
                    f"material '{self.name}' has thickness {self.thickness:g}; expected 0 or more"
                )
            object.__setattr__(self, "thickness", float(self.thickness))
        object.__setattr__(self, "double_sided", bool(self.double_sided))
        object.__setattr__(self, "unlit", bool(self.unlit))

    @property
    def textures(self) -> tuple[Texture | None, Texture | None, Texture | None]:
        """Base colour, metallic-roughness, emission."""
        return (self.base_color_texture, self.metallic_roughness_texture, self.emissive_texture)


@dataclass(frozen=True, slots=True, eq=False)
class Primitive:
    """Triangles with one material.

    positions (n, 3) float32 in mesh space; faces (m, 3) int32, counter-clockwise seen from
    outside; normals (n, 3) float32 or None for flat shading; colors (n, 3) float32 linear RGB that
    multiplies the base colour, or None; uv0, uv1 (n, 2) float32 texture coordinates or None, v
    down; alphas (n,) float32 that multiplies alpha, or None.
    """

    positions: F32Array
    faces: I32Array
    material: int = 0
    normals: F32Array | None = None
    colors: F32Array | None = None
    uv0: F32Array | None = None
    uv1: F32Array | None = None
    alphas: F32Array | None = None

    def __post_init__(self) -> None:
        positions = _frozen(self.positions, np.float32, "positions")
        faces = _frozen(self.faces, np.int32, "faces")
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "faces", faces)
        if len(faces) and (faces.min() < 0 or faces.max() >= len(positions)):
            raise SceneError(
                f"a face refers to vertex {faces.min() if faces.min() < 0 else faces.max()} of "
                f"{len(positions)}; expected 0 to {len(positions) - 1}: fix the indices"
            )
        for name, columns in (("normals", 3), ("colors", 3), ("uv0", 2), ("uv1", 2), ("alphas", 0)):
            value = getattr(self, name)
            if value is None:
                continue
            array = _frozen(value, np.float32, name, columns)
            if len(array) != len(positions):
                raise SceneError(
                    f"{len(array)} {name} for {len(positions)} vertices; expected one for each"
                )
            object.__setattr__(self, name, array)


def _frozen(value: Any, dtype: Any, name: str, columns: int = 3) -> Any:
    """A read-only C-contiguous (n, columns) copy, so that neither side can change the other.

    columns 0: an (n,) array.
    """
    array = np.array(value, dtype=dtype, order="C", copy=True)
    expected = (columns,) if columns else ()
    if array.size == 0:
        array = array.reshape(0, *expected)
    if array.shape[1:] != expected:
        shape = f"(n, {columns})" if columns else "(n,)"
        raise SceneError(f"{name} has shape {array.shape}; expected {shape}")
    array.setflags(write=False)
    return array


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A named list of primitives."""

    name: str
    primitives: tuple[Primitive, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """One instance of a mesh. world_from_mesh: (4, 4) float64, affine, not singular."""

    name: str
    mesh: int
    world_from_mesh: F64Array = field(default_factory=transforms.identity)


@dataclass(frozen=True, slots=True)
class DirectionalLight:
    """A light infinitely far away.

    direction_ws: the way the light travels (any length). color: linear RGB radiance that a white
    diffuse surface facing the light reflects, that is irradiance / π.
    """

    direction_ws: tuple[float, float, float]
    color: Rgb = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        direction = _rgb(self.direction_ws, "light direction", low=-np.inf)
        if not np.isfinite(transforms.normalized3(direction)[0]):
            raise SceneError(
                f"light direction {self.direction_ws}; expected three finite numbers, not all zero"
            )
        object.__setattr__(self, "direction_ws", direction)
        object.__setattr__(self, "color", _rgb(self.color, "light color"))


@dataclass(frozen=True, slots=True)
class Lights:
    """Ambient radiance of a white surface (linear RGB) and directional lights."""

    ambient: Rgb = (0.25, 0.25, 0.25)
    directional: tuple[DirectionalLight, ...] = (
        DirectionalLight((-0.5, -1.0, -0.35), (0.7, 0.7, 0.7)),
        DirectionalLight((0.6, -0.4, -0.7), (0.2, 0.2, 0.25)),
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "ambient", _rgb(self.ambient, "ambient"))

    def to_json(self) -> dict[str, Any]:
        """A dictionary that `from_json` reads back exactly."""
        return {
            "ambient": list(self.ambient),
            "directional": [
                {"direction_ws": list(light.direction_ws), "color": list(light.color)}
                for light in self.directional
            ],
        }

    @staticmethod
    def from_json(data: Any) -> Lights:
        """Lights from `to_json`'s dictionary; raises SceneError for anything else."""
        try:
            unknown = set(data) - {"ambient", "directional"}
            if unknown:
                raise SceneError(
                    f"lights have the unknown key '{sorted(unknown)[0]}'; expected 'ambient' and "
                    "'directional'"
                )
            return Lights(
                ambient=data["ambient"],
                directional=tuple(
                    DirectionalLight(light["direction_ws"], light["color"])
                    for light in data["directional"]
                ),
            )
        except (KeyError, TypeError) as error:
            raise SceneError(
                f"lights are incomplete ({error}); expected 'ambient': [r, g, b] and 'directional':"
                " a list of {'direction_ws': [x, y, z], 'color': [r, g, b]}"
            ) from None


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadReport:
    """What a loader made of a file.

    triangles : kept, each mesh once. degenerate, non_finite : kept triangles that cannot be seen:
    two corners in one place, or a NaN or infinite coordinate. skipped : what was left out and why,
    counted. fallbacks : materials that fell back to their factors or the default, by name.
    unsupported : features of the file that are not drawn, by name. textures : (name, W, H).
    generated_normals : primitives whose normals the loader made.
    """

    format: str
    triangles: int = 0
    degenerate: int = 0
    non_finite: int = 0
    skipped: tuple[str, ...] = ()
    fallbacks: tuple[str, ...] = ()
    unsupported: tuple[str, ...] = ()
    textures: tuple[tuple[str, int, int], ...] = ()
    generated_normals: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Everything that is drawn, with lights and the view it was made for (if any).

    images: what textures refer to. report: the loader's, None for scenes made by code.
    Raises SceneError for an index out of range, a singular transform, or no usable triangle.
    """

    meshes: tuple[Mesh, ...]
    nodes: tuple[Node, ...]
    materials: tuple[Material, ...] = (Material(),)
    lights: Lights = field(default_factory=Lights)
    view: View | None = None
    name: str = "scene"
    notes: tuple[str, ...] = ()
    images: tuple[Image, ...] = ()
    report: LoadReport | None = None

    def __post_init__(self) -> None:
        for material in self.materials:
            for texture in material.textures:
                if texture is not None and not 0 <= texture.image < len(self.images):
                    raise SceneError(
                        f"material '{material.name}' uses image {texture.image} of "
                        f"{len(self.images)}; expected 0 to {len(self.images) - 1}"
                    )
        for mesh in self.meshes:
            for primitive in mesh.primitives:
                if not 0 <= primitive.material < len(self.materials):
                    raise SceneError(
                        f"mesh '{mesh.name}' uses material {primitive.material} of "
                        f"{len(self.materials)}; expected 0 to {len(self.materials) - 1}"
                    )
        for node in self.nodes:
            if not 0 <= node.mesh < len(self.meshes):
                raise SceneError(
                    f"node '{node.name}' uses mesh {node.mesh} of {len(self.meshes)}; expected 0 "
                    f"to {len(self.meshes) - 1}"
                )
            _check_transform(node)
        if self.triangle_count == 0:
            raise SceneError(
                f"scene '{self.name}' has no triangles; expected at least one: point clouds and "
                "curves cannot be drawn"
            )

    @property
    def triangle_count(self) -> int:
        """Triangles drawn, instances counted each time."""
        faces = [sum(len(p.faces) for p in mesh.primitives) for mesh in self.meshes]
        return sum(faces[node.mesh] for node in self.nodes)

    def world_bounds(self) -> tuple[F64Array, F64Array]:
        """Least and greatest finite world position of any face's vertex, two (3,) arrays."""
        low = np.full(3, np.inf)
        high = np.full(3, -np.inf)
        for node in self.nodes:
            for primitive in self.meshes[node.mesh].primitives:
                is_used = np.zeros(len(primitive.positions), np.bool_)
                is_used[primitive.faces] = True  # a sort of all corners takes 10 times as long
                used = primitive.positions[is_used]
                used.setflags(write=False)  # as primitive.positions are: one compiled signature
                points = np.empty((len(used), 3))
                transforms.transform_points(node.world_from_mesh, used, points)
                points = points[np.isfinite(points).all(axis=1)]
                if len(points):
                    low = np.minimum(low, points.min(axis=0))
                    high = np.maximum(high, points.max(axis=0))
        if not np.isfinite(low).all():
            raise SceneError(
                f"scene '{self.name}' has no vertex with finite coordinates (all are NaN or "
                "infinite); expected at least one triangle that can be drawn: repair the file"
            )
        return low, high

    def radius(self) -> float:
        """Half the diagonal of the world bounds, rounded to a power of two (nearest in log)."""
        return radius_of_bounds(*self.world_bounds())

    def with_lights(self, lights: Lights) -> Scene:
        """The same scene under other lights."""
        return replace(self, lights=lights)

    def content_sha256(self) -> str:
        """Hash of everything that is drawn: arrays, transforms, materials, lights (not names)."""
        digest = hashlib.sha256()
        for node in self.nodes:
            digest.update(np.ascontiguousarray(node.world_from_mesh, "<f8").tobytes())
            for primitive in self.meshes[node.mesh].primitives:
                for array in (primitive.positions, primitive.normals, primitive.colors):
                    digest.update(b"none" if array is None else array.astype("<f4").tobytes())
                digest.update(primitive.faces.astype("<i4").tobytes())
                material = self.materials[primitive.material]
                values = [
                    material.base_color,
                    material.metallic,
                    material.roughness,
                    material.emissive,
                    material.reflectivity,
                    material.double_sided,
                ]
                digest.update(json.dumps(values).encode())
                self._update_optional(digest, primitive, material)
        digest.update(json.dumps(self.lights.to_json()).encode())
        return digest.hexdigest()

    def _update_optional(self, digest: Any, primitive: Primitive, material: Material) -> None:
        """Hash what most scenes do not have; what is absent adds nothing."""
        for name in ("uv0", "uv1", "alphas"):
            array = getattr(primitive, name)
            if array is not None:
                digest.update(name.encode() + array.astype("<f4").tobytes())
        extra = [material.alpha, material.alpha_cutoff, material.unlit]
        if extra != [1.0, None, False]:
            digest.update(json.dumps(extra).encode())
        if material.thickness is not None:
            digest.update(f"thickness {material.thickness.hex()}".encode())
        for slot, texture in enumerate(material.textures):
            if texture is not None:
                pixels = self.images[texture.image].pixels
                reading = asdict(texture) | {"image": [slot, pixels.dtype.str, *pixels.shape]}
                digest.update(json.dumps(reading, sort_keys=True).encode())
                digest.update(pixels.astype(pixels.dtype.newbyteorder("<")).tobytes())


def radius_of_bounds(low: F64Array, high: F64Array) -> float:
    """Half the diagonal of bounds, rounded to a power of two (nearest in log); 1 for a point."""
    d = high / 2 - low / 2
    largest = float(d.max())
    if largest == 0.0:
        return 1.0
    d = d / largest
    r = largest * float(np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]))
    mantissa, exponent = np.frexp(r)
    power = int(exponent) if mantissa * mantissa >= 0.5 else int(exponent) - 1
    return float(np.ldexp(1.0, power))


def _check_transform(node: Node) -> None:
    m = np.array(node.world_from_mesh, np.float64)
    if m.shape != (4, 4):
        raise SceneError(f"node '{node.name}' has a {m.shape} transform; expected (4, 4)")
    if not np.isfinite(m).all():
        raise SceneError(f"node '{node.name}' has a NaN or infinite transform; expected finite")
    if tuple(m[3]) != (0.0, 0.0, 0.0, 1.0):
        raise SceneError(
            f"node '{node.name}' has the last row {m[3].tolist()}; expected [0, 0, 0, 1]: only "
            "affine transforms place a mesh"
        )
    # Scaled by a power of two, exactly, so that products of huge or tiny entries stay in range.
    exponent = int(np.frexp(np.abs(m[:3, :3]).max())[1])
    a = m.copy()
    a[:3, :3] = np.ldexp(m[:3, :3], -exponent)
    columns = 1.0
    for j in range(3):
        columns *= float(np.sqrt(a[0, j] * a[0, j] + a[1, j] * a[1, j] + a[2, j] * a[2, j]))
    det = transforms.determinant3(a)
    if not abs(det) > SINGULAR * columns:
        with np.errstate(over="ignore"):
            det = float(np.ldexp(det, 3 * exponent))
        raise SceneError(
            f"node '{node.name}' has a singular transform (determinant {det:.3g}); expected one "
            "that keeps volume: remove the zero scale"
        )
    m.setflags(write=False)
    object.__setattr__(node, "world_from_mesh", m)

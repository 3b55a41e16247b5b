"""Find a scene's flat mirrors: reflective triangles, grouped by plane.

Within an object the largest triangle that is left over gives a plane, all triangles on it join,
and so on; planes of different objects that coincide become one mirror. What is not flat, or what
is shaded as if it were not, is refused with a reason: a plane's image would be wrong there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..raster.attributes import DIELECTRIC_F0
from ..raster.geometry import HAS_NORMALS, Geometry
from ..scene import Scene
from ..typed import BoolArray, F64Array, I32Array, I64Array
from .mirrors import FLAT, PlanarMirror

MAX_MIRRORS = 16
"""Planes of one object; a box has 6, a curved surface has hundreds."""

BENT = 2.0**-20
"""Greatest difference of a unit shading normal from the plane's; float32 normals are to 2⁻²⁴."""

COUNTING_GRID = 4096.0
"""Steps a unit of normals and distances when the planes of a refused object are counted."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why reflective triangles of an object do not become mirrors.

    planes: how many they lie in, about. draws: objects drawn if each plane were a mirror all the
    same. reason: one line.
    """

    object_id: int
    name: str
    triangles: int
    planes: int
    draws: int
    reason: str


class Mirrors(NamedTuple):
    """The mirrors found, that with the largest triangle first, and what was refused."""

    mirrors: tuple[PlanarMirror, ...]
    refused: tuple[Refusal, ...]


class _Candidates(NamedTuple):
    """Reflective triangles, n of them; positions in units of the scene's radius."""

    triangle: I64Array  # (n,) ids, ascending
    corners: F64Array  # (n, 3, 3)
    normal: F64Array  # (n, 3) unit
    area: F64Array  # (n,)


class _Group(NamedTuple):
    """One plane of one object: rows of the candidates, that with the largest area first."""

    object_id: int
    seed: int
    rows: I64Array


def find_mirrors(
    scene: Scene,
    geometry: Geometry,
    *,
    max_roughness: float = 0.5,
    fresnel: bool = False,
    max_mirrors: int = MAX_MIRRORS,
) -> Mirrors:
    """The flat mirrors of a scene; geometry: `flatten(scene)`.

    max_roughness: rougher materials do not reflect. fresnel: dielectrics reflect too. max_mirrors:
    planes of one object above which it counts as curved.
    """
    reflective = reflective_materials(scene, geometry, max_roughness, fresnel)
    radius = scene.radius()
    c = _candidates(geometry, reflective, radius)
    groups: list[_Group] = []
    refused: list[Refusal] = []
    objects = geometry.triangle_object[c.triangle]
    for object_id in np.unique(objects):
        rows = np.flatnonzero(objects == object_id)
        found = _group(c, int(object_id), rows, max_mirrors)
        if found is None:
            refused.append(_curved(scene, c, int(object_id), rows, max_mirrors))
            continue
        for group in found:
            straight = ~_is_bent(geometry, c, group)
            if not straight.all():
                refused.append(_bent(scene, group, int((~straight).sum())))
            if straight.any():
                groups.append(group._replace(rows=group.rows[straight]))
    return Mirrors(_merged(c, groups, radius), tuple(refused))


def reflective_materials(
    scene: Scene, geometry: Geometry, max_roughness: float, fresnel: bool
) -> BoolArray:
    """(nm,) whether any pixel of a material may have R above 0; a map may lower its roughness."""
    own = geometry.own_reflectivity
    has_own = ~np.isnan(own[:, 0])
    f0 = DIELECTRIC_F0 if fresnel else 0.0
    by_metal = geometry.metallic * geometry.base_color.max(axis=1) + f0
    reflects = np.where(has_own, np.nan_to_num(own).max(axis=1), by_metal) > 0.0
    mapped = [m.metallic_roughness_texture is not None for m in scene.materials]
    return np.asarray(reflects & ((geometry.roughness <= max_roughness) | np.array(mapped, bool)))


def _candidates(geometry: Geometry, reflective: BoolArray, radius: float) -> _Candidates:
    """Reflective triangles with an area; radius is a power of two, so the scaling is exact."""
    triangle = np.flatnonzero(reflective[geometry.triangle_material])
    corners = geometry.positions_ws[geometry.faces[triangle]] / radius
    with np.errstate(invalid="ignore", over="ignore"):
        a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        normal = np.stack(
            [a[:, i - 2] * b[:, i - 1] - a[:, i - 1] * b[:, i - 2] for i in range(3)], axis=1
        )
        area = np.sqrt(
            (normal[:, 0] * normal[:, 0] + normal[:, 1] * normal[:, 1])
            + normal[:, 2] * normal[:, 2]
        )
    usable = np.isfinite(area) & (area > 0.0)
    normal = normal[usable] / area[usable, None]
    return _Candidates(triangle[usable], corners[usable], normal, area[usable])


def _distance(c: _Candidates, seed: int, rows: I64Array) -> F64Array:
    """(n,) greatest distance of a corner of each row from the plane of row `seed`."""
    n, p = c.normal[seed], c.corners[seed, 0]
    d = c.corners[rows] - p
    return np.asarray(np.abs((d[..., 0] * n[0] + d[..., 1] * n[1]) + d[..., 2] * n[2]).max(axis=1))


def _group(c: _Candidates, object_id: int, rows: I64Array, max_mirrors: int) -> list[_Group] | None:
    """An object's planes, largest triangle first; None if there are more than max_mirrors."""
    left = rows[np.argsort(-c.area[rows], kind="stable")]
    found: list[_Group] = []
    while len(left):
        if len(found) == max_mirrors:
            return None
        on_plane = _distance(c, int(left[0]), left) <= FLAT
        found.append(_Group(object_id, int(left[0]), left[on_plane]))
        left = left[~on_plane]
    return found


def _is_bent(geometry: Geometry, c: _Candidates, group: _Group) -> BoolArray:
    """(n,) whether a vertex normal is not the plane's, either way round; unusable ones are."""
    triangles = c.triangle[group.rows]
    smooth = (geometry.triangle_flags[triangles] & HAS_NORMALS) != 0
    if not smooth.any():
        return np.asarray(smooth)
    plane = c.normal[group.seed]
    n = geometry.normals_ws[geometry.faces[triangles]]
    along = (n[..., 0] * plane[0] + n[..., 1] * plane[1]) + n[..., 2] * plane[2]
    off = np.abs(n * np.where(along < 0.0, -1.0, 1.0)[..., None] - plane).max(axis=2)
    used = (n != 0.0).any(axis=2)  # zero: unusable, the geometric normal is shown
    return np.asarray(smooth & ((off > BENT) & used).any(axis=1))


def _merged(c: _Candidates, groups: list[_Group], radius: float) -> tuple[PlanarMirror, ...]:
    """Groups on one plane as one mirror, whatever their objects; the largest triangle leads."""
    order = sorted(groups, key=lambda g: (-c.area[g.seed], g.seed))
    seeds: list[int] = []
    members: list[list[I64Array]] = []
    for group in order:
        n = c.normal[group.seed]
        chosen = c.normal[seeds].reshape(-1, 3)
        along = (chosen[:, 0] * n[0] + chosen[:, 1] * n[1]) + chosen[:, 2] * n[2]
        for k in np.flatnonzero(np.abs(along) > 0.5):
            if (_distance(c, seeds[k], group.rows) <= FLAT).all():
                members[k].append(group.rows)
                break
        else:
            seeds.append(group.seed)
            members.append([group.rows])
    made = []
    for seed, rows in zip(seeds, members, strict=True):
        x, y, z = (float(v) * radius for v in c.corners[seed, 0])
        nx, ny, nz = (float(v) + 0.0 for v in c.normal[seed])  # no −0
        made.append(PlanarMirror((x, y, z), (nx, ny, nz), _ids(c, np.concatenate(rows))))
    return tuple(made)


def _ids(c: _Candidates, rows: I64Array) -> I32Array:
    return c.triangle[rows].astype(np.int32)


def _curved(
    scene: Scene, c: _Candidates, object_id: int, rows: I64Array, max_mirrors: int
) -> Refusal:
    """The refusal of an object with too many planes, counted on a grid: planes within one step of
    another may count once or twice.
    """
    n, p = c.normal[rows], c.corners[rows, 0]
    d = (n[:, 0] * p[:, 0] + n[:, 1] * p[:, 1]) + n[:, 2] * p[:, 2]
    key = np.rint(np.concatenate([n, d[:, None]], axis=1) * COUNTING_GRID)
    # A plane and the same plane the other way round count once.
    first = np.where(key[:, 0] != 0, key[:, 0], np.where(key[:, 1] != 0, key[:, 1], key[:, 2]))
    key = np.where(first < 0, -1.0, 1.0)[:, None] * key + 0.0
    planes = max(len(np.unique(key, axis=0)), max_mirrors + 1)
    draws = planes * len(scene.nodes)
    name = scene.nodes[object_id].name
    return Refusal(
        object_id,
        name,
        len(rows),
        planes,
        draws,
        f"'{name}' is curved or faceted: its {len(rows)} reflective triangles lie in about {planes}"
        f" planes, more than max_mirrors {max_mirrors}; mirrors would take {planes} × "
        f"{len(scene.nodes)} = {draws} draws",
    )


def _bent(scene: Scene, group: _Group, count: int) -> Refusal:
    """The refusal of triangles that are flat but shaded as if they were not."""
    name = scene.nodes[group.object_id].name
    return Refusal(
        group.object_id,
        name,
        count,
        1,
        len(scene.nodes),
        f"'{name}' has {count} reflective triangles in one plane whose shading normals are not the "
        "plane's: they bend the reflection, and a plane's image would be straight",
    )

"""Primitives made by code: quad, boxes, flat grid, checker, sphere, round post.

Faces are counter-clockwise seen from outside. Closed shapes are watertight: neighbouring faces use
bit-equal positions. Only + − × ÷ and square roots (spec 1.2), so the bytes are the same everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..scene import Primitive
from ..typed import AnyArray, F32Array, F64Array, I32Array, Rgb

BOX_QUADS = (
    (0, 4, 6, 2),  # −x
    (1, 3, 7, 5),  # +x
    (0, 1, 5, 4),  # −y
    (2, 6, 7, 3),  # +y
    (0, 2, 3, 1),  # −z
    (4, 5, 7, 6),  # +z
)
"""Corner numbers of a box's sides; bit 0, 1, 2 of a number says low or high x, y, z."""
_BOX_RIGHT = ((0, 0, 1), (0, 0, -1), (1, 0, 0), (1, 0, 0), (-1, 0, 0), (1, 0, 0))
_BOX_DOWN = ((0, -1, 0), (0, -1, 0), (0, 0, -1), (0, 0, 1), (0, -1, 0), (0, -1, 0))
"""Directions of u and v of the sides in `BOX_QUADS`."""


def split_quads(quads: AnyArray | Sequence[Sequence[int]]) -> I32Array:
    """(2m, 3) triangles of (m, 4) quads a b c d: a b c, then a c d."""
    q = np.asarray(quads, np.int32).reshape(-1, 4)
    return q[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


def quad(
    corners: Sequence[Sequence[float]],
    *,
    uv: Sequence[Sequence[float]] | None = None,
    material: int = 0,
) -> Primitive:
    """Two triangles of four corners, counter-clockwise seen from the front; flat, open.

    uv: (4, 2) texture coordinates of the corners, or None.
    """
    uv0 = None if uv is None else np.asarray(uv, np.float32)
    faces = split_quads([[0, 1, 2, 3]])
    return Primitive(np.asarray(corners, np.float32), faces, material, uv0=uv0)


def box(low: Sequence[float], high: Sequence[float], *, material: int = 0) -> Primitive:
    """An axis-aligned box, closed: 8 vertices, 12 triangles, flat."""
    ends = (low, high)
    corners = [[ends[i >> axis & 1][axis] for axis in range(3)] for i in range(8)]
    return Primitive(np.array(corners, np.float32), split_quads(BOX_QUADS), material)


def unwrapped_box(low: Sequence[float], high: Sequence[float], *, material: int = 0) -> Primitive:
    """A `box` whose sides have vertices of their own, 24 in all, and texture coordinates.

    uv0 is in scene units, from a side's upper left corner as seen from outside: u right, v down.
    The top is seen with −z up, the bottom with +z up.
    """
    shape = box(low, high)
    corners = shape.positions[np.array(BOX_QUADS)]
    p = corners.astype(np.float64)
    right = np.array(_BOX_RIGHT, np.float64)[:, None, :]
    down = np.array(_BOX_DOWN, np.float64)[:, None, :]
    u = (p[:, :, 0] * right[..., 0] + p[:, :, 1] * right[..., 1]) + p[:, :, 2] * right[..., 2]
    v = (p[:, :, 0] * down[..., 0] + p[:, :, 1] * down[..., 1]) + p[:, :, 2] * down[..., 2]
    u, v = u - u.min(axis=1, keepdims=True), v - v.min(axis=1, keepdims=True)
    return Primitive(
        corners.reshape(-1, 3),
        split_quads(np.arange(24).reshape(6, 4)),
        material,
        uv0=np.stack([u, v], axis=2).reshape(-1, 2).astype(np.float32),
    )


def layered_box(
    low: Sequence[float],
    high: Sequence[float],
    layers: Sequence[tuple[float, Rgb]],
    *,
    material: int = 0,
) -> Primitive:
    """A closed, flat box with a colour gradient from bottom to top.

    layers: at least two (share of the height, colour), the shares rising from 0 to 1; colours are
    linear RGB and change linearly between them. 8 triangles a layer and 4 for bottom and top.
    """
    rings, colors = [], []
    for share, color in layers:
        y = low[1] + (high[1] - low[1]) * share
        # Counter-clockwise seen from above.
        rings += [(low[0], y, high[2]), (high[0], y, high[2]), (high[0], y, low[2])]
        rings += [(low[0], y, low[2])]
        colors += [color] * 4
    n = 4 * len(layers)
    i = np.arange(n - 4)
    after = i - i % 4 + (i + 1) % 4
    sides = np.stack([i, after, after + 4, i + 4], axis=1)
    ends = [[3, 2, 1, 0], [n - 4, n - 3, n - 2, n - 1]]
    return Primitive(
        np.array(rings, np.float32),
        split_quads(np.concatenate([sides, ends])),
        material,
        colors=np.array(colors, np.float32),
    )


def grid(
    half_x: float, half_z: float, cells_x: int, cells_z: int, *, material: int = 0
) -> Primitive:
    """A flat floor at y = 0 about the origin that faces up, cells_x × cells_z quads; open."""
    i = np.arange(cells_x + 1, dtype=np.float64)
    k = np.arange(cells_z + 1, dtype=np.float64)
    positions = np.zeros((cells_z + 1, cells_x + 1, 3), np.float64)
    positions[:, :, 0] = (2.0 * i / cells_x - 1.0) * half_x
    positions[:, :, 2] = ((2.0 * k / cells_z - 1.0) * half_z)[:, None]

    index = np.arange((cells_z + 1) * (cells_x + 1)).reshape(cells_z + 1, cells_x + 1)
    quads = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=2)
    return Primitive(positions.reshape(-1, 3).astype(np.float32), split_quads(quads), material)


def checker(
    half_x: float,
    half_z: float,
    cells_x: int,
    cells_z: int,
    colors: tuple[Rgb, Rgb],
    *,
    material: int = 0,
) -> Primitive:
    """A `grid` whose cells alternate between two linear colours, each with its own vertices; open.

    The cell at the least x and z has the first colour.
    """
    flat = grid(half_x, half_z, cells_x, cells_z)
    corners = flat.faces.reshape(-1, 6)[:, [0, 1, 2, 5]]
    row, column = np.divmod(np.arange(cells_x * cells_z), cells_x)
    cell_colors = np.array(colors, np.float32)[(row + column) % 2]
    return Primitive(
        flat.positions[corners].reshape(-1, 3),
        split_quads(np.arange(4 * len(corners)).reshape(-1, 4)),
        material,
        colors=np.repeat(cell_colors, 4, axis=0),
    )


def sphere(radius: float, frequency: int, *, material: int = 0) -> Primitive:
    """A sphere about the origin, closed and smooth: 20·frequency² triangles of an icosahedron.

    Each edge of the icosahedron is cut into `frequency` parts and pushed out to the sphere;
    positions lie within 1 ulp of `radius`, normals are positions / radius.
    """
    corners, faces = _icosahedron()
    # Barycentric lattice of one face: weights (a, b, c), a + b + c = frequency, row by row.
    rows = [(a, b) for a in range(frequency + 1) for b in range(frequency + 1 - a)]
    weight_a, weight_b = (np.array(v, np.float64)[None, :, None] for v in zip(*rows))
    weight_c = frequency - weight_a - weight_b

    # A weight is 0 on the opposite edge, so both faces of an edge add the same two terms.
    pa, pb, pc = (corners[faces[:, v]][:, None, :] for v in range(3))
    points = (weight_a * pa + weight_b * pb + weight_c * pc).reshape(-1, 3)
    points = points / _length(points)[:, None] + 0.0  # + 0 turns −0 into 0

    # Upright and upside-down small triangles, each turning as its large face does.
    start = np.cumsum([0] + [frequency + 1 - a for a in range(frequency)])
    small = [
        (start[a] + b, start[a + 1] + b, start[a] + b + 1)
        for a in range(frequency)
        for b in range(frequency - a)
    ]
    small += [
        (start[a] + b, start[a + 1] + b - 1, start[a + 1] + b)
        for a in range(frequency)
        for b in range(1, frequency - a)
    ]
    one_face = np.array(small)
    triangles = (one_face[None] + (np.arange(len(faces)) * len(rows))[:, None, None]).reshape(-1, 3)

    positions = (radius * points).astype(np.float32)
    first, welded = _weld(positions)
    return Primitive(
        positions[first],
        welded[triangles].astype(np.int32),
        material,
        normals=points[first].astype(np.float32),
    )


def round_post(radius: float, height: float, segments: int, *, material: int = 0) -> Primitive:
    """A closed cylinder on y = 0 about the y axis; the mantle is smooth, the two caps flat.

    segments: corners of the ring, rounded up to a multiple of 4.
    """
    ring = unit_circle(segments)
    n = len(ring)
    rim = np.zeros((2, n, 3))
    rim[:, :, 0], rim[:, :, 2] = radius * ring[:, 0], radius * ring[:, 1]
    rim[1, :, 1] = height
    side_normals = np.zeros((2, n, 3))
    side_normals[:, :, 0], side_normals[:, :, 2] = ring[:, 0], ring[:, 1]
    cap_normals = np.zeros((2, n, 3))
    cap_normals[0, :, 1], cap_normals[1, :, 1] = -1.0, 1.0
    centres = np.array([[0.0, 0.0, 0.0], [0.0, height, 0.0]])

    # The ring turns from +x to +z, which is clockwise seen from above. Vertices: mantle low and
    # high ring, then cap low and high ring, then the caps' centres.
    j = np.arange(n)
    k = (j + 1) % n
    mantle = split_quads(np.stack([j, n + j, n + k, k], axis=1))
    below = np.stack([np.full(n, 4 * n), 2 * n + j, 2 * n + k], axis=1)
    above = np.stack([np.full(n, 4 * n + 1), 3 * n + k, 3 * n + j], axis=1)
    positions = np.concatenate([rim.reshape(-1, 3), rim.reshape(-1, 3), centres])
    normals = np.concatenate(
        [side_normals.reshape(-1, 3), cap_normals.reshape(-1, 3), [[0, -1, 0], [0, 1, 0]]]
    )
    faces = np.concatenate([mantle, below, above]).astype(np.int32)
    return Primitive(
        positions.astype(np.float32), faces, material, normals=normals.astype(np.float32)
    )


def unit_circle(segments: int) -> F64Array:
    """(n, 2) points of the unit circle from (1, 0) over (0, 1), n = segments rounded up to 4k.

    A quarter is the rational quadratic Bézier curve with weights 1, √½, 1, which lies on the
    circle; the other three are exact turns of it.
    """
    quarter = max(1, -(-segments // 4))
    t = np.arange(quarter, dtype=np.float64) / quarter
    s = 1.0 - t
    middle = np.sqrt(2.0) * (s * t)
    bottom = s * s + middle + t * t
    x, y = (s * s + middle) / bottom, (t * t + middle) / bottom
    turns = [(x, y), (-y, x), (-x, -y), (y, -x)]
    return np.concatenate([np.stack(turn, axis=1) for turn in turns]) + 0.0


def _icosahedron() -> tuple[F64Array, I32Array]:
    """Corners (12, 3), not normalised, and faces (20, 3) counter-clockwise seen from outside."""
    g = (1.0 + float(np.sqrt(5.0))) / 2.0
    corners = [
        point
        for a in (-1.0, 1.0)
        for b in (-g, g)
        for point in ((0.0, a, b), (a, b, 0.0), (b, 0.0, a))
    ]
    p = np.array(corners)
    # Edges have length 2, the next diagonal 2g: three corners with short edges are a face.
    near = ((p[:, None] - p[None]) ** 2).sum(axis=2) < 5.0
    faces = [
        (i, j, k) if _turn(p[i], p[j], p[k]) > 0.0 else (i, k, j)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if near[i, j] and near[j, k] and near[i, k]
    ]
    return p, np.array(faces, np.int32)


def _turn(a: F64Array, b: F64Array, c: F64Array) -> float:
    """Determinant of three points: above 0 if they turn counter-clockwise seen from outside."""
    return float(
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


def _length(v: F64Array) -> F64Array:
    """Euclidean length of (n, 3) vectors, summed left to right."""
    total: F64Array = np.sqrt(v[:, 0] * v[:, 0] + v[:, 1] * v[:, 1] + v[:, 2] * v[:, 2])
    return total


def _weld(positions: F32Array) -> tuple[AnyArray, AnyArray]:
    """(first index of each different position, number of the position of every index)."""
    order = np.lexsort((positions[:, 2], positions[:, 1], positions[:, 0]))
    ordered = positions[order]
    new = np.ones(len(order), bool)
    new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    number = np.empty(len(order), np.int64)
    number[order] = np.cumsum(new) - 1
    return order[new], number

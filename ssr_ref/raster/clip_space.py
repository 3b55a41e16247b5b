"""Draw raw clip-space triangles, ordered by z/w, as a GPU's fixed function does.

For comparing coverage with real rasterizers: the same snapping, edges and fill rule as the scene
rasterizer, without a camera. Depth is z/w, linear on screen, less is nearer, at equal depth the
triangle drawn first stays (OpenGL's LESS).
"""

from __future__ import annotations

import numpy as np

from .._jit import driver
from ..camera import check_size
from ..errors import SceneError
from ..typed import AnyArray, F32Array, I32Array, I64Array, Size
from . import coverage
from .assemble import column_range
from .clip import snap_float32, snap_float64


def draw_clip_space(
    vertices: AnyArray, size: Size, *, gpu_vertices: bool = True
) -> tuple[I32Array, I32Array]:
    """Triangle ids (H, W) int32, −1 for none, and how often each centre is covered (H, W) int32.

    vertices: (n, 3, 4) clip coordinates, every w > 0 and every position within the guard band (no
    clipping here). size: (W, H). Row r holds window y from r to r + 1 with y = ndc_y·H/2 + H/2, so
    row 0 is OpenGL's bottom row; no face is culled. Raises SceneError for other vertices.
    """
    width, height = check_size(size)
    v = np.ascontiguousarray(vertices, np.float32)
    if v.ndim != 3 or v.shape[1:] != (3, 4):
        raise SceneError(f"vertices have shape {v.shape}; expected (n, 3, 4) clip coordinates")
    if not (np.isfinite(v).all() and (v[..., 3] > 0.0).all()):
        raise SceneError("a vertex has w <= 0 or is not finite; expected triangles before the eye")
    if (np.abs(v[..., :2]) > 8.0 * v[..., 3:]).any():
        raise SceneError("a vertex lies beyond 8 times the viewport; expected it nearer")
    ids = np.full((height, width), -1, np.int32)
    hits = np.zeros((height, width), np.int32)
    _draw(v, gpu_vertices, np.full((height, width), np.inf), ids, hits)
    return ids, hits


@driver(parallel=False)
def _draw(v: F32Array, gpu: bool, depth: AnyArray, ids: I32Array, hits: I32Array) -> None:
    """Draw in order; depth (H, W) float64 starts at +inf."""
    height, width = ids.shape
    p: I64Array = np.empty((3, 2), np.int64)
    z = np.empty(3)
    for t in range(v.shape[0]):
        for c in range(3):
            w = np.float64(v[t, c, 3])
            if gpu:
                p[c, 0] = snap_float32(v[t, c, 0], v[t, c, 3], width * 0.5, 1.0)
                p[c, 1] = snap_float32(v[t, c, 1], v[t, c, 3], height * 0.5, 1.0)
            else:
                p[c, 0] = snap_float64(v[t, c, 0] / w, width * 0.5)
                p[c, 1] = snap_float64(v[t, c, 1] / w, height * 0.5)
            z[c] = v[t, c, 2] / w
        i, j = 1, 2
        area = coverage.doubled_area(p[0, 0], p[0, 1], p[1, 0], p[1, 1], p[2, 0], p[2, 1])
        if area == 0:
            continue
        if area < 0:
            i, j = 2, 1
        edges = coverage.make_edges(p[0, 0], p[0, 1], p[i, 0], p[i, 1], p[j, 0], p[j, 1])

        # The plane of z/w over the snapped positions.
        x1, y1 = np.float64(p[1, 0] - p[0, 0]), np.float64(p[1, 1] - p[0, 1])
        x2, y2 = np.float64(p[2, 0] - p[0, 0]), np.float64(p[2, 1] - p[0, 1])
        dz_dx = ((z[1] - z[0]) * y2 - (z[2] - z[0]) * y1) / area
        dz_dy = ((z[2] - z[0]) * x1 - (z[1] - z[0]) * x2) / area
        xa, xb = column_range(
            min(p[0, 0], p[1, 0], p[2, 0]), max(p[0, 0], p[1, 0], p[2, 0]), width - 1
        )
        ya, yb = column_range(
            min(p[0, 1], p[1, 1], p[2, 1]), max(p[0, 1], p[1, 1], p[2, 1]), height - 1
        )
        for y in range(ya, yb + 1):
            low, high = coverage.row_span(edges, y, xa, xb)
            for x in range(low, high + 1):
                hits[y, x] += 1
                zw = z[0] + dz_dx * (256 * x + 128 - p[0, 0]) + dz_dy * (256 * y + 128 - p[0, 1])
                if zw < depth[y, x]:
                    depth[y, x] = zw
                    ids[y, x] = t

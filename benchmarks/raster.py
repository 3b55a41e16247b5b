"""Time of a G-buffer with back depth at 1920×1080, by stage, and what was drawn.

    python -m benchmarks.raster            # NUMBA_NUM_THREADS=1 for one core

Error: depth is compared with the plane evaluated in exact rationals in tests/test_raster_depth.py;
coverage with a real GPU in tests/test_raster_gpu.py. A time here is that of those same bytes.
"""

from __future__ import annotations

import numpy as np

from ssr_ref.raster import rasterize as R
from ssr_ref.raster.geometry import flatten
from ssr_ref.settings import Settings

from .common import machine, median_ms
from .scenes import GOAL_MS, scene

SIZE = (1920, 1080)
GBUFFER = R.RasterOptions(material=True)
OUTPUTS = "depth, triangle_id, back_depth, normals, albedo, reflectivity, roughness, ids"


def main() -> None:
    """Print one row a scene."""
    print(machine())
    print(f"{SIZE[0]}x{SIZE[1]}: {OUTPUTS}")
    print("scene  triangles  covered  back    vertices  visibility  attributes  total ms  x goal")
    for name in GOAL_MS:
        made = scene(name)
        geometry = flatten(made)
        view = made.view.camera(SIZE, 0.1).params(Settings(size=SIZE).size)
        gbuffer, _ = R.rasterize(view, geometry, GBUFFER)
        covered = np.mean(gbuffer.triangle_id >= 0)
        back = np.mean(np.isfinite(gbuffer.back_depth))
        vertices = median_ms(lambda v=view, g=geometry: R.project(v, g))
        bare = R.RasterOptions(geo_normal=False, normal=False, material=False)
        visible = median_ms(lambda v=view, g=geometry, o=bare: R.rasterize(v, g, o))
        total = median_ms(lambda v=view, g=geometry: R.rasterize(v, g, GBUFFER))
        print(
            f"{name:5}  {len(geometry.faces):9}  {covered:6.1%}  {back:6.1%}  {vertices:8.1f}  "
            f"{visible - vertices:10.1f}  {total - visible:10.1f}  {total:8.1f}  "
            f"{total / GOAL_MS[name]:6.2f}"
        )


if __name__ == "__main__":
    main()

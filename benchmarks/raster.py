"""Time of a G-buffer with back depth at 1920×1080, by stage, and what was drawn.

    python -m benchmarks.raster            # NUMBA_NUM_THREADS=1 for one core

Error: depth is compared with the plane evaluated in exact rationals in tests/test_raster_depth.py;
coverage with a real GPU in tests/test_raster_gpu.py. A time here is that of those same bytes.
"""

from __future__ import annotations

import numpy as np

from ssr_ref.raster import rasterize as R
from ssr_ref.raster.geometry import flatten

from .common import machine, median_ms
from .scenes import GOAL_MS, scene

SIZE = (1920, 1080)
DEPTHS = R.RasterOptions(geo_normal=False, normal=False, material=False)
NORMALS = R.RasterOptions(material=False)
FULL = R.RasterOptions()


def main() -> None:
    """Print one row a scene; output buffers are reused between frames."""
    print(machine())
    print(f"{SIZE[0]}x{SIZE[1]}, ms. depths: depth, triangle id, back depth. normals: depths, both")
    print("normals. full: normals, albedo, reflectivity, roughness, object and material id.")
    print("scene  triangles  covered  behind  vertices  depths  normals   full  normals / goal")
    for name, goal in GOAL_MS.items():
        made = scene(name)
        geometry = flatten(made)
        view = made.view.camera(SIZE, 0.1).params(SIZE)
        gbuffer, _ = R.rasterize(view, geometry, FULL)
        covered = np.mean(gbuffer.triangle_id >= 0)
        behind = np.mean(np.isfinite(gbuffer.back_depth))
        vertices = median_ms(lambda v=view, g=geometry: R.project(v, g))
        depths, normals, full = (
            median_ms(lambda v=view, g=geometry, o=options, b=gbuffer: R.rasterize(v, g, o, b))
            for options in (DEPTHS, NORMALS, FULL)
        )
        print(
            f"{name:5}  {len(geometry.faces):9}  {covered:7.1%}  {behind:6.1%}  {vertices:8.1f}  "
            f"{depths:6.1f}  {normals:7.1f}  {full:5.1f}  {normals / goal:6.2f}"
        )


if __name__ == "__main__":
    main()

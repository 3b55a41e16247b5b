"""Build and trace times of the truth's hierarchy beside Embree, one thread each.

    NUMBA_NUM_THREADS=1 python -m benchmarks.truth [--size 1920x1080] [--tessellation 34] [--runs 9]

Mirror rays of the built-in scene `spheres` (tessellation 34: 98 thousand triangles), tile by tile.
Each round runs every method once, in turn, so that a busy machine slows all alike; ratios are
medians of the rounds' own ratios to Embree. Embree is embreex: one call, nearest hit, float32.

    plain, packets   the same work as Embree: every triangle is met, from both sides
    truth            as used: culled, the own triangle skipped, hits above the tangent plane alone

Embree's origins are moved 2⁻¹² along the ray, as float32 needs; ours too, but for `truth`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

from ssr_ref import Settings, scenes
from ssr_ref.cli.parsing import parse_size
from ssr_ref.pipeline import make_camera
from ssr_ref.raster.geometry import DOUBLE_SIDED, flatten
from ssr_ref.raster.rasterize import RasterOptions, rasterize
from ssr_ref.truth.bvh import build_bvh
from ssr_ref.truth.nearest import nearest_plain, rays_of
from ssr_ref.truth.packets import nearest
from ssr_ref.truth.reflections import reflected_rays, reflective_pixels

from .common import machine


def embree_scene(triangles: np.ndarray) -> rtcore_scene.EmbreeScene:
    """A committed scene of (n, 3, 3) float32 triangles."""
    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, triangles)
    scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
    return scene


def rounds(methods: dict[str, Callable[[], object]], runs: int) -> None:
    """Print median times, and ratios to the first method, of methods run in turn."""
    times = {name: [] for name in methods}
    for i in range(runs + 1):
        for name, run in methods.items():
            start = time.perf_counter()
            run()
            if i > 0:  # the first round warms up
                times[name].append(time.perf_counter() - start)
    first = np.array(next(iter(times.values())))
    for name, taken in times.items():
        ratio = float(np.median(np.array(taken) / first))
        print(f"  {name:10s} {1e3 * np.median(taken):9.1f} ms  {ratio:6.2f}")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=parse_size, default=(1920, 1080))
    parser.add_argument("--tessellation", type=int, default=34)
    parser.add_argument("--runs", type=int, default=9)
    args = parser.parse_args()
    print(machine())

    scene = scenes.build("spheres", args.tessellation)
    settings = Settings(size=args.size).resolved(scene.radius())
    camera = make_camera(scene, None, settings, scene.radius())
    view, geometry = camera.params(args.size), flatten(scene)
    gbuffer, _ = rasterize(view, geometry, RasterOptions(back_depth=False))
    points = geometry.positions_ws - np.array([view.eye_x, view.eye_y, view.eye_z])
    pixels = reflective_pixels(view, gbuffer)
    truth_rays = reflected_rays(camera, view, geometry, points, gbuffer, pixels)
    traced = np.isfinite(truth_rays.direction[:, 0])
    origin = (truth_rays.origin + 2.0**-12 * truth_rays.direction)[traced]
    direction = truth_rays.direction[traced]
    free_rays = rays_of(origin, direction)

    bvh = build_bvh(points, geometry.faces, geometry.triangle_flags)
    both_sides = bvh._replace(flags=np.full_like(bvh.flags, DOUBLE_SIDED))
    triangles = np.float32(points[geometry.faces])
    other = embree_scene(triangles)
    o32, d32 = np.float32(origin), np.float32(direction)
    print(f"{len(geometry.faces)} triangles, {traced.sum()} mirror rays")
    print("build")
    rounds(
        {
            "Embree": lambda: embree_scene(triangles),
            "ours": lambda: build_bvh(points, geometry.faces, geometry.triangle_flags),
        },
        args.runs,
    )
    print("trace")
    rounds(
        {
            "Embree": lambda: other.run(o32, d32, output=1),
            "plain": lambda: nearest_plain(both_sides, free_rays),
            "packets": lambda: nearest(both_sides, free_rays),
            "truth": lambda: nearest(bvh, truth_rays),
        },
        args.runs,
    )
    ours, theirs = nearest(both_sides, free_rays).triangle_id, other.run(o32, d32, output=1)
    print(f"other triangle than Embree: {(ours != theirs['primID']).sum()} rays")


if __name__ == "__main__":
    main()

"""Normals fitted to depths: exact on planes, the choice of a stencil, what is no neighbour."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tracing import PROJECTIONS, front_view, pixel_rays, same_hits, view_of

from ssr_ref import Settings
from ssr_ref.analytic import HitErrors, analytic_gbuffer, analytic_reflections, hit_errors
from ssr_ref.analytic.scenes import SCENES
from ssr_ref.camera import ViewParams, ray_through
from ssr_ref.pipeline import make_camera
from ssr_ref.ssr.fit_planes import axis_slope, fit_normals
from ssr_ref.ssr.trace import trace
from ssr_ref.vecmath.vec import Vec3, dot

NAN = float("nan")


def plane_depth(view: ViewParams, normal: np.ndarray, distance: float = 3.0) -> np.ndarray:
    """View depth of the plane through (0, 0, −distance); +inf beyond its horizon."""
    d = pixel_rays(view)
    y, x = np.mgrid[: view.height, : view.width] + 0.5
    with np.errstate(all="ignore"):
        if view.perspective:
            z = -distance * normal[2] / (d * normal).sum(axis=2)
        else:
            across, up = (x - view.cx) / view.fx, (view.cy - y) / view.fy
            z = distance + (across * normal[0] + up * normal[1]) / normal[2]
    return np.where(z > 0.0, z, np.inf)


def gradients(view: ViewParams, normals: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """(H, W, 2) change of nearness per pixel of planes with these normals (docs/planes.md)."""
    n, f = normals, np.array([view.fx, -view.fy])
    with np.errstate(all="ignore"):
        if view.perspective:
            facing = (n * pixel_rays(view)).sum(axis=2)
            return n[..., :2] / (f * (depth * facing)[..., None])
        return -n[..., :2] / (f * n[..., 2:])


def has_neighbours(good: np.ndarray) -> np.ndarray:
    """Whether a pixel has a good neighbour in its row, and one in its column."""
    edged = np.pad(good, 1)
    in_row = edged[1:-1, :-2] | edged[1:-1, 2:]
    return good & in_row & (edged[:-2, 1:-1] | edged[2:, 1:-1])


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_a_plane_is_fitted_to_rounding(projection: str) -> None:
    """The stated bound: a slope of w is off by at most 4u of the greatest w of five pixels.

    (3, −4, 1)/2 of three rounded numbers. Depths are rounded to float32 and widened, so that the
    normals' own rounding does not count; 1e-13 is that of the arithmetic.
    """
    view = view_of(projection)
    rng = np.random.default_rng(4)
    seen = 0
    for tilt in (0.0, 0.3, 0.9, 1.3, 1.5):
        roll = rng.uniform(0.0, 6.28)
        normal = np.array([np.sin(tilt) * np.cos(roll), np.sin(tilt) * np.sin(roll), np.cos(tilt)])
        exact = plane_depth(view, normal)
        for depth, u in ((exact, 2.0**-53), (exact.astype(np.float32).astype(float), 2.0**-24)):
            good = depth < np.inf
            found = fit_normals(view, depth)
            w = np.where(good, 1.0 / depth if view.perspective else depth, 0.0)
            error = gradients(view, found, depth) - gradients(view, 0 * found + normal, exact)
            assert np.abs(error[has_neighbours(good)]).max() <= (4.0 * u + 1e-13) * w.max(), (
                tilt,
                u,
            )
            assert np.abs((found**2).sum(axis=2)[good] - 1.0).max() < 1e-15
            assert (found[~good] == 0.0).all()
            seen += int(good.sum())
    assert seen > 5000


def test_float32_normals_are_the_float64_ones_rounded() -> None:
    view = view_of("perspective")
    depth = plane_depth(view, np.array([0.48, 0.6, 0.64])).astype(np.float32)
    found = fit_normals(view, depth)
    assert found.dtype == np.float32
    assert found.tobytes() == fit_normals(view, depth.astype(float)).astype(np.float32).tobytes()


@pytest.mark.parametrize(
    ("pixels", "slope"),
    [
        # A parabola x² + x has slope 1 at 0 from any of its stencils.
        ((2.0, 0.0, 0.0, 2.0, 6.0), 1.0),
        ((2.0, 0.0, 0.0, 9.0, -7.0), 1.0),
        ((9.0, -7.0, 0.0, 2.0, 6.0), 1.0),
        # Silhouettes: the side that is on the same surface; in the middle of three, both.
        ((-2.0, -1.0, 0.0, 50.0, 51.0), 1.0),
        ((50.0, 49.0, 0.0, 2.0, 4.0), 2.0),
        ((50.0, -1.0, 0.0, 1.0, 50.0), 1.0),
        # A crease of slopes 1 and 3, exactly straight on both sides: the smaller slope.
        ((-2.0, -1.0, 0.0, 3.0, 6.0), 1.0),
        ((-6.0, -3.0, 0.0, 1.0, 2.0), 1.0),
        # Straight all along: the middle.
        ((-2.0, -1.0, 0.0, 1.0, 2.0), 1.0),
        # Missing pixels: the other side, the only neighbour, none.
        ((NAN, NAN, 0.0, 2.0, 4.0), 2.0),
        ((-4.0, -2.0, 0.0, NAN, NAN), 2.0),
        ((NAN, -2.0, 0.0, 4.0, NAN), 3.0),
        ((NAN, -2.0, 0.0, NAN, 1.0), 2.0),
        ((1.0, NAN, 0.0, 5.0, NAN), 5.0),
        ((1.0, NAN, 0.0, NAN, 1.0), 0.25),
    ],
)
def test_the_straightest_stencil_is_used(pixels: tuple[float, ...], slope: float) -> None:
    a, b, w, c, d = pixels
    assert axis_slope(a, b, w, c, d, 0.25) == slope
    assert axis_slope(d, c, w, b, a, -0.25) == -slope


@pytest.mark.parametrize("perspective", [True, False])
def test_a_pixel_without_neighbours_faces_the_eye(perspective: bool) -> None:
    """Bad depths have no normal and are no neighbours."""
    view = front_view(perspective, (9, 7))
    depth = np.full((7, 9), np.inf)
    depth[2, 6], depth[2, 5], depth[2, 7], depth[1, 6], depth[3, 6] = (
        2.0,
        np.nan,
        -1.0,
        0.0,
        -np.inf,
    )
    found = fit_normals(view, depth)
    d = pixel_rays(view)[2, 6]
    assert np.abs(found[2, 6] + d / np.sqrt((d * d).sum())).max() < 1e-15
    assert (np.delete(found.reshape(-1, 3), 2 * 9 + 6, axis=0) == 0.0).all()


@pytest.mark.parametrize("perspective", [True, False])
def test_noise_gives_unit_normals_that_face_the_eye(perspective: bool) -> None:
    """Also mirrored, and scaled by a power of two, to the bit."""
    view = front_view(perspective, (41, 31))
    rng = np.random.default_rng(9)
    depth = 10.0 ** rng.uniform(-9.0, 9.0, (31, 41))  # many edge-on up to rounding
    depth[rng.random(depth.shape) < 0.2] = np.inf
    for dtype in (np.float32, np.float64):
        image = depth.astype(dtype)
        found = fit_normals(view, image)
        good = image < np.inf
        for y, x in np.argwhere(good):  # as the tracers ask it
            n = Vec3(*(float(c) for c in found[y, x]))
            assert dot(n, ray_through(view, x + 0.5, y + 0.5)) < 0.0
        assert np.abs((found.astype(float) ** 2).sum(axis=2)[good] - 1.0).max() < 1e-6
        flipped = fit_normals(view, np.ascontiguousarray(image[:, ::-1]))[:, ::-1] * [-1, 1, 1]
        assert np.array_equal(flipped, found)
        upside = fit_normals(view, np.ascontiguousarray(image[::-1]))[::-1] * [1, -1, 1]
        assert np.array_equal(upside, found)
    if perspective:
        assert fit_normals(view, depth * 2.0**-20).tobytes() == fit_normals(view, depth).tobytes()


def errors(name: str, orthographic: bool, **kw: object) -> HitErrors:
    """A traced closed-form scene of half-spaces against its closed form."""
    size = (161, 91)
    scene = SCENES[name](orthographic=orthographic)
    fixed = {"size": size, "thickness": np.inf, "max_distance": np.inf, "tracer": "cells"}
    settings = Settings(**fixed | kw).resolved(scene.radius())  # type: ignore[arg-type]
    camera = make_camera(scene, None, settings, scene.radius())
    gbuffer = analytic_gbuffer(scene, camera, size)
    truth = analytic_reflections(scene, camera, size, gbuffer)
    return hit_errors(trace(camera.params(size), gbuffer, settings), truth, gbuffer)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("name", ["sphere_on_plane", "box_on_plane", "corner", "clutter"])
def test_fitted_planes_against_true_ones(name: str, orthographic: bool) -> None:
    """At this small size silhouettes are a large share; docs/hit_rules.md has 320 × 181.

    Self-hits: 4 of 6,600 rays in clutter, on objects less than three pixels wide, else none.
    """
    true = errors(name, orthographic, surface="plane")
    fitted = errors(name, orthographic, surface="plane", geo_normals="fitted")
    constant = errors(name, orthographic)
    assert fitted.rays > 1000
    assert fitted.self_hits <= (4 if name == "clutter" else 0)
    assert fitted.missed <= true.missed + 0.02
    assert fitted.false <= true.false + 0.01
    assert fitted.wrong <= true.wrong + 0.01
    assert fitted.p50 <= max(0.01, 2.0 * true.p50) < constant.p50


def test_a_buffer_without_normals_is_fitted() -> None:
    """The same bytes as asking for it, and as normals that were fitted before; both surfaces."""
    scene = SCENES["corner"]()
    settings = Settings(size=(37, 23), thickness=np.inf, max_distance=np.inf)
    camera = make_camera(scene, None, settings, scene.radius())
    view = camera.params(settings.size)
    gbuffer = analytic_gbuffer(scene, camera, settings.size, dtype=np.float32)
    given = replace(gbuffer, geo_normal_vs=fit_normals(view, gbuffer.depth))
    for surface in ("constant", "plane"):
        chosen = replace(settings, surface=surface)
        hits = trace(view, replace(gbuffer, geo_normal_vs=None), chosen)
        same_hits(hits, trace(view, gbuffer, replace(chosen, geo_normals="fitted")))
        same_hits(hits, trace(view, given, chosen))
        stored = trace(view, gbuffer, chosen)
        assert stored.hit_px.tobytes() != hits.hit_px.tobytes(), surface

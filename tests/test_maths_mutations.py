"""Broken formulas are refused by the checks that the real ones pass.

The package is imported a second time, interpreted, with one substring of one file replaced; the
public function of that copy goes through the check that the real test uses. A check that accepts a
mutant tests nothing.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

import maths_checks as checks
import numpy as np
import pytest
from mutants import mutant

import ssr_ref
from ssr_ref.study.sampling import examples


def run(check: Callable[..., None], name: str, package: ModuleType) -> None:
    """The check on the copy's public function, on few cases: interpreted code is slow."""
    function = getattr(package, name)
    few = {
        "check_sphere_bounds": 6, "check_sphere_scaling": 3, "check_sphere_accuracy": 12,
        "check_clip": 60, "check_mirror_matrix": 20,
    }.get(check.__name__)  # fmt: skip
    extra: dict[str, Any] = {} if few is None else {"n": few}
    if check is checks.check_clip:
        extra["camera_of"] = package.Camera.frustum
    check(function, **extra)


EXACT, VEC, MIRROR = "vecmath.exact", "vecmath.vec", "vecmath.mirror"
SPHERE, DISTANCE, LINE, RAY = "vecmath.sphere", "vecmath.sphere_distance", "vecmath.line", "ssr.ray"
CLIPPED = "if depth1 < lowest:"
# check, public function, module, what is replaced, by what
MUTATIONS: dict[str, tuple[Callable[..., None], str, str, str, str]] = {
    "two_sum: sign": (
        checks.check_two_sum, "two_sum", EXACT, "(s - t)) + (b - t)", "(s - t)) - (b - t)",
    ),
    "two_sum: an optimiser's zero": (
        checks.check_two_sum, "two_sum", EXACT, "(a - (s - t)) + (b - t)", "0.0 * t",
    ),
    "two_prod: not fused": (
        checks.check_two_prod, "two_prod", EXACT, "fma(a, b, -p)", "a * b - p",
    ),
    "difference_of_products: error with the wrong sign": (
        checks.check_difference_of_products, "difference_of_products", VEC,
        "fma(a, b, -cd) + error", "fma(a, b, -cd) - error",
    ),
    "difference_of_products: plain": (
        checks.check_difference_of_products, "difference_of_products", VEC,
        "fma(a, b, -cd) + error", "a * b - cd",
    ),
    "reflect: sign": (
        checks.check_reflect, "reflect", MIRROR, "incident.y - k * n.y", "incident.y + k * n.y",
    ),
    "reflect: not divided by n·n": (
        checks.check_reflect, "reflect", MIRROR, "dot(incident, n) / dot(n, n)", "dot(incident, n)",
    ),
    "reflect: half": (
        checks.check_reflect, "reflect", MIRROR, "k = 2.0 * dot", "k = 1.0 * dot",
    ),
    "mirror_matrix: offset forgotten": (
        checks.check_mirror_matrix, "mirror_matrix", MIRROR,
        "-_twice_quotient(d, n.y, square).hi", "0.0 * d",
    ),
    "mirror_matrix: ny for nz": (
        checks.check_mirror_matrix, "mirror_matrix", MIRROR,
        "_twice_quotient(n.x, n.z, square)", "_twice_quotient(n.x, n.y, square)",
    ),
    "mirror_matrix: n·n rounded": (
        checks.check_mirror_matrix, "mirror_matrix", MIRROR,
        "square = dot_twice(n, n)", "square = Pair(dot(n, n) * (1.0 + 2.0**-49), 0.0)",
    ),
    "dda_line: truncated": (
        checks.check_line, "dda_line", LINE,
        "(2 * i * (y1 - y0) + steps)", "(2 * i * (y1 - y0))",
    ),
    "dda_line: ties to the lower pixel": (
        checks.check_line, "dda_line", LINE,
        "(2 * i * (y1 - y0) + steps)", "(2 * i * (y1 - y0) + steps - 1)",
    ),
    "dda_line: increments added up": (
        checks.check_line, "dda_line", LINE,
        "y0 + (2 * i * (y1 - y0) + steps) // (2 * steps)",
        "int(__import__('numpy').floor(__import__('numpy').float32(y0 + 0.5) + "
        "__import__('numpy').cumsum(__import__('numpy').full(min(i, 9999) + 1, "
        "(y1 - y0) / steps, 'f4'))[-1] - (y1 - y0) / steps))",
    ),
    "sphere: no guard for d = 0": (
        checks.check_sphere_contract, "intersect_sphere", SPHERE, " and size_d > zero", "",
    ),
    "sphere: negative radius accepted": (
        checks.check_sphere_contract, "intersect_sphere", SPHERE, "r >= zero and ", "",
    ),
    "sphere: NaN let through": (
        checks.check_sphere_contract, "intersect_sphere", SPHERE,
        "is_finite(f) and is_finite(o) and is_finite(d) and np.isfinite(r)", "True",
    ),
    "sphere: sign(0) = 0": (
        checks.check_sphere_contract, "intersect_sphere", DISTANCE,
        "far = s - half if s < zero else s + half", "far = s + np.sign(s) * half",
    ),
    "sphere: no guard for q = 0": (
        checks.check_sphere_contract, "intersect_sphere", DISTANCE,
        "if far_error < type(r)(0.25) * size_far:", "if True:",
    ),
    "sphere: roots not ordered": (
        checks.check_sphere_contract, "intersect_sphere", DISTANCE, "if near <= far:", "if True:",
    ),
    "sphere: C from rounded squares": (
        checks.check_sphere_accuracy, "intersect_sphere", DISTANCE,
        "c = power_of_origin(f, high, r)", "c = dot(high, high) - r * r",
    ),
    "sphere: discriminant b² − aC": (
        checks.check_sphere_far, "intersect_sphere", DISTANCE,
        "delta = fma(-l.z, l.z, delta) + fma(r, r, -square)",
        "delta = (dot(high, d) * dot(high, d) - a * (dot(high, high) - square)) / a",
    ),
    "sphere: hit points by t alone": (
        checks.check_sphere_far, "intersect_sphere", DISTANCE,
        "if by_t_error < by_chord_error:", "if True:",
    ),
    "sphere: o − c rounded": (
        checks.check_sphere_bounds, "intersect_sphere", DISTANCE,
        "f = difference_of_points(g.o, g.c)",
        "f = difference_of_points(Vec3(g.o.x - g.c.x, g.o.y - g.c.y, g.o.z - g.c.z), "
        "Vec3(0.0, 0.0, 0.0))",
    ),
    "sphere: bound of a tangent forgotten": (
        checks.check_sphere_bounds, "intersect_sphere", DISTANCE,
        "root_error = delta_error / root", "root_error = zero",
    ),
    "sphere: near root's bound forgotten": (
        checks.check_sphere_bounds, "intersect_sphere", DISTANCE,
        "near_error = abs(near) * (type(r)(5.0) * u + far_error / (size_far - far_error))",
        "near_error = zero",
    ),
    "sphere: lengths not scaled": (
        checks.check_sphere_scaling, "intersect_sphere", SPHERE,
        "n = exponent(r if r > size_f else size_f)", "n = 0 * exponent(size_f)",
    ),
    "clip: left and right swapped": (
        checks.check_clip, "clip_ray", RAY,
        "leaving_time(w - cx, dw - dx)", "leaving_time(w - cx, dw + dx)",
    ),
    "clip: near plane forgotten": (
        checks.check_clip, "clip_ray", RAY,
        "leaving_time(depth - view.near, -r.z)", "leaving_time(depth, -r.z)",
    ),
    "clip: w below the near plane": (
        checks.check_clip, "clip_ray", RAY, CLIPPED, "if False:",
    ),
    "clip: a grazing side wins a tie": (
        checks.check_clip, "clip_ray", RAY, "if not slope < 0.0:", "if not slope > 0.0:",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MUTATIONS)
def test_a_broken_formula_is_refused(name: str) -> None:
    check, function, module, old, new = MUTATIONS[name]
    with mutant(module, old, new) as package, pytest.raises(AssertionError):
        run(check, function, package)


def test_the_unbroken_copy_passes_every_check() -> None:
    """Interpreted, as the mutants are: so it is the mutation that a check refuses."""
    real = ssr_ref.two_sum
    with mutant("nothing") as package:
        assert package is not ssr_ref
        assert package.two_sum is not real
        for check, function in {(m[0], m[1]) for m in MUTATIONS.values()}:
            run(check, function, package)
    assert sys.modules["ssr_ref"] is ssr_ref


def flat_bytes(package: ModuleType) -> dict[str, bytes]:
    """Results of each formula, of the package given, on the same few hard inputs."""
    found: dict[str, bytes] = {}
    spheres = examples("intersect_sphere/distance", 40, 3)
    for form in ("textbook", "stable", "kahan", "hearn_baker", "distance"):
        for dtype in ("float64", "float32"):
            hit = package.intersect_sphere(*spheres, form=form, dtype=dtype)
            found[f"{form} {dtype}"] = b"".join(a.tobytes() for a in hit)
    found["reflect"] = package.reflect(*examples("reflect/normalizing", 60, 3)).tobytes()
    found["mirror_matrix"] = package.mirror_matrix(*examples("mirror_matrix", 30, 3)).tobytes()
    found["two_prod"] = package.two_prod(*examples("two_prod", 60, 3)).error.tobytes()
    camera = package.Camera.frustum(np.eye(4), -0.75, 1.25, -0.375, 0.625, near=0.125)
    clipped = package.clip_ray(camera, (37, 23), *examples("clip_ray", 60, 3))
    found["clip_ray"] = b"".join(a.tobytes() for a in clipped)
    *pixels, limit = examples("ray_setup/end_position", 60, 3)
    ready = package.ray_setup(camera, (37, 23), *pixels, max_distance=limit)
    found["ray_setup"] = b"".join(a.tobytes() for a in ready)
    return found


def test_interpreted_and_compiled_code_give_the_same_bytes() -> None:
    compiled = flat_bytes(ssr_ref)
    with mutant("nothing") as package:
        interpreted = flat_bytes(package)
    for name, found in compiled.items():
        assert interpreted[name] == found, name

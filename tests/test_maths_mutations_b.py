"""Tests of the tests: each broken formula is caught by the check that is named beside it.

A module's source is changed in one place and run interpreted, with the public functions on top; the
check is the very one that the real modules pass in test_maths_{depth,barycentric,directions}.py.
"""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Callable, Iterator
from functools import partial
from types import ModuleType

import maths_b_checks as checks
import maths_direction_checks as sky
import numpy as np
import pytest
from mutants import mutant

from ssr_ref.study.sampling_maps import SAMPLES

PUBLIC = ("ssr_ref.maths.depth", "ssr_ref.maths.barycentric", "ssr_ref.maths.directions")


@contextlib.contextmanager
def broken(public: str, where: str = "", edit: tuple[str, str] = ("", "")) -> Iterator[ModuleType]:
    """A public module of an interpreted copy of the package, `edit` made in `where`."""
    with mutant(where.removeprefix("ssr_ref."), *edit):
        yield importlib.import_module(public)


DEPTH, BARY, DIRS = PUBLIC
FORMATS, LOG, STORAGE = (f"ssr_ref.depth.{n}" for n in ("formats", "logarithmic", "storage"))
BARY_K, DIRS_K = "ssr_ref.vecmath.barycentric", "ssr_ref.vecmath.directions"


def accurate(key: str, n: int = 80) -> Callable[[ModuleType], None]:
    return partial(checks.accuracy, key=key, n=n)


def texels(layout: str) -> Callable[[ModuleType], None]:
    d = np.random.default_rng(3).normal(size=(60, 3))
    size = (52, 39) if layout == "cross" else (37, 23)

    def check(m: ModuleType) -> None:
        sky.texel_round_trip(m, layout, d, *size)

    return check


# public module, changed module, old, new, the check that must fail
MUTATIONS = {
    # Depth
    "gl swapped": (DEPTH, FORMATS, "0.5 * (1.0 - device)", "0.5 * (1.0 + device)",
                   checks.depth_ends),
    "orthographic reversed like d3d": (DEPTH, FORMATS,
                   "    return 1.0 - device\n\n\n@kernel\ndef part_from_far",
                   "    return device\n\n\n@kernel\ndef part_from_far", checks.depth_ends),
    "sign of r": (DEPTH, FORMATS, "fma(e, 1.0 - r, r)", "fma(e, 1.0 + r, r)", checks.depth_middle),
    "lost far": (DEPTH, FORMATS, "fma(e, 1.0 - r, r)", "fma(e, 1.0 - r, 1.0)",
                 checks.depth_middle),
    "far end by division": (DEPTH, FORMATS, "    if e == 0.0:\n        return far\n    if far",
                   "    if far", checks.depth_ends),
    "no cap at far": (DEPTH, FORMATS,
                   "fma(e, 1.0 - r, r)\n    return depth if depth < far else far",
                   "fma(e, 1.0 - r, r)\n    return depth", checks.depth_order),
    "cancelling formula": (DEPTH, FORMATS, "near / fma(e, 1.0 - r, r)",
                   "near * far / (far - (1.0 - e) * (far - near))",
                   accurate("linear_depth/reversed")),
    "range guard of perspective": (DEPTH, FORMATS,
                   "    if not (e >= 0.0 and e <= 1.0):\n        return np.nan\n", "",
                   checks.depth_classes),
    "range guard of orthographic": (DEPTH, FORMATS,
                   "    if not (t >= 0.0 and t <= 1.0):\n        return np.nan\n", "",
                   checks.depth_classes),
    "range guard of encoding": (DEPTH, FORMATS,
                   "    if not (depth >= near and depth <= far):\n        return np.nan\n", "",
                   checks.depth_classes),
    "encoding by cancelling": (DEPTH, FORMATS,
                   "e = (near / depth) * ((far - depth) / (far - near))",
                   "e = (near / depth - near / far) / (1.0 - near / far)",
                   accurate("device_depth/reversed", 300)),
    "distance times the ray": (DEPTH, FORMATS, "device / ray_length", "device * ray_length",
                   accurate("linear_depth/distance")),
    "sign of view z": (DEPTH, FORMATS,
                   "return -device if device < 0.0", "return device if device < 0.0",
                   checks.depth_classes),
    "2^x - 1 cancels": (DEPTH, LOG, "return (y - 1.0) * (x / log2(y))", "return y - 1.0",
                   accurate("linear_depth/logarithmic")),
    "log(1 + x) cancels": (DEPTH, LOG, "return log2(y) * (x / (y - 1.0))", "return log2(y)",
                   accurate("device_depth/logarithmic")),
    "near left out of the logarithm": (DEPTH, LOG, "near * power(far / near, d)",
                   "power(far / near, d)", checks.depth_ends),
    "unorm truncated": (DEPTH, STORAGE, "scaled + 0.5", "scaled", checks.depth_storage),
    "2^24 for 2^24 - 1": (DEPTH, STORAGE, "0xFFFFFF}", "0x1000000}", checks.depth_storage),
    "NaN is never empty": (DEPTH, DEPTH, "or (np.isnan(d) and np.isnan(empty))", "",
                   checks.depth_classes),
    "empty kept in float64": (DEPTH, DEPTH, "float(np.asarray(value).astype(kind))",
                   "float(value)", checks.depth_classes),
    # Barycentrics
    "no clamp": (BARY, BARY_K, "b = max(0.0, side * doubled_area(px, py, cx, cy, ax, ay).hi / w.y)",
                 "b = side * doubled_area(px, py, cx, cy, ax, ay).hi / w.y",
                 checks.barycentric_shares),
    "w of the wrong vertex": (BARY, BARY_K, "ax, ay).hi / w.y)", "ax, ay).hi / w.z)",
                 accurate("barycentrics")),
    "linear on screen": (BARY, BARY_K, "ax, ay).hi / w.y)", "ax, ay).hi)",
                 accurate("barycentrics")),
    "one winding": (BARY, BARY_K, "side = 1.0 if whole > 0.0 else -1.0", "side = 1.0",
                 checks.barycentric_shares),
    "no guard of the area": (BARY, BARY_K,
                 "    if whole == 0.0:\n        return Vec3(1.0, 0.0, 0.0)\n", "",
                 checks.barycentric_degenerate),
    "no guard of w": (BARY, BARY_K, "w.x > 0.0 and w.y > 0.0 and w.z > 0.0", "True",
                 checks.barycentric_classes),
    "area in plain float64": (BARY, BARY_K,
                 "    return subtract_pairs(\n        multiply_pairs(",
                 "    return Pair((ax - px) * (by - py) - (ay - py) * (bx - px), 0.0)\n"
                 "    return subtract_pairs(\n        multiply_pairs(",
                 checks.barycentric_sliver),
    # Directions
    "faces swapped": (DIRS, DIRS_K, "(4, d.x, -d.y, az) if d.z > 0.0 else (5, -d.x, -d.y, az)",
                 "(5, d.x, -d.y, az) if d.z > 0.0 else (4, -d.x, -d.y, az)", sky.cube_table),
    "sign of s on +X": (DIRS, DIRS_K, "(0, -d.z, -d.y, ax)", "(0, d.z, -d.y, ax)",
                 sky.cube_table),
    "letter mirrored": (DIRS, DIRS_K, "return Vec3(d.x, d.y, -d.z)", "return Vec3(d.x, d.y, d.z)",
                 sky.cube_letter),
    "ties to y": (DIRS, DIRS_K, "if az >= ax and az >= ay:", "if az >= ax and az > ay:",
                 sky.cube_ties),
    "ties to x": (DIRS, DIRS_K, "elif ay >= ax:", "elif ay > ax:", sky.cube_ties),
    "zero is a direction": (DIRS, DIRS_K,
                 "    if not is_direction(d):\n        return -1, _NAN, _NAN\n", "",
                 sky.no_direction),
    "zero has a longitude": (DIRS, DIRS_K,
                 "is_finite(d) and (d.x != 0.0 or d.y != 0.0 or d.z != 0.0)",
                 "is_finite(d)", sky.no_direction),
    "infinity is a direction": (DIRS, DIRS_K,
                 "is_finite(d) and (d.x != 0.0 or d.y != 0.0 or d.z != 0.0)",
                 "d.x != 0.0 or d.y != 0.0 or d.z != 0.0", sky.no_direction),
    "half after the sum with 1": (DIRS, DIRS_K, "return 0.5 * ((s + m) / m)",
                 "return 0.5 * (s / m + 1.0)", accurate("cube_face/uv", 300)),
    "edge of the cross": (DIRS, DIRS_K, "    if row != 1 and u > _BELOW_HALF:",
                 "    if row != 1 and u > 2.0:", sky.cross_seams),
    "hole at the edge": (DIRS, DIRS_K, "if row != 1 and column == 2 and x == 2.0:",
                 "if row != 1 and column == 2 and x == -2.0:", sky.cross_seams),
    "rows of the cross": (DIRS, DIRS_K, "2 if row == 0 else 3, s, t", "3 if row == 0 else 2, s, t",
                 texels("cross")),
    "u reaches 1": (DIRS, DIRS_K, "        if u >= 1.0:  # within half an ulp of the seam\n"
                 "            u = 0.0\n", "", sky.latlong_seam),
    "pole with an azimuth": (DIRS, DIRS_K, "if d.x == 0.0 and d.z == 0.0:", "if False:",
                 sky.latlong_seam),
    "minus zero": (DIRS, DIRS_K, "return u + 0.0, ", "return u, ", sky.latlong_seam),
    "east is west": (DIRS, DIRS_K, "atan2(-d.x, d.z)", "atan2(d.x, d.z)", sky.latlong_seam),
    "latitude by plain squares": (DIRS, DIRS_K, "atan2(hypotenuse(d.x, d.z), d.y)",
                 "atan2(np.sqrt(d.x * d.x + d.z * d.z), d.y)", sky.latlong_seam),
    "quarter turn backwards": (DIRS, DIRS_K, "return -cosine, sine", "return cosine, -sine",
                 accurate("latlong_direction")),
    "sign of z": (DIRS, DIRS_K, "cosine, sine * turn_cosine)", "cosine, -(sine * turn_cosine))",
                 partial(sky.there_and_back, layout="latlong")),
    "ball by one formula": (DIRS, DIRS_K, "if d.z >= 0.0:  #", "if True:  #", sky.ball_rim),
    "rim of the ball": (DIRS, DIRS_K, " if s > 0.0 else (1.0, 0.0)", "", sky.ball_rim),
    "squares rounded": (DIRS, DIRS_K, "(first.lo - rest)", "first.lo",
                 sky.ball_close_to_rim),
    "ball upside down": (DIRS, DIRS_K, "0.5 - 0.5 * y", "0.5 + 0.5 * y", sky.ball_rim),
    "off the ball": (DIRS, DIRS_K, "    if not q >= 0.0:\n        return Vec3(_NAN, _NAN, _NAN)\n",
                 "    q = abs(q)\n", sky.no_direction),
}  # fmt: skip


@pytest.mark.parametrize("name", MUTATIONS)
def test_broken_formula_is_caught(name: str) -> None:
    public, where, old, new, check = MUTATIONS[name]
    with broken(public, where, (old, new)) as module, pytest.raises(AssertionError):
        check(module)


@pytest.mark.parametrize("public", PUBLIC)
def test_unbroken_source_passes_the_same_checks(public: str) -> None:
    """Interpreted and unchanged: what fails above fails because of its change alone."""
    with broken(public) as module:
        for check in {row[4] for row in MUTATIONS.values() if row[0] == public}:
            check(module)


@pytest.mark.parametrize("public", PUBLIC)
def test_compiled_and_interpreted_give_the_same_bytes(public: str) -> None:
    compiled = checks.infos(importlib.import_module(public))
    with broken(public) as module:
        for key, info in checks.infos(module).items():
            inputs = SAMPLES[key](60, 41)
            expected = compiled[key].function(*inputs)
            assert info.function(*inputs).tobytes() == expected.tobytes(), key

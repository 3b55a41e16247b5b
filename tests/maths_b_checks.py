"""Checks of depth formats and barycentrics, shared by their tests and the mutations.

Each takes the module of public functions, real or broken, and raises AssertionError where it fails.
Expected numbers are mpmath's at 60 digits (`study/oracle_maps.py`) or derived beside them.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from ssr_ref.maths.registry import KernelInfo
from ssr_ref.study.accuracy import case, errors
from ssr_ref.study.sampling_maps import SAMPLES

U = 2.0**-53
INF, NAN = np.inf, np.nan
RANGES = [(0.1, 1e3), (0.01, 1e5), (1e-3, 1e5), (1e-3, 1e7), (0.1, 100.0), (1.0, 1.25),
          # near/(near/far) is below far, and above it.
          (0.01, 1e3), (1e-3, 1e3), (0.3, 103.0), (1.0, 49.0)]  # fmt: skip
# Device depth at near and at far.
ENDS = {
    "gl_ndc": (-1.0, 1.0),
    "gl_window": (0.0, 1.0),
    "d3d": (0.0, 1.0),
    "vulkan": (0.0, 1.0),
    "reversed": (1.0, 0.0),
    "logarithmic_near": (0.0, 1.0),
}


def infos(module: ModuleType) -> dict[str, KernelInfo]:
    return {info.key: info for info in module.KERNELS}


def worst_error(info: KernelInfo, inputs: tuple[Any, ...]) -> tuple[float, tuple[Any, ...]]:
    """The largest of `accuracy.errors` over the cases, and its arguments."""
    with np.errstate(all="ignore"):
        found = errors(info, inputs)
    worst = int(np.argmax(found))
    return float(found[worst]), case(inputs, worst)


def accuracy(module: ModuleType, key: str, n: int = 400, seed: int = 11) -> None:
    """Stated bounds hold on the samples of the hard regions."""
    info = infos(module)[key]
    error, args = worst_error(info, SAMPLES[key](n, seed))
    assert error <= info.bound, f"{key}: {error:.3g} > {info.bound} at {args}"


# --- Depth ----------------------------------------------------------------------------------------


def depth_ends(depth: ModuleType) -> None:
    """near and far come back bit for bit from the ends of every range, and go there."""
    for near, far in RANGES:
        for name, ends in ENDS.items():
            for projection in ("perspective", "orthographic"):
                kind = {"near": near, "far": far, "projection": projection}
                got = depth.linear_depth(ends, name, **kind)
                assert got.tolist() == [near, far], f"{name} {kind}: {got}"
                back = depth.device_depth([near, far], name, **kind)
                assert back.tolist() == list(ends), f"{name} {kind}: {back}"
        got = depth.linear_depth([0.0, 1.0], "logarithmic", far=far, constant=0.7)
        assert got.tolist() == [0.0, far]
        for name in ("gl_ndc", "d3d", "reversed"):
            got = depth.linear_depth(ENDS[name], name, near=near, far=INF)
            assert got.tolist() == [near, INF]
            assert depth.device_depth([near, INF], name, near=near, far=INF).tolist() == list(
                ENDS[name]
            )


def depth_middle(depth: ModuleType) -> None:
    """Half way in device depth: the harmonic mean 2nf/(n + f), the mean, the geometric mean."""
    for near, far in RANGES:
        for name, (a, b) in ENDS.items():
            kind = {"near": near, "far": far}
            middle = 0.5 * (a + b)
            plain = depth.linear_depth(middle, name, projection="orthographic", **kind)
            if name == "logarithmic_near":
                assert abs(plain / np.sqrt(near * far) - 1.0) < 8 * U
                continue
            assert abs(plain / (0.5 * (near + far)) - 1.0) < 8 * U
            got = depth.linear_depth(middle, name, **kind)
            assert abs(got / (2 * near * far / (near + far)) - 1.0) < 8 * U, name


def depth_order(depth: ModuleType) -> None:
    """Decoding never turns the order of two device depths round, nor leaves [near, far]."""
    tiny = np.array([5e-324, 1e-300, 2.0**-80])
    close = np.arange(1, 400) * 2.0**-53
    half = 0.5 + np.arange(-200, 200) * 2.0**-54
    rest = np.sort(np.concatenate([[0.0], tiny, close, half, np.linspace(0, 1, 97), 1.0 - close]))
    for near, far in [*RANGES, (0.3, 0.7), (3e-3, 9e5), (0.3, INF)]:
        for name in ("gl_ndc", "d3d", "reversed"):
            for projection in ("perspective", "orthographic"):
                if projection == "orthographic" and far == INF:
                    continue
                device = {"gl_ndc": 2.0 * rest - 1.0, "d3d": rest, "reversed": 1.0 - rest}[name]
                if name == "reversed":
                    device = rest[::-1]
                z = depth.linear_depth(device, name, near=near, far=far, projection=projection)
                assert (np.diff(z[np.isfinite(z)]) >= 0.0).all(), f"{name} {near} {far}"
                assert z[0] == near and (z <= far).all(), f"{name} {near} {far}"


def depth_classes(depth: ModuleType) -> None:
    """What no format can hold is NaN; empty pixels are +inf where, and only where, it was said."""
    kind = {"near": 0.5, "far": 8.0}
    for name, (a, b) in ENDS.items():
        for projection in ("perspective", "orthographic"):
            lowest, highest = min(a, b), max(a, b)
            outside = [lowest - 1e-9, highest + 1e-9, NAN, INF, -INF]
            got = depth.linear_depth(outside, name, projection=projection, **kind)
            assert np.isnan(got).all(), f"{name}: {got}"
            z = [0.4999, 8.001, 0.0, -1.0, NAN, INF]
            assert np.isnan(depth.device_depth(z, name, projection=projection, **kind)).all(), name
    z = depth.linear_depth([-1.0, 0.0, NAN, 2.0, INF], "linear")
    assert np.isnan(z[:3]).all() and z[3:].tolist() == [2.0, INF]
    z = depth.linear_depth([1.0, 0.0, NAN, -2.0, -INF], "negative_z")
    assert np.isnan(z[:3]).all() and z[3:].tolist() == [2.0, INF]

    for name, value in (("d3d", 1.0), ("reversed", 0.0), ("d3d", INF), ("d3d", NAN), ("d3d", 7.0)):
        z = depth.linear_depth([0.25, value, 0.75], name, empty=value, **kind)
        assert np.isfinite(z).tolist() == [True, False, True] and z[1] == INF, f"{name} {value}"
        d = depth.device_depth([2.0, INF], name, empty=value, **kind)
        assert np.array_equal(d[1], value, equal_nan=True) and 0.0 < d[0] < 1.0
    # Without `empty` the far plane is a depth.
    assert depth.linear_depth([1.0], "d3d", **kind).tolist() == [8.0]
    z = depth.linear_depth(np.float32([3.0, 1e10]), "linear", empty=1e10)
    assert z.tolist() == [3.0, INF]
    # 3.3e38 is between two float32 numbers; the file holds the nearest.
    z = depth.linear_depth(np.float32([3.0, 3.3e38]), "linear", empty=3.3e38)
    assert z.tolist() == [3.0, INF]


def depth_storage(depth: ModuleType) -> None:
    """Codes of unorm storage: ends, the tie at ½ upwards, every code its own value."""
    for name, largest in (("unorm16", 65535), ("unorm24", 16777215)):
        codes = depth.depth_codes([0.0, 0.5, 1.0, -3.0, 7.0], name)
        assert codes.tolist() == [0, (largest + 1) // 2, largest, 0, largest]
        every = np.arange(0, largest + 1, 1 if largest == 65535 else 251)
        values = depth.stored_depth(every, name)
        assert np.array_equal(values, every / largest)
        assert np.array_equal(depth.depth_codes(values, name), every)
        # One code further up begins half a quantum up.
        edge = (every[:-1] + 0.5) / largest
        assert np.array_equal(depth.depth_codes(edge * (1 + 4e-16), name), every[:-1] + 1)
        assert np.array_equal(depth.depth_codes(edge * (1 - 4e-16), name), every[:-1])
    assert depth.depth_codes([65519.9, 65520.0], "float16").tolist() == [65504.0, INF]
    assert depth.depth_codes([1.0 + 2.0**-24], "float32").tolist() == [1.0]  # tie to even


# --- Barycentrics ---------------------------------------------------------------------------------

DEGENERATE = {  # a, b, c
    "one point": ((3, 4), (3, 4), (3, 4)),
    "two equal": ((3, 4), (3, 4), (9, 1)),
    "two equal, the others": ((3, 4), (9, 1), (9, 1)),
    "collinear": ((0, 0), (3, 1), (9, 3)),
    "collinear, float32": tuple((np.float32(0.1) * k, np.float32(0.7) * k) for k in (1, 4, 16)),
}


def barycentric_degenerate(m: ModuleType) -> None:
    """A triangle without area: (1, 0, 0) at every point, on its line or off it."""
    for name, (a, b, c) in DEGENERATE.items():
        for p in ((3.0, 4.0), (0.5, 0.5), (6.0, 2.0), (-40.0, 7.0)):
            got = m.barycentrics(p, a, b, c, (1.0, 2.0, 4.0))
            assert got.tolist() == [1.0, 0.0, 0.0], f"{name} {p}: {got}"


def barycentric_shares(m: ModuleType) -> None:
    """Never negative, sum 1, also outside, either winding; 1 on a vertex; order of vertices."""
    p, a, b, c, w = SAMPLES["barycentrics"](300, 5)
    p = np.concatenate([p, p + 700.0])
    a, b, c, w = (np.concatenate([v, v]) for v in (a, b, c, w))
    got = m.barycentrics(p, a, b, c, w)
    assert (got >= 0.0).all() and (got <= 1.0).all()
    assert np.abs(got.sum(axis=1) - 1.0).max() <= 4 * U
    flat = (a == b).all(1) | (b == c).all(1) | (c == a).all(1)
    whole = ~flat & ~((b - a)[:, 0] * (c - a)[:, 1] == (b - a)[:, 1] * (c - a)[:, 0])
    turned = m.barycentrics(p, c, b, a, w[:, ::-1])[:, ::-1]
    assert np.abs(turned - got)[whole].max() <= 8 * U
    assert (m.barycentrics(a, a, b, c, w)[whole] == [1.0, 0.0, 0.0]).all()
    assert (m.barycentrics(b, a, b, c, w)[whole] == [0.0, 1.0, 0.0]).all()
    assert (m.barycentrics(c, a, b, c, w)[whole] == [0.0, 0.0, 1.0]).all()


def barycentric_classes(m: ModuleType) -> None:
    """NaN for w that is not > 0 and for numbers that are not finite."""
    a, b, c, w = (0.0, 0.0), (8.0, 0.0), (0.0, 8.0), (1.0, 2.0, 3.0)
    for bad in (0.0, -1.0, NAN, INF):
        for i in range(3):
            broken = [bad if i == j else v for j, v in enumerate(w)]
            assert np.isnan(m.barycentrics((1, 1), a, b, c, broken)).all(), broken
    for bad in (NAN, INF, -INF):
        assert np.isnan(m.barycentrics((bad, 1), a, b, c, w)).all()
        assert np.isnan(m.barycentrics((1, 1), a, b, (0, bad), w)).all()


def barycentric_sliver(m: ModuleType) -> None:
    """b lies 2⁻³⁰ off the line from a to c, p on it: weights by hand, to the bound."""
    t = 2.0**-30
    got = m.barycentrics((0.5, 0.5), (0.0, 0.0), (1.0 / 3.0, 1.0 / 3.0 + t), (1.0, 1.0), (1, 1, 1))
    assert got.tolist() == [0.5, 0.0, 0.5]
    # Far from the origin with all bits in use: E_a, E_b, E_c all cancel.
    p, a, b, c = (-5.1, 7.3), (1e3 / 3, 7.3), (-1e3 / 7, 7.3 + 2.0**-40), (11.7, 7.3 - 2.0**-43)
    info = infos(m)["barycentrics"]
    for q in (p, b, (3.3, 7.3)):
        args = [np.array([v]) for v in (q, a, b, c, (1.0, 2.0, 5.0))]
        error, at = worst_error(info, tuple(args))
        assert error <= info.bound, at

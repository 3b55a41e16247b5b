"""Exact cells against planes per pixel once more, in NumPy: all rays in step, in any float type.

For studies of arithmetic alone. In float64 it gives the package's statuses and hits to the bit
(tests/test_hit_rules.py); in float32 every operation is float32, from the ray's set-up to the hit,
as a GPU computes. Letters as in docs/planes.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from ssr_ref.buffers import GBuffer, Status
from ssr_ref.camera import ViewParams
from ssr_ref.typed import AnyArray, U8Array

OWN_PIXEL = 0.5


@dataclass(frozen=True, slots=True)
class Walked:
    """Of a walk: status (H, W) (HIT, BLOCKED, or 0), hit_px (H, W, 2), NaN where there is none."""

    status: U8Array
    hit_px: AnyArray


def _numbers(view: ViewParams, dtype: Any) -> SimpleNamespace:
    """A view's numbers in one float type: a float64 scalar would promote everything it meets."""
    items = view._asdict().items()
    return SimpleNamespace(**{k: dtype(v) if isinstance(v, float) else v for k, v in items})


def _dot(a: Any, b: Any) -> AnyArray:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _unit(a: Any) -> tuple[AnyArray, ...]:
    length = np.sqrt(_dot(a, a))
    return a[0] / length, a[1] / length, a[2] / length


def _leaving(value: Any, slope: Any) -> AnyArray:
    return np.where(slope < 0, np.where(value > 0, value / -slope, 0), np.inf).astype(slope.dtype)


def _rays(v: Any, g: dict[str, Any], dtype: Any) -> dict[str, Any]:
    """Every pixel's ray, as `ssr_ref.ssr.ray.set_up_ray`; `walks` says which have one."""
    y, x = np.mgrid[: v.height, : v.width]
    px, py = x.astype(dtype) + dtype(0.5), y.astype(dtype) + dtype(0.5)
    across, up = (px - v.cx) / v.fx, (v.cy - py) / v.fy
    one, none = np.ones_like(px), np.zeros_like(px)
    z, n = g["depth"], g["geo"]
    d = (across, up, -one) if v.perspective else (none, none, -one)
    o = (across * z, up * z, -z) if v.perspective else (across, up, -z)
    facing = _dot(n, d)
    unit, normal = _unit(d), _unit(g["normal"])
    k = 2 * _dot(unit, normal)
    r = _unit(tuple(unit[i] - k * normal[i] for i in range(3)))
    walks = (z > 0) & (z < np.inf) & (facing < 0) & (_dot(r, n) > 0) & g["reflects"]

    # Clip; the bound that is met first.
    if v.perspective:
        w, dw = z, -r[2]
        cx, cy = v.p00 * o[0] + v.offset_x * o[2], v.p11 * o[1] + v.offset_y * o[2]
        dx, dy = v.p00 * r[0] + v.offset_x * r[2], v.p11 * r[1] + v.offset_y * r[2]
    else:
        w, dw = one, none
        cx, cy = v.p00 * o[0] + v.offset_x, v.p11 * o[1] + v.offset_y
        dx, dy = v.p00 * r[0], v.p11 * r[1]
    bounds = (
        (w + cx, dw + dx), (w - cx, dw - dx), (w - cy, dw - dy), (w + cy, dw + dy),
        (z - v.near, -r[2]),
    )  # fmt: skip
    times = np.stack([_leaving(*bound) for bound in bounds])
    end, t = times.argmin(axis=0), times.min(axis=0)
    near = (end == 4) & np.isfinite(t)
    depth1 = np.maximum(np.where(near, v.near, z - t * r[2]), np.minimum(z, v.near))
    half_w, half_h = dtype(v.width) * dtype(0.5), dtype(v.height) * dtype(0.5)
    if v.perspective:
        endless = np.isinf(t)
        w1 = np.where(endless, dw, depth1)
        k0, k1 = 1 / z, np.where(endless, 0, 1 / depth1).astype(dtype)
        cx, cy = np.where(endless, dx, cx + t * dx), np.where(endless, dy, cy + t * dy)
        x1, y1 = half_w + cx / w1 * half_w, half_h - cy / w1 * half_h
    else:
        k0, k1 = z, depth1
        x1, y1 = half_w + (cx + t * dx) * half_w, half_h - (cy + t * dy) * half_h
    met = np.isfinite(t)
    x1 = np.where((end == 0) & met, 0, np.where((end == 1) & met, v.width, x1)).astype(dtype)
    y1 = np.where((end == 2) & met, 0, np.where((end == 3) & met, v.height, y1)).astype(dtype)
    to_x, to_y = x1 - px, y1 - py
    s_end = np.maximum(np.abs(to_x), np.abs(to_y))
    walks &= (s_end > OWN_PIXEL) & np.isfinite(s_end)
    return {
        "x": x, "y": y, "p0_x": px, "p0_y": py, "dp_x": to_x / s_end, "dp_y": to_y / s_end,
        "k0": k0, "dk": (k1 - k0) / s_end, "s_end": s_end, "walks": walks, "z": z,
        "facing": facing, **{f"o{i}": o[i] for i in range(3)}, **{f"r{i}": r[i] for i in range(3)},
        **{f"n{i}": n[i] for i in range(3)},
    }  # fmt: skip


def _planes(v: Any, g: dict[str, Any], rays: dict[str, Any], thickness: float) -> dict[str, Any]:
    """w, g_x, g_y and back of every pixel; w is −inf where it cannot be hit."""
    z, n, facing = g["depth"], g["geo"], rays["facing"]
    good = (z > 0) & (z < np.inf) & (facing < 0)
    end = np.where(g["back"] < np.inf, g["back"], z + z.dtype.type(thickness))
    if v.perspective:
        scale = 1 / (z * facing)
        gx, gy = n[0] * v.inverse_fx * scale, -(n[1] * v.inverse_fy * scale)
        w, back = 1 / z, 1 / end
    else:
        gx, gy = -(n[0] * v.inverse_fx / n[2]), n[1] * v.inverse_fy / n[2]
        w, back = -z, -end
    return {"w": np.where(good, w, -np.inf).astype(z.dtype), "gx": gx, "gy": gy, "back": back}


def _above(v: Any, g: dict[str, Any], ray: dict[str, Any], x: Any, y: Any, unit: float) -> AnyArray:
    """The tangent-plane rule, specification 4.5."""
    dtype = g["depth"].dtype.type
    z = g["depth"][y, x]
    m = [g["geo"][i][y, x] for i in range(3)]
    n = [ray[f"n{i}"] for i in range(3)]
    px, py = x.astype(dtype) + dtype(0.5), y.astype(dtype) + dtype(0.5)
    across, up = (px - v.cx) / v.fx, (v.cy - py) / v.fy
    one = np.ones_like(z)
    d, q, z_q, z_o = (across, up, -one), (across * z, up * z, -z), z, ray["z"]
    if not v.perspective:
        d, q, z_q, z_o = (0 * one, 0 * one, -one), (across, up, -z), one, one
    qo = [q[i] - ray[f"o{i}"] for i in range(3)]
    n_d = np.abs(_dot(n, d))
    rho = n_d / np.abs(_dot(m, d))
    size = np.abs(qo[0]) + np.abs(qo[1]) + np.abs(qo[2])
    rounding = dtype(8 * unit) * (n_d * z + np.abs(ray["facing"]) * ray["z"] + size)
    snapping = dtype(2.0**-8) * (
        (z_q * (np.abs(n[0]) + rho * np.abs(m[0])) + z_o * np.abs(n[0])) / v.fx
        + (z_q * (np.abs(n[1]) + rho * np.abs(m[1])) + z_o * np.abs(n[1])) / v.fy
    )
    return np.asarray(_dot(n, qo) > rounding + snapping)


def walk_planes(
    view: ViewParams,
    gbuffer: GBuffer,
    dtype: Any,
    *,
    thickness: float = np.inf,
    tangent: bool = True,
    facing: bool = False,
) -> Walked:
    """Trace every reflective pixel. Rays have no greatest length.

    dtype: np.float32 or np.float64, of every operation; buffers are converted to it first.
    tangent: the tangent-plane rule. facing: a crossing also needs n·R < 0 of the plane it meets.
    """
    assert gbuffer.geo_normal_vs is not None and gbuffer.normal_vs is not None
    assert gbuffer.reflectivity is not None and gbuffer.back_depth is not None
    unit = 2.0**-24 if np.float32 in (dtype, gbuffer.depth.dtype.type) else 2.0**-53
    g: dict[str, Any] = {
        "depth": gbuffer.depth.astype(dtype),
        "back": gbuffer.back_depth.astype(dtype),
        "geo": np.moveaxis(gbuffer.geo_normal_vs.astype(dtype), 2, 0),
        "normal": np.moveaxis(gbuffer.normal_vs.astype(dtype), 2, 0),
        "reflects": (gbuffer.reflectivity != 0).any(axis=2),
    }
    v = _numbers(view, dtype)
    status = np.zeros(gbuffer.depth.shape, np.uint8)
    hit_px = np.full((*status.shape, 2), np.nan, dtype)
    with np.errstate(all="ignore"):
        rays = _rays(v, g, dtype)
        planes = _planes(v, g, rays, thickness)
        ray = {name: values[rays["walks"]] for name, values in rays.items()}
        _walk(v, g, planes, ray, status, hit_px, unit, tangent, facing)
    return Walked(status, hit_px)


def _walk(
    v: Any,
    g: dict[str, Any],
    planes: dict[str, Any],
    ray: dict[str, Any],
    status: U8Array,
    hit_px: AnyArray,
    unit: float,
    tangent: bool,
    facing: bool,
) -> None:
    """Step all rays from cell to cell until each has ended; those that have are dropped."""
    dtype = hit_px.dtype.type
    at_y, at_x = ray["y"].copy(), ray["x"].copy()
    ahead_x, ahead_y = ray["dp_x"] > 0, ray["dp_y"] > 0
    ray |= {"step_x": np.where(ahead_x, 1, -1), "step_y": np.where(ahead_y, 1, -1)}

    def crossing(axis: str) -> AnyArray:
        border = ray[axis] + (ray[f"step_{axis}"] > 0)
        s = (border.astype(dtype) - ray[f"p0_{axis}"]) / ray[f"dp_{axis}"]
        return np.asarray(np.where(ray[f"left_{axis}"] > 0, s, dtype(np.inf)))

    for axis in "xy":
        last = np.floor(ray[f"p0_{axis}"] + ray["s_end"] * ray[f"dp_{axis}"]).astype(np.int64)
        left = np.maximum(0, (last - ray[axis]) * ray[f"step_{axis}"])
        ray[f"left_{axis}"] = np.where(ray[f"dp_{axis}"] != 0, left, 0)
        ray[f"s_{axis}"] = crossing(axis)
    ray |= {"own_x": at_x, "own_y": at_y, "free": np.ones(at_x.shape, bool)}
    ray["entry"] = np.zeros_like(ray["s_end"])
    first = np.minimum(ray["s_x"], ray["s_y"])
    ray["leave"] = np.minimum(np.maximum(first, 0), ray["s_end"])

    while len(ray["x"]):
        # Enter the next cell; a corner crossed exactly steps x first.
        more = (ray["left_x"] > 0) | (ray["left_y"] > 0)
        by_x = ray["s_x"] <= ray["s_y"]
        for axis, moves in (("x", by_x), ("y", ~by_x)):
            ray[axis] = ray[axis] + np.where(moves, ray[f"step_{axis}"], 0)
            ray[f"left_{axis}"] = ray[f"left_{axis}"] - moves
            ray[f"s_{axis}"] = np.where(moves, crossing(axis), ray[f"s_{axis}"])
        x, y = ray["x"], ray["y"]
        goes = more & (x >= 0) & (y >= 0) & (x < v.width) & (y < v.height)
        ray = {name: values[goes] for name, values in ray.items()}
        before, ray["entry"] = ray["entry"], ray["leave"]
        first = np.minimum(ray["s_x"], ray["s_y"])
        ray["leave"] = np.minimum(np.maximum(first, ray["entry"]), ray["s_end"])
        met, blocked, s, ray["free"] = _meet(v, g, planes, ray, before)

        # A crossing must pass the rules against the own surface.
        found = np.flatnonzero(met)
        some = {name: values[found] for name, values in ray.items()}
        x, y = some["x"], some["y"]
        good = np.ones(len(found), bool)
        if tangent:
            good &= _above(v, g, some, x, y, unit)
        if facing:
            normal = [g["geo"][i][y, x] for i in range(3)]
            good &= _dot(normal, [some[f"r{i}"] for i in range(3)]) < 0
        hit = some["own_y"][good], some["own_x"][good]
        status[hit] = Status.HIT
        for i, (axis, index) in enumerate((("x", x), ("y", y))):
            p = some[f"p0_{axis}"] + s[found] * some[f"dp_{axis}"]
            low, high = index.astype(dtype), (index + 1).astype(dtype)
            p = np.where(p >= high, np.nextafter(high, dtype(0)), np.maximum(p, low))
            hit_px[(*hit, i)] = p[good]
        status[ray["own_y"][blocked], ray["own_x"][blocked]] = Status.BLOCKED
        stays = ~blocked
        stays[found[good]] = False
        ray = {name: values[stays] for name, values in ray.items()}


def _meet(
    v: Any, g: dict[str, Any], planes: dict[str, Any], ray: dict[str, Any], before: AnyArray
) -> tuple[AnyArray, ...]:
    """Hit, blocked, where, free afterwards, as `ssr_ref.ssr.march_planes.meet_plane`."""
    dtype = g["depth"].dtype.type
    x, y, a, b = ray["x"], ray["y"], ray["entry"], ray["leave"]
    w, gx, gy, back = (planes[name][y, x] for name in ("w", "gx", "gy", "back"))

    def nearness(s: AnyArray) -> AnyArray:
        k = ray["k0"] + s * ray["dk"]
        return k if v.perspective else -k

    def behind_by(s: AnyArray) -> AnyArray:
        off_x = ray["p0_x"] + s * ray["dp_x"] - (x.astype(dtype) + dtype(0.5))
        off_y = ray["p0_y"] + s * ray["dp_y"] - (y.astype(dtype) + dtype(0.5))
        return np.asarray((w + (gx * off_x + gy * off_y)) - nearness(s))

    empty = w == -np.inf
    e0, ea, eb = behind_by(before), behind_by(a), behind_by(b)
    tau = np.abs(gx) + np.abs(gy)
    wa, wb = nearness(a), nearness(b)
    free = empty | ((e0 < 0) & (eb < 0)) | ~((eb > tau) & (wb >= back))
    at = before + (b - before) * (-e0) / (eb - e0)
    crossed = ~empty & (e0 < 0) & (eb >= 0) & (nearness(at) >= back)
    inside = ~empty & ~crossed & ~((e0 < 0) & (eb < 0)) & ray["free"]
    inside &= (np.maximum(ea, eb) >= 0) & (np.maximum(wa, wb) >= back)
    entered = (ea <= tau) & (wa >= back)
    contact = inside & entered & (ea >= 0) & (eb > ea)
    blocked = inside & ~entered & (g["back"][y, x] < np.inf)
    s = np.where(crossed, np.maximum(at, a), a)
    return crossed | contact, blocked, s, free

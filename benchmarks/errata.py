"""The numbers of docs/errata.md: what each slip of a published listing costs, as sentences.

    python -m benchmarks.errata

Each printed formula is restated here only as far as its number needs it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import ssr_ref
from ssr_ref.study import oracle_ray
from ssr_ref.study.accuracy import case
from ssr_ref.study.sampling_ray import spheres
from ssr_ref.vecmath import srgb

from .published import published_mirror_matrix, published_mirror_point, worst_displacement

RAYS = 400
AHEAD = (0.0, 0.0, -1.0)
BALL = ((0.0, 0.0, -5.0), 1.0)


def mirror_sentences() -> list[str]:
    """Wrong entries and displacements of the printed mirror matrix; the formula without d."""
    out = []
    for name, normal, offset in (
        ("the floor y = 0", (0.0, 1.0, 0.0), 0.0),
        ("the floor y = −0.5", (0.0, 1.0, 0.0), 0.5),
        ("the wall z = −2", (0.0, 0.0, 1.0), 2.0),
        ("the plane (2, 3, 6)/7 · p + 0.5 = 0", (2 / 7, 3 / 7, 6 / 7), 0.5),
    ):
        n = np.array(normal)
        true = ssr_ref.mirror_matrix(n, offset, row_vectors=True)
        entry = np.abs(published_mirror_matrix(n, offset) - true).max()
        moved = worst_displacement(n, offset)
        out.append(
            f"At {name} the worst entry is off by {entry:.3g} and a point of [−1, 1]³ by "
            f"{moved:.3g}."
        )
    n, point = np.array([0.0, 1.0, 0.0]), np.array([0.25, 0.75, -0.5])
    image = ssr_ref.mirror_matrix(n, 0.5)[:3] * np.append(point, 1.0)
    off = np.abs(published_mirror_point(point, n) - image.sum(axis=-1)).max()
    out.append(f"Without the offset an image at the floor y = −0.5 is {off:g} too high.")
    return out


def printed_edge_fade(u: float, v: float, power: float) -> float:
    """1 − (2·|uv − ½|)^p with the length of the vector, and no clamp."""
    x, y = u - 0.5, v - 0.5
    return float(1.0 - (2.0 * np.sqrt(x * x + y * y)) ** power)


def fade_sentences() -> list[str]:
    """Both fades at their ends."""
    uv = (np.arange(1000) + 0.5) / 1000
    u, v = np.meshgrid(uv, uv)
    negative = float((2.0 * np.hypot(u - 0.5, v - 0.5) > 1.0).mean())
    two, three = (printed_edge_fade(0.0, 0.0, p) for p in (2.0, 3.0))
    ours = float(ssr_ref.edge_fade((0.0, 0.0), 3.0))
    end = float(ssr_ref.distance_fade(4.0, 4.0, "published"))
    linear = float(ssr_ref.distance_fade(4.0, 4.0, "linear"))
    return [
        f"The corner gets {two:.2f} for exponent 2 and {three:.2f} for exponent 3; "
        f"{negative:.1%} of the image is negative; `edge_fade` gives {ours:g} in the corner.",
        f"At the maximum the printed fade is {end:g}, the linear one {linear:g}.",
    ]


def sphere_sentences() -> list[str]:
    """Roots, lengths and float32."""

    def roots(o: Any, d: Any, form: Any) -> str:
        found = ssr_ref.intersect_sphere(o, d, *BALL, form=form)
        return "a miss" if found.outcome == 0 else " and ".join(f"{t:.4g}" for t in found.t)

    start = (0.0, 0.0, 0.0)
    inside = roots((0.0, 0.0, -5.25), AHEAD, "distance")
    out = [
        f"From 0.25 behind the centre of a unit ball the roots are {inside}: the smaller one lies "
        "behind the ray.",
        f"A unit ball 5 ahead, d = (0, 0, −2): {roots(start, (0, 0, -2.0), 'textbook_unit')} "
        f"instead of {roots(start, (0, 0, -2.0), 'distance')}.",
        f"With d = (0, 0, −0.97): {roots(start, (0, 0, -0.97), 'textbook_unit')} instead of "
        f"{roots(start, (0, 0, -0.97), 'distance')}.",
    ]
    for i, distance in ((1, 1e3), (2, 1e4)):
        rays = spheres(RAYS, 40 + i, distance, single=True)
        wrong = []
        hits = np.array(
            [not np.isnan(float(oracle_ray.sphere_roots(*case(rays, k))[0])) for k in range(RAYS)]
        )
        for form in ("textbook", "distance"):
            found = ssr_ref.intersect_sphere(*rays, form=form, dtype=np.float32)
            wrong.append(float((np.isin(found.outcome, (1, 2)) != hits).mean()))
        out.append(
            f"In float32, {distance:g} radii away, {wrong[0]:.1%} of the textbook's hits and misses"
            f" are wrong, {wrong[1]:.1%} of the default's."
        )
    return out


def reflect_sentences() -> list[str]:
    """Unit vectors averaged, as interpolation does, are short."""
    out = []
    for s in (0.9, 1.1):
        got = ssr_ref.reflect((0.0, -1.0, 0.0), (0.0, s, 0.0), form="published")
        out.append(f"|n| = {s:g}: the component along n comes back times {-got[1]:.2f}.")
    half = np.sin(np.pi / 6)
    n = 0.5 * (np.array([half, np.sqrt(0.75), 0.0]) + np.array([-half, np.sqrt(0.75), 0.0]))
    d = np.array([np.sqrt(0.5), -np.sqrt(0.5), 0.0])
    short, true = ssr_ref.reflect(d, n, form="published"), ssr_ref.reflect(d, n)
    angle = np.degrees(np.arctan2(true[1], true[0]) - np.arctan2(short[1], short[0]))
    out.append(
        f"Between two normals 60° apart |n| = {np.sqrt((n * n).sum()):.3f}; a ray at 45° leaves "
        f"{angle:.1f}° too low and {np.sqrt((short * short).sum()):.2f} long."
    )
    return out


def goes_back(values: Any) -> bool:
    """Rises and falls."""
    steps = np.diff(values)
    return bool((steps > 0).any() and (steps < 0).any())


def walk_back_share(kind: Any, length: int, rays: int = 2000) -> tuple[float, float]:
    """Shares of walks that go back: by q(s)/k(s), and by 1/k(s) of the same ray.

    View depths w a factor up to 1000 apart, z = q/k at both ends equal to 2 ulp: the true z is
    monotone.
    """
    rng = np.random.default_rng(5)
    back = [0, 0]
    for _ in range(rays):
        k0, k1 = (kind(1) / kind(10.0 ** rng.uniform(-1, 2)) for _ in range(2))
        z0 = kind(rng.uniform(0.5, 2.0))
        z1 = kind(z0 * kind(1.0 + rng.integers(-2, 3) * float(np.finfo(kind).eps)))
        q0, q1, n = z0 * k0, z1 * k1, kind(length - 1)
        s = np.arange(length).astype(kind)
        k = k0 + s * ((k1 - k0) / n)
        back[0] += goes_back((q0 + s * ((q1 - q0) / n)) / k)
        back[1] += goes_back(kind(1) / k)
    return back[0] / rays, back[1] / rays


def quotient_sentences() -> list[str]:
    """Of walks of 3 and of 64 samples."""
    out = []
    for kind in (np.float32, np.float64):
        few, many = walk_back_share(kind, 3), walk_back_share(kind, 64)
        out.append(
            f"{kind.__name__}: of 2000 walks of 3 samples {few[0]:.1%} go back by q/k, of 64 "
            f"samples {many[0]:.1%}; by 1/k {few[1] + many[1]:.0%}."
        )
    return out


def depth_sentences() -> list[str]:
    """A forgotten factor, and what float32 loses."""
    near, far, z = 0.1, 1000.0, 250.0
    d = float(ssr_ref.device_depth(z, "d3d", near=near, far=far))
    printed = near / (far - d * (far - near))
    right = float(ssr_ref.linear_depth(d, "d3d", near=near, far=far))
    out = [f"Near 0.1, far 1000, z = 250: {printed:.4g} instead of {right:.4g}."]
    for near, far in ((0.1, 1e3), (0.01, 1e5)):
        rng = np.random.default_rng(3)
        everywhere, far_half = (
            near * (far / near) ** rng.random(20000),
            1.0 - 0.5 * rng.random(20000) ** 2,
        )
        z_all = np.concatenate([everywhere, far * far_half]).clip(near, far)
        worst = []
        for name in ("d3d", "reversed"):
            kind: dict[str, Any] = {"near": near, "far": far}
            stored = ssr_ref.device_depth(z_all, name, **kind).astype(np.float32)
            back = ssr_ref.linear_depth(stored, name, **kind)
            worst.append(float(np.abs(back / z_all - 1.0).max()))
        out.append(
            f"Near {near:g}, far {far:g}: float32 standard depth loses {worst[0]:.1e} of z, "
            f"reversed {worst[1]:.1e}."
        )
    return out


def srgb_sentences() -> list[str]:
    """The jump at each threshold."""
    x, c = srgb.LINEAR_THRESHOLD, srgb.CODE_THRESHOLD
    encode = srgb.SLOPE * x - (srgb.SCALE * x ** (1.0 / srgb.EXPONENT) - srgb.OFFSET)
    decode = ((c + srgb.OFFSET) / srgb.SCALE) ** srgb.EXPONENT - c / srgb.SLOPE
    return [
        f"At 0.0031308 the curve lies {encode:.1e} under the line, {255 * encode:.1e} of a byte's "
        f"step; at 0.04045 {decode:.1e} over it."
    ]


def sentences() -> list[str]:
    """All of them, in the order of the page."""
    return [
        *mirror_sentences(), *fade_sentences(), *sphere_sentences(), *reflect_sentences(),
        *quotient_sentences(), *depth_sentences(), *srgb_sentences(),
    ]  # fmt: skip


if __name__ == "__main__":
    print("\n".join(sentences()))

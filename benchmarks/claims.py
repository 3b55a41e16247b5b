"""The numbers of docs/maths.md: what the naive form of a formula gives beside the stable one.

    python -m benchmarks.claims

u is that of float64 unless a sentence says otherwise; exact values are rationals.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

import ssr_ref

U = 2.0**-53


def off(value: float, exact: Any) -> float:
    """Relative error in u of float64."""
    return float(abs(Fraction(float(value)) / Fraction(exact) - 1)) / U


def error_free() -> list[str]:
    """What plain sums and products drop."""
    a, d = 1.0 + 2.0**-30, 1.0 + 2.0**-29
    ours = float(ssr_ref.difference_of_products(a, a, 1.0, d))
    lost = float(ssr_ref.two_sum(1.0, 2.0**-60).error)
    square = float(ssr_ref.two_prod(a, a).error)
    return [
        f"1 + 2⁻⁶⁰ rounds to 1 and `two_sum` hands back the lost {lost:.2g}; of (1 + 2⁻³⁰)² "
        f"`two_prod` hands back {square:.2g}.",
        f"(1 + 2⁻³⁰)² − (1 + 2⁻²⁹) is 2⁻⁶⁰ = {2.0**-60:.3g}: plainly {a * a - 1.0 * d:g}, here "
        f"{ours:.3g}.",
    ]


def mirror() -> list[str]:
    """The diagonal entry 1 − 2·x²/(n·n) where it cancels."""
    n = np.array([1.0, 1.0, 2.0**-12])
    exact = 1 - Fraction(2) / (2 + Fraction(1, 2**24))
    unit = n / np.sqrt((n * n).sum())
    naive = off(1.0 - 2.0 * unit[0] * unit[0], exact)
    ours = off(ssr_ref.mirror_matrix(n, 0.0)[0, 0], exact)
    return [
        f"For n = (1, 1, 2⁻¹²) the first entry of the normalise-first form is off by {naive:.2g}u, "
        f"here by {ours:.1g}u."
    ]


def line() -> list[str]:
    """A float32 running sum on a long line."""
    steps, rise = 4000, 1999
    total, slope = np.float32(0.5), np.float32(rise) / np.float32(steps)
    drift, wrong = 0.0, 0
    exact = ssr_ref.dda_line((0, 0), (steps, rise))[:, 1]
    for i in range(steps + 1):
        true = Fraction(1, 2) + Fraction(i * rise, steps)
        drift = max(drift, float(abs(Fraction(float(total)) - true)))
        wrong += int(np.floor(total)) != exact[i]
        total = np.float32(total + slope)
    return [
        f"From (0, 0) to (4000, 1999) a float32 running sum drifts by {drift:.2g} px and "
        f"{wrong} of 4001 pixels are wrong; here none."
    ]


def clip() -> list[str]:
    """A ray that rises past the eye, projected before it is clipped."""
    camera = ssr_ref.Camera.frustum(np.eye(4), -1.0, 1.0, -1.0, 1.0, near=1.0)
    start, d = np.array([0.0, 0.0, -4.0]), np.array([1.0, 0.0, 2.0])
    end = start + 4.0 * d
    found = ssr_ref.clip_ray(camera, (8, 8), start, d)
    side = ssr_ref.End(int(found.end)).name
    ndc = found.clip[0] / found.clip[2]
    return [
        f"In a frustum |x| ≤ depth the ray from (0, 0, −4) along (1, 0, 2) reaches x/w = "
        f"{end[0] / -end[2]:g} at (4, 0, 4), the left border; clipped it ends at x/w = {ndc:.3g}, "
        f"`{side}`."
    ]


def depth() -> list[str]:
    """The usual arrangement in float32, decoded from the same codes."""
    near, far = np.float32(0.1), np.float32(1e3)
    d = (1.0 - np.arange(1, 4000) * 2.0**-24).astype(np.float32)
    n, f = Fraction(float(near)), Fraction(float(far))
    usual = near * far / (far - d * (far - near))
    r = near / far
    ours = near / (r + (np.float32(1) - d) * (np.float32(1) - r))

    def worst(z: Any) -> float:
        exact = [n * f / (f - Fraction(float(v)) * (f - n)) for v in d]
        return max(float(abs(Fraction(float(v)) / x - 1)) for v, x in zip(z, exact)) * 2.0**24

    return [
        f"In float32 at near 0.1, far 1000 the usual form is off by up to {worst(usual):.2g} · "
        f"2⁻²⁴, this one by {worst(ours):.2g} · 2⁻²⁴."
    ]


def barycentric() -> list[str]:
    """The middle of a sliver, from plain products."""
    a, b, c = (0.1, 0.1), (0.7, 0.7 + 2.0**-48), (1.3, 1.3)
    p = (0.7, 0.7 + 2.0**-50)

    def area(x: Any, y: Any, z: Any) -> Any:
        return (y[0] - x[0]) * (z[1] - x[1]) - (y[1] - x[1]) * (z[0] - x[0])

    exact = [tuple(Fraction(t) for t in v) for v in (a, b, c, p)]
    want = area(exact[3], exact[2], exact[0]) / area(*exact[:3])
    plain = area(p, c, a) / area(a, b, c)
    ours = ssr_ref.barycentrics(p, a, b, c, (1.0, 1.0, 1.0))[1]
    return [
        f"In a triangle 2⁻⁴⁸ high the weight of the tip is {float(want):.4f}: plain differences "
        f"and products give {plain:.4f}, here {ours:.4f}."
    ]


def directions() -> list[str]:
    """Next to a face's edge, the seam, a pole, the middle of the ball, the equator."""
    s = -(1.0 - 3.0 * 2.0**-53) * 3.0
    exact = (Fraction(s) + 3) / 6
    cube = off(0.5 * (s / 3.0 + 1.0), exact)
    _, uv = ssr_ref.cube_face((s, 0.0, 3.0))
    seam = float(ssr_ref.latlong_uv((-1e-18, 0.0, 1.0))[0])
    pole = float(ssr_ref.latlong_uv((1e-9, 1.0, 0.0))[1])
    ball = float(ssr_ref.ball_uv((1e-4, 0.0, 1e5))[0]) - 0.5
    code = float(ssr_ref.octahedral_encode((1.0, 1e-20, -1e-20))[1])
    plain = 0.5 + np.arctan2(-1e-18, -1.0) / (2.0 * np.pi)
    radius = np.sqrt((1.0 - 1e5 / np.sqrt(1e-4 * 1e-4 + 1e5 * 1e5)) / 2.0)
    fold = 1.0 - 1.0 / (1.0 + 1e-20 + 1e-20)
    return [
        f"Next to a face's edge ½(s/m + 1) is off by {cube:.2g}u, (s + m)/2m by "
        f"{off(uv[0], exact):.2g}u.",
        f"For (−1e-18, 0, 1), beside the seam, ½ + atan2(x, −z)/2π gives u = {plain:g}, here "
        f"{seam:.3g}; for (1e-9, 1, 0), beside the pole, acos(y)/π gives {np.arccos(1.0):g}, here "
        f"{pole:.3g}.",
        f"For (1e-4, 0, 1e5) √((1 − z)/2) of the unit vector gives r = {radius:g}, here "
        f"u − ½ = {ball:.2g}.",
        f"Of (1, 1e-20, −1e-20) the code v is {code:.2g}; 1 − |x|/Σ gives {fold:g}.",
    ]


def noise() -> list[str]:
    """Range of the jitter."""
    x, y = np.meshgrid(np.arange(1000), np.arange(1000))
    j = ssr_ref.jitter(x, y)
    return [
        f"A million pixels of seed 0: mean {j.mean():.4f}, least {j.min() * 2**24:.0f} · 2⁻²⁴, "
        f"greatest 1 − {(1.0 - j.max()) * 2**24:.0f} · 2⁻²⁴."
    ]


def sentences() -> list[str]:
    """All of them, in the order of the page."""
    return [
        *error_free(), *mirror(), *line(), *clip(), *depth(), *barycentric(), *directions(),
        *noise(),
    ]  # fmt: skip


if __name__ == "__main__":
    print("\n".join(sentences()))

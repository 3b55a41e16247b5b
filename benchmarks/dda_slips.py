"""What each slip of the published DDA changes on a built-in scene, at stride 1 and 4.

    python -m benchmarks.dda_slips [SCENE]

Rays of the right DDA (column interval, no refinement) beside the same with one slip alone, and with
all of them; what hangs on bias, jitter and thickness; then slips of the buffers and of units, made
by settings.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

import ssr_ref
from benchmarks.common import machine
from benchmarks.slips import HEAD, count, drawn, table
from ssr_ref.buffers import GBuffer, HitBuffer
from ssr_ref.camera import ViewParams
from ssr_ref.pipeline import Frame
from ssr_ref.scene import Scene
from ssr_ref.ssr import listing_dda
from ssr_ref.ssr.trace import trace
from ssr_ref.typed import FloatArray

SIZE = (480, 270)
STEPS = 1024
SLIPS = (
    "OWN_DEPTH",
    "OWN_PIXEL",
    "NO_PLANE",
    "SUMMED",
    "STRICT",
    "SHIFTED",
    "EMPTY_ZERO",
    "NO_WINDOW",
    "NUDGE",
    "PAST_END",
    "NO_TAIL",
    "LATE_POINT",
    "AFTER_LOOP",
    "OWN_DEPTH NO_PLANE",
    "OWN_DEPTH OWN_PIXEL NO_PLANE",
    "ALL_SLIPS",
)
WITH_BIAS = ("OWN_DEPTH", "OWN_PIXEL", "SHIFTED", "EMPTY_ZERO", "OWN_DEPTH NO_PLANE", "ALL_SLIPS")
UNMOVED = ("OWN_DEPTH OWN_PIXEL NO_PLANE", "OWN_DEPTH OWN_PIXEL NO_PLANE STRICT", "ALL_SLIPS")
BIAS_PER_THICKNESS = 0.25
FAR = 1000.0


def bits_of(names: Iterable[str]) -> dict[str, int]:
    """The bits of slips, several in a name, by name."""
    return {name: sum(getattr(listing_dda, n) for n in name.split()) for name in names}


def settings_of(stride: int, **kw: object) -> ssr_ref.Settings:
    """The published DDA: constant thickness r/64, jitter."""
    return ssr_ref.Settings(
        **{"size": SIZE, "stride": stride, "jitter": True, "max_steps": STEPS, "listing": True}
        | {"thickness_from": "constant"}
        | kw
    )  # type: ignore[arg-type]


def nearest_back_of_all(scene: Scene, settings: ssr_ref.Settings) -> FloatArray:
    """(H, W) nearest back face, before the front face or behind: the scene inside out."""
    meshes = tuple(
        replace(m, primitives=tuple(replace(p, faces=p.faces[:, ::-1]) for p in m.primitives))
        for m in scene.meshes
    )
    return ssr_ref.render(replace(scene, meshes=meshes), settings=settings).gbuffer.depth


def single_sided(scene: Scene) -> Scene:
    """The same without double-sided faces: open surfaces seen from behind are not drawn."""
    return replace(scene, materials=tuple(replace(m, double_sided=False) for m in scene.materials))


def other_settings(frame: Frame, view: ViewParams) -> list[str]:
    """Rows of slips that settings or other buffers make, against the default DDA at stride 1."""
    assert isinstance(frame.scene, Scene)
    default = ssr_ref.Settings(size=SIZE, jitter=True)
    closed = ssr_ref.render(frame.scene, settings=default)
    any_object = ssr_ref.render(frame.scene, settings=replace(default, back_any_object=True))
    back = closed.settings
    constant = replace(back, thickness_from="constant")
    coarse = replace(constant, stride=4, refine="none")
    assert back.thickness is not None
    one_side = single_sided(frame.scene)
    culled = ssr_ref.render(one_side, settings=default).gbuffer
    of_all = nearest_back_of_all(one_side, default)
    g = closed.gbuffer
    cases: list[tuple[str, ssr_ref.Settings, ssr_ref.Settings, GBuffer, GBuffer]] = [
        ('interval = "point"', constant, replace(constant, interval="point"), g, g),
        ('interval = "point", stride 4', coarse, replace(coarse, interval="point"), g, g),
        ("back faces, thickness = inf", back, replace(back, thickness=np.inf), g, g),
        ("back_any_object", back, back, g, any_object.gbuffer),
        ("nearest back face of all", back, back, culled, replace(culled, back_depth=of_all)),
        ("thickness × far", constant, replace(constant, thickness=back.thickness * FAR), g, g),
        ("thickness ÷ far", constant, replace(constant, thickness=back.thickness / FAR), g, g),
    ]
    rows = []
    for name, right_settings, settings, buffers, others in cases:
        right = trace(view, buffers, right_settings)
        rays = int((right.steps > 0).sum())
        other = trace(view, others, settings)
        rows.append(count(view, buffers, right, other, rays, settings.stride).row(name))
    before = (of_all < culled.depth).sum() / np.isfinite(culled.depth).sum()
    return [*rows, f"\nThe nearest back face of all is before the front in {before:.2%} of pixels."]


def steps_of(view: ViewParams, frame: Frame) -> str:
    """Samples a ray takes when nothing ends it at the image's border."""

    def mean(slips: int) -> float:
        hits: HitBuffer = trace(view, frame.gbuffer, frame.settings, slips=slips)
        return float(hits.steps[hits.steps > 0].mean())

    return (
        f"Samples a ray: {mean(0):.1f}, with NO_WINDOW {mean(listing_dda.NO_WINDOW):.1f} "
        f"(at most {STEPS})."
    )


def thick_enough(view: ViewParams, frame: Frame) -> str:
    """Rays that hit without a sample, for a thickness just under 100 and of 100."""
    shares = []
    for thickness in (np.nextafter(100.0, 0.0), 100.0):
        settings = replace(frame.settings, thickness=thickness)
        hits = trace(view, frame.gbuffer, settings, slips=listing_dda.AFTER_LOOP)
        shares.append(float(np.isfinite(hits.hit_px[..., 0])[hits.steps == 0].sum()))
    rays = shares[1]
    return (
        f"AFTER_LOOP: {shares[0]:.0f} rays hit without a sample at a thickness below 100, all "
        f"{rays:.0f} at 100."
    )


def drift_sentences(samples: int = 2000, rays: int = 3000) -> list[str]:
    """P and k of 2000 samples: carried or from the index, each in float32 and float64.

    Against the index in extended precision, from the same rounded start and increment.
    """
    rng = np.random.default_rng(7)
    out = []
    index = np.arange(samples, dtype=np.float64)
    for kind in (np.float32, np.float64):
        p0 = (rng.integers(0, 1000, rays) + 0.5).astype(kind)
        dp = rng.uniform(-0.25, 1.0, rays).astype(kind)
        k0, k1 = (1.0 / 10.0 ** rng.uniform(0.0, 1.0, rays) for _ in range(2))
        dk = ((k1 - k0) / samples).astype(kind)
        k0 = k0.astype(kind)
        worst = {}
        for name in ("carried", "from the index"):
            drift, deep, other = 0.0, 0.0, 0
            for j in range(rays):
                if name == "carried":
                    p = np.add.accumulate(np.r_[p0[j], np.full(samples - 1, dp[j])], dtype=kind)
                    k = np.add.accumulate(np.r_[k0[j], np.full(samples - 1, dk[j])], dtype=kind)
                else:
                    p = p0[j] + index.astype(kind) * dp[j]
                    k = k0[j] + index.astype(kind) * dk[j]
                true_p = np.longdouble(p0[j]) + index * np.longdouble(dp[j])
                true_k = np.longdouble(k0[j]) + index * np.longdouble(dk[j])
                drift = max(drift, float(np.abs(p - true_p).max()))
                deep = max(deep, float(np.abs(true_k / k - 1.0).max()))
                other += int((np.floor(p) != np.floor(true_p)).sum())
            worst[name] = (
                f"{drift:.1e} px, {deep:.1e} of the depth, {other / (rays * samples):.3%} of the "
                "samples in another pixel"
            )
        out += [f"{kind.__name__}, {name}: {text}." for name, text in worst.items()]
    return out


def filtered_sentence(view: ViewParams, gbuffer: GBuffer, thickness: float) -> str:
    """Depth through a bilinear sampler: how often it is on no surface.

    At random places of the drawn pixels: the filtered depth of the four texels about it lies
    farther than the thickness from each, or is empty where one of them is.
    """
    rng = np.random.default_rng(11)
    z = gbuffer.depth.astype(np.float64)
    x, y = (rng.random(200_000) * (n - 1) for n in (view.width, view.height))
    x0, y0 = x.astype(int), y.astype(int)
    texels = np.stack([z[y0 + j, x0 + i] for j in (0, 1) for i in (0, 1)])
    u, v = x - x0, y - y0
    weights = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v])
    whole = np.isfinite(texels).all(axis=0)
    some = np.isfinite(texels).any(axis=0)
    mixed = (weights * np.where(whole, texels, 0.0)).sum(axis=0)
    nowhere = whole & (np.abs(texels - mixed).min(axis=0) > thickness)
    far_off, mixes = (n.sum() / some.sum() for n in (nowhere, some & ~whole))
    return (
        f"Depth through a bilinear sampler: {far_off:.2%} of places have a depth farther than the "
        f"thickness from every texel about them, {mixes:.2%} mix in an empty one."
    )


def main() -> None:
    name = sys.argv[1] if len(sys.argv) > 1 else "teapot"
    print(f"{name} {SIZE[0]}x{SIZE[1]}, jitter; {machine()}")
    frame, view = drawn(name, settings_of(1))
    thickness = frame.settings.thickness
    assert thickness is not None
    bias = BIAS_PER_THICKNESS * thickness
    blocks: tuple[tuple[str, dict[str, object], tuple[str, ...]], ...] = (
        ("stride 1", {}, SLIPS),
        ("stride 4", {"stride": 4}, SLIPS),
        (f"stride 1, bias {bias:g}", {"bias": bias}, WITH_BIAS),
        (f"stride 4, bias {bias:g}", {"bias": bias, "stride": 4}, WITH_BIAS),
        ("stride 1, no jitter", {"jitter": False}, UNMOVED),
        ("stride 1, thickness inf", {"thickness": np.inf}, ("EMPTY_ZERO",)),
    )
    for title, kw, slips in blocks:
        made = replace(frame.settings, **kw)  # type: ignore[arg-type]
        rays, rows = table(replace(frame, settings=made), view, bits_of(slips))
        print(f"\n{title}, {rays} rays\n")
        print("\n".join([HEAD, *rows]))
    print("\nby settings, stride 1\n")
    print("\n".join([HEAD, *other_settings(frame, view)]))
    print(steps_of(view, frame))
    print(thick_enough(view, frame))
    print(filtered_sentence(view, frame.gbuffer, thickness))
    print("\n".join(drift_sentences()))


if __name__ == "__main__":
    main()

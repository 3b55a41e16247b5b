"""Which hit test gives no self-hits, closed contacts, and the fewest missed and false hits at once.

    python -m benchmarks.hit_rules [--size 320x181] [--buffers exact] [--table main] [SCENE ...]

Tables (docs/hit_rules.md holds all): `main`, every rule; `jitter`, the same with start offsets;
`concave`, what the tangent-plane rule costs where a body does see itself; `float32`, the plane rule
in float32 arithmetic. Buffers: `benchmarks.hit_scenes.BUFFERS`.

Columns: self, hits on lone convex mirrors, in % of their rays (a count below 0.01 %), "grazing"
those of rays that leave along the surface; missed,
wrong, false, p50, p95: `ssr_ref.analytic.HitErrors`, means over the scenes in perspective and
orthographic; fetches a ray; gap, px of a box and of a ball that stand on a mirror, greatest and
mean over columns. Sheets are half-spaces (thickness inf).
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from ssr_ref import HitBuffer, Settings, Status
from ssr_ref.analytic import contact_gaps, hit_errors
from ssr_ref.analytic.metrics import FAR_PX, distances
from ssr_ref.analytic.scenes import SCENES
from ssr_ref.buffers import TruthClass
from ssr_ref.cli.parsing import parse_size
from ssr_ref.ssr.trace import trace

from .common import machine
from .hit_scenes import BUFFERS, STANDING, Case, grazing, lone_bodies, make_case
from .plane_walk import walk_planes

Method = dict[str, Any]
NO_RULE: Method = {"self_rejection": "none"}
PLANES: Method = {"surface": "plane"}
CELLS: Method = {"tracer": "cells"}
FITTED: Method = {"geo_normals": "fitted"}
RULES: dict[str, Method] = {
    "published interval": {"interval": "published", **NO_RULE},
    "published, bias 0.01": {"interval": "published", "bias": 0.01, **NO_RULE},
    "column interval": NO_RULE,
    "column, tangent plane": {},
    "point": {"interval": "point", **NO_RULE},
    "cell interval": {"interval": "cell", **NO_RULE},
    "cell, tangent plane": {"interval": "cell"},
    "slope bias": {"self_rejection": "slope_bias"},
    "exact cells": CELLS,
    "slope bias, stride 4": {"self_rejection": "slope_bias", "stride": 4},
    "column, stride 4": {"stride": 4},
    "planes, no tangent plane": PLANES | CELLS | NO_RULE,
    "planes, exact cells": PLANES | CELLS,
    "planes, one fetch": PLANES,
    "planes, stride 4": PLANES | {"stride": 4},
    "planes, stride 16": PLANES | {"stride": 16},
    "fitted, column": FITTED,
    "fitted, planes": PLANES | CELLS | FITTED,
}
JITTERED = (
    "published interval", "column interval", "column, tangent plane", "point", "slope bias",
    "planes, one fetch", "planes, stride 4", "planes, stride 16",
)  # fmt: skip
SEEDS = (1, 2, 3)
FLOAT32 = (
    (np.float64, True, False), (np.float64, False, False), (np.float32, True, False),
    (np.float32, True, True), (np.float32, False, False), (np.float32, False, True),
)  # fmt: skip
"""Arithmetic, tangent-plane rule, n·R < 0."""
QUALITY = ("sphere_on_plane", "box_on_plane", "corner", "clutter")
CONCAVE = ("corner", "inside_a_sphere")


def settings_of(case: Case, method: Method) -> Settings:
    """Half-spaces, no limit on the ray."""
    size = (case.view.width, case.view.height)
    fixed: Method = {"size": size, "thickness": np.inf, "max_distance": np.inf}
    return Settings(**fixed | method).resolved(1.0)


def self_share(cases: Iterable[Case], methods: Iterable[Method]) -> str:
    """Hits on lone bodies, of the rays that walk."""
    hits = rays = 0
    for case in cases:
        for method in methods:
            status = trace(case.view, case.gbuffer, settings_of(case, method)).status
            hits += int((status == Status.HIT).sum())
            rays += int((case.gbuffer.depth < np.inf).sum())
    return share(hits, rays)


def share(part: int, whole: int) -> str:
    """A percentage, or the count where it is below 0.01 %."""
    if not part:
        return "0"
    return f"{part}" if part < 1e-4 * whole else f"{100.0 * part / max(whole, 1):.2f} %"


def quality(cases: dict[str, list[Case]], methods: list[Method]) -> list[str]:
    """Missed, wrong, false, p50 / p95, fetches and the gaps of box and ball."""
    rows: list[tuple[float, ...]] = []
    gaps: dict[str, list[int]] = {name: [] for name in STANDING}
    for name, some in cases.items():
        for case in some:
            for method in methods:
                hits = trace(case.view, case.gbuffer, settings_of(case, method))
                rows.append(errors(hits, case))
                if name in STANDING:
                    gaps[name] += gaps_of(hits, case, STANDING[name], method)
    missed, wrong, false, p50, p95, fetches = np.mean(rows, axis=0)
    return [
        f"{missed:.2%}", f"{wrong:.2%}", f"{false:.2%}", f"{p50:.3f} / {p95:.3f}",
        f"{fetches:.0f}",
        *(f"{max(some)} / {np.mean(some):.2f}" if some else "" for some in gaps.values()),
    ]  # fmt: skip


def errors(hits: HitBuffer, case: Case) -> tuple[float, ...]:
    """The numbers of one image."""
    e = hit_errors(hits, case.truth, case.gbuffer)
    fetches = int(hits.fetches.sum(dtype=np.int64)) / max(e.rays, 1)
    return e.missed, e.wrong, e.false, e.p50, e.p95, fetches


def gaps_of(hits: HitBuffer, case: Case, shape: int, method: Method) -> list[int]:
    """The gap of each column at a contact, px."""
    stride = method.get("stride", 1)
    found = contact_gaps(hits, case.truth, case.gbuffer, floor=0, shape=shape, stride=stride)
    return [int(g) for g in found if g >= 0]


def main_table(
    bodies: dict[str, list[Case]], cases: dict[str, list[Case]], jitter: bool
) -> Iterable[list[str]]:
    """One row a rule; with jitter three seeds each."""
    yield ["rule", "self: ball", "planes", "boxes", "grazing", "missed", "wrong", "false",
           "p50 / p95", "fetches", "gap: box", "ball"]  # fmt: skip
    for name in JITTERED if jitter else RULES:
        methods = [RULES[name]]
        if jitter:
            methods = [RULES[name] | {"jitter": True, "seed": seed} for seed in SEEDS]
        own = [self_share(some, methods) for some in bodies.values()]
        yield [name, *own, *quality(cases, methods)]


def concave_table(cases: dict[str, list[Case]]) -> Iterable[list[str]]:
    """What the tangent-plane rule takes and gives where a body reflects itself."""
    yield ["scene", "rule", "V", "right without", "of these lost with", "of these moved",
           "false or wrong without", "with"]  # fmt: skip
    for name, some in cases.items():
        for rule in ("column, tangent plane", "exact cells", "planes, exact cells",
                     "fitted, planes"):  # fmt: skip
            total = np.zeros(6, np.int64)
            for case in some:
                settings = settings_of(case, RULES[rule])
                known = case.truth.truth == TruthClass.VISIBLE
                rays = case.truth.truth != TruthClass.NO_RAY
                found = []
                for chosen in (replace(settings, **NO_RULE), settings):
                    hits = trace(case.view, case.gbuffer, chosen)
                    hit = hits.status == Status.HIT
                    right = hit & (distances(hits, case.truth) <= FAR_PX)
                    found.append((hit, right & known, int((hit & rays & ~right).sum())))
                (_, right, bad), (hit, right_with, bad_with) = found
                lost, moved = right & ~hit, right & hit & ~right_with
                total += [known.sum(), right.sum(), lost.sum(), moved.sum(), bad, bad_with]
            yield [name, rule, *(str(n) for n in total)]


def float32_table(
    bodies: dict[str, list[Case]], cases: dict[str, list[Case]]
) -> Iterable[list[str]]:
    """The plane rule in exact cells, every operation in one float type."""
    yield ["arithmetic", "tangent plane", "n·R < 0", "self: ball", "planes", "boxes", "grazing",
           "missed", "wrong", "false", "p50 / p95"]  # fmt: skip
    for dtype, tangent, facing in FLOAT32:
        own = []
        for some in bodies.values():
            walks = [_walked(case, dtype, tangent, facing) for case in some]
            rays = sum(int((c.gbuffer.depth < np.inf).sum()) for c in some)
            own.append(share(sum(int((h.status == Status.HIT).sum()) for h in walks), rays))
        quality = [_walked(c, dtype, tangent, facing) for some in cases.values() for c in some]
        every = [case for some in cases.values() for case in some]
        rows = [errors(walked, case) for walked, case in zip(quality, every, strict=True)]
        missed, wrong, false, p50, p95, _ = np.mean(rows, axis=0)
        chosen = ("yes" if tangent else "no", "yes" if facing else "no")
        shares = (f"{missed:.2%}", f"{wrong:.2%}", f"{false:.2%}")
        yield [dtype.__name__, *chosen, *own, *shares, f"{p50:.4f} / {p95:.4f}"]


def _walked(case: Case, dtype: Any, tangent: bool, facing: bool) -> HitBuffer:
    walked = walk_planes(case.view, case.gbuffer, dtype, tangent=tangent, facing=facing)
    nothing = np.zeros(walked.status.shape)
    counts = nothing.astype(np.uint32)
    return HitBuffer(
        status=walked.status, end=nothing.astype(np.uint8), flags=nothing.astype(np.uint8),
        hit_px=walked.hit_px.astype(np.float64), hit_depth=nothing, residual=nothing,
        length=nothing, steps=counts, fetches=counts,
    )  # fmt: skip


def cases_of(names: Iterable[str], size: tuple[int, int], buffers: str) -> dict[str, list[Case]]:
    """Each scene in perspective and orthographic."""
    return {
        name: [make_case(SCENES[name](orthographic=o), size, buffers) for o in (False, True)]
        for name in names
    }


def bodies_of(size: tuple[int, int], buffers: str) -> dict[str, list[Case]]:
    """Lone bodies by kind; the last kind is all of them with grazing rays."""
    bodies = {
        kind: [make_case(scene, size, buffers, coarse=True) for scene in some]
        for kind, some in lone_bodies().items()
    }
    every = [case for some in bodies.values() for case in some]
    return bodies | {"grazing": [grazing(case, seed) for seed, case in enumerate(every)]}


def print_table(rows: Iterable[list[str]]) -> None:
    """As a table of the documentation, a row as soon as it is known."""
    for i, row in enumerate(rows):
        print("| " + " | ".join(row) + " |", flush=True)
        if i == 0:
            print("|" + "---|" * len(row))


def main() -> None:
    """Print the tables that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: as in the docs")
    parser.add_argument("--size", type=parse_size, default=(320, 181))
    parser.add_argument("--buffers", choices=BUFFERS, default="exact")
    parser.add_argument("--table", choices=("main", "jitter", "concave", "float32"), default="main")
    given = parser.parse_args()
    for name in given.scenes:
        if name not in SCENES:
            parser.error(f"there is no scene '{name}'; expected some of {', '.join(SCENES)}")
    print(machine())
    default = CONCAVE if given.table == "concave" else QUALITY
    cases = cases_of(given.scenes or default, given.size, given.buffers)
    print(f"{given.size[0]}x{given.size[1]}, {given.buffers} buffers: {', '.join(cases)}\n")
    if given.table == "concave":
        print_table(concave_table(cases))
        return
    bodies = bodies_of(given.size, given.buffers)
    if given.table == "float32":
        print_table(float32_table(bodies, cases))
    else:
        print_table(main_table(bodies, cases, given.table == "jitter"))


if __name__ == "__main__":
    main()

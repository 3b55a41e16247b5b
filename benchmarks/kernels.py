"""Time of every formula of the registry beside its measured error and the bound it states.

    NUMBA_NUM_THREADS=1 python -m benchmarks.kernels [-o FOLDER] [--only WORD] [--cases N]

Prints Markdown: first one row a formulation (nanoseconds a case over arrays, worst error over hard
inputs in u over the condition number, stated bound), then line against sphere: the share of wrong
answers of each form by distance, against mpmath. -o writes kernels.csv, spheres.csv, kernels.json
and, if matplotlib is there, kernels.png (error against time).
"""

from __future__ import annotations

import argparse
import csv
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import mpmath
import numpy as np

import ssr_ref
from ssr_ref.maths.registry import KernelInfo, kernels
from ssr_ref.study import oracle_ray
from ssr_ref.study.accuracy import case, errors
from ssr_ref.study.sampling import examples
from ssr_ref.study.sampling_ray import near_spheres, spheres

from .common import machine, median_ms

SIZE = 20_000
RAYS = 400
FORMS = ("textbook", "textbook_unit", "stable", "kahan", "hearn_baker", "distance")
UNITS = {"float64": 2.0**-53, "float32": 2.0**-24}
DISTANCES = (1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8)


@dataclass(frozen=True)
class Row:
    """One formulation in one precision."""

    key: str
    precision: str
    ns: float
    error: float  # worst, in u (1 + condition number)
    bound: float
    measure: str
    why: str


@dataclass(frozen=True)
class SphereRow:
    """One form on one set of rays."""

    region: str
    form: str
    precision: str
    hits: float  # share of rays that truly hit
    wrong: float  # share with a wrong hit or miss
    median: float  # relative error of the nearer root, where both hit
    worst: float
    ns: float


def time_ns(info: KernelInfo, **options: Any) -> float:
    """Nanoseconds a case over arrays of `SIZE` cases, the wrapper's copies included."""
    arguments = examples(info.key, SIZE, 1)
    return 1e6 * median_ms(lambda: info.function(*arguments, **options), 5, 1) / SIZE


def measure(info: KernelInfo, cases: int) -> list[Row]:
    """One row, or two for formulas that come in float32 as well."""
    precisions = ["float64"]
    if info.name == "intersect_sphere":
        precisions.append("float32")
    rows = []
    for precision in precisions:
        options: dict[str, Any] = {} if precision == "float64" else {"dtype": np.float32}
        found = errors(info, examples(info.key, cases, 1), unit=UNITS[precision], **options)
        # Wrong hits or misses have no relative error; the second table counts them.
        finite = found[np.isfinite(found)]
        rows.append(
            Row(
                info.key, precision, time_ns(info, **options), float(finite.max(initial=0.0)),
                info.bound, info.measure, info.why,
            )
        )  # fmt: skip
    return rows


def regions(precision: str) -> dict[str, tuple[Any, ...]]:
    """Rays by what is hard about them; numbers that the precision can hold."""
    single = precision == "float32"
    found = {
        f"distance/r {d:.0e}": spheres(RAYS, 40 + i, d, single=single)
        for i, d in enumerate(DISTANCES)
    }
    for tangent in (1e-2, 1e-4, 1e-6):
        name = f"20 r away, within {tangent:.0e} of tangent"
        found[name] = spheres(RAYS, 50, 20.0, tangent=tangent, single=single)
    found["r 6.4e6, height 10"] = near_spheres(RAYS, 60, 6.4e6, 10.0, single=single)
    found["inside"] = spheres(RAYS, 61, 0.9, single=single)
    return found


def sphere_rows(precision: str) -> list[SphereRow]:
    """Every form on every region."""
    rows = []
    for region, arguments in regions(precision).items():
        exact = [oracle_ray.sphere_roots(*case(arguments, i)) for i in range(RAYS)]
        hits = np.array([not mpmath.isnan(t[0]) for t in exact])
        many = tuple(np.resize(a, (SIZE, *a.shape[1:])) for a in arguments)
        for form in FORMS:
            found = ssr_ref.intersect_sphere(*arguments, form=form, dtype=precision)
            hit = np.isin(found.outcome, (1, 2))
            off = []
            for i in np.nonzero(hits & hit)[0]:
                nearer = min((0, 1), key=lambda k, i=i: abs(exact[i][k]))
                value = float(found.t[i, nearer])
                if np.isfinite(value) and exact[i][nearer] != 0:
                    off.append(float(abs(value / exact[i][nearer] - 1)))
            seconds = median_ms(
                lambda m=many, f=form: ssr_ref.intersect_sphere(*m, form=f, dtype=precision), 5, 1
            )
            rows.append(
                SphereRow(
                    region, form, precision, float(hits.mean()), float((hits != hit).mean()),
                    float(np.median(off)) if off else np.nan, max(off, default=np.nan),
                    1e6 * seconds / SIZE,
                )
            )  # fmt: skip
    return rows


def number(x: float) -> str:
    """Short, "none" for a bound that is not there."""
    if np.isinf(x):
        return "none"
    return "0" if x == 0 else f"{x:.3g}"


def print_kernels(rows: Sequence[Row]) -> None:
    """The first table."""
    print("| formula | type | ns | measured error | stated bound | per |")
    print("|---|---|---|---|---|---|")
    for r in rows:
        print(
            f"| `{r.key}` | {r.precision} | {r.ns:.1f} | {number(r.error)} | {number(r.bound)} "
            f"| {r.measure} |"
        )


def print_spheres(rows: Sequence[SphereRow]) -> None:
    """The second table: wrong hit or miss, and median error of the nearer root, by form."""
    for precision in UNITS:
        mine = [r for r in rows if r.precision == precision]
        print(
            f"\n{precision}: wrong hit or miss (median, worst relative error of the nearer root)\n"
        )
        print("| rays | true hits | " + " | ".join(FORMS) + " |")
        print("|---|---|" + "---|" * len(FORMS))
        for region in dict.fromkeys(r.region for r in mine):
            line = [r for r in mine if r.region == region]
            cells = [f"{r.wrong:.1%} ({r.median:.0e}, {r.worst:.0e})" for r in line]
            print(f"| {region} | {line[0].hits:.0%} | " + " | ".join(cells) + " |")
        times = [f"{np.median([r.ns for r in mine if r.form == form]):.0f} ns" for form in FORMS]
        print("| time a ray | | " + " | ".join(times) + " |")


def write(folder: Path, rows: Sequence[Row], sphere: Sequence[SphereRow]) -> None:
    """CSV, JSON and the picture."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in (("kernels.csv", rows), ("spheres.csv", sphere)):
        if table:
            with (folder / name).open("w", newline="") as file:
                writer = csv.DictWriter(file, list(asdict(table[0])))
                writer.writeheader()
                writer.writerows(asdict(r) for r in table)
    content = {
        "machine": machine(),
        "kernels": [asdict(r) for r in rows],
        "spheres": [asdict(r) for r in sphere],
    }
    # JSON has no inf or nan: such numbers become null.
    text = json.dumps(_without_infinity(content), indent=1, allow_nan=False)
    (folder / "kernels.json").write_text(text + "\n")
    try:
        import matplotlib
    except ImportError:
        print(f"\nmatplotlib is not installed: no picture; the numbers are in {folder}")
        return
    matplotlib.use("Agg")
    draw(folder / "kernels.png", rows, sphere)


def _without_infinity(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _without_infinity(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_without_infinity(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def draw(path: Path, rows: Sequence[Row], sphere: Sequence[SphereRow]) -> None:
    """Error against time: all formulas with a bound; and wrong answers of each sphere form.

    Points are numbered and named at the side: names beside them would cover each other.
    """
    import matplotlib.pyplot as plt

    widths = [3.0, 2.2] + ([3.0, 1.1] if sphere else [])
    figure, axes = plt.subplots(
        1, len(widths), figsize=(2.1 * sum(widths), 9), width_ratios=widths, squeeze=False
    )
    left = axes[0, 0]
    floor = 0.05
    bounded = sorted((r for r in rows if np.isfinite(r.bound)), key=lambda r: r.ns)
    names = []
    for i, r in enumerate(bounded):
        error, bound = max(r.error, floor), max(r.bound, floor)
        marker = "o" if r.precision == "float64" else "s"
        left.plot([r.ns, r.ns], [error, bound], color="tab:gray", lw=0.8)
        left.plot(r.ns, bound, "_", color="tab:red", ms=9)
        left.plot(r.ns, error, marker, color="tab:blue", ms=5)
        left.annotate(
            str(i + 1), (r.ns, error), xytext=(0, -9 - 7 * (i % 5)), textcoords="offset points",
            fontsize=6, ha="center",
        )  # fmt: skip
        names.append(f"{i + 1}  {r.key} {r.precision[-2:]}, {r.ns:.0f} ns")
    left.set(
        xscale="log", yscale="log", xlabel="ns a case (over arrays)", ylim=(floor / 3.0, None),
        ylabel=f"worst error in u · (1 + condition number); exact drawn at {floor}",
        title="measured (dot: float64, square: float32), stated bound (red)",
    )  # fmt: skip
    write_names(axes[0, 1], names)
    if sphere:
        chosen = [r for r in sphere if r.region.startswith("distance")]
        write_names(axes[0, 3], draw_spheres(axes[0, 2], chosen))
    figure.tight_layout()
    figure.savefig(path, dpi=130)


def write_names(axis: Any, names: Sequence[str]) -> None:
    """A list of names in the place of a plot."""
    axis.axis("off")
    axis.text(0.0, 1.0, "\n".join(names), va="top", fontsize=7, transform=axis.transAxes)


def draw_spheres(axis: Any, rows: Sequence[SphereRow]) -> list[str]:
    """Each form and precision a column at its time, a point a distance; the columns' names."""
    import matplotlib.pyplot as plt

    names = list(dict.fromkeys(r.region for r in rows))
    shades = plt.get_cmap("viridis")(np.linspace(0.0, 0.95, len(names)))
    columns = []
    for precision, marker in (("float64", "o"), ("float32", "s")):
        for form in FORMS:
            mine = [r for r in rows if r.form == form and r.precision == precision]
            ns = float(np.median([r.ns for r in mine]))
            for r in mine:
                color = shades[names.index(r.region)]
                label = None if columns else r.region
                axis.plot(ns, max(r.wrong, 1e-3), marker, color=color, ms=5, label=label)
            letter = chr(ord("a") + len(columns))
            axis.annotate(
                letter, (ns, 1e-3), fontsize=8, ha="center", textcoords="offset points",
                xytext=(0, -14 - 9 * (len(columns) % 4)),
            )  # fmt: skip
            columns.append(f"{letter}  {form} {precision[-2:]}, {ns:.0f} ns")
    axis.set(
        xscale="log", yscale="log", ylim=(2e-4, 1.0), xlabel="ns a ray (column of each form)",
        ylabel="share of wrong hits and misses (none drawn at 0.001)",
        title="line against sphere (dot: float64, square: float32)",
    )  # fmt: skip
    axis.legend(fontsize=6, loc="center right")
    return columns


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.kernels")
    parser.add_argument("-o", "--output", type=Path, help="folder for CSV, JSON and the picture")
    parser.add_argument("--only", default="", help="formulas whose key holds this")
    parser.add_argument("--cases", type=int, default=400, help="cases a formula (default 400)")
    options = parser.parse_args()

    print(machine() + "\n")
    rows = [
        r for info in kernels() if options.only in info.key for r in measure(info, options.cases)
    ]
    print_kernels(rows)
    sphere: list[SphereRow] = []
    if options.only in "intersect_sphere":
        sphere = [r for precision in UNITS for r in sphere_rows(precision)]
        print_spheres(sphere)
    if options.output is not None:
        write(options.output, rows, sphere)


if __name__ == "__main__":
    main()

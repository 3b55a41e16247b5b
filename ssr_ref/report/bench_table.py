"""The rows of a bench as a table: Markdown, CSV, and what a terminal shows."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Sequence

from ..study.bench import Bench, Row
from ..study.pareto import pareto_front

Column = tuple[str, str, Callable[[Row], float]]

COLUMNS: tuple[Column, ...] = (
    ("total_ms", ".2f", lambda r: 1e3 * r.total),
    ("trace_ms", ".2f", lambda r: 1e3 * r.seconds),
    ("least_ms", ".2f", lambda r: 1e3 * r.low),
    ("greatest_ms", ".2f", lambda r: 1e3 * r.high),
    ("passes_ms", ".2f", lambda r: 1e3 * r.passes),
    ("compile_s", ".2f", lambda r: r.compile_seconds),
    ("steps", ".1f", lambda r: r.steps),
    ("fetches", ".1f", lambda r: r.fetches),
    ("block_steps", ".1f", lambda r: r.block_steps),
    ("draws", ".0f", lambda r: r.draws),
    ("wrong_%", ".3f", lambda r: 1e2 * r.errors.wrong),
    ("recall_%", ".3f", lambda r: 1e2 * r.errors.recall),
    ("precision_%", ".3f", lambda r: 1e2 * r.errors.precision),
    ("p50_px", ".4f", lambda r: r.errors.p50),
    ("p95_px", ".4f", lambda r: r.errors.p95),
    ("rel_mse", ".3e", lambda r: r.errors.rel_mse),
    ("flip", ".4f", lambda r: r.errors.flip),
    ("non_finite_px", ".0f", lambda r: r.errors.non_finite),
)
"""Name, format and value of every column of numbers."""

SHOWN = ("total_ms", "fetches", "block_steps", "wrong_%", "recall_%", "p95_px", "rel_mse", "flip")
"""Columns of the tables that people read; files have all."""


def cells(row: Row, columns: Sequence[str]) -> list[str]:
    """A row's numbers as text; "-" where there is none."""
    table = {name: (form, value) for name, form, value in COLUMNS}
    out = []
    for name in columns:
        form, value = table[name]
        number = value(row)
        out.append("-" if math.isnan(number) else format(number, form))
    return out


def fronts(bench: Bench) -> tuple[set[int], set[int]]:
    """Rows on the Pareto front of wrong share against seconds, and against fetches."""
    wrong = [row.errors.wrong for row in bench.rows]
    return (
        set(pareto_front([row.total for row in bench.rows], wrong)),
        set(pareto_front([row.fetches for row in bench.rows], wrong)),
    )


def markdown(bench: Bench, columns: Sequence[str] = SHOWN) -> str:
    """A table; rows on the front of error against seconds are bold."""
    by_time, _ = fronts(bench)
    lines = ["| case | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    for i, row in enumerate(bench.rows):
        label = f"**{row.label}**" if i in by_time else row.label
        lines.append(f"| {label} | " + " | ".join(cells(row, columns)) + " |")
    if bench.knowable is not None and bench.rays:
        e = bench.knowable
        lines += [
            "",
            f"What no screen-space method can know leaves relMSE {e.rel_mse:.3e}"
            + ("" if math.isnan(e.flip) else f", FLIP {e.flip:.4f}")
            + " to the best of them.",
        ]
    lines += [f"\nNot applicable: {name}: {reason}." for name, reason in bench.not_applicable]
    return "\n".join(lines) + "\n"


def csv_text(benches: Sequence[Bench]) -> str:
    """All columns of all scenes; numbers with 9 digits, empty where there is none."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["scene", "method", "case", "pareto_seconds", "pareto_fetches"]
                    + [name for name, _, _ in COLUMNS])  # fmt: skip
    for bench in benches:
        by_time, by_fetches = fronts(bench)
        for i, row in enumerate(bench.rows):
            numbers = [value(row) for _, _, value in COLUMNS]
            writer.writerow(
                [bench.scene, row.method, row.label, int(i in by_time), int(i in by_fetches)]
                + ["" if math.isnan(n) else f"{n:.9g}" for n in numbers]
            )
    return out.getvalue()

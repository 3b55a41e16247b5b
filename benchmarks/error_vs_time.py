"""Error against run time on every built-in scene: `ssr-ref bench all`, checked in as docs.

    python -m benchmarks.error_vs_time -o DIR [--size 960x540] [--repeats 5] [SCENE ...]

Writes what `ssr-ref bench` writes, and the table and small diagrams of docs/error_vs_time.md:
the Pareto fronts of all scenes, which `--docs` puts into the page between its marks.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ssr_ref.cli.bench import machine_facts
from ssr_ref.cli.parsing import parse_size
from ssr_ref.fileio.load import load
from ssr_ref.report.bench_page import about, write_bench
from ssr_ref.report.bench_plot import overview
from ssr_ref.report.bench_table import cells
from ssr_ref.scenes import BUILTIN
from ssr_ref.settings import METHODS, Settings
from ssr_ref.study.bench import Bench, run_bench
from ssr_ref.study.pareto import pareto_front
from ssr_ref.study.sweep import sweep

DOCS = Path(__file__).parents[1] / "docs"
COLUMNS = ("total_ms", "fetches", "block_steps", "wrong_%", "recall_%", "p95_px", "rel_mse", "flip")
BEGIN, END = "<!-- error_vs_time: begin -->\n", "<!-- error_vs_time: end -->\n"


def front_table(benches: list[Bench]) -> str:
    """The Pareto front of each scene as one table."""
    lines = ["| scene | case | " + " | ".join(COLUMNS) + " |", "|---" * (len(COLUMNS) + 2) + "|"]
    for bench in benches:
        wrong = [row.errors.wrong for row in bench.rows]
        for n, k in enumerate(pareto_front([row.total for row in bench.rows], wrong)):
            row = bench.rows[k]
            name = bench.scene if n == 0 else ""
            lines.append(f"| {name} | {row.label} | " + " | ".join(cells(row, COLUMNS)) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run, write, and update the page if asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", default=list(BUILTIN))
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--size", type=parse_size, default=(960, 540))
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--docs", action="store_true", help="update docs/error_vs_time.md")
    given = parser.parse_args()
    benches = []
    for name in given.scenes:
        scene = load(name)
        cases = sweep(Settings(size=given.size), scene.radius(), tuple(METHODS))
        benches.append(run_bench(scene, [None], cases, repeats=given.repeats))
        print(f"{name}: {about(benches[-1])}", flush=True)
    given.output.mkdir(parents=True, exist_ok=True)
    facts = machine_facts()
    facts["command"] = "python -m benchmarks.error_vs_time"
    write_bench(given.output, benches, facts)
    text = "\n".join(f"- {name}: {value}" for name, value in facts.items()) + "\n\n"
    text += "".join(f"- {bench.scene}: {about(bench)}\n" for bench in benches) + "\n"
    text += front_table(benches)
    print(text)
    if given.docs:
        page = DOCS / "error_vs_time.md"
        before, rest = page.read_text().split(BEGIN)
        page.write_text(before + BEGIN + text + END + rest.split(END)[1])
        (DOCS / "figures").mkdir(exist_ok=True)
        (DOCS / "figures" / "error_vs_time.svg").write_bytes(overview(benches))


if __name__ == "__main__":
    main()

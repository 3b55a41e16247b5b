"""docs/maths.md and docs/errata.md agree with the code: bounds, numbers, tables.

`python -m tests.test_docs_maths FOLDER` writes the tables of docs/maths.md anew, from the
kernels.json that `python -m benchmarks.kernels -o FOLDER` left.
"""

from __future__ import annotations

import ast
import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ssr_ref
from benchmarks import claims, errata
from ssr_ref.maths.registry import kernels
from ssr_ref.vecmath import sphere

ROOT = Path(__file__).parents[1]
MATHS = ROOT / "docs" / "maths.md"
FORMS = ("textbook", "textbook_unit", "stable", "kahan", "hearn_baker", "distance")


def page(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def plain(text: str) -> str:
    """Without line breaks and list marks."""
    return re.sub(r"\s+", " ", text)


def between(text: str, name: str) -> str:
    """What stands in the generated part of that name."""
    found = re.search(rf"<!-- {name}: [^>]*-->\n(.*?)<!-- end -->", text, re.DOTALL)
    assert found, name
    return found[1]


def cells(table: str) -> list[list[str]]:
    """Rows below the head."""
    lines = [line for line in table.splitlines() if line.startswith("|")][2:]
    return [[c.strip().replace("\\|", "|") for c in re.split(r"(?<!\\)\|", x)[1:-1]] for x in lines]


# --- Tables ---------------------------------------------------------------------------------------


def number(x: float | None) -> str:
    """3 digits; JSON's null is an infinity."""
    return "none" if x is None or np.isinf(x) else f"{x:.3g}"


def kernel_table(rows: list[dict[str, Any]]) -> str:
    lines = ["| formula | type | measured | bound | per | time |", "|---|---|---|---|---|---|"]
    for r in rows:
        name = r["key"].split("/")[0]
        same = [
            x["ns"] for x in rows if x["key"].split("/")[0] == name and x["precision"] == "float64"
        ]
        time = f"{r['ns'] / min(same):.1f}" if len(same) > 1 else "–"
        lines.append(
            f"| `{r['key']}` | {r['precision']} | {number(r['error'])} | {number(r['bound'])} "
            f"| {r['measure']} | {time} |"
        )
    return "\n".join(lines) + "\n"


def sphere_table(rows: list[dict[str, Any]]) -> str:
    head = "| type | rays | true hits | " + " | ".join(f"`{f}`" for f in FORMS) + " |"
    lines = [head, "|---" * 9 + "|"]
    for precision in ("float32", "float64"):
        mine = [r for r in rows if r["precision"] == precision]
        for region in dict.fromkeys(r["region"] for r in mine):
            line = [r for r in mine if r["region"] == region]
            assert tuple(r["form"] for r in line) == FORMS
            shares = " | ".join(f"{r['wrong']:.1%}" for r in line)
            name = region.replace("e+0", "e").replace("e-0", "e-")
            lines.append(f"| {precision} | {name} | {line[0]['hits']:.0%} | {shares} |")
    return "\n".join(lines) + "\n"


def reason_table() -> str:
    """The registry's own words; forms that share them share a row."""
    found: dict[tuple[str, str, str], list[str]] = {}
    for info in kernels():
        found.setdefault((info.name, info.why, info.source), []).append(info.form)
    lines = ["| formula | forms | bound from | source |", "|---|---|---|---|"]
    for (name, why, source), forms in found.items():
        words = " | ".join(x.replace("|", "\\|") for x in (", ".join(forms) or "–", why, source))
        lines.append(f"| `{name}` | {words} |")
    return "\n".join(lines) + "\n"


def with_tables(text: str, measured: dict[str, Any]) -> str:
    for name, table in {
        "kernels": kernel_table(measured["kernels"]),
        "spheres": sphere_table(measured["spheres"]),
        "reasons": reason_table(),
    }.items():
        old = between(text, name)
        head, rest = text.split(f"<!-- {name}: ", 1)
        mark, rest = rest.split("\n", 1)
        text = f"{head}<!-- {name}: {mark}\n{table}{rest[len(old) :]}"
    return text


def test_bounds_are_those_of_the_registry() -> None:
    """Every formula has a row in float64, with its own bound; what was measured is below it."""
    rows = cells(between(page(MATHS), "kernels"))
    stated = {r[0].strip("`"): (r[3], r[4]) for r in rows if r[1] == "float64"}
    assert stated == {k.key: (number(k.bound), k.measure) for k in kernels()}
    for key, kind, measured, bound, *_ in rows:
        assert bound == "none" or float(measured) <= float(bound), (key, kind)


def test_reasons_are_those_of_the_registry() -> None:
    assert between(page(MATHS), "reasons") == reason_table()


def test_every_formula_is_explained() -> None:
    """Each function is named in the text, not in the tables alone."""
    text = page(MATHS).split("## Measured against stated")[0]
    for info in kernels():
        assert re.search(rf"(`|\b){info.name}(`|\(|:| )", text), info.key
    for form in FORMS:
        assert f"| `{form}`" in text


def far_rows() -> list[list[str]]:
    """Rows by distance; the second cell is the distance alone."""
    rows = cells(between(page(MATHS), "spheres"))
    return [[r[0], r[1].split()[1], *r[2:]] for r in rows if r[1].startswith("distance/r")]


def test_shares_of_wrong_answers_follow_the_text() -> None:
    """Right at any distance by default; the b² − aC forms fail from 4096 radii on in float32."""
    assert [(r[0], float(r[1])) for r in far_rows()] == [
        (p, 10.0**e) for p in ("float32", "float64") for e in range(2, 9)
    ]
    for precision, distance, _, *shares in far_rows():
        wrong = dict(zip(FORMS, (float(s.rstrip("%")) for s in shares)))
        assert wrong["distance"] == 0.0
        lost = float(distance) > 4096.0 if precision == "float32" else float(distance) >= 1e8
        assert all((wrong[f] > 20.0) == lost for f in ("textbook", "stable", "kahan"))
        near = precision == "float64" or float(distance) < 1e6
        assert (wrong["hearn_baker"] == 0.0) == near


def test_two_rows_of_the_table_anew() -> None:
    """The rows of float32 at 1e3 and 1e4 are the benchmark's, so errata.md says the same."""
    rows = {r[1]: r for r in far_rows() if r[0] == "float32"}
    text = " ".join(errata.sphere_sentences())
    for distance, radii in (("1e3", 1000), ("1e4", 10000)):
        assert f"{radii} radii away, {rows[distance][3]} of the textbook's" in text


def test_the_contract_is_that_of_the_module() -> None:
    doc = plain(sphere.__doc__ or "")
    table = page(MATHS).split("| case | answer |")[1].split("\n\n")[0]
    rows = cells("| case | answer |" + table)
    assert len(rows) == 11
    for case, answer in rows:
        assert f"{case} {answer}" in doc


# --- Numbers --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "source"), [("maths.md", claims), ("errata.md", errata)])
def test_numbers_of_the_page(name: str, source: Any) -> None:
    """Every sentence with a number, computed anew, stands on its page word for word."""
    text = plain(page(ROOT / "docs" / name))
    for sentence in source.sentences():
        assert sentence in text


def test_the_walk_of_the_proof() -> None:
    for sentence in errata.quotient_sentences():
        assert sentence in plain(page(MATHS))
        assert sentence.endswith("by 1/k 0%.")
        assert float(re.findall(r"([\d.]+)%", sentence)[0]) > 1.0
    # Stride 1 in float64: one pixel further each sample, for any jitter.
    for j in (2.0**-24, 0.3 * 2.0**24 // 1 * 2.0**-24, 1.0 - 2.0**-24, 1.0):
        s = np.arange(8000) + j
        assert (np.diff(np.floor(1.5 + s * 1.0)) == 1.0).all()
        assert (np.diff(np.floor(8190.5 + s * -1.0)) == -1.0).all()


def test_what_the_errata_say_of_defaults() -> None:
    text = plain(page(ROOT / "docs" / "errata.md"))
    settings = ssr_ref.Settings().resolved(1.0)
    assert f"`edge_power` {settings.edge_power:g} by default" in text
    assert f'`Settings.distance_fade` is "{settings.distance_fade}" by default' in text
    assert ssr_ref.distance_fade(1.0, 1.0) == 0.75
    d, n = (1.0, -2.0, 0.5), (0.0, 3.0, 0.0)
    assert ssr_ref.reflect(d, n).tolist() == [1.0, 2.0, 0.5]


def test_readme_lines() -> None:
    """Each line gives the numbers of its own comment."""
    block = page(ROOT / "README.md").split("stated error bounds")[1].split("```")[1]
    lines = block.removeprefix("python\n").strip().splitlines()
    assert lines[0] == "import ssr_ref" and len(lines) == 3
    for line in lines[1:]:
        code, comment = line.split("  # ")
        wanted = ast.literal_eval(comment.split("]")[0] + "]")
        assert eval(code, {"ssr_ref": ssr_ref}).tolist() == wanted


if __name__ == "__main__":
    content = json.loads((Path(sys.argv[1]) / "kernels.json").read_text(encoding="utf-8"))
    MATHS.write_text(with_tables(page(MATHS), content), encoding="utf-8")

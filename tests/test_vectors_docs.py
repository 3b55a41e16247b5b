"""docs/vectors.md: its C program compiled and run, its Python listings, its table of kernels.

`python tests/test_vectors_docs.py` writes the table anew.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ssr_ref.fileio.vectors import write_vectors
from ssr_ref.study.subjects import SUBJECTS, select
from ssr_ref.study.vectors import Field, make

PAGE = Path(__file__).parents[1] / "docs" / "vectors.md"
BEGIN, END = "<!-- kernels -->\n", "<!-- end -->\n"
STRICT = ["-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-pedantic"]


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def table() -> str:
    """One row a kernel: arguments, results with their measure, source."""
    lines = ["| kernel | arguments | results | source |", "|---|---|---|---|"]
    for subject in SUBJECTS:
        vectors = make_blank(subject)
        results = ", ".join(f"{text(f)}: {vectors(f)}" for f in subject.outputs)
        arguments = ", ".join(text(f) for f in subject.inputs)
        source = subject.info().source.replace("|", "\\|")
        lines.append(f"| `{subject.title}` | {arguments} | {results} | {source} |")
    return "\n".join(lines) + "\n"


def make_blank(subject: Any) -> Any:
    def measure(field: Field) -> str:
        return "exact" if field.kind != "float" else field.measure or subject.info().measure

    return measure


def text(field: Field) -> str:
    shape = "×".join(map(str, field.shape))
    kind = {"float": "", "int": " int32", "uint": " uint32"}[field.kind]
    return f"{field.name}{f' ({shape})' if shape else ''}{kind}"


def with_table(page: str) -> str:
    before, rest = page.split(BEGIN)
    return before + BEGIN + table() + END + rest.split(END, 1)[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    chosen = select(["reflect_published", "octahedral_encode"])
    return write_vectors(map(make, chosen), tmp_path_factory.mktemp("docs") / "vectors")


def run_c(source: str, folder: Path, where: Path) -> subprocess.CompletedProcess[str]:
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("no C compiler")
    (where / "check.c").write_text(source, encoding="utf-8")
    command = [compiler, *STRICT, "check.c", "-o", "check", "-lm"]
    built = subprocess.run(command, cwd=where, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    return subprocess.run([str(where / "check"), str(folder)], capture_output=True, text=True)


def test_the_c_program_passes(folder: Path, tmp_path: Path) -> None:
    run = run_c(blocks("c")[0], folder, tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
    lines = run.stdout.splitlines()
    assert len(lines) == 2
    for line, name in zip(lines, ("reflect_published", "octahedral_encode")):
        found = re.fullmatch(rf"{name}: (\d+) cases, 0 failed, worst (\S+) ulp \(.+\)", line)
        assert found is not None, line
        tolerance = np.load(folder / f"{name}.npz")["tolerance.float32"]
        assert int(found[1]) == np.count_nonzero(~np.isnan(tolerance))
        # float32 rounds: no error at all would mean that nothing was compared.
        assert 0.0 < float(found[2]) < 20.0


@pytest.mark.parametrize(
    ("right", "wrong", "kernel", "case"),
    [
        ("d[i] - k * n[i]", "d[i] + k * n[i]", "reflect_published", "at 45 degrees"),
        ("x >= 0.0f ? 1.0f", "x > 0.0f ? 1.0f", "octahedral_encode", "axis -z"),
        ("out[0] = out[1] = NAN;", "out[0] = out[1] = 0.0f;", "octahedral_encode", "gives NaN"),
        ("double e = (double)got[i] - want[i];", "double e = 9;", "reflect_published", ""),
    ],
)
def test_a_planted_bug_is_reported(
    folder: Path, tmp_path: Path, right: str, wrong: str, kernel: str, case: str
) -> None:
    source = blocks("c")[0]
    assert source.count(right) == 1
    run = run_c(source.replace(right, wrong), folder, tmp_path)
    assert run.returncode == 1
    failures = [line for line in run.stdout.splitlines() if line.startswith("FAILED")]
    assert any(line.startswith(f"FAILED {kernel}, ") and case in line for line in failures)


def test_the_python_listings_do_what_the_page_says(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = blocks("python")
    space: dict[str, Any] = {}
    exec(compile(first, "vectors.md", "exec"), space)
    assert space["finding"].failed == ("inf gives NaN",)
    assert capsys.readouterr().out.endswith("('inf gives NaN',)\n")

    monkeypatch.chdir(folder.parent)
    space = {}
    exec(compile(second, "vectors.md", "exec"), space)
    rows, count = space["rows"], space["count"]
    d, n = (rows[:, i, :3].astype(np.float64) for i in (0, 1))
    reflected = np.zeros((count, 4), np.float32)
    reflected[:, :3] = d - 2.0 * (d * n).sum(axis=1, keepdims=True) * n
    assert space["failures"](reflected.tobytes(), factor=1.0) == []
    reflected[7, 1] = -reflected[7, 1] - 1.0
    assert space["failures"](reflected.tobytes()) == [space["data"]["case"][space["use"]][7]]
    assert len(space["storage_buffer"]) == 32 * count
    bits = [int(b, 16) for b in re.findall(r"0x([0-9a-f]{8})u", space["wgsl"])]
    assert np.array_equal(np.array(bits, np.uint32).view(np.float32), rows[:, 0, :3].ravel())
    assert space["glsl"].count("uintBitsToFloat(0x") == space["hlsl"].count("0x") == 3 * count


def test_the_table_lists_every_kernel() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert with_table(page) == page, "python tests/test_vectors_docs.py writes the table anew"


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")

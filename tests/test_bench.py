"""`ssr-ref bench` as a user runs it, small."""

from __future__ import annotations

import csv
import json
import shlex
from pathlib import Path

import pytest

import ssr_ref
from ssr_ref.__main__ import main
from ssr_ref.study.bench import run_bench
from ssr_ref.study.sweep import Case

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "triangle.obj").write_text(TRIANGLE)
    view = {"eye": [1.0, 2.0, 5.0], "target": [0.0, 0.3, 0.0], "fov_y_degrees": 40}
    moved = {**view, "eye": [-1.0, 2.0, 5.0]}
    (tmp_path / "path.json").write_text(json.dumps([view, moved]))
    return tmp_path


@pytest.mark.slow
def test_files_table_and_what_is_recommended(folder: Path, capsys: pytest.CaptureFixture) -> None:
    pytest.importorskip("matplotlib")
    pytest.importorskip("jinja2")
    line = "bench teapot -o out --size 64x36 --repeats 2 --method exact,planes --within 50%"
    assert main([*line.split(), "--budget", "100s", "--cameras", "path.json"]) == 0
    out = capsys.readouterr().out
    assert sorted(p.name for p in (folder / "out").iterdir()) == [
        "bench.csv", "bench.html", "bench.json", "bench.md", "manifest.json", "teapot.svg",
    ]  # fmt: skip
    data = json.loads((folder / "out" / "bench.json").read_text())
    (scene,) = data["scenes"]
    assert scene["cameras"] == 2 and scene["rays"] > 500 and len(scene["rows"]) == 4
    for row in scene["rows"]:
        assert 0 < row["seconds"]["least"] <= row["seconds"]["trace"] <= row["seconds"]["greatest"]
        assert row["work"]["block_steps"] > 0
        assert 0 < row["errors"]["wrong"] < 0.5 and row["errors"]["recall"] > 0.5
        assert row["errors"]["rays"] == scene["rays"]
    assert scene["knowable"]["wrong"] == 0.0 and scene["knowable"]["rel_mse"] > 0
    with (folder / "out" / "bench.csv").open() as file:
        assert len(list(csv.DictReader(file))) == 4
    page = (folder / "out" / "bench.html").read_text()
    assert "<svg" in page and "http" not in page.split("</style>")[1].split("<svg")[0]
    assert data["facts"]["command"] and "numba" in data["facts"]["versions"]

    # The lines can be run, and name settings of a row.
    for asked in ("within", "budget"):
        (found,) = [text for text in out.splitlines() if text.startswith(asked + ": ")]
        words = shlex.split(found.split(": ", 1)[1])
        assert words[:3] == ["ssr-ref", "render", "teapot"] and "--method" in words
        assert main([*words[1:], "--no-previews", "-q", "--force"]) == 0
        assert ssr_ref.load_bundle(folder / "golden").settings.size == (64, 36)
    assert main(["bench", "teapot", "-o", "out", "--size", "64x36"]) == 2  # taken
    assert "exists" in capsys.readouterr().err


@pytest.mark.slow
def test_a_scene_without_reflections_says_so(folder: Path, capsys: pytest.CaptureFixture) -> None:
    line = "bench triangle.obj --size 17x9 --repeats 1 --method exact --no-flip --within 1%"
    assert main(line.split()) == 0
    assert "No pixel reflects" in capsys.readouterr().out


@pytest.mark.slow
def test_a_closed_form_scene_and_a_doubled_stride() -> None:
    """A worse method costs less and errs more: the judgement is of the method."""
    from ssr_ref.analytic.scenes import SCENES

    base = ssr_ref.Settings(size=(160, 90))
    cases = [
        Case("dda", ssr_ref.method_settings("dda", base, stride=s, refine="none"), {"stride": s})
        for s in (1, 16)
    ]
    bench = run_bench(SCENES["clutter"](), [None], cases, repeats=1, flip=False)
    fine, coarse = bench.rows
    assert coarse.errors.wrong > 2 * fine.errors.wrong and coarse.fetches < 0.2 * fine.fetches
    assert coarse.errors.recall < fine.errors.recall and coarse.errors.p95 > fine.errors.p95
    assert bench.knowable is not None and bench.knowable.rays == fine.errors.rays


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("bench teapot --within few", "within is 'few'"),
        ("bench teapot --budget 20", "budget is '20'"),
        ("bench teapot --repeats 0", "repeats is 0"),
        ("bench teapot --method magic", "method is 'magic'"),
        ("bench teapot --cameras triangle.obj", "not JSON"),
        ("bench no_such", "no_such"),
        ("bench", "Missing argument"),
        ("bench teapot -o triangle.obj", "is a file"),
    ],
)
def test_bad_input(folder: Path, capsys: pytest.CaptureFixture, line: str, words: str) -> None:
    assert main(line.split()) == 2
    err = capsys.readouterr().err
    assert words in err and err.count("\n") == 1
    assert sorted(p.name for p in folder.iterdir()) == ["path.json", "triangle.obj"]

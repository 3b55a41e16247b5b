"""`ssr-ref pixel`: table, JSON, pictures, and what it walks on."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import ssr_ref
from ssr_ref.__main__ import main
from ssr_ref.pipeline import Stages, draw_gbuffer
from ssr_ref.ssr.explain import trace_pixel


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


LINE = "pixel teapot 10 26 --size 64x36"


def told(capsys: pytest.CaptureFixture, line: str) -> dict:
    assert main([*line.split(), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_json_is_the_walk_digit_for_digit(folder: Path, capsys: pytest.CaptureFixture) -> None:
    data = told(capsys, LINE + " --method dda,exact")
    settings = ssr_ref.Settings(size=(64, 36))
    drawn = draw_gbuffer(ssr_ref.load("teapot"), None, settings, {}, Stages(None))
    assert list(data["methods"]) == ["dda", "exact"] and data["size"] == [64, 36]
    for name, found in data["methods"].items():
        own = ssr_ref.method_settings(name, drawn.settings)
        walk = trace_pixel(drawn.view, drawn.gbuffer, own, 10, 26)
        rows = [row[:-1] for row in found["rows"]]
        numbers = np.array([[np.inf if v == "inf" else v for v in row] for row in rows], float)
        assert np.array_equal(numbers, walk.rows)
        assert [row[-1] for row in found["rows"]] == [v.name for v in walk.verdicts]
        assert found["hit_px"] == list(walk.hit_px) and found["length"] == walk.length
        assert found["status"] == "HIT" and found["fetches"] == walk.fetches == 12 - 2 * (
            name == "exact"
        )  # docs/dda.md, the worked example
        assert found["columns"][-1] == "verdict" and found["s_is"] == "px"
        assert ssr_ref.Settings.from_json(found["settings"]) == own


def test_the_table_and_what_is_left_out(folder: Path, capsys: pytest.CaptureFixture) -> None:
    assert main(LINE.split()) == 0
    out = capsys.readouterr().out
    assert "method        dda" in out and "HIT" in out and "(9, 20)" in out
    assert len([line for line in out.splitlines() if " sample " in line]) == 6
    assert main([*LINE.split(), "--rows", "4"]) == 0
    out = capsys.readouterr().out
    assert "2 more" in out and len([li for li in out.splitlines() if " sample " in li]) == 4


def test_a_bundle_is_walked_with_its_own_settings(
    folder: Path, capsys: pytest.CaptureFixture
) -> None:
    line = "render teapot -o out --size 64x36 --stride 4 --no-previews -q"
    assert main(line.split()) == 0
    data = told(capsys, "pixel out 10 26")
    again = told(capsys, LINE + " --stride 4")
    assert data["methods"]["dda"]["rows"] == again["methods"]["dda"]["rows"]
    assert data["methods"]["dda"]["settings"]["stride"] == 4
    assert {row[0] for row in data["methods"]["dda"]["rows"]} == {0, 1}
    exact = told(capsys, "pixel out 10 26 --method exact")
    assert list(exact["methods"]) == ["exact"]


def test_a_pixel_without_a_ray(folder: Path, capsys: pytest.CaptureFixture) -> None:
    data = told(capsys, "pixel poles 0 0 --size 64x36")
    walk = data["methods"]["dda"]
    assert walk["status"] in ("BACKGROUND", "NOT_REFLECTIVE") and walk["rows"] == []
    assert walk["hit_depth"] is None and walk["hit_px"] == [None, None]
    assert main(["pixel", "poles", "0", "0", "--size", "64x36"]) == 0
    assert "nothing was walked" in capsys.readouterr().out


@pytest.mark.slow
def test_files(folder: Path, capsys: pytest.CaptureFixture) -> None:
    pytest.importorskip("matplotlib")
    from PIL import Image

    assert main([*LINE.split(), "-o", "walk", "--heat", "-q"]) == 0
    names = sorted(p.name for p in (folder / "walk").iterdir())
    assert names == ["heat.png", "manifest.json", "pixel.json", "pixel.png"]
    assert Image.open(folder / "walk" / "pixel.png").width == 1400
    first = (folder / "walk" / "pixel.png").read_bytes()
    assert main([*LINE.split(), "-o", "walk", "--force", "-q"]) == 0
    assert (folder / "walk" / "pixel.png").read_bytes() == first  # no date, no version
    assert main([*LINE.replace("26", "27").split(), "-o", "other", "-q"]) == 0
    assert (folder / "other" / "pixel.png").read_bytes() != first
    assert main([*LINE.split(), "-o", "walk"]) == 2
    assert "exists" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("pixel teapot 64 0 --size 64x36", "outside the image"),
        ("pixel teapot 0 36 --size 64x36", "outside the image"),
        ("pixel teapot 1", "Missing argument"),
        ("pixel no_such 1 1", "no_such"),
        (LINE + " --rows 1", "rows is 1"),
        (LINE + " --heat", "--heat is given without --output"),
        (LINE + " --method dda,magic", "method is 'magic'"),
        (LINE + " --listing --max-steps 9", "has no log"),
    ],
)
def test_bad_input(folder: Path, capsys: pytest.CaptureFixture, line: str, words: str) -> None:
    assert main(line.split()) == 2
    err = capsys.readouterr().err
    assert words in err and err.count("\n") == 1
    assert list(folder.iterdir()) == []

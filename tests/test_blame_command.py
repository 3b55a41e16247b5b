"""`ssr-ref blame` as a user runs it, small."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ssr_ref.__main__ import main


@pytest.mark.slow
def test_tables_json_and_pictures(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    out = tmp_path / "blame"
    line = ["blame", "teapot", "--size", "64x36", "--method", "exact,dda", "--stride", "4"]
    assert main([*line, "--ambiguity", "-o", str(out)]) == 0
    text = capsys.readouterr().out
    assert "pixels by status and truth" in text and "information" in text and "ambiguous" in text
    data = json.loads((out / "blame.json").read_text())
    exact, dda = data["methods"]["exact"], data["methods"]["dda"]
    # The exact walk is its own oracle: nothing is lost in traversal.
    assert exact["blame"]["shares"]["traversal"] == 0.0 != dda["blame"]["shares"]["traversal"]
    assert exact["blame"]["charged"]["TRAVERSAL"] == 0 < dda["blame"]["charged"]["TRAVERSAL"]
    for found in (exact, dda):
        assert abs(sum(found["blame"]["shares"].values()) - 1.0) < 1e-12
        table = found["outcome"]["status_by_class"]
        assert sum(sum(row.values()) for row in table.values()) == 64 * 36
        assert found["outcome"]["recall"] > 0.8
    pictures = {p.name for p in (out / "exact").iterdir()}
    assert {"blame_information.png", "blame_shares.png", "blame_ambiguity.png"} <= pictures
    assert main([*line, "-o", str(out)]) == 2
    assert "exists" in capsys.readouterr().err


def test_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert main(["blame", "no_such_scene"]) == 2
    assert main(["blame", "teapot", "--method", "magic"]) == 2
    listing = ["--tracer", "march", "--listing", "--max-steps", "9", "--ambiguity"]
    assert main(["blame", "teapot", *listing]) == 2
    err = capsys.readouterr().err.splitlines()
    assert len(err) == 3 and all(line.startswith("error: ") for line in err)

"""Presets: the facts' own numbers, what a preset does to a frame, and its page."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ssr_ref
from ssr_ref.__main__ import main
from ssr_ref.cli.options import as_options
from ssr_ref.errors import SettingsError
from ssr_ref.presets import PRESETS, preset_settings
from ssr_ref.settings import Settings

PAGE = Path(__file__).parents[1] / "docs" / "presets.md"

# Read in the engines' public sources, November 2026.
FACTS: dict[str, dict[str, Any]] = {
    "mcguire_mara": {"tracer": "dda", "interval": "published", "edge_fade": False},
    "babylon": {"max_steps": 1000, "max_distance": 1000.0, "thickness": 0.5, "stride": 1},
    "filament": {"stride": 2, "max_distance": 3.0, "thickness": 0.1, "max_steps": None},
    "kode80": {"max_steps": 20, "max_distance": 10.0, "thickness": 0.1, "back_any_object": True},
    "three_ssrpass": {"max_distance": 180.0, "thickness": 0.018, "interval": "point"},
    "three_ssrnode": {"max_distance": 1.0, "thickness": 0.1, "stride": 2},
    "godot_4_5": {"max_steps": 64, "thickness": 0.2, "steps_fade_out": 2.0, "steps_fade_in": 0.15},
    "lettier": {"thickness": 0.5, "refine": "bisect"},
    "zerobeqz": {"tracer": "march", "max_steps": 20, "refine_steps": 5, "thickness": 10.0},
    "realism_effects": {"tracer": "march", "max_steps": 20, "refine_steps": 5, "thickness": 10.0},
    "ffx_sssr": {"tracer": "cells", "residual_end": 0.015, "residual_power": 2.0},
    "wicked": {"tracer": "cells", "residual_end": 1.5, "residual_power": 1.0},
    "unity_hdrp": {"tracer": "cells", "thickness_from": "relative", "thickness": 0.01},
}


def test_numbers_are_the_facts() -> None:
    assert set(FACTS) == set(PRESETS)
    for name, facts in FACTS.items():
        settings = preset_settings(name)
        found = {key: getattr(settings, key) for key in facts}
        assert found == facts, name


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_renders(name: str) -> None:
    settings = preset_settings(name, Settings(size=(37, 23)))
    frame = ssr_ref.render(ssr_ref.load("teapot", tessellation=3), settings=settings)
    assert (frame.hits.status == ssr_ref.Status.HIT).sum() > 10
    assert np.isfinite(frame.resolved.composite).all()
    preset = PRESETS[name]
    assert preset.covers and preset.not_covered and preset.source


def test_an_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(SettingsError, match="'unreal'; expected one of mcguire_mara, babylon"):
        preset_settings("unreal")


def test_the_page_has_every_preset_with_its_options() -> None:
    text = PAGE.read_text()
    rows = dict(re.findall(r"^\| `(\w+)` \| .*? \| `(--.*?)` \|", text, re.M))
    assert list(rows) == list(PRESETS)
    for name, options in rows.items():
        assert options == shlex.join(as_options(PRESETS[name].changes)), name
        for said in (*PRESETS[name].covers, *PRESETS[name].not_covered):
            assert said in text, (name, said)


def test_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["presets"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(PRESETS)
    assert main(["presets", "babylon"]) == 0
    assert "roughness blur" in capsys.readouterr().out
    assert main(["presets", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert set(told) == set(PRESETS) and told["filament"]["settings"]["stride"] == 2
    assert main(["presets", "unreal"]) == 2


def test_options_win_over_a_preset(tmp_path: Path) -> None:
    line = ["render", "teapot", "-o", str(tmp_path / "out"), "--size", "9x7", "--preset", "babylon"]
    assert main([*line, "--thickness", "0.25", "--no-previews", "-q"]) == 0
    settings = ssr_ref.load_bundle(tmp_path / "out").settings
    assert (settings.thickness, settings.max_distance) == (0.25, 1000.0)
    again = ["--settings", str(tmp_path / "out" / "settings.json"), "--force"]
    assert main([*line, *again]) == 2  # both a preset and a file

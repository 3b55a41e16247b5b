"""Readers under fire: whatever a mesh file holds, loading gives a scene or one clean error.

Small valid files of every format are damaged (tests/fuzz_mutations.py) and loaded in a process that
may not take more than 1 GiB. No traceback, crash, warning, output or hang; a scene that comes out
is one that can be drawn. A case is told by its seed and number, and made again by
`python tests/fuzz_worker.py FOLDER SEED NUMBER 1`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("resource", reason="limits on a process's memory exist on Unix only")

HERE = Path(__file__).parent
SEED = 20


def fuzz(folder: Path, seed: int, first: int, count: int) -> subprocess.Popen[str]:
    folder.mkdir()
    paths = [str(HERE), str(HERE.parent), os.environ.get("PYTHONPATH", "")]
    return subprocess.Popen(
        [
            sys.executable,
            str(HERE / "fuzz_worker.py"),
            str(folder),
            *map(str, (seed, first, count)),
        ],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(paths), "NUMBA_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def result(run: subprocess.Popen[str], folder: Path, seconds: float) -> dict[str, Any]:
    """What a worker found; an AssertionError, which names the case, if there is a fault."""
    try:
        out, err = run.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        run.kill()
        run.communicate()
        raise AssertionError(f"case {(folder / 'case').read_text()} hangs") from None
    assert run.returncode == 0, f"case {(folder / 'case').read_text()} ends the process: {err}"
    assert err == ""
    found: dict[str, Any] = json.loads(out)  # nothing else was printed
    faults = [f"case {i}, {name}: {kind} {text}" for i, name, kind, text in found["faults"]]
    assert not faults, "\n".join(faults[:5])
    # Files of at most 40 kB; the largest table that one may ask for has 256 MiB.
    assert found["grown"] < 2**29
    return found


def check_counts(counts: dict[str, int], cases: int) -> None:
    """Both outcomes are common: damage that always, or never, stops a reader tests little."""
    assert counts["scene"] + counts["error"] == cases
    for kind in ("glb", "gltf", "obj", "ply", "stl", "off", "3mf"):
        assert counts[f"{kind} scene"] > cases // 500, kind
        assert counts[f"{kind} error"] > cases // 100, kind


def test_damaged_files_give_a_scene_or_one_line(tmp_path):
    run = fuzz(tmp_path / "a", SEED, 0, 1500)
    check_counts(result(run, tmp_path / "a", 120)["counts"], 1500)


@pytest.mark.slow
def test_many_damaged_files_give_a_scene_or_one_line(tmp_path):
    halves = [(tmp_path / name, seed) for name, seed in (("a", SEED + 1), ("b", SEED + 2))]
    runs = [(fuzz(folder, seed, 0, 10_000), folder) for folder, seed in halves]
    for run, folder in runs:
        check_counts(result(run, folder, 300)["counts"], 10_000)

"""Loads damaged files in a process of its own, which may use 1 GiB beyond what it starts with.

    python tests/fuzz_worker.py FOLDER SEED FIRST COUNT

Cases FIRST to FIRST + COUNT of SEED are written to FOLDER and loaded there, one after the other.
Standard output has one JSON object at the end: outcomes counted, and what went wrong. The number of
the case that runs is in FOLDER/case, so a crash or a hang can be told too. With COUNT 1 the damaged
files stay in FOLDER.
"""

from __future__ import annotations

import contextlib
import io
import json
import random
import resource
import shutil
import signal
import sys
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from fuzz_files import Asset, assets
from fuzz_mutations import mutated

from ssr_ref.errors import SsrRefError
from ssr_ref.meshfiles.meshes import load_mesh
from ssr_ref.meshfiles.options import LoadOptions
from ssr_ref.scene import Scene

MEMORY = 2**30
SECONDS = 4.0
MOST_MESSAGE = 1000
OPTIONS = (
    LoadOptions(), LoadOptions(), LoadOptions(strict=True), LoadOptions(normals="smooth"),
    LoadOptions(normals="crease", up="z", unit="mm"), LoadOptions(normals="flat"),
)  # fmt: skip


class _TooLong(BaseException):
    """Raised by the watchdog; no reader catches it."""


def _watchdog(*_: Any) -> None:
    raise _TooLong


def case(found: dict[str, Asset], seed: int, index: int) -> tuple[Asset, LoadOptions]:
    """The damaged asset and the options of one case."""
    rng = random.Random(f"{seed}/{index}")
    names = list(found)
    asset = dict(found[names[index % len(names)]])
    files = list(asset)
    name = files[0] if rng.random() < 0.75 else rng.choice(files)
    others = [data for other in found.values() for data in other.values()]
    asset[name] = mutated(rng, name, asset[name], others)
    return asset, rng.choice(OPTIONS)


def check_scene(scene: Scene) -> None:
    """Raise AssertionError unless everything that a renderer relies on holds."""
    assert scene.triangle_count > 0
    low, high = scene.world_bounds()
    assert np.isfinite(low).all() and np.isfinite(high).all()
    assert len(scene.content_sha256()) == 64
    report = scene.report
    assert report is not None
    words = (*scene.notes, *report.skipped, *report.fallbacks, *report.unsupported)
    for line in words:
        assert line.isprintable() and len(line) < MOST_MESSAGE, f"note {line[:200]!r}"
    for node in scene.nodes:
        assert np.isfinite(node.world_from_mesh).all()
    for mesh in scene.meshes:
        for primitive in mesh.primitives:
            count = len(primitive.positions)
            assert primitive.faces.min(initial=0) >= 0
            assert primitive.faces.max(initial=-1) < count
            for array in (primitive.normals, primitive.colors, primitive.uv0, primitive.uv1):
                assert array is None or len(array) == count
            colors = primitive.colors
            assert colors is None or np.isfinite(colors).all(), "a colour is not finite"
    for material in scene.materials:
        for texture in material.textures:
            assert texture is None or 0 <= texture.image < len(scene.images)


def outcome(path: Path, options: LoadOptions) -> tuple[str, str]:
    """What loading leads to: "scene", "error", or a fault in capital letters; and its text."""
    said = io.StringIO()
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        with (
            warnings.catch_warnings(record=True) as warned,
            contextlib.redirect_stdout(said),
            contextlib.redirect_stderr(said),
        ):
            warnings.simplefilter("always")
            scene = load_mesh(path, options)
            check_scene(scene)
        kind, text = "scene", ""
    except SsrRefError as error:
        kind, text = "error", str(error)
        if "\n" in text or len(text) >= MOST_MESSAGE or not text.isprintable():
            return "MESSAGE", text[:2000]
        if not text.startswith(str(path)) or "expected" not in text:
            return "WORDS", text
    except _TooLong:
        return "HANG", traceback.format_exc(limit=-4)
    except Exception:
        return "TRACEBACK", traceback.format_exc(limit=-6)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    if warned:
        return "WARNED", f"{warned[0].filename}:{warned[0].lineno}: {warned[0].message}"
    if said.getvalue():
        return "PRINTED", said.getvalue()[:500]
    return kind, text


def main(folder: Path, seed: int, first: int, count: int) -> dict[str, Any]:
    found = assets()
    home = folder / "asset"
    for asset in found.values():  # what is imported and compiled once does not count
        _write(home, asset)
        kind, text = outcome(home / next(iter(asset)), LoadOptions())
        assert kind == "scene", (next(iter(asset)), kind, text)
        outcome(home / next(iter(asset)), LoadOptions(normals="smooth"))
    signal.signal(signal.SIGALRM, _watchdog)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    counts: Counter[str] = Counter()
    faults: list[tuple[int, str, str, str]] = []
    slowest = (0.0, -1)
    for index in range(first, first + count):
        (folder / "case").write_text(str(index))
        asset, options = case(found, seed, index)
        _write(home, asset)
        name = next(iter(asset))
        began = time.perf_counter()
        kind, text = outcome(home / name, options)
        slowest = max(slowest, (time.perf_counter() - began, index))
        counts[kind] += 1
        counts[f"{name[2:]} {kind}"] += 1
        if kind.isupper() and len(faults) < 50:
            faults.append((index, name, kind, text))
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - start) * 1024
    return {"counts": counts, "faults": faults, "grown": grown, "slowest": slowest}


def _write(home: Path, asset: Asset) -> None:
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir()
    for name, data in asset.items():
        (home / name).write_bytes(data)


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), *(int(word) for word in sys.argv[2:]))))

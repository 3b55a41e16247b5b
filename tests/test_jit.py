"""The compiled code's cache and decorators: stale answers, read-only installs, one signature."""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
import threading
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import ssr_ref
from ssr_ref import _jit

PACKAGE = Path(ssr_ref.__file__).parent
ASK = (
    "from ssr_ref.vecmath import vec\n"
    "from ssr_ref._jit import driver\n"
    "import numpy as np, sys\n"
    "sys.path.insert(0, '.')\n"
    "from ask import ask\n"
    "ask(1.0)\n"
    "print(ask(3.0), ask.dispatcher.stats.cache_hits)\n"
)
DRIVER = (
    "from ssr_ref._jit import driver\n"
    "from ssr_ref.vecmath.vec import Vec3, reflect\n"
    "@driver(parallel=False)\n"
    "def ask(x):\n"
    "    return reflect(Vec3(x, -1.0, 0.0), Vec3(0.0, 1.0, 0.0)).y\n"
)


def run(code: str, cwd: Path, **environment: str | None) -> str:
    """Run Python code in a clean process that imports the copy of the package in `cwd`."""
    env = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA_", "PYTHON", "XDG_"))}
    env["PYTHONPATH"] = str(cwd)
    for key, value in environment.items():
        if value is None:
            env.pop(key, None)
        else:
            env[key] = value
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=cwd, env=env, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def copy_package(folder: Path) -> Path:
    shutil.copytree(PACKAGE, folder / "ssr_ref", ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "ask.py").write_text(DRIVER)
    return folder


@pytest.mark.skipif(not _jit.JIT_ENABLED, reason="asks the compiler")
def test_an_edited_kernel_changes_the_answer_of_a_cached_driver(tmp_path: Path) -> None:
    copy_package(tmp_path)
    cache = str(tmp_path / "cache")
    assert run(ASK, tmp_path, NUMBA_CACHE_DIR=cache) == "1.0 Counter()"
    # Second process: from the cache, nothing compiled.
    assert "1.0 Counter({" in run(ASK, tmp_path, NUMBA_CACHE_DIR=cache)
    # Edit the kernel in another file than the driver's: Numba's own cache would keep 1.0.
    vec = tmp_path / "ssr_ref" / "vecmath" / "vec.py"
    text = vec.read_text()
    assert text.count("k = 2.0 * dot(incident, normal)") == 1
    vec.write_text(
        text.replace("k = 2.0 * dot(incident, normal)", "k = 3.0 * dot(incident, normal)")
    )
    assert run(ASK, tmp_path, NUMBA_CACHE_DIR=cache) == "2.0 Counter()"


@pytest.mark.skipif(not _jit.JIT_ENABLED, reason="asks the compiler")
def test_a_damaged_cache_only_costs_time(tmp_path: Path) -> None:
    copy_package(tmp_path)
    cache = tmp_path / "cache"
    run(ASK, tmp_path, NUMBA_CACHE_DIR=str(cache))
    files = [p for p in cache.rglob("*") if p.suffix in (".nbi", ".nbc")]
    assert files
    for path in files:
        path.write_bytes(path.read_bytes()[:40])
    assert run(ASK, tmp_path, NUMBA_CACHE_DIR=str(cache)) == "1.0 Counter()"


@pytest.mark.skipif(not _jit.JIT_ENABLED, reason="asks the compiler")
def test_read_only_install_without_home(tmp_path: Path) -> None:
    copy_package(tmp_path)
    locked = tmp_path / "not-a-folder"
    locked.write_text("")  # a file where a folder is wanted fails for every user, root included
    temp = tmp_path / "temp"
    temp.mkdir()
    places = {"HOME": str(locked / "home"), "NUMBA_CACHE_DIR": str(locked), "TMPDIR": str(temp)}
    before = sorted(p for p in (tmp_path / "ssr_ref").rglob("*") if "__pycache__" not in str(p))
    for path in (tmp_path / "ssr_ref").rglob("*"):
        path.chmod(stat.S_IRUSR | (stat.S_IXUSR if path.is_dir() else 0))
    try:
        assert run(ASK, tmp_path, **places, PYTHONDONTWRITEBYTECODE="1") == "1.0 Counter()"
    finally:
        for path in [tmp_path / "ssr_ref", *(tmp_path / "ssr_ref").rglob("*")]:
            path.chmod(path.stat().st_mode | stat.S_IWUSR | (stat.S_IXUSR if path.is_dir() else 0))
    after = sorted(p for p in (tmp_path / "ssr_ref").rglob("*") if "__pycache__" not in str(p))
    assert before == after
    assert list(temp.glob("ssr_ref-*/*/*.nbc")), "compiled code goes to the temporary folder"


def test_no_writable_place_warns_and_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_jit, "_private_folder", lambda path: False)
    _jit.cache_folder.cache_clear()
    try:
        with pytest.warns(ssr_ref.SsrRefWarning, match="NUMBA_CACHE_DIR"):
            assert _jit.cache_folder() is None
    finally:
        _jit.cache_folder.cache_clear()


def test_cache_folder_is_keyed_by_source_and_bounds_check() -> None:
    folder = _jit.cache_folder()
    assert folder is not None
    assert folder.name.startswith(_jit.source_hash()[:20])
    import numba

    assert folder.name.endswith("-boundscheck") == bool(numba.config.BOUNDSCHECK)


@_jit.driver(parallel=False)
def fma_of(a, b, c):  # type: ignore[no-untyped-def]
    return _jit.fma(a, b, c)


def test_fma_rounds_once() -> None:
    rng = np.random.default_rng(5)
    for _ in range(200):
        a, b = rng.normal(size=2) * 2.0 ** rng.integers(-30, 30, 2)
        c = -a * b * (1.0 + rng.normal() * 2.0 ** rng.integers(-60, 2))
        exact = float(Fraction(a) * Fraction(b) + Fraction(c))
        assert fma_of(a, b, c) == exact == _jit._fma_exact(a, b, c)


@pytest.mark.parametrize(
    ("a", "b", "c"),
    [(0.0, -1.0, 0.0), (0.0, -1.0, -0.0), (np.inf, 1.0, 0.0), (np.nan, 1.0, 0.0),
     (1e300, 1e300, 0.0), (-1e300, 1e300, 0.0), (np.inf, 0.0, 1.0), (5e-324, 0.5, 0.0)],
)  # fmt: skip
def test_fma_fallback_equals_the_instruction(a: float, b: float, c: float) -> None:
    got = np.float64(_jit._fma_exact(a, b, c))
    want = np.float64(fma_of(a, b, c))
    assert (np.isnan(got) and np.isnan(want)) or got.tobytes() == want.tobytes()


@pytest.mark.skipif(not _jit.JIT_ENABLED, reason="asks the compiler")
def test_one_signature_a_driver() -> None:
    """Renders under different settings and scenes compile each driver once: types are fixed at the
    border, so that nobody pays for a second compilation of the same thing.
    """
    code = (
        "import ssr_ref\n"
        "from ssr_ref import _jit\n"
        "for name in ('poles', 'teapot'):\n"
        "    scene = ssr_ref.load(name, tessellation=4)\n"
        "    for change in ({}, {'thickness_from': 'constant', 'jitter': True, 'stride': 3},\n"
        "                   {'tracer': 'cells', 'fresnel': True, 'max_steps': 5}):\n"
        "        ssr_ref.render(scene, settings=ssr_ref.Settings(size=(9, 7), **change))\n"
        "for d in _jit._DRIVERS: print(d.py_func.__name__, len(d.signatures))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    counts = dict(line.split() for line in done.stdout.splitlines())
    assert {"draw_bands", "trace_rows", "resolve_rows", "shade_radiance"} <= set(counts)
    assert {name for name, n in counts.items() if int(n) > 1} == set()


@pytest.mark.skipif(not _jit.JIT_ENABLED, reason="threads of the compiled code")
def test_two_callers_at_once() -> None:
    """`workqueue` aborts the process on two callers; the lock makes them take turns."""
    scene = ssr_ref.load("poles")
    settings = ssr_ref.Settings(size=(41, 23))
    want = ssr_ref.render(scene, settings=settings).resolved.composite
    results: list[np.ndarray] = []
    threads = [
        threading.Thread(
            target=lambda: results.append(
                ssr_ref.render(scene, settings=settings).resolved.composite
            )
        )
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(results) == 4
    assert all(np.array_equal(r, want) for r in results)


@pytest.mark.skipif(not _jit.JIT_ENABLED, reason="threads of the compiled code")
def test_render_in_a_forked_child(tmp_path: Path) -> None:
    """Numba's `omp` layer dies after fork; the child must finish, and in time."""
    code = (
        "import multiprocessing, ssr_ref\n"
        "def work(q):\n"
        "    f = ssr_ref.render(ssr_ref.load('poles'), settings=ssr_ref.Settings(size=(9, 7)))\n"
        "    q.put(f.hits.status.tobytes())\n"
        "context = multiprocessing.get_context('fork')\n"
        "q = context.Queue(); work(q); parent = q.get()\n"
        "child = context.Process(target=work, args=(q,)); child.start()\n"
        "print(q.get(timeout=60) == parent); child.join(60); print(child.exitcode)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout.split() == ["True", "0"], done.stderr

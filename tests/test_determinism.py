"""The same bytes on every x86-64 processor, for any number of threads, compiled or interpreted."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache

import pytest

from ssr_ref import _jit

RENDER = """
import hashlib, sys
import numpy as np
import ssr_ref
scene = ssr_ref.load({scene!r}, tessellation={tessellation})
frame = ssr_ref.render(scene, {view}, ssr_ref.Settings(**{settings}))
digest = hashlib.sha256(repr(frame.camera.to_json()).encode())
for group in (frame.gbuffer, frame.hits, frame.resolved):
    for name, array in sorted(group.arrays().items()):
        array = np.where(np.isnan(array), np.array(0, array.dtype), array)
        digest.update(name.encode() + str(array.dtype).encode() + array.tobytes())
print(digest.hexdigest())
"""


def content_hash(
    scene: str = "teapot",
    tessellation: int = 6,
    view: dict | None = None,
    environment: dict[str, str] | None = None,
    **settings: object,
) -> str:
    """Hash of every array of a render in a process of its own."""
    made = f"ssr_ref.View(**{view!r})" if view else "None"
    code = RENDER.format(scene=scene, tessellation=tessellation, view=made, settings=settings)
    env = {**os.environ, **(environment or {})}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


SETTINGS = {"size": (161, 91), "jitter": True, "distance_fade": "published", "fresnel": True}


@cache
def reference() -> str:
    return content_hash(**SETTINGS)


def numpy_features() -> str:
    """Every CPU feature that NumPy would dispatch on, for NPY_DISABLE_CPU_FEATURES."""
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

    return " ".join(f for f in __cpu_dispatch__ if __cpu_features__.get(f))


VARIANTS = {
    "openblas prescott": {"OPENBLAS_CORETYPE": "Prescott"},
    "openblas skylakex": {"OPENBLAS_CORETYPE": "SkylakeX"},
    "numpy features off": {"NPY_DISABLE_CPU_FEATURES": "(all)"},
    "glibc without fma": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-AVX2"},
    "1 thread": {"NUMBA_NUM_THREADS": "1"},
    "2 threads": {"NUMBA_NUM_THREADS": "2"},
    "8 threads": {"NUMBA_NUM_THREADS": "8"},
}


@pytest.mark.skipif(not _jit.JIT_ENABLED, reason="compares compiled runs")
@pytest.mark.parametrize("name", VARIANTS)
def test_same_bytes_on_other_processors_and_threads(name: str) -> None:
    environment = dict(VARIANTS[name])
    if environment.get("NPY_DISABLE_CPU_FEATURES"):
        environment["NPY_DISABLE_CPU_FEATURES"] = numpy_features()
    assert content_hash(environment=environment, **SETTINGS) == reference()


@pytest.mark.slow
@pytest.mark.parametrize("cpu", ["x86-64", "nehalem", "haswell"])
def test_same_bytes_compiled_for_other_targets(cpu: str, tmp_path) -> None:  # type: ignore[no-untyped-def]
    """SSE2 has no FMA instruction and AVX2 no 512-bit lanes; neither may change a byte."""
    environment = {"NUMBA_CPU_NAME": cpu, "NUMBA_CACHE_DIR": str(tmp_path)}
    if cpu == "haswell":
        environment["NUMBA_CPU_FEATURES"] = "+fma,+avx2"
    else:
        environment["NUMBA_CPU_FEATURES"] = ""
    assert content_hash(environment=environment, **SETTINGS) == reference()


INTERPRETED = [
    {},
    {"tracer": "cells"},
    {"stride": 3, "jitter": True, "seed": 7, "thickness_from": "constant"},
    {"interval": "cell", "fresnel": True, "distance_fade": "published", "edge_power": 2.5},
    {"buffer_dtype": "float64", "back_any_object": True},
    {"snap": "gpu_vertices", "max_steps": 3},
    pytest.param({"tracer": "march", "jitter": True, "refine": "secant"}, marks=pytest.mark.slow),
    pytest.param(
        {"tracer": "march", "listing": True, "max_steps": 12, "distance_fade": "published"},
        marks=pytest.mark.slow,
    ),
]


@pytest.mark.skipif(not _jit.JIT_ENABLED, reason="compares compiled with interpreted")
@pytest.mark.parametrize("settings", INTERPRETED, ids=str)
def test_interpreted_equals_compiled(settings: dict) -> None:
    asked = {"size": (9, 7), **settings}
    compiled = content_hash(tessellation=1, **asked)
    interpreted = content_hash(tessellation=1, environment={"NUMBA_DISABLE_JIT": "1"}, **asked)
    assert interpreted == compiled


def test_orthographic_interpreted_equals_compiled() -> None:
    view = {"eye": (1.5, 1.2, 3.0), "target": (0.0, 0.4, 0.0), "orthographic_height": 2.5}
    compiled = content_hash("poles", 4, view, size=(9, 7), stride=2)
    interpreted = content_hash("poles", 4, view, {"NUMBA_DISABLE_JIT": "1"}, size=(9, 7), stride=2)
    assert interpreted == compiled


def test_a_hash_can_differ() -> None:
    """The comparison has bite: another seed is another hash."""
    assert content_hash(**{**SETTINGS, "seed": 1}) != reference()

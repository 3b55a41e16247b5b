"""What every benchmark prints beside its numbers, and how it takes a time."""

from __future__ import annotations

import gc
import os
import platform
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np


def machine() -> str:
    """One line: processor, threads, versions."""
    import numba

    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                model = line.split(":", 1)[1].strip()
                break
    return (
        f"{model}, {os.cpu_count()} cores, {numba.get_num_threads()} threads, "
        f"Python {platform.python_version()}, NumPy {np.__version__}, Numba {numba.__version__}"
    )


def median_ms(run: Callable[[], object], repeats: int = 7, warm_up: int = 2) -> float:
    """Median of several runs in milliseconds, after warm-up."""
    for _ in range(warm_up):
        run()
    gc.collect()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return 1e3 * float(np.median(times))

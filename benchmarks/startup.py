"""Start-up: import, each driver's compile time, first render and second render in new processes.

python -m benchmarks.startup
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

COLD = """
import time
start = time.perf_counter()
import ssr_ref
from ssr_ref import _jit
print(f"  import ssr_ref          {time.perf_counter() - start:6.2f} s")
start = time.perf_counter()
import numba
print(f"  import numba            {time.perf_counter() - start:6.2f} s")
scene = ssr_ref.load("teapot")
start = time.perf_counter()
frame = ssr_ref.render(scene, settings=ssr_ref.Settings(size=(9, 7)))
print(f"  first render, 9x7       {time.perf_counter() - start:6.2f} s")
for name, seconds in _jit.compile_seconds().items():
    print(f"    {name:20}  {seconds:6.2f} s")
"""


def timed(command: list[str], environment: dict[str, str]) -> float:
    """Wall time of a command that must succeed."""
    start = time.perf_counter()
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


def main() -> None:
    """Print the table."""
    from .common import machine

    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(Path(folder) / "cache")}
        for title in ("empty cache", "filled cache"):
            print(title, flush=True)
            subprocess.run([sys.executable, "-c", COLD], env=environment, check=True)
        environment["NUMBA_CACHE_DIR"] = str(Path(folder) / "cache2")
        command = [sys.executable, "-m", "ssr_ref", "render", "teapot", "--force", "--quiet"]
        command += ["-o", str(Path(folder) / "golden")]
        print(f"render teapot, empty cache  {timed(command, environment):6.2f} s")
        print(f"render teapot, filled cache {timed(command, environment):6.2f} s")
        for _ in range(2):
            print(f"                      again {timed(command, environment):6.2f} s")
        size = ["--size", "1920x1080"]
        print(f"render teapot at 1920x1080  {timed(command + size, environment):6.2f} s")


if __name__ == "__main__":
    main()

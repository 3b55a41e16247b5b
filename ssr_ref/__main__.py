"""`ssr-ref` and `python -m ssr_ref`: global options first, then the command line proper.

The number of threads must be set before Numba is imported, so it is read here, where nothing but
the standard library is.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

GLOBAL_FLAGS = ("--quiet", "-q", "--verbose", "-v", "--json", "--version")
MAX_THREADS = 1024


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code: 0 done, 2 bad input, 130 interrupted.

    Global options may stand before or after the command's name.
    """
    given = list(sys.argv[1:] if argv is None else argv)
    try:
        front, rest, threads = split_global_options(given)
        if threads is not None:
            use_threads(threads)
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    from .cli.app import run

    return run([*front, *rest])


def split_global_options(argv: Sequence[str]) -> tuple[list[str], list[str], str | None]:
    """Global flags, everything else, and the value of --threads; nothing is moved past "--"."""
    front: list[str] = []
    rest: list[str] = []
    threads: str | None = None
    words = iter(argv)
    for word in words:
        if word == "--":
            rest += [word, *words]
        elif word in GLOBAL_FLAGS:
            front.append(word)
        elif word == "--threads":
            threads = next(words, "nothing")
        elif word.startswith("--threads="):
            threads = word.removeprefix("--threads=")
        else:
            rest.append(word)
    return front, rest, threads


def use_threads(value: str) -> None:
    """Let Numba use so many threads; raises ValueError for anything but a number it can have."""
    text = value.strip()
    if not (text.isdecimal() and len(text) < 6 and 1 <= int(text) <= MAX_THREADS):
        raise ValueError(f"--threads is '{value}'; expected a whole number, 1 to {MAX_THREADS}")
    numba = sys.modules.get("numba")
    if numba is None:
        os.environ["NUMBA_NUM_THREADS"] = str(int(text))
        return
    most = int(numba.config.NUMBA_NUM_THREADS)
    if int(text) > most:
        raise ValueError(f"--threads is {text}; expected 1 to {most}: Numba has started already")
    numba.set_num_threads(int(text))


if __name__ == "__main__":
    sys.exit(main())

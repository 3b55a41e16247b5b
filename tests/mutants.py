"""A second, interpreted copy of the package with one change in its source: tests of the tests."""

from __future__ import annotations

import contextlib
import importlib
import importlib.abc
import importlib.machinery
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import numpy as np

import ssr_ref

PACKAGE = Path(ssr_ref.__file__).parent


class _Edited(importlib.machinery.SourceFileLoader):
    """Loads a module with a substring replaced."""

    def __init__(self, name: str, path: str, old: str, new: str) -> None:
        super().__init__(name, path)
        self._edit = old, new

    def get_code(self, fullname: str) -> Any:
        text = Path(self.path).read_text()
        count = text.count(self._edit[0])
        assert count == 1, f"{self._edit[0]!r} stands {count} times in {self.path}"
        return compile(text.replace(*self._edit), self.path, "exec")


class _Finder(importlib.abc.MetaPathFinder):
    def __init__(self, module: str, old: str, new: str) -> None:
        self._module, self._edit = module, (old, new)

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> Any:
        if name != self._module:
            return None
        file = str(PACKAGE.joinpath(*name.split(".")[1:])) + ".py"
        return importlib.machinery.ModuleSpec(name, _Edited(name, file, *self._edit), origin=file)


@contextlib.contextmanager
def mutant(module: str, old: str = "", new: str = "") -> Iterator[ModuleType]:
    """A second, interpreted `ssr_ref` with `old` replaced by `new` in `ssr_ref.<module>`.

    Not through `sys.modules`: what is imported already stays what it is.
    """
    mine = {k: v for k, v in sys.modules.items() if k.split(".")[0] == "ssr_ref"}
    finder = _Finder(f"ssr_ref.{module}", old, new)
    disabled = numba.config.DISABLE_JIT
    for name in mine:
        del sys.modules[name]
    if old:
        sys.meta_path.insert(0, finder)
    numba.config.DISABLE_JIT = 1
    try:
        copy = importlib.import_module("ssr_ref")
        with np.errstate(all="ignore"):
            yield copy
    finally:
        numba.config.DISABLE_JIT = disabled
        if old:
            sys.meta_path.remove(finder)
        for name in [k for k in sys.modules if k.split(".")[0] == "ssr_ref"]:
            del sys.modules[name]
        sys.modules.update(mine)

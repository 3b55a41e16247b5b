"""The one place with Numba options: the two decorators, the cache key, the thread lock.

`kernel` is a scalar, pure, allocation-free function; `driver` owns the loops and the arrays.
Both use strict IEEE arithmetic (no fastmath, no contraction) and `error_model="numpy"`, so that a
division by zero gives inf or NaN as it does in NumPy.

Numba's own cache looks only at the file of the cached function, so an edit to a kernel in another
file would keep the old answer. Here the cache folder is keyed by the source of the whole package.
"""

from __future__ import annotations

import functools
import hashlib
import os
import tempfile
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core import types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, NullCache, _CacheLocator
from numba.extending import intrinsic

from .errors import SsrRefWarning

F = TypeVar("F", bound=Callable[..., Any])

JIT_ENABLED: bool = not numba.config.DISABLE_JIT

# `omp` dies after fork and `workqueue` aborts when two Python threads call it at once, so: the
# layer that survives a fork, and one lock around every parallel call.
numba.config.THREADING_LAYER = "workqueue"
_PARALLEL_CALL = threading.RLock()


@functools.cache
def source_hash() -> str:
    """SHA-256 of the package's Python source, in hexadecimal; the key of the compiled code."""
    digest = hashlib.sha256()
    package = Path(__file__).parent
    if package.is_dir():
        for path in sorted(package.rglob("*.py")):
            digest.update(path.relative_to(package).as_posix().encode() + b"\0")
            digest.update(path.read_bytes() + b"\0")
    else:  # imported from a zip file: the archive is the source
        archive = next(parent for parent in package.parents if parent.is_file())
        digest.update(archive.read_bytes())
    return digest.hexdigest()


def _private_folder(path: Path) -> bool:
    """Make `path` and say whether it can be written to and belongs to this user alone."""
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        if hasattr(os, "getuid") and path.stat().st_uid != os.getuid():
            return False
        tempfile.TemporaryFile(dir=path).close()
    except OSError:
        return False
    return True


@functools.cache
def cache_folder() -> Path | None:
    """Folder of the compiled kernels, or None where no place can be written to.

    The first that works of `$NUMBA_CACHE_DIR`, `$XDG_CACHE_HOME`, `~/.cache` and the temporary
    folder. Below it, one folder for each source hash and bounds-check mode.
    """
    bounds = "-boundscheck" if numba.config.BOUNDSCHECK else ""
    key = source_hash()[:20] + bounds
    roots: list[Path] = []
    if os.environ.get("NUMBA_CACHE_DIR"):
        roots.append(Path(os.environ["NUMBA_CACHE_DIR"]) / "ssr_ref")
    if os.environ.get("XDG_CACHE_HOME"):
        roots.append(Path(os.environ["XDG_CACHE_HOME"]) / "ssr_ref")
    home = os.path.expanduser("~")  # noqa: PTH111  (Path.home raises where there is none)
    if home != "~":
        roots.append(Path(home) / ".cache" / "ssr_ref")
    user = os.getuid() if hasattr(os, "getuid") else "user"
    roots.append(Path(tempfile.gettempdir()) / f"ssr_ref-{user}")
    for root in roots:
        if _private_folder(root) and _private_folder(root / key):
            return root / key
    warnings.warn(
        "no writable folder for compiled kernels: they are compiled anew in every process; "
        "set NUMBA_CACHE_DIR to a writable folder",
        SsrRefWarning,
        stacklevel=2,
    )
    return None


class _PackageLocator(_CacheLocator):  # type: ignore[misc]
    def __init__(self, folder: Path, py_func: Callable[..., Any], py_file: str) -> None:
        self._folder = folder
        self._py_file = py_file
        self._name = f"{py_func.__module__}:{py_func.__code__.co_firstlineno}"

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return source_hash()

    def get_disambiguator(self) -> str:
        return hashlib.sha256(self._name.encode()).hexdigest()[:10]

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _PackageLocator | None:
        folder = cache_folder()
        return None if folder is None else cls(folder, py_func, py_file)


class _PackageCacheImpl(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = [_PackageLocator]  # noqa: RUF012


class _PackageCache(FunctionCache):  # type: ignore[misc]
    """Numba's function cache in the package's folder; a damaged or full disk only costs time."""

    _impl_class = _PackageCacheImpl

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # a truncated or foreign file: forget the index and compile again
            self._empty_index()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError:  # a full disk or a folder that went away
            self.disable()

    def _empty_index(self) -> None:
        try:
            self.flush()
        except OSError:
            self.disable()


_DRIVERS: list[Any] = []


def compile_seconds() -> dict[str, float]:
    """Time that each driver's code took to compile or to load in this process, longest first."""
    found = {}
    for dispatcher in _DRIVERS:
        metadata: dict[Any, Any] = getattr(dispatcher, "get_metadata", dict)() or {}
        total = sum(
            timer.get("compiler_lock", 0.0) or timer.get("llvm_lock", 0.0)
            for timer in ((m or {}).get("timers", {}) for m in metadata.values())
        )
        if metadata:
            found[dispatcher.py_func.__name__] = total
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def kernel(function: F) -> F:
    """Compile a scalar, pure, allocation-free function; it is inlined into its drivers."""
    return numba.njit(error_model="numpy")(function)  # type: ignore[no-any-return]


def inlined(function: F) -> F:
    """A `kernel` that LLVM must inline, for small functions that take wide tuples: copying the
    tuple to a call costs more than the work (measured: benchmarks/raster.py, scene L).
    """
    return numba.njit(error_model="numpy", forceinline=True)(function)  # type: ignore[no-any-return]


def driver(*, parallel: bool = True) -> Callable[[F], F]:
    """Compile a function that owns loops and arrays; cached on disk, callable from any thread."""

    def decorate(function: F) -> F:
        compiled = numba.njit(error_model="numpy", parallel=parallel)(function)
        if JIT_ENABLED:
            cached = cache_folder() is not None
            compiled._cache = _PackageCache(function) if cached else NullCache()

        _DRIVERS.append(compiled)

        @functools.wraps(function)
        def call(*args: Any) -> Any:
            if not JIT_ENABLED:
                with np.errstate(all="ignore"):
                    return compiled(*args)
            if not parallel:
                return compiled(*args)
            with _PARALLEL_CALL:
                return compiled(*args)

        call.dispatcher = compiled  # type: ignore[attr-defined]
        return call  # type: ignore[return-value]

    return decorate


def _fma_exact(a: Any, b: Any, c: Any) -> Any:
    """a·b + c rounded once, by exact rationals (for interpreted runs)."""
    from fractions import Fraction

    single = all(isinstance(v, np.float32) for v in (a, b, c))
    kind: Callable[[Any], Any] = np.float32 if single else float
    if not (np.isfinite(a) and np.isfinite(b) and np.isfinite(c)):
        return kind(a * b + c)
    exact = Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c))
    if exact == 0:
        return kind(np.float64(a) * np.float64(b) + np.float64(c))  # keeps the sign of zero
    try:
        rounded = float(exact)
    except OverflowError:
        return kind(np.inf if exact > 0 else -np.inf)
    if single and Fraction(rounded) != exact and int(np.float64(rounded).view(np.int64)) % 2 == 0:
        # Rounded twice, a number just beside a float32 tie would go the wrong way: an odd last
        # bit is no tie.
        rounded = float(np.nextafter(rounded, np.inf if exact > Fraction(rounded) else -np.inf))
    return kind(rounded)


if JIT_ENABLED:

    @intrinsic  # type: ignore[untyped-decorator]
    def fma(typingctx, a, b, c):  # type: ignore[no-untyped-def]
        """Fused multiply-add: a·b + c rounded once; float32 if all three are, else float64."""
        kind = types.float32 if a == b == c == types.float32 else types.float64
        signature = kind(kind, kind, kind)

        def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
            cast = [context.cast(builder, v, t, kind) for v, t in zip(args, sig.args)]
            return builder.fma(*cast)

        return signature, codegen

else:
    fma = _fma_exact

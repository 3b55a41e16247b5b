"""Files that a mesh file refers to: buffers, images, material libraries.

A mesh file may come from anywhere, so what it names is opened only inside the file's own folder,
only if it is a regular file of a bounded size. Nothing is ever fetched.
"""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path

from ..errors import FileError
from .options import LoadOptions

MAX_BESIDE_BYTES = 2**28
"""Largest file that another may refer to, 256 MiB."""

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")
_DRIVE = re.compile(r"[A-Za-z]:")


def read_beside(asset: Path, reference: str, options: LoadOptions) -> bytes:
    """The bytes of the file that `asset` refers to as `reference` (no longer URI-quoted).

    The reference is relative to the asset's folder and stays in it, also through `..` and symbolic
    links, unless `options.allow_outside`. Raises FileError (one line that starts with the asset's
    path) for a URL, a reference that leaves the folder, a missing or unreadable file, one that is
    not regular (pipe, device, folder), or one of over 256 MiB.
    """
    try:
        path = _resolved(asset, reference, options)
        status = path.stat()
        _check(asset, reference, status)
        # Without O_NONBLOCK a pipe put here since `stat` would block for ever.
        flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        with os.fdopen(os.open(path, flags), "rb") as file:
            status = os.fstat(file.fileno())
            _check(asset, reference, status)
            data = file.read(status.st_size + 1)
    except FileNotFoundError:
        raise _error(
            asset, reference, "is missing", "it beside the file: copy it there, or embed it"
        ) from None
    except (OSError, ValueError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise _error(
            asset, reference, f"cannot be read ({reason})", "a readable file: check its permissions"
        ) from None
    if len(data) != status.st_size:
        raise _error(asset, reference, "changed while it was read", "a file at rest: try again")
    return data


def _resolved(asset: Path, reference: str, options: LoadOptions) -> Path:
    """The real path of the reference; raises FileError if it may not be opened."""
    if not reference.strip() or "\0" in reference:
        raise _error(asset, reference, "is no file name", "a path relative to the file: fix it")
    if _SCHEME.match(reference) or reference.startswith("//"):
        raise _error(
            asset, reference, "is a URL", "a file: nothing is fetched, copy it beside the file"
        )
    folder = asset.parent.resolve()
    path = (folder / reference).resolve()
    if not options.allow_outside:
        leaves = (
            reference.startswith("/")
            or "\\" in reference
            or _DRIVE.match(reference) is not None
            or ".." in reference.split("/")
            or not path.is_relative_to(folder)
        )
        if leaves:
            raise _error(
                asset,
                reference,
                "is not inside the file's folder",
                "a relative path with / that stays there: copy it there, or allow files outside "
                "(allow_outside) if you trust the file",
            )
    return path


def _check(asset: Path, reference: str, status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise _error(asset, reference, "is a folder, pipe or device", "a regular file: fix it")
    if status.st_size > MAX_BESIDE_BYTES:
        raise _error(
            asset,
            reference,
            f"has {status.st_size} bytes",
            f"at most {MAX_BESIDE_BYTES}: make it smaller",
        )


def _error(asset: Path, reference: str, found: str, expected: str) -> FileError:
    short = reference if len(reference) <= 100 else reference[:97] + "..."
    line = f"{asset}: refers to {short!r}, which {found}; expected {expected}"
    return FileError(" ".join(line.split()))

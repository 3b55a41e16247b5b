"""A folder appears whole or not at all: written beside its target, then renamed.

Nothing half-written is left behind by an error, a full disk or an interrupt, and a folder that is
replaced stays untouched until the new one is complete.
"""

from __future__ import annotations

import errno
import json
import os
import secrets
import shutil
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from ..errors import FileError, SsrRefWarning

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
MANIFEST_FILE = "manifest.json"


@dataclass(frozen=True, slots=True)
class FolderKind:
    """A kind of folder that this package writes and may therefore replace.

    noun, short : for messages. format : its manifest's "format". unlisted : files that may stand
    beside those of the manifest's "files".
    """

    noun: str
    short: str
    format: str
    unlisted: tuple[str, ...] = (MANIFEST_FILE,)


@contextmanager
def whole_folder(target: Path) -> Iterator[Path]:
    """Yield a new folder beside `target`; take its place when the block ends without an error.

    Missing parents are made, and removed again on failure. An existing `target` is replaced: the
    caller has checked that it may be. Raises FileError if the disk refuses.
    """
    target = Path(os.path.realpath(target))  # a link stays; what it points to is replaced
    temporary = target.parent / f".ssr-ref-{secrets.token_hex(6)}.tmp"
    made: list[Path] = []
    try:
        with disk_errors(target):
            _make(target.parent, made)
            temporary.mkdir()
        yield temporary
        with disk_errors(target):
            _swap(temporary, target)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        for folder in reversed(made):
            with suppress(OSError):
                folder.rmdir()
        raise


def _make(folder: Path, made: list[Path]) -> None:
    """Make a folder and its parents, noting each in `made`."""
    if folder.is_dir():
        return
    _make(folder.parent, made)
    made.append(folder)
    folder.mkdir(exist_ok=True)


def _swap(temporary: Path, target: Path) -> None:
    """Put `temporary` where `target` is; what was there returns if that fails."""
    aside = temporary.with_suffix(".old")
    try:
        if target.exists():
            target.rename(aside)
        temporary.rename(target)
    except BaseException:
        if aside.exists() and not target.exists():
            aside.rename(target)
        raise
    try:
        shutil.rmtree(aside, ignore_errors=True)
    finally:
        if aside.exists():
            shutil.rmtree(aside, ignore_errors=True)
    if aside.exists():
        warnings.warn(
            f"the replaced bundle could not be removed; delete {aside}", SsrRefWarning, stacklevel=2
        )


def check_target(path: str | Path, kind: FolderKind, *, force: bool = False) -> None:
    """Raise FileError unless a folder of this kind can be written: before the work, not after."""
    target = Path(path)
    with disk_errors(target):
        if target.is_dir():
            if not force:
                raise FileError(
                    f"output folder {target} exists; choose another folder, or --force "
                    f"(force=True) to replace a {kind.noun}"
                )
            _check_replaceable(target, kind)
        elif target.exists():
            raise FileError(f"output {target} is a file; expected a folder that can be created")
    check_can_create(target)


def _check_replaceable(target: Path, kind: FolderKind) -> None:
    """Only what a folder's own manifest names may be deleted."""
    found = {p.relative_to(target).as_posix() for p in target.rglob("*") if not p.is_dir()}
    if not found and not any(target.iterdir()):
        return
    try:
        data = json.loads((target / MANIFEST_FILE).read_bytes())
        known = set(data["files"])
        ours = data["format"] == kind.format
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        known, ours = set(), False
    if not ours:
        raise FileError(
            f"{target} is not a {kind.noun} and not empty; it is left as it is: choose another "
            "folder"
        )
    strange = sorted(found - known - set(kind.unlisted))
    if strange:
        raise FileError(
            f"{target} holds {strange[0]}, which is not the {kind.short}'s; it is left as it is: "
            "move that file away or choose another folder"
        )


def check_can_create(target: Path) -> None:
    """Raise FileError unless a folder can be made at `target`, found out by making one beside it.

    Asking for permission is not enough: root passes every check, also on a read-only disk.
    """
    with disk_errors(target):
        parent = Path(os.path.realpath(target)).parent
        while not parent.exists():
            parent = parent.parent
        if not parent.is_dir():
            raise FileError(
                f"{parent} is a file; expected a folder to put {target.name} in: choose another "
                "output folder"
            )
        probe = parent / f".ssr-ref-{secrets.token_hex(6)}.tmp"
        probe.mkdir()
        probe.rmdir()


@contextmanager
def disk_errors(what: str | Path) -> Iterator[None]:
    """Turn an OSError into a FileError that says what was being written."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        if error.errno in _FULL:
            raise FileError(
                f"disk full or size limit reached while writing {what} ({reason}); free some space "
                "or choose another folder"
            ) from error
        raise FileError(f"cannot write {what} ({reason}); choose another folder") from error

"""NPZ files whose bytes repeat, and the hash that identifies an array on every machine."""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError
from ..typed import AnyArray


def write_npz(path: Path, arrays: Mapping[str, AnyArray]) -> None:
    """Write named arrays, stored without compression, sorted by name, dated 1980-01-01.

    Little-endian and C order, so the same arrays give the same bytes. Raises OSError if the disk
    refuses.
    """
    with path.open("wb") as file:
        named: dict[str, Any] = {name: portable(arrays[name]) for name in sorted(arrays)}
        np.savez(file, **named)


def read_npz(path: str | Path) -> dict[str, AnyArray]:
    """The arrays of an NPZ file, sorted by name. Raises FileError if it cannot be read."""
    path = Path(path)
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: np.asarray(file[name]) for name in sorted(file.files)}
    except FileNotFoundError:
        raise FileError(f"no file {path}; expected an NPZ file of arrays") from None
    except (OSError, ValueError, TypeError, EOFError, AttributeError, zipfile.BadZipFile) as error:
        raise FileError(
            f"{path} cannot be read as NPZ ({error}); expected a complete file of numeric arrays"
        ) from None


def portable(array: AnyArray) -> AnyArray:
    """The array in C order and little-endian byte order, as files and hashes hold it."""
    return np.ascontiguousarray(array, array.dtype.newbyteorder("<")).reshape(array.shape)


def content_sha256(array: AnyArray) -> str:
    """SHA-256, in hexadecimal, of an array's dtype, shape and values.

    Hashed are, in this order: NumPy's name of the little-endian dtype ("<f4", "<f8", "<i4", "<u4"
    or "|u1"), a newline, the sides in decimal joined by "x" ("540x960x3"), a newline (all ASCII),
    and the values in C order, little-endian.
    """
    stored = portable(array)
    head = f"{stored.dtype.str}\n{'x'.join(str(n) for n in stored.shape)}\n"
    digest = hashlib.sha256(head.encode("ascii"))
    digest.update(stored.data if stored.size else b"")
    return digest.hexdigest()


def file_sha256(path: Path) -> str:
    """SHA-256, in hexadecimal, of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()

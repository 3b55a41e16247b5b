"""The container and the JSON of GLB and glTF 2.0 files, with checked access to its values.

The file's own JSON and binary data are read, because what it says must arrive bit for bit: other
readers compose transforms through BLAS, turn float vertex colours into bytes and cannot say whether
normals were authored.

Source: Khronos glTF 2.0 specification, sections 3.2 to 3.4 and 4 (GLB). Files are untrusted: JSON
with a NaN, a key twice, or nested too deeply is refused, and every size is checked before use.
"""

from __future__ import annotations

import contextlib
import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError
from .building import file_error
from .options import LoadOptions

_JSON_CHUNK = 0x4E4F534A
_BIN_CHUNK = 0x004E4942
_GREATEST = 2**53
"""No count, offset or length of a file that fits on a disk is larger."""


@dataclass(frozen=True, slots=True, eq=False)
class Gltf:
    """A parsed file. Every method raises FileError (one line) for what the file has wrong.

    binary: the GLB's second chunk. size: bytes of the file.
    """

    path: Path
    root: dict[str, Any]
    binary: memoryview | None
    size: int
    options: LoadOptions

    def error(self, message: str) -> FileError:
        """A FileError about this file."""
        return file_error(self.path, message)

    def items(self, key: str) -> list[Any]:
        """The top-level array `key`; empty where the file has none."""
        return self.listed(self.root, key, "")

    def item(self, key: str, index: Any) -> dict[str, Any]:
        """Object `index` of the top-level array `key`."""
        items = self.items(key)
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(items):
            raise self.error(
                f"a reference to {key}[{str(index)[:20]}] of {len(items)}; expected an index from "
                f"0 to {len(items) - 1}: the file is damaged, export it again"
            )
        value = items[index]
        if not isinstance(value, dict):
            raise self.error(f"{key}[{index}] is not an object; expected glTF 2.0: export again")
        return value

    def object(self, entry: dict[str, Any], key: str, where: str) -> dict[str, Any]:
        """The object `entry[key]`; empty where there is none."""
        value = entry.get(key, {})
        if not isinstance(value, dict):
            raise self.error(f"{where}.{key} is not an object; expected glTF 2.0: export again")
        return value

    def extension(self, entry: dict[str, Any], name: str, where: str) -> dict[str, Any] | None:
        """The extension `name` of an entry, None where it has none."""
        extensions = self.object(entry, "extensions", where)
        return self.object(extensions, name, where) if name in extensions else None

    def listed(self, entry: dict[str, Any], key: str, where: str) -> list[Any]:
        """The array `entry[key]`; empty where there is none."""
        value = entry.get(key, [])
        if not isinstance(value, list):
            raise self.error(
                f"'{where}{'.' * bool(where)}{key}' is not a list; expected glTF 2.0: export again"
            )
        return value

    def numbers(self, value: Any, count: int, where: str) -> list[float]:
        """`count` finite numbers."""
        if isinstance(value, list) and len(value) == count:
            if all(isinstance(v, int | float) and not isinstance(v, bool) for v in value):
                with contextlib.suppress(OverflowError):
                    numbers = [float(v) for v in value]
                    if all(abs(v) < np.inf for v in numbers):  # false for NaN
                        return numbers
        raise self.error(
            f"{where} is {str(value)[:80]}; expected {count} finite numbers: export again"
        )

    def number(self, value: Any, where: str) -> float:
        """One finite number."""
        return self.numbers([value], 1, where)[0]

    def whole(self, entry: dict[str, Any], key: str, where: str, default: int | None) -> int:
        """The whole number `entry[key]` from 0; a default of None: it must be there."""
        value = entry.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= _GREATEST:
            raise self.error(
                f"{where}.{key} is {str(value)[:20]}; expected a whole number: export again"
            )
        return value

    def names(self, key: str) -> list[str]:
        """The top-level list of names `key`, such as extensionsUsed, each once."""
        return list(dict.fromkeys(str(name) for name in self.items(key)))

    def declares(self, extension: str) -> bool:
        """Whether the file says that it uses an extension."""
        return extension in (*self.names("extensionsUsed"), *self.names("extensionsRequired"))


def read_gltf(path: Path, data: bytes, options: LoadOptions) -> Gltf:
    """Parse the bytes of a .glb or .gltf file; which of the two is decided by its first bytes.

    Raises FileError for broken JSON, a version other than 2, or a truncated GLB.
    """
    text, binary = _chunks(path, data) if data[:4] == b"glTF" else (memoryview(data), None)
    try:
        words = bytes(text).strip(b"\x00").decode("utf-8-sig")
        root = json.loads(words, parse_constant=_no_constant, object_pairs_hook=_unique)
        if "\\ud" in words or "\\uD" in words:  # an escaped half of a surrogate pair is no text
            json.dumps(root, ensure_ascii=False).encode()
    except (ValueError, RecursionError) as error:
        raise file_error(
            path,
            f"is not a glTF file (JSON: {str(error)[:120]}); expected glTF 2.0: check the file, or "
            "export it again",
        ) from None
    asset = root.get("asset") if isinstance(root, dict) else None
    version, least = (
        asset.get(key, default) if isinstance(asset, dict) else None
        for key, default in (("version", None), ("minVersion", "2.0"))
    )
    for number in (version, least):
        if not str(number).startswith("2.") or (number is least and number != "2.0"):
            raise file_error(
                path, f"has glTF version {str(number)[:20]}; expected 2.0: export it again"
            )
    return Gltf(path, root, binary, len(data), options)


def _no_constant(name: str) -> Any:
    raise ValueError(f"{name} is no JSON number")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object; a key twice is refused, since readers differ in which value they take."""
    found = dict(pairs)
    if len(found) != len(pairs):
        twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"the key {twice[:40]!r} stands twice in one object")
    return found


def _chunks(path: Path, data: bytes) -> tuple[memoryview, memoryview | None]:
    """JSON and binary chunk of a GLB, not copied."""
    version, length = (int(v) for v in np.frombuffer(data[4:12].ljust(8, b"\0"), "<u4"))
    if len(data) < 20 or length > len(data):
        raise file_error(
            path,
            f"is a GLB of {len(data)} bytes; expected {length} by its header: the file is "
            "truncated, copy or export it again",
        )
    if version != 2:
        raise file_error(path, f"is a GLB of version {version}; expected 2: export it again")
    found: dict[int, memoryview] = {}
    for kind, body in _each_chunk(path, memoryview(data)[:length]):
        found.setdefault(kind, body)
    if _JSON_CHUNK not in found:
        raise file_error(path, "is a GLB without a JSON chunk; expected glTF 2.0: export it again")
    return found[_JSON_CHUNK], found.get(_BIN_CHUNK)


def _each_chunk(path: Path, view: memoryview) -> Iterator[tuple[int, memoryview]]:
    at = 12
    while at + 8 <= len(view):
        size, kind = (int(v) for v in np.frombuffer(view[at : at + 8], "<u4"))
        if at + 8 + size > len(view):
            raise file_error(
                path,
                f"has a GLB chunk of {size} bytes where {len(view) - at - 8} are left; expected it "
                "inside the file: the file is truncated, copy or export it again",
            )
        yield kind, view[at + 8 : at + 8 + size]
        at += 8 + size

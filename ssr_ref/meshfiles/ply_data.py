"""The elements of a PLY file as arrays, checked against the file's size before memory is taken.

A list property whose rows all have one length, as most files' faces, is read as a table; rows of
several lengths are walked one by one. ASCII numbers are read as one stream, so it does not matter
where lines end.

Source: Greg Turk, "The PLY Polygon File Format", 1994.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import FileError
from ..typed import AnyArray, F64Array, I64Array
from .building import file_error

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
_MAX_HEADER = 2**20
_MAX_PROPERTIES = 1000


class Property(NamedTuple):
    """Name and dtype of a property; length: the dtype of a list's length, None for a scalar."""

    name: str
    dtype: np.dtype[Any]
    length: np.dtype[Any] | None


class Element(NamedTuple):
    """scalars: (rows,) each; lists: (rows,) lengths and all their values."""

    rows: int
    scalars: dict[str, AnyArray]
    lists: dict[str, tuple[I64Array, AnyArray]]


def read_ply(path: Path, data: bytes) -> tuple[list[str], dict[str, Element]]:
    """The header's lines, and each element by its name. Raises FileError (one line)."""
    lines, body = _header(path, data)
    kind = ""
    declared: list[tuple[str, int, list[Property]]] = []
    for line in lines:
        words = line.split()
        try:
            if words[:1] == ["format"]:
                kind = words[1]
            elif words[:1] == ["element"]:
                declared.append((words[1], int(words[2]), []))
            elif words[:1] == ["property"]:
                declared[-1][2].append(_property(words, _ORDERS[kind]))
        except (IndexError, KeyError, ValueError):
            raise _bad_header(path, f"has the header line '{line[:60]}'") from None
    if kind not in _ORDERS:
        raise _bad_header(path, "has no known format in its header")
    names = [name for name, _, _ in declared]
    wide = any(len(properties) > _MAX_PROPERTIES for _, _, properties in declared)
    if len(set(names)) != len(names) or wide or any(count < 0 for _, count, _ in declared):
        raise _bad_header(path, "has elements of one name, of a negative count or too many parts")
    reader = (_Ascii if kind == "ascii" else _Binary)(path, data, body)
    return lines, {
        name: reader.element(name, count, properties) for name, count, properties in declared
    }


def _bad_header(path: Path, found: str) -> FileError:
    return file_error(
        path, f"{found}; expected a PLY header: it is damaged or of another format, export it again"
    )


def _header(path: Path, data: bytes) -> tuple[list[str], int]:
    """The header's lines, and where the data start."""
    end = data.find(b"end_header", 0, _MAX_HEADER)
    if data[:3] != b"ply" or end < 0:
        raise _bad_header(path, "has no PLY header ('ply' to 'end_header')")
    newline = b"\r\n" if data[3:5] == b"\r\n" else data[3:4]
    if newline not in (b"\r\n", b"\n", b"\r"):
        raise _bad_header(path, "does not start with a line 'ply'")
    body = end + len(b"end_header")
    stop = data.find(newline, body, body + 80)
    lines = data[:end].decode("utf-8", "replace").splitlines()
    return lines, len(data) if stop < 0 else stop + len(newline)


def _property(words: list[str], order: str) -> Property:
    if words[1] == "list":
        count = np.dtype(order + _TYPES[words[2]])
        if count.kind == "f":
            raise ValueError("a length that is not whole")
        return Property(words[4], np.dtype(order + _TYPES[words[3]]), count)
    return Property(words[2], np.dtype(order + _TYPES[words[1]]), None)


def _native(array: AnyArray) -> AnyArray:
    return np.ascontiguousarray(array, array.dtype.newbyteorder("="))


class _Binary:
    """Elements of a binary body, one after the other."""

    def __init__(self, path: Path, data: bytes, start: int) -> None:
        self._path = path
        self._data = data
        self._at = start

    def element(self, name: str, count: int, properties: list[Property]) -> Element:
        if not properties or not count:
            return _empty(count if properties else 0, properties)
        least = sum((p.length or p.dtype).itemsize for p in properties)
        left = len(self._data) - self._at
        if count * least > left:
            raise self._truncated(name, left // least, count)
        return self._table(count, properties) or self._rows(name, count, properties)

    def _truncated(self, name: str, found: int, expected: int) -> FileError:
        return file_error(
            self._path,
            f"has {found} {name} rows; expected {expected} by its header: the file is truncated, "
            "copy or export it again",
        )

    def _table(self, count: int, properties: list[Property]) -> Element | None:
        """The element if every list has in every row the length that it has in the first."""
        fields: list[tuple[str, np.dtype[Any], tuple[int, ...]]] = []
        at = self._at
        for i, p in enumerate(properties):
            length = 1
            if p.length is not None:
                if at + p.length.itemsize > len(self._data):
                    return None
                length = int(np.frombuffer(self._data, p.length, 1, at)[0])
                fields.append((f"n{i}", p.length, ()))
                at += p.length.itemsize
            fields.append((f"p{i}", p.dtype, () if p.length is None else (length,)))
            at += length * p.dtype.itemsize
            if length < 0 or at > len(self._data):
                return None
        row = np.dtype(fields)  # type: ignore[arg-type]
        if count * row.itemsize > len(self._data) - self._at:
            return None
        rows = np.frombuffer(self._data, row, count, self._at)
        scalars, lists = {}, {}
        for i, p in enumerate(properties):
            values = _native(rows[f"p{i}"])
            if p.length is None:
                scalars[p.name] = values
                continue
            lengths = rows[f"n{i}"].astype(np.int64)
            if (lengths != lengths[0]).any():
                return None
            lists[p.name] = (lengths, values.reshape(-1))
        self._at += rows.nbytes
        return Element(count, scalars, lists)

    def _rows(self, name: str, count: int, properties: list[Property]) -> Element:
        data, at, end = self._data, self._at, len(self._data)
        signed = {p.length.str: p.length.kind == "i" for p in properties if p.length is not None}
        order = "big" if properties[0].dtype.str[0] == ">" else "little"
        if any(p.dtype.str[0] == ">" or (p.length and p.length.str[0] == ">") for p in properties):
            order = "big"
        values = [bytearray() for _ in properties]
        lengths: list[list[int]] = [[] for _ in properties]
        for row in range(count):
            for i, p in enumerate(properties):
                n = 1
                if p.length is not None:
                    stop = at + p.length.itemsize
                    n = int.from_bytes(data[at:stop], order, signed=signed[p.length.str])  # type: ignore[arg-type]
                    lengths[i].append(n)
                    at = stop
                stop = at + n * p.dtype.itemsize
                if n < 0 or stop > end:
                    raise self._truncated(name, row, count)
                values[i] += data[at:stop]
                at = stop
        self._at = at
        scalars, lists = {}, {}
        for i, p in enumerate(properties):
            found = _native(np.frombuffer(values[i], p.dtype))
            if p.length is None:
                scalars[p.name] = found
            else:
                lists[p.name] = (np.array(lengths[i], np.int64), found)
        return Element(count, scalars, lists)


class _Ascii:
    """Elements of an ASCII body: one stream of numbers."""

    def __init__(self, path: Path, data: bytes, start: int) -> None:
        self._path = path
        self._at = 0
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # what older NumPy says of text
            try:
                self._values: F64Array = np.fromstring(data[start:], np.float64, sep=" ")
            except (ValueError, DeprecationWarning):
                raise file_error(
                    path,
                    "has text that is no number after its header; expected numbers: repair it or "
                    "export it again",
                ) from None

    def element(self, name: str, count: int, properties: list[Property]) -> Element:
        if not properties or not count:
            return _empty(count if properties else 0, properties)
        left = len(self._values) - self._at
        if count * len(properties) > left:
            raise self._short(name, left // len(properties), count)
        return self._table(count, properties) or self._rows(name, count, properties)

    def _short(self, name: str, found: int, expected: int) -> FileError:
        return file_error(
            self._path,
            f"has {found} {name} rows; expected {expected} by its header: the file is truncated, "
            "copy or export it again",
        )

    def _table(self, count: int, properties: list[Property]) -> Element | None:
        starts, lengths = [], []
        width = 0
        for p in properties:
            n = 1
            if p.length is not None:
                if self._at + width >= len(self._values):
                    return None
                first = self._values[self._at + width]
                if not 0 <= first <= len(self._values):
                    return None
                n = int(first)
                width += 1
            starts.append(width)
            lengths.append(n)
            width += n
        if count * width > len(self._values) - self._at:
            return None
        rows = self._values[self._at : self._at + count * width].reshape(count, width)
        scalars, lists = {}, {}
        for p, start, n in zip(properties, starts, lengths):
            if p.length is None:
                scalars[p.name] = _typed(rows[:, start], p)
                continue
            if (rows[:, start - 1] != n).any():
                return None
            values = _typed(rows[:, start : start + n].reshape(-1), p)
            lists[p.name] = (np.full(count, n), values)
        self._at += count * width
        return Element(count, scalars, lists)

    def _rows(self, name: str, count: int, properties: list[Property]) -> Element:
        at, end = self._at, len(self._values)
        starts = np.empty((len(properties), count), np.int64)
        lengths = np.ones((len(properties), count), np.int64)
        for row in range(count):
            for i, p in enumerate(properties):
                n = 1
                if p.length is not None:
                    first = float(self._values[at]) if at < end else -1.0
                    n = int(first) if 0.0 <= first <= end and first.is_integer() else end
                    at += 1
                if at + n > end:
                    raise self._short(name, row, count)
                starts[i, row], lengths[i, row] = at, n
                at += n
        self._at = at
        scalars, lists = {}, {}
        for i, p in enumerate(properties):
            ends = np.cumsum(lengths[i])
            shift = np.repeat(starts[i] - (ends - lengths[i]), lengths[i])
            values = _typed(self._values[np.arange(len(shift)) + shift], p)
            if p.length is None:
                scalars[p.name] = values
            else:
                lists[p.name] = (lengths[i], values)
        return Element(count, scalars, lists)


def _typed(values: F64Array, p: Property) -> AnyArray:
    """The numbers in the property's type; raises ValueError for one that it cannot hold."""
    native = p.dtype.newbyteorder("=")
    if p.dtype.kind == "f":
        with np.errstate(over="ignore"):
            return values.astype(native)
    info = np.iinfo(p.dtype)
    odd = np.flatnonzero(~((values >= info.min) & (values <= info.max)))
    if not odd.size:
        odd = np.flatnonzero(values != np.floor(values))
    if odd.size:
        raise ValueError(f"{p.name} {values[odd[0]]:.10g} is no {native}")
    return values.astype(native)


def _empty(count: int, properties: list[Property]) -> Element:
    return Element(
        count,
        {p.name: np.empty(0, p.dtype.newbyteorder("=")) for p in properties if p.length is None},
        {
            p.name: (np.empty(0, np.int64), np.empty(0, p.dtype.newbyteorder("=")))
            for p in properties
            if p.length is not None
        },
    )

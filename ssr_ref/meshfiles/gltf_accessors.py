"""Buffers and accessors of a glTF file as arrays: interleaved, sparse, quantised.

Source: glTF 2.0, sections 3.6 (buffers, accessors, sparse) and 3.6.2.2 (normalised integers); the
extensions KHR_mesh_quantization, KHR_draco_mesh_compression, EXT_ and KHR_meshopt_compression.

Rounding: float32 values are taken bit for bit; integers of 8 and 16 bits are exact in float32; a
normalised one is the float32 nearest to the exact quotient c / 255, c / 65535, max(c / 127, −1) or
max(c / 32767, −1), the one division being correctly rounded.
"""

from __future__ import annotations

import base64
import binascii
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np

from ..typed import AnyArray, F32Array
from .beside import read_beside
from .gltf_json import Gltf

MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
DRACO = "KHR_draco_mesh_compression"
QUANTIZATION = "KHR_mesh_quantization"

MAX_ZEROS = 2**26
"""Bytes that a sparse accessor without data beneath may ask for."""

_BUDGET, _BUDGET_PER_BYTE = 2**26, 64
"""Bytes that accessors become at most: this, and so many times the bytes of the file's buffers."""

_MAX_BUFFERS = 2**31
"""Bytes of all buffers together."""

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
UNSIGNED = ("<u1", "<u2", "<u4")


class Raw(NamedTuple):
    """An accessor as the file has it: values (count, width), whether integers are normalised."""

    values: AnyArray
    normalized: bool


class Accessors:
    """Reads a file's accessors; buffers are opened on first use. Errors are FileError lines."""

    def __init__(self, gltf: Gltf) -> None:
        self._gltf = gltf
        self._buffers: dict[int, memoryview] = {}
        self._files: dict[str, memoryview] = {}
        self._buffer_bytes = 0
        self._read_bytes = 0

    # ------------------------------------------------------------------ vertices

    def vertices(self, index: Any, where: str, widths: tuple[int, ...], allowed: str) -> F32Array:
        """(n, width) float32 of a vertex attribute.

        allowed : which types beside float32 the attribute may have, space-separated, such as
            "u1n u2n": unsigned, signed (i), normalised (n).
        """
        values, normalized = self.raw(index, where)
        kind = values.dtype.str[1:] + "n" * (normalized and values.dtype.kind != "f")
        if values.shape[1] not in widths or kind not in ("f4", *allowed.split()):
            listed = " or ".join(f"VEC{w}" for w in widths)
            kinds = "float32" + (f" or {allowed.replace(' ', ', ')}" if allowed else "")
            raise self._gltf.error(
                f"{where} is {values.shape[1]} × {kind}; expected {listed} of {kinds}: export "
                f"again, or declare {QUANTIZATION} if it is quantised"
            )
        return as_float32(values, normalized)

    # ------------------------------------------------------------------ accessors

    def raw(self, index: Any, where: str, allowed: tuple[str, ...] = ()) -> Raw:
        """Accessor `index`, the file's type; `where` names it in errors. Data may be the file's."""
        gltf = self._gltf
        entry = gltf.item("accessors", index)
        count = gltf.whole(entry, "count", where, None)
        dtype, width = self._layout(entry, where, allowed)
        size = count * width * np.dtype(dtype).itemsize
        if "bufferView" in entry:
            offset = gltf.whole(entry, "byteOffset", where, 0)
            values = self._values(entry["bufferView"], offset, count, dtype, width, where)
            self.spend(4 * count * width, where)
        elif "sparse" in entry:
            if size > MAX_ZEROS:
                raise gltf.error(
                    f"{where} asks for {size} bytes of zeros; expected at most {MAX_ZEROS}: the "
                    "file is damaged, export it again"
                )
            self.spend(4 * count * width, where)
            values = np.zeros((count, width), dtype)
        else:
            raise gltf.error(
                f"{where} has no data (compressed?); expected a bufferView: export without Draco "
                "or meshopt compression"
            )
        if "sparse" in entry:
            values = self._with_sparse(gltf.object(entry, "sparse", where), values, where)
        return Raw(values, entry.get("normalized", False) is True)

    def _layout(
        self, entry: dict[str, Any], where: str, allowed: tuple[str, ...]
    ) -> tuple[str, int]:
        component, shape = entry.get("componentType"), entry.get("type")
        dtype = _COMPONENTS.get(component) if isinstance(component, int) else None
        width = _WIDTHS.get(shape) if isinstance(shape, str) else None
        if dtype is None or width is None or (allowed and dtype not in allowed):
            raise self._gltf.error(
                f"{where} has component type {str(component)[:20]} and type {str(shape)[:20]}; "
                "expected one that glTF 2.0 allows here: export again"
            )
        return dtype, width

    def _values(
        self, view_index: Any, offset: int, count: int, dtype: str, width: int, where: str
    ) -> AnyArray:
        """(count, width) values in a buffer view, as the buffer's own bytes."""
        gltf = self._gltf
        view = gltf.item("bufferViews", view_index)
        data = self.view(view_index, where)
        item = width * np.dtype(dtype).itemsize
        stride = gltf.whole(view, "byteStride", f"{where} bufferView", 0) or item
        end = offset + (count - 1) * stride + item if count else offset
        if stride < item or end > len(data):
            raise gltf.error(
                f"{where} needs bytes {offset} to {end} of a view of {len(data)}, {stride} apart; "
                "expected them inside it: the file is truncated or damaged, export it again"
            )
        if count == 0:
            return np.empty((0, width), dtype)
        return np.ndarray((count, width), dtype, data, offset, (stride, np.dtype(dtype).itemsize))

    def _with_sparse(self, sparse: dict[str, Any], base: AnyArray, where: str) -> AnyArray:
        """A copy of the base with the values of `sparse` put in."""
        gltf = self._gltf
        where = f"{where} sparse"
        count = gltf.whole(sparse, "count", where, None)
        if count > len(base):
            raise gltf.error(
                f"{where} replaces {count} of {len(base)} elements; expected no more than there "
                "are: the file is damaged, export it again"
            )
        places, news = (gltf.object(sparse, key, where) for key in ("indices", "values"))
        dtype, _ = self._layout({**places, "type": "SCALAR"}, where, UNSIGNED)
        at = gltf.whole(places, "byteOffset", where, 0)
        indices = self._values(places.get("bufferView"), at, count, dtype, 1, where)[:, 0]
        if count and (int(indices[-1]) >= len(base) or (indices[1:] <= indices[:-1]).any()):
            raise gltf.error(
                f"{where} indices reach {indices.max()} of {len(base)}; expected growing ones from "
                f"0 to {len(base) - 1}: the file is damaged, export it again"
            )
        at = gltf.whole(news, "byteOffset", where, 0)
        values = self._values(
            news.get("bufferView"), at, count, base.dtype.str, base.shape[1], where
        )
        out = base.copy()
        out[indices] = values
        return out

    def spend(self, size: int, where: str) -> None:
        """Count bytes of what is made of the file (4 for each number, whatever it is stored as).

        Few bytes of JSON can read a buffer many times, and one byte can become a triangle.
        """
        self._read_bytes += size
        budget = _BUDGET + _BUDGET_PER_BYTE * (self._gltf.size + self._buffer_bytes)
        if self._read_bytes > budget:
            raise self._gltf.error(
                f"{where} brings what is read to {self._read_bytes} bytes; expected at most "
                f"{budget} for a file of this size: share accessors less, or split the file"
            )

    # -------------------------------------------------------------------- buffers

    def view(self, index: Any, where: str) -> memoryview:
        """The bytes of buffer view `index`."""
        gltf = self._gltf
        view = gltf.item("bufferViews", index)
        data = self._buffer(view, where)
        start = gltf.whole(view, "byteOffset", f"{where} bufferView", 0)
        length = gltf.whole(view, "byteLength", f"{where} bufferView", None)
        if start + length > len(data):
            raise gltf.error(
                f"{where} needs bytes {start} to {start + length} of a buffer of {len(data)}; "
                "expected them inside it: the file is truncated or damaged, export it again"
            )
        return data[start : start + length]

    def _buffer(self, view: dict[str, Any], where: str) -> memoryview:
        gltf = self._gltf
        index = view.get("buffer")
        entry = gltf.item("buffers", index)
        assert isinstance(index, int)
        if index in self._buffers:
            return self._buffers[index]
        uri = entry.get("uri")
        if uri is None and index == 0 and gltf.binary is not None:
            data = gltf.binary
        elif isinstance(uri, str):
            data = self.resource(uri)
        else:
            for name in MESHOPT:
                if any(gltf.extension(e, name, where) is not None for e in (view, entry)):
                    raise gltf.error(
                        f"{where} is compressed with {name}; expected plain buffers: export without"
                        " meshopt compression"
                    )
            raise gltf.error(f"buffers[{index}] has no data; expected a uri: export again")
        length = gltf.whole(entry, "byteLength", f"buffers[{index}]", None)
        if len(data) < length:
            raise gltf.error(
                f"buffers[{index}] has {len(data)} bytes; expected {length}: the file is "
                "truncated, copy or export it again"
            )
        self._buffers[index] = data[:length]
        return self._buffers[index]

    def resource(self, uri: str) -> memoryview:
        """The bytes of a data URI, or of a file beside the glTF file; read once."""
        gltf = self._gltf
        if uri not in self._files:
            data = self._data_uri(uri) if uri.startswith("data:") else self._beside(uri)
            self._buffer_bytes += len(data)
            if self._buffer_bytes > _MAX_BUFFERS:
                raise gltf.error(
                    f"its buffers and images hold over {_MAX_BUFFERS} bytes; expected less: split "
                    "the file"
                )
            self._files[uri] = memoryview(data)
        return self._files[uri]

    def _data_uri(self, uri: str) -> bytes:
        head, comma, body = uri.partition(",")
        if not comma or not head.endswith(";base64"):
            raise self._gltf.error("a data URI is not base64; expected ';base64,': export it again")
        try:
            return base64.b64decode(unquote(body) if "%" in body else body, validate=True)
        except (binascii.Error, ValueError):
            raise self._gltf.error("a data URI is broken; expected base64: export again") from None

    def _beside(self, uri: str) -> bytes:
        return read_beside(self._gltf.path, unquote(uri), self._gltf.options)


def as_float32(values: AnyArray, normalized: bool) -> F32Array:
    """Float32 of float32 or 8 to 16-bit integers; see the module for the rounding."""
    if values.dtype.kind == "f" or not normalized:
        return values.astype(np.float32, copy=False)
    out = values.astype(np.float32)
    out /= np.float32(np.iinfo(values.dtype).max)
    if values.dtype.kind == "i":
        np.maximum(out, np.float32(-1.0), out=out)
    return out

"""A PNG decoder: every colour type, 1 to 16 bits, interlaced or not, as RGBA codes.

Source: PNG Specification (Third Edition), W3C, sections 7 to 11. Pillow reads 16-bit colour as 8
bits and compares tRNS with scaled greys; pypng takes 2 s for 1024 × 1024 RGBA of 16 bits. Of the
chunks only IHDR, PLTE, tRNS and IDAT matter: gamma, profile and text are never decompressed.

The size is checked before memory is taken, and against what the file's bytes can inflate to.
"""

from __future__ import annotations

import struct
import zlib
from typing import NamedTuple

import numpy as np

from .._jit import driver
from ..errors import FileError, SceneError
from ..texture import check_image_size
from ..typed import AnyArray, U8Array

SIGNATURE = b"\x89PNG\r\n\x1a\n"

_GREY, _RGB, _PALETTE, _GREY_ALPHA, _RGBA = 0, 2, 3, 4, 6
_DEPTHS = {
    _GREY: (1, 2, 4, 8, 16),
    _RGB: (8, 16),
    _PALETTE: (1, 2, 4, 8),
    _GREY_ALPHA: (8, 16),
    _RGBA: (8, 16),
}
_CHANNELS = {_GREY: 1, _RGB: 3, _PALETTE: 1, _GREY_ALPHA: 2, _RGBA: 4}

# Adam7: first column, first row, column step, row step of each pass.
_ADAM7 = (
    (0, 0, 8, 8),
    (4, 0, 8, 8),
    (0, 4, 4, 8),
    (2, 0, 4, 4),
    (0, 2, 2, 4),
    (1, 0, 2, 2),
    (0, 1, 1, 2),
)

_MOST_INFLATED = 1032
"""DEFLATE makes at most 1032 bytes of one (258 bytes for 2 bits)."""

_PADDING = 3
"""Zero bytes that may follow the image: containers align to 4 bytes."""


class _Header(NamedTuple):
    width: int
    height: int
    depth: int
    color: int
    interlaced: bool

    @property
    def pixel_bits(self) -> int:
        return self.depth * _CHANNELS[self.color]


def image_error(name: str, found: str, expected: str) -> FileError:
    """A FileError of one line about the image `name`."""
    return FileError(" ".join(f"image '{name}' {found}; expected {expected}".split()))


def _damaged(name: str, what: str) -> FileError:
    return image_error(name, f"is a damaged PNG ({what})", "a valid file: export it again")


def decode_png(name: str, data: bytes) -> AnyArray:
    """(H, W, 4) uint8, or uint16 for a depth of 16, RGBA; alpha is the greatest code if absent.

    Greys of less than 8 bits are scaled to 0..255 exactly. Raises FileError for damaged, truncated
    or animated data, anything but zero padding after the end, or a size over the limits.
    """
    header, chunks = _read_chunks(name, data)
    passes = [
        (x, y, dx, dy, -(-(header.width - x) // dx), -(-(header.height - y) // dy))
        for x, y, dx, dy in (_ADAM7 if header.interlaced else ((0, 0, 1, 1),))
        if x < header.width and y < header.height
    ]
    sizes = [h * (1 + (w * header.pixel_bits + 7) // 8) for *_, w, h in passes]
    raw = _inflate(name, chunks[b"IDAT"], sum(sizes))
    channels = _CHANNELS[header.color]
    samples = np.empty(
        (header.height, header.width, channels), np.uint16 if header.depth == 16 else np.uint8
    )
    at = 0
    for (x, y, dx, dy, w, h), size in zip(passes, sizes):
        rows = raw[at : at + size].reshape(h, -1)
        out = np.empty((h, rows.shape[1] - 1), np.uint8)
        if not _unfilter(rows, max(1, header.pixel_bits // 8), out):
            raise _damaged(name, "an unknown row filter")
        samples[y::dy, x::dx] = _samples(out, header.depth, w * channels).reshape(h, w, channels)
        at += size
    return _rgba(name, samples, header, chunks)


def _read_chunks(name: str, data: bytes) -> tuple[_Header, dict[bytes, bytes]]:
    """The header, and the bodies of PLTE, tRNS and IDAT (joined)."""
    header: _Header | None = None
    chunks: dict[bytes, bytes] = {}
    parts: list[bytes] = []
    at = len(SIGNATURE)
    while True:
        if at + 12 > len(data):
            raise _damaged(name, "its end is missing")
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        end = at + 12 + length
        if end > len(data):
            raise _damaged(name, "a chunk is longer than the file")
        body = data[at + 8 : end - 4]
        if not kind[0] & 0x20 or kind == b"tRNS":  # critical, or used here
            if struct.pack(">I", zlib.crc32(data[at + 4 : end - 4])) != data[end - 4 : end]:
                raise _damaged(name, f"the checksum of {kind!r} is wrong")
        if header is None:
            if kind != b"IHDR" or length != 13:
                raise _damaged(name, "it does not start with IHDR")
            header = _read_header(name, body)
        elif kind == b"IDAT":
            parts.append(body)
        elif kind == b"acTL":
            raise image_error(name, "is an animated PNG", "a still image: export one frame")
        elif kind in (b"PLTE", b"tRNS"):
            if kind in chunks or parts:
                raise _damaged(name, f"{kind!r} is in the wrong place")
            chunks[kind] = body
        elif kind == b"IEND":
            break
        elif not kind[0] & 0x20:
            raise _damaged(name, f"unknown chunk {kind!r}")
        at = end
    if len(data) - end > _PADDING or any(data[end:]):
        raise _damaged(name, f"{len(data) - end} bytes follow its end")
    return header, {**chunks, b"IDAT": b"".join(parts)}


def _read_header(name: str, body: bytes) -> _Header:
    width, height, depth, color, compression, filtering, interlace = struct.unpack(">IIBBBBB", body)
    if depth not in _DEPTHS.get(color, ()) or compression or filtering or interlace > 1:
        raise _damaged(name, f"depth {depth}, colour type {color}, interlace {interlace}")
    try:
        check_image_size(name, width, height)
    except SceneError as error:
        raise FileError(" ".join(str(error).split())) from None
    return _Header(width, height, depth, color, interlace == 1)


def _inflate(name: str, data: bytes, size: int) -> U8Array:
    """The (size,) bytes of a zlib stream; never takes more memory than that."""
    if size > _MOST_INFLATED * (len(data) + 1):
        raise _damaged(name, f"{len(data)} bytes of data where {size} must come out")
    stream = zlib.decompressobj()
    try:
        raw = stream.decompress(data, size + 1)
    except zlib.error as error:
        raise _damaged(name, str(error)) from None
    if len(raw) != size or not stream.eof:
        more = " or more" if not stream.eof else ""
        raise _damaged(name, f"{len(raw)}{more} bytes of pixels, {size} needed")
    return np.frombuffer(raw, np.uint8)


@driver(parallel=False)
def _unfilter(rows: U8Array, step: int, out: U8Array) -> bool:
    """Undo each row's filter (PNG, section 9): rows (h, 1 + n), out (h, n); false: unknown filter.

    step: bytes from a sample to the same one of the pixel before.
    """
    for r in range(rows.shape[0]):
        kind = rows[r, 0]
        if kind > 4:
            return False
        for i in range(out.shape[1]):
            value = np.int32(rows[r, i + 1])
            left = np.int32(out[r, i - step]) if i >= step else np.int32(0)
            up = np.int32(out[r - 1, i]) if r > 0 else np.int32(0)
            if kind == 1:
                value += left
            elif kind == 2:
                value += up
            elif kind == 3:
                value += (left + up) >> 1
            elif kind == 4:
                corner = np.int32(out[r - 1, i - step]) if r > 0 and i >= step else np.int32(0)
                a, b, c = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
                if a <= b and a <= c:
                    value += left
                elif b <= c:
                    value += up
                else:
                    value += corner
            out[r, i] = np.uint8(value & 255)
    return True


def _samples(rows: U8Array, depth: int, count: int) -> AnyArray:
    """(h, count) samples of packed rows, as the file's numbers."""
    if depth == 16:
        return rows.view(">u2")
    if depth == 8:
        return rows
    bits = np.unpackbits(rows, axis=1).reshape(len(rows), -1, depth)
    value = np.zeros(bits.shape[:2], np.uint8)
    for i in range(depth):
        value = 2 * value + bits[:, :, i]
    return value[:, :count]


def _rgba(name: str, samples: AnyArray, header: _Header, chunks: dict[bytes, bytes]) -> AnyArray:
    """(H, W, 4) codes of (H, W, channels) samples."""
    out = np.empty((header.height, header.width, 4), samples.dtype)
    greatest = np.iinfo(samples.dtype).max
    transparent = chunks.get(b"tRNS")
    if header.color == _PALETTE:
        palette = np.frombuffer(chunks.get(b"PLTE", b""), np.uint8)
        count = len(palette) // 3
        if not 1 <= count <= 256 or len(palette) % 3 or samples.max() >= count:
            raise _damaged(name, f"colour {samples.max()} of a palette of {count}")
        table = np.full((count, 4), greatest, np.uint8)
        table[:, :3] = palette.reshape(-1, 3)
        if transparent is not None:
            if len(transparent) > count:
                raise _damaged(name, "more alphas than colours")
            table[: len(transparent), 3] = np.frombuffer(transparent, np.uint8)
        return table[samples[:, :, 0]]
    out[:, :, 3] = greatest
    if header.color in (_GREY_ALPHA, _RGBA):
        out[:, :, 3] = samples[:, :, -1]
    elif transparent is not None:
        if len(transparent) != 2 * samples.shape[2]:
            raise _damaged(name, f"tRNS of {len(transparent)} bytes")
        key = np.frombuffer(transparent, ">u2") & ((1 << header.depth) - 1)
        out[(samples == key).all(axis=2), 3] = 0
    scale = greatest // ((1 << header.depth) - 1)
    out[:, :, :3] = samples[:, :, : 3 if samples.shape[2] > 2 else 1] * samples.dtype.type(scale)
    return out

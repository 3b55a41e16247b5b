"""Image files to `Image`, and back to PNG.

8-bit PNG, JPEG and WebP go through Pillow; 16-bit PNG and greys of fewer than 8 bits through pypng,
because Pillow reads 16-bit colour as 8 bits and compares tRNS with scaled greys. The decoders of
JPEG and WebP are not defined to the last bit, so their codes may differ by 1 between versions of
libjpeg or libwebp; PNG is lossless. Colour profiles, gamma chunks and EXIF orientation are ignored,
as glTF 2.0, sections 3.8.3 and 3.9.2, demands.

Files are untrusted: the size is read from the header and checked before memory is taken.
"""

from __future__ import annotations

import io
import struct
import warnings
import zlib

import numpy as np

from ..errors import FileError, SceneError
from ..texture import MAX_IMAGE_PIXELS, Image, check_image_size
from ..typed import AnyArray

SIGNATURE = b"\x89PNG\r\n\x1a\n"

_MOST_INFLATED = 1032
"""DEFLATE makes at most 1032 bytes of one (258 bytes for 2 bits)."""

_SLOW_TEXELS, _SLOW_TEXELS_PER_BYTE = 2**22, 64
"""Texels that pypng may make (2 µs each): this, and so many times the bytes of the file."""

_FREE_BYTES, _BYTES_PER_BYTE = 2**26, 256
"""Bytes that any image may decode to (4096 × 4096 of 8 bits), and above it, for each of its own."""

_STORED = 65535
"""Most bytes of one stored DEFLATE block (RFC 1951, section 3.2.4)."""


class NoRoomError(FileError):
    """An image whose pixels would take more memory than there is room for."""


def read_image(name: str, data: bytes, *, room: int | None = None) -> Image:
    """The image of a PNG, JPEG or WebP file; its kind is decided by its first bytes.

    name : of the image, used in errors too. Pixels are (H, W, 4), uint16 for 16-bit PNG, uint8
    otherwise; alpha is the greatest code where the file has none. Raises FileError (one line) for
    another format, damaged, truncated or animated data, CMYK, or a size over `texture`'s limits;
    NoRoomError, before anything is decoded, if its pixels take more than `room` bytes.
    """
    if data.startswith(SIGNATURE):
        pixels = _read_png(name, data, room)
    elif data.startswith(b"\xff\xd8\xff"):
        pixels = _through_pillow(name, data, "JPEG", room)
    elif data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        _check_webp(name, data, room)
        pixels = _through_pillow(name, data, "WEBP", room)
    else:
        raise image_error(
            name,
            f"starts with {bytes(data[:8])!r}" if data else "is empty",
            "a PNG, JPEG or WebP file: convert it",
        )
    return Image(name, pixels)


def image_error(name: str, found: str, expected: str) -> FileError:
    """A FileError of one line about an image."""
    return FileError(" ".join(f"image '{name}' {found}; expected {expected}".split()))


def _check_size(
    name: str, data: bytes, width: int, height: int, texel: int, room: int | None
) -> None:
    """Refuse, by its header, an image that is too large, far larger than its file, or than `room`.

    texel : bytes of one that is decoded.
    """
    try:
        check_image_size(name, width, height)
    except SceneError as error:
        raise FileError(" ".join(str(error).split())) from None
    most = max(_FREE_BYTES, _BYTES_PER_BYTE * len(data))
    if width * height * texel > most:
        raise image_error(
            name,
            f"decodes to {width * height * texel} bytes from {len(data)}",
            f"at most {most}: it may be an image bomb, scale it down",
        )
    if room is not None and width * height * texel > room:
        raise NoRoomError(
            f"image '{name}' takes {width * height * texel} bytes; expected at most {max(room, 0)} "
            "more: scale the images down"
        )


def _read_png(name: str, data: bytes, room: int | None) -> AnyArray:
    """Check the header, then decode by the library that gets this kind right."""
    if len(data) < 33 or data[12:16] != b"IHDR":
        raise image_error(name, "has no PNG header", "a valid PNG file: export it again")
    width, height, depth, color = struct.unpack(">IIBB", data[16:26])
    _check_size(name, data, width, height, 8 if depth == 16 else 4, room)
    if width * height * depth > 8 * _MOST_INFLATED * len(data):
        raise image_error(
            name,
            f"says {width} × {height} texels in {len(data)} bytes",
            "a whole PNG file: it is cut short, export it again",
        )
    if depth == 16 or (color == 0 and depth < 8):
        if width * height > _SLOW_TEXELS + _SLOW_TEXELS_PER_BYTE * len(data):
            raise image_error(
                name,
                f"has {width} × {height} texels of {depth} bits in {len(data)} bytes",
                "8 bits where so much is packed: convert it",
            )
        _check_unpacked(name, data, width, height)
        return _through_pypng(name, data)
    return _through_pillow(name, data, "PNG", room)


def _check_unpacked(name: str, data: bytes, width: int, height: int) -> None:
    """Raise FileError if the pixel data unpack to more than the header says: pypng unpacks all.

    The bound holds for 4 channels of 16 bits, and for the filter bytes of interlaced rows too.
    """
    left = 8 * width * height + 2 * (2 * height + 8)
    stream = zlib.decompressobj()
    at = len(SIGNATURE)
    try:
        while at + 8 <= len(data):
            size = int.from_bytes(data[at : at + 4], "big")
            if data[at + 4 : at + 8] == b"IDAT":
                left -= len(stream.decompress(data[at + 8 : at + 8 + size], left + 1))
            if left < 0:
                raise image_error(
                    name,
                    f"cannot be read as PNG (it unpacks to more than {width} × {height} texels)",
                    "a valid PNG file: export it again",
                )
            at += 12 + size
    except zlib.error:
        pass  # pypng says what is damaged


def _through_pypng(name: str, data: bytes) -> AnyArray:
    import png

    try:
        reader = png.Reader(bytes=data)
        reader.preamble()
        wide = reader.bitdepth == 16
        width, height, rows, _ = reader.asRGBA() if wide else reader.asRGBA8()
        pixels = np.empty((height, width, 4), np.uint16 if wide else np.uint8)
        filled = 0
        for y, row in enumerate(rows):
            pixels[y] = np.asarray(row, pixels.dtype).reshape(width, 4)
            filled += 1
        if filled != height:
            raise ValueError(f"{filled} of {height} rows")
    except Exception as error:  # what pypng raises depends on the damage
        raise image_error(
            name,
            f"cannot be read as PNG ({type(error).__name__}: {str(error)[:120]})",
            "a valid PNG file: export it again",
        ) from None
    return pixels


def _through_pillow(name: str, data: bytes, kind: str, room: int | None) -> AnyArray:
    from PIL import Image as PillowImage

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's own size warning: the limits here are lower
            if kind == "PNG":
                with PillowImage.open(io.BytesIO(data), formats=(kind,)) as file:
                    file.verify()  # the chunks' checksums, which decoding alone passes over
            with PillowImage.open(io.BytesIO(data), formats=(kind,)) as file:
                _check_size(name, data, *file.size, 4, room)
                # The second picture of a stereo JPEG is no animation: the first is the image.
                if kind != "JPEG" and getattr(file, "is_animated", False):
                    raise image_error(name, "is animated", "a still image: export one frame")
                if file.mode not in ("1", "L", "LA", "P", "RGB", "RGBA", "RGBX"):
                    raise image_error(name, f"is {kind} in {file.mode}", "grey or RGB: convert it")
                return np.asarray(file.convert("RGBA"))
    except FileError:
        raise
    except PillowImage.DecompressionBombError:
        raise image_error(
            name, f"has over {MAX_IMAGE_PIXELS} texels", "no more: scale it down"
        ) from None
    except Exception as error:  # Pillow's plugins raise whatever the damage leads to
        raise image_error(
            name,
            f"cannot be read as {kind} ({type(error).__name__}: {str(error)[:120]})",
            f"a valid {kind} file: export it again",
        ) from None


def _check_webp(name: str, data: bytes, room: int | None) -> None:
    """Check the size in a WebP header: Pillow's reader takes memory for it when it opens.

    Source: RFC 9649, sections 2.5 to 2.7.
    """
    head = data[12:30].ljust(18, b"\0")
    if head[:4] == b"VP8X":
        width = int.from_bytes(head[12:15], "little") + 1
        height = int.from_bytes(head[15:18], "little") + 1
    elif head[:4] == b"VP8L":
        bits = int.from_bytes(head[9:13], "little")
        width, height = (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    else:
        width, height = (v & 0x3FFF for v in struct.unpack("<HH", head[14:18]))
    _check_size(name, data, width, height, 4, room)


def png_bytes(image: Image) -> bytes:
    """An 8 or 16-bit RGBA PNG that `read_image` gives back exactly.

    The pixels are stored without compression (a little over 4 or 8 bytes each): what a compressor
    makes of them changes with its version, and these bytes must depend on the pixels only.
    """
    pixels = image.pixels
    height, width = pixels.shape[:2]
    depth = 8 * pixels.itemsize
    rows = pixels.astype(pixels.dtype.newbyteorder(">")).reshape(height, -1).view(np.uint8)
    raw = np.zeros((height, 1 + rows.shape[1]), np.uint8)  # column 0: filter "None"
    raw[:, 1:] = rows
    return (
        SIGNATURE
        + _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, 6, 0, 0, 0))
        + _chunk(b"IDAT", _stored(raw.tobytes()))
        + _chunk(b"IEND", b"")
    )


def _stored(raw: bytes) -> bytes:
    """A zlib stream (RFC 1950) of stored blocks."""
    parts = [b"\x78\x01"]
    for at in range(0, len(raw), _STORED):
        block = raw[at : at + _STORED]
        last = at + _STORED >= len(raw)
        parts += [struct.pack("<BHH", last, len(block), 0xFFFF - len(block)), block]
    parts.append(struct.pack(">I", zlib.adler32(raw)))
    return b"".join(parts)


def _chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

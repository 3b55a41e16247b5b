"""Image files to `Image`, and back to PNG.

PNG is decoded by `png_codec.py`, so its codes never depend on a library's version. JPEG and WebP go
through Pillow: their decoders are not defined to the last bit, so their codes may differ by 1
between versions of libjpeg or libwebp. Colour profiles, gamma chunks and EXIF orientation are
ignored, as glTF 2.0, section 3.9.2 and 3.8.3, demands.

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
from .png_codec import SIGNATURE, decode_png, image_error

_STORED = 65535
"""Most bytes of one stored DEFLATE block (RFC 1951, section 3.2.4)."""


def read_image(name: str, data: bytes) -> Image:
    """The image of a PNG, JPEG or WebP file; its kind is decided by its first bytes.

    name : of the image, used in errors too. Pixels are (H, W, 4), uint16 for 16-bit PNG, uint8
    otherwise; alpha is the greatest code where the file has none. Raises FileError (one line) for
    another format, damaged, truncated or animated data, CMYK, or a size over `texture`'s limits.
    """
    if data.startswith(SIGNATURE):
        pixels = decode_png(name, data)
    elif data.startswith(b"\xff\xd8\xff"):
        pixels = _through_pillow(name, data, "JPEG")
    elif data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        _check_webp(name, data)
        pixels = _through_pillow(name, data, "WEBP")
    else:
        raise image_error(
            name,
            f"starts with {bytes(data[:8])!r}" if data else "is empty",
            "a PNG, JPEG or WebP file: convert it",
        )
    return Image(name, pixels)


def _through_pillow(name: str, data: bytes, kind: str) -> AnyArray:
    from PIL import Image as PillowImage

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's own size warning: the limits here are lower
            with PillowImage.open(io.BytesIO(data), formats=(kind,)) as file:
                check_image_size(name, *file.size)
                # The second picture of a stereo JPEG is no animation: the first is the image.
                if kind != "JPEG" and getattr(file, "is_animated", False):
                    raise image_error(name, "is animated", "a still image: export one frame")
                if file.mode not in ("1", "L", "LA", "RGB", "RGBA", "RGBX"):
                    raise image_error(name, f"is {kind} in {file.mode}", "grey or RGB: convert it")
                return np.asarray(file.convert("RGBA"))
    except SceneError as error:
        raise FileError(" ".join(str(error).split())) from None
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


def _check_webp(name: str, data: bytes) -> None:
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
    try:
        check_image_size(name, width, height)
    except SceneError as error:
        raise FileError(" ".join(str(error).split())) from None


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

"""Image files, files beside an asset and load options. pypng and Pillow write the test images."""

from __future__ import annotations

import io
import os
import struct
import tracemalloc
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import png
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image as PillowImage

from ssr_ref.errors import FileError, SettingsError
from ssr_ref.meshfiles import beside as beside_module
from ssr_ref.meshfiles import images
from ssr_ref.meshfiles.beside import read_beside
from ssr_ref.meshfiles.images import png_bytes, read_image
from ssr_ref.meshfiles.options import LoadOptions, check_strict
from ssr_ref.scene import LoadReport
from ssr_ref.texture import Image

DEPTHS = {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}
CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}


def chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def header(width: int, height: int, depth: int = 8, color: int = 6, interlace: int = 0) -> bytes:
    return chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, interlace))


def make_png(*chunks: bytes) -> bytes:
    return images.SIGNATURE + b"".join(chunks) + chunk(b"IEND", b"")


def refused(data: bytes, *words: str) -> None:
    with pytest.raises(FileError) as caught:
        read_image("lid.png", data)
    message = str(caught.value)
    assert "\n" not in message
    assert "lid.png" in message
    assert "expected" in message
    for word in words:
        assert word in message, message


# ------------------------------------------------------------------------- PNG


@st.composite
def random_png(draw: Any) -> tuple[bytes, np.ndarray]:
    """A PNG of any kind, written by pypng, and the RGBA codes that it means."""
    color = draw(st.sampled_from(sorted(DEPTHS)))
    depth = draw(st.sampled_from(DEPTHS[color]))
    width, height = draw(st.integers(1, 19)), draw(st.integers(1, 13))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    greatest = 65535 if depth == 16 else 255
    out = np.full((height, width, 4), greatest)
    options: dict[str, Any] = {}
    if color == 3:
        count = draw(st.integers(1, 2**depth))
        pixels = rng.integers(0, count, (height, width, 1))
        table = rng.integers(0, 256, (count, 4))
        if draw(st.booleans()):
            table[:, 3] = 255
        rows = [tuple(map(int, row if row[3] < 255 else row[:3])) for row in table]
        # pypng wants the colours with alpha first.
        order = sorted(range(count), key=lambda i: -len(rows[i]))
        options["palette"] = [rows[i] for i in order]
        out[:] = table[order][pixels[:, :, 0]]
    else:
        pixels = rng.integers(0, 2**depth, (height, width, CHANNELS[color]))
        options.update(greyscale=color in (0, 4), alpha=color in (4, 6))
        scaled = pixels * (greatest // (2**depth - 1))  # 255 = 3 · 85 = 15 · 17: always whole
        out[:, :, :3] = scaled[:, :, : 3 if color in (2, 6) else 1]
        if options["alpha"]:
            out[:, :, 3] = scaled[:, :, -1]
        elif draw(st.booleans()):
            key = pixels[0, 0]
            options["transparent"] = tuple(map(int, key)) if color == 2 else int(key[0])
            out[(pixels == key).all(axis=2), 3] = 0
    file = io.BytesIO()
    writer = png.Writer(
        width, height, bitdepth=depth, interlace=draw(st.booleans()), chunk_limit=200, **options
    )
    writer.write(file, pixels.reshape(height, -1).tolist())
    return file.getvalue(), out


@settings(deadline=None, max_examples=150)
@given(random_png())
def test_every_kind_of_png_gives_its_codes(made):
    data, expected = made
    image = read_image("any", data)
    assert image.pixels.dtype == (np.uint16 if data[24] == 16 else np.uint8)
    assert np.array_equal(image.pixels, expected)


def filtered(rows: np.ndarray, step: int, kinds: list[int]) -> bytes:
    """Rows (h, n) of bytes under the filters of section 9 of the specification, one for each."""
    rows = rows.astype(int)
    up = np.vstack([np.zeros_like(rows[:1]), rows[:-1]])
    left = np.pad(rows, ((0, 0), (step, 0)))[:, : rows.shape[1]]
    corner = np.pad(up, ((0, 0), (step, 0)))[:, : rows.shape[1]]
    p = left + up - corner
    pa, pb, pc = abs(p - left), abs(p - up), abs(p - corner)
    paeth = np.where((pa <= pb) & (pa <= pc), left, np.where(pb <= pc, up, corner))
    guesses = [np.zeros_like(rows), left, up, (left + up) // 2, paeth]
    coded = [
        bytes([kind, *((row - guesses[kind][i]) % 256)])
        for i, (row, kind) in enumerate(zip(rows, kinds))
    ]
    return b"".join(coded)


@pytest.mark.parametrize("color", sorted(DEPTHS))
def test_every_row_filter(color):
    rng = np.random.default_rng(color)
    depth = DEPTHS[color][-1]
    step = CHANNELS[color] * depth // 8
    kinds = [3, 4, 1, 2, 0, 4, 3, 4, 2, 1, 1]  # the first row has nothing above it
    rows = rng.integers(0, 256, (11, 7 * step))
    rows[:, 2 * step :] %= 5  # small numbers, so that Paeth's three distances tie
    extra = [chunk(b"PLTE", bytes(range(256)) * 3)] if color == 3 else []
    data = [chunk(b"IDAT", zlib.compress(filtered(rows, step, kinds)))]
    found = read_image("f", make_png(header(7, 11, depth, color), *extra, *data))
    plain = [chunk(b"IDAT", zlib.compress(filtered(rows, step, [0] * 11)))]
    expected = read_image("f", make_png(header(7, 11, depth, color), *extra, *plain))
    assert np.array_equal(found.pixels, expected.pixels)
    if color == 6:
        assert np.array_equal(found.pixels.astype(">u2").view(np.uint8).reshape(11, -1), rows)
    bad = make_png(header(7, 11, depth, color), *extra, chunk(b"IDAT", zlib.compress(b"\5" * 700)))
    refused(bad, "cannot be read as PNG")


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("size", [(1, 1), (37, 23), (3, 9001)])
def test_png_bytes_round_trip_and_other_readers(dtype, size):
    rng = np.random.default_rng(5)
    pixels = rng.integers(0, np.iinfo(dtype).max + 1, (*size, 4)).astype(dtype)
    data = png_bytes(Image("a", pixels))
    again = read_image("a", data)
    assert again.pixels.dtype == dtype
    assert np.array_equal(again.pixels, pixels)
    _, _, rows, _ = png.Reader(bytes=data).read()
    assert np.array_equal(np.array([list(row) for row in rows]).reshape(pixels.shape), pixels)
    if dtype is np.uint8:
        with PillowImage.open(io.BytesIO(data)) as file:
            assert np.array_equal(np.asarray(file), pixels)


def test_png_bytes_are_fixed():
    """Written by hand after RFC 1950 and 1951: one stored block, filter 0 before each row."""
    raw = bytes([0, 1, 2, 3, 4, 0, 5, 6, 7, 8])
    stream = b"\x78\x01\x01\x0a\x00\xf5\xff" + raw + struct.pack(">I", zlib.adler32(raw))
    expected = make_png(header(1, 2), chunk(b"IDAT", stream))
    pixels = np.arange(1, 9, dtype=np.uint8).reshape(2, 1, 4)
    assert png_bytes(Image("x", pixels)) == png_bytes(Image("y", pixels)) == expected


GOOD = make_png(header(2, 3), chunk(b"IDAT", zlib.compress(bytes(27))))
INDEX_1 = chunk(b"IDAT", zlib.compress(b"\0\1"))


def corrupt(data: bytes, at: int) -> bytes:
    return data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]


BAD_PNG = {
    "empty": (b"", "empty"),
    "text": (b"hello", "PNG, JPEG or WebP"),
    "GIF": (b"GIF89a" + bytes(20), "GIF89a"),
    "DDS": (b"DDS " + bytes(120), "convert"),
    "signature only": (images.SIGNATURE, "header"),
    "no IDAT": (make_png(header(2, 3)), "expected"),
    "no IHDR": (make_png(chunk(b"IDAT", b"")), "header"),
    "second IHDR": (make_png(header(2, 3), header(2, 3)), "expected"),
    "depth": (make_png(header(2, 3, depth=4)), "expected"),
    "interlace": (make_png(header(2, 3, interlace=2)), "expected"),
    "zero side": (make_png(header(0, 3)), "0 × 3"),
    "wide": (make_png(header(16385, 1)), "16384"),
    "huge": (make_png(header(2**32 - 1, 2**32 - 1)), "scale it down"),
    "area": (make_png(header(16384, 16384)), "67108864"),
    "cut": (make_png(header(4096, 4096), chunk(b"IDAT", zlib.compress(bytes(99)))), "cut short"),
    "bomb": (make_png(header(8192, 8192), chunk(b"IDAT", zlib.compress(bytes(99)))), "image bomb"),
    "header checksum": (corrupt(GOOD, 18), "expected"),
    "data checksum": (corrupt(GOOD, len(GOOD) - 14), "expected"),
    "stream": (make_png(header(2, 3), chunk(b"IDAT", b"x" * 40)), "expected"),
    "short": (make_png(header(2, 3), chunk(b"IDAT", zlib.compress(bytes(26)))), "expected"),
    "critical": (make_png(header(2, 3), chunk(b"JDAT", b"")), "expected"),
}


@pytest.mark.parametrize("name", BAD_PNG)
def test_bad_png_is_one_silent_line(name, recwarn, capfd):
    data, word = BAD_PNG[name]
    refused(data, word)
    assert not recwarn.list
    assert capfd.readouterr() == ("", "")


def test_every_truncation_of_a_png_is_refused():
    assert read_image("good", GOOD).size == (2, 3)
    assert read_image("padded", GOOD + bytes(3)).size == (2, 3)  # to a multiple of 4
    for length in range(len(GOOD) - 12):  # the end chunk carries nothing
        refused(GOOD[:length])


def test_an_animated_png_is_refused():
    frames = [PillowImage.new("RGB", (5, 3), color) for color in ("red", "blue")]
    file = io.BytesIO()
    frames[0].save(file, "PNG", save_all=True, append_images=frames[1:])
    refused(file.getvalue(), "animated")


def test_text_chunk_bomb_is_not_inflated():
    bomb = zlib.compress(bytes(2**26))
    text = [chunk(b"zTXt", b"a\0\0" + bomb), chunk(b"iCCP", b"p\0\0" + bomb), chunk(b"gAMA", b"?")]
    data = make_png(header(2, 3), *text, chunk(b"IDAT", zlib.compress(bytes(27))))
    tracemalloc.start()
    refused(data)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2**24


def test_a_small_file_takes_little_memory():
    """8192 × 8192 × 8 bytes are 2²⁹: the size is allowed, the file cannot inflate to it."""
    data = make_png(header(8192, 8192, 16), chunk(b"IDAT", zlib.compress(bytes(2**20))))
    tracemalloc.start()
    refused(data)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2**23


# --------------------------------------------------------------- JPEG and WebP


def encoded(kind: str, mode: str = "RGB", **options: Any) -> bytes:
    file = io.BytesIO()
    PillowImage.new(mode, (13, 7), 200 if mode == "L" else (200, 100, 50, 25)[: len(mode)]).save(
        file, kind, **options
    )
    return file.getvalue()


def test_jpeg_and_webp():
    # A constant image is one DC coefficient a block: 200 survives, colours to the rounding of
    # JPEG's YCbCr, 2 codes.
    grey = read_image("g", encoded("JPEG", "L")).pixels
    assert grey.shape == (7, 13, 4)
    assert (grey == [200, 200, 200, 255]).all()
    rgb = read_image("c", encoded("JPEG")).pixels.astype(int)
    assert abs(rgb - [200, 100, 50, 255]).max() <= 2
    turned = PillowImage.Exif()
    turned[0x0112] = 6  # EXIF "rotate by 90°", ignored
    assert read_image("e", encoded("JPEG", exif=turned)).size == (13, 7)
    lossless = read_image("w", encoded("WEBP", "RGBA", lossless=True, exact=True)).pixels
    assert (lossless == [200, 100, 50, 25]).all()
    assert (read_image("w", encoded("WEBP", lossless=True)).pixels == [200, 100, 50, 255]).all()


def patched_jpeg(width: int, height: int) -> bytes:
    data = bytearray(encoded("JPEG"))
    at = data.index(b"\xff\xc0") + 5
    data[at : at + 4] = struct.pack(">HH", height, width)
    return bytes(data)


def webp(kind: bytes, body: bytes) -> bytes:
    inner = b"WEBP" + kind + struct.pack("<I", len(body)) + body
    return b"RIFF" + struct.pack("<I", len(inner)) + inner


def animated_webp() -> bytes:
    frames = [PillowImage.new("RGB", (5, 3), (v, 0, 0)) for v in (0, 255)]
    file = io.BytesIO()
    frames[0].save(file, "WEBP", save_all=True, append_images=frames[1:])
    return file.getvalue()


BAD_OTHER = {
    "jpeg cut": (encoded("JPEG")[:-20], "JPEG"),
    "jpeg head": (encoded("JPEG")[:30], "JPEG"),
    "jpeg wide": (patched_jpeg(20000, 9), "20000 × 9"),
    "jpeg bomb": (patched_jpeg(16000, 16000), "67108864"),
    "jpeg 2 bombs": (patched_jpeg(10000, 9999), "10000 × 9999"),  # where Pillow only warns
    "jpeg zero": (patched_jpeg(0, 9), "expected"),
    "jpeg cmyk": (encoded("JPEG", "CMYK"), "CMYK"),
    "webp cut": (encoded("WEBP")[:-9], "WEBP"),
    "webp head": (b"RIFF\0\0\0\0WEBP", "expected"),
    "webp VP8X": (webp(b"VP8X", bytes(4) + b"\xff" * 6), "16777216 × 16777216"),
    "webp VP8L": (webp(b"VP8L", b"\x2f" + b"\xff" * 4), "16384 × 16384"),
    "webp VP8": (webp(b"VP8 ", b"\0\0\0\x9d\x01\x2a\xff\x3f\xff\x3f"), "16383 × 16383"),
    "webp animated": (animated_webp(), "animated"),
}


@pytest.mark.parametrize("name", BAD_OTHER)
def test_bad_jpeg_or_webp_is_one_silent_line(name, recwarn, capfd):
    data, word = BAD_OTHER[name]
    refused(data, word)
    assert not recwarn.list
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "WEBP"])
def test_damaged_images_never_raise_anything_else(kind, recwarn):
    rng = np.random.default_rng(8)
    data = np.frombuffer(encoded(kind), np.uint8)
    loaded = 0
    for _ in range(400):
        bad = data.copy()
        bad[rng.integers(0, len(bad), 3)] = rng.integers(0, 256, 3)
        try:
            read_image("x", bad.tobytes())
            loaded += 1
        except FileError as error:
            assert "\n" not in str(error)
    assert loaded < 400
    assert not recwarn.list


# ----------------------------------------------------------------- files beside


@pytest.fixture
def asset(tmp_path: Path) -> Path:
    folder = tmp_path / "in"
    (folder / "sub").mkdir(parents=True)
    (tmp_path / "secret").write_bytes(b"secret")
    (folder / "a b.bin").write_bytes(b"beside")
    (folder / "sub" / "c.bin").write_bytes(b"below")
    return folder / "model.gltf"


def beside_fails(asset: Path, reference: str, word: str, **options: Any) -> None:
    with pytest.raises(FileError) as caught:
        read_beside(asset, reference, LoadOptions(**options))
    message = str(caught.value)
    assert message.startswith(f"{asset}: ")
    assert word in message, message
    assert "expected" in message
    assert "\n" not in message
    assert len(message) < len(str(asset)) + 400


def test_files_in_the_folder_are_read(asset):
    assert read_beside(asset, "a b.bin", LoadOptions()) == b"beside"
    assert read_beside(asset, "./sub/c.bin", LoadOptions()) == b"below"


OUTSIDE = ["../secret", "sub/../../secret", "sub/../a b.bin", "..", "link", "linked/secret"]


@pytest.mark.parametrize(
    "reference", [*OUTSIDE, "{0}/secret", "C:secret", "..\\secret", "\\secret"]
)
def test_references_that_leave_the_folder_are_refused(asset, reference):
    (asset.parent / "link").symlink_to("../secret")
    (asset.parent / "linked").symlink_to("..", target_is_directory=True)
    beside_fails(asset, reference.format(asset.parents[1]), "allow_outside")


def test_outside_is_allowed_on_demand(asset):
    (asset.parent / "link").symlink_to("../secret")
    options = LoadOptions(allow_outside=True)
    for reference in ("../secret", "link", str(asset.parents[1] / "secret")):
        assert read_beside(asset, reference, options) == b"secret"
    beside_fails(asset, "../none", "missing", allow_outside=True)


@pytest.mark.parametrize("outside", [False, True])
def test_what_is_no_file_is_refused(asset, outside, monkeypatch):
    for url in ("https://example.org/a", "file:///etc/passwd", "//host/a", "javascript:1"):
        beside_fails(asset, url, "URL", allow_outside=outside)
    beside_fails(asset, "missing\nfile.bin", "missing", allow_outside=outside)
    beside_fails(asset, "a\0b", "no file name", allow_outside=outside)
    beside_fails(asset, "", "no file name", allow_outside=outside)
    beside_fails(asset, "x" * 5000, "cannot be read", allow_outside=outside)
    beside_fails(asset, "sub", "folder", allow_outside=outside)
    (asset.parent / "loop").symlink_to("loop")
    beside_fails(asset, "loop", "expected", allow_outside=outside)
    os.mkfifo(asset.parent / "pipe")
    beside_fails(asset, "pipe", "pipe", allow_outside=outside)
    monkeypatch.setattr(beside_module, "MAX_BESIDE_BYTES", 5)
    beside_fails(asset, "a b.bin", "6 bytes", allow_outside=outside)
    assert read_beside(asset, "sub/c.bin", LoadOptions()) == b"below"


def test_devices_are_refused(asset):
    beside_fails(asset, "/dev/zero", "device", allow_outside=True)


def test_a_sparse_file_over_the_limit_is_not_read(asset):
    with (asset.parent / "big").open("wb") as file:
        file.truncate(2**28 + 1)
    beside_fails(asset, "big", "268435457 bytes")


# ---------------------------------------------------------------------- options


@pytest.mark.parametrize(
    ("name", "value"),
    [("normals", "round"), ("normals", None), ("up", "x"), ("unit", "km"), ("unit", 1),
     ("strict", 1), ("allow_outside", None), ("scene", -1), ("scene", 1.0), ("scene", True)],
)  # fmt: skip
def test_bad_options(name, value):
    with pytest.raises(SettingsError, match=f"{name} is {value!r}; expected "):
        LoadOptions(**{name: value})


def test_good_options():
    options = LoadOptions(normals="crease", up="z", unit="inch", strict=True, scene="a")
    assert options.scene == "a"
    assert LoadOptions() == LoadOptions(scene=None, unit=None)


def test_strict_refuses_what_is_not_drawn():
    lax, strict = LoadOptions(), LoadOptions(strict=True)
    check_strict(Path("a.glb"), LoadReport(format="glTF", triangles=3, degenerate=2), strict)
    for field in ("skipped", "fallbacks", "unsupported"):
        report = LoadReport(format="glTF", **{field: ("one", "two", "three", "four")})
        check_strict(Path("a.glb"), report, lax)
        with pytest.raises(FileError, match=r"a\.glb: .*one; two; three and 1 more; expected"):
            check_strict(Path("a.glb"), report, strict)

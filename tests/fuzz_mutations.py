"""Damage to files: bytes, numbers and lines of text, JSON, and what checksums would hide.

Everything is drawn from the `random.Random` given, so a case is its seed.
"""

from __future__ import annotations

import copy
import io
import json
import random
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from typing import Any

from fuzz_files import zipped

NUMBER = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
NUMBERS = (
    "-1", "0", "1", "2", "127", "255", "256", "65535", "65536", "2147483647", "2147483648",
    "4294967295", "4294967296", "9223372036854775808", "1e308", "-1e308", "1e39", "1e-320", "1e999",
    "nan", "inf", "-inf", "NaN", "Infinity", "0.5", "-0", "1_0", "0x10", "9" * 30, "9" * 5000, "",
    "x", "\u0663",
)  # fmt: skip
VALUES = (
    None, True, False, -1, 0, 1, 2, 3, 255, 2**31, 2**32, 2**53, 2**63, 10**40, -0.5, 1e308, 1e-320,
    float("nan"), float("inf"), "", "x", "../m.bin", "/etc/passwd", "C:\\x", "file:///x", "m.gltf",
    "data:,", "a\nb\x00\x1b", "\ud800", [], [0], [[]], {}, {"index": 0}, [0] * 16, "x" * 2000,
)  # fmt: skip
WORDS = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 2**31 - 1, 2**31, 2**32 - 1, 0x7F800000,
         0xFF800000, 0x7FC00000, 0x7F7FFFFF, 1)  # fmt: skip
MOST = 40_000
"""Files do not grow beyond it: what must be bounded is what is made of a small file."""


def mutated(rng: random.Random, name: str, data: bytes, others: list[bytes]) -> bytes:
    """The file `name` with one to four changes; `others` are spliced in."""
    kinds = _BY_SUFFIX.get(name.rpartition(".")[2], (_bytes,))
    for _ in range(rng.choice((1, 1, 1, 2, 3, 4))):
        change = rng.choice(kinds)
        data = change(rng, data, others)[:MOST]
    return data


def _span(rng: random.Random, size: int, most: int) -> tuple[int, int]:
    start = rng.randrange(size + 1)
    return start, min(size, start + rng.randint(1, most))


def _bytes(rng: random.Random, data: bytes, others: list[bytes]) -> bytes:
    if not data:
        return rng.randbytes(9)
    kind = rng.randrange(8)
    out = bytearray(data)
    a, b = _span(rng, len(data), rng.choice((1, 4, 16, 300)))
    if kind == 0:
        for _ in range(rng.randint(1, 4)):
            out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    elif kind == 1:
        out[a:b] = bytes([rng.choice((0, 0x20, 0x7F, 0x80, 0xFF))]) * (b - a)
    elif kind == 2:
        out[a:b] = rng.randbytes(b - a)
    elif kind == 3:
        return data[: rng.randrange(len(data))]
    elif kind == 4:
        del out[a:b]
    elif kind == 5:
        out[a:a] = data[a:b] * rng.choice((1, 1, 2, 30))
    elif kind == 6:  # one word of what a header may hold
        at = rng.randrange(len(out)) & (-1 if rng.random() < 0.5 else -4)
        order = rng.choice("<>")
        out[at : at + 4] = struct.pack(order + "I", rng.choice(WORDS))
    else:
        other = rng.choice(others)
        c, d = _span(rng, len(other), 2000)
        out = bytearray(rng.choice((data[:a] + other[c:], data[:a] + other[c:d] + data[b:])))
    return bytes(out)


def _text(rng: random.Random, data: bytes, others: list[bytes]) -> bytes:
    kind = rng.randrange(7)
    numbers = list(NUMBER.finditer(data))
    if kind < 3 and numbers:
        found = rng.choice(numbers)
        return data[: found.start()] + rng.choice(NUMBERS).encode() + data[found.end() :]
    if kind == 3 and len(numbers) > 1:  # swap two numbers
        i, j = sorted(rng.sample(range(len(numbers)), 2))
        a, b = numbers[i], numbers[j]
        between = data[a.end() : b.start()]
        return data[: a.start()] + b[0] + between + a[0] + data[b.end() :]
    if kind == 4:  # words
        words = re.split(rb"(\s+)", data)
        i, j = rng.randrange(len(words)), rng.randrange(len(words))
        if rng.random() < 0.5:
            words[i], words[j] = words[j], words[i]
        else:
            words[i] = b""
        return b"".join(words)
    lines = data.splitlines(keepends=True) or [b""]
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    if kind == 5:
        lines[i], lines[j] = lines[j], lines[i]
    else:
        lines[i:i] = [lines[j]] * rng.choice((1, 1, 3, 50))
        if rng.random() < 0.5:
            del lines[j]
    return b"".join(lines)


# ------------------------------------------------------------------------ JSON


def _json_root(rng: random.Random, root: Any) -> Any:
    """One change to a random place of a tree of lists and objects."""
    root = copy.deepcopy(root)
    places: list[tuple[Any, Any]] = []
    todo = [root]
    while todo:
        here = todo.pop()
        keys = list(here) if isinstance(here, dict) else range(len(here))
        for key in keys:
            places.append((here, key))
            if isinstance(here[key], dict | list):
                todo.append(here[key])
    if not places:
        return rng.choice(VALUES)
    here, key = rng.choice(places)
    there, other = rng.choice(places)
    kind = rng.randrange(8)
    old = here[key]
    if kind == 0:
        del here[key]
    elif kind == 1:
        here[key], there[other] = there[other], here[key]
        if _circular(root):
            here[key] = None
    elif kind == 2:
        here[key] = [old] * rng.choice((1, 2, 7))
    elif kind == 3:
        here[key] = {rng.choice(("index", "mesh", "extensions", "name", "")): old}
    elif kind == 4 and isinstance(old, int | float):
        here[key] = old + rng.choice((-2, -1, 1, 2, 0.5, 1000))
    elif kind == 5 and isinstance(here, list):
        here.insert(rng.randrange(len(here) + 1), copy.deepcopy(old))
    else:
        here[key] = rng.choice(VALUES)
    return root


def _circular(root: Any) -> bool:
    try:
        json.dumps(root)
    except (ValueError, RecursionError):
        return True
    return False


def _dumped(root: Any) -> bytes:
    return json.dumps(root).encode()


def _json(rng: random.Random, data: bytes, others: list[bytes]) -> bytes:
    try:
        root = json.loads(data)
        return _dumped(_json_root(rng, root))
    except (ValueError, RecursionError, TypeError):
        return _text(rng, data, others)


def _glb(rng: random.Random, data: bytes, others: list[bytes]) -> bytes:
    """Change the JSON or the binary chunk of a GLB, all lengths right."""
    try:
        size = struct.unpack("<I", data[12:16])[0]
        text, binary = data[20 : 20 + size], data[28 + size :]
        if rng.random() < 0.75:
            text = _json(rng, text, others)
        else:
            binary = _bytes(rng, binary, others)
    except struct.error:
        return _bytes(rng, data, others)
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    body += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


# ------------------------------------------- images and archives, checksums made right


def _png(rng: random.Random, data: bytes, others: list[bytes]) -> bytes:
    """Change one chunk's body, or what IDAT unpacks to, and make its length and checksum right."""
    chunks: list[tuple[bytes, bytes]] = []
    at = 8
    while at + 12 <= len(data):
        size = int.from_bytes(data[at : at + 4], "big")
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + size]))
        at += 12 + size
    if not chunks:
        return _bytes(rng, data, others)
    i = rng.randrange(len(chunks))
    kind, body = chunks[i]
    action = rng.randrange(4)
    if action == 0:
        chunks.insert(rng.randrange(len(chunks) + 1), chunks[i])
    elif action == 1:
        del chunks[i]
    elif kind == b"IDAT" and action == 2:
        try:
            chunks[i] = (kind, zlib.compress(_bytes(rng, zlib.decompress(body), others)))
        except zlib.error:
            chunks[i] = (kind, b"")
    else:
        chunks[i] = (kind, _bytes(rng, body, others))
    out = [data[:8]]
    for kind, body in chunks:
        out += [struct.pack(">I", len(body)), kind, body]
        out.append(struct.pack(">I", zlib.crc32(kind + body)))
    return b"".join(out)


def _threemf(rng: random.Random, data: bytes, others: list[bytes]) -> bytes:
    """Change the model's XML within a sound archive."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            parts = {name: archive.read(name) for name in archive.namelist()}
    except Exception:  # damaged by an earlier change: whatever zipfile says, bytes are left
        return _bytes(rng, data, others)
    if not parts:
        return _bytes(rng, data, others)
    name = list(parts)[-1]
    change = rng.choice((_text, _text, _text, _bytes))
    parts[name] = change(rng, parts[name], others)
    return zipped(parts)


_Change = Callable[[random.Random, bytes, list[bytes]], bytes]
_BY_SUFFIX: dict[str, tuple[_Change, ...]] = {
    "glb": (_glb, _glb, _glb, _bytes),
    "gltf": (_json, _json, _text, _bytes),
    "obj": (_text, _text, _bytes),
    "mtl": (_text, _text, _bytes),
    "ply": (_text, _bytes),
    "stl": (_text, _bytes),
    "off": (_text, _text, _bytes),
    "3mf": (_threemf, _threemf, _bytes),
    "png": (_png, _bytes),
}

"""The maps of MTL statements: their options, their images, and scalar maps packed into channels.

Options that have a place in `Texture` are used: `-o u v`, `-s u v` (u' = s·u + o), `-clamp on` and
`-imfchan r|g|b|m` (m is alpha). Others are reported. Windows' backslashes are read as slashes.

Source: Alias/Wavefront, "MTL material format", "Options for texture map statements".
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import FileError
from ..texture import Image, Texture, WrapName
from ..typed import AnyArray
from .beside import read_beside
from .images import read_image
from .options import LoadOptions

MAX_IMAGE_BYTES = 2**29
"""Of all images of one file, decoded."""

_SWITCHES = ("-blendu", "-blendv", "-cc", "-clamp")
_WORDS = {"-imfchan": 1, "-type": 1, "-texres": 1, "-bm": 1, "-boost": 1, "-mm": 2}
_VECTORS = {"-o": 0.0, "-s": 1.0, "-t": 0.0}
_CHANNELS = {"r": 0, "g": 1, "b": 2, "m": 3}


class Map(NamedTuple):
    """A map statement; image: its number, channel: of a scalar map, None where none is named."""

    image: int
    wrap: WrapName
    offset: tuple[float, float]
    scale: tuple[float, float]
    channel: int | None

    def texture(self, image: int | None = None) -> Texture:
        """The texture, of another image if one is given, for the file's coordinates (v up)."""
        (u, v), (scale_u, scale_v) = self.offset, self.scale
        return Texture(
            self.image if image is None else image,
            wrap=(self.wrap, self.wrap),
            offset=(u, 1.0 - v),  # v down: v' = 1 − (s·v + o)
            scale=(scale_u, -scale_v),
        )


class Statement(NamedTuple):
    """A map statement as written; ignored: options that are not used."""

    reference: str
    wrap: WrapName
    offset: tuple[float, float]
    scale: tuple[float, float]
    channel: int | None
    ignored: list[str]


def parse_statement(rest: str) -> Statement:
    """Options, then a file name that may hold spaces."""
    words = rest.split()
    vectors = {option: [default] * 3 for option, default in _VECTORS.items()}
    wrap: WrapName = "repeat"
    channel: int | None = None
    ignored: dict[str, None] = {}
    i = 0
    while i < len(words) - 1 and words[i].lower() in (*_SWITCHES, *_WORDS, *_VECTORS):
        option = words[i].lower()
        i += 1
        if option in _VECTORS:
            for k in range(3):
                if i < len(words) - 1 and is_number(words[i]):
                    vectors[option][k] = float(words[i])
                    i += 1
        elif option in _SWITCHES:
            if option == "-clamp":
                wrap = "clamp" if words[i].lower() == "on" else "repeat"
            elif option == "-cc" and words[i].lower() == "on":
                ignored[option] = None
            i += 1
        else:
            values = [word.lower() for word in words[i : i + _WORDS[option]]]
            if option == "-imfchan" and values[0] in _CHANNELS:
                channel = _CHANNELS[values[0]]
            elif option != "-type" and values not in (["0", "1"], ["l"]):
                ignored[option] = None
            i += _WORDS[option]
    if any(vectors["-t"]):
        ignored["-t"] = None
    return Statement(
        plain_reference(" ".join(words[i:]).strip('"')),
        wrap,
        (vectors["-o"][0], vectors["-o"][1]),
        (vectors["-s"][0], vectors["-s"][1]),
        channel,
        list(ignored),
    )


class MapImages:
    """The images of one file, each read once; MAX_IMAGE_BYTES in all."""

    def __init__(self, path: Path, options: LoadOptions) -> None:
        self.images: list[Image] = []
        self._path = path
        self._options = options
        self._numbers: dict[str, int] = {}
        self._errors: dict[str, FileError] = {}
        self._packed: dict[tuple[tuple[int, int] | None, ...], int] = {}
        self._bytes = 0

    def read(self, reference: str) -> int:
        """The number of the image beside the file. Raises FileError, the same one each time."""
        if reference in self._errors:
            raise self._errors[reference]
        if reference not in self._numbers:
            try:
                data = read_beside(self._path, reference, self._options)
                room = MAX_IMAGE_BYTES - self._bytes
                self._numbers[reference] = self._add(read_image(reference, data, room=room))
            except FileError as error:
                self._errors[reference] = error
                raise
        return self._numbers[reference]

    def _add(self, image: Image) -> int:
        self._bytes += image.pixels.nbytes
        self.images.append(image)
        return len(self.images) - 1

    def has_alpha(self, number: int) -> bool:
        """Whether any texel is not opaque."""
        pixels = self.images[number].pixels
        return bool((pixels[:, :, 3] != np.iinfo(pixels.dtype).max).any())

    def same_layout(self, a: Map, b: Map) -> bool:
        """Whether two maps can be channels of one image."""
        return self.images[a.image].size == self.images[b.image].size and a[1:4] == b[1:4]

    def pack(self, planes: Sequence[tuple[int, int] | None]) -> int:
        """An image of four (image, channel) planes of one size; None: the greatest code.

        8-bit codes are widened to 16 where a plane has 16 (·257, exact). Raises FileError.
        """
        key = tuple(planes)
        if key not in self._packed:
            named = [plane for plane in planes if plane is not None]
            sources = [self.images[number].pixels for number, _ in named]
            wide = any(source.dtype == np.uint16 for source in sources)
            pixels: AnyArray = np.full(sources[0].shape, 65535 if wide else 255, np.uint16)
            for k, plane in enumerate(planes):
                if plane is not None:
                    codes = self.images[plane[0]].pixels[:, :, plane[1]]
                    widen = 257 if wide and codes.dtype == np.uint8 else 1
                    pixels[:, :, k] = codes.astype(np.uint16) * np.uint16(widen)
            names = dict.fromkeys(self.images[number].name for number, _ in named)
            image = Image(" + ".join(names), pixels if wide else pixels.astype(np.uint8))
            self._packed[key] = self._add(image)
        return self._packed[key]


def plain_reference(name: str) -> str:
    """The name with slashes and without "." and empty parts, so that a file has one name.

    The same file under many names would be read many times.
    """
    name = name.replace("\\", "/")
    root = name[: len(name) - len(name.lstrip("/"))]
    return root + "/".join(part for part in name.split("/") if part not in ("", "."))


def is_number(word: str) -> bool:
    """Whether a word is a finite number."""
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False
